"""Folders that must be the same to the byte: where they are not, what differs, and the files."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from itmo_video.output.exr import read_exr


def assert_same_bytes(folder: Path, expected: Mapping[str, bytes], what: str) -> None:
    """Fail unless `folder` holds the `expected` files; keep both sides of what differs.

    A law that is broken once in a thousand runs must leave something to look at: the files go to
    a new folder under `ITMO_VIDEO_KEEP` (else the system's temporary folder), `*.expected` beside
    `*.found`.
    """
    found = {path.name: path.read_bytes() for path in sorted(folder.iterdir())}
    names = sorted(n for n in {*found, *expected} if found.get(n) != expected.get(n))
    if not names:
        return
    kept = Path(tempfile.mkdtemp(prefix="itmo-differing-", dir=os.environ.get("ITMO_VIDEO_KEEP")))
    told = []
    for name in names:
        for side, files in (("found", found), ("expected", expected)):
            if name in files:
                (kept / f"{name}.{side}").write_bytes(files[name])
        if name in found:
            shutil.copystat(folder / name, kept / f"{name}.found")
        told.append(f"{name}: {_difference(kept, name, found, expected)}")
    raise AssertionError(f"{what}; kept in {kept}:\n" + "\n".join(told))


def _difference(
    kept: Path, name: str, found: Mapping[str, bytes], expected: Mapping[str, bytes]
) -> str:
    if name not in found or name not in expected:
        return "missing" if name not in found else "should not be there"
    if not name.endswith(".exr"):
        return "other bytes"
    sides = [read_exr(kept / f"{name}.{side}") for side in ("found", "expected")]
    (pixels, header), (pixels_before, header_before) = ((s.channels, s.attributes) for s in sides)
    parts = [
        f"{key} {header_before.get(key)} -> {header.get(key)}"
        for key in sorted({*header, *header_before})
        if str(header.get(key)) != str(header_before.get(key))
    ]
    for channel in sorted({*pixels, *pixels_before}):
        one, two = pixels.get(channel), pixels_before.get(channel)
        if one is None or two is None or one.shape != two.shape:
            parts.append(f"channel {channel} is another")
        elif count := int(np.count_nonzero(one != two)):
            y, x = np.argwhere(one != two)[0]
            largest = float(np.abs(one.astype(np.float32) - two.astype(np.float32)).max())
            parts.append(f"{count} of {channel} from line {y}, column {x} on, by up to {largest:g}")
    return "; ".join(parts) or "the same pixels and header, packed in another way"
