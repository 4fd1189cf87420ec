"""Video files as clips: decoded by frame number, in presentation order (PyAV)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np

from itmo_video.errors import DamagedInputError, InputError
from itmo_video.memory_limit import check_memory
from itmo_video.model import Frame
from itmo_video.source.clip import Clip
from itmo_video.source.deinterlace import LEAD_IN, deinterlaced
from itmo_video.source.digest import SourceFiles
from itmo_video.source.planes import pixel_form, read_picture
from itmo_video.source.read_faults import check_readable, ends_at
from itmo_video.source.stream_facts import find_facts, shown_planes
from itmo_video.source.stretches import numbered
from itmo_video.source.tags import InputOptions
from itmo_video.words import counted

_HEAD_BYTES = 1 << 20  # of a file, in which a container's header lies


class VideoClip(Clip):
    """A video file."""

    def __init__(self, path: Path, options: InputOptions) -> None:
        self._path, self._source = path, SourceFiles([path])
        try:
            self._facts, begun = find_facts(path, options, self._source)
        except av.FFmpegError as error:
            check_memory(error)
            raise InputError(f"cannot be read ({error.strerror})", where=str(path)) from error
        if (fault := self._source.faults.get(path)) is not None:
            self.disk_fault = str(fault)
            told = replace(self._facts.info, notices=(*self._facts.info.notices, str(fault)))
            self._facts = replace(self._facts, info=told)
        self.info = self._facts.info
        # A decoder at the first frame, which is the slowest to get: readers from there use it.
        self._begun = [] if begun is None else [begun]

    def frames(self, start: int = 0) -> Iterator[Frame]:
        """Yield frames from index `start` on, decoding from the nearest suitable point before."""
        facts = self._facts
        ahead = max(0, start - LEAD_IN) if facts.is_deinterlaced else start
        try:
            begun = self._begun.pop()  # for the first reader, if threads read in parallel
        except IndexError:
            begun = None
        pictures = begun if begun is not None and ahead == 0 else numbered(facts.decoder, ahead)
        if facts.is_deinterlaced:
            pictures = deinterlaced(pictures, facts.is_forced, facts.time_base, self._is_same)
        try:
            for index, decoded, is_damaged in pictures:
                if index >= start:
                    self._check_source()
                    self._check_same(index, decoded)
                    yield self._frame(index, decoded, is_damaged)
        except (InputError, av.FFmpegError, OSError):
            self._check_source()  # a file being rewritten is empty first, which is then the reason
            self._check_readable()
            raise
        self._check_source()
        self._check_disk_end()

    def time_s(self, index: int) -> Fraction:
        """The presentation time as stamped, or by the frame rate if stamps are unusable."""
        packets = self._facts.decoder.packets
        if packets.is_exact:
            return packets.pts[index] * self._facts.time_base
        return Fraction(index) / self.info.frame_rate

    def close(self) -> None:
        """Release the source."""
        self._begun.clear()

    def _check_source(self) -> None:
        """Raise DamagedInputError if the file was replaced by another."""
        self._source.check(self._path)

    def _check_readable(self) -> None:
        """Raise InputError if it is the disk that fails."""
        check_readable(self._path, 0, _HEAD_BYTES)

    def _check_disk_end(self) -> None:
        """Raise DamagedInputError if the file ends where the disk failed."""
        if (fault := self._source.faults.get(self._path)) is not None:
            raise ends_at(self._path, fault)

    def _is_same(self, decoded: Any) -> bool:
        size = decoded.width, decoded.height
        return bool(size == self._facts.size and pixel_form(decoded) == self._facts.form)

    def _check_same(self, index: int, decoded: Any) -> None:
        if self._is_same(decoded):
            return
        (width, height), form = self._facts.size, self._facts.form
        now = f"{decoded.width}x{decoded.height} {pixel_form(decoded)}"
        raise DamagedInputError(
            f"after {counted(index, 'frame')} the picture changes to {now} from "
            f"{width}x{height} {form}",
            where=self.info.path,
            remedy="The frames before it can be converted; split the file where it changes.",
        )

    def _frame(self, index: int, decoded: Any, is_damaged: bool) -> Frame:
        stored = self._facts.stored
        planes = read_picture(decoded).planes
        count = {"ycbcr": 3, "rgb": 3, "grey": 1}[stored.family] + stored.has_alpha
        if len(planes) < count:  # a palette without transparency in a clip with alpha
            planes = (*planes, np.full_like(planes[0], 255))
        facts = self._facts
        planes, encoding = shown_planes(planes[:count], stored, facts.crop, facts.turn)
        return Frame(index, self.time_s(index), planes, encoding, is_damaged)
