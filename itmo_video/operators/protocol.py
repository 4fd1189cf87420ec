"""What the renderer asks of an operator: a map of a keyframe's picture, and gains by it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal, Protocol, runtime_checkable

from itmo_video.kernels.compiled_auto import GainAuto
from itmo_video.model import Float32, Half
from itmo_video.operators.base import Context, Guard, Parameter

Sees = Literal["luminance", "channels", "rgb"]


@runtime_checkable
class Operator(Protocol):
    """A named operator. It has no state between frames; both its functions are pure.

    `uses_alpha` and `uses_l_white` tell which of the context it reads, `needs_stats` that it wants
    the frame's statistics. `uses_map` tells whether a map weighs the result; `has_paper_map` that
    it is the Expand Map of sections 2.2 and 2.3 as the settings make it. `guard` is what the noise
    guard smooths away. An operator that draws edges itself has its maps brought up without them.
    """

    @property
    def name(self) -> str:
        """As the settings and the command line have it."""

    @property
    def summary(self) -> str:
        """What it does, in a line."""

    @property
    def source(self) -> str:
        """Where it was published."""

    @property
    def parameters(self) -> Mapping[str, Parameter]:
        """Its own parameters by name."""

    @property
    def uses_map(self) -> bool:
        """Whether a map weighs the result."""

    @property
    def uses_alpha(self) -> bool:
        """Whether it reads `alpha`."""

    @property
    def uses_l_white(self) -> bool:
        """Whether it reads `l_white`."""

    @property
    def needs_stats(self) -> bool:
        """Whether it reads the frame's statistics."""

    @property
    def guard(self) -> Guard:
        """What the noise guard smooths away."""

    @property
    def sees(self) -> Sees:
        """What `map` is given: luminance, R, G and B one after another, or all three at once."""

    @property
    def draws_edges(self) -> bool:
        """Whether `gains` follows the picture's edges by itself."""

    @property
    def has_paper_map(self) -> bool:
        """Whether `map` is the density of lights and nothing else."""

    def map(self, picture: Float32, context: Context) -> Float32:
        """The map of a keyframe's picture, float32 (H, W) or (H, W, C), C at most 4, in [0, 1].

        `picture` is linear light in [0, 1] at analysis size without black bars: float32 (H, W), or
        (H, W, 3) where it sees RGB. `context.density` makes the paper's Expand Map of (H, W).
        """

    def gains(
        self,
        rgb: Sequence[Float32],
        ratio: Float32 | None,
        maps: Sequence[Float32],
        context: Context,
        strength: float,
    ) -> list[Float32]:
        """The gains of R, G and B, or one of all three: new float32 arrays of their shape.

        `rgb` are planes of linear light, more than 1 counting as 1; `ratio` is smoothed over given
        luminance, 1 if None; `maps` are the planes of `map` at this size, none for maps of 1.
        `strength` 0 to 1 is how much of the expansion is applied.
        """


@runtime_checkable
class WritesHalves(Protocol):
    """An operator that has `gains` times the picture in one pass: what is asked of most frames."""

    def numbers(self, context: Context) -> GainAuto:
        """What the compiled pass from codes to halves needs to know."""

    def expand(
        self,
        rgb: Sequence[Float32],
        ratio: Float32 | None,
        maps: Sequence[Float32],
        context: Context,
        strength: float,
        out: Half,
    ) -> None:
        """R, G and B times `gains` of the same arguments as halves into `out` (3, rows, W).

        The products are within a half's range.
        """
