"""A frame's fingerprint: a hash of everything its pixels depend on, stored in its header."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any

_UNTOLD_ALGORITHMS = range(1, 7)  # up to 6, manifests did not record the algorithm


def fingerprint_text(
    settings: Mapping[str, Any],
    source_digest: str,
    algorithm: int,
    arithmetic: str | None,
    operator_version: str | None = None,
) -> str:
    """Everything that all frames of one look depend on, as text, equal for equal values.

    `settings` are plain values by name (Settings.as_dict); `arithmetic` is None in folders from
    before it was recorded; `operator_version` distinguishes versions of a user's operator.
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
    """The fingerprints that a frame may have by its folder's manifest, with a shot's changes.

    One, or one per algorithm in folders whose manifest names none. Names added by a later version
    count as settings.
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
