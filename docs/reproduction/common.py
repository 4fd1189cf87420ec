"""What the reproduction's scripts share: reading, exposures, converting stills, false colour."""

from __future__ import annotations

import argparse
from fractions import Fraction
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from itmo_video import make_settings
from itmo_video.colour.primaries import LUMINANCE_WEIGHTS_BANTERLE2006
from itmo_video.expand_map.key_map import make_key_map
from itmo_video.look import make_look
from itmo_video.model import Encoding, Frame
from itmo_video.output.exr import read_exr
from itmo_video.rendering.frame import render

HERE = Path(__file__).resolve().parent
IMAGES = HERE / "images"
HIGHLIGHTS = str(HERE / "highlights.toml")  # the paper's operator, a finer and stricter map
RGB8 = Encoding("rgb", 8, "bt709", "full", "srgb", "rec709")


def data_folder(text: str) -> Path:
    """The folder with hdr_images/ and panoramas/ that a script's first argument names."""
    parser = argparse.ArgumentParser(description=text)
    parser.add_argument("data", type=Path, help="a folder with hdr_images/ and panoramas/")
    folder: Path = parser.parse_args().data
    if not folder.is_dir():
        parser.error(f"{folder} is not a folder")
    return folder


def read_hdr(path: Path) -> Any:
    """Linear RGB of an .hdr or .exr file, float32 (H, W, 3), finite and not negative."""
    if path.suffix.lower() == ".exr":
        channels = read_exr(path).channels
        rgb = np.dstack([channels[name] for name in "RGB"])
    else:
        picture = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        if picture is None:
            raise SystemExit(f"{path} cannot be read")
        rgb = picture[..., ::-1]
    return np.clip(np.nan_to_num(rgb.astype(np.float32), posinf=6e4), 0, 6e4)


def luminance(rgb: Any) -> Any:
    """Eq. 1."""
    return rgb @ np.array(LUMINANCE_WEIGHTS_BANTERLE2006, np.float32)


def srgb_codes(rgb: Any) -> Any:
    """What a camera at stop 0 records: clipped to [0, 1], sRGB, 8 bits."""
    v = np.clip(rgb, 0, 1)
    coded = np.where(v <= 0.0031308, 12.92 * v, 1.055 * np.maximum(v, 1e-9) ** (1 / 2.4) - 0.055)
    return np.round(coded * 255).astype(np.uint8)


def linear(codes: Any) -> Any:
    """Linear RGB of sRGB codes, 8 bits: the SDR as it is."""
    v = codes.astype(np.float32) / 255
    return np.where(v <= 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4)


def converted(codes: Any, preset: str = "paper", **overrides: Any) -> tuple[Any, Any]:
    """(linear RGB, map at analysis size or None) that itmo_video makes of sRGB codes."""
    planes = tuple(np.ascontiguousarray(codes[..., i]) for i in range(3))
    frame = Frame(0, Fraction(0), planes, RGB8)
    look = make_look(make_settings(preset, **overrides))
    key_map = make_key_map(frame, look) if look.needs_map else None
    return np.dstack(render(frame, key_map, look).rgb).astype(np.float32), key_map


def false_colour(values: Any, lowest: float, highest: float) -> Any:
    """Log2 of luminance as a picture (uint8 BGR), from `lowest` to `highest` stops."""
    stops = np.log2(np.maximum(values, 2.0**-20))
    scaled = np.clip((stops - lowest) / (highest - lowest), 0, 1)
    return cv2.applyColorMap((scaled * 255).astype(np.uint8), cv2.COLORMAP_JET)


def labelled(picture: Any, text: str) -> Any:
    """A picture with its name in the corner."""
    out = picture.copy()
    for colour, width in (((0, 0, 0), 3), ((255, 255, 255), 1)):
        cv2.putText(out, text, (5, 14), cv2.FONT_HERSHEY_SIMPLEX, 0.4, colour, width, cv2.LINE_AA)
    return out


def scale_bar(height: int, lowest: float, highest: float) -> Any:
    """The scale of a false-colour picture, in stops."""
    bar = np.repeat(np.linspace(255, 0, height).astype(np.uint8)[:, None], 44, axis=1)
    bar = cv2.applyColorMap(bar, cv2.COLORMAP_JET)
    for stop in range(int(np.ceil(lowest)), int(highest) + 1, 2):
        y = int((highest - stop) / (highest - lowest) * (height - 1))
        bar = _text(bar, f"{stop:+d}", min(max(y + 4, 12), height - 3))
    return bar


def _text(picture: Any, text: str, y: int) -> Any:
    for colour, width in (((0, 0, 0), 3), ((255, 255, 255), 1)):
        cv2.putText(picture, text, (8, y), cv2.FONT_HERSHEY_SIMPLEX, 0.4, colour, width)
    return picture


def save(name: str, pictures: list[Any], width: int = 256) -> None:
    """Pictures side by side, each `width` wide (a scale bar as it is), in few colours."""
    height = round(pictures[0].shape[0] * width / pictures[0].shape[1])
    shown = []
    for picture in pictures:
        w = width if picture.shape[1] > 60 else picture.shape[1]
        if picture.shape[:2] != (height, w):
            picture = cv2.resize(picture, (w, height), interpolation=cv2.INTER_AREA)
        shown.append(picture)
    IMAGES.mkdir(exist_ok=True)
    cv2.imwrite(str(IMAGES / name), np.hstack(shown) & 0xF8, [cv2.IMWRITE_PNG_COMPRESSION, 9])
