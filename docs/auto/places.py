"""Pictures of the places where `auto` shifts hue most: python docs/auto/places.py DATA.

DATA is ../shared/data. Writes docs/images/places.jpg: the source, and the default's result 1 and 2
stops darker, at the worst place of each clip by a measure: where its hue moves most, for the ferris
wheel where it is brightest. Only clips whose licence allows it (SOURCES.md): our own samples, Big
Buck Bunny (CC-BY 3.0, Blender Foundation), ColorVideoVDP's ferris wheel (MIT).
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from itmo_video import RunOptions, convert, make_settings, open_clip, open_result
from itmo_video.colour import linear_light

ROOT = Path(__file__).resolve().parents[2]
XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
TILE = (432, 243)
SAMPLES = "sample_clips"
# clip, frame, width of the window that is shown, what it is chosen by
PLACES = (
    (f"{SAMPLES}/night_street.mp4", 15, 144, "hue"),
    (f"{SAMPLES}/cut_and_flash.mp4", 15, 144, "hue"),
    (f"{SAMPLES}/bright_window.mp4", 29, 216, "hue"),
    ("clips/bigbuckbunny.mp4", 40, 432, "hue"),
    ("clips/cvvdp_ferris-ref.mp4", 30, 288, "light"),
)


def uv(rgb: Any) -> Any:
    """CIE 1976 u'v' of linear BT.709: (H, W, 2)."""
    x, y, z = np.moveaxis(rgb @ XYZ.T, -1, 0)
    return np.stack([4 * x, 9 * y], -1) / (x + 15 * y + 3 * z + 1e-6)[..., None]


def before_and_after(path: Path, frame: int) -> tuple[Any, Any]:
    """A frame in linear light, and as the default renders it: float (H, W, 3)."""
    with open_clip(path) as clip:
        source = next(iter(clip.frames(frame - 1)))
        before = np.dstack(linear_light.to_rgb_linear(source, clip=True))
    with tempfile.TemporaryDirectory() as folder:
        convert(path, folder, make_settings(), RunOptions(frames=str(frame)))
        (after,) = [one.rgb.astype(np.float32) for _, one in open_result(folder).items()]
    return before, after


def window(before: Any, after: Any, width: int, by: str) -> tuple[slice, slice]:
    """Where the measure is greatest over a window of 16 : 9."""
    height = round(width * TILE[1] / TILE[0])
    if by == "hue":
        measure = np.minimum(np.hypot(*np.moveaxis(uv(after) - uv(before), -1, 0)), 0.03)
        measure[before.max(-1) < 0.02] = 0
    else:
        measure = after.max(-1)
    mean = cv2.blur(measure.astype(np.float32), (width, height), borderType=cv2.BORDER_CONSTANT)
    y, x = np.unravel_index(int(mean.argmax()), mean.shape)
    top = min(max(int(y) - height // 2, 0), before.shape[0] - height)
    left = min(max(int(x) - width // 2, 0), before.shape[1] - width)
    return slice(top, top + height), slice(left, left + width)


def tile(rgb: Any, stops: float, text: str) -> Any:
    """A window at an exposure as an SDR monitor shows it, pixels left as they are."""
    shown = (np.clip(rgb * 2.0**stops, 0, 1) ** (1 / 2.4) * 255 + 0.5).astype(np.uint8)
    out = cv2.resize(shown[..., ::-1], TILE, interpolation=cv2.INTER_NEAREST)
    cv2.rectangle(out, (0, 0), (9 * len(text) + 12, 22), (0, 0, 0), cv2.FILLED)
    font = cv2.FONT_HERSHEY_SIMPLEX
    cv2.putText(out, text, (6, 16), font, 0.45, (255, 255, 255), 1, cv2.LINE_AA)
    return out


def main() -> None:
    """Write the picture."""
    rows = []
    for clip, frame, width, by in PLACES:
        root = ROOT if clip.startswith(SAMPLES) else Path(sys.argv[1])
        before, after = before_and_after(root / clip, frame)
        at = window(before, after, width, by)
        name = f"{Path(clip).stem}, frame {frame}"
        rows.append(
            np.hstack(
                [
                    tile(before[at], 0, f"{name}: SDR"),
                    tile(after[at], -1, "default, -1 EV"),
                    tile(after[at], -2, "default, -2 EV"),
                ]
            )
        )
        print(name, at)
    path = ROOT / "docs/images/places.jpg"
    cv2.imwrite(str(path), np.vstack(rows), [cv2.IMWRITE_JPEG_QUALITY, 74])
    print(path, path.stat().st_size)


if __name__ == "__main__":
    main()
