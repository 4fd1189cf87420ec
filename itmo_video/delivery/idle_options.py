"""Options of a preview that its view or its kind of file does not use: named, not refused.

They may come from a config file, which serves films and stills alike.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

from itmo_video.delivery.preview_options import PreviewOptions
from itmo_video.delivery.still_files import JPEG, STILLS
from itmo_video.options import flag_of


def idle_options(output: Path, options: PreviewOptions) -> list[str]:
    """A notice about options that were changed but have no effect on `output`, or none."""
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
    if not changed:
        return []
    what = f"a {suffix} still" if is_still else "a film"
    have = "has" if len(changed) == 1 else "have"
    return [f"{', '.join(changed)} {have} no effect on {what} of this view ({options.view})"]
