"""Decoding a still file with the library for its format."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from itmo_video.errors import AlreadyHdrError, DamagedInputError, InputError
from itmo_video.regular_file import read_head, read_regular
from itmo_video.source import avif, lut_profile, oiio_stills, pillow_stills, png_chunks, raw_photos
from itmo_video.source.damage import DamageError, check_boxes, check_jpeg
from itmo_video.source.files import PICTURE_BYTES, check_pixels
from itmo_video.source.gain_map import NOTICE, has_gain_map
from itmo_video.source.icc import ProfileError
from itmo_video.source.still_formats import (
    HEAD_BYTES,
    StillFormat,
    is_float_image,
    stated_size,
    still_format,
)
from itmo_video.source.still_picture import StillColour, StillPicture, exif_turn
from itmo_video.source.tiff_directory import check_jpeg_parts

# Modes that OpenImageIO converts to RGB without the profile (Photoshop File Formats).
_PSD_MODES = {4: "CMYK", 7: "multichannel inks", 9: "CIE L*a*b*"}
_BY_PILLOW = ("webp", "gif", "apng", "avif", "heif", "qoi")


def kind_of(path: Path) -> StillFormat | None:
    """The format of a still by its first bytes, None if it is not a still.

    Raises AlreadyHdrError for floating-point images, InputError for unsupported formats.
    """
    head = read_head(path, HEAD_BYTES)
    if is_float_image(head):
        raise AlreadyHdrError(
            "floating-point image: it is already HDR",
            where=str(path),
            remedy="To see frames of a conversion, give its folder: "
            "itmo-video preview FOLDER OUTPUT --frame N.",
        )
    kind = still_format(head, path.suffix)
    if kind == "jpegxl":
        raise InputError(
            "JPEG XL is not supported",
            where=str(path),
            remedy="Convert it to PNG or TIFF (djxl in.jxl out.png).",
        )
    if kind == "cineon":
        raise AlreadyHdrError(
            "Cineon file: its codes are film density, not SDR",
            where=str(path),
            remedy="Convert it to display-referred SDR first (OpenColorIO's cineon transform).",
        )
    return kind


def read_still(path: Path, kind: StillFormat, max_pixels: int) -> StillPicture:
    """Decode a still, or the first frame of an animation.

    Raises DamagedInputError if it is incomplete, InputError if it is larger than `max_pixels` or
    not supported, AlreadyHdrError for floats.
    """
    where = str(path)
    data = read_regular(path, PICTURE_BYTES)
    size = stated_size(data, kind)
    if size is not None:
        check_pixels(*size, max_pixels, where)
    if kind == "psd":
        _check_psd(data, where)
    if kind == "tiff":
        raw_photos.check_tiff(data, where)
    facts = _checked(data, kind, where)
    if kind == "avif":
        picture = avif.read_still(data, max_pixels, where)
    elif kind in _BY_PILLOW or (kind == "jpeg" and has_gain_map(data, kind)):
        # OpenImageIO always applies the gain map of an Ultra HDR JPEG; Pillow reads the SDR base.
        picture = pillow_stills.read_still(data, kind, max_pixels, where)
    else:
        found = oiio_stills.read_still(path, kind, max_pixels)
        picture = found or _inks(data, kind, max_pixels, where)
    if facts is not None:
        gamma, xy = (None, None) if facts.is_srgb else (facts.gamma, facts.xy)
        # PNG, third edition, 4.3: code points override a profile, which overrides the rest.
        icc = facts.icc if facts.cicp is None else None
        colour = StillColour(icc=icc, cicp=facts.cicp, gamma=gamma, xy=xy)
        picture = replace(picture, colour=colour)
    if has_gain_map(data, kind):
        picture = replace(picture, notices=(*picture.notices, NOTICE))
    return picture


def _check_psd(data: bytes, where: str) -> None:
    found = _PSD_MODES.get(int.from_bytes(data[24:26], "big"))
    if found is not None:
        raise InputError(
            f"colours are {found}, which is not supported in PSD",
            where=where,
            remedy="Convert it to RGB in the program that created it.",
        )


def _checked(data: bytes, kind: StillFormat, where: str) -> png_chunks.PngFacts | None:
    try:
        if kind == "jpeg":
            check_jpeg(data)
        if kind == "tiff":
            check_jpeg_parts(data)
        if kind in ("heif", "avif"):
            check_boxes(data)
        return png_chunks.read_facts(data) if kind in ("png", "apng") else None
    except DamageError as error:
        raise DamagedInputError(str(error), where=where) from error


def _inks(data: bytes, kind: StillFormat, max_pixels: int, where: str) -> StillPicture:
    image, profile = pillow_stills.read_inks(data, kind, max_pixels, where)
    try:
        planes = lut_profile.to_rec2020(image, profile)
    except ProfileError as error:
        told = f"colours are CMYK, and the ICC profile cannot be used: {error}"
        raise InputError(told, where=where) from error
    return StillPicture(
        kind, "cmyk8", "rgb", 8, planes, False,
        exif_turn(image.getexif().get(0x0112)),
        StillColour(cicp=(9, 13, 2, 1)),  # the profile's destination: Rec. 2020, the sRGB curve
        ("colours are CMYK: converted with the ICC profile",),
    )  # fmt: skip
