"""The operators by name: those in OPERATORS of the modules in this folder, and users' own.

A new operator is one file here. A user's operator is an entry point of the group
`itmo_video.operators` with the operator's name, which returns an Operator; it is loaded only when
used, and cannot replace one of ours. Its distribution's version is part of a frame's fingerprint,
so that a resumed conversion does not mix versions.
"""

from __future__ import annotations

import pkgutil
from collections.abc import Mapping
from importlib import import_module
from typing import TYPE_CHECKING

from itmo_video.errors import UsageError
from itmo_video.operators.protocol import Operator
from itmo_video.settings import Settings

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

GROUP = "itmo_video.operators"


def _built_in() -> dict[str, Operator]:
    found: dict[str, Operator] = {}
    package = __name__.rpartition(".")[0]
    for module in pkgutil.iter_modules(import_module(package).__path__, f"{package}."):
        if module.name != __name__:
            for operator in getattr(import_module(module.name), "OPERATORS", ()):
                found[operator.name] = operator
    return dict(sorted(found.items()))


OPERATORS: dict[str, Operator] = _built_in()


def all_operators() -> dict[str, Operator]:
    """All operators by name; raises UsageError if a user's entry point cannot be loaded."""
    from importlib import metadata  # late, because it is slow

    users = {point.name for point in metadata.entry_points(group=GROUP)} - set(OPERATORS)
    return OPERATORS | {name: _load(name) for name in sorted(users)}


def find_operator(settings: Settings) -> Operator:
    """The operator named in the settings; raises UsageError for unknown names and parameters."""
    operator = OPERATORS.get(settings.operator)
    if operator is None:
        operator = _load(settings.operator)
    if settings.alpha is not None and not operator.uses_alpha:
        raise UsageError(f"operator {operator.name} does not use alpha")
    return operator


def version_of(name: str) -> str:
    """The distribution and version of a user's operator; "" for ours or if unknown.

    Raises UsageError for unknown names.
    """
    if name in OPERATORS:
        return ""
    distribution = _point(name).dist
    return "" if distribution is None else f"{distribution.name} {distribution.version}"


def _point(name: str) -> EntryPoint:
    from importlib import metadata

    points = metadata.entry_points(group=GROUP, name=name)
    if not points:
        raise UsageError(f"unknown operator {name!r}", remedy=f"Known: {', '.join(OPERATORS)}")
    return next(iter(points))


def _load(name: str) -> Operator:
    point = _point(name)
    try:
        operator = point.load()
    except Exception as error:  # any fault of a plug-in is reported as its own
        raise UsageError(
            f"operator {name!r} cannot be loaded: {error}", where=point.value
        ) from error
    if not isinstance(operator, Operator):
        raise UsageError(f"operator {name!r} is not an Operator", where=point.value)
    return operator


def resolve_params(operator: Operator, given: Mapping[str, float]) -> dict[str, float]:
    """All parameters of an operator with defaults filled in; raises UsageError if out of bounds."""
    params = {name: p.default for name, p in operator.parameters.items()}
    for name, value in given.items():
        spec = operator.parameters.get(name)
        if spec is None:
            known = ", ".join(operator.parameters) or "none"
            raise UsageError(
                f"operator {operator.name} has no parameter {name!r}", remedy=f"Known: {known}"
            )
        if not isinstance(value, int | float) or not spec.lower <= value <= spec.upper:
            raise UsageError(f"{name} must be from {spec.lower:g} to {spec.upper:g}, not {value!r}")
        params[name] = float(value)
    return params
