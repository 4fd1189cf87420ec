"""Still images and numbered sequences as clips (PyAV's image decoders)."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any, cast

import av

from itmo_video.errors import DamagedInputError, InputError
from itmo_video.model import ClipInfo, Frame
from itmo_video.source import packets, tags
from itmo_video.source.clip import Clip
from itmo_video.source.files import check_file, check_pixels, content_digest, still_codec
from itmo_video.source.planes import Turn, picture_of, pixel_form, upright
from itmo_video.source.tags import InputOptions

STILL_RATE = Fraction(24)  # images have no rate of their own
_NUMBER = re.compile(r"%0?(\d*)d|#+")


def is_pattern(path: Path) -> bool:
    """Whether the name stands for a numbered sequence: `img.%04d.png`, `img.####.png`."""
    return _NUMBER.search(path.name) is not None


class StillClip(Clip):
    """Images by index; each one is read by its own tags, as encoders vary the format."""

    def __init__(self, path: Path, files: dict[int, Path], options: InputOptions) -> None:
        self._path, self._files, self._options = path, dict(sorted(files.items())), options
        self._alpha: bool | None = None
        self._size: tuple[int, int] | None = None
        self._first = min(files)
        is_single = list(files.values()) == [path]
        for index, file in self._files.items():
            found = self._read(index, file)
            if found is not None:
                break
            if is_single:
                raise InputError(
                    f"cannot be decoded: damaged, or more than {options.max_pixels} pixels",
                    where=str(path),
                )
        else:
            raise InputError("none of its images can be decoded", where=str(path))
        frame, picture, turn, told = found
        self._alpha, self._size = frame.encoding.has_alpha, frame.size
        count = max(self._files) - self._first + 1
        notices = list(told)
        if turn != (0, False):
            notices.append(
                f"turned upright: {'mirrored, then ' * turn[1]}{turn[0]} degrees clockwise"
            )
        if not is_single:
            notices.append(f"images have no frame rate: assumed {STILL_RATE}")
            if len(files) < count:
                notices.append(f"{count - len(files)} numbers of the sequence are missing")
        self.info = ClipInfo(
            path=str(path),
            stem=path.stem if is_single else _sequence_stem(path),
            container="image" if is_single else "image sequence",
            codec=str(still_codec(self._files[self._first + frame.index])),
            pixel_format=pixel_form(picture),
            width=picture.width,
            height=picture.height,
            frames=count,
            frame_rate=STILL_RATE,
            duration_s=count / STILL_RATE,
            is_vfr=False,
            pixel_aspect=Fraction(1),
            rotation_deg=turn[0],
            flip=turn[1],
            field_order="progressive",
            timecode=None,
            encoding=frame.encoding,
            digest=content_digest(list(self._files.values())),
            first_number=None if is_single else self._first,
            notices=tuple(notices),
        )

    def frames(self, start: int = 0) -> Iterator[Frame]:
        """Yield the images that decode, from index `start` on."""
        for number, file in self._files.items():
            if number - self._first < start:
                continue
            found = self._read(number, file)
            if found is None:
                continue
            frame = found[0]
            if frame.size != self._size or frame.encoding.has_alpha != self._alpha:
                raise DamagedInputError(
                    f"it is {frame.size[0]}x{frame.size[1]}, "
                    f"the first image {self.info.display_size[0]}x{self.info.display_size[1]}, "
                    "or only one of the two has alpha",
                    where=str(file),
                    remedy="What came before can be converted; put unlike images apart.",
                )
            yield frame

    def time_s(self, index: int) -> Fraction:
        """Presentation time at the assumed rate."""
        return index / STILL_RATE

    def _read(self, number: int, file: Path) -> tuple[Frame, Any, Turn, tuple[str, ...]] | None:
        """One image as a frame, with what it was decoded to; None when it does not decode."""
        try:
            check_file(file)
            codec = still_codec(file)
        except InputError:
            if len(self._files) == 1:
                raise
            return None
        if codec is None:
            return None
        data = file.read_bytes()
        decoded = _decode_still(data, codec, self._options.max_pixels, str(file))
        if decoded is None:
            return None
        check_pixels(decoded.width, decoded.height, self._options.max_pixels, str(file))
        picture = picture_of(file, decoded)
        encoding, told = tags.resolve_encoding(
            tags.read_tags(decoded),
            self._options,
            family=picture.family,
            bit_depth=picture.bit_depth,
            has_alpha=picture.has_alpha,
            is_full_format="yuvj" in decoded.format.name or picture.family != "ycbcr",
            is_still=True,
            codec=codec,
            lines=decoded.height,
            where=str(file),
        )
        turn = tags.exif_turn(data)
        planes, encoding = upright(picture.planes, turn, encoding)
        index = number - self._first
        is_damaged = bool(decoded.is_corrupt)
        return Frame(index, index / STILL_RATE, planes, encoding, is_damaged), decoded, turn, told


def _decode_still(data: bytes, codec: str, max_pixels: int, where: str) -> Any:
    if codec == "png" and data[12:16] == b"IHDR":
        width, height = (int.from_bytes(data[at : at + 4], "big") for at in (16, 20))
        check_pixels(width, height, max_pixels, where)
    try:
        context = cast(Any, av.CodecContext.create(codec, "r"))
        context.options = {"max_pixels": packets.decoder_limit(max_pixels)}
        frames = context.decode(av.Packet(data)) or context.decode(None)
    except (av.FFmpegError, EOFError, ValueError):
        return None
    return frames[0] if frames else None


def sequence(path: Path) -> dict[int, Path]:
    """The files of a numbered pattern, by number; InputError when there are none."""
    match = _NUMBER.search(path.name)
    assert match is not None
    digits = int(match[1] or 1) if match[0].startswith("%") else len(match[0])
    before, after = (
        re.escape(path.name[part]) for part in (slice(match.start()), slice(match.end(), None))
    )
    name = re.compile(f"{before}([0-9]{{{digits},}}){after}", re.DOTALL)
    files: dict[int, Path] = {}
    try:
        entries = os.listdir(path.parent)
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", where=str(path.parent)) from error
    for entry in entries:
        found = name.fullmatch(entry)
        if found and (len(found[1]) == digits or found[1][0] != "0"):
            files[int(found[1])] = path.parent / entry
    if not files:
        raise InputError("no file has a name like that", where=str(path))
    return files


def _sequence_stem(path: Path) -> str:
    match = _NUMBER.search(path.name)
    stem = path.name[: match.start()] if match else path.stem
    return stem.rstrip("._- ") or path.parent.name or "frame"
