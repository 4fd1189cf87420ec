"""Transfer functions: BT.1886, sRGB and pure gammas, PQ and HLG."""

from __future__ import annotations

import numpy as np

from itmo_video.model import Float32, Float64, Transfer

BT1886_GAMMA = 2.4  # ITU-R BT.1886 with a black of 0
_GAMMA: dict[Transfer, float] = {"bt1886": BT1886_GAMMA, "gamma22": 2.2, "linear": 1.0}


# IEC 61966-2-1 as published: slope, offset, exponent, and where the line ends in code and light.
SRGB_SLOPE, SRGB_OFFSET, SRGB_POWER = 12.92, 0.055, 2.4


SRGB_CODE, SRGB_LIGHT = 0.04045, 0.0031308


def eotf(code: Float64 | Float32, transfer: Transfer) -> Float64:
    """Display light, 1 at code 1, of nonlinear codes; odd-symmetric for negative codes.

    Any shape; returns float64. BT.1886 with a black of 0 is a power of 2.4 (ITU-R BT.1886), sRGB is
    IEC 61966-2-1. Raises ValueError for PQ and HLG, which have no display white of 1.
    """
    x = np.asarray(code, np.float64)
    size = np.abs(x)
    if transfer == "srgb":
        power = ((size + SRGB_OFFSET) / (1 + SRGB_OFFSET)) ** SRGB_POWER
        light = np.where(size <= SRGB_CODE, size / SRGB_SLOPE, power)
    else:
        light = size ** gamma_of(transfer)
    return np.copysign(light, x)


def inverse_eotf(light: Float64 | Float32, transfer: Transfer) -> Float64:
    """The nonlinear code of display light: the inverse of `eotf`, with the same domain."""
    y = np.asarray(light, np.float64)
    size = np.abs(y)
    if transfer == "srgb":
        power = (1 + SRGB_OFFSET) * size ** (1 / SRGB_POWER) - SRGB_OFFSET
        code = np.where(size <= SRGB_LIGHT, size * SRGB_SLOPE, power)
    else:
        code = size ** (1 / gamma_of(transfer))
    return np.copysign(code, y)


def gamma_of(transfer: Transfer) -> float:
    """The exponent of a transfer that is a power; raises ValueError for PQ and HLG."""
    if transfer not in _GAMMA:
        raise ValueError(f"{transfer} is not a transfer function of SDR")
    return _GAMMA[transfer]


# SMPTE ST 2084 / ITU-R BT.2100-2 table 4
_M1, _M2 = 2610 / 16384, 2523 / 4096 * 128


_C1, _C2, _C3 = 3424 / 4096, 2413 / 4096 * 32, 2392 / 4096 * 32


PQ_PEAK_NITS = 10000.0


# ITU-R BT.2100-2 table 5
_HLG_A = 0.17883277


_HLG_B = 1 - 4 * _HLG_A


_HLG_C = 0.5 - _HLG_A * float(np.log(4 * _HLG_A))


def pq_code(nits: Float64 | Float32) -> Float64:
    """PQ's nonlinear value, 0 to 1, of light in nits, 0 to 10000 (ST 2084's inverse EOTF)."""
    y = np.clip(np.asarray(nits, np.float64) / PQ_PEAK_NITS, 0, 1) ** _M1
    return np.asarray(((_C1 + _C2 * y) / (1 + _C3 * y)) ** _M2, np.float64)


def pq_nits(code: Float64 | Float32) -> Float64:
    """Light in nits of PQ's nonlinear value, 0 to 1 (ST 2084's EOTF)."""
    power = np.clip(np.asarray(code, np.float64), 0, 1) ** (1 / _M2)
    return PQ_PEAK_NITS * (np.maximum(power - _C1, 0) / (_C2 - _C3 * power)) ** (1 / _M1)


def hlg_gamma(peak_nits: float) -> float:
    """System gamma of a display with this peak (BT.2100-2, table 5, notes 5e and 5f).

    1.2 + 0.42 log10(peak / 1000) from 400 to 2000 nits, BT.2390's extended form outside.
    """
    if 400 <= peak_nits <= 2000:
        return float(1.2 + 0.42 * np.log10(peak_nits / 1000))
    return float(1.2 * 1.111 ** np.log2(peak_nits / 1000))


def hlg_oetf(scene: Float64 | Float32) -> Float64:
    """HLG's nonlinear value, 0 to 1, of scene light, 0 to 1 (BT.2100-2, table 5)."""
    e = np.clip(np.asarray(scene, np.float64), 0, 1)
    log = _HLG_A * np.log(np.maximum(12 * e - _HLG_B, 1e-9)) + _HLG_C
    return np.asarray(np.where(e <= 1 / 12, np.sqrt(3 * e), log), np.float64)
