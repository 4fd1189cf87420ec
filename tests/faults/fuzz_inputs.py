"""Mutants of stills and field reports, each read by a fork with 2 GB of memory and 20 s.

    python tests/faults/fuzz_inputs.py [--count 3000] [--seed 0] [--only NAME] [FILE...]

Without files: a still of every format that is read, made here, and ../shared's field reports. The
mutant `n` of a run is that of seed and n alone, so `--only-number n` makes it again. Wrong is any
error that is not one of ours (a traceback), a signal, a hang, more memory, and a clip that is read
without a word though frames of it are missing or of another size than it says.
"""

from __future__ import annotations

import argparse
import io
import os
import random
import resource
import signal
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

import numpy as np
from clips import SHARED
from fuzz import mutate

MEMORY_BYTES, SECONDS = 2 << 30, 20
WHOLE, REFUSED, SHORT, WRONG, FLAT = 0, 1, 2, 3, 4
WRONGS = {
    WRONG: "a frame of another size than told", FLAT: "a part of the picture is missing",
    99: "a traceback",
}  # fmt: skip


def made_stills(folder: Path) -> list[Path]:
    """A still of every format, and an animation of each kind, in a folder."""
    import pillow_heif
    from PIL import Image

    pillow_heif.register_heif_opener()
    y, x = np.mgrid[:48, :64]
    waves = np.dstack([128 + 100 * np.sin(x / (4 + i) + y / 6) for i in range(3)])
    picture = Image.fromarray(waves.astype(np.uint8))
    moved = [Image.fromarray(np.roll(waves, 5 * n, 1).astype(np.uint8)) for n in range(4)]
    forms: dict[str, tuple[str, dict[str, Any]]] = {
        "a.jpg": ("JPEG", {}), "progressive.jpg": ("JPEG", {"progressive": True}),
        "a.png": ("PNG", {}), "raw.tif": ("TIFF", {}), "lzw.tif": ("TIFF", {"compression":
        "tiff_lzw"}), "zip.tif": ("TIFF", {"compression": "tiff_adobe_deflate"}),
        "jpeg.tif": ("TIFF", {"compression": "jpeg"}), "a.webp": ("WEBP", {}),
        "lossless.webp": ("WEBP", {"lossless": True}), "a.gif": ("GIF", {}), "a.bmp": ("BMP", {}),
        "a.ppm": ("PPM", {}), "a.jp2": ("JPEG2000", {}), "a.avif": ("AVIF", {}),
        "a.heic": ("HEIF", {}), "a.qoi": ("QOI", {}),
    }  # fmt: skip
    paths = []
    for name, (form, options) in forms.items():
        data = io.BytesIO()
        picture.save(data, form, **options)
        paths.append(folder / name)
        paths[-1].write_bytes(data.getvalue())
    for name, form in (("b.gif", "GIF"), ("b.webp", "WEBP"), ("b.png", "PNG"), ("b.avif", "AVIF")):
        paths.append(folder / name)
        moved[0].save(paths[-1], form, save_all=True, append_images=moved[1:], duration=80)
    return paths


def field_reports() -> list[Path]:
    """The files of ../shared's field reports, where they are."""
    folder = SHARED / "data/field_reports"
    return sorted(p for p in folder.rglob("*.*") if p.suffix not in (".md", ".exr"))


def flat_part(planes: tuple[np.ndarray, ...]) -> float:
    """How much of a picture is rows of one colour: what decoders fill a missing part with."""
    return float(np.mean([np.ptp(plane, axis=1) == 0 for plane in planes[:3]]))


def read_whole(path: Path, flat: float = 1) -> int:
    """Read a clip as `convert` does; WHOLE only if each of its frames came, of the size it says.

    FLAT where a still has more rows of one colour than the part `flat`, which its original has.
    """
    from itmo_video.errors import DamagedInputError, ItmoError
    from itmo_video.source.opening import open_clip

    try:
        with open_clip(path) as clip:
            seen = 0
            for frame in clip.frames():
                seen += not frame.is_damaged
                if frame.size != clip.info.display_size:
                    return WRONG
                if clip.info.container == "image" and flat_part(frame.planes) > flat + 0.1:
                    return FLAT
            is_short = (clip.info.frames_declared or 0) > clip.info.frames
            return SHORT if seen < clip.info.frames or is_short else WHOLE
    except DamagedInputError:
        return SHORT
    except ItmoError:
        return REFUSED


def run_one(path: Path, flat: float = 1) -> tuple[int | str, str]:
    """What became of a mutant, in a fork: one of the codes or what went wrong, and its errors."""
    with tempfile.TemporaryFile() as told:
        child = os.fork()
        if child == 0:
            os.dup2(told.fileno(), 2)
            resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
            signal.alarm(SECONDS)
            try:
                os._exit(read_whole(path, flat))
            except BaseException:
                import traceback

                traceback.print_exc()
                os._exit(99)
        _, status = os.waitpid(child, 0)
        told.seek(0)
        errors = told.read().decode("utf-8", "replace")
    if os.WIFSIGNALED(status):
        number = os.WTERMSIG(status)
        return "it hangs" if number == signal.SIGALRM else f"signal {number}", errors
    code = os.WEXITSTATUS(status)
    return WRONGS.get(code, code), errors


def flat_of(path: Path) -> float:
    """The part of a whole still that is rows of one colour; 1 for all else."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        from itmo_video.source.opening import open_clip

        try:
            with open_clip(path) as clip:
                part = flat_part(next(iter(clip.frames())).planes)
                is_still = clip.info.container == "image"
            os.write(writing, str(part if is_still else 1).encode())
        finally:
            os._exit(0)
    os.close(writing)
    with os.fdopen(reading) as told:
        part = float(told.read() or 1)
    os.waitpid(child, 0)
    return part


def failures(
    files: list[Path], count: int, seed: int, only: int | None = None
) -> Iterator[tuple[int, str, str]]:
    """(number, what is wrong, standard error) of mutants that were not treated as they should."""
    import itmo_video.source.opening  # noqa: F401 - so that forks have it

    codes: Counter[str] = Counter()
    flats = {path: flat_of(path) for path in files}
    with tempfile.TemporaryDirectory() as name:
        for number in range(count) if only is None else (only,):
            original = files[number % len(files)]
            data = mutate(original.read_bytes(), random.Random(f"{seed} {number}"))
            mutant = Path(name) / f"m{original.suffix}"
            mutant.write_bytes(data)
            outcome, errors = run_one(mutant, flats[original])
            words: dict[int | str, str] = {WHOLE: "whole", REFUSED: "refused", SHORT: "short"}
            word = words.get(outcome, str(outcome))
            codes[word] += 1
            if isinstance(outcome, str):
                yield number, f"{original.name}: {outcome}", errors
    print(dict(codes), file=sys.stderr)


def main() -> int:
    """Run all and tell."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("files", nargs="*", type=Path)
    parser.add_argument("--count", type=int, default=3000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only-number", type=int)
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        files = args.files or [*made_stills(Path(name)), *field_reports()]
        bad = 0
        for number, what, errors in failures(files, args.count, args.seed, args.only_number):
            bad += 1
            print(f"mutant {number}: {what}\n{errors[-3000:]}", flush=True)
    print(f"{args.count} mutants of {len(files)} files, seed {args.seed}: {bad} failures")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
