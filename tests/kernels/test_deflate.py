"""The compiled deflate encoder: zlib gives back what it packs, and its files are small."""

from __future__ import annotations

import zlib
from pathlib import Path

import hypothesis.strategies as st
import numpy as np
import numpy.typing as npt
import pytest
from compiled_kernels import loaded, needs_kernels
from exr_pictures import header
from hypothesis import example, given

from itmo_video.kernels import library
from itmo_video.kernels.compiled import pack_literals
from itmo_video.model import Half
from itmo_video.output import exr


def fibonacci_bytes(symbols: int) -> npt.NDArray[np.uint8]:
    """Bytes whose Huffman codes are as long as there are symbols: the worst for a limit."""
    counts = [1, 1]
    while len(counts) < symbols:
        counts.append(counts[-1] + counts[-2])
    half = np.repeat(np.arange(symbols, dtype=np.uint8), counts)
    return np.concatenate([half, half[::-1]])[None]


@needs_kernels
@given(
    st.integers(0, 2**32 - 1),
    st.integers(1, 5),
    st.integers(1, 700),
    st.sampled_from([0.0, 0.3, 2, 9, 40, 1000]),
)
@example(0, 1, 1, 0.0)
def test_packed_rows_come_back(seed: int, count: int, half: int, spread: float) -> None:
    rows = np.random.default_rng(seed).normal(128, spread, (count, 2 * half)).astype(np.uint8)
    packed = pack_literals(loaded, rows)
    assert [zlib.decompress(data) for data in packed] == [row.tobytes() for row in rows]


@needs_kernels
@pytest.mark.parametrize("symbols", [2, 13, 14, 15, 16, 20, 27])
def test_long_codes_are_cut_to_what_fits(symbols: int) -> None:
    rows = fibonacci_bytes(symbols)
    (data,) = pack_literals(loaded, rows)
    assert zlib.decompress(data) == rows.tobytes()


@needs_kernels
def test_every_byte_value() -> None:
    rows = np.tile(np.arange(256, dtype=np.uint8), (3, 4))
    packed = pack_literals(loaded, rows)
    assert [zlib.decompress(data) for data in packed] == [row.tobytes() for row in rows]


@needs_kernels
@pytest.mark.parametrize("spread", [0.3, 3, 30])
def test_as_small_as_zlibs_huffman_codes(spread: float) -> None:
    """zlib with its matches off, one block of each half, is the oracle for codes and headers."""
    rng = np.random.default_rng(5)
    halves = [rng.normal(128, spread, 16000), rng.normal(60, spread / 3, 16000)]
    rows = np.concatenate(halves).astype(np.uint8)[None]
    packer = zlib.compressobj(1, zlib.DEFLATED, 15, 9, zlib.Z_HUFFMAN_ONLY)
    theirs = b""
    for half in np.split(rows[0], 2):
        theirs += packer.compress(half.tobytes()) + packer.flush(zlib.Z_SYNC_FLUSH)
    theirs += packer.flush()
    (ours,) = pack_literals(loaded, rows)
    assert len(theirs) - 20 <= len(ours) <= len(theirs)  # the flushes are some bytes


@needs_kernels
@pytest.mark.parametrize("rows", [np.zeros((2, 3), np.uint8), np.zeros((2, 0), np.uint8)])
def test_odd_rows_are_refused(rows: npt.NDArray[np.uint8]) -> None:
    with pytest.raises(ValueError, match="cannot be packed"):
        pack_literals(loaded, rows)


def grain(height: int, width: int, channels: int) -> tuple[Half, Half, Half]:
    """Return R, G, B with grain; from one channel, a grey picture's three equal planes."""
    light = 0.5 + 0.05 * np.random.default_rng(6).standard_normal((channels, height, width))
    red, green, blue = np.resize(light, (3, height, width)).astype(np.float16)
    return red, green, blue


def sizes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rgb: tuple[Half, Half, Half], compression: str
) -> tuple[int, int]:
    """Return the bytes of a picture's file with the compiled loops and without; same pixels."""
    head = header(compression=compression)
    with_loops = exr.write_exr(tmp_path / "a.exr", rgb, head)
    monkeypatch.setattr(library, "library", lambda: None)
    without = exr.write_exr(tmp_path / "b.exr", rgb, head)
    for name in ("a.exr", "b.exr"):
        channels = exr.read_exr(Path(tmp_path / name)).channels
        for plane, letter in zip(rgb, "RGB", strict=True):
            assert np.array_equal(channels[letter], plane), (name, letter)
    return with_loops, without


@needs_kernels
@pytest.mark.parametrize("compression", ["zips", "zip"])
def test_grain_is_packed_smaller_than_by_matches(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, compression: str
) -> None:
    ours, theirs = sizes(tmp_path, monkeypatch, grain(150, 640, 3), compression)
    assert ours < 0.99 * theirs


@needs_kernels
@pytest.mark.parametrize("compression", ["zips", "zip"])
def test_what_repeats_is_left_to_matches(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, compression: str
) -> None:
    ours, theirs = sizes(tmp_path, monkeypatch, grain(150, 640, 1), compression)
    assert ours == theirs
