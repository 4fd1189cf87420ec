"""Still files for tests of the source, written byte by byte or by a library, and their codes."""

from __future__ import annotations

import os
import struct
import zlib
from pathlib import Path
from typing import cast

import cv2
import numpy as np

from itmo_video.model import Code
from itmo_video.source.opening import open_clip


def codes_of(path: Path) -> Code:
    """A still's codes (H, W, channels)."""
    with open_clip(path) as clip:
        (frame,) = clip.frames()
    return cast(Code, np.dstack(frame.planes))  # NumPy's types lose the union


def written(path: Path, data: bytes) -> Path:
    """`path`, once it holds `data`."""
    path.write_bytes(data)
    return path


def chunk(name: bytes, body: bytes) -> bytes:
    """A PNG's chunk with its check sum."""
    return struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))


def png_bytes(
    width: int, height: int, kind: int, data: bytes, *extra: tuple[bytes, bytes]
) -> bytes:
    """A PNG of 8 bits, its colour type `kind`, with these rows and these other chunks."""
    head = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, kind, 0, 0, 0))
    body = b"".join(chunk(name, value) for name, value in extra)
    image = chunk(b"IDAT", zlib.compress(data))
    return b"\x89PNG\r\n\x1a\n" + head + body + image + chunk(b"IEND", b"")


def picture(
    height: int = 24,
    width: int = 38,
    dtype: type[np.uint8 | np.uint16] = np.uint8,
    channels: int = 3,
    seed: int = 0,
) -> Code:
    """Noise over all codes, (height, width, channels), or (height, width) for one channel."""
    top = np.iinfo(dtype).max + 1
    shape = (height, width, channels) if channels > 1 else (height, width)
    noise = np.random.default_rng(seed).integers(0, top, shape)
    return noise.astype(np.uint8) if dtype is np.uint8 else noise.astype(np.uint16)


def write_image(path: Path, image: Code) -> Path:
    """A still as OpenCV writes it: the channels are B, G, R."""
    assert cv2.imwrite(os.fspath(path), image)
    return path


def exif(orientation: int) -> bytes:
    """EXIF of one tag."""
    return b"II*\0" + struct.pack("<IHHHIII", 8, 1, 0x0112, 3, 1, orientation, 0)
