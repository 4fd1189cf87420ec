"""How settings differ, in words: two manifests', or a frame's and its folder's."""

from __future__ import annotations

import json
from collections.abc import Mapping

from itmo_video.untrusted import parse_json


def settings_changes(old: Mapping[str, object], new: Mapping[str, object]) -> list[str]:
    """`peak-nits 600 -> 1000` for each setting that differs, the first four of them.

    Both are plain values by name, as in manifests.
    """

    def show(values: Mapping[str, object], name: str) -> str:
        value = values.get(name)
        if isinstance(value, float):
            return f"{value:.6g}"
        return json.dumps(value, sort_keys=True) if name in values else "unset"

    # In folders from before it was recorded, the frames' fingerprints decide.
    names = sorted((old.keys() | new.keys()) - ({"algorithm"} - old.keys()))
    pairs = ((name, show(old, name), show(new, name)) for name in names)
    changed = [
        _shots_changed(old, new)
        if name == "shots"
        else f"{name.replace('_', '-')} {was[:40]} -> {now[:40]}"
        for name, was, now in pairs
        if was != now
    ]
    return [*changed[:4], f"and {len(changed) - 4} more"] if len(changed) > 4 else changed


def frames_changes(stated: str, folders: Mapping[str, object]) -> list[str]:
    """`settings_changes` from a frame's `itmoSettings` to its folder's for the same names.

    The operator's parameters are left out: a frame states all of them.
    """
    try:
        own = parse_json(stated)
    except ValueError:
        return []
    if not isinstance(own, dict):
        return []
    names = own.keys() & folders.keys() - {"operator_params"}
    return settings_changes({n: own[n] for n in names}, {n: folders[n] for n in names})


def _shots_changed(old: Mapping[str, object], new: Mapping[str, object]) -> str:
    """The shots that differ, by the frame numbers of their files."""
    first, rows = new.get("first_number", 1), list[str]()
    both = [
        {json.dumps(shot): shot for shot in shots} if isinstance(shots, list) else {}
        for shots in (old.get("shots", []), new.get("shots", []))
    ]
    for text in sorted(both[0].keys() ^ both[1].keys()):
        match both[0].get(text, both[1].get(text)), first:
            case [int(begin), int(end), _], int(start):
                rows.append(f"{begin + start}-{end + start}")
    told = sorted(set(rows), key=lambda text: int(text.split("-")[0]))
    more = f" and {len(told) - 3} more" if len(told) > 3 else ""
    return f"shots of frames {', '.join(told[:3])}{more}"
