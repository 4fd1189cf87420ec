"""Encoding planes to the chunks of a scan line EXR file, faster than OpenEXR's own writer.

Uncompressed lines need no library. ZIP and ZIPS blocks are zlib streams, which any reader can
open: pictures with grain have no repeating bytes, and Huffman coding alone (deflate.c) compresses
them better than libdeflate's lowest level, in a quarter of the time. Pictures that do repeat, such
as drawings and grey pictures, use libdeflate; a few lines of each group decide. Pixels are
identical to the bit. (ISA-L is fast, too, but its output is not always the same.)
"""

from __future__ import annotations

import ctypes
import functools
import struct
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from itmo_video.compressions import COMPRESSIONS
from itmo_video.kernels import compiled
from itmo_video.kernels.dispatch import with_compiled_form

Planes = Mapping[str, npt.NDArray[Any]]
Bytes2D = npt.NDArray[np.uint8]

_LEVEL = 1  # of libdeflate's 1 to 12; OpenEXR uses 4
_GROUP_LINES = 48  # lines laid out at a time; at 1080p they fit into the L2 cache


def scanline_file(header: bytes, planes: Planes, compression: str) -> Iterator[bytes | memoryview]:
    """The whole file in parts, each to be written before the next is requested.

    `header` is everything before the chunk table, with a data window that starts at line 0;
    `planes` are its channels, contiguous float16 or float32 of one shape (height, width).
    `compression` is one of those supported here.
    """
    # The order of OpenEXR's channel list, which compares names as bytes.
    ordered = [planes[name] for name in sorted(planes, key=lambda name: name.encode())]
    height = ordered[0].shape[0]
    lines = COMPRESSIONS[compression].chunk_lines
    first = len(header) + 8 * -(-height // lines)
    if compression == "none":
        size = 8 + sum(plane.shape[1] * plane.itemsize for plane in ordered)
        yield header + np.arange(first, first + height * size, size, dtype="<u8").tobytes()
        for top, group in _line_groups(ordered, 8):
            group[:, :8] = _chunk_heads(top, len(group), size - 8)
            yield group.reshape(-1).data
        return
    chunks = list(_zip_chunks(ordered, lines))
    offsets = np.cumsum([first, *(len(chunk) for chunk in chunks[:-1])], dtype="<u8")
    yield header + offsets.tobytes()
    yield b"".join(chunks)


def _line_groups(planes: list[npt.NDArray[Any]], room: int) -> Iterator[tuple[int, Bytes2D]]:
    """Lines as stored, `room` bytes and then each channel's: (first line, (lines, bytes)).

    The same array is reused each time.
    """
    height = planes[0].shape[0]
    little = [plane.astype(plane.dtype.newbyteorder("<"), copy=False) for plane in planes]
    columns = [plane.view(np.uint8) for plane in little]
    group = np.empty((min(_GROUP_LINES, height), room + sum(c.shape[1] for c in columns)), np.uint8)
    for top in range(0, height, _GROUP_LINES):
        part = group[: min(_GROUP_LINES, height - top)]
        start = room
        for column in columns:
            part[:, start : start + column.shape[1]] = column[top : top + len(part)]
            start += column.shape[1]
        yield top, part


def _chunk_heads(top: int, count: int, size: int) -> Bytes2D:
    """The headers, line number and size, of one-line chunks: (count, 8)."""
    heads = np.empty((count, 2), "<i4")
    heads[:, 0] = np.arange(top, top + count)
    heads[:, 1] = size
    return heads.view(np.uint8)


def _zip_chunks(planes: list[npt.NDArray[Any]], lines: int) -> Iterator[bytes]:
    scratch = Predictor()
    for top, group in _line_groups(planes, 0):
        pack = _packer(group, lines)
        whole = len(group) // lines * lines
        # The last block of the picture may be shorter.
        parts = [(0, group[:whole].reshape(-1, lines * group.shape[1]))] if whole else []
        if whole < len(group):
            parts.append((whole, group[whole:].reshape(1, -1)))
        for start, blocks in parts:
            packed = pack(scratch.predict(blocks))
            for i, (block, data) in enumerate(zip(blocks, packed, strict=True)):
                if len(data) >= block.size:  # readers take a block of full size as raw
                    data = block.tobytes()
                yield struct.pack("<ii", top + start + i * lines, len(data)) + data


def _lesser_packer(
    loaded: ctypes.CDLL, group: Bytes2D, lines: int
) -> Callable[[Bytes2D], list[bytes]]:
    """The compressor that does better on a line or two from the middle of the group."""
    middle = len(group) // 2
    sample = Predictor().predict(group[middle : middle + min(lines, 2)].reshape(1, -1))
    by_code = compiled.pack_literals(loaded, sample)
    if len(_deflated(sample)[0]) < len(by_code[0]):
        return _deflated
    return functools.partial(compiled.pack_literals, loaded)


@with_compiled_form(_lesser_packer)
def _packer(group: Bytes2D, lines: int) -> Callable[[Bytes2D], list[bytes]]:
    return _deflated


def _deflated(blocks: Bytes2D) -> list[bytes]:
    import deflate

    return [bytes(deflate.zlib_compress(block, _LEVEL)) for block in blocks]


class Predictor:
    """EXR's byte reordering before deflate, in reused buffers."""

    def __init__(self) -> None:
        self._halves = self._differences = np.empty((0, 0), np.uint8)

    def predict(self, blocks: Bytes2D) -> Bytes2D:
        """Each row's even bytes, then its odd ones, as differences plus 128.

        (blocks, bytes) in and out, an even number of bytes; the result is reused each time.
        """
        count, size = blocks.shape
        if self._halves.shape[0] < count or self._halves.shape[1] != size:
            self._halves, self._differences = np.empty_like(blocks), np.empty_like(blocks)
        halves, differences = self._halves[:count], self._differences[:count]
        pairs = blocks.view("<u2")
        np.copyto(halves[:, : size // 2], pairs, casting="unsafe")
        np.copyto(halves[:, size // 2 :], pairs >> 8, casting="unsafe")
        differences[:, 0] = halves[:, 0]
        np.subtract(halves[:, 1:], halves[:, :-1], out=differences[:, 1:])
        differences[:, 1:] ^= 128  # plus 128, as bytes wrap around
        return differences
