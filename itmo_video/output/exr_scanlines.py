"""The chunks of a scan line EXR file from planes, quicker than by OpenEXR's own writer.

Uncompressed lines need no library. ZIP and ZIPS blocks are zlib streams, which any reader opens:
where a picture has grain its bytes do not repeat, and Huffman's code alone (deflate.c) makes them
smaller than libdeflate's lowest level does, in a quarter of the time. Where they do repeat, in
drawings and grey pictures, it is libdeflate; a few lines in each group tell which. Pixels are the
same to the bit. (ISA-L is quick as well, but now and then packs the same bytes in another way.)
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

_LEVEL = 1  # of libdeflate's 1 to 12; OpenEXR's own is 4
_GROUP_LINES = 48  # lines laid out at a time: at 1080p they stay in the second-level cache


def scanline_file(header: bytes, planes: Planes, compression: str) -> Iterator[bytes | memoryview]:
    """The whole file in parts, each to be written before the next is asked for.

    `header` is all in front of the table of chunks, with a data window that begins at line 0;
    `planes` are its channels, contiguous float16 or float32 of one shape (height, width).
    `compression` is one of those that are laid out here.
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

    The array is the same each time, filled anew.
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
    """Line number and size in bytes of chunks of one line: (count, 8)."""
    heads = np.empty((count, 2), "<i4")
    heads[:, 0] = np.arange(top, top + count)
    heads[:, 1] = size
    return heads.view(np.uint8)


def _zip_chunks(planes: list[npt.NDArray[Any]], lines: int) -> Iterator[bytes]:
    scratch = Predictor()
    for top, group in _line_groups(planes, 0):
        pack = _packer(group, lines)
        whole = len(group) // lines * lines
        # The last block of the picture may be a short one.
        parts = [(0, group[:whole].reshape(-1, lines * group.shape[1]))] if whole else []
        if whole < len(group):
            parts.append((whole, group[whole:].reshape(1, -1)))
        for start, blocks in parts:
            packed = pack(scratch.predict(blocks))
            for i, (block, data) in enumerate(zip(blocks, packed, strict=True)):
                if len(data) >= block.size:  # a reader takes a block of full size as it is
                    data = block.tobytes()
                yield struct.pack("<ii", top + start + i * lines, len(data)) + data


def _lesser_packer(
    loaded: ctypes.CDLL, group: Bytes2D, lines: int
) -> Callable[[Bytes2D], list[bytes]]:
    """Whatever makes the less of a line or two in the group's middle, as a block of their own."""
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
    """EXR's rearrangement ahead of deflate, in buffers that are used again."""

    def __init__(self) -> None:
        self._halves = self._differences = np.empty((0, 0), np.uint8)

    def predict(self, blocks: Bytes2D) -> Bytes2D:
        """Each row's even bytes, then its odd ones; of those the differences, plus 128.

        (blocks, bytes) in and out, an even number of bytes; the result is filled anew each time.
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
