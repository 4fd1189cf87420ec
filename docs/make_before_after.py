"""Make docs/images/before_after.png: a sample clip, its truth, and what presets make of it."""

from __future__ import annotations

import sys
import tempfile
from itertools import islice
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from itmo_video import RunOptions, convert, make_settings, open_clip, read_exr
from itmo_video.colour import linear_light

ROOT = Path(__file__).resolve().parent.parent
FRAME = 24
PRESETS = ("default", "ibl", "paper")
LOWEST_STOP, HIGHEST_STOP = -6, 5
WEIGHTS = np.array([0.2126, 0.7152, 0.0722], np.float32)


def false_colour(rgb: Any) -> Any:
    """Luminance in stops against SDR white, as a picture."""
    stops = np.log2(np.maximum(rgb @ WEIGHTS, 1e-6))
    scaled = np.clip((stops - LOWEST_STOP) / (HIGHEST_STOP - LOWEST_STOP), 0, 1)
    return cv2.applyColorMap((scaled * 255).astype(np.uint8), cv2.COLORMAP_INFERNO)


def labelled(picture: Any, text: str) -> Any:
    """A picture with its name in the corner."""
    out = picture.copy()
    for colour_bgr, width in (((0, 0, 0), 3), ((255, 255, 255), 1)):
        font = cv2.FONT_HERSHEY_SIMPLEX
        cv2.putText(out, text, (8, 20), font, 0.5, colour_bgr, width, cv2.LINE_AA)
    return out


def legend(width: int) -> Any:
    """The scale in stops."""
    levels = np.linspace(0, 255, width).astype(np.uint8)[None]
    ramp = cv2.applyColorMap(levels, cv2.COLORMAP_INFERNO)
    bar = np.repeat(ramp, 26, axis=0)
    for stop in range(LOWEST_STOP, HIGHEST_STOP + 1):
        x = int((stop - LOWEST_STOP) / (HIGHEST_STOP - LOWEST_STOP) * (width - 60)) + 8
        ink = (255, 255, 255) if stop < 2 else (0, 0, 0)
        cv2.putText(bar, f"{stop:+d}", (x, 18), cv2.FONT_HERSHEY_SIMPLEX, 0.42, ink, 1, cv2.LINE_AA)
    return bar


def converted(clip: Path, preset: str) -> Any:
    """Linear RGB of the frame, expanded."""
    with tempfile.TemporaryDirectory() as folder:
        convert(clip, folder, make_settings(preset), RunOptions(frames=str(FRAME + 1)))
        channels = read_exr(Path(folder) / f"{clip.stem}.{FRAME + 1:04d}.exr").channels
    return np.dstack([channels[c].astype(np.float32) for c in "RGB"])


def main() -> None:
    """Convert one frame by each preset and write the picture."""
    sys.path.insert(0, str(ROOT / "sample_clips"))
    from make_sample_clips import scene_frames

    clip = ROOT / "sample_clips/night_street.mp4"
    with open_clip(clip) as opened:
        sdr = np.dstack(linear_light.to_rgb_linear(next(opened.frames(FRAME)), clip=True))
    truth = next(islice(scene_frames("night_street"), FRAME, None))
    picture = (np.clip(sdr, 0, 1) ** (1 / 2.4) * 255).astype(np.uint8)[..., ::-1]
    upper = [
        labelled(picture, "the SDR clip"),
        labelled(false_colour(sdr), "the SDR clip, in stops"),
        labelled(false_colour(truth), "the scene's true radiance"),
    ]
    lower = [
        labelled(false_colour(converted(clip, preset)), f"--preset {preset}") for preset in PRESETS
    ]
    both = np.vstack([np.hstack(upper), np.hstack(lower)])
    target = ROOT / "docs/images/before_after.png"
    target.parent.mkdir(exist_ok=True)
    cv2.imwrite(str(target), np.vstack([both, legend(both.shape[1])]))


if __name__ == "__main__":
    main()
