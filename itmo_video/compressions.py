"""EXR's compressions: their names, chunk sizes and typical ratios."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Compression:
    """One compression, by its number in a file's `compression` attribute.

    `openexr` is OpenEXR's constant for it; `chunk_lines` are the lines per chunk, 0 if unknown.
    `share_left` is the compressed share of the half floats' bytes, measured on camera-like clips
    with grain (the more demanding sample clips, rounded up); clean animation takes far less.
    Without it the compression is read only. `is_laid_out_here`: our own writer encodes its chunks.
    """

    number: int
    openexr: str
    chunk_lines: int
    share_left: float | None = None
    is_laid_out_here: bool = False


COMPRESSIONS: dict[str, Compression] = {
    "none": Compression(0, "NO_COMPRESSION", 1, 1.0, is_laid_out_here=True),
    "rle": Compression(1, "RLE_COMPRESSION", 1, 1.0),
    "zips": Compression(2, "ZIPS_COMPRESSION", 1, 0.85, is_laid_out_here=True),
    "zip": Compression(3, "ZIP_COMPRESSION", 16, 0.8, is_laid_out_here=True),
    "piz": Compression(4, "PIZ_COMPRESSION", 32, 0.7),
    "pxr24": Compression(5, "PXR24_COMPRESSION", 16, 0.75),
    "b44": Compression(6, "B44_COMPRESSION", 32, 0.45),
    "b44a": Compression(7, "B44A_COMPRESSION", 32),
    "dwaa": Compression(8, "DWAA_COMPRESSION", 32, 0.25),
    "dwab": Compression(9, "DWAB_COMPRESSION", 256, 0.25),
    "htj2k": Compression(10, "HTJ2K256_COMPRESSION", 256, 0.6),
    "htj2k32": Compression(11, "HTJ2K32_COMPRESSION", 32),
    "lj2k": Compression(12, "LJ2K_COMPRESSION", 0),
    "zstd": Compression(13, "ZSTD_COMPRESSION", 1, 0.8),
}
WRITTEN = tuple(name for name, found in COMPRESSIONS.items() if found.share_left is not None)
"""The names of the compressions that can be written."""

CHUNK_LINES = {found.number: found.chunk_lines for found in COMPRESSIONS.values()}
"""The lines per chunk by a compression's number."""
