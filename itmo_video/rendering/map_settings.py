"""Which settings a frame's map depends on; others may change without recomputing it."""

from __future__ import annotations

import dataclasses
import json

from itmo_video.look import Look
from itmo_video.settings import OF_FILE

# These apply after any map. A setting not named here counts as one that the map depends on: then
# maps are recomputed needlessly, but a wrong one is never shown.
AFTER_THE_MAP = frozenset({"strength", "hue", "over_white", "edge_aware", "noise_guard", *OF_FILE})
# The paper's Expand Map does not depend on the curve that it weights.
OF_THE_CURVE = frozenset(
    {"operator", "l_max", "peak_nits", "white_nits", "l_white", "alpha", "operator_params"}
)


def map_settings(look: Look) -> str:
    """A key that is equal for looks with equal maps."""
    left_out = AFTER_THE_MAP | (OF_THE_CURVE if has_paper_map(look) else frozenset())
    values = dataclasses.asdict(look.settings)
    kept = {name: value for name, value in values.items() if name not in left_out}
    return json.dumps(kept, sort_keys=True, default=str)


def shares_maps(one: Look, other: Look) -> bool:
    """Whether both give the same maps for any frames, so that they differ in their use only."""
    return one.needs_map == other.needs_map and map_settings(one) == map_settings(other)


def has_paper_map(look: Look) -> bool:
    """Whether the map is the density of lights (sections 2.2, 2.3), the same for all operators."""
    return look.operator.has_paper_map
