"""The interface of an operator: a map from a keyframe's picture, and gains from the map."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping, Sequence
from typing import Literal, Protocol, runtime_checkable

from itmo_video.kernels.compiled_auto import SmallMaps
from itmo_video.kernels.compiled_light import CodesToLight
from itmo_video.model import Code, Float32, Half
from itmo_video.operators.base import Context, Guard, Parameter

Sees = Literal["luminance", "channels", "rgb"]


@runtime_checkable
class Operator(Protocol):
    """A named operator, without state between frames; both its functions are pure.

    `uses_alpha`, `uses_l_white` and `needs_stats` state which parts of the context it uses.
    `uses_map`: a map weights the result; `has_paper_map`: the map is the Expand Map of sections 2.2
    and 2.3 with the settings. `guard` is the noise guard's smoothing. Maps of an operator that
    follows edges itself are upsampled without edge guidance.
    """

    @property
    def name(self) -> str:
        """The name in settings and on the command line."""

    @property
    def summary(self) -> str:
        """A one-line description."""

    @property
    def source(self) -> str:
        """The publication."""

    @property
    def parameters(self) -> Mapping[str, Parameter]:
        """Its parameters by name."""

    @property
    def uses_map(self) -> bool:
        """Whether a map weights the result."""

    @property
    def uses_alpha(self) -> bool:
        """Whether it uses `alpha`."""

    @property
    def uses_l_white(self) -> bool:
        """Whether it uses `l_white`."""

    @property
    def needs_stats(self) -> bool:
        """Whether it uses the frame's statistics."""

    @property
    def guard(self) -> Guard:
        """The noise guard's smoothing."""

    @property
    def sees(self) -> Sees:
        """The input of `map`: luminance, R, G and B in turn, or all three at once."""

    @property
    def draws_edges(self) -> bool:
        """Whether `gains` follows the picture's edges itself."""

    @property
    def has_paper_map(self) -> bool:
        """Whether `map` is just the density of lights."""

    @property
    def reach_px(self) -> int:
        """How many rows of pixels above and below `gains` needs for the right ones."""

    def map(self, picture: Float32, context: Context) -> Float32:
        """Compute the map of a keyframe's picture: float32 (H, W) or (H, W, C), C <= 4, in [0, 1].

        `picture` is linear light in [0, 1] at analysis size without black bars: float32 (H, W), or
        (H, W, 3) for RGB. `context.density` computes the paper's Expand Map of (H, W).
        """

    def gains(
        self,
        rgb: Sequence[Float32],
        ratio: Float32 | None,
        maps: Sequence[Float32],
        context: Context,
        strength: float,
    ) -> list[Float32]:
        """Compute the gains of R, G and B, or one gain for all: new float32 arrays of their shape.

        `rgb` are planes (rows, W) of linear light, clamped to 1; `ratio` is smoothed over given
        luminance, 1 if None; `maps` are the planes of `map` at this size, empty for maps of 1.
        `strength` (0 to 1) is the share of the expansion to apply.
        """


@runtime_checkable
class WritesHalves(Protocol):
    """An operator that can multiply the picture by `gains` in one pass, as most frames need."""

    @property
    def reach_px(self) -> int:
        """As `Operator.reach_px`."""

    def expand(
        self,
        rgb: Sequence[Float32],
        ratio: Float32 | None,
        maps: Sequence[Float32],
        context: Context,
        strength: float,
        out: Half,
    ) -> None:
        """Write R, G and B times `gains` of the same arguments to `out` (3, rows, W), as halves.

        The products are limited to the range of half floats.
        """


@runtime_checkable
class ExpandsCodes(WritesHalves, Protocol):
    """An operator of four maps, or none, with a compiled pass from Y'CbCr codes to halves."""

    def from_codes(
        self,
        loaded: ctypes.CDLL,
        planes: Sequence[Code],
        rows: slice,
        codes: CodesToLight,
        maps: SmallMaps,
        context: Context,
        strength: float,
        out: Half,
    ) -> None:
        """`expand` of some rows of the planes Y, Cb and Cr into `out` (3, rows, W), same bytes.

        `loaded` is the compiled library; `codes` has an exponent; `maps` are at analysis size.
        """
