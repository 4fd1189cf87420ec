"""Gain-map stills: an SDR JPEG with a second picture that raises it to HDR on HDR displays.

Both forms of metadata are written: ISO 21496-1 (binary), and the XMP of Adobe and Android ("Ultra
HDR", version 1.0), with the same content. Pure except for the JPEG encoder.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from fractions import Fraction

import cv2
import numpy as np
import numpy.typing as npt

from itmo_video.colour.transfer import eotf, inverse_eotf
from itmo_video.delivery import jpeg_container
from itmo_video.model import Float32

OFFSET = 1 / 64  # k of both renditions, as in Android: exact in binary
BASE_QUALITY, MAP_QUALITY = 95, 92
_MULTICHANNEL, _BASE_SPACE = 1 << 7, 1 << 6


@dataclass(frozen=True)
class GainMapMetadata:
    """The scale of a gain map's codes in stops: code 0 is `lowest`, 255 `highest`.

    `headroom` is the display headroom over SDR white from which the full gain is applied.
    """

    lowest: float
    highest: float
    headroom: float

    def iso(self) -> bytes:
        """ISO 21496-1, annex C: three channels, in the base picture's primaries."""
        head = struct.pack(">2HB", 0, 0, _MULTICHANNEL | _BASE_SPACE)
        channel = b"".join(
            _fraction(value, signed)
            for value, signed in (
                (self.lowest, True), (self.highest, True), (1.0, False), (OFFSET, True),
                (OFFSET, True),
            )
        )  # fmt: skip
        return head + _fraction(0, False) + _fraction(self.headroom, False) + 3 * channel

    def xmp(self) -> bytes:
        """The gain map's XMP packet."""
        return jpeg_container.xmp_packet(
            'xmlns:hdrgm="http://ns.adobe.com/hdr-gain-map/1.0/" hdrgm:Version="1.0" '
            f'hdrgm:GainMapMin="{self.lowest:.6f}" hdrgm:GainMapMax="{self.highest:.6f}" '
            f'hdrgm:Gamma="1" hdrgm:OffsetSDR="{OFFSET}" hdrgm:OffsetHDR="{OFFSET}" '
            f'hdrgm:HDRCapacityMin="0" hdrgm:HDRCapacityMax="{self.headroom:.6f}" '
            'hdrgm:BaseRenditionIsHDR="False"'
        )


def gain_map_jpeg(sdr_linear: Float32, hdr_linear: Float32, peak: float) -> bytes:
    """A gain-map JPEG from two renditions, (H, W, 3) linear BT.709, 1.0 = SDR white in both.

    `peak` is the HDR rendition's maximum. The map is relative to the base as decoded, so that the
    base's compression losses do not affect the HDR picture; it has full size and three channels.
    """
    base_codes = np.asarray(
        np.round(inverse_eotf(np.clip(sdr_linear, 0, 1), "srgb") * 255), np.uint8
    )
    base = _jpeg(base_codes, BASE_QUALITY)
    decoded = cv2.imdecode(np.frombuffer(base, np.uint8), cv2.IMREAD_COLOR)
    assert decoded is not None
    shown = _LINEAR_OF_SRGB[decoded[..., ::-1]]
    hdr = np.clip(hdr_linear, 0, max(peak, 1.0))
    stops = np.log2((hdr + np.float32(OFFSET)) / (shown + np.float32(OFFSET)))
    lowest, highest = _rounded(float(stops.min())), _rounded(float(stops.max()))
    highest = max(highest, lowest + 1e-3)
    codes = np.round((stops - lowest) * (255 / (highest - lowest)))
    meaning = GainMapMetadata(lowest, highest, _rounded(max(float(np.log2(max(peak, 1))), 1e-3)))
    gain_map = _jpeg(np.asarray(np.clip(codes, 0, 255), np.uint8), MAP_QUALITY)
    return jpeg_container.joined(base, gain_map, meaning.xmp(), meaning.iso())


def _jpeg(rgb: npt.NDArray[np.uint8], quality: int) -> bytes:
    whole = cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444
    options = [cv2.IMWRITE_JPEG_QUALITY, quality, cv2.IMWRITE_JPEG_SAMPLING_FACTOR, whole]
    done, data = cv2.imencode(".jpg", np.ascontiguousarray(rgb[..., ::-1]), options)
    assert done
    return bytes(data)


def _rounded(stops: float) -> float:
    """Rounded to a value that both forms of metadata represent exactly."""
    return round(stops, 6)


def _fraction(value: float, signed: bool) -> bytes:
    exact = Fraction(value).limit_denominator(1_000_000)
    return struct.pack(">iI" if signed else ">2I", exact.numerator, exact.denominator)


_LINEAR_OF_SRGB = np.asarray(eotf(np.arange(256) / 255, "srgb"), np.float32)
