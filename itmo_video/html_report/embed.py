"""Pictures embedded in a page: HDR as lossless logarithmic codes, for exact read-outs."""

from __future__ import annotations

import base64
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from itmo_video.delivery import sdr
from itmo_video.delivery.lettering import RgbPicture
from itmo_video.delivery.pictures import Picture

CODES = 2047  # 11 bits: steps of 0.8 % over 24 stops, so an error of at most 0.4 %
LOWEST_STOP = -12


@dataclass(frozen=True)
class Embedded:
    """One frame for the viewer: `size` (width, height), and data URIs.

    `hdr` is twice as high as the frame: the upper 8 bits of the 11-bit codes are in the top half,
    the lower 3 in the bottom half.
    """

    number: int
    index: int
    size: tuple[int, int]
    hdr: str
    source: str | None
    map: str | None

    @property
    def length(self) -> int:
        """The number of characters it adds to the page."""
        return sum(len(uri) for uri in (self.hdr, self.source, self.map) if uri)


def highest_stop(peak: float) -> int:
    """The range of the codes for a film that peaks at `peak`, SDR white = 1."""
    return max(4, int(np.ceil(np.log2(max(peak, 1.0) * 1.01))))


def codes_of(linear: RgbPicture, top: int) -> npt.NDArray[np.uint16]:
    """11-bit logarithmic codes of linear light, the same shape; 0 stands for black."""
    stops = np.log2(np.maximum(linear, 2.0 ** (LOWEST_STOP - 1)))
    code = np.round((stops - LOWEST_STOP) / (top - LOWEST_STOP) * (CODES - 1)) + 1
    return np.asarray(np.clip(code, 0, CODES), np.uint16)


def embed(picture: Picture, primaries: str, peak: float, width: int) -> Embedded:
    """Embed one frame at `width` pixels at most, area-averaged in linear light."""
    linear = _at_most(sdr.to_709(picture.rgb, primaries), width)
    codes = codes_of(np.nan_to_num(linear, posinf=65504.0), highest_stop(peak))
    both = np.concatenate([codes >> 3, (codes & 7) << 5]).astype(np.uint8)
    source = map_ = None
    if picture.source is not None:
        before = sdr.encoded(_at_most(sdr.source_picture(picture.source), width))
        source = _uri("image/jpeg", ".jpg", _bgr8(before), [cv2.IMWRITE_JPEG_QUALITY, 88])
    if "expand_map.Y" in picture.layers:
        plane = np.asarray(picture.layers["expand_map.Y"], np.float32)
        small = _at_most(plane, width // 2)
        grey = np.asarray(np.round(np.clip(small, 0, 1) * 255), np.uint8)
        map_ = _uri("image/png", ".png", grey, [])
    height, across = linear.shape[:2]
    # Lossless WebP (quality above 100) is a third smaller than PNG, and all browsers support it.
    lossless = _uri("image/webp", ".webp", both[..., ::-1], [cv2.IMWRITE_WEBP_QUALITY, 101])
    return Embedded(picture.number, picture.index, (across, height), lossless, source, map_)


def _at_most(picture: Any, width: int) -> Any:
    if picture.shape[1] <= width:
        return picture
    size = (width, max(1, round(picture.shape[0] * width / picture.shape[1])))
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.float32)


def _bgr8(picture: RgbPicture) -> Any:
    return np.asarray(np.round(picture[..., ::-1] * 255), np.uint8)


def _uri(kind: str, suffix: str, codes: Any, options: list[int]) -> str:
    done, data = cv2.imencode(suffix, np.ascontiguousarray(codes), options)
    assert done
    return f"data:{kind};base64,{base64.b64encode(bytes(data)).decode()}"
