"""Opening a container safely, and scanning its video stream's packets without decoding."""

from __future__ import annotations

import os
from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np

from itmo_video.errors import InputError
from itmo_video.memory_limit import check_memory
from itmo_video.regular_file import read_head
from itmo_video.source import cineform_bands, flash_blocks
from itmo_video.source.asf_objects import numbered_frames
from itmo_video.source.ffv1_slices import has_sums
from itmo_video.source.files import check_file, check_pixels
from itmo_video.source.iso_boxes import lacks_index
from itmo_video.source.read_faults import PROBED_BYTES, fault_at_ends, find_fault
from itmo_video.source.stamp_jumps import Jumps
from itmo_video.source.streams import choose_video, codec_tag
from itmo_video.untrusted import parse_rational

# No playlists and no demuxers that open a second file, as these could read other local files.
CONTAINERS = (
    "mov,mp4,m4a,3gp,3g2,mj2,matroska,webm,avi,mpeg,mpegts,mpegvideo,mxf,ogg,flv,asf,gif,apng,"
    "ivf,h264,hevc,av1,obu,m4v,mjpeg,yuv4mpegpipe,nut,wtv,dv,rm,mpjpeg,ingenient,vc1,swf,roq,smk,"
    "bink,flic,nsv,gxf,h263,h261,mjpeg_2000,evc,vvc,amv,r3d,dirac,cavsvideo,pmp,film_cpk,mp3,aac,"
    "wav,flac,w64,aiff,caf,ac3,eac3,dts,truehd,amr,au,voc,tta,ape,wv"
)

# Tags that are not UTF-8 keep their bytes (as surrogates), as is the default from PyAV 19 on.
TAG_ERRORS: dict[str, Any] = (
    {"metadata_errors": "surrogateescape"} if int(av.__version__.split(".")[0]) < 19 else {}
)


# Of decoders that show memory that was never written where a packet is not whole.
CHECKS = {"cfhd": cineform_bands.is_whole, "flashsv": flash_blocks.is_whole}
_AVI_CHUNK_BYTES = 8  # of a chunk's header, at least


@dataclass(frozen=True)
class Packets:
    """The frames of a stream by their packets, found without decoding.

    `pts` are those of the frames, sorted, in ticks; `order` maps each packet's pts to its place in
    the file and its size. `keys` are (place, pts, dts) of the packets at which decoding can start.
    Not `is_exact`: stamps are missing, not unique or not presentation times, so frames must be
    counted by decoding. `declared` is the container's frame count, None if it states none.
    `repeats` are stamps of frames without a packet, which repeat the previous frame. `last_length`
    is the duration of the last frame in ticks, 0 if unknown. `left_out` is the number of frames
    before the first key packet, which are not part of the clip. `has_jumps`: stamps jump, as in
    joined captures, so they are not times. `end_byte` is the file's byte behind all packets.
    `broken` are stamps of packets that must not reach the decoder; None if none is whole, or for
    codecs that need no check. `has_sums`: FFV1's packets have checksums.
    """

    pts: tuple[int, ...]
    order: Mapping[int, tuple[int, int]]
    keys: tuple[tuple[int, int, int], ...]
    is_exact: bool
    declared: int | None = None
    repeats: frozenset[int] = frozenset()
    last_length: int = 0
    left_out: int = 0
    has_jumps: bool = False
    end_byte: int = 0
    broken: frozenset[int] | None = None
    has_sums: bool = False

    def index_of(self, pts: int | None) -> int | None:
        """The frame's number by its pts, None for a stamp that no packet has."""
        if pts is None:
            return None
        at = bisect_right(self.pts, pts) - 1
        return at if at >= 0 and self.pts[at] == pts else None


def open_container(path: Path, max_pixels: int) -> Any:
    """Open a container, a regular file in one of CONTAINERS; otherwise raises InputError."""
    check_file(path)
    options = {
        "protocol_whitelist": "file",
        "format_whitelist": CONTAINERS,
        "max_pixels": decoder_limit(max_pixels),
    }
    try:
        # An absolute path, so that a colon in the name is not mistaken for a protocol.
        return av.open(os.path.abspath(path), options=options, **TAG_ERRORS)
    except (av.FFmpegError, OSError, ValueError) as error:
        check_memory(error)
        reason = getattr(error, "strerror", None) or str(error)
        fault = fault_at_ends(path)
        if fault is None and lacks_index(path):
            raise InputError(
                "the film has no index (moov): the recording or the copy is incomplete",
                where=str(path),
                remedy="Copy it again. A recording that was cut off can often be repaired, with "
                "untrunc and a whole film of the same camera.",
            ) from error
        what = f"not a readable video ({reason})" if fault is None else str(fault)
        raise InputError(what, where=str(path)) from error


@contextmanager
def open_video(path: Path, max_pixels: int, number: int | None = None) -> Iterator[tuple[Any, Any]]:
    """Open a container and its video stream, ready to decode: (container, stream).

    The stream with that number in the file, by default the one that `choose_video` picks. Raises
    InputError if it cannot be opened, has no video, is encrypted, has an unknown codec, or has
    frames larger than `max_pixels`.
    """
    where = str(path)
    container = open_container(path, max_pixels)
    try:
        stream, _ = choose_video(container, number, where)
        prepare_decoder(stream, max_pixels, where)
        yield container, stream
    finally:
        container.close()


def decoder_limit(max_pixels: int) -> str:
    """FFmpeg's limit, which must leave room for the padding that it includes; ours is exact."""
    return str(min(2 * max_pixels + (1 << 20), 2**31 - 1))


def read_packets(container: Any, stream: Any) -> Iterator[Any]:
    """Yield a stream's packets up to the end or until reading fails."""
    while True:
        try:
            yield from container.demux(stream)
        except IndexError:  # PyAV 18 at a stream that starts later; reading can continue after it
            continue
        except (av.FFmpegError, OSError) as error:
            check_memory(error)
        return


def scan_packets(container: Any, stream: Any) -> Packets:
    """Read all packets without decoding to find the frames and where decoding can start.

    Damage ends the scan without an error; the packets read so far are used.
    """
    stamps: list[int | None] = []
    shown: list[int] = []
    order: dict[int, tuple[int, int]] = {}
    keys: list[tuple[int, int, int]] = []
    broken: list[int] = []
    is_unique, discarded, jumps = True, 0, Jumps(stream)
    last, tail, end_byte = (0, 0), (0, 0), 0
    codec = str(stream.codec_context.name)
    check, sums = CHECKS.get(codec), False
    for packet in read_packets(container, stream):
        if packet.size == 0:
            continue
        pts, place = packet.pts, len(stamps)
        if is_hidden(packet, codec):
            continue
        stamps.append(pts)
        tail = packet.size, (packet.pos or 0) + packet.size
        end_byte = max(end_byte, tail[1])
        sums = sums or (codec == "ffv1" and has_sums(bytes(packet)))
        jumps.see(packet.dts if packet.dts is not None else pts)
        is_unique = is_unique and pts is not None and pts not in order
        if pts is not None:
            order[pts] = (place, packet.size)
            if check is not None and not check(bytes(packet)):
                broken.append(pts)
            if packet.is_keyframe:
                keys.append((place, pts, pts if packet.dts is None else packet.dts))
            if not packet.is_discard:
                shown.append(pts)
                last = max(last, (pts, int(packet.duration or 0)))
        discarded += packet.is_discard
    declared = _declared_frames(container, stream, len(stamps), shown, tail)
    if declared is not None:
        declared -= discarded
    repeats = frozenset[int]()
    if is_unique:
        repeats = _empty_chunks(container, stream, shown, declared, end_byte)
    pts_shown = tuple(sorted((*shown, *repeats)))
    is_exact = is_unique and not jumps.found
    return Packets(
        pts_shown, order, tuple(keys), is_exact, declared, repeats, last[1],
        has_jumps=jumps.found, end_byte=end_byte,
        broken=frozenset(broken) if check is not None and len(broken) < len(stamps) else None,
        has_sums=sums,
    )  # fmt: skip


def _empty_chunks(
    container: Any, stream: Any, shown: list[int], declared: int | None, end_byte: int
) -> frozenset[int]:
    """Stamps of an AVI's empty chunks, which repeat a frame; AVI derives stamps from chunks."""
    if str(container.format.name) != "avi" or not shown or (declared or 0) <= len(shown):
        return frozenset()
    last = max(shown)
    if int(stream.start_time or 0) + int(stream.frames) - 1 > last and _is_whole_riff(
        container, end_byte
    ):
        last = int(stream.start_time or 0) + int(stream.frames) - 1
    if last - min(shown) >= 2 * int(stream.frames):
        return frozenset()  # its stamps do not count chunks
    if last - min(shown) > os.stat(container.name).st_size // _AVI_CHUNK_BYTES:
        return frozenset()  # its header states more chunks than fit into the file
    return frozenset(range(min(shown), last + 1)) - set(shown)


def _is_whole_riff(container: Any, end_byte: int) -> bool:
    path = Path(container.name)
    whole = 8 + int.from_bytes(read_head(path, 8)[4:8], "little")
    return os.stat(path).st_size >= whole and find_fault(path, end_byte, PROBED_BYTES) is None


def prepare_decoder(stream: Any, max_pixels: int, where: str) -> None:
    """Set up a stream's decoder; raises InputError if it is encrypted or its frames too large."""
    context = stream.codec_context
    if codec_tag(context) in ("encv", "drmi"):
        raise InputError("the video is encrypted", where=where)
    check_pixels(context.width, context.height, max_pixels, where)
    options = {"max_pixels": decoder_limit(max_pixels)}
    if context.name == "h264":
        # Otherwise frames near a seek point are dropped in streams that do not state their delay.
        options["strict"] = "1"
    context.options = options


def is_hidden(packet: Any, codec: str) -> bool:
    """Whether a VP8 packet is a reference that is never shown (RFC 6386, 9.1)."""
    return codec == "vp8" and not memoryview(packet)[0] & 0x10


def _declared_frames(
    container: Any, stream: Any, count: int, pts: list[int], tail: tuple[int, int]
) -> int | None:
    """The number of frames the file should have; `tail` is the last packet's size and end."""
    name = str(container.format.name)
    if name == "yuv4mpegpipe" and count:
        # FFmpeg takes a damaged FRAME line or a truncated frame for the end of the stream.
        size, end = tail
        rest = os.stat(container.name).st_size - end
        return count - (-rest // (size + len(b"FRAME\n")))
    if name.startswith("mov"):
        return max(len(stream.index_entries), count)
    if name == "avi" and stream.frames:
        return max(int(stream.frames), count)
    if name == "asf":
        return max(numbered_frames(Path(container.name), int(stream.id)), count)
    if not pts:
        return None
    missing = frames_after(stream, max(pts) + (packet_step(pts) or 0))
    return None if missing is None else count + missing


def frames_after(stream: Any, end_pts: int) -> int | None:
    """How many frames a Matroska track should have after `end_pts`, None if it does not state it.

    Its duration is written when the file is finalised. NUT keeps the tag of what was cut.
    """
    length, rate = stream.metadata.get("DURATION", ""), stream.average_rate
    if not length or not rate or not str(stream.container.format.name).startswith("matroska"):
        return None
    try:
        hours, minutes, seconds = map(parse_rational, length.split(":"))
    except ValueError:
        return None
    until_s = end_pts * Fraction(stream.time_base)
    missing = (hours * 3600 + minutes * 60 + seconds - until_s) * rate
    return round(missing) if missing >= 1.5 else 0


def packet_step(pts: Sequence[int]) -> int | None:
    """The median interval of stamps in ticks, sorted or not; None for fewer than two."""
    if len(pts) < 2:
        return None
    return int(np.median(np.diff(np.sort(np.asarray(pts, np.int64)))))
