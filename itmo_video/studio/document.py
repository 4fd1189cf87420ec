"""What is decided in the studio: settings of the clip, shots with their own; undone and redone."""

from __future__ import annotations

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
from itmo_video.presets import check_own, load_preset, made_of
from itmo_video.settings import Settings

STEPS = 200  # that can be undone
_MAXIMA = ("l_max", "peak_nits")
_UNREAD: Mapping[str, Any] = MappingProxyType({})


@dataclass(frozen=True)
class Document:
    """A preset, the settings changed on top of it, and the clip's shots (none until analysed).

    `base` is what the preset's file says; it is read once, as the file may be saved over.
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
        """The clip's settings; raises UsageError where they do not fit together."""
        return made_of(self.base, self.changed)

    @cached_property
    def look(self) -> Look:
        """The clip's settings, compiled."""
        return make_look(self.settings)

    @property
    def shots(self) -> tuple[Shot, ...]:
        """The shots, in order."""
        return self.analysis.shots if self.analysis else ()

    def own_looks(self, info: ClipInfo) -> tuple[ShotLook, ...]:
        """The shots that are expanded otherwise than the clip, as a conversion takes them."""
        if "_own" not in self.__dict__:
            self.__dict__["_own"] = shot_looks(info, self.settings, self.analysis)
        own: tuple[ShotLook, ...] = self.__dict__["_own"]
        return own

    def look_at(self, index: int, info: ClipInfo) -> Look:
        """What the frame at `index` is expanded with."""
        for shot in self.own_looks(info):
            if shot.first <= index <= shot.last:
                return shot.look
        return self.look

    def with_shots(self, shots: Sequence[Shot]) -> Document:
        """The same with other shots; UsageError before the clip is analysed."""
        if self.analysis is None:
            raise UsageError("the clip's cuts are not known yet", remedy="Wait a moment.")
        return replace(self, analysis=replace(self.analysis, shots=tuple(shots)))


def with_preset(document: Document, name: Any) -> Document:
    """Another preset in place of what was set for the clip; a path is not the page's to choose."""
    if not isinstance(name, str) or name.endswith(".toml"):
        raise UsageError(f"unknown preset {name!r}")
    return Document(name, {}, document.analysis)


def set_values(document: Document, values: Mapping[str, Any], shot: int | None) -> Document:
    """With settings changed, of the clip or of one shot; a value of None resets one."""
    if shot is None:
        changed = _merged(document.changed, values)
        return replace(document, changed=changed)
    shots = list(document.shots)
    _known(shots, shot)
    own = _merged(shots[shot].own, values)
    check_own(own)
    shots[shot] = replace(shots[shot], own=own)
    return document.with_shots(shots)


def split(document: Document, at: int) -> Document:
    """With the shot that frame number `at` lies in cut in two before it; both keep its settings."""
    shots = list(document.shots)
    for place, shot in enumerate(shots):
        if shot.first < at <= shot.last:
            parts = (
                replace(shot, last=at - 1, statistics=None),
                replace(shot, first=at, statistics=None),
            )
            shots[place : place + 1] = parts
            return document.with_shots(shots)
    raise UsageError(f"no shot can be split before frame {at}", remedy="A shot starts there.")


def merge(document: Document, shot: int) -> Document:
    """With a shot and the one after it as one, which has the first one's settings."""
    shots = list(document.shots)
    _known(shots, shot)
    if shot + 1 >= len(shots):
        raise UsageError("there is no shot after it to merge with")
    merged = replace(shots[shot], last=shots[shot + 1].last, statistics=None)
    shots[shot : shot + 2] = [merged]
    return document.with_shots(shots)


def enable(document: Document, shot: int, on: bool) -> Document:
    """With a shot expanded or left SDR."""
    shots = list(document.shots)
    _known(shots, shot)
    shots[shot] = replace(shots[shot], enabled=on)
    return document.with_shots(shots)


def _merged(before: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    after = dict(before)
    for name, value in values.items():
        after.pop(name, None)
        if value is not None:
            after[name] = value
            # Of the two ways to say the peak the one that was said last holds.
            for other in _MAXIMA:
                if name in _MAXIMA and other != name and other not in values:
                    after.pop(other, None)
    return after


def _known(shots: Sequence[Shot], shot: int) -> None:
    if not 0 <= shot < len(shots):
        raise UsageError(f"there is no shot {shot + 1}")


class History:
    """A document and its steps, undone and redone; steps of one gesture (a drag) count as one."""

    def __init__(self, document: Document) -> None:
        self._past: list[Document] = []
        self._future: list[Document] = []
        self._gesture: str | None = None
        self.now = document

    @property
    def can_undo(self) -> bool:
        """Whether there is a step back."""
        return bool(self._past)

    @property
    def can_redo(self) -> bool:
        """Whether a step was undone and nothing done since."""
        return bool(self._future)

    def do(self, document: Document, info: ClipInfo, gesture: str | None = None) -> None:
        """Take the document over; raises UsageError, changing nothing, unless it is sound."""
        _ = document.look
        document.own_looks(info)
        if gesture is None or gesture != self._gesture:
            self._past = [*self._past, self.now][-STEPS:]
        self._gesture, self._future, self.now = gesture, [], document

    def undo(self) -> None:
        """Go a step back, if there is one."""
        if self._past:
            self._future.append(self.now)
            self.now, self._gesture = self._past.pop(), None

    def redo(self) -> None:
        """Do again what was undone last, if anything."""
        if self._future:
            self._past.append(self.now)
            self.now, self._gesture = self._future.pop(), None

    def analysed(self, analysis: Analysis) -> None:
        """Give the steps that know no shots yet those of the analysis."""

        def known(document: Document) -> Document:
            return document if document.analysis else replace(document, analysis=analysis)

        self._past = [known(document) for document in self._past]
        self._future = [known(document) for document in self._future]
        self.now = known(self.now)
