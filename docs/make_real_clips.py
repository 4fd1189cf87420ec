"""Make docs/images/real_clips.png: make_real_clips.py CLIPS (a folder, ../shared/data/clips).

A frame each of real clips as it is, expanded by the default at -1 and -2 stops, and the gain.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from itmo_video import RunOptions, convert, make_settings, read_exr

FRAMES = {"bigbuckbunny": 66, "nasa_13013": 100, "carphone_pristine": 114, "cvvdp_ferris-ref": 45}
WIDTH = 360


def shown(rgb: Any, stops: float) -> Any:
    """SRGB codes of linear light, some stops brighter, clipped."""
    light = np.clip(rgb * 2.0**stops, 0, 1)
    curve = 1.055 * np.maximum(light, 1e-9) ** (1 / 2.4) - 0.055
    return np.uint8(255 * np.where(light <= 0.0031308, 12.92 * light, curve))[..., ::-1]


def main() -> None:
    """Convert the frames and write the picture."""
    rows = []
    for name, number in FRAMES.items():
        clip = Path(sys.argv[1]) / f"{name}.mp4"
        pictures = []
        for strength in (0.0, 1.0):
            with tempfile.TemporaryDirectory() as folder:
                settings = make_settings(strength=strength)
                convert(clip, folder, settings, RunOptions(frames=str(number), jobs=1))
                channels = read_exr(next(Path(folder).glob("*.exr"))).channels
            pictures.append(np.dstack([channels[c].astype(np.float32) for c in "RGB"]))
        sdr, hdr = pictures
        gain = np.log2(np.maximum(hdr.max(-1), 1e-4) / np.maximum(sdr.max(-1), 1e-4))
        scaled = np.uint8(np.clip(gain / np.log2(1000 / 203), 0, 1) * 255)
        heat = cv2.applyColorMap(scaled, cv2.COLORMAP_INFERNO)
        parts = [shown(sdr, 0), shown(hdr, -1), shown(hdr, -2), heat]
        size = (WIDTH, round(WIDTH * sdr.shape[0] / sdr.shape[1]))
        rows.append(np.hstack([cv2.resize(p, size, interpolation=cv2.INTER_AREA) for p in parts]))
    target = Path(__file__).resolve().parent / "images/real_clips.png"
    cv2.imwrite(str(target), np.vstack(rows))


if __name__ == "__main__":
    main()
