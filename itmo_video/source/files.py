"""What a file says of itself before its frames are read: container, packets, tags, content.

Nothing but local files in known containers is opened, and no picture larger than the limit.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Sequence
from pathlib import Path

from itmo_video.errors import InputError
from itmo_video.regular_file import open_regular

_DIGEST_BLOCK, _DIGEST_WHOLE, _DIGEST_BLOCKS = 1 << 20, 64 << 20, 64


# ---- files ----


def check_file(path: Path) -> None:
    """Raise InputError unless there is a readable, regular file with something in it."""
    if path.is_dir():
        raise InputError(
            "is a folder, not a clip",
            where=str(path),
            remedy="For an image sequence give its pattern, such as folder/img.%04d.png.",
        )
    with open_regular(path) as file:
        if os.fstat(file.fileno()).st_size == 0:
            raise InputError("the file is empty", where=str(path))


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


def check_pixels(width: int, height: int, max_pixels: int, where: str) -> None:
    """Raise InputError for pictures that are larger than the limit."""
    if width * height > max_pixels:
        raise InputError(
            f"{width}x{height} is more than {max_pixels} pixels a frame",
            where=where,
            remedy="Raise --max-pixels if that is meant.",
        )
