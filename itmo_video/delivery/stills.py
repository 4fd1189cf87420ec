"""Encoding stills: 16-bit PNG and TIFF with HDR tags; SDR JPEG, PNG and TIFF."""

from __future__ import annotations

import struct
import zlib
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from itmo_video.delivery import hdr
from itmo_video.delivery.lettering import RgbPicture
from itmo_video.delivery.metadata import Mastering, in_32_bits
from itmo_video.delivery.tiff import tiff_rgb16
from itmo_video.delivery.ycbcr import Planes
from itmo_video.kernels.compiled_codes import Curve
from itmo_video.source.icc import pq_profile

_JPEG = (".jpg", ".jpeg")
_PNG_HEAD = 8 + 25  # the signature and the IHDR chunk, which always comes first


def png_hdr(rgb_code: Planes, curve: Curve, mastering: Mastering, light: hdr.Light) -> bytes:
    """A 16-bit PNG of BT.2020 R'G'B' planes in PQ or HLG, with cICP; for PQ also mDCV and cLLI.

    PNG 3rd edition, 11.3.2.6 to 11.3.2.8: primaries 9, transfer 16 or 18, RGB, full range.
    """
    data = _encoded(".png", np.ascontiguousarray(_codes16(rgb_code)[..., ::-1]))
    # Colour chunks must precede the picture's data.
    chunks = _chunk(b"cICP", bytes((9, 16 if curve == "pq" else 18, 0, 1)))
    if curve == "pq":
        levels = map(in_32_bits, (light.peak, light.average))
        chunks += _chunk(b"mDCV", mastering.png_chunk())
        chunks += _chunk(b"cLLI", struct.pack(">2I", *levels))
    return data[:_PNG_HEAD] + chunks + data[_PNG_HEAD:]


def tiff_pq(rgb_code: Planes) -> bytes:
    """A 16-bit TIFF of PQ BT.2020 R'G'B' planes with a matching ICC profile."""
    return tiff_rgb16(_codes16(rgb_code), pq_profile())


def _codes16(rgb_code: Planes) -> npt.NDArray[np.uint16]:
    codes = cv2.multiply(np.dstack(rgb_code), (65535.0,) * 4, dtype=cv2.CV_16U)
    return np.asarray(codes, np.uint16)


def sdr_still(picture: RgbPicture, suffix: str) -> bytes:
    """An R'G'B' picture (H, W, 3) in [0, 1] as a JPEG or an 8-bit PNG or TIFF."""
    codes = np.asarray(np.round(picture[..., ::-1] * 255), np.uint8)
    return _encoded(suffix, codes, [cv2.IMWRITE_JPEG_QUALITY, 94] if suffix in _JPEG else [])


def _encoded(suffix: str, codes: Any, options: list[int] | None = None) -> bytes:
    done, data = cv2.imencode(suffix, codes, options or [])
    assert done
    return bytes(data)


def _chunk(kind: bytes, payload: bytes) -> bytes:
    check = zlib.crc32(kind + payload)
    return struct.pack(">I", len(payload)) + kind + payload + struct.pack(">I", check)
