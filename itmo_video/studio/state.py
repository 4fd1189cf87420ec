"""What is sent to the page: constant facts, and the current state."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

from itmo_video.colour.primaries import (
    CHROMATICITIES,
    luminance_weights,
    rgb_to_rgb_matrix,
    rgb_to_xyz_matrix,
)
from itmo_video.settings import Settings
from itmo_video.source.facts import clip_facts
from itmo_video.studio import controls, variants
from itmo_video.studio.desk import Desk
from itmo_video.studio.document import Document
from itmo_video.studio.saving import plain_name


def about(desk: Desk) -> dict[str, Any]:
    """Facts that do not change while the studio is open."""
    info = desk.info
    return {
        "name": Path(info.path).name,
        "suggested": plain_name(info.stem),
        "size": info.display_size,
        "frames": info.frames,
        "first_number": desk.first_number,
        "rate": float(info.frame_rate),
        "pixel_aspect": float(info.pixel_aspect),
        "facts": clip_facts(info),
        "notices": list(info.notices),
        "folder": str(desk.saver.folder),
        "controls": controls.controls(),
        "presets": controls.presets(),
        "operators": controls.operators(),
        "varied": variants.varied(),
        "primaries": {
            name: {
                "to_709": rgb_to_rgb_matrix(name, "rec709").tolist(),
                "to_xyz": rgb_to_xyz_matrix(name).tolist(),
                "weights": luminance_weights(name),
            }
            for name in CHROMATICITIES
        },
    }


def state(desk: Desk) -> dict[str, Any]:
    """The state of the document, the saved files and the render, for the page."""
    now = desk.history.now
    progress = dataclasses.asdict(desk.runner.progress)
    return {
        "version": desk.version,
        "document": _document(desk, now),
        "other": _document(desk, desk.other) if desk.other is not None else None,
        "peak": _peak(desk),
        "can_undo": desk.history.can_undo,
        "can_redo": desk.history.can_redo,
        "analysed": desk.analysed,
        "is_analysed": now.analysis is not None,
        "analysis_error": desk.analysis_error,
        "keys": keys(desk, now),
        "saved": {kind: path.name for kind, path in desk.saved.items()},
        "command": desk.command(),
        "preset_needs_saving": desk.preset_needs_saving,
        "shots_need_saving": desk.shots_need_saving,
        "render": progress,
    }


def keys(desk: Desk, document: Document) -> list[int]:
    """Frame numbers of the keyframes: the grid, both sides of each cut, and the last frame.

    A keyframe that is moved because of a flash is shown at its regular place.
    """
    reach, last = document.settings.key_reach, desk.info.frames - 1
    found = {*range(0, last + 1, reach), last}
    for cut in document.analysis.cuts if document.analysis else ():
        found |= {cut - desk.first_number - 1, cut - desk.first_number}
    return sorted(index + desk.first_number for index in found)


def _peak(desk: Desk) -> float:
    """The highest peak of clip, shots and B, SDR white = 1, shared by all pictures compared."""
    both = [desk.history.now, *([desk.other] if desk.other is not None else [])]
    looks = [document.look for document in both]
    looks += [shot.look for document in both for shot in document.own_looks(desk.info)]
    return max(look.settings.l_max_effective for look in looks)


def _document(desk: Desk, document: Document) -> dict[str, Any]:
    settings, first = document.settings, desk.first_number
    return {
        "preset": document.preset,
        "changed": dict(document.changed),
        "settings": _values(settings),
        "source": document.source_key(-1, desk.info),  # of frames in no shot
        "l_max": settings.l_max_effective,
        "peak_nits": settings.l_max_effective * settings.white_nits,
        "layout": document.layout,
        "shots": [
            {
                "first": shot.first,
                "last": shot.last,
                "enabled": shot.enabled,
                "own": dict(shot.own),
                "source": document.source_key(shot.first - first, desk.info),
                "settings": _values(shot.settings(settings)) if shot.own else None,
            }
            for shot in document.shots
        ],
    }


def _values(settings: Settings) -> dict[str, Any]:
    values = {f.name: getattr(settings, f.name) for f in dataclasses.fields(settings)}
    return {**values, "layers": list(settings.layers)}
