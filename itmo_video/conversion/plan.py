"""The plan of a conversion: frames by number, settings by shot, fingerprints."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from itmo_video.analysis.lamps import lamps_notices
from itmo_video.analysis.model import Analysis
from itmo_video.conversion.file_size import check_file_size
from itmo_video.conversion.frame_ranges import format_ranges, parse_ranges
from itmo_video.conversion.run_options import RunOptions
from itmo_video.errors import UsageError
from itmo_video.kernels.arithmetic import arithmetic
from itmo_video.look import Look, make_look
from itmo_video.model import ClipInfo
from itmo_video.operators import version_of
from itmo_video.output import disk_space
from itmo_video.output.fingerprint import fingerprint, fingerprint_text
from itmo_video.output.frame_form import FrameForm, colour_attributes, timing_attributes
from itmo_video.output.manifest import Manifest
from itmo_video.rendering import spans
from itmo_video.settings import Settings
from itmo_video.source import timecode
from itmo_video.source.clip import Clip, first_number
from itmo_video.words import frames_are

ALGORITHM = 12  # raise it whenever the same settings give other pixels


@dataclass(frozen=True)
class ShotLook:
    """Frames `first` to `last` (indices, inclusive) with their own settings."""

    first: int
    last: int
    look: Look


@dataclass(frozen=True)
class Plan:
    """The plan of a conversion: frames by number, the folder's manifest, and fingerprints.

    `shots` are sorted and do not overlap; frames outside of them use `look`. `notices` should be
    reported first.

    >>> from itmo_video import RunOptions, Settings, open_clip
    >>> from itmo_video.conversion.plan import make_plan
    >>> from itmo_video.look import make_look
    >>> with open_clip("clip.mkv") as clip:
    ...     dict(make_plan(clip, make_look(Settings()), RunOptions(frames="2-3")).numbers)
    {2: 1, 3: 2}
    """

    clip: ClipInfo
    look: Look
    numbers: Mapping[int, int]  # file number -> index
    first_number: int
    memory_bytes: int
    jobs: int
    shots: tuple[ShotLook, ...] = ()
    notices: tuple[str, ...] = ()
    source_frames: int | None = None  # None for a pipe

    @property
    def looks(self) -> tuple[Look, ...]:
        """All looks that frames may have."""
        return self.look, *(shot.look for shot in self.shots)

    @property
    def settings(self) -> Settings:
        """The settings of frames outside of shots with their own."""
        return self.look.settings

    def look_at(self, index: int) -> Look:
        """The effective settings, compiled, of the frame at `index`."""
        at = bisect_right(self._shot_starts, index) - 1
        return self.shots[at].look if at >= 0 and index <= self.shots[at].last else self.look

    def fingerprint(self, number: int) -> str:
        """The fingerprint of everything a frame depends on: settings, source, index, algorithm."""
        return self.fingerprint_at(self.numbers[number])

    def fingerprint_at(self, index: int) -> str:
        """The fingerprint of the frame at `index`, also of frames that are not planned."""
        return fingerprint(self._settings_texts[id(self.look_at(index))], index)

    def form(self, number: int) -> FrameForm:
        """The properties of a frame's file apart from pixels."""
        settings = self.look_at(self.numbers[number]).settings
        alpha = "A" if self.clip.encoding.has_alpha else ""
        layers = (f"{name}.Y" for name in settings.layers)
        clip = self.clip
        return FrameForm(
            clip.display_size,
            frozenset((*"RGB", *alpha, *layers)),
            settings.compression,
            colour_attributes(settings) | timing_attributes(clip.frame_rate, clip.pixel_aspect),
        )

    @property
    def manifest(self) -> Manifest:
        """The manifest of the output folder."""
        settings = {**self.settings.as_dict(), "first_number": self.first_number}
        settings |= {"algorithm": ALGORITHM, "arithmetic": arithmetic()}
        if versions := {name: told for name in self._operators if (told := version_of(name))}:
            settings["operator_versions"] = versions
        if self.shots:
            settings["shots"] = [
                [shot.first, shot.last, _changed(self.settings, shot.look.settings)]
                for shot in self.shots
            ]
        return Manifest(
            Path(self.clip.path).name, self.clip.digest, self.clip.stem, settings,
            self.source_frames,
        )  # fmt: skip

    @property
    def estimated_frame_bytes(self) -> int:
        """The approximate size of one file in bytes."""
        width, height = self.clip.display_size
        return disk_space.estimated_frame_bytes(
            width, height, self.clip.encoding.has_alpha, self.settings
        )

    @cached_property
    def _shot_starts(self) -> list[int]:
        return [shot.first for shot in self.shots]

    @property
    def _operators(self) -> list[str]:
        return sorted({look.settings.operator for look in self.looks})

    @cached_property
    def _settings_texts(self) -> dict[int, str]:
        # By identity: a film has 150,000 frames and few looks, which the plan keeps alive.
        return {
            id(look): fingerprint_text(
                look.settings.as_dict(),
                self.clip.digest,
                ALGORITHM,
                arithmetic(),
                version_of(look.settings.operator),
            )
            for look in self.looks
        }


def make_plan(clip: Clip, look: Look, run: RunOptions) -> Plan:
    """Resolve ranges, numbers and shots; raises UsageError if they do not fit the clip."""
    info = clip.info
    first = first_number(info, run.start_number)
    numbers = {first + index: index for index in range(info.frames)}
    if run.frames is not None:
        asked = parse_ranges(run.frames)
        if outside := [n for n in asked if n not in numbers]:
            raise UsageError(
                f"{frames_are(format_ranges(outside))} not in the clip",
                where=info.path,
                remedy=f"It has frames {first}-{first + info.frames - 1}.",
            )
        numbers = {n: numbers[n] for n in asked}
    jobs = run.jobs or spans.default_jobs()
    width, height = info.display_size
    wide = 1 if info.encoding.bit_depth == 8 else 2
    _check_timecode(info, look.settings)
    if not run.null:
        check_file_size(info, look.settings)
    shots = shot_looks(info, look.settings, run.analysis)
    looks = (look, *(shot.look for shot in shots))
    memory = max(spans.memory_bound_bytes(width, height, wide, own, jobs) for own in looks)
    notices = (
        *info.notices, *look.notices, *_no_timecode(info), *_panorama(info, look.settings),
        *_left_out(numbers, first, run.analysis), *lamps_notices(clip, numbers, look.settings),
        *_lamps_of_shots(clip, numbers, first, look.settings, shots),
    )  # fmt: skip
    return Plan(info, look, numbers, first, memory, jobs, shots, notices, info.frames)


def _left_out(numbers: Mapping[int, int], first: int, analysis: Analysis | None) -> list[str]:
    """A notice about frames that are in no shot of an analysis."""
    if analysis is None:
        return []
    offset = first - analysis.first_number
    listed = {n + offset for shot in analysis.shots for n in range(shot.first, shot.last + 1)}
    if not (alone := sorted(set(numbers) - listed)):
        return []
    told = f"{frames_are(format_ranges(alone))} in no shot of {analysis.where or 'the analysis'}"
    return [f"{told}: they use the settings of the clip"]


def _lamps_of_shots(
    clip: Clip, numbers: Mapping[int, int], first: int, base: Settings, shots: Sequence[ShotLook]
) -> list[str]:
    """Notices about shots whose own `lamps` has no effect, by their first frames."""
    return [
        notice
        for shot in shots
        if shot.look.settings.lamps != base.lamps and first + shot.first in numbers
        for notice in lamps_notices(clip, {first + shot.first: shot.first}, shot.look.settings)
    ]


def _panorama(info: ClipInfo, settings: Settings) -> list[str]:
    """A word on what may be a panorama for lighting, by its shape and a maximum as a ratio."""
    width, height = info.display_size
    if settings.projection != "flat" or settings.l_max is None or width != 2 * height:
        return []
    return [
        "it is twice as wide as high and read as a flat picture: for a latitude-longitude "
        "panorama add --projection latlong"
    ]


def _no_timecode(info: ClipInfo) -> list[str]:
    if info.timecode is None or timecode.fits(info.frame_rate):
        return []
    return [
        f"timecode {info.timecode} is not written: EXR's timeCode supports at most 30 frames "
        "per second"
    ]


def _check_timecode(info: ClipInfo, settings: Settings) -> None:
    code, base = settings.timecode, max(1, round(info.frame_rate))
    if code is None:
        return
    if base > 30:
        raise UsageError(
            f"EXR's timeCode supports at most 30 fps, but the clip has {info.frame_rate}",
            where=info.path,
            remedy="Omit --timecode.",
        )
    if code != "auto" and int(code[-2:]) >= base:
        raise UsageError(f"timecode {code} is invalid: at {base} fps there is no frame {code[-2:]}")
    if code != "auto" and code[-3] == ";" and base != 30:
        raise UsageError(f"drop-frame timecode needs 29.97 fps, but the clip has {info.frame_rate}")


def shot_looks(info: ClipInfo, base: Settings, analysis: Analysis | None) -> tuple[ShotLook, ...]:
    """The shots of an analysis with their own settings, by index.

    Raises UsageError if the analysis belongs to another clip or a shot's values are invalid.
    """
    if analysis is None:
        return ()
    if analysis.digest != info.digest:
        raise UsageError(
            f"the analysis is of another clip, {analysis.source_name!r}",
            where=analysis.where,
            remedy=f"Analyse this one: itmo-video analyse {info.path} --output FILE.json",
        )
    if analysis.frames != info.frames:
        raise UsageError(
            f"the analysis has {analysis.frames} frames, this conversion has {info.frames}",
            where=analysis.where,
            remedy="Analyse with the same --fps.",
        )
    looks: list[ShotLook] = []
    for shot in analysis.shots:
        try:
            settings = shot.settings(base)
        except UsageError as error:
            raise UsageError(
                f"shot {shot.first}-{shot.last}: {error.what}",
                where=analysis.where,
                remedy=error.remedy,
            ) from error
        if settings != base:
            first, last = (n - analysis.first_number for n in (shot.first, shot.last))
            looks.append(ShotLook(first, last, make_look(settings)))
    return tuple(looks)


def keys_on_grid(plan: Plan) -> Sequence[int]:
    """Indices of the regular keyframes that precede the planned frames."""
    interval = plan.settings.key_reach
    return sorted({i - i % interval for i in plan.numbers.values()})


def _changed(base: Settings, effective: Settings) -> dict[str, Any]:
    was, now = base.as_dict(), effective.as_dict()
    return {name: now[name] for name in now if now[name] != was[name]}
