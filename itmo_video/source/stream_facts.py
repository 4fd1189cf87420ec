"""What a video stream is: found once, by its packets, its tags and its first frame."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import chain, islice
from pathlib import Path
from typing import Any

import numpy as np

from itmo_video.errors import InputError
from itmo_video.model import ClipInfo, Encoding
from itmo_video.source import tags
from itmo_video.source.decoding import Decoder, Numbered
from itmo_video.source.deinterlace import can_deinterlace
from itmo_video.source.files import check_pixels, content_digest
from itmo_video.source.packets import Packets, open_video, packet_step, scan_packets
from itmo_video.source.planes import Turn, picture_of, pixel_form, upright
from itmo_video.source.tags import InputOptions

_FILM_CODECS = ("mpeg2video", "vc1")  # in which films are telecined frame by frame
_SAMPLE = 30  # frames looked at for telecine
_INTERLACED = {2: "tff", 3: "bff", 4: "tff", 5: "bff"}  # FFmpeg's AVFieldOrder
_LIMITED_GREY = ("h264", "hevc", "av1", "libdav1d", "vp9", "mpeg2video", "mpeg4")


@dataclass(frozen=True)
class StreamFacts:
    """What is known of a stream before its frames are read.

    `size` (width, height) in pixels, `form` and `stored` are those of each decoded frame; `turn`
    brings it upright. `info` is what the clip says of itself to everybody else.
    """

    decoder: Decoder
    time_base: Fraction
    size: tuple[int, int]
    form: str
    stored: Encoding
    turn: Turn
    is_deinterlaced: bool
    is_forced: bool
    info: ClipInfo


def find_facts(path: Path, options: InputOptions) -> tuple[StreamFacts, Iterator[Numbered] | None]:
    """The facts of a video file, and a reader that stands at its first frame, where there is one.

    Raises InputError where no frame can be decoded, AlreadyHdrError by its tags, and av's errors.
    """
    with open_video(path, options.max_pixels) as (container, stream):
        context = stream.codec_context
        codec, container_name = str(context.name), str(container.format.name)
        decoder = Decoder(path, options.max_pixels, scan_packets(container, stream), codec)
        order = _INTERLACED.get(int(context.field_order), "progressive")
        if decoder.packets.is_exact and (order != "progressive" or container_name == "avi"):
            decoder = _as_countable(decoder)
        decoder, first, begun = _first_frame(decoder)
        return facts_at(container, stream, decoder, first, options, content_digest([path])), begun


def facts_at(
    container: Any, stream: Any, decoder: Decoder, first: Any, options: InputOptions, digest: str
) -> StreamFacts:
    """The facts of an open stream by its first decoded frame; `digest` is of its content."""
    path, codec, container_name = decoder.path, decoder.codec, str(container.format.name)
    context = stream.codec_context
    order = _INTERLACED.get(int(context.field_order), "progressive")
    check_pixels(first.width, first.height, options.max_pixels, str(path))
    picture = picture_of(path, first)
    stored, told = tags.resolve_encoding(
        tags.read_tags(first, context),
        options,
        family=picture.family,
        bit_depth=picture.bit_depth,
        has_alpha=picture.has_alpha,
        is_full_format="yuvj" in first.format.name
        or (picture.family == "grey" and codec not in _LIMITED_GREY),
        is_still=container_name in ("gif", "apng"),
        codec=codec,
        size=(first.width, first.height),
        where=str(path),
    )
    turn = tags.frame_turn(first)
    is_interlaced = order != "progressive" or bool(first.interlaced_frame)
    if is_interlaced and order == "progressive":
        order = "interlaced"
    is_forced = options.deinterlace == "force"
    is_deinterlaced = (
        options.deinterlace != "off"
        and (is_interlaced or is_forced)
        and can_deinterlace(first, is_forced)
    )
    notices = list(told)
    if is_interlaced or is_forced:
        done = "deinterlaced" if is_deinterlaced else "left as it is"
        notices.append(f"it is {'' if is_interlaced else 'not '}flagged interlaced: {done}")
    if is_interlaced or codec in _FILM_CODECS:
        sample = islice(decoder.decoded(None), _SAMPLE)
        notices += mixture([bool(frame.interlaced_frame) for frame in sample])
    if not decoder.packets.is_exact:
        notices.append("its time stamps are incomplete: frames are counted from the start")
    time_base, form = Fraction(stream.time_base or 1), pixel_form(first)
    rate, length, is_vfr = _timing(stream, decoder.packets, time_base)
    notices += _timing_notices(decoder.packets, is_vfr)
    if turn != (0, False):
        mirrored = "mirrored, then " if turn[1] else ""
        notices.append(f"turned upright: {mirrored}{turn[0]} degrees clockwise")
    aspect = Fraction(stream.sample_aspect_ratio or context.sample_aspect_ratio or 1)
    codes = (s.metadata.get("timecode") for s in (container, *container.streams))
    info = ClipInfo(
        path=str(path),
        stem=path.stem,
        container=container_name,
        codec=codec,
        pixel_format=form,
        width=first.width,
        height=first.height,
        frames=len(decoder.packets.pts),
        frame_rate=rate,
        duration_s=length,
        is_vfr=is_vfr,
        pixel_aspect=1 / aspect if turn[0] % 180 else aspect,
        rotation_deg=turn[0],
        flip=turn[1],
        field_order=order,
        timecode=next((_printable(code) for code in codes if code), None),
        encoding=upright(picture.planes, turn, stored)[1],
        digest=digest,
        notices=tuple(notices),
        frames_declared=decoder.packets.declared,
    )
    return StreamFacts(
        decoder, time_base, (first.width, first.height), form, stored, turn, is_deinterlaced,
        is_forced, info,
    )  # fmt: skip


def _as_countable(decoder: Decoder) -> Decoder:
    """The decoder, its packets marked inexact where its first frames do not follow their stamps."""
    head = (decoder.packets.index_of(f.pts) for f in islice(decoder.decoded(None), 24))
    found = [index for index in head if index is not None]
    # AVI stamps packets in the file's order; an interlaced frame may be two packets.
    is_shuffled = found != sorted(found)
    is_halved = len(found) > 1 and all(index % 2 == 0 for index in found)
    if is_shuffled or is_halved:
        return replace(decoder, packets=replace(decoder.packets, is_exact=False))
    return decoder


def _first_frame(decoder: Decoder) -> tuple[Decoder, Any, Iterator[Numbered] | None]:
    """The first frame that decodes, and what goes on from it; finds out whether packets count."""
    if decoder.packets.is_exact:
        pictures = decoder.numbered(0)
        for picture in pictures:
            return decoder, picture[1], chain((picture,), pictures)
    count, first = 0, None
    for count, frame in enumerate(decoder.decoded(None), 1):  # noqa: B007 - the last count
        first = first or frame
    if first is None:
        raise InputError(
            "no frame of it can be decoded: it is damaged, encrypted or has none",
            where=str(decoder.path),
        )
    counted = replace(decoder.packets, pts=tuple(range(count)), is_exact=False, declared=None)
    return replace(decoder, packets=counted), first, None


def mixture(is_interlaced: Sequence[bool]) -> list[str]:
    """A word about telecine: interlaced and progressive frames in turn in the first frames."""
    if all(is_interlaced) or not any(is_interlaced):
        return []
    return [
        f"{sum(is_interlaced)} of its first {len(is_interlaced)} frames are interlaced, others "
        "not: perhaps telecined film; no inverse telecine is done"
    ]


def _timing(stream: Any, packets: Packets, time_base: Fraction) -> tuple[Fraction, Fraction, bool]:
    """Frames a second, length in seconds, and whether the rate varies."""
    rate = Fraction(stream.average_rate or stream.guessed_rate or 25)
    count = len(packets.pts)
    step = packet_step(packets.pts) if packets.is_exact else None
    if step is None:
        return rate, count / rate, False
    measured = 1 / (step * time_base)
    rate = rate if 0.8 < rate / measured < 1.25 or rate < measured else measured
    length = (packets.pts[-1] - packets.pts[0] + step) * time_base
    # Where a file is cut off, its last frames lack some of those shown before them.
    whole = packets.pts[:-16] if count > 48 or (packets.declared or 0) > count else packets.pts
    steps = np.diff(np.asarray(whole, np.int64))
    # Matroska counts in whole milliseconds, so steps of a constant rate differ by one.
    return rate, length, steps.size > 0 and int(np.ptp(steps)) > max(1, step // 50)


def _timing_notices(packets: Packets, is_vfr: bool) -> list[str]:
    told = ["its frame rate varies: each frame keeps its own time"] if is_vfr else []
    missing = (packets.declared or 0) - len(packets.pts)
    if missing > 0:
        told.append(f"it is cut short: {missing} frames are missing at its end")
    return told


def _printable(tag: str) -> str:
    return tag.encode(errors="replace").decode()  # bytes that are not UTF-8 come as surrogates
