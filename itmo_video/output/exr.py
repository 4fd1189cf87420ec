"""Half-float OpenEXR frames on disk, written atomically and reproducibly to the byte.

The only module that imports OpenEXR, and only inside functions, so that importing this is fast.
We write files ourselves: OpenEXR's file writer loses the error if its last buffer does not fit on
the disk, and hardly describes failures. It encodes to memory; where we can lay out the chunks
faster (exr_scanlines) it makes the header only.
"""

from __future__ import annotations

import io
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt

from itmo_video.colour.primaries import CHROMATICITIES, Chromaticities, nearest_primaries
from itmo_video.compressions import COMPRESSIONS, WRITTEN
from itmo_video.errors import InputError
from itmo_video.model import Float32, Half
from itmo_video.output.atomic import write_parts, write_whole
from itmo_video.output.exr_chunks import ExrDamageError, check_chunks, with_window
from itmo_video.output.exr_claims import MOST_PIXEL_BYTES, check_claims
from itmo_video.output.exr_scanlines import scanline_file
from itmo_video.output.exr_windows import in_display_window, is_multi_part, part_index
from itmo_video.regular_file import StrPath, read_regular

_AP0 = CHROMATICITIES["aces2065-1"]
_PIXEL_KINDS = (np.uint32, np.float16, np.float32)  # by OpenEXR's PixelType
_MOST_FILE_BYTES = 2 * MOST_PIXEL_BYTES  # larger than any valid file, even badly compressed
_NO_LAYERS: Mapping[str, Half | Float32] = MappingProxyType({})


@dataclass(frozen=True)
class ExrHeader:
    """A frame's header apart from its size; nothing in it may depend on the run.

    `chromaticities` are x, y of red, green, blue and white; `white_nits` is the luminance of 1.0 in
    cd/m2; `time_s` the presentation time in seconds; `timecode` is "HH:MM:SS:FF" (";FF" for drop
    frame); `interop_id` is the Color Interop Forum's name of the colour space, "" for none. An ACES
    container (SMPTE ST 2065-4) must be AP0, uncompressed and without layers.
    """

    compression: str
    chromaticities: Chromaticities
    white_nits: float
    frame_rate: Fraction
    pixel_aspect: Fraction
    time_s: Fraction
    source_name: str
    fingerprint: str
    timecode: str | None = None
    settings_text: str = ""
    interop_id: str = ""
    owner: str | None = None
    comments: str | None = None
    is_aces_container: bool = False
    is_source_damaged: bool = False


@dataclass(frozen=True, eq=False)
class ExrImage:
    """One image as stored: channels, 2D arrays (height, width), and attributes by name."""

    channels: dict[str, npt.NDArray[Any]]
    attributes: dict[str, Any]

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) of the data window in pixels."""
        (left, top), (right, bottom) = self.attributes["dataWindow"]
        return int(right) - int(left) + 1, int(bottom) - int(top) + 1

    def shown(self, name: str) -> npt.NDArray[Any]:
        """A channel in the display window, 0 outside of the data window."""
        return in_display_window(self.channels[name], self.attributes)

    @property
    def primaries(self) -> str:
        """The name in colour.CHROMATICITIES of its primaries; rec709 if it states none."""
        stated = self.attributes.get("chromaticities")
        return "rec709" if stated is None else nearest_primaries(stated)

    @property
    def frame_rate(self) -> Fraction | None:
        """The stated frame rate, None if there is no usable one."""
        stated = self.attributes.get("framesPerSecond")
        return stated if isinstance(stated, Fraction) and 0 < stated <= 1000 else None

    @property
    def fingerprint(self) -> str | None:
        """The fingerprint that the frame was written with; None in other programs' files."""
        value = self.attributes.get("itmoFingerprint")
        return value if isinstance(value, str) else None

    @property
    def is_source_damaged(self) -> bool:
        """Whether the frame was written from a source frame that was damaged."""
        return self.attributes.get("itmoSourceDamaged") == 1


def write_exr(
    path: StrPath,
    rgb: tuple[Half, Half, Half],
    header: ExrHeader,
    *,
    alpha: Half | None = None,
    layers: Mapping[str, Half | Float32] = _NO_LAYERS,
    durable: bool = False,
) -> int:
    """Write one frame under a temporary name, rename it to `path` and return its size in bytes.

    `rgb`, `alpha` (RGB is expected premultiplied by it) and each of `layers` (by full channel name,
    such as "expand_map.Y"; float16 or float32) are arrays (height, width), written unchanged.
    `durable` waits until file and folder are on the disk. Raises ValueError for invalid arrays or
    headers, and OutputError if the file cannot be written; no temporary file is left behind.
    """
    import OpenEXR

    channels = _checked_channels(rgb, alpha, layers)
    if header.is_aces_container and (
        header.compression != "none" or layers or tuple(header.chromaticities) != _AP0
    ):
        raise ValueError("an ACES container must be uncompressed AP0 without layers")
    attributes = _attributes(header)
    encoded = io.BytesIO()
    if not COMPRESSIONS[header.compression].is_laid_out_here:
        OpenEXR.File(attributes, channels, num_threads=0).write(encoded)
        return write_whole(path, encoded.getbuffer(), durable=durable)
    # OpenEXR writes the header of a one-pixel picture; we write the chunks.
    pixels = {name: np.zeros((1, 1), channel.dtype) for name, channel in channels.items()}
    OpenEXR.File(attributes, pixels, num_threads=0).write(encoded)
    height, width = channels["R"].shape
    first = with_window(encoded.getvalue(), width, height)
    return write_parts(path, scanline_file(first, channels, header.compression), durable=durable)


def read_exr(path: StrPath, part: str | None = None) -> ExrImage:
    """Read all channels of a part of `path`; raises InputError if it is damaged.

    `part` is a name or a number (from 0), by default the first part with R, G and B.

    >>> from itmo_video import convert, read_exr
    >>> _ = convert("photo.png", "out")
    >>> image = read_exr("out/photo.0001.exr")
    >>> image.channels["G"].dtype, image.size, image.attributes["whiteLuminance"]
    (dtype('float16'), (96, 64), 203.0)
    """
    import OpenEXR

    data = read_regular(path, _MOST_FILE_BYTES)
    try:
        check_claims(data)
        check_chunks(data)
        if is_multi_part(data):
            return _part(data, part, os.fspath(path))
        if part not in (None, "0"):
            raise InputError(f"there is no part {part}, only one", where=os.fspath(path))
        file = OpenEXR.File(io.BytesIO(data), header_only=True)
        channels = _pixels(OpenEXR.InputFile(io.BytesIO(data)))
        attributes = dict(file.header())
    except InputError:
        raise
    except Exception as error:  # its bindings raise anything for a bad header, even TypeError
        reason = str(error) if isinstance(error, ExrDamageError) else "its pixels cannot be decoded"
        raise InputError(
            f"not an intact EXR file: {reason}",
            where=os.fspath(path),
            remedy="Write or copy the file again.",
        ) from error
    return ExrImage(channels, attributes)


def _part(data: bytes, wanted: str | None, where: str) -> ExrImage:
    import OpenEXR

    parts = OpenEXR.File(io.BytesIO(data), separate_channels=True, num_threads=0).parts
    at = part_index(parts, wanted, where)
    channels = {name: channel.pixels for name, channel in parts[at].channels.items()}
    return ExrImage(channels, dict(parts[at].header))


def _checked_channels(
    rgb: tuple[Half, Half, Half], alpha: Half | None, layers: Mapping[str, Half | Float32]
) -> dict[str, npt.NDArray[Any]]:
    channels: dict[str, npt.NDArray[Any]] = dict(zip("RGB", rgb, strict=True))
    if alpha is not None:
        channels["A"] = alpha
    for name in layers:
        if not name or name in ("R", "G", "B", "A"):
            raise ValueError(f"{name!r} cannot name a layer's channel")
    for name, array in (*channels.items(), *layers.items()):
        allowed = (np.float16, np.float32) if name in layers else (np.float16,)
        if array.ndim != 2 or array.size == 0 or array.shape != rgb[0].shape:
            raise ValueError(f"channel {name} has shape {array.shape}, R has {rgb[0].shape}")
        if array.dtype not in allowed:
            raise ValueError(f"channel {name} is {array.dtype}")
        # OpenEXR reads strided arrays as if they were contiguous, and keeps references to them.
        channels[name] = np.ascontiguousarray(array)
    return channels


def compression_constant(name: str) -> Any:
    """OpenEXR's constant for a compression name; raises ValueError for an unknown one."""
    import OpenEXR

    if name not in WRITTEN:
        raise ValueError(f"unknown compression {name!r}")
    return getattr(OpenEXR, COMPRESSIONS[name].openexr)


def _attributes(header: ExrHeader) -> dict[str, Any]:
    import OpenEXR

    attributes: dict[str, Any] = {
        "type": OpenEXR.scanlineimage,
        "compression": compression_constant(header.compression),
        "chromaticities": tuple(float(value) for value in header.chromaticities),
        "whiteLuminance": float(header.white_nits),
        "pixelAspectRatio": float(header.pixel_aspect),
        "itmoTime": exr_rational(header.time_s),
        "itmoSource": _utf8(header.source_name),
        "itmoSettings": _utf8(header.settings_text),
        "itmoFingerprint": _utf8(header.fingerprint),
    }
    if header.frame_rate > 0:
        attributes["framesPerSecond"] = exr_rational(header.frame_rate)
    if (timecode := _timecode(header.timecode)) is not None:
        attributes["timeCode"] = timecode
    if header.interop_id:
        attributes["colorInteropID"] = header.interop_id
    for name, text in (("owner", header.owner), ("comments", header.comments)):
        if text is not None:
            attributes[name] = _utf8(text)
    if header.is_aces_container:
        attributes["acesImageContainerFlag"] = 1
    if header.is_source_damaged:
        attributes["itmoSourceDamaged"] = 1
    return attributes


def exr_rational(value: Fraction) -> Fraction:
    """The nearest fraction that fits EXR's 32 bits, as OpenEXR would let it wrap around."""
    if abs(value.numerator) < 2**31 and value.denominator < 2**32:
        return value
    return value.limit_denominator(max(1, int((2**31 - 1) / (abs(value) + 1))))


def _utf8(text: str) -> str:
    return text.encode("utf-8", "backslashreplace").decode("utf-8")


def _timecode(text: str | None) -> Any:
    """An OpenEXR.TimeCode, or None if SMPTE 12M's fields cannot hold it (FF above 29)."""
    import OpenEXR

    match = re.fullmatch(r"(\d\d):(\d\d):(\d\d)([:;.])(\d\d)", text or "")
    if match is None:
        return None
    hours, minutes, seconds, separator, frame = match.groups()
    fields = [int(hours), int(minutes), int(seconds), int(frame), int(separator != ":")]
    try:  # the 13 others: colour frame, field phase, three group flags, eight binary groups
        return OpenEXR.TimeCode(*fields, *[0] * 13)
    except RuntimeError:
        return None


def _pixels(file: Any) -> dict[str, npt.NDArray[Any]]:
    """All channels of an OpenEXR.InputFile, whose readers raise errors; File's only print them."""
    header = file.header()
    low, high = header["dataWindow"].min, header["dataWindow"].max
    width, height = high.x - low.x + 1, high.y - low.y + 1
    found = {}
    for (name, kind), stored in zip(
        header["channels"].items(), file.channels(list(header["channels"])), strict=True
    ):
        shape = -(-height // kind.ySampling), -(-width // kind.xSampling)
        pixels = np.frombuffer(stored, _PIXEL_KINDS[kind.type.v])
        found[name] = pixels.reshape(shape).copy()  # writable
    return found
