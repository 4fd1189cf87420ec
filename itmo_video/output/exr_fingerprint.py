"""What a frame's file states of itself, from its header alone, without reading its pixels."""

from __future__ import annotations

from itmo_video.errors import InputError
from itmo_video.output.exr_chunks import ExrDamageError, parse_header
from itmo_video.regular_file import StrPath, read_head

_HEADER_BYTES = 1 << 18  # ours has a few kilobytes, apart from long comments


def stated_fingerprint(path: StrPath) -> str | None:
    """The fingerprint in the header of a file, which need not be whole; "" if it states none.

    None if there is no such file, or its header cannot be read.
    """
    attributes = _attributes(path)
    if attributes is None:
        return None
    kind, value = attributes.get("itmoFingerprint", ("", b""))
    return value.decode("ascii", "replace") if kind == "string" else ""


def states_damage(path: StrPath) -> bool:
    """Whether a file's header states that its source frame was damaged."""
    kind, value = (_attributes(path) or {}).get("itmoSourceDamaged", ("", b""))
    return kind == "int" and int.from_bytes(value, "little") == 1


def _attributes(path: StrPath) -> dict[str, tuple[str, bytes]] | None:
    try:
        return parse_header(read_head(path, _HEADER_BYTES))[0]
    except (InputError, ExrDamageError):
        return None
