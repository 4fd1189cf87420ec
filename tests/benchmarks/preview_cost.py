"""CPU time a frame of an on-the-fly preview against its encoder alone, fed with ready frames.

    python tests/benchmarks/preview_cost.py [CLIP] [--frames N] [--codec av1] [--speeds 5,6,8]

Without a clip it makes one of 1080p. Prints CPU milliseconds a frame, their ratio, and the peak of
memory of a preview in a process of its own.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tempfile
import time
from contextlib import closing
from pathlib import Path
from typing import Any

from against_ffmpeg import make_clip
from kernels_run import add_plain, require_kernels

from itmo_video import RunOptions, make_settings
from itmo_video.delivery.film_spec import FilmSpec
from itmo_video.delivery.film_writer import FilmWriter
from itmo_video.delivery.hdr import Light
from itmo_video.delivery.preview import preview
from itmo_video.delivery.preview_options import PreviewOptions
from itmo_video.output.gate import FILM, Gate

Writing = tuple[tuple[Any, ...], dict[str, Any]]


def measure(clip: Path, frames: int, codec: Any, speed: str, out: Path) -> tuple[float, float]:
    """Milliseconds of CPU a frame: the encoder alone, and the whole preview."""
    made: list[Writing] = []
    asked: list[FilmSpec] = []
    begin, write = FilmWriter.__init__, FilmWriter.write

    def watched(self: FilmWriter, gate: Gate, spec: FilmSpec, *rest: Any, **more: Any) -> None:
        asked.append(spec)
        begin(self, gate, spec, *rest, **more)

    def kept(self: FilmWriter, *args: Any, **more: Any) -> None:
        made.append((args, more))
        write(self, *args, **more)

    # Watched for as long as this runs, which mypy is right to dislike.
    FilmWriter.__init__, FilmWriter.write = watched, kept  # type: ignore[method-assign]
    try:
        start = time.process_time()
        options = PreviewOptions(codec=codec, speed=speed)
        run = RunOptions(frames=f"1-{frames}")
        preview(clip, out / f"fly{speed}.mp4", make_settings("default"), run, options)
        whole_s = time.process_time() - start
    finally:
        FilmWriter.__init__, FilmWriter.write = begin, write  # type: ignore[method-assign]
    start = time.process_time()
    with closing(FilmWriter(Gate(out / f"alone{speed}.mp4", FILM), asked[0])) as film:
        for args, more in made:
            film.write(*args, **more)
        film.finish(Light(1000, 100))
    alone_s = time.process_time() - start
    return 1e3 * alone_s / frames, 1e3 * whole_s / frames


def peak_mb(clip: Path, frames: int, codec: str, out: Path) -> float:
    """Peak resident memory of the command in a process of its own."""
    command = [sys.executable, "-m", "itmo_video", "preview", str(clip), str(out / "p.mp4")]
    flags = ["--frames", f"1-{frames}", "--codec", codec, "--quiet"]
    timed = ["/usr/bin/time", "-v", *command, *flags]
    done = subprocess.run(timed, check=True, stderr=subprocess.PIPE, text=True)
    found = re.search(r"Maximum resident set size \(kbytes\): (\d+)", done.stderr)
    assert found is not None
    return int(found[1]) / 1024


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("clip", type=Path, nargs="?")
    parser.add_argument("--frames", type=int, default=48)
    parser.add_argument("--codec", default="av1")
    parser.add_argument("--speeds", default="5,6,8")
    parser.add_argument("--memory", action="store_true", help="the peak, too")
    add_plain(parser)
    args = parser.parse_args()
    require_kernels(args.plain)
    with tempfile.TemporaryDirectory(prefix="itmo-preview-") as scratch:
        out = Path(scratch)
        clip = args.clip or make_clip(out / "made.mp4", 1920, 1080, args.frames, "yuv420p")
        for speed in args.speeds.split(","):
            alone, whole = measure(clip, args.frames, args.codec, speed, out)
            cells = f"{alone:.0f} ms | {whole:.0f} ms | {whole / alone:.2f}"
            print(f"| {args.codec} {speed} | {cells} |", flush=True)
        if args.memory:
            print(f"peak {peak_mb(clip, args.frames, args.codec, out):.0f} MB")


if __name__ == "__main__":
    main()
