"""The encoding of a still: by settings, its code points, its profile, or else sRGB."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from itmo_video.errors import AlreadyHdrError
from itmo_video.model import Encoding, Transfer
from itmo_video.source import icc, lut_profile, png_colour, tags
from itmo_video.source.still_picture import DIGITAL_CINEMA, StillPicture, sixteen_bits
from itmo_video.source.tags import InputOptions, Tags

_HDR_TRANSFERS = (16, 18)  # PQ and HLG


def resolve(
    picture: StillPicture, options: InputOptions, where: str
) -> tuple[StillPicture, Encoding, tuple[str, ...]]:
    """The picture (converted if its profile is not a known space), its encoding, and notices.

    Raises AlreadyHdrError for PQ, HLG and log code points that the user does not override.
    """
    told: list[str] = []
    found = Tags()
    colour = picture.colour
    points = None if colour.icc is None else icc.code_points_of(colour.icc)
    if points is not None and points[1] in _HDR_TRANSFERS and options.transfer == "auto":
        found = Tags(transfer=points[1], primaries=points[0])  # regardless of its curves
    elif colour.icc is not None:
        picture, found = _by_profile(picture, colour.icc, options, told)
    elif colour.cicp is not None:
        primaries, transfer, matrix, is_full = colour.cicp
        if picture.codec in ("png", "apng"):
            told += png_colour.unread_code_points(colour.cicp)
        is_coded = picture.family == "ycbcr"
        found = Tags(matrix=matrix if is_coded else 2, range=2 if is_full or not is_coded else 1)
        found = replace(found, transfer=transfer, primaries=primaries)
        if transfer == 8:  # integer linear light, whose white is 1: not HDR
            found = replace(found, transfer=2, named_transfer="linear")
    else:
        picture, found = png_colour.by_gamma_and_xy(picture, options, told)
    try:
        encoding, more = tags.resolve_encoding(
            found,
            options,
            family=picture.family,
            bit_depth=picture.bit_depth,
            has_alpha=picture.has_alpha,
            is_full_format=True,
            is_still=True,
            codec=picture.codec,
            size=picture.size,
            where=where,
        )
    except AlreadyHdrError as error:
        raise _in_words(error, picture) from error
    if picture.family != "ycbcr" and (options.matrix != "auto" or options.range != "auto"):
        told.append("--matrix and --range are ignored: the picture is RGB")
    return picture, encoding, (*told, *more)


def _in_words(error: AlreadyHdrError, picture: StillPicture) -> AlreadyHdrError:
    """The refusal of a tag, in terms of the format."""
    if picture.codec == "dpx":
        return AlreadyHdrError(
            "tagged as logarithmic: film density or camera log",
            where=error.where,
            remedy="Convert it to display-referred SDR first (OpenColorIO's cineon or camera "
            "transform); if the tag is wrong, use --transfer srgb.",
        )
    if picture.colour.cicp == DIGITAL_CINEMA:
        return AlreadyHdrError(
            "digital cinema profile: codes are X'Y'Z' (SMPTE 428), not RGB",
            where=error.where,
            remedy="Convert it to display-referred RGB first (OpenColorIO's DCDM transform); if it "
            "is RGB after all, use --transfer srgb.",
        )
    return error


def _by_profile(
    picture: StillPicture, data: bytes, options: InputOptions, told: list[str]
) -> tuple[StillPicture, Tags]:
    try:
        profile = icc.read_profile(data)
        if profile.space not in ("RGB", "GRAY"):
            raise icc.ProfileError(f"it is for {profile.space}, the picture is not")
        if profile.space == "GRAY" and picture.family != "grey":
            raise icc.ProfileError("it is for grey, the picture is not")
        curve, primaries = icc.named_curve(profile), icc.named_primaries(profile)
        if options.transfer != "auto" and (curve is None or primaries is None):
            told.append("ICC profile ignored, because --transfer is set")
            return picture, Tags(named_primaries=primaries)
        if picture.family == "grey" and profile.curves is not None:
            return _grey(picture, profile, curve)
        if curve is not None and primaries is not None:
            return picture, Tags(named_transfer=curve, named_primaries=primaries)
        return _converted(picture, profile, told)
    except icc.ProfileError as error:
        told.append(f"ICC profile ignored: {error}")
        return picture, Tags()


def _grey(
    picture: StillPicture, profile: icc.Profile, curve: Transfer | None
) -> tuple[StillPicture, Tags]:
    if curve is not None:
        return picture, Tags(named_transfer=curve, named_primaries="rec709")
    grey = icc.to_srgb_curve(profile, picture.planes[0], picture.bit_depth)
    planes = (grey, *(sixteen_bits(plane, picture.bit_depth) for plane in picture.planes[1:]))
    tagged = Tags(named_transfer="srgb", named_primaries="rec709")
    return replace(picture, planes=planes, bit_depth=16), tagged


def _converted(
    picture: StillPicture, profile: icc.Profile, told: list[str]
) -> tuple[StillPicture, Tags]:
    colours, alpha = picture.planes[: 1 if picture.family == "grey" else 3], picture.planes[-1:]
    bits = picture.bit_depth
    if profile.has_tables:
        image = lut_profile.image_of(colours, bits)
        done, out_bits = lut_profile.to_rec2020(image, profile.data), 8
        if bits > 8:
            told.append("ICC profile with tables applied in 8 bits")
    else:
        done, out_bits = icc.to_rec2020(profile, colours, bits), 16
    if picture.has_alpha:
        wide = sixteen_bits(alpha[0], bits)
        done = (*done, wide if out_bits == 16 else np.asarray(wide >> 8, np.uint8))
    told.append("ICC profile applied, converted to Rec. 2020 primaries")
    tagged = Tags(named_transfer="srgb", named_primaries="rec2020")
    return replace(picture, planes=done, bit_depth=out_bits, family="rgb"), tagged
