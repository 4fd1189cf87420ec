"""The settings as controls for the page, generated from their definitions."""

from __future__ import annotations

import dataclasses
from typing import Any

from itmo_video.operators import OPERATORS
from itmo_video.options import flag_of, spec_of
from itmo_video.presets import load_preset, preset_names, read_preset
from itmo_video.settings import LOOK, OF_FILE, Settings
from itmo_video.studio import variants
from itmo_video.studio.document import OF_OPENING

# The group of each setting on the page; a setting not named here appears under "More".
GROUPS: dict[str, tuple[str, ...]] = {
    "Look": ("operator", "peak_nits", "l_max", "white_nits", "strength", "l_white", "alpha",
             "operator_params", "footage", "hue", "lamps"),
    "Expand Map": ("expand_map", "lights", "radius", "min_lights", "soft_lights", "edge_aware",
                   "noise_guard", "map_width"),
    "Over time": ("temporal", "key_interval", "smooth_keys"),
    "Source": ("transfer", "matrix", "range", "over_white", "projection", "force_sdr"),
    "File": OF_FILE,
}  # fmt: skip


def controls() -> list[dict[str, Any]]:
    """One entry per setting: name, flag, help, kind, bounds, choices, default, group."""
    places = {name: group for group, names in GROUPS.items() for name in names}
    order = [name for names in GROUPS.values() for name in names]
    found = []
    for f in dataclasses.fields(Settings):
        if f.name in OF_OPENING:
            continue
        spec = spec_of(f)
        default = f.default
        if default is dataclasses.MISSING:
            default = {}
        choices: tuple[str, ...] = tuple(OPERATORS) if f.name == "operator" else spec.choices
        found.append(
            {
                "name": f.name,
                "flag": f"--{flag_of(f)}",
                "label": f.name.replace("_", " "),
                "help": spec.help,
                "kind": spec.kind.__name__,
                "lower": spec.lower,
                "upper": spec.upper,
                "usual": variants.usual_bounds(f.name, spec),
                "by_ratio": variants.by_ratio(f.name, spec),
                "choices": list(choices),
                "default": list(default) if isinstance(default, tuple) else default,
                "group": places.get(f.name, "More"),
                "of_shots": f.name in LOOK,
            }
        )
    rank = {name: i for i, name in enumerate(order)}
    return sorted(found, key=lambda control: rank.get(control["name"], len(rank)))


def presets() -> list[dict[str, Any]]:
    """The presets by name, with their descriptions and settings."""
    return [
        {
            "name": name,
            "description": str(read_preset(name).get("description", "")),
            "settings": load_preset(name),
        }
        for name in preset_names()
    ]


def operators() -> list[dict[str, Any]]:
    """The operators by name, with their parameters."""
    return [
        {
            "name": operator.name,
            "summary": operator.summary,
            "parameters": [
                {"name": name, "default": p.default, "lower": p.lower, "upper": p.upper,
                 "help": p.help}
                for name, p in operator.parameters.items()
            ],
        }
        for operator in OPERATORS.values()
    ]  # fmt: skip
