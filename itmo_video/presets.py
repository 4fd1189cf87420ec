"""Presets: named settings in TOML, and combining them with overrides."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

from itmo_video.errors import InputError, UsageError
from itmo_video.options import flag_name, flag_of, spec_of
from itmo_video.settings import LOOK, OF_CLIP, Settings, settings_from
from itmo_video.untrusted import read_toml

_MAXIMA = {"l_max": "peak_nits", "peak_nits": "l_max"}  # the one set last applies
_OF_OPERATOR = ("strength", "l_white", "alpha", "operator_params")


def make_settings(preset: str = "default", **overrides: Any) -> Settings:
    """Settings from a preset (name or TOML file) with overrides, for the API and the CLI.

    An override of l_max or peak_nits replaces the other one in the preset. If the operator is
    overridden, the preset's strength, l_white, alpha and operator_params, which belong to its own
    operator, are ignored. Raises UsageError if both maxima are given, for unknown names and for
    values out of bounds.

    >>> from itmo_video import make_settings
    >>> make_settings("default", peak_nits=812).l_max_effective
    4.0
    """
    return made_of(load_preset(preset), overrides)


def made_of(base: Mapping[str, Any], overrides: Mapping[str, Any]) -> Settings:
    """`make_settings` for a preset that was already read: `base` is from `load_preset`."""
    settings = settings_from(overriding(base, overrides))
    object.__setattr__(settings, "asked", (base, overrides))
    return settings


def overriding(values: Mapping[str, Any], later: Mapping[str, Any]) -> dict[str, Any]:
    """`values` updated with `later`; raises UsageError if that has both maxima.

    A later l_max or peak_nits replaces the other one; another operator drops the settings of the
    former one.
    """
    _require_one_maximum(later)
    held = values
    if "operator" in held and later.get("operator", held["operator"]) != held["operator"]:
        # Settings for its own operator would harm another one.
        held = {name: value for name, value in held.items() if name not in _OF_OPERATOR}
    return without_replaced_maximum(held, later) | dict(later)


def without_replaced_maximum(values: Mapping[str, Any], later: Mapping[str, Any]) -> dict[str, Any]:
    """`values` without the l_max that a later peak_nits replaces, and the other way round."""
    replaced = {_MAXIMA[name] for name in later if name in _MAXIMA}
    return {name: value for name, value in values.items() if name not in replaced}


def as_settings(settings: Settings | str | None) -> Settings:
    """Settings unchanged, or those of a preset by name, `default` for None.

    Raises UsageError for anything else.
    """
    if isinstance(settings, Settings):
        return settings
    if settings is None or isinstance(settings, str):
        return make_settings(settings or "default")
    raise UsageError(
        f"settings must be Settings or a preset's name, not {type(settings).__name__}",
        remedy="Create them: make_settings('default', peak_nits=600).",
    )


def with_own(base: Settings, own: Mapping[str, Any]) -> Settings:
    """`base` with a shot's own look, as if its settings were given as the last flags.

    `own` may name a preset in addition to settings of the look. If `base` came from make_settings,
    that is repeated with it; of other Settings, those that differ from the defaults count as given.
    Raises UsageError like make_settings, and for settings of a whole clip (OF_CLIP).
    """
    if whole := [flag_name(name) for name in own if name in OF_CLIP]:
        raise UsageError(
            f"{', '.join(whole)} applies to the whole clip and cannot be set for a shot"
        )
    _require_one_maximum(own)
    values = {name: value for name, value in own.items() if name != "preset"}
    preset, asked = base.asked or (None, _asked_for(base))
    if "preset" in own:
        preset = load_preset(own["preset"])
    asked = without_replaced_maximum(asked, values)
    together = {**asked, **{name: getattr(base, name) for name in OF_CLIP}, **values}
    return settings_from(together) if preset is None else made_of(preset, together)


def _asked_for(settings: Settings) -> dict[str, Any]:
    plain = Settings()
    names = [f.name for f in dataclasses.fields(settings)]
    return {n: getattr(settings, n) for n in names if getattr(settings, n) != getattr(plain, n)}


def check_own(own: Mapping[str, Any]) -> None:
    """Raise UsageError for settings that no shot can have, checking each value separately."""
    specs = {f.name: f for f in dataclasses.fields(Settings) if f.name in LOOK}
    _require_one_maximum(own)
    for name, value in own.items():
        if name == "preset":
            load_preset(str(value))
        elif name in specs:
            spec_of(specs[name]).check(flag_of(specs[name]), value)
        else:
            raise UsageError(f"{flag_name(name)} cannot be set for a shot")


def preset_folder() -> Path:
    """The folder of the presets: in the installed package, or configs/ in a source checkout."""
    inside = Path(str(resources.files("itmo_video"))) / "configs"
    return inside if inside.is_dir() else Path(__file__).resolve().parent.parent / "configs"


def preset_names() -> Sequence[str]:
    """The presets that come with itmo_video, sorted."""
    return sorted(path.stem for path in preset_folder().glob("*.toml"))


def read_preset(preset: str) -> dict[str, Any]:
    """A preset's TOML: `description` and `settings`; raises UsageError if it does not exist."""
    path = Path(preset) if preset.endswith(".toml") else preset_folder() / f"{preset}.toml"
    if not preset.endswith(".toml") and preset not in preset_names():
        raise UsageError(
            f"unknown preset {preset!r}",
            remedy=f"Known: {', '.join(preset_names())}, or a path ending in .toml",
        )
    try:
        content = read_toml(path)
    except InputError as error:
        raise UsageError(f"preset: {error.what}", where=str(path)) from error
    if unknown := sorted(set(content) - {"description", "settings"}):
        raise UsageError(
            f"unknown entry {', '.join(unknown)}",
            where=str(path),
            remedy="A preset has `description` and a table [settings].",
        )
    return content


def load_preset(preset: str) -> dict[str, Any]:
    """A preset's settings by name (underscores; dashes are accepted)."""
    table = read_preset(preset).get("settings", {})
    if not isinstance(table, dict):
        raise UsageError("[settings] must be a table", where=preset)
    values = {name.replace("-", "_"): value for name, value in table.items()}
    if len(values) < len(table):
        raise UsageError("a setting is given twice, with - and with _", where=preset)
    _require_one_maximum(values, where=preset)
    try:
        settings_from(values)
    except UsageError as error:
        raise UsageError(error.what, where=preset, remedy=error.remedy) from error
    return values


def _require_one_maximum(values: Mapping[str, Any], where: str | None = None) -> None:
    if "l_max" in values and "peak_nits" in values:
        raise UsageError(
            "l-max and peak-nits cannot be combined", where=where, remedy="Give only one of them."
        )
