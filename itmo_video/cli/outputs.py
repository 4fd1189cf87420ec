"""The output folder and name of each input."""

from __future__ import annotations

import os
import string
from collections.abc import Sequence
from dataclasses import dataclass

from itmo_video.conversion.frame_ranges import format_ranges
from itmo_video.errors import UsageError
from itmo_video.output.folder_names import check_folder_name
from itmo_video.source.numbered import together
from itmo_video.source.stills import NUMBER_PATTERN

_FIELDS = ("stem", "parent", "suffix", "number")
_KNOWN = (None, *_FIELDS)  # None for text without a field
_APART = ("{parent}-{stem}", "{stem}-{suffix}", "{number}-{stem}")


@dataclass(frozen=True)
class Outputs:
    """Source, folder and frames (None for all) of each conversion, and `notices` to print."""

    conversions: tuple[tuple[str, str, str | None], ...]
    notices: tuple[str, ...]


def named(inputs: Sequence[str], output: str, template: str | None) -> Outputs:
    """The folder of each input: `output` itself for one, otherwise `template` within it.

    Pictures of one sequence are one input. Raises UsageError if two inputs would share a folder,
    and for invalid templates and names.
    """
    check_folder_name(output, inputs[0])
    listed, told = together(inputs)
    sources = [entry.source for entry in listed]
    frames = [None if e.numbers is None else format_ranges(e.numbers) for e in listed]
    if len(sources) == 1 and template is None:
        folders = [output]
    else:
        names = [
            _name("{stem}" if template is None else template, s, n)
            for n, s in enumerate(sources, 1)
        ]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise UsageError(
                f"several inputs would go to {', '.join(os.path.join(output, n) for n in twice)}",
                remedy=f"Give them different names: --name '{_apart(sources)}'",
            )
        # With a slash, so that a name with a dot is not mistaken for a film's.
        folders = [os.path.join(output, name, "") for name in names]
    return Outputs(tuple(zip(sources, folders, frames, strict=True)), tuple(told))


def _apart(sources: Sequence[str]) -> str:
    def tells(template: str) -> bool:
        names = {_name(template, source, n) for n, source in enumerate(sources, 1)}
        return len(names) == len(sources)

    return next(filter(tells, _APART))


def _name(template: str, source: str, number: int) -> str:
    folder, base = os.path.split(os.path.abspath(source))
    stem, suffix = os.path.splitext(base)
    stem = NUMBER_PATTERN.sub("", stem).rstrip("._- ") or stem
    values = {
        "stem": stem, "parent": os.path.basename(folder), "suffix": suffix[1:], "number": number,
    }  # fmt: skip
    try:
        if unknown := [f for _, f, _, _ in string.Formatter().parse(template) if f not in _KNOWN]:
            raise ValueError(f"{{{unknown[0]}}} is unknown")
        name = template.format(**values)
    except (ValueError, IndexError, KeyError) as error:
        raise UsageError(
            f"--name {template!r} is invalid: {error}",
            remedy=f"Known: {', '.join(f'{{{field}}}' for field in _FIELDS)}",
        ) from error
    parts = name.split("/")
    if any(part in ("", ".", "..") for part in parts) or os.path.isabs(name):
        raise UsageError(f"--name: {name!r} is not a valid folder name in OUTPUT_DIR")
    return name
