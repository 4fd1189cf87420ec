"""Make the pictures of README and docs from the sample clips: python docs/make_pictures.py."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Sequence
from itertools import islice
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from itmo_video import PreviewOptions, RunOptions, convert, make_settings, open_clip, open_result
from itmo_video import preview as film
from itmo_video.colour import linear_light

ROOT = Path(__file__).resolve().parents[1]
IMAGES = ROOT / "docs" / "images"
CLIPS = ROOT / "sample_clips"
WEIGHTS = np.array([0.2126, 0.7152, 0.0722], np.float32)
LOWEST_STOP, HIGHEST_STOP = -6, 5
DARKER_STOPS = 3


def luminance(rgb: Any) -> Any:
    """BT.709 luminance of linear RGB (H, W, 3)."""
    return rgb @ WEIGHTS


def shown(rgb: Any, stops: float = 0) -> Any:
    """Linear RGB at an exposure, clipped at white, as 8-bit BGR for SDR monitors."""
    exposed = np.clip(rgb * 2.0**stops, 0, 1) ** (1 / 2.4)
    return (exposed * 255 + 0.5).astype(np.uint8)[..., ::-1]


def in_stops(rgb: Any) -> Any:
    """Luminance in stops about SDR white, as false colour."""
    stops = np.log2(np.maximum(luminance(rgb), 1e-6))
    scaled = np.clip((stops - LOWEST_STOP) / (HIGHEST_STOP - LOWEST_STOP), 0, 1)
    return cv2.applyColorMap((scaled * 255).astype(np.uint8), cv2.COLORMAP_INFERNO)


def labelled(picture: Any, text: str) -> Any:
    """A picture with its name on a dark ground in the corner."""
    out = np.ascontiguousarray(picture)
    (width, height), below = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, 0.5, 1)
    cv2.rectangle(out, (0, 0), (width + 16, height + below + 12), (0, 0, 0), cv2.FILLED)
    white = (255, 255, 255)
    cv2.putText(out, text, (8, 20), cv2.FONT_HERSHEY_SIMPLEX, 0.5, white, 1, cv2.LINE_AA)
    return out


def legend(width: int) -> Any:
    """The scale of `in_stops`."""
    levels = np.linspace(0, 255, width).astype(np.uint8)[None]
    bar = np.repeat(cv2.applyColorMap(levels, cv2.COLORMAP_INFERNO), 26, axis=0)
    for stop in range(LOWEST_STOP, HIGHEST_STOP + 1):
        x = int((stop - LOWEST_STOP) / (HIGHEST_STOP - LOWEST_STOP) * (width - 60)) + 8
        ink = (255, 255, 255) if stop < 2 else (0, 0, 0)
        cv2.putText(
            bar,
            f"{stop:+d}" if stop else "0",
            (x, 18),
            cv2.FONT_HERSHEY_SIMPLEX,
            0.42,
            ink,
            1,
            cv2.LINE_AA,
        )
    return bar


def grid(rows: Sequence[Sequence[Any]]) -> Any:
    """Pictures of one size in rows."""
    return np.vstack([np.hstack(row) for row in rows])


def sdr_frames(name: str, first: int, count: int) -> list[Any]:
    """Frames of a sample clip in linear light."""
    with open_clip(CLIPS / f"{name}.mp4") as clip:
        frames = islice(clip.frames(first), count)
        return [np.dstack(linear_light.to_rgb_linear(frame, clip=True)) for frame in frames]


def true_frames(name: str, first: int, count: int) -> list[Any]:
    """Their radiance, as drawn."""
    sys.path.insert(0, str(CLIPS))
    from make_sample_clips import scene_frames

    return list(islice(scene_frames(name), first, first + count))


def converted(name: str, first: int, count: int, **settings: Any) -> list[Any]:
    """Their conversion by `default`: a list of Expanded."""
    with tempfile.TemporaryDirectory() as folder:
        run = RunOptions(frames=f"{first + 1}-{first + count}")
        convert(CLIPS / f"{name}.mp4", folder, make_settings(**settings), run)
        return [frame for _, frame in open_result(folder).items()]


def before_after() -> Any:
    """A frame before and after beside its truth: three stops darker, and in stops."""
    columns = (
        ("SDR", sdr_frames("night_street", 24, 1)[0]),
        ("itmo_video", converted("night_street", 24, 1)[0].rgb.astype(np.float32)),
        ("true radiance", true_frames("night_street", 24, 1)[0]),
    )
    dark = [
        labelled(shown(rgb, -DARKER_STOPS), f"{name}, {DARKER_STOPS} stops darker")
        for name, rgb in columns
    ]
    plain = [labelled(shown(rgb), f"{name}, on an SDR monitor") for name, rgb in columns]
    stops = [labelled(in_stops(rgb), f"{name}, in stops") for name, rgb in columns]
    whole = grid([plain, dark, stops])
    return np.vstack([whole, legend(whole.shape[1])])


def map_over_shot() -> Any:
    """SDR, Expand Map and gain of three frames of a pan."""
    frames = (4, 20, 36)
    names = ("SDR", "Expand Map", "gain, 0 to 2.3 stops")
    columns = []
    for number in frames:
        sdr = sdr_frames("night_street", number, 1)[0]
        done = converted("night_street", number, 1, layers=("expand_map", "gain"))[0]
        levels = np.clip(done.layers["expand_map"].astype(np.float32), 0, 1)
        gain = np.log2(np.maximum(done.layers["gain"].astype(np.float32), 1)) / 2.3
        planes = [(np.clip(p, 0, 1) * 255).astype(np.uint8) for p in (levels, gain)]
        maps = [cv2.applyColorMap(plane, cv2.COLORMAP_VIRIDIS) for plane in planes]
        pictures = zip((shown(sdr), *maps), names, strict=True)
        columns.append([labelled(p, f"{name}, frame {number + 1}") for p, name in pictures])
    return grid(list(zip(*columns, strict=True)))


def false_colour() -> Any:
    """The view of `preview --as false-colour --scale nits`."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "nits.png"
        options = PreviewOptions(view="false-colour", scale="nits", frame=25)
        film(CLIPS / "night_street.mp4", path, None, RunOptions(), options)
        return cv2.imread(str(path))


def limitations() -> Any:
    """Of each sample clip the frame, of every eighth, that is furthest from the truth."""
    rows = []
    for name in ("bright_window", "cut_and_flash"):
        sdr, truth = sdr_frames(name, 0, 48), true_frames(name, 0, 48)
        done = [frame.rgb.astype(np.float32) for frame in converted(name, 0, 48)]
        errors = [_stops_off(done[n], truth[n]) for n in range(0, 48, 8)]
        worst = 8 * int(np.argmax([np.mean(np.abs(e)) for e in errors]))
        off = np.clip(_stops_off(done[worst], truth[worst]) / 4, -1, 1)[..., None]
        hue = np.where(off < 0, (200, 90, 0), (0, 110, 230))  # BGR: blue, orange
        error = (235 + np.abs(off) * (hue - 235)).astype(np.uint8)
        rows += [
            [
                labelled(shown(sdr[worst]), f"{name}, frame {worst + 1}: SDR"),
                labelled(error, "error: blue too dark, orange too bright"),
            ],
            [
                labelled(in_stops(done[worst]), "itmo_video, in stops"),
                labelled(in_stops(truth[worst]), "true radiance, in stops"),
            ],
        ]
    return grid(rows)


def _stops_off(rgb: Any, truth: Any) -> Any:
    """Error of luminance in stops; light below 2 % of white counts as 2 %."""
    return np.log2(np.maximum(luminance(rgb), 0.02) / np.maximum(luminance(truth), 0.02))


def main() -> None:
    """Write all, or those that are named."""
    makers = (before_after, map_over_shot, false_colour, limitations)
    for make in makers:
        if len(sys.argv) > 1 and make.__name__ not in sys.argv[1:]:
            continue
        path = IMAGES / f"{make.__name__}.jpg"
        cv2.imwrite(str(path), make(), [cv2.IMWRITE_JPEG_QUALITY, 88])
        print(path, path.stat().st_size)


if __name__ == "__main__":
    main()
