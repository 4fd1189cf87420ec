"""A cache of large files' digests: one small file for each, in the user's cache folder.

Missing, outdated or foreign entries are ignored, and no error is ever raised.
"""

from __future__ import annotations

import json
import os
import tempfile
from contextlib import suppress
from pathlib import Path

import xxhash

from itmo_video.errors import InputError
from itmo_video.regular_file import read_regular
from itmo_video.untrusted import parse_json

_MOST_BYTES = 1 << 16


def digest(path: Path, found: os.stat_result) -> str | None:
    """The cached digest of `path`, if it is of the file that `found` describes."""
    try:
        entry = parse_json(read_regular(_place(path), _MOST_BYTES).decode())
    except (InputError, ValueError):
        return None
    known = entry.get("digest") if isinstance(entry, dict) else None
    is_ours = isinstance(known, str) and len(known) == 32 and known.isalnum()
    return known if is_ours and entry == {**_facts(path, found), "digest": known} else None


def remember(path: Path, found: os.stat_result, known: str) -> None:
    """Store a digest for later runs, if the cache can be written."""
    place = _place(path)
    with suppress(OSError):
        place.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile("w", dir=place.parent, delete=False) as file:
            json.dump({**_facts(path, found), "digest": known}, file)
        os.replace(file.name, place)


def _facts(path: Path, found: os.stat_result) -> dict[str, object]:
    # ctime cannot be set back, unlike mtime.
    return {
        "path": os.fspath(path).encode(errors="surrogateescape").hex(),
        "device": found.st_dev,
        "inode": found.st_ino,
        "size": found.st_size,
        "written_ns": found.st_mtime_ns,
        "changed_ns": found.st_ctime_ns,
    }


def _place(path: Path) -> Path:
    home = os.environ.get("LOCALAPPDATA") if os.name == "nt" else os.environ.get("XDG_CACHE_HOME")
    cache = Path(home) if home else Path(os.path.expanduser("~")) / ".cache"
    name = xxhash.xxh3_128_hexdigest(os.fspath(path).encode(errors="surrogateescape"))
    return cache / "itmo-video" / "digests" / f"{name}.json"
