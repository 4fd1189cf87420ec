"""Stills: 16-bit PNG with PQ and cICP written by hand, SDR JPEG and PNG."""

from __future__ import annotations

import struct
import zlib
from typing import Any

import cv2
import numpy as np

from itmo_video.delivery import hdr
from itmo_video.delivery.metadata import Mastering, in_32_bits
from itmo_video.delivery.sdr import Picture

_PNG_HEAD = 8 + 25  # the signature and the IHDR chunk, which always comes first


def png_pq(rgb_code: hdr.Planes, mastering: Mastering, light: hdr.Light) -> bytes:
    """A 16-bit PNG of PQ BT.2020 R'G'B' planes, tagged by cICP, mDCV and cLLI chunks.

    PNG 3rd edition, 11.3.2.6 to 11.3.2.8: primaries 9, transfer 16, RGB, full range.
    """
    bgr = np.dstack(rgb_code[::-1])
    codes = np.asarray(cv2.multiply(bgr, (65535.0,) * 4, dtype=cv2.CV_16U))
    data = _encoded(".png", codes)
    # Chunks of colour come before the picture's data.
    chunks = (
        _chunk(b"cICP", bytes((9, 16, 0, 1)))
        + _chunk(b"mDCV", mastering.png_chunk())
        + _chunk(
            b"cLLI",
            struct.pack(">2I", *map(in_32_bits, (light.peak, light.average))),
        )
    )
    return data[:_PNG_HEAD] + chunks + data[_PNG_HEAD:]


def sdr_still(picture: Picture, suffix: str) -> bytes:
    """A JPEG or an 8-bit PNG of an R'G'B' picture (H, W, 3) in [0, 1]."""
    codes = np.asarray(np.round(picture[..., ::-1] * 255), np.uint8)
    return _encoded(suffix, codes, [cv2.IMWRITE_JPEG_QUALITY, 94] if suffix != ".png" else [])


def _encoded(suffix: str, codes: Any, options: list[int] | None = None) -> bytes:
    done, data = cv2.imencode(suffix, codes, options or [])
    assert done
    return bytes(data)


def _chunk(kind: bytes, payload: bytes) -> bytes:
    check = zlib.crc32(kind + payload)
    return struct.pack(">I", len(payload)) + kind + payload + struct.pack(">I", check)
