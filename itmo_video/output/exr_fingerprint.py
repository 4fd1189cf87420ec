"""A frame's fingerprint from its header alone, without reading its pixels."""

from __future__ import annotations

from itmo_video.errors import InputError
from itmo_video.output.exr_chunks import ExrDamageError, parse_header
from itmo_video.regular_file import StrPath, read_head

_HEADER_BYTES = 1 << 18  # ours has a few kilobytes, apart from long comments


def stated_fingerprint(path: StrPath) -> str | None:
    """The fingerprint in the header of a file, which need not be whole; "" if it states none.

    None if there is no such file, or its header cannot be read.
    """
    try:
        attributes, _ = parse_header(read_head(path, _HEADER_BYTES))
    except (InputError, ExrDamageError):
        return None
    kind, value = attributes.get("itmoFingerprint", ("", b""))
    return value.decode("ascii", "replace") if kind == "string" else ""
