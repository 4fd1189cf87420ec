"""ICC profiles of stills: known curves and primaries are recognised, others applied.

Matrix and grey profiles (ICC.1:2022, F.3 and F.2) are applied here in floats, to keep the
precision of 16 bits; LittleCMS applies profiles with tables (lut_profile). Rendering is relative
colorimetric: the profile's white is white.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from itmo_video.colour.primaries import rgb_to_xyz_matrix, white_adaptation, white_xyz
from itmo_video.colour.transfer import (
    PQ_PEAK_NITS,
    SRGB_LIGHT,
    SRGB_OFFSET,
    SRGB_POWER,
    SRGB_SLOPE,
    eotf,
    inverse_eotf,
    pq_nits,
)
from itmo_video.model import Code, Float64, Primaries, Transfer

Curve = Callable[[Float64], Float64]

D50_XYZ = (0.9642, 1.0, 0.8249)  # the profile connection space's white
_MOST_BYTES = 16 << 20
_NEAR_LIGHT, _NEAR_XYZ = 1e-3, 2.5e-3  # tolerance for recognising a curve or primary
_KNOWN_CURVES: tuple[Transfer, ...] = ("srgb", "gamma22", "linear", "bt1886")
KNOWN_PRIMARIES: tuple[Primaries, ...] = ("rec709", "p3d65", "adobergb", "rec2020")
_STRIP_ROWS = 64
_PQ_POINTS = 4096


class ProfileError(ValueError):
    """A profile that cannot be used; the message says why."""


@dataclass(frozen=True)
class Profile:
    """A profile's class of colour ("RGB", "GRAY", "CMYK", ...), its curves and colorants.

    `curves` has one per channel, from code (0 to 1) to light; `to_xyz` converts linear RGB to D50
    XYZ. Both are None if the profile has tables instead (`has_tables`).
    """

    space: str
    curves: tuple[Curve, ...] | None
    to_xyz: Float64 | None
    has_tables: bool
    data: bytes


def read_profile(data: bytes) -> Profile:
    """Parse a profile; raises ProfileError if it is damaged or of another class."""
    if len(data) < 132 or data[36:40] != b"acsp" or len(data) > _MOST_BYTES:
        raise ProfileError("it is not an ICC profile")
    space = data[16:20].decode("latin-1").strip()
    tags = _tags(data)
    tables = next((tags[name] for name in (b"A2B1", b"A2B0") if name in tags), None)
    try:
        if tables is not None or (space == "CMYK"):
            return Profile(space, None, None, tables is not None, data)
        if space == "GRAY":
            return Profile(space, (_curve(tags[b"kTRC"]),), None, False, data)
        if space == "RGB":
            curves = tuple(_curve(tags[name]) for name in (b"rTRC", b"gTRC", b"bTRC"))
            columns = [_xyz(tags[name]) for name in (b"rXYZ", b"gXYZ", b"bXYZ")]
            return Profile(space, curves, np.array(columns).T, False, data)
    except (KeyError, struct.error, IndexError) as error:
        raise ProfileError("it is damaged or lacks curves or colorants") from error
    raise ProfileError(f"its colour space is {space}")


def named_curve(profile: Profile) -> Transfer | None:
    """The known transfer function that all curves of a profile match, None if there is none."""
    if profile.curves is None:
        return None
    codes = np.linspace(0, 1, 1024)
    for name in _KNOWN_CURVES:
        want = eotf(codes, name)
        if all(np.abs(curve(codes) - want).max() < _NEAR_LIGHT for curve in profile.curves):
            return name
    return None


def named_primaries(profile: Profile) -> Primaries | None:
    """The known primaries that a profile's colorants match, None if there are none."""
    if profile.to_xyz is None:
        return None
    for name in KNOWN_PRIMARIES:
        if np.abs(profile.to_xyz - _d50_matrix(name)).max() < _NEAR_XYZ:
            return name
    return None


def to_srgb_curve(profile: Profile, grey: Code, bit_depth: int) -> Code:
    """Grey codes converted by the profile's (first) curve to 16-bit sRGB-curve codes."""
    assert profile.curves is not None
    return recoded(profile.curves[0], grey, bit_depth)


def recoded(curve: Curve, plane: Code, bit_depth: int) -> Code:
    """Codes converted by a curve from code to light, both in 0..1, to 16-bit sRGB-curve codes."""
    return np.asarray(_coded(curve(_levels(bit_depth)))[plane], np.uint16)


def to_rec2020(profile: Profile, planes: tuple[Code, ...], bit_depth: int) -> tuple[Code, ...]:
    """RGB codes converted by a matrix profile to 16 bits, Rec. 2020 primaries, the sRGB curve.

    Colours outside Rec. 2020 are clipped; white is exactly 65535.
    """
    assert profile.curves is not None
    assert profile.to_xyz is not None
    matrix = np.linalg.solve(_d50_matrix("rec2020"), profile.to_xyz)
    if np.abs(matrix.sum(axis=1) - 1).max() < 5e-3:  # rounded colorants: white stays white
        matrix /= matrix.sum(axis=1, keepdims=True)
    tables = [curve(_levels(bit_depth)) for curve in profile.curves]
    out: tuple[Code, ...] = tuple(np.empty(plane.shape, np.uint16) for plane in planes)
    for top in range(0, planes[0].shape[0], _STRIP_ROWS):
        rows = slice(top, top + _STRIP_ROWS)
        light = np.stack([table[p[rows]] for table, p in zip(tables, planes, strict=True)], -1)
        coded = _coded(light @ matrix.T)
        for i, plane in enumerate(out):
            plane[rows] = coded[..., i]
    return out


def rec2020_profile() -> bytes:
    """A profile with Rec. 2020 primaries and the sRGB curve, as LittleCMS's destination."""
    return matrix_profile(_d50_matrix("rec2020"))


def pq_profile() -> bytes:
    """A profile with Rec. 2020 primaries and PQ, as code points (cicp) and as a full curve.

    Programs without PQ support show 10000 nits as white. ICC.1:2022, 9.2.17 and 10.3.
    """
    light = pq_nits(np.linspace(0, 1, _PQ_POINTS)) / PQ_PEAK_NITS
    points = np.rint(light * 65535).astype(">u2")
    curve = b"curv" + bytes(4) + struct.pack(">I", points.size) + points.tobytes()
    return matrix_profile(_d50_matrix("rec2020"), curve=curve, code_points=(9, 16, 0, 1))


def code_points_of(data: bytes) -> tuple[int, int, int, int] | None:
    """A profile's code points (cicp): (primaries, transfer, matrix, full range) by H.273."""
    try:
        tag = _tags(data)[b"cicp"]
        primaries, transfer, matrix, is_full = struct.unpack_from(">4B", tag, 8)
    except (KeyError, struct.error, ProfileError):
        return None
    return primaries, transfer, matrix, is_full


def matrix_profile(
    to_xyz: Float64,
    gamma: float | None = None,
    *,
    curve: bytes | None = None,
    code_points: tuple[int, int, int, int] | None = None,
) -> bytes:
    """An ICC v4 matrix profile of D50 colorants, with the sRGB curve, a power, or a curve tag."""

    def fixed(*values: float) -> bytes:
        return struct.pack(f">{len(values)}i", *(round(value * 65536) for value in values))

    if curve is not None:
        pass
    elif gamma is not None:
        curve = b"para" + bytes(4) + struct.pack(">HH", 0, 0) + fixed(gamma)
    else:
        scale = 1 / (1 + SRGB_OFFSET)
        linear_to = SRGB_SLOPE * SRGB_LIGHT
        numbers = (SRGB_POWER, scale, SRGB_OFFSET * scale, 1 / SRGB_SLOPE, linear_to)
        curve = b"para" + bytes(4) + struct.pack(">HH", 3, 0) + fixed(*numbers)
    text = "itmo".encode("utf-16-be")
    words = b"mluc" + bytes(4) + struct.pack(">IIHHII", 1, 12, 0x656E, 0x5553, len(text), 28) + text
    xyz = [b"XYZ " + bytes(4) + fixed(*to_xyz[:, i]) for i in range(3)]
    bodies = [
        (b"desc", words), (b"cprt", words), (b"wtpt", b"XYZ " + bytes(4) + fixed(*D50_XYZ)),
        (b"rXYZ", xyz[0]), (b"gXYZ", xyz[1]), (b"bXYZ", xyz[2]),
        (b"rTRC", curve), (b"gTRC", curve), (b"bTRC", curve),
    ]  # fmt: skip
    if code_points is not None:
        bodies.append((b"cicp", b"cicp" + bytes(4) + bytes(code_points)))
    at = 128 + 4 + 12 * len(bodies)
    table, content = struct.pack(">I", len(bodies)), b""
    for name, body in bodies:
        table += name + struct.pack(">II", at + len(content), len(body))
        content += body + bytes(-len(body) % 4)
    head = struct.pack(">I", at + len(content)) + bytes(4) + b"\x04\x40\0\0" + b"mntrRGB XYZ "
    head += struct.pack(">6H", 2026, 1, 1, 0, 0, 0) + b"acsp" + bytes(28) + fixed(*D50_XYZ)
    return head.ljust(128, b"\0") + table + content


def _d50_matrix(primaries: str) -> Float64:
    adapt = white_adaptation(white_xyz(primaries), np.array(D50_XYZ))
    return np.asarray(adapt @ rgb_to_xyz_matrix(primaries), np.float64)


def _levels(bit_depth: int) -> Float64:
    return np.asarray(np.arange(2**bit_depth) / (2**bit_depth - 1), np.float64)


def _coded(light: Float64) -> Code:
    """16-bit codes of the sRGB curve."""
    return np.asarray(np.rint(inverse_eotf(np.clip(light, 0, 1), "srgb") * 65535), np.uint16)


def _tags(data: bytes) -> dict[bytes, bytes]:
    (count,) = struct.unpack_from(">I", data, 128)
    tags: dict[bytes, bytes] = {}
    for i in range(min(count, 200)):
        entry = data[132 + 12 * i : 144 + 12 * i]
        if len(entry) < 12:
            raise ProfileError("it is truncated")
        name, at, size = struct.unpack(">4sII", entry)
        tags[name] = data[at : at + size]
    return tags


def _xyz(tag: bytes) -> tuple[float, float, float]:
    x, y, z = struct.unpack_from(">3i", tag, 8)
    return x / 65536, y / 65536, z / 65536


def _curve(tag: bytes) -> Curve:
    """A curveType (10.6) or parametricCurveType (10.18)."""
    if tag[:4] == b"curv":
        (count,) = struct.unpack_from(">I", tag, 8)
        if count == 0:
            return lambda code: code
        values = np.frombuffer(tag, ">u2", count, 12) if len(tag) >= 12 + 2 * count else None
        if values is None:
            raise ProfileError("one of its curves is truncated")
        if count == 1:
            gamma = float(values[0]) / 256
            return lambda code: code**gamma
        points, table = np.linspace(0, 1, count), values / 65535
        return lambda code: np.interp(code, points, table)
    if tag[:4] != b"para":
        raise ProfileError("one of its curves is of an unknown type")
    (kind,) = struct.unpack_from(">H", tag, 8)
    if kind > 4:
        raise ProfileError("one of its curves is of an unknown type")
    count = (1, 3, 4, 5, 7)[kind]
    numbers = [value / 65536 for value in struct.unpack_from(f">{count}i", tag, 12)]
    g, a, b, c, d, e, f = numbers + [0.0] * (7 - count)
    if kind == 0:
        return lambda code: code**g
    if kind in (1, 2):  # below -b / a it is constant
        d, e, c = (-b / a if a else 0.0), c, 0.0
        f = e
    return lambda code: np.where(code >= d, np.maximum(a * code + b, 0) ** g + e, c * code + f)
