"""What a PNG's chunks say of colour where no profile does: gAMA, cHRM, and cICP's odd points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from itmo_video.colour.primaries import CHROMATICITIES
from itmo_video.model import Primaries, Transfer
from itmo_video.source import icc
from itmo_video.source.still_picture import StillPicture, sixteen_bits
from itmo_video.source.tags import InputOptions, Tags

_PRIMARIES: tuple[Primaries, ...] = ("rec709", "p3d65", "adobergb", "rec2020")
_GAMMAS: dict[Transfer, float] = {"gamma22": 1 / 2.2, "linear": 1.0}
_LEAST_GAMMA, _MOST_GAMMA = 0.2, 1.5  # of encoding; beyond, the number is a writer's error


def by_gamma_and_xy(
    picture: StillPicture, options: InputOptions, told: list[str]
) -> tuple[StillPicture, Tags]:
    """The picture, converted where its gamma is of no known transfer, and what its chunks name."""
    gamma, primaries = picture.colour.gamma, _named_primaries(picture.colour.xy)
    if picture.colour.xy is not None and primaries is None:
        told.append("its primaries (cHRM) are of no known space: read as rec709")
    if gamma is None:
        return picture, Tags(named_primaries=primaries)
    named = next((name for name, value in _GAMMAS.items() if abs(gamma - value) < 0.005), None)
    if named is not None or options.transfer != "auto":
        return picture, Tags(named_transfer=named, named_primaries=primaries)
    if not _LEAST_GAMMA <= gamma <= _MOST_GAMMA:
        told.append(f"its gamma (gAMA) of {gamma:g} is left out: no picture has such a one")
        return picture, Tags(named_primaries=primaries)
    count = 1 if picture.family == "grey" else 3
    bits = picture.bit_depth
    planes = (
        *(icc.recoded(lambda code: code ** (1 / gamma), p, bits) for p in picture.planes[:count]),
        *(sixteen_bits(plane, bits) for plane in picture.planes[count:]),
    )
    told.append(f"its gamma (gAMA) of 1/{1 / gamma:.3g} is applied: the sRGB curve from here on")
    tagged = Tags(named_transfer="srgb", named_primaries=primaries)
    return replace(picture, planes=planes, bit_depth=16), tagged


def unread_code_points(cicp: tuple[int, int, int, int]) -> list[str]:
    """What of cICP is not read, in words: PNG holds RGB, of full range nearly always."""
    _, _, matrix, is_full = cicp
    told = []
    if not is_full:
        told.append("it is tagged (cICP) as of limited range: read as full, as RGB mostly is")
    if matrix != 0:
        told.append(f"its matrix (cICP, {matrix}) is left out: the picture comes as RGB")
    return told


def _named_primaries(xy: Sequence[float] | None) -> Primaries | None:
    if xy is None:
        return None
    stated = (*xy[2:], *xy[:2])
    for name in _PRIMARIES:
        if max(abs(a - b) for a, b in zip(stated, CHROMATICITIES[name], strict=True)) < 0.003:
            return name
    return None
