"""Which settings a frame's map depends on: what may change without the map being made again."""

from __future__ import annotations

import dataclasses
import json

from itmo_video.look import Look

# These come after the map, whoever makes it. A setting that is not named here counts as one that
# the map depends on: too many maps are made then, never a wrong one shown.
AFTER_THE_MAP = frozenset(
    {"strength", "hue", "over_white", "edge_aware", "noise_guard", "primaries", "compression",
     "layers", "owner", "comments", "timecode"}
)  # fmt: skip
# The paper's Expand Map knows nothing of the curve that it weighs.
OF_THE_CURVE = frozenset(
    {"operator", "l_max", "peak_nits", "white_nits", "l_white", "alpha", "operator_params"}
)


def map_settings(look: Look) -> str:
    """Equal for looks whose maps are equal."""
    left_out = AFTER_THE_MAP | (OF_THE_CURVE if has_paper_map(look) else frozenset())
    values = dataclasses.asdict(look.settings)
    kept = {name: value for name, value in values.items() if name not in left_out}
    return json.dumps(kept, sort_keys=True, default=str)


def shares_maps(one: Look, other: Look) -> bool:
    """Whether both would make the same maps of any frames, so that they differ in their use."""
    return one.needs_map == other.needs_map and map_settings(one) == map_settings(other)


def has_paper_map(look: Look) -> bool:
    """Whether the map is sections 2.2 and 2.3's density of lights, the same for all operators."""
    return look.operator.has_paper_map
