"""Options and settings that a preview's view or kind of file does not use: named, not refused.

They may come from a config file, which serves films and stills alike.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

from itmo_video.delivery.preview_options import PreviewOptions
from itmo_video.delivery.still_files import JPEG, STILLS
from itmo_video.options import flag_of
from itmo_video.settings import OF_FILE, Settings
from itmo_video.words import has_or_have

_OF_EXR = sorted({*OF_FILE} - {"primaries"})  # settings; primaries limit a preview's colours, too


def idle_options(
    output: Path, options: PreviewOptions, settings: Settings | None = None
) -> list[str]:
    """A notice about options that were changed but have no effect on `output`, or none.

    `settings` are those that the source is rendered with for it.
    """
    suffix, idle = output.suffix.lower(), set[str]()
    is_still, is_jpeg = suffix in STILLS, suffix in JPEG
    if is_still:
        idle |= {"chroma", "depth"} | ({"crf"} if is_jpeg else set())
    is_mapped = options.view in ("sdr", "compare")  # a gain map's SDR side may be, too
    if not (is_mapped or is_jpeg):
        idle.add("tone_map")
    changed = [
        flag_of(field)
        for field in dataclasses.fields(options)
        if field.name in idle and getattr(options, field.name) != field.default
    ]
    _, overrides = (settings and settings.asked) or ({}, {})
    of_files = [name for name in _OF_EXR if name in overrides]
    notices = list[str]()
    if of_files:
        have = has_or_have(len(of_files))
        notices = [f"{', '.join(of_files)} {have} an effect on EXR files only"]
    if not changed:
        return notices
    what = f"a {suffix} still" if is_still else "a film"
    told = f"{', '.join(changed)} {has_or_have(len(changed))} no effect on {what} of this view"
    return [*notices, f"{told} ({options.view})"]
