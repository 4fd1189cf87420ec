"""A decoded still: codes as stored, not yet upright."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from itmo_video.model import Code, Family

DIGITAL_CINEMA = (10, 17, 0, 1)  # H.273's numbers for X'Y'Z' with the curve of SMPTE 428
Turn = tuple[int, bool]  # degrees clockwise, mirrored left-right first


@dataclass(frozen=True)
class StillColour:
    """A still's colour metadata, None where it has none.

    `icc` is an embedded profile; `cicp` (primaries, transfer, matrix, full range) by H.273; `gamma`
    and `xy` (white, red, green, blue) are those of PNG.
    """

    icc: bytes | None = None
    cicp: tuple[int, int, int, int] | None = None
    gamma: float | None = None
    xy: tuple[float, ...] | None = None


@dataclass(frozen=True)
class StillPicture:
    """Planes of codes by family, (R, G, B), (Y, Cb, Cr) or (Y,), then straight alpha.

    uint8 for 8 bits, otherwise uint16 with the code in the low bits. `turn` makes it upright.
    """

    codec: str
    form: str
    family: Family
    bit_depth: int
    planes: tuple[Code, ...]
    has_alpha: bool
    turn: Turn = (0, False)
    colour: StillColour = field(default_factory=StillColour)
    notices: tuple[str, ...] = ()

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) in pixels as stored."""
        height, width = self.planes[0].shape
        return width, height


def split(pixels: npt.NDArray[Any]) -> tuple[Code, ...]:
    """The planes of packed pixels (H, W) or (H, W, channels), each contiguous."""
    if pixels.ndim == 2:
        return (np.ascontiguousarray(pixels),)
    return tuple(np.ascontiguousarray(pixels[..., i]) for i in range(pixels.shape[2]))


def sixteen_bits(plane: Code, bits: int) -> Code:
    """Codes of `bits` bits scaled to 16."""
    top = (1 << bits) - 1
    return np.asarray((plane.astype(np.uint32) * 65535 + top // 2) // top, np.uint16)


def straight(planes: tuple[Code, ...], bit_depth: int) -> tuple[Code, ...]:
    """Unpremultiply by alpha, the last plane, to 16-bit codes, so that nothing is lost.

    Writers of associated alpha multiply the codes as stored, not light.
    Where alpha is 0, colour is 0.
    """
    top = 2.0**bit_depth - 1
    alpha = planes[-1].astype(np.float32) / top
    scale = np.divide(65535 / top, alpha, out=np.zeros_like(alpha), where=alpha > 0)
    colour = tuple(
        np.clip(np.rint(plane.astype(np.float32) * scale), 0, 65535).astype(np.uint16)
        for plane in planes[:-1]
    )
    return (*colour, np.rint(alpha * 65535).astype(np.uint16))


_EXIF_TURNS: dict[int, Turn] = {
    2: (0, True), 3: (180, False), 4: (180, True), 5: (270, True), 6: (90, False), 7: (90, True),
    8: (270, False),
}  # fmt: skip


def exif_turn(orientation: object) -> Turn:
    """The turn for Exif's orientation (1 to 8); none for anything else."""
    return _EXIF_TURNS.get(orientation, (0, False)) if isinstance(orientation, int) else (0, False)
