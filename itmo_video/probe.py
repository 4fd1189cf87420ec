"""What a file says of itself before its frames are read: container, packets, tags, content.

Nothing but local files in known containers is opened, and no picture larger than the limit.
"""

from __future__ import annotations

import hashlib
import os
import stat
from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np

from itmo_video.errors import AlreadyHdrError, InputError
from itmo_video.model import Transfer as Transfer

# No playlists and no demuxer that opens a second file: those could read other local files.
CONTAINERS = (
    "mov,mp4,m4a,3gp,3g2,mj2,matroska,webm,avi,mpeg,mpegts,mpegvideo,mxf,ogg,flv,asf,gif,apng,"
    "ivf,h264,hevc,av1,obu,m4v,mjpeg,yuv4mpegpipe,nut,wtv,dv,rm,mpjpeg,ingenient,vc1,swf,roq,smk,"
    "bink,flic,nsv,gxf,h263,h261,mjpeg_2000,evc,vvc,amv,r3d,dirac,cavsvideo,pmp,film_cpk,mp3,aac,"
    "wav,flac,w64,aiff,caf,ac3,eac3,dts,truehd,amr,au,voc,tta,ape,wv"
)

_STILL_MAGIC = (
    (b"\x89PNG\r\n\x1a\n", "png"), (b"\xff\xd8\xff", "mjpeg"), (b"II*\0", "tiff"),
    (b"MM\0*", "tiff"), (b"\0\0\0\x0cjP  ", "jpeg2000"), (b"\xff\x4f\xff\x51", "jpeg2000"),
    (b"SDPX", "dpx"), (b"XPDS", "dpx"), (b"qoif", "qoi"), (b"8BPS", "psd"),
    (b"P4\n", "pbm"), (b"P5\n", "pgm"), (b"P6\n", "ppm"),
)  # fmt: skip
_FLOAT_MAGIC = (b"\x76\x2f\x31\x01", b"#?RADIANCE", b"#?RGBE", b"PF\n", b"Pf\n")

# Tags that are not UTF-8 keep their bytes (as surrogates), as PyAV does by itself from 19 on.
TAG_ERRORS: dict[str, Any] = (
    {"metadata_errors": "surrogateescape"} if int(av.__version__.split(".")[0]) < 19 else {}
)

_DIGEST_BLOCK, _DIGEST_WHOLE, _DIGEST_BLOCKS = 1 << 20, 64 << 20, 64


@dataclass(frozen=True)
class Packets:
    """The frames of a stream by their packets, found without decoding.

    `pts` are those of the frames, sorted, in ticks; `order` maps every packet's pts to its place
    in the file and its size. `keys` are (place, pts, dts) of the packets at which decoding can
    start. Not `is_exact`: stamps are missing, not unique or no times of presentation, so frames
    must be counted by decoding. `declared` is how many frames the container speaks of, None where
    it does not.
    """

    pts: tuple[int, ...]
    order: Mapping[int, tuple[int, int]]
    keys: tuple[tuple[int, int, int], ...]
    is_exact: bool
    declared: int | None = None

    def index_of(self, pts: int | None) -> int | None:
        """Give the frame's number by its pts, None for a stamp that no packet has."""
        if pts is None:
            return None
        at = bisect_right(self.pts, pts) - 1
        return at if at >= 0 and self.pts[at] == pts else None


# ---- files ----


def check_file(path: Path) -> None:
    """Raise InputError unless there is a readable, regular file with something in it."""
    try:
        found = path.stat()
        with path.open("rb"):
            pass
    except FileNotFoundError as error:
        raise InputError("no such file", where=str(path)) from error
    except IsADirectoryError as error:
        raise InputError(
            "is a folder, not a clip",
            where=str(path),
            remedy="For an image sequence give its pattern, such as folder/img.%04d.png.",
        ) from error
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(f"cannot be read: {reason}", where=str(path)) from error
    if not stat.S_ISREG(found.st_mode):
        raise InputError("is not a regular file", where=str(path))
    if found.st_size == 0:
        raise InputError("the file is empty", where=str(path))


def still_codec(path: Path) -> str | None:
    """Name FFmpeg's decoder for a still image by its first bytes, None for anything else.

    Raises AlreadyHdrError for images that hold floats.
    """
    with path.open("rb") as file:
        head = file.read(64)
        more = head + file.read(4096) if head.startswith(b"\x89PNG") else b""
    if head.startswith(_FLOAT_MAGIC):
        raise AlreadyHdrError("it is a floating-point image, so it is HDR already", where=str(path))
    if head[:4] == b"RIFF" and head[8:12] == b"WEBP":
        return "webp"
    if head[:2] == b"BM" and head[6:10] == b"\0\0\0\0":
        return "bmp"
    if b"acTL" in more or path.suffix.lower() in (".mjpeg", ".mjpg"):
        return None
    return next((codec for magic, codec in _STILL_MAGIC if head.startswith(magic)), None)


def content_digest(paths: Sequence[Path]) -> str:
    """Digest the files' content, not their names: 32 hex digits of BLAKE2b.

    Everything up to 64 MiB in all; beyond that each file's size and 64 evenly spaced blocks of
    1 MiB (at least two from each file).
    """
    digest = hashlib.blake2b(digest_size=16)
    sizes = [path.stat().st_size for path in paths]
    count = max(2, _DIGEST_BLOCKS // len(paths))
    for path, size in zip(paths, sizes, strict=True):
        digest.update(size.to_bytes(8, "little"))
        with path.open("rb") as file:
            if sum(sizes) <= _DIGEST_WHOLE or size <= count * _DIGEST_BLOCK:
                digest.update(file.read())
                continue
            for i in range(count):
                file.seek(i * (size - _DIGEST_BLOCK) // (count - 1))
                digest.update(file.read(_DIGEST_BLOCK))
    return digest.hexdigest()


# ---- containers ----


@contextmanager
def open_video(path: Path, max_pixels: int) -> Iterator[tuple[Any, Any]]:
    """Open a container and its first video stream, ready to decode: (container, stream).

    Raises InputError when it cannot be opened, has no video, is encrypted, its codec is unknown
    or its frames are larger than `max_pixels`.
    """
    where = str(path)
    options = {
        "protocol_whitelist": "file",
        "format_whitelist": CONTAINERS,
        "max_pixels": decoder_limit(max_pixels),
    }
    try:
        # An absolute path, so that a colon in the name is not taken for a protocol.
        container = av.open(os.path.abspath(path), options=options, **TAG_ERRORS)
    except (av.FFmpegError, OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(f"is not a video that can be read ({reason})", where=where) from error
    try:
        stream = _video_stream(container, where)
        _prepare_decoder(stream, max_pixels, where)
        yield container, stream
    finally:
        container.close()


def check_pixels(width: int, height: int, max_pixels: int, where: str) -> None:
    """Raise InputError for pictures that are larger than the limit."""
    if width * height > max_pixels:
        raise InputError(
            f"{width}x{height} is more than {max_pixels} pixels a frame",
            where=where,
            remedy="Raise --max-pixels if that is meant.",
        )


def decoder_limit(max_pixels: int) -> str:
    """FFmpeg's own limit: with room for the padding that it counts in, as ours is exact."""
    return str(min(2 * max_pixels + (1 << 20), 2**31 - 1))


def read_packets(container: Any, stream: Any) -> Iterator[Any]:
    """Yield a stream's packets up to the end or to where reading fails."""
    while True:
        try:
            yield from container.demux(stream)
        except IndexError:  # PyAV 18 at a stream that begins later on; reading can go on behind it
            continue
        except (av.FFmpegError, OSError):
            pass
        return


def scan_packets(container: Any, stream: Any) -> Packets:
    """Read all packets without decoding: which frames there are, and where decoding can start.

    Damage ends the scan without an error: what was read until there is what there is.
    """
    stamps: list[int | None] = []
    shown: list[int] = []
    order: dict[int, tuple[int, int]] = {}
    keys: list[tuple[int, int, int]] = []
    is_unique, discarded = True, 0
    codec = str(stream.codec_context.name)
    for packet in read_packets(container, stream):
        if packet.size == 0:
            continue
        pts, place = packet.pts, len(stamps)
        if _is_hidden(packet, codec):
            continue
        stamps.append(pts)
        is_unique = is_unique and pts is not None and pts not in order
        if pts is not None:
            order[pts] = (place, packet.size)
            if packet.is_keyframe:
                keys.append((place, pts, pts if packet.dts is None else packet.dts))
            if not packet.is_discard:
                shown.append(pts)
        discarded += packet.is_discard
    declared = _declared_frames(container, stream, len(stamps), shown)
    if declared is not None:
        declared -= discarded
    return Packets(tuple(sorted(shown)), order, tuple(keys), is_unique, declared)


def _video_stream(container: Any, where: str) -> Any:
    videos = [s for s in container.streams if s.type == "video"]
    videos = [s for s in videos if "attached_pic" not in str(s.disposition).lower()]
    if not videos:
        raise InputError("there is no video in it", where=where)
    usable = [s for s in videos if s.codec_context is not None]
    if not usable:
        raise InputError("its video codec is unknown, nothing here decodes it", where=where)
    return usable[0]


def _prepare_decoder(stream: Any, max_pixels: int, where: str) -> None:
    context = stream.codec_context
    if str(context.codec_tag) in ("encv", "drmi"):
        raise InputError("it is encrypted", where=where)
    check_pixels(context.width, context.height, max_pixels, where)
    context.thread_type = "AUTO"
    options = {"max_pixels": decoder_limit(max_pixels)}
    if context.name == "h264":
        # Else a stream that does not tell its delay has frames dropped near wherever one starts.
        options["strict"] = "1"
    context.options = options


def _is_hidden(packet: Any, codec: str) -> bool:
    """Whether a VP8 packet is a reference that is never shown (RFC 6386, 9.1)."""
    return codec == "vp8" and not memoryview(packet)[0] & 0x10


def _declared_frames(container: Any, stream: Any, count: int, pts: list[int]) -> int | None:
    name = str(container.format.name)
    if name.startswith("mov"):
        return max(len(stream.index_entries), count)
    if name == "avi" and stream.frames:
        return max(int(stream.frames), count)
    length = stream.metadata.get("DURATION", "")  # Matroska; written when the file was finished
    rate = stream.average_rate
    if not length or not rate or not pts:
        return None
    try:
        hours, minutes, seconds = (Fraction(part) for part in length.split(":"))
    except ValueError:
        return None
    until = (max(pts) + (packet_step(pts) or 0)) * Fraction(stream.time_base)
    missing = (hours * 3600 + minutes * 60 + seconds - until) * rate
    return count + (round(missing) if missing >= 1.5 else 0)


def packet_step(pts: Sequence[int]) -> int | None:
    """Give the middle distance of sorted or unsorted stamps in ticks, None for fewer than two."""
    if len(pts) < 2:
        return None
    return int(np.median(np.diff(np.sort(np.asarray(pts, np.int64)))))
