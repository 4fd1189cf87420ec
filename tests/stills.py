"""Still files for tests, made in the test."""

from __future__ import annotations

import io
import struct
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from PIL import Image

from itmo_video.colour import linear_light
from itmo_video.colour.primaries import rgb_to_rgb_matrix
from itmo_video.source.opening import open_clip

PATCHES = np.array(
    [[255, 255, 255], [128, 128, 128], [255, 0, 0], [0, 255, 0], [0, 0, 255], [200, 120, 90],
     [30, 60, 90], [250, 240, 20]], np.uint8
)  # fmt: skip


def patches(size: int = 16) -> np.ndarray:
    """A picture of eight patches side by side, (size, 8 * size, 3) uint8."""
    return np.repeat(np.repeat(PATCHES[None], size, 0), size, 1)


def noise(height: int = 40, width: int = 60, channels: int = 3, seed: int = 0) -> np.ndarray:
    """A smooth picture with some noise, uint8."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:height, :width]
    waves = [120 + 90 * np.sin(x / (5 + i) + y / (9 - i)) for i in range(channels)]
    return np.clip(np.dstack(waves) + rng.normal(0, 4, (height, width, channels)), 0, 255).astype(
        np.uint8
    )


def linear_srgb(path: Path) -> np.ndarray:
    """A still's picture as linear sRGB (H, W, 3), not clipped."""
    with open_clip(path) as clip:
        frame = next(iter(clip.frames()))
    rgb = np.dstack(linear_light.to_rgb_linear(frame, clip=False)).astype(np.float64)
    return rgb @ rgb_to_rgb_matrix(frame.encoding.primaries, "rec709").T


def bgr_codes(path: Path) -> npt.NDArray[Any]:
    """A still as OpenCV reads it, in its own depth."""
    codes = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    assert codes is not None, f"{path} cannot be read"
    return np.asarray(codes)


def at_patches(rgb: np.ndarray) -> np.ndarray:
    """The middle pixel of each of the eight patches, (8, 3)."""
    height, width = rgb.shape[:2]
    return rgb[height // 2, width // 16 :: width // 8][:8]


def encoded(image: np.ndarray, form: str, **options: object) -> bytes:
    """A picture as Pillow writes it."""
    data = io.BytesIO()
    Image.fromarray(image).save(data, form, **options)
    return data.getvalue()


def lut_profile(grid: int = 9, gamma: float = 1.8) -> bytes:
    """An ICC v2 profile of RGB with a table (mft2): a gamma of its own, BT.709's primaries."""
    nodes = np.linspace(0, 1, grid) ** gamma
    light = np.stack(np.meshgrid(nodes, nodes, nodes, indexing="ij"), -1)
    return _table_profile(b"RGB ", grid, light)


def ink_profile(grid: int = 9) -> bytes:
    """An ICC v2 profile of CMYK with a table: each ink takes its share of light away."""
    nodes = np.linspace(0, 1, grid)
    inks = np.stack(np.meshgrid(nodes, nodes, nodes, nodes, indexing="ij"), -1)
    return _table_profile(b"CMYK", grid, (1 - inks[..., :3]) * (1 - inks[..., 3:]))


def _table_profile(space: bytes, grid: int, light: np.ndarray) -> bytes:
    """A profile whose table has linear BT.709 light at its nodes, as Lab."""
    from itmo_video.source.icc import D50_XYZ, _d50_matrix

    channels = light.ndim - 1
    ratio = light @ _d50_matrix("rec709").T / np.array(D50_XYZ)
    cube = np.where(ratio > 216 / 24389, np.cbrt(ratio), (24389 / 27 * ratio + 16) / 116)
    codes = np.stack(
        [(116 * cube[..., 1] - 16) * 652.80, (500 * (cube[..., 0] - cube[..., 1]) + 128) * 256,
         (200 * (cube[..., 1] - cube[..., 2]) + 128) * 256], -1
    )  # fmt: skip
    table = np.clip(np.rint(codes), 0, 65535).astype(">u2").tobytes()
    line = np.array([0, 65535], ">u2").tobytes()
    body = b"mft2" + bytes(4) + bytes([channels, 3, grid, 0])
    body += struct.pack(">9i", 65536, 0, 0, 0, 65536, 0, 0, 0, 65536)
    body += struct.pack(">HH", 2, 2) + line * channels + table + line * 3
    white = b"XYZ " + bytes(4) + struct.pack(">3i", *(round(v * 65536) for v in D50_XYZ))
    desc = b"desc" + bytes(4) + struct.pack(">I", 5) + b"made\0" + bytes(78)
    bodies = [(b"desc", desc), (b"wtpt", white), (b"A2B0", body)]
    at = 128 + 4 + 12 * len(bodies)
    tags, content = struct.pack(">I", len(bodies)), b""
    for name, part in bodies:
        tags += name + struct.pack(">II", at + len(content), len(part))
        content += part + bytes(-len(part) % 4)
    kind = b"prtr" if space == b"CMYK" else b"mntr"
    head = (
        struct.pack(">I", at + len(content)) + bytes(4) + b"\x02\x40\0\0" + kind + space + b"Lab "
    )
    head += struct.pack(">6H", 2026, 1, 1, 0, 0, 0) + b"acsp" + bytes(28)
    head += struct.pack(">3i", *(round(v * 65536) for v in D50_XYZ))
    return head.ljust(128, b"\0") + tags + content
