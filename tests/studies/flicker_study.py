"""Flicker of the map along true motion: per frame, blended and tracked, on panned panoramas.

    python tests/studies/flicker_study.py PAN_CLIP.py PANORAMA... [--motions pan,shake,static]

PAN_CLIP.py makes the clips (24 frames of 384x216, h264). Prints a table in Markdown: map flicker of
`--preset paper --temporal per-frame` (P), of `paper` blended (PB), of `default` blended (DB) and of
`default` (D); the ratios; how like the per-frame maps the tracked ones are; and how like P is to
its own frame before, along true motion (no steady map can be much more like P than that).
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import numpy.typing as npt

from itmo_video import convert, make_settings, read_exr
from itmo_video.evaluation import flicker, sequence
from itmo_video.motion.flow import warp

KINDS = {
    "P": ("paper", "per-frame"),
    "PB": ("paper", "blend"),
    "DB": ("default", "blend"),
    "D": ("default", "tracked"),
}


def make_clip(tool: Path, panorama: Path, motion: str, work: Path) -> Path:
    """A clip with known motion, made once."""
    out = work / f"{panorama.stem}_{motion}"
    if not (out / "motion.json").exists():
        size = ["--frames", "24", "--size", "384x216", "--motion", motion]
        subprocess.run([sys.executable, str(tool), str(panorama), str(out), *size], check=True)
    return out


def maps(clip: Path, kind: str) -> list[npt.NDArray[np.float32]]:
    """The full-size maps of a conversion."""
    preset, temporal = KINDS[kind]
    chosen = {"temporal": temporal, "layers": ("expand_map",), "compression": "none"}
    with tempfile.TemporaryDirectory() as folder:
        convert(clip / "sdr.mkv", folder, make_settings(preset, **chosen))
        files = sorted(Path(folder).glob("*.exr"))
        return [read_exr(f).channels["expand_map.Y"].astype(np.float32) for f in files]


def along_motion(
    found: list[npt.NDArray[np.float32]], origins: sequence.Origins
) -> tuple[float, float]:
    """Mean absolute change from frame to frame, and mean correlation of a frame with the last."""
    steps, alike = [], []
    for n in range(1, len(found)):
        (xa, ya), (xb, yb) = origins[n - 1], origins[n]
        flow, valid = flicker.known_flow(found[n].shape[:2], xb - xa, yb - ya)
        steps.append(flicker.change_along(found[n - 1], found[n], flow, valid))
        alike.append(np.corrcoef(warp(found[n - 1], flow)[valid], found[n][valid])[0, 1])
    return float(np.mean(steps)), float(np.mean(alike))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("pan_clip", type=Path)
    parser.add_argument("panoramas", type=Path, nargs="+")
    parser.add_argument("--motions", default="pan,shake,static")
    parser.add_argument("--work", type=Path, default=Path(tempfile.gettempdir()) / "itmo-flicker")
    args = parser.parse_args()
    args.work.mkdir(exist_ok=True)
    print(
        "| scene | motion | P | PB | DB | D | P/D | PB/D | DB/D | mean | correlation | P itself |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|---|---|")
    ratios, blended = [], []
    for panorama in args.panoramas:
        for motion in args.motions.split(","):
            clip = make_clip(args.pan_clip, panorama, motion, args.work)
            origins = sequence.read_origins(clip / "motion.json")
            found = {kind: maps(clip, kind) for kind in KINDS}
            f = {kind: along_motion(found[kind], origins)[0] for kind in KINDS}
            itself = along_motion(found["P"], origins)[1]
            mean = np.mean(found["D"]) / np.mean(found["P"])
            alike = [
                np.corrcoef(a.ravel(), b.ravel())[0, 1]
                for a, b in zip(found["D"], found["P"], strict=True)
            ]
            if motion != "static":
                ratios.append(f["P"] / f["D"])
                blended.append(f["DB"] / f["D"])
            cells = " | ".join(f"{f[kind]:.5f}" for kind in KINDS)
            over = " | ".join(f"{f[kind] / f['D']:.1f}" for kind in ("P", "PB", "DB"))
            row = f"{cells} | {over} | {mean:.2f} | {np.mean(alike):.2f} | {itself:.2f} |"
            print(f"| {panorama.stem} | {motion} | {row}", flush=True)
    for name, values in (("P/D", ratios), ("DB/D", blended)) if ratios else ():
        print(f"\n{name}, moving scenes: mean {np.mean(values):.1f}, least {np.min(values):.1f}")


if __name__ == "__main__":
    main()
