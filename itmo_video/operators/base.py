"""What an operator may know about a frame, and functions shared by several operators."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

from itmo_video.colour.transfer import BT1886_GAMMA
from itmo_video.model import Float32

Floats: TypeAlias = npt.NDArray[np.floating[Any]]

DELTA = 1e-3  # eq. 5; reproduces Table 1's Memorial to 1 %
FLOOR = 1e-6  # below this luminance the gain of FLOOR is used, to avoid 0 / 0 at black
OVER_CODE = 254 / 255  # Masia 2017 counts codes of 254 and more as over-exposed


@dataclass(frozen=True)
class FrameStats:
    """Statistics of one frame's luminance, in [0, 1]; computed only for operators that need them.

    `key` is Akyuz and Reinhard's (2006), from the 1st and 99th percentiles; `over_share` the share
    of over-exposed pixels, 0 to 1; `diffuse_white` the largest local mean (Meylan 2006).
    """

    minimum: float
    maximum: float
    geometric_mean: float
    key: float
    over_share: float
    diffuse_white: float


Recall: TypeAlias = Callable[[str, Callable[[], Any]], Any]


def made_anew(_what: str, make: Callable[[], Any]) -> Any:
    """A `Recall` without a cache."""
    return make()


@dataclass(frozen=True)
class Context:
    """What an operator may know: maxima in units of SDR white, and its parameters.

    `alpha` and `geometric_mean` (eq. 5, of the frame) are set only if the user gave alpha; `stats`
    only if the operator needs them; `density`, which computes the paper's Expand Map from luminance
    with the current settings, only while a map is computed from luminance; `wraps`: left and right
    meet, as in a panorama; `hue`, `lamps` and `footage` are the settings of those names.
    `recall(what, make)` returns results that depend on the picture alone, not on the look; a caller
    that tries several settings on one picture may cache them.
    """

    l_max: float
    l_white: float
    params: Mapping[str, float] = field(default_factory=dict)
    alpha: float | None = None
    geometric_mean: float | None = None
    stats: FrameStats | None = None
    hue: str = "restore"
    lamps: float = 1.0
    footage: str = "auto"
    density: Callable[[Float32], Float32] | None = None
    wraps: bool = False
    recall: Recall = made_anew

    def expand_map(self, luminance: Float32) -> Float32:
        """The paper's Expand Map with the settings; ValueError unless a map is being computed."""
        if self.density is None:
            raise ValueError(
                "the Expand Map is available only while a map is computed from luminance"
            )
        return self.density(luminance)

    @property
    def scale(self) -> float | None:
        """L_mean / alpha of eqs. 4 and 9, or None if the mean cancels by eq. 13."""
        if self.alpha is None:
            return None
        if self.geometric_mean is None:
            raise ValueError("alpha is set, so the frame's geometric mean is needed")
        return self.geometric_mean / self.alpha

    @property
    def frame(self) -> FrameStats:
        """The frame's statistics; ValueError if the operator did not request them."""
        if self.stats is None:
            raise ValueError("this operator needs the frame's statistics (needs_stats)")
        return self.stats


@dataclass(frozen=True)
class Parameter:
    """A parameter of an operator: its default, bounds and meaning."""

    default: float
    lower: float
    upper: float
    help: str


Curve: TypeAlias = Callable[[Floats, Context], Floats]
Gain: TypeAlias = Callable[[Float32, Context], Float32]


@dataclass(frozen=True)
class Guard:
    """The noise guard's smoothing of the curve's argument: a guided filter's radius and epsilon.

    The radius is in pixels at analysis size; contrasts of codes (0 to 1, squared) below epsilon are
    removed. `curve_map` is the index of the map that weights the curve, if there are several: where
    it is 0 no smoothing is needed.
    """

    radius_px: int
    epsilon: float
    curve_map: int | None = None


GRAIN = Guard(radius_px=3, epsilon=4e-4)  # 2 % of the code range counts as grain


def gain_of(curve: Curve) -> Gain:
    """The gain of a curve: expanded over display luminance, with luminance of at least FLOOR."""

    def gain(luminance: Float32, context: Context) -> Float32:
        above = np.maximum(luminance, np.float32(FLOOR))
        return np.asarray(curve(above, context) / above, np.float32)

    return gain


def geometric_mean(luminance: Float32, delta: float = DELTA) -> float:
    """Eq. 5: exp of the mean of log(delta + L_w) over the frame; luminance is linear."""
    return float(np.exp(np.mean(np.log(delta + luminance.astype(np.float64)))))


def light_of_code(code: float) -> float:
    """The linear luminance of a grey code in [0, 1], BT.1886."""
    return float(code**BT1886_GAMMA)


def code_of_light(luminance: Float32) -> Float32:
    """The grey code in [0, 1] of linear luminance, BT.1886, for publications that filter codes."""
    return np.asarray(np.power(luminance, np.float32(1 / BT1886_GAMMA)), np.float32)


def frame_stats(luminance: Float32) -> FrameStats:
    """Statistics of a frame's linear luminance, float32 (H, W) in [0, 1]."""
    height, width = luminance.shape
    low, high = np.percentile(luminance[:: max(1, height // 270), :: max(1, width // 480)], (1, 99))
    low, high = max(float(low), FLOOR), max(float(high), 2 * FLOOR)
    mean = geometric_mean(luminance, FLOOR)
    span = np.log(high / low)
    key = np.log(mean / low) / span if span > 1e-6 else 0.5
    side = max(1, round(max(height, width) / 50))  # Meylan 2006: a fiftieth of the picture
    local = cv2.blur(luminance, (side, side), borderType=cv2.BORDER_REPLICATE)
    return FrameStats(
        minimum=float(luminance.min()),
        maximum=float(luminance.max()),
        geometric_mean=mean,
        key=float(np.clip(key, 0, 1)),
        over_share=float(np.mean(luminance >= light_of_code(OVER_CODE))),
        diffuse_white=float(np.max(local)),
    )
