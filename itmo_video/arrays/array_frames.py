"""Arrays as a source of frames: validated and converted to codes for the renderer."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any, cast, get_args

import numpy as np
import numpy.typing as npt

from itmo_video.colour.transfer import inverse_eotf
from itmo_video.errors import AlreadyHdrError, DamagedInputError, UsageError
from itmo_video.model import ASSUMED_SEQUENCE_RATE, Code, Encoding, Frame, Primaries, Transfer
from itmo_video.settings import Settings

PRIMARIES: tuple[Primaries, ...] = get_args(Primaries)
_OF_FILES = ("matrix", "range", "deinterlace", "fps", "stream", "raw")


class ArrayFrames:
    """An iterable of pictures as frames of codes; it is read once, from its start."""

    def __init__(
        self,
        pictures: Iterable[npt.NDArray[Any]],
        settings: Settings,
        primaries: Primaries,
        bit_depth: int | None,
    ) -> None:
        """Raises UsageError for settings that do not apply to arrays."""
        plain = Settings()
        for name in _OF_FILES:
            if getattr(settings, name) != getattr(plain, name):
                raise UsageError(
                    f"{name} applies to files; arrays are full-range RGB",
                    remedy="Omit it.",
                )
        if primaries not in PRIMARIES:
            raise UsageError(f"primaries must be one of {', '.join(PRIMARIES)}, not {primaries!r}")
        self._pictures, self._primaries = pictures, primaries
        self._transfer, self._bit_depth = settings.transfer, bit_depth

    def frames(self, start: int = 0) -> Iterator[Frame]:
        """Yield the pictures as frames, from the first on.

        Raises UsageError for anything that is not a picture, AlreadyHdrError for light above white,
        and DamagedInputError if a picture differs in size from the first.
        """
        assert start == 0, "an iterable can only be read from its start"
        size: tuple[int, int] | None = None
        kind: np.dtype[Any] | None = None
        for index, given in enumerate(self._pictures):
            picture = np.asarray(given)
            kind = kind or picture.dtype
            if picture.dtype != kind:
                raise UsageError(
                    f"is {picture.dtype}, but the first is {kind}",
                    where=f"picture {index}",
                    remedy="Convert all pictures to one form: codes, or linear light.",
                )
            frame = self._frame(index, picture)
            size = size or frame.size
            if frame.size != size:
                raise DamagedInputError(
                    f"it is {frame.size[0]}x{frame.size[1]}, the first {size[0]}x{size[1]}",
                    where=f"picture {index}",
                )
            yield frame

    def _frame(self, index: int, picture: npt.NDArray[Any]) -> Frame:
        where = f"picture {index}"
        if picture.ndim != 3 or picture.shape[2] != 3 or 0 in picture.shape:
            raise UsageError(
                f"an array of shape {picture.shape} is not a picture",
                where=where,
                remedy="Pictures are RGB, with the shape (height, width, 3).",
            )
        transfer = _transfer_of(picture, self._transfer, where)
        if np.issubdtype(picture.dtype, np.floating):
            codes, bit_depth = _codes_of_light(picture, where), 16
        else:
            codes, bit_depth = picture, _depth_of(picture, self._bit_depth, where)
        # Copies: the caller may reuse the array for the next picture.
        planes = cast(tuple[Code, ...], tuple(codes[..., i].copy() for i in range(3)))
        encoding = Encoding("rgb", bit_depth, "bt709", "full", transfer, self._primaries)
        # Arrays have no times, and pictures do not depend on them.
        return Frame(index, index / ASSUMED_SEQUENCE_RATE, planes, encoding)


def _transfer_of(picture: npt.NDArray[Any], transfer: str, where: str) -> Transfer:
    if not np.issubdtype(picture.dtype, np.floating):
        return "srgb" if transfer == "auto" else cast(Transfer, transfer)
    if transfer not in ("auto", "linear"):
        raise UsageError(
            f"floats are linear light, but transfer is {transfer}",
            where=where,
            remedy="Pass uint8 or uint16 codes, or omit transfer.",
        )
    return "srgb"


def _depth_of(picture: npt.NDArray[Any], bit_depth: int | None, where: str) -> int:
    most = {np.dtype(np.uint8): 8, np.dtype(np.uint16): 16}.get(picture.dtype)
    if most is None:
        raise UsageError(
            f"an array of {picture.dtype} is not a picture",
            where=where,
            remedy="Codes are uint8 or uint16; linear light (SDR white = 1) is floating point.",
        )
    depth = most if bit_depth is None else bit_depth
    if isinstance(depth, bool) or not isinstance(depth, int):
        raise UsageError(f"bit_depth must be a whole number, not {bit_depth!r}")
    if not 8 <= depth <= most or (depth == 8) != (most == 8):
        raise UsageError(f"{picture.dtype} cannot hold codes of {depth} bits", where=where)
    if (top := int(picture.max())) >= 2**depth:
        raise UsageError(f"the highest code is {top}, more than {depth} bits hold", where=where)
    return depth


def _codes_of_light(picture: npt.NDArray[Any], where: str) -> Code:
    """Linear light, 0 to 1, as 16-bit sRGB codes: within 6e-7 in the dark, 1e-5 elsewhere."""
    low, high = float(picture.min()), float(picture.max())
    if not np.isfinite(low + high):
        raise UsageError("contains values that are not finite", where=where)
    if high > 1:
        raise AlreadyHdrError(
            f"already HDR: up to {high:g} times SDR white",
            where=where,
            remedy="SDR white is 1; if it only overshoots, use numpy.clip(rgb, 0, 1).",
        )
    if low < 0:
        raise UsageError(f"contains negative light, {low:g}", where=where, remedy="Use numpy.clip.")
    return np.asarray(np.rint(inverse_eotf(picture, "srgb") * 65535), np.uint16)
