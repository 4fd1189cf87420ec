"""Variants to choose from: all presets, or one setting at several values."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from itmo_video.errors import UsageError
from itmo_video.operators import OPERATORS
from itmo_video.options import Spec, flag_name, spec_of
from itmo_video.presets import preset_names, read_preset
from itmo_video.settings import OF_FILE, Settings
from itmo_video.studio.document import OF_OPENING

COUNT = 6
PRESETS = "presets"
# The useful range where a setting's bounds are much wider: ends of sliders and of variants.
USUAL: dict[str, tuple[float, float]] = {
    "peak_nits": (400, 4000), "l_max": (1.5, 20), "white_nits": (100, 400), "l_white": (0.5, 20),
    "alpha": (0.05, 2), "radius": (4, 64), "min_lights": (0, 16), "map_width": (128, 1024),
    "lights": (64, 4096), "key_interval": (1, 24),
}  # fmt: skip
_OF_READING = (*OF_OPENING, "force_sdr")


@dataclass(frozen=True)
class Variant:
    """A look to try: a preset, or values on top of the current settings.

    `is_current` says that it is the current setting, as its label does.
    """

    label: str
    says: str = ""
    preset: str | None = None
    values: Mapping[str, Any] = field(default_factory=dict)
    is_current: bool = False


def varied() -> list[str]:
    """What can be varied: "presets", or any setting of the look that is a number or a choice."""
    names = [
        f.name
        for f in dataclasses.fields(Settings)
        if f.name not in (*OF_FILE, *_OF_READING)
        and (spec_of(f).kind in (int, float, bool) or _choices(f.name, spec_of(f)))
    ]
    return [PRESETS, *names]


def variants(by: str, texts: Sequence[str] = (), current: Settings | None = None) -> list[Variant]:
    """All presets, or the setting `by` at the values in `texts`, or at some typical ones.

    Typical ones include that of `current`, in place of the nearest. Raises UsageError unless `by`
    is a setting of the look and `texts` are values of it.
    """
    if by == PRESETS:
        return [
            Variant(name, str(read_preset(name).get("description", "")), preset=name)
            for name in (texts or preset_names())
        ]
    name = by.replace("-", "_")
    if name not in varied():
        known = ", ".join(flag_name(known) for known in varied())
        raise UsageError(f"{by} cannot be varied", remedy=f"Choose one of: {known}")
    (f,) = (f for f in dataclasses.fields(Settings) if f.name == name)
    spec = spec_of(f)
    now = getattr(current, name) if current is not None else None
    values = [_read(name, spec, text) for text in texts] or _with(now, _usual(name, spec))
    flag = flag_name(name)
    return [
        Variant(f"{flag} {_said(value)}", spec.help, values={name: value})
        if value != now
        else Variant(f"{flag} {_said(value)} (current)", spec.help, None, {name: value}, True)
        for value in values
    ]


def usual_bounds(name: str, spec: Spec) -> tuple[float, float]:
    """The ends of a slider: the useful range, or the setting's bounds."""
    low, high = spec.lower or 0.0, spec.upper if spec.upper is not None else 1.0
    return USUAL.get(name, (low, high))


def by_ratio(name: str, spec: Spec) -> bool:
    """Whether its slider is logarithmic, because its ends are far apart."""
    low, high = usual_bounds(name, spec)
    return low > 0 and high / low >= 4


def _usual(name: str, spec: Spec) -> list[Any]:
    if spec.kind is bool:
        return [False, True]
    if choices := _choices(name, spec):
        return list(choices)
    low, high = usual_bounds(name, spec)
    if name == "lights":  # powers of two
        return [64, 256, 512, 1024, 2048, 4096]
    parts = [i / (COUNT - 1) for i in range(COUNT)]
    found = [
        low * (high / low) ** part if by_ratio(name, spec) else low + part * (high - low)
        for part in parts
    ]
    return [round(value) if spec.kind is int else float(f"{value:.2g}") for value in found]


def _with(now: Any, values: list[Any]) -> list[Any]:
    """Typical values, of which the nearest gives way to the current one."""
    if not isinstance(now, int | float) or now in values:
        return values
    nearest = min(values, key=lambda value: abs(value - now))
    return sorted([now, *(value for value in values if value != nearest)])


def _choices(name: str, spec: Spec) -> tuple[str, ...]:
    return tuple(OPERATORS) if name == "operator" else spec.choices


def _read(name: str, spec: Spec, text: str) -> Any:
    if spec.kind is bool:
        if text not in ("on", "off"):
            raise UsageError(f"{flag_name(name)} is on or off, not {text!r}")
        return text == "on"
    if spec.kind not in (int, float):
        return text
    try:
        return spec.kind(text)
    except ValueError:
        raise UsageError(f"{flag_name(name)}: {text!r} is not a number") from None


def _said(value: Any) -> str:
    if isinstance(value, bool):
        return "on" if value else "off"
    return f"{value:g}" if isinstance(value, float) else str(value)
