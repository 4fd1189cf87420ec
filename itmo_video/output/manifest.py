"""The manifest of an output folder: its source and settings."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from itmo_video.errors import InputError
from itmo_video.regular_file import StrPath
from itmo_video.untrusted import parse_json, read_text

MANIFEST_NAME = "itmo-video.json"
MANIFEST_FORMAT = 2


@dataclass(frozen=True)
class Manifest:
    """A folder's source by name and content, the frames' stem, and the effective settings.

    `settings` contains what the pixels depend on, as JSON values, and nothing about a run (ranges,
    jobs, paths, times), so that all processes of a conversion write the same manifest.
    `source_frames` is the source's frame count, None if unknown (a pipe, an older version).
    """

    source_name: str
    source_digest: str
    stem: str
    settings: dict[str, object]
    source_frames: int | None = None
    format: int = MANIFEST_FORMAT

    def to_json(self) -> str:
        """The manifest as JSON text, equal for equal manifests; other values raise TypeError."""
        # Undecodable bytes of file names stay escaped, as only ASCII can always be written.
        return json.dumps(asdict(self), indent=1, sort_keys=True, allow_nan=False) + "\n"

    @classmethod
    def from_json(cls, text: str, *, where: str = MANIFEST_NAME) -> Manifest:
        """Parse JSON text; raises InputError, naming `where`, unless it is a valid manifest."""
        try:
            data = parse_json(text)
        except ValueError as error:
            raise _bad_manifest(f"it is not JSON: {error}", where) from error
        if not isinstance(data, dict) or type(data.get("format")) is not int:
            raise _bad_manifest("it has no format number", where)
        if data["format"] != MANIFEST_FORMAT:
            raise _bad_manifest(f"its format is {data['format']}, not {MANIFEST_FORMAT}", where)
        kinds: dict[str, Any] = {field.name: str for field in fields(cls)}
        kinds |= {"format": int, "settings": dict, "source_frames": int | None}
        for name, kind in kinds.items():
            if not isinstance(data.get(name), kind):
                raise _bad_manifest(f"{name!r} is missing or of the wrong type", where)
        count = data.get("source_frames")
        if isinstance(count, bool) or (count is not None and count < 0):
            raise _bad_manifest("'source_frames' is not a count", where)
        values: dict[str, Any] = {name: data.get(name) for name in kinds}
        return cls(**values)


def read_manifest(folder: StrPath) -> Manifest | None:
    """Read the manifest of `folder`; None if it has none, InputError if it is invalid."""
    path = Path(folder) / MANIFEST_NAME
    try:
        text = read_text(path)
    except InputError as error:
        if not isinstance(error.__cause__, FileNotFoundError | NotADirectoryError):
            raise _bad_manifest(error.what, str(path)) from error
        if path.is_symlink():  # a broken link is neither a manifest nor a free name
            raise _bad_manifest("it is a broken link", str(path)) from error
        return None
    return Manifest.from_json(text, where=str(path))


def _bad_manifest(why: str, where: str) -> InputError:
    return InputError(f"invalid manifest: {why}", where=where, remedy="Convert the clip again.")
