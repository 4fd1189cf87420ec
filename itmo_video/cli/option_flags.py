"""Flags generated from the options' definitions, and options parsed from flags."""

from __future__ import annotations

import argparse
import dataclasses
import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from itmo_video.errors import UsageError
from itmo_video.options import Spec, flag_of, options_from, spec_of

T = TypeVar("T")
_SWITCHES = {True: "on", False: "off"}


def add_options(
    group: Any,
    kind: type[Any],
    only: Iterable[str] | None = None,
    defaults: Mapping[str, Any] | None = None,
    *,
    negatable: bool = False,
) -> None:
    """Add flags for the options of the dataclass `kind`, or only those in `only`, to a group.

    `defaults` override the fields' defaults in the help; `negatable` adds --no- to switches that
    can also be set elsewhere.
    """
    wanted = None if only is None else set(only)
    for f in dataclasses.fields(kind):
        if wanted is not None and f.name not in wanted:
            continue
        spec = spec_of(f)
        default = f.default if defaults is None else defaults[f.name]
        names = [f"--{name}" for name in (flag_of(f), *spec.aliases)]
        common: dict[str, Any] = {"dest": _dest(kind, f.name), "default": None}
        common["help"] = _help(spec, default, negatable).replace("%", "%%")
        if spec.kind is bool:
            switch = argparse.BooleanOptionalAction if negatable else "store_true"
            group.add_argument(*names, action=switch, **common)
            continue
        group.add_argument(
            *names,
            type=_reader(spec),
            action="append" if spec.kind is dict else "store",
            choices=spec.choices or None,
            metavar=spec.metavar or (None if spec.choices else flag_of(f).upper()),
            **common,
        )


def given(args: argparse.Namespace, kind: type[Any]) -> dict[str, Any]:
    """The values of the options of `kind` given by flags, by field name."""
    values: dict[str, Any] = {}
    for f in dataclasses.fields(kind):
        value, spec = getattr(args, _dest(kind, f.name), None), spec_of(f)
        if value is None:
            continue
        if spec.kind is dict:
            value = dict(named_number(flag_of(f), text) for text in value)
        elif spec.kind is tuple:
            value = tuple(part for part in value.split(",") if part)
        elif spec.read is not None:
            value = spec.read(value)
        values[f.name] = value
    return values


def options_of(args: argparse.Namespace, kind: type[T]) -> T:
    """The options of `kind` from the flags; raises UsageError for invalid ones."""
    return options_from(kind, given(args, kind))


def named_number(flag: str, text: str) -> tuple[str, float]:
    """The name and value of NAME=VALUE given to `flag`; raises UsageError for anything else."""
    name, _, value = text.partition("=")
    try:
        number = float(value)
        if not math.isfinite(number):  # a check against NaN would always pass
            raise ValueError
        return name, number
    except ValueError:
        raise UsageError(f"{flag}: {text!r} is not NAME=VALUE with a number") from None


def _dest(kind: type[Any], name: str) -> str:
    return f"{kind.__name__}.{name}"


def _help(spec: Spec, default: Any, negatable: bool) -> str:
    text = spec.help
    if spec.bounds_in_words and not spec.words:
        text += f"; {spec.bounds_in_words}"
    if isinstance(default, bool):
        return f"{text} ({_SWITCHES[default]})" if negatable else text
    if isinstance(default, int | float):
        return f"{text} ({default:.10g})"
    return f"{text} ({default})" if isinstance(default, str) else text


def _reader(spec: Spec) -> Any:
    if spec.words:
        return lambda text: text if text in spec.words else _number(text, spec)
    return spec.kind if spec.kind in (int, float, str, Path) else str


def _number(text: str, spec: Spec) -> float:
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(
            f"must be a number or {', '.join(spec.words)}, not {text!r}"
        ) from None
