"""Stills read by OpenImageIO: PNG, JPEG, TIFF, JPEG 2000, DPX, BMP, PNM, PSD in 8 and 16 bits.

The only module that imports OpenImageIO, and only inside functions, as most runs read films.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from itmo_video.errors import AlreadyHdrError, DamagedInputError, InputError
from itmo_video.regular_file import read_head
from itmo_video.source.files import check_pixels
from itmo_video.source.still_formats import StillFormat, cinema_profile
from itmo_video.source.still_picture import (
    DIGITAL_CINEMA,
    StillColour,
    StillPicture,
    exif_turn,
    split,
    straight,
)

_MOST_CHANNELS = 8
_SEPARATED, _LAB = 5, (8, 9, 10)  # TIFF's PhotometricInterpretation: inks; CIELab, ICCLab, ITULab
_HEAD_BYTES = 1 << 20  # large enough for any header, whatever boxes come first
_DPX_TRANSFERS = {1: 9, 2: 8, 3: 9, 5: 1, 6: 1, 7: 1, 8: 1, 9: 1, 10: 1}  # SMPTE 268M to H.273


def read_still(path: Path, kind: StillFormat, max_pixels: int) -> StillPicture | None:
    """Decode a still; None if its colours are CMYK, which need a profile.

    Raises DamagedInputError if it is incomplete, InputError for more than `max_pixels` (before
    allocation) and for unsupported pixels, AlreadyHdrError for floats.
    """
    import OpenImageIO

    where = str(path)
    config = OpenImageIO.ImageSpec()
    config.attribute("oiio:UnassociatedAlpha", 1)
    with _utf8_name(path) as name:
        reader = OpenImageIO.ImageInput.open(name, config)
    if reader is None:
        raise DamagedInputError(_reason(OpenImageIO.geterror()), where=where)
    try:
        spec = reader.spec()
        _check(spec, max_pixels, where)
        if _is_inks(spec):
            return None
        notices = _several(reader, kind)
        reader.seek_subimage(0, 0)
        is_eight = spec.format.basetype == OpenImageIO.UINT8
        wanted = OpenImageIO.UINT8 if is_eight else OpenImageIO.UINT16
        pixels = reader.read_image(0, 0, 0, spec.nchannels, wanted)
        fault = reader.geterror()
    finally:
        reader.close()
    if pixels is None or fault:
        raise DamagedInputError(_reason(fault), where=where)
    return _picture(kind, spec, np.asarray(pixels), 8 if is_eight else 16, notices, path)


@contextmanager
def _utf8_name(path: Path) -> Iterator[str]:
    """The file's name, or a link to it if it is not UTF-8, which OpenImageIO does not accept."""
    try:
        os.fspath(path).encode()
    except UnicodeEncodeError:
        with tempfile.TemporaryDirectory(prefix="itmo-video-") as folder:
            link = Path(folder, "still")
            link.symlink_to(path)
            yield os.fspath(link)
        return
    yield os.fspath(path)


def _check(spec: Any, max_pixels: int, where: str) -> None:
    width, height = spec.width, spec.height
    if width < 1 or height < 1 or spec.depth > 1:
        raise DamagedInputError(f"it has no size ({width}x{height}x{spec.depth})", where=where)
    check_pixels(width, height, max_pixels, where)
    form = str(spec.format)
    if form in ("half", "float", "double"):
        raise AlreadyHdrError(f"floating-point pixels ({form}): it is already HDR", where=where)
    if form.startswith("int"):
        raise InputError(f"signed pixels ({form}) are not supported", where=where)
    if spec.get_int_attribute("tiff:PhotometricInterpretation", -1) in _LAB:
        raise InputError(
            "colours are CIE L*a*b*, which is not supported",
            where=where,
            remedy="Convert it to RGB in the program that created it.",
        )
    if spec.nchannels > _MOST_CHANNELS:
        raise InputError(f"pictures with {spec.nchannels} channels are not supported", where=where)


def _is_inks(spec: Any) -> bool:
    if spec.get_int_attribute("tiff:PhotometricInterpretation", -1) == _SEPARATED:
        return True
    return spec.get_string_attribute("jpeg:ColorSpace") in ("CMYK", "YCCK")


def _several(reader: Any, kind: StillFormat) -> tuple[str, ...]:
    if kind != "tiff" or not reader.seek_subimage(1, 0):
        reader.geterror()
        return ()
    return ("several pages: only the first one is read",)


def _picture(
    kind: StillFormat, spec: Any, pixels: Any, bits: int, notices: tuple[str, ...], path: Path
) -> StillPicture:
    planes = split(pixels)
    count = spec.nchannels
    colours = 3 if count >= 3 else 1
    alpha_at = spec.alpha_channel
    has_alpha = colours <= alpha_at < count
    if kind == "bmp" and has_alpha and not planes[alpha_at].any():
        has_alpha = False  # the fourth byte of old headers is meaningless
    if count > colours + has_alpha:
        notices += (f"only {colours + has_alpha} of its {count} channels are read",)
    planes = (*planes[:colours], *((planes[alpha_at],) if has_alpha else ()))
    is_straight = kind != "tiff" or spec.get_int_attribute("oiio:UnassociatedAlpha", 0) == 1
    if has_alpha and not is_straight:
        planes, bits = straight(planes, bits), 16
        notices += ("colours are premultiplied by alpha: unpremultiplied",)
    profile = spec.getattribute("ICCProfile")
    return StillPicture(
        codec=kind,
        form=f"{'rgb' if colours == 3 else 'grey'}{'a' * has_alpha}{bits}",
        family="rgb" if colours == 3 else "grey",
        bit_depth=bits,
        planes=planes,
        has_alpha=has_alpha,
        turn=exif_turn(spec.get_int_attribute("Orientation", 1)),
        colour=StillColour(
            icc=None if profile is None else bytes(profile),
            cicp=_tags(path, kind),
        ),
        notices=notices,
    )


def _tags(path: Path, kind: StillFormat) -> tuple[int, int, int, int] | None:
    """A header's colour information other than a profile, by H.273's numbers."""
    if kind not in ("dpx", "jpeg2000"):
        return None
    head = read_head(path, _HEAD_BYTES)
    if kind == "jpeg2000":
        return DIGITAL_CINEMA if cinema_profile(head) else None
    # The transfer of a DPX's first element (SMPTE 268M, byte 801)
    transfer = _DPX_TRANSFERS.get(head[801]) if len(head) > 801 else None
    return None if transfer is None else (2, transfer, 2, 1)


def _reason(told: str) -> str:
    first = told.strip().splitlines()[0] if told.strip() else ""
    return f"cannot be decoded ({first})" if first else "cannot be decoded"
