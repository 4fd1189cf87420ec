"""Kernels at the ends of what they take: counts that make the longest codes, places beyond 32 bits.

tests/sanitize.sh runs them under AddressSanitizer and UndefinedBehaviorSanitizer, too.
"""

from __future__ import annotations

import sys
import zlib
from pathlib import Path

import hypothesis.strategies as st
import numpy as np
import numpy.typing as npt
import pytest
from compiled_kernels import loaded, needs_kernels
from hypothesis import given

from itmo_video.kernels.compiled import pack_literals
from itmo_video.kernels.compiled_light import CodesToLight, ycbcr_rows

pytestmark = needs_kernels
Bytes = npt.NDArray[np.uint8]


def of_counts(counts: list[int]) -> Bytes:
    """So many of each symbol, shuffled; one more where their number is odd."""
    symbols = np.repeat(np.arange(len(counts), dtype=np.uint8), counts)
    np.random.default_rng(3).shuffle(symbols)
    return np.append(symbols, symbols[: symbols.size % 2])


def packed(half: Bytes, other: Bytes) -> tuple[int, int]:
    """The size by the kernel, which must come back, and by zlib's Huffman codes alone."""
    assert loaded is not None
    size = min(half.size, other.size)
    rows = np.concatenate([half[:size], other[:size]])[None]
    (ours,) = pack_literals(loaded, rows)
    assert zlib.decompress(ours) == rows.tobytes()
    packer = zlib.compressobj(1, zlib.DEFLATED, 15, 9, zlib.Z_HUFFMAN_ONLY)
    theirs = packer.compress(rows[0, :size].tobytes()) + packer.flush(zlib.Z_FULL_FLUSH)
    theirs += packer.compress(rows[0, size:].tobytes()) + packer.flush()
    return len(ours), len(theirs)


FIBONACCI = [1, 1, 2, 3, 5, 8, 13, 21, 34, 55, 89, 144, 233, 377, 610, 987, 1597, 2584, 4181, 6765]


@pytest.mark.parametrize(
    "counts",
    [[4096], [1, 4095], [2048, 2048], [16] * 256, [1] * 256, FIBONACCI, FIBONACCI[::-1],
     [10**6, *[1] * 255], [2**n for n in range(18)]],
    ids=["one", "two", "two alike", "all alike", "each once", "fibonacci", "fibonacci back",
         "one of all", "powers"],
)  # fmt: skip
def test_codes_are_as_short_as_zlibs(counts: list[int]) -> None:
    """Lengths are kept to 14 bits, where zlib's go to 15, and two distances are described."""
    half = of_counts(counts)
    ours, theirs = packed(half, half[::-1])
    is_stored = theirs >= 2 * half.size  # zlib gives up coding; who packs chunks does so, too
    assert ours <= 1.001 * theirs + (64 if is_stored else 8)


@given(
    st.lists(st.integers(0, 400), min_size=1, max_size=256),
    st.lists(st.sampled_from([0, 1, 2, 3, 10, 1000]), min_size=1, max_size=256),
)
def test_any_counts_come_back(counts: list[int], others: list[int]) -> None:
    if sum(counts) and sum(others):
        packed(of_counts(counts), of_counts(others))


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="no sparse files here")
def test_rows_beyond_32_bits(tmp_path: Path) -> None:
    """A plane of 4.3 GB, nearly all of it a hole in a file: its last rows are found."""
    assert loaded is not None
    width, height, last = 65536, 65540, 3
    rows = np.random.default_rng(4).integers(16, 236, (last, width)).astype(np.uint8)
    with (tmp_path / "plane").open("wb") as file:
        file.seek((height - last) * width)
        file.write(rows.tobytes())
    plane = np.memmap(tmp_path / "plane", np.uint8, "r", shape=(height, width))
    levels = (16.0, 219.0, 128.0, 112.0)
    to_light = CodesToLight((None, None), levels, (1.5, 1.8, -0.4, -0.2), 2.4)
    found, alone = ([np.empty((last, width), np.float32) for _ in range(3)] for _ in range(2))
    ycbcr_rows(loaded, (plane, plane, plane), slice(height - last, height), to_light, found)
    ycbcr_rows(loaded, (rows, rows, rows), slice(0, last), to_light, alone)
    assert all(np.array_equal(one, other) for one, other in zip(found, alone, strict=True))
    with pytest.raises(ValueError, match="cannot be packed"):
        pack_literals(loaded, plane)
