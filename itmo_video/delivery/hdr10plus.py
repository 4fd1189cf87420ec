"""HDR10+ (SMPTE ST 2094-40) in a film's stream: a file's JSON as the messages that frames carry."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from itmo_video.errors import InputError
from itmo_video.untrusted import read_json

# ITU-T T.35: United States, Samsung, its code for ST 2094-40; application 4, version 1.
_HEADER = ((0xB5, 8), (0x003C, 16), (0x0001, 16), (4, 8), (1, 8))
_MOST = 100_000  # tenths of a nit
_MOST_VALUES = 15  # of a distribution, whose number has 4 bits


def read_hdr10plus(path: str | Path) -> list[bytes]:
    """The T.35 message of each frame, by the JSON that `analyse --hdr10plus` and others write.

    Profile A alone: InputError for tone curves (profile B), as for what is no such file.
    """
    document = read_json(path)
    try:
        entries = document["SceneInfo"]
        messages: list[bytes] = []
        for index, entry in enumerate(entries):
            if entry.get("BezierCurveData"):
                raise InputError(
                    "has tone curves (profile B)", where=str(path),
                    remedy="Take the metadata of this conversion: itmo-video analyse --hdr10plus.",
                )  # fmt: skip
            if entry["SequenceFrameIndex"] != index or entry["NumberOfWindows"] != 1:
                raise ValueError(f"entry {index}")
            messages.append(_message(entry["LuminanceParameters"]))
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise InputError(f"is not HDR10+ metadata: {error}", where=str(path)) from error
    return messages


def _message(light: dict[str, Any]) -> bytes:
    """ST 2094-40's syntax for one window of the whole picture, without the optional parts."""
    spread = light["LuminanceDistributions"]
    pairs = list(zip(spread["DistributionIndex"], spread["DistributionValues"], strict=True))
    if len(light["MaxScl"]) != 3 or len(pairs) > _MOST_VALUES:
        raise ValueError("a wrong number of values")
    fields = [*_HEADER, (1, 2), (0, 27), (0, 1)]  # windows, targeted display, its peaks
    fields += [(_checked(value, _MOST), 17) for value in (*light["MaxScl"], light["AverageRGB"])]
    fields.append((len(pairs), 4))
    for percent, value in pairs:
        fields += [(_checked(percent, 100), 7), (_checked(value, _MOST), 17)]
    # Fraction of bright pixels, mastering display's peaks, tone mapping, colour saturation.
    fields += [(0, 10), (0, 1), (0, 1), (0, 1)]
    return _packed(fields)


def _checked(value: Any, most: int) -> int:
    if type(value) is not int or not 0 <= value <= most:
        raise ValueError(f"{str(value)[:20]} is not a whole number from 0 to {most}")
    return value


def _packed(fields: Iterable[tuple[int, int]]) -> bytes:
    """Values of so many bits, most significant first, filled up to whole bytes by 0."""
    bits = "".join(f"{value:0{width}b}" for value, width in fields)
    bits += "0" * (-len(bits) % 8)
    return int(bits, 2).to_bytes(len(bits) // 8, "big")


def checked_length(messages: Sequence[bytes], frames: int, path: Path) -> None:
    """Raise InputError unless there is a message for each of so many frames."""
    if len(messages) != frames:
        raise InputError(
            f"is for {len(messages)} frames, the film has {frames}",
            where=str(path),
            remedy="Make it of the same frames: itmo-video analyse INPUT --hdr10plus FILE.json.",
        )
