"""Colour of PNGs without a profile: gAMA, cHRM, and unusual values of cICP."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from itmo_video.colour.primaries import CHROMATICITIES
from itmo_video.model import Primaries, Transfer
from itmo_video.source import icc
from itmo_video.source.still_picture import StillPicture, sixteen_bits
from itmo_video.source.tags import InputOptions, Tags

_GAMMAS: dict[Transfer, float] = {"gamma22": 1 / 2.2, "linear": 1.0}
_LEAST_GAMMA, _MOST_GAMMA = 0.2, 1.5  # encoding exponents; beyond these, the file is wrong


def by_gamma_and_xy(
    picture: StillPicture, options: InputOptions, told: list[str]
) -> tuple[StillPicture, Tags]:
    """The picture, converted if its gamma is not a known transfer, and the tags of its chunks."""
    gamma, primaries = picture.colour.gamma, _named_primaries(picture.colour.xy)
    if picture.colour.xy is not None and primaries is None:
        told.append("primaries (cHRM) match no known colour space: read as rec709")
    if gamma is None:
        return picture, Tags(named_primaries=primaries)
    named = next((name for name, value in _GAMMAS.items() if abs(gamma - value) < 0.005), None)
    if named is not None or options.transfer != "auto":
        return picture, Tags(named_transfer=named, named_primaries=primaries)
    if not _LEAST_GAMMA <= gamma <= _MOST_GAMMA:
        told.append(f"gamma (gAMA) of {gamma:g} is implausible and ignored")
        return picture, Tags(named_primaries=primaries)
    count = 1 if picture.family == "grey" else 3
    bits = picture.bit_depth
    planes = (
        *(icc.recoded(lambda code: code ** (1 / gamma), p, bits) for p in picture.planes[:count]),
        *(sixteen_bits(plane, bits) for plane in picture.planes[count:]),
    )
    told.append(f"gamma (gAMA) of 1/{1 / gamma:.3g} applied, converted to the sRGB curve")
    tagged = Tags(named_transfer="srgb", named_primaries=primaries)
    return replace(picture, planes=planes, bit_depth=16), tagged


def unread_code_points(cicp: tuple[int, int, int, int]) -> list[str]:
    """Notices about ignored values of cICP: a PNG is RGB, and nearly always full range."""
    _, _, matrix, is_full = cicp
    told = []
    if not is_full:
        told.append("tagged (cICP) as limited range: read as full range, as usual for RGB")
    if matrix != 0:
        told.append(f"matrix (cICP, {matrix}) is ignored: the picture is RGB")
    return told


def _named_primaries(xy: Sequence[float] | None) -> Primaries | None:
    if xy is None:
        return None
    stated = (*xy[2:], *xy[:2])
    for name in icc.KNOWN_PRIMARIES:
        if max(abs(a - b) for a, b in zip(stated, CHROMATICITIES[name], strict=True)) < 0.003:
            return name
    return None
