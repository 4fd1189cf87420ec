"""The studio's document: settings of the clip and of single shots, with undo and redo."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType
from typing import Any

from itmo_video.analysis.model import Analysis, Shot
from itmo_video.conversion.plan import ShotLook, shot_looks
from itmo_video.errors import UsageError
from itmo_video.look import Look, make_look
from itmo_video.model import ClipInfo
from itmo_video.options import flag_name
from itmo_video.presets import (
    check_own,
    load_preset,
    made_of,
    preset_names,
    without_replaced_maximum,
)
from itmo_video.settings import Settings

STEPS = 200  # of undo
# These change the set of frames, which the timeline of an open clip cannot follow.
OF_OPENING = ("fps", "deinterlace", "stream", "raw")
_UNREAD: Mapping[str, Any] = MappingProxyType({})


@dataclass(frozen=True)
class Document:
    """A preset, the settings changed on top of it, and the clip's shots (none before analysis).

    `base` is the content of the preset's file; it is read once, as the file may be replaced.
    """

    preset: str
    changed: Mapping[str, Any] = field(default_factory=dict)
    analysis: Analysis | None = None
    base: Mapping[str, Any] = field(default_factory=lambda: _UNREAD, repr=False)

    def __post_init__(self) -> None:
        if self.base is _UNREAD:
            object.__setattr__(self, "base", load_preset(self.preset))

    @cached_property
    def settings(self) -> Settings:
        """The clip's settings; raises UsageError if they contradict each other."""
        return made_of(self.base, self.changed)

    @cached_property
    def look(self) -> Look:
        """The clip's settings, compiled."""
        return make_look(self.settings)

    @property
    def shots(self) -> tuple[Shot, ...]:
        """The shots, in order."""
        return self.analysis.shots if self.analysis else ()

    @property
    def layout(self) -> str:
        """A key of where the shots begin and end: only with it does a place name one shot."""
        bounds = " ".join(f"{shot.first}-{shot.last}" for shot in self.shots)
        return hashlib.blake2b(bounds.encode(), digest_size=8).hexdigest()

    def own_looks(self, info: ClipInfo) -> tuple[ShotLook, ...]:
        """The shots with settings of their own, in the form that a conversion takes."""
        if "_own" not in self.__dict__:
            self.__dict__["_own"] = shot_looks(info, self.settings, self.analysis)
        own: tuple[ShotLook, ...] = self.__dict__["_own"]
        return own

    def look_at(self, index: int, info: ClipInfo) -> Look:
        """The settings used for the frame at `index`."""
        for shot in self.own_looks(info):
            if shot.first <= index <= shot.last:
                return shot.look
        return self.look

    def source_key(self, index: int, info: ClipInfo) -> str:
        """What the SDR picture at `index` depends on: equal keys mean equal pictures."""
        clip, own = self.settings, self.look_at(index, info).settings
        return f"{clip.transfer} {clip.matrix} {clip.range} {clip.force_sdr} {own.over_white}"

    def with_shots(self, shots: Sequence[Shot]) -> Document:
        """A copy with other shots; raises UsageError before the clip is analysed."""
        if self.analysis is None:
            raise UsageError(
                "the clip is still being analysed", remedy="Wait until its cuts are found."
            )
        return replace(self, analysis=replace(self.analysis, shots=tuple(shots)))


def check_layout(document: Document, layout: object) -> None:
    """Raise UsageError if an edit names a shot among others than the present ones."""
    if layout != document.layout:
        raise UsageError(
            "the shots have changed meanwhile, and nothing was set",
            remedy="Look at them as they are now, and set it again.",
        )


def with_preset(
    document: Document, name: object, opened: Document, shot: int | None = None
) -> Document:
    """A copy with a preset in place of the settings of the clip or of one shot.

    It must be a known one, or for the clip that of `opened`: the page may not name another path.
    """
    if shot is not None:
        _check_preset(name)
        shots = list(document.shots)
        _known(shots, shot)
        shots[shot] = replace(shots[shot], own={"preset": name})
        return document.with_shots(shots)
    _check_preset(name, opened)
    assert isinstance(name, str)
    base = opened.base if name == opened.preset else load_preset(name)
    held = {known: getattr(opened.settings, known) for known in OF_OPENING}
    plain = made_of(base, {})
    changed = {known: v for known, v in held.items() if v != getattr(plain, known)}
    return Document(name, changed, document.analysis, base)


def _check_preset(name: object, opened: Document | None = None) -> None:
    known = [*preset_names()]
    if opened is not None and opened.preset not in known:
        known.append(opened.preset)
    if name not in known:
        raise UsageError(f"unknown preset {name!r}", remedy=f"Known: {', '.join(known)}")


def set_values(document: Document, values: Mapping[str, Any], shot: int | None) -> Document:
    """A copy with settings of the clip or of one shot changed; a value of None resets one."""
    if fixed := [flag_name(name) for name in values if name in OF_OPENING]:
        raise UsageError(
            f"{', '.join(fixed)} cannot be changed while the clip is open",
            remedy="Give it as a flag when you start the studio.",
        )
    if (preset := values.get("preset")) is not None:
        _check_preset(preset)
    if shot is None:
        changed = _merged(document.changed, values)
        return replace(document, changed=changed)
    shots = list(document.shots)
    _known(shots, shot)
    own = _merged(shots[shot].own, values)
    check_own(own)
    shots[shot] = replace(shots[shot], own=own)
    return document.with_shots(shots)


def with_analysis(document: Document, analysis: Analysis) -> Document:
    """A copy with the analysed shots, unless it has shots already."""
    return document if document.analysis else replace(document, analysis=analysis)


def split(document: Document, at: int) -> Document:
    """A copy with the shot split before frame number `at`; both parts keep its settings."""
    shots = list(document.shots)
    for place, shot in enumerate(shots):
        if shot.first < at <= shot.last:
            parts = (
                replace(shot, last=at - 1, statistics=None),
                replace(shot, first=at, statistics=None),
            )
            shots[place : place + 1] = parts
            return document.with_shots(shots)
    raise UsageError(f"cannot split before frame {at}", remedy="A shot already starts there.")


def merge(document: Document, shot: int) -> Document:
    """A copy with a shot and the next merged, with the settings of the first."""
    shots = list(document.shots)
    _known(shots, shot)
    if shot + 1 >= len(shots):
        raise UsageError("this is the last shot: there is no next shot to merge with")
    merged = replace(shots[shot], last=shots[shot + 1].last, statistics=None)
    shots[shot : shot + 2] = [merged]
    return document.with_shots(shots)


def enable(document: Document, shot: int, on: bool) -> Document:
    """A copy with a shot expanded or left SDR."""
    shots = list(document.shots)
    _known(shots, shot)
    shots[shot] = replace(shots[shot], enabled=on)
    return document.with_shots(shots)


def _merged(before: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    given = {name: value for name, value in values.items() if value is not None}
    kept = without_replaced_maximum(before, given)
    return {name: value for name, value in kept.items() if name not in values} | given


def _known(shots: Sequence[Shot], shot: int) -> None:
    if not 0 <= shot < len(shots):
        raise UsageError(f"there is no shot {shot + 1}")


class History:
    """A document with undo and redo; all changes of one gesture (a drag) are one step."""

    def __init__(self, document: Document) -> None:
        self._past: list[Document] = []
        self._future: list[Document] = []
        self._gesture: str | None = None
        self.now = document

    @property
    def can_undo(self) -> bool:
        """Whether there is a step to undo."""
        return bool(self._past)

    @property
    def can_redo(self) -> bool:
        """Whether there is a step to redo."""
        return bool(self._future)

    def do(self, document: Document, info: ClipInfo, gesture: str | None = None) -> None:
        """Make the document the current one; if it is invalid, raise UsageError, change nothing."""
        _ = document.look
        document.own_looks(info)
        if gesture is None or gesture != self._gesture:
            self._past = [*self._past, self.now][-STEPS:]
        self._gesture, self._future, self.now = gesture, [], document

    def undo(self) -> None:
        """Undo one step, if there is one."""
        if self._past:
            self._future.append(self.now)
            self.now, self._gesture = self._past.pop(), None

    def redo(self) -> None:
        """Redo the step that was undone last, if any."""
        if self._future:
            self._past.append(self.now)
            self.now, self._gesture = self._future.pop(), None

    def analysed(self, analysis: Analysis) -> None:
        """Add the analysed shots to all steps made before the analysis."""
        self._past = [with_analysis(document, analysis) for document in self._past]
        self._future = [with_analysis(document, analysis) for document in self._future]
        self.now = with_analysis(self.now, analysis)
