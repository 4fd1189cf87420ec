"""A frame's fingerprint: a hash of all that its pixels depend on, kept in its file's header."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any

_UNTOLD_ALGORITHMS = range(1, 7)  # until 6 manifests did not say which


def fingerprint_text(
    settings: Mapping[str, Any],
    source_digest: str,
    algorithm: int,
    arithmetic: str | None,
    operator_version: str | None = None,
) -> str:
    """What all frames of one look depend on, as text, equal for equal values.

    `settings` are plain values by name (Settings.as_dict); `arithmetic` is None in folders of
    before it was recorded; `operator_version` tells versions of a user's operator apart.
    """
    common: dict[str, Any] = {"source": source_digest, "algorithm": algorithm}
    if arithmetic is not None:
        common["arithmetic"] = arithmetic
    if operator_version:
        common["operator_version"] = operator_version
    return json.dumps({**settings, **common}, sort_keys=True)


def fingerprint(text: str, index: int) -> str:
    """The fingerprint of the frame at `index` of a look's `fingerprint_text`, 32 hex digits."""
    return hashlib.blake2b(f"{text}{index}".encode(), digest_size=16).hexdigest()


def fingerprints_told(
    told: Mapping[str, Any], changed: Mapping[str, Any], source_digest: str, index: int
) -> list[str]:
    """What a frame's may be by its folder's manifest: its settings, and what a shot `changed`.

    One; or one for each algorithm, in folders whose manifest names none. Names that a later version
    may have added count as settings.
    """
    values = {**told, **changed}
    for name in ("first_number", "shots"):
        values.pop(name, None)
    arithmetic, algorithm = values.pop("arithmetic", None), values.pop("algorithm", None)
    versions = values.pop("operator_versions", None)
    version = versions.get(values.get("operator")) if isinstance(versions, dict) else None
    algorithms = _UNTOLD_ALGORITHMS if algorithm is None else (algorithm,)
    texts = (
        fingerprint_text(values, source_digest, one, arithmetic, version) for one in algorithms
    )
    return [fingerprint(text, index) for text in texts]
