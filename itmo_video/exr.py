"""Half-float OpenEXR frames on disk: whole or not there at all, the same bytes every time.

The only module that imports OpenEXR, and only inside functions, so that the names come at once.
Frames are encoded to memory and written by us: OpenEXR's own file writer loses the error when its
last buffer does not fit on the disk, and says no more of a failure than a sentence.
"""

from __future__ import annotations

import errno
import functools
import io
import itertools
import os
import re
import socket
import struct
import sys
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple, TextIO, cast

import numpy as np
import numpy.typing as npt

from itmo_video.errors import InputError, OutputError
from itmo_video.model import Float32, Half

StrPath = str | os.PathLike[str]
Chromaticities = tuple[float, float, float, float, float, float, float, float]

_CONSTANTS = {
    "none": "NO_COMPRESSION",
    "rle": "RLE_COMPRESSION",
    "zips": "ZIPS_COMPRESSION",
    "zip": "ZIP_COMPRESSION",
    "piz": "PIZ_COMPRESSION",
    "pxr24": "PXR24_COMPRESSION",
    "b44": "B44_COMPRESSION",
    "dwaa": "DWAA_COMPRESSION",
    "dwab": "DWAB_COMPRESSION",
    "htj2k": "HTJ2K256_COMPRESSION",
    "zstd": "ZSTD_COMPRESSION",
}
COMPRESSION_NAMES = tuple(_CONSTANTS)
AP0: Chromaticities = (0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.077, 0.32168, 0.33767)

# Lines in a chunk, by the number in the file's "compression" attribute; 0 where we do not know.
_CHUNK_LINES = (1, 1, 1, 16, 32, 16, 32, 32, 32, 256, 256, 32, 0, 1)
_PLAIN_FLAGS = 0x2 | 0x400  # version 2, scan lines in one part, perhaps with long names
_NO_LAYERS: Mapping[str, Half | Float32] = MappingProxyType({})


@dataclass(frozen=True)
class ExrHeader:
    """What a frame's header says beside its size; nothing in it may depend on the run.

    `chromaticities` are x, y of red, green, blue and white; `white_nits` is the luminance of 1.0 in
    cd/m2; `time_s` the presentation time in seconds; `timecode` is "HH:MM:SS:FF" (";FF" for drop
    frame). An ACES container (SMPTE ST 2065-4) must be AP0, uncompressed and without layers.
    """

    compression: str
    chromaticities: Chromaticities
    white_nits: float
    frame_rate: Fraction
    pixel_aspect: Fraction
    time_s: Fraction
    source_name: str
    fingerprint: str
    timecode: str | None = None
    settings_text: str = ""
    is_aces_container: bool = False


@dataclass(frozen=True, eq=False)
class ExrImage:
    """One image as stored: 2D arrays (height, width) by channel name, attributes by theirs."""

    channels: dict[str, npt.NDArray[Any]]
    attributes: dict[str, Any]

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) of the data window in pixels."""
        (left, top), (right, bottom) = self.attributes["dataWindow"]
        return int(right) - int(left) + 1, int(bottom) - int(top) + 1

    @property
    def fingerprint(self) -> str | None:
        """The fingerprint that the frame was written with; None in other people's files."""
        value = self.attributes.get("itmoFingerprint")
        return value if isinstance(value, str) else None


def write_exr(
    path: StrPath,
    rgb: tuple[Half, Half, Half],
    header: ExrHeader,
    *,
    alpha: Half | None = None,
    layers: Mapping[str, Half | Float32] = _NO_LAYERS,
    durable: bool = False,
) -> int:
    """Write one frame under a temporary name, rename it to `path` and return its size in bytes.

    `rgb`, `alpha` (RGB is expected premultiplied by it) and each of `layers` (by full channel name,
    such as "expand_map.Y"; float16 or float32) are arrays (height, width), written as they are.
    `durable` waits until file and folder are on the disk. Raises ValueError for arrays or a header
    that do not fit, and OutputError when the file cannot be written; no temporary file stays.
    """
    import OpenEXR

    channels = _checked_channels(rgb, alpha, layers)
    if header.is_aces_container and (
        header.compression != "none" or layers or tuple(header.chromaticities) != AP0
    ):
        raise ValueError("an ACES container must be uncompressed AP0 without layers")
    encoded = io.BytesIO()
    OpenEXR.File(_attributes(header), channels, num_threads=0).write(encoded)
    return write_whole(path, encoded.getbuffer(), durable=durable)


def read_exr(path: StrPath) -> ExrImage:
    """Read all channels of the first part of `path`; raises InputError unless it is whole."""
    import OpenEXR

    data = _read_bytes(path)
    try:
        _check_chunks(data)
        with _no_prints():
            file = OpenEXR.File(io.BytesIO(data), separate_channels=True, num_threads=0)
            # The constructor swallows damage and leaves a file without parts: channels() raises.
            channels = {name: channel.pixels for name, channel in file.channels().items()}
    except (_DamageError, RuntimeError, ValueError, OSError, MemoryError) as error:
        reason = str(error) if isinstance(error, _DamageError) else "its pixels do not decode"
        raise InputError(
            f"not a whole EXR file: {reason}",
            where=os.fspath(path),
            remedy="Make or copy the file again.",
        ) from error
    return ExrImage(channels, dict(file.header()))


def is_whole(path: StrPath) -> bool:
    """Whether `path` opens and all its channels can be read; False too when it is missing."""
    try:
        read_exr(path)
    except InputError:
        return False
    return True


def read_fingerprint(path: StrPath) -> str | None:
    """Read the fingerprint from the header of `path`; None when there is none or no header."""
    try:
        with open(path, "rb") as file:
            data = file.read(1 << 16)
            try:
                attributes, _ = _parse_header(data)
            except _DamageError:  # perhaps only longer than a first look
                attributes, _ = _parse_header(data + file.read(1 << 24))
    except (OSError, _DamageError):
        return None
    kind, value = attributes.get("itmoFingerprint", ("", b""))
    return value.decode("utf-8", "replace") if kind == "string" else None


def _checked_channels(
    rgb: tuple[Half, Half, Half], alpha: Half | None, layers: Mapping[str, Half | Float32]
) -> dict[str, npt.NDArray[Any]]:
    channels: dict[str, npt.NDArray[Any]] = dict(zip("RGB", rgb, strict=True))
    if alpha is not None:
        channels["A"] = alpha
    for name in layers:
        if not name or name in ("R", "G", "B", "A"):
            raise ValueError(f"{name!r} cannot name a layer's channel")
    for name, array in (*channels.items(), *layers.items()):
        allowed = (np.float16, np.float32) if name in layers else (np.float16,)
        if array.ndim != 2 or array.size == 0 or array.shape != rgb[0].shape:
            raise ValueError(f"channel {name} has shape {array.shape}, R has {rgb[0].shape}")
        if array.dtype not in allowed:
            raise ValueError(f"channel {name} is {array.dtype}")
        # OpenEXR reads strided arrays as if they were contiguous, and keeps what it is handed.
        channels[name] = np.ascontiguousarray(array)
    return channels


def _attributes(header: ExrHeader) -> dict[str, Any]:
    import OpenEXR

    if header.compression not in _CONSTANTS:
        raise ValueError(f"unknown compression {header.compression!r}")
    attributes: dict[str, Any] = {
        "type": OpenEXR.scanlineimage,
        "compression": getattr(OpenEXR, _CONSTANTS[header.compression]),
        "chromaticities": tuple(float(value) for value in header.chromaticities),
        "whiteLuminance": float(header.white_nits),
        "pixelAspectRatio": float(header.pixel_aspect),
        "itmoTime": _rational(header.time_s),
        "itmoSource": _utf8(header.source_name),
        "itmoSettings": _utf8(header.settings_text),
        "itmoFingerprint": _utf8(header.fingerprint),
    }
    if header.frame_rate > 0:
        attributes["framesPerSecond"] = _rational(header.frame_rate)
    if (timecode := _timecode(header.timecode)) is not None:
        attributes["timeCode"] = timecode
    if header.is_aces_container:
        attributes["acesImageContainerFlag"] = 1
    return attributes


def _rational(value: Fraction) -> Fraction:
    """Bring a fraction into EXR's 32 bits (the nearest): OpenEXR would let it wrap around."""
    if abs(value.numerator) < 2**31 and value.denominator < 2**32:
        return value
    return value.limit_denominator(max(1, int((2**31 - 1) / (abs(value) + 1))))


def _utf8(text: str) -> str:
    return text.encode("utf-8", "backslashreplace").decode("utf-8")


def _timecode(text: str | None) -> Any:
    """Make an OpenEXR.TimeCode, or None where SMPTE 12M's fields cannot hold it (FF above 29)."""
    import OpenEXR

    match = re.fullmatch(r"(\d\d):(\d\d):(\d\d)([:;.])(\d\d)", text or "")
    if match is None:
        return None
    hours, minutes, seconds, separator, frame = match.groups()
    fields = [int(hours), int(minutes), int(seconds), int(frame), int(separator != ":")]
    try:  # the 13 others: colour frame, field phase, three group flags, eight binary groups
        return OpenEXR.TimeCode(*fields, *[0] * 13)
    except RuntimeError:
        return None


# Reading without noise: OpenEXR prints to standard output and error when a file is cut short.


class _DamageError(Exception):
    """Why a file cannot be whole."""


def _read_bytes(path: StrPath) -> bytes:
    try:
        return Path(path).read_bytes()
    except OSError as error:
        raise InputError(
            f"cannot be read: {error.strerror}",
            where=os.fspath(path),
            remedy="Check the name and the right to read it.",
        ) from error


def _parse_header(data: bytes) -> tuple[dict[str, tuple[str, bytes]], int]:
    """Return (type, value) of the first part's attributes by name, and where the header ends."""
    if data[:4] != b"\x76\x2f\x31\x01":
        raise _DamageError("empty" if not data else "no EXR file at all")
    attributes: dict[str, tuple[str, bytes]] = {}
    position = 8
    try:
        while data[position] != 0:
            name_end = data.index(0, position)
            type_end = data.index(0, name_end + 1)
            start = type_end + 5
            (size,) = struct.unpack_from("<i", data, type_end + 1)
            if not 0 <= size <= len(data) - start:
                raise _DamageError("cut short in its header")
            name, kind = data[position:name_end], data[name_end + 1 : type_end]
            attributes[name.decode("latin-1")] = kind.decode("latin-1"), data[start : start + size]
            position = start + size
    except (IndexError, ValueError, struct.error) as error:
        raise _DamageError("cut short in its header") from error
    return attributes, position + 1


def _check_chunks(data: bytes) -> None:
    """Follow the table of chunks through a plain scan line file: each must lie inside of it.

    Finds every file that was cut short or has holes in its table, quietly and without decoding;
    other kinds of EXR file pass unseen.
    """
    attributes, table = _parse_header(data)
    flags = struct.unpack_from("<I", data, 4)[0]
    try:
        method = attributes["compression"][1][0]
        _, top, _, bottom = struct.unpack("<4i", attributes["dataWindow"][1])
    except (KeyError, IndexError, struct.error) as error:
        raise _DamageError("its header is incomplete") from error
    lines = _CHUNK_LINES[method] if method < len(_CHUNK_LINES) else 0
    if flags & ~_PLAIN_FLAGS or not lines:
        return
    count = -(-(bottom - top + 1) // lines)
    first = table + 8 * count
    if count < 1 or first > len(data):
        raise _DamageError("cut short")
    for index, offset in enumerate(struct.unpack_from(f"<{count}Q", data, table)):
        if not first <= offset <= len(data) - 8:
            raise _DamageError(f"cut short at line {index * lines}")
        y, size = struct.unpack_from("<ii", data, offset)
        if y != top + index * lines or not 0 < size <= len(data) - 8 - offset:
            raise _DamageError(f"cut short or damaged at line {index * lines}")


class _Hush:
    """Standard output without what `threads` print to it; all else goes through."""

    def __init__(self, stream: TextIO) -> None:
        self.stream = stream
        self.threads: set[int] = set()

    def write(self, text: str) -> int:
        return len(text) if threading.get_ident() in self.threads else self.stream.write(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)


_hush_lock = threading.Lock()


@contextmanager
def _no_prints() -> Iterator[None]:
    """Keep OpenEXR's "Warning: ..." out of standard output, where results go, in this thread.

    File descriptor 2 is left alone: it belongs to the whole process, and what the library writes
    there about rotten (not merely cut) pixels is a diagnostic in its right place.
    """
    with _hush_lock:
        stdout: Any = sys.stdout
        hush = stdout if isinstance(stdout, _Hush) else _Hush(stdout)
        sys.stdout = cast(TextIO, hush)
        hush.threads.add(threading.get_ident())
    try:
        yield
    finally:
        with _hush_lock:
            hush.threads.discard(threading.get_ident())
            stdout = sys.stdout
            if not hush.threads and stdout is hush:
                sys.stdout = hush.stream


# Temporary files, which folder.sweep_temp_files removes once their owner is dead.


class TempOwner(NamedTuple):
    """The process that a temporary file belongs to; `boot`, `pids` and `start` tell pids apart.

    `boot` is of the machine's run, `pids` the name space that `pid` counts in (containers), `start`
    the process's start in clock ticks after boot; "0" where the system does not tell.
    """

    host: str
    boot: str
    pids: str
    pid: int
    start: str


_serial = itertools.count()


def temp_path(path: StrPath) -> Path:
    """Name a temporary file of this process beside `path`; never the same name twice."""
    owner = "-".join(str(part) for part in this_process(os.getpid()))
    # Not made of `path`'s own name, which may have the file system's full length already.
    return Path(path).parent / f".itmo-{owner}-{next(_serial)}.tmp"


def temp_owner(name: str) -> TempOwner | None:
    """Return whose temporary file `name` is; None when it is not named like one of ours."""
    match = re.fullmatch(r"\.itmo-([\w.]+)-(\w+)-(\d+)-(\d+)-(\d+)-\d+\.tmp", name)
    if match is None:
        return None
    host, boot, pids, pid, start = match.groups()
    return TempOwner(host, boot, pids, int(pid), start)


@functools.lru_cache(maxsize=1)  # by pid, so that a forked child does not take its parent's name
def this_process(pid: int) -> TempOwner:
    """Describe this process, whose number is `pid`."""
    boot = pids = "0"
    with suppress(OSError):
        boot = Path("/proc/sys/kernel/random/boot_id").read_text()[:8]
        pids = re.sub(r"\D", "", os.readlink("/proc/self/ns/pid")) or "0"
    host = re.sub(r"[^\w.]", "_", socket.gethostname(), flags=re.ASCII)[:63] or "_"
    start = (process_stat(pid) or ("", "0"))[1]
    return TempOwner(host, boot, pids, pid, start)


def process_stat(pid: int) -> tuple[str, str] | None:
    """Return the state letter and start time of process `pid`; None where Linux does not tell."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return None
    return fields[0], fields[19]


def write_whole(path: StrPath, data: bytes | memoryview, *, durable: bool = False) -> int:
    """Put `data` at `path` by way of a temporary file and return its size in bytes.

    Whoever looks sees the old file or the whole new one. Raises OutputError when it cannot be
    written; the temporary file is removed whatever goes wrong.
    """
    temp = temp_path(path)
    try:
        with open(temp, "xb") as file:
            file.write(data)
            if durable:
                file.flush()
                os.fsync(file.fileno())
        os.replace(temp, path)
        if durable:
            _sync_folder(temp.parent)
    except OSError as error:
        raise output_error(error, path) from error
    finally:  # after the rename there is nothing left to remove
        with suppress(OSError):
            temp.unlink()
    return len(data)


def _sync_folder(folder: Path) -> None:
    if os.name == "nt":  # folders cannot be opened there
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def output_error(error: OSError, path: StrPath) -> OutputError:
    """Tell a failure to write `path` in the user's words, with the way to go on."""
    again = "then run the same command again: it goes on where it stopped."
    if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
        what, remedy = "no space left to write it", f"Make space, {again}"
    elif error.errno in (errno.EACCES, errno.EPERM, errno.EROFS):
        what, remedy = "no right to write it", f"Change its rights or the folder, {again}"
    elif error.errno in (errno.ENOENT, errno.ENOTDIR):
        what, remedy = "its folder is not there (any more)", f"Bring the folder back, {again}"
    else:
        what, remedy = "it cannot be written", f"Look at the disk, {again}"
    return OutputError(f"{what} ({error.strerror})", where=os.fspath(path), remedy=remedy)
