"""The facts about a video stream, determined once from packets, tags and its first frame."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import chain, islice
from pathlib import Path
from typing import Any

from itmo_video.errors import AlreadyHdrError, InputError
from itmo_video.model import ClipInfo, Code, Encoding
from itmo_video.regular_file import read_head
from itmo_video.source import hidden_hdr, tags
from itmo_video.source.chroma_siting import Y4M, Y4M_HEAD_BYTES, stream_siting, y4m_siting
from itmo_video.source.code_range import outside_range
from itmo_video.source.container_facts import track_of
from itmo_video.source.counted_frames import find_losses
from itmo_video.source.cropping import Crop, cropped, cropped_size, usable
from itmo_video.source.decoding import Decoder, Numbered
from itmo_video.source.deinterlace import can_deinterlace
from itmo_video.source.digest import SourceFiles
from itmo_video.source.files import check_pixels
from itmo_video.source.frame_timing import packet_notices, stated_rate, timing, timing_notices
from itmo_video.source.packets import Packets, open_video, scan_packets
from itmo_video.source.planes import Turn, is_420, picture_of, pixel_form, upright
from itmo_video.source.streams import choose_video, codec_tag
from itmo_video.source.stretches import numbered
from itmo_video.source.tags import InputOptions
from itmo_video.source.track_facts import TrackFacts

_FILM_CODECS = ("mpeg2video", "vc1")  # codecs in which film may be telecined frame by frame
_SAMPLE = 30  # frames examined for telecine
_INTERLACED = {2: "tff", 3: "bff", 4: "tff", 5: "bff"}  # FFmpeg's AVFieldOrder
CAPTURES = ("mpegts", "mpeg", "h264", "hevc", "mpegvideo")  # may start and end anywhere
_LIMITED_GREY = ("h264", "hevc", "av1", "libdav1d", "vp9", "mpeg2video", "mpeg4")


@dataclass(frozen=True)
class StreamFacts:
    """The facts about a stream, known before its frames are read.

    `size` (width, height) in pixels, `form` and `stored` are those of each decoded frame; `turn`
    makes it upright. `info` is the clip's metadata for all other modules.
    """

    decoder: Decoder
    time_base: Fraction
    size: tuple[int, int]
    form: str
    stored: Encoding
    turn: Turn
    crop: Crop | None
    is_deinterlaced: bool
    is_forced: bool
    info: ClipInfo


def find_facts(
    path: Path, options: InputOptions, source: SourceFiles
) -> tuple[StreamFacts, Iterator[Numbered] | None]:
    """The facts about a video file, and a reader at its first frame, if there is one.

    `source` is the state of the file before it was read.

    Raises InputError if no frame can be decoded, AlreadyHdrError by its tags, and av's errors.
    """
    with open_video(path, options.max_pixels, options.stream) as (container, stream):
        context = stream.codec_context
        codec, container_name = str(context.name), str(container.format.name)
        packets = scan_packets(container, stream)
        decoder = Decoder(path, options.max_pixels, packets, codec, stream.index)
        order = _INTERLACED.get(int(context.field_order), "progressive")
        if decoder.packets.is_exact and (order != "progressive" or container_name == "avi"):
            decoder = _as_countable(decoder)
        decoder, first, begun = _first_frame(decoder, container_name in CAPTURES)
        track = track_of(path, container, stream)
        head = read_head(path, Y4M_HEAD_BYTES) if container_name == Y4M else b""
        digest = source.digest(packets.end_byte)
        return facts_at(container, stream, decoder, first, options, digest, track, head), begun


def facts_at(
    container: Any,
    stream: Any,
    decoder: Decoder,
    first: Any,
    options: InputOptions,
    digest: str,
    track: TrackFacts | None = None,
    head: bytes = b"",
) -> StreamFacts:
    """The facts about an open stream from its first decoded frame; `digest` is of its content.

    `track` has those from the file's boxes, None for a stream that is not a file; `head` is its
    first bytes, which count for Y4M.
    """
    path, codec, container_name = decoder.path, decoder.codec, str(container.format.name)
    context = stream.codec_context
    order = _INTERLACED.get(int(context.field_order), "progressive")
    check_pixels(first.width, first.height, options.max_pixels, str(path))
    picture = picture_of(path, first)
    tagged, file = tags.read_tags(first, context), None if track is None else path
    track = track or TrackFacts(sample_entry=codec_tag(context))
    hidden = _hidden_hdr(file, str(path), container, stream, track, first, tagged)
    if hidden is not None and not (options.force_sdr or options.transfer != "auto"):
        if not options.only_tells:
            raise hidden
        tagged = replace(
            tagged, named_transfer="log" if hidden.remedy == hidden_hdr.UNDO_LOG else "pq"
        )
    is_y4m = container_name == Y4M
    siting, doubt = y4m_siting(head) if is_y4m else (stream_siting(stream), None)
    stored, told = tags.resolve_encoding(
        tagged,
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
        siting=siting,
        is_420=picture.family == "ycbcr" and is_420(first.format),
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
    _, chosen = choose_video(container, options.stream, str(path))
    notices = [*([chosen] if chosen else []), *told]
    notices += [doubt] if doubt else []
    if hidden is not None:
        notices.append(hidden.what)
    size = (first.width, first.height)
    crop = usable(track.crop, size)
    if crop is not None:
        shown = cropped_size(size, crop)
        notices.append(f"cropped to {shown[0]}x{shown[1]}, as stated by the container")
    notices += outside_range(picture, stored)
    if is_interlaced or is_forced:
        done = "deinterlaced" if is_deinterlaced else "left as it is"
        notices.append(f"{'' if is_interlaced else 'not '}flagged as interlaced: {done}")
    if is_interlaced or codec in _FILM_CODECS:
        sample = islice(decoder.decoded(None), _SAMPLE)
        notices += mixture([bool(frame.interlaced_frame) for frame in sample])
    notices += packet_notices(decoder.packets, decoder.losses)
    time_base, form = Fraction(stream.time_base or 1), pixel_form(first)
    stated = stated_rate(stream, head)
    rate, length, is_vfr = timing(stream, stated, decoder.packets, time_base)
    notices += timing_notices(stream, stated, decoder.packets, rate, is_vfr)
    if turn != (0, False):
        mirrored = "mirrored, then " if turn[1] else ""
        notices.append(f"rotated for display: {mirrored}{turn[0]} degrees clockwise")
    aspect = Fraction(stream.sample_aspect_ratio or context.sample_aspect_ratio or 1)
    codes = (s.metadata.get("timecode") for s in (container, *container.streams))
    info = ClipInfo(
        path=str(path),
        stem=path.stem,
        container=container_name,
        codec=codec,
        pixel_format=form,
        width=cropped_size(size, crop)[0],
        height=cropped_size(size, crop)[1],
        frames=len(decoder.packets.pts),
        frame_rate=rate,
        duration_s=length,
        is_vfr=is_vfr,
        pixel_aspect=1 / aspect if turn[0] % 180 else aspect,
        rotation_deg=turn[0],
        flip=turn[1],
        field_order=order,
        timecode=next((_printable(code) for code in codes if code), None),
        encoding=shown_planes(picture.planes, stored, crop, turn)[1],
        digest=digest,
        notices=tuple(notices),
        frames_declared=decoder.packets.declared,
    )
    return StreamFacts(
        decoder, time_base, size, form, stored, turn, crop, is_deinterlaced, is_forced, info,
    )  # fmt: skip


def shown_planes(
    planes: tuple[Code, ...], stored: Encoding, crop: Crop | None, turn: Turn
) -> tuple[tuple[Code, ...], Encoding]:
    """A decoded picture's planes for display: cropped, then rotated."""
    if crop is not None:
        planes, stored = cropped(planes, stored, crop)
    return upright(planes, turn, stored)


def _hidden_hdr(
    file: Path | None,
    where: str,
    container: Any,
    stream: Any,
    track: TrackFacts,
    frame: Any,
    tagged: tags.Tags,
) -> AlreadyHdrError | None:
    """The refusal of HDR without a transfer tag, None for anything else."""
    words = hidden_hdr.dolby_vision_words(track, frame, tagged.transfer)
    words = words or hidden_hdr.hdr10_words(frame, tagged.transfer)
    if words is not None:
        return AlreadyHdrError(words, where=where, remedy=hidden_hdr.MAP_TO_SDR)
    words = hidden_hdr.log_words(file, (container.metadata, stream.metadata))
    if words is not None:
        return AlreadyHdrError(words, where=where, remedy=hidden_hdr.UNDO_LOG)
    return None


def _as_countable(decoder: Decoder) -> Decoder:
    """The decoder; its packets are marked inexact if its first frames contradict their stamps."""
    head = (decoder.packets.index_of(f.pts) for f in islice(decoder.decoded(None), 24))
    found = [index for index in head if index is not None]
    # AVI stamps packets in file order; an interlaced frame may be two packets.
    is_shuffled = found != sorted(found)
    is_halved = len(found) > 1 and all(index % 2 == 0 for index in found)
    is_halved = is_halved and not decoder.packets.repeats
    if is_shuffled or is_halved:
        return replace(decoder, packets=replace(decoder.packets, is_exact=False))
    return decoder


def _first_frame(
    decoder: Decoder, is_capture: bool
) -> tuple[Decoder, Any, Iterator[Numbered] | None]:
    """The first frame that decodes, and an iterator of the rest; checks the packets' order.

    Frames of a capture shown before its first key packet refer to frames before the capture, so
    they are not part of it.
    """
    if decoder.packets.is_exact:
        pictures = numbered(decoder, 0)
        for picture in pictures:
            lead = _leading(decoder.packets) if is_capture else 0
            if lead == 0 or picture[0] < lead:
                return decoder, picture[1], chain((picture,), pictures)
            packets = replace(decoder.packets, pts=decoder.packets.pts[lead:], left_out=lead)
            return _first_frame(replace(decoder, packets=packets), False)
    count, first = 0, None
    failed: list[Any] = []

    def on_error(packet: Any) -> bool:
        failed.append(packet)
        return False

    every = decoder.decoded(None, on_error=on_error)
    for count, frame in enumerate(every, 1):  # noqa: B007 - the last count
        first = first or frame
    if first is None:
        raise InputError(
            "no frame can be decoded: the video is damaged, encrypted or empty",
            where=str(decoder.path),
        )
    losses = find_losses(decoder, bool(failed))
    counted = replace(
        decoder.packets,
        pts=tuple(range(count)),
        is_exact=False,
        declared=count + losses.missing if losses.missing else None,
    )
    return replace(decoder, packets=counted, losses=losses), first, None


def _leading(packets: Packets) -> int:
    """The number of frames shown before the first key packet's."""
    return (packets.index_of(packets.keys[0][1]) or 0) if packets.keys else 0


def mixture(is_interlaced: Sequence[bool]) -> list[str]:
    """A notice about telecine, if the first frames alternate interlaced and progressive."""
    if all(is_interlaced) or not any(is_interlaced):
        return []
    return [
        f"{sum(is_interlaced)} of the first {len(is_interlaced)} frames are interlaced, the rest "
        "are not: possibly telecined film; no inverse telecine is applied"
    ]


def _printable(tag: str) -> str:
    return tag.encode(errors="replace").decode()  # bytes that are not UTF-8 arrive as surrogates
