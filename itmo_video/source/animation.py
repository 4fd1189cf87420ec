"""Animations as clips: GIF, WebP, APNG and AVIF, composed by Pillow, with their own timing."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from itertools import accumulate
from pathlib import Path

import numpy as np

from itmo_video.errors import DamagedInputError, InputError
from itmo_video.model import ClipInfo, Code, Encoding, Frame
from itmo_video.regular_file import read_regular
from itmo_video.source import pillow_stills, still_colour
from itmo_video.source.animation_times import Timing
from itmo_video.source.clip import Clip
from itmo_video.source.digest import SourceFiles
from itmo_video.source.files import PICTURE_BYTES, check_pixels
from itmo_video.source.gif_canvas import on_clear_canvas
from itmo_video.source.planes import upright
from itmo_video.source.still_formats import StillFormat, stated_size
from itmo_video.source.still_picture import StillColour, StillPicture
from itmo_video.source.still_reading import read_still
from itmo_video.source.tags import InputOptions


class AnimationClip(Clip):
    """An animation by frame number; frame n is what a viewer shows at that frame's time."""

    def __init__(
        self,
        path: Path,
        kind: StillFormat,
        timing: Timing,
        options: InputOptions,
        source: SourceFiles,
    ) -> None:
        """`source` is the file as it was before its `timing` was read."""
        self._path, self._kind, self._options, self._source = path, kind, options, source
        if not timing.lengths_s:
            raise InputError(f"cannot be decoded: {timing.damage}", where=str(path))
        self._has_alpha = timing.needs_alpha
        self._colour: StillColour | None = None  # the first frame's, used for the whole file
        size = stated_size(read_regular(path, PICTURE_BYTES)[:4096], kind)
        if size is not None:
            check_pixels(*size, options.max_pixels, str(path))
        first = self._first()
        self._encoding, told = self._encode(first)
        self._begins = [Fraction(0), *accumulate(timing.lengths_s)]
        count = len(timing.lengths_s)
        length = self._begins[-1]
        notices = list(told)
        if timing.is_lengthened:
            notices.append("frames of 10 ms or less are shown for 100 ms, as in browsers")
        if timing.damage is not None:
            notices.append(timing.damage)
        is_vfr = len(set(timing.lengths_s)) > 1
        if is_vfr:
            notices.append("variable frame rate: each frame keeps its own time")
        width, height = first.size
        self.info = ClipInfo(
            path=str(path),
            stem=path.stem,
            container=kind,
            codec=kind,
            pixel_format=first.form,
            width=width,
            height=height,
            frames=count,
            frame_rate=count / length,
            duration_s=length,
            is_vfr=is_vfr,
            pixel_aspect=Fraction(1),
            rotation_deg=first.turn[0],
            flip=first.turn[1],
            field_order="progressive",
            timecode=None,
            encoding=self._encoding,
            digest=self._source.digest(),
            notices=tuple(notices),
            frames_declared=max(timing.declared, count + (timing.damage is not None)),
        )

    def frames(self, start: int = 0) -> Iterator[Frame]:
        """Yield the composed frames from index `start` on; stops at the first damaged one."""
        self._source.check(self._path)
        data, where = read_regular(self._path, PICTURE_BYTES), str(self._path)
        self._source.check(self._path)  # ensures that what was read is what was hashed
        data, before = on_clear_canvas(data) if self._kind == "gif" else (data, 0)
        with pillow_stills.opened(data, self._kind, self._options.max_pixels, where) as image:
            for index in range(self.info.frames):
                try:
                    with pillow_stills.decoding(where):
                        image.seek(before + index)
                        image.load()
                        picture = pillow_stills.picture(image, self._kind)
                        if self._kind == "gif":
                            pillow_stills.dispose_to_clear(image)
                except DamagedInputError:
                    return
                if index >= start:
                    self._source.check(self._path)
                    yield self._frame(index, picture)

    def time_s(self, index: int) -> Fraction:
        """The time at which the frame is shown, as stored in the file."""
        return self._begins[index]

    def _first(self) -> StillPicture:
        try:
            picture = read_still(self._path, self._kind, self._options.max_pixels)
        except DamagedInputError as error:
            raise InputError(error.what, where=error.where) from error
        self._has_alpha = self._has_alpha or (
            picture.has_alpha and (self._kind != "gif" or int(picture.planes[-1].min()) < 255)
        )
        self._colour = picture.colour
        return self._of_one_form(picture)

    def _of_one_form(self, picture: StillPicture) -> StillPicture:
        """8-bit RGB, with alpha if the clip has it: frames of one animation may differ."""
        planes: tuple[Code, ...] = picture.planes
        colours = planes[:3] if picture.family == "rgb" else (planes[0],) * 3
        if picture.bit_depth > 8:
            shift = picture.bit_depth - 8
            colours = tuple(np.asarray(plane >> shift, np.uint8) for plane in colours)
        if self._has_alpha:
            alpha = planes[-1] if picture.has_alpha else np.full_like(colours[0], 255)
            colours = (*colours, np.asarray(alpha, np.uint8))
        return StillPicture(
            picture.codec, f"rgb{'a' * self._has_alpha}8", "rgb", 8, colours, self._has_alpha,
            picture.turn, self._colour or picture.colour, picture.notices,
        )  # fmt: skip

    def _encode(self, picture: StillPicture) -> tuple[Encoding, tuple[str, ...]]:
        done, encoding, told = still_colour.resolve(picture, self._options, str(self._path))
        _, encoding = upright(done.planes, picture.turn, encoding)
        return encoding, (*picture.notices, *told)

    def _frame(self, index: int, picture: StillPicture) -> Frame:
        picture = self._of_one_form(picture)
        done, encoding, _ = still_colour.resolve(picture, self._options, str(self._path))
        planes, encoding = upright(done.planes, picture.turn, encoding)
        return Frame(index, self._begins[index], planes, encoding)
