"""One definition per option, used for flag, help, bounds, TOML and the Python API.

A frozen dataclass with fields made by `option` is validated by `check_options` on creation:
Settings is one, and so are the options of each command (RunOptions, PreviewOptions, ...).
"""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any, Protocol, TypeVar, runtime_checkable

from itmo_video.errors import UsageError
from itmo_video.words import cut

T = TypeVar("T")


@dataclass(frozen=True)
class Spec:
    """What an option accepts, and its help.

    `words` are accepted in addition to `kind`; `flag` is its name on the command line if it differs
    from the field's, `read` parses the flag's text if that needs more than `kind`.
    """

    help: str
    kind: type
    lower: float | None = None
    upper: float | None = None
    choices: tuple[str, ...] = ()
    words: tuple[str, ...] = ()
    metavar: str | None = None
    flag: str | None = None
    aliases: tuple[str, ...] = ()
    read: Callable[[str], Any] | None = None

    def check(self, name: str, value: object) -> object:
        """The value, converted to its kind; raises UsageError if it is out of bounds."""
        value = _plain(value)
        if isinstance(value, str) and value in self.words:
            return value
        if self.kind is float and isinstance(value, int | Fraction) and not isinstance(value, bool):
            try:
                value = float(value)
            except OverflowError:
                told = f"{name} must be {self.bounds_in_words or 'a number'}, not one of 300 digits"
                raise UsageError(f"{told} and more") from None
        if self.kind is tuple and isinstance(value, list):
            value = tuple(value)
        if self.kind is Path and isinstance(value, str | os.PathLike):
            value = Path(value)
        if not isinstance(value, self.kind) or (self.kind is int and isinstance(value, bool)):
            raise UsageError(f"{name} must be {self._kind_in_words}, not {cut(repr(value), 60)}")
        if self.choices and value not in self.choices:
            raise UsageError(
                f"{name} must be one of {', '.join(self.choices)}, not {cut(repr(value), 60)}"
            )
        if isinstance(value, int | float) and not isinstance(value, bool):
            low = self.lower if self.lower is not None else float("-inf")
            high = self.upper if self.upper is not None else float("inf")
            if not low <= value <= high:
                raise UsageError(
                    f"{name} must be {self.bounds_in_words}, not {cut(repr(value), 60)}"
                )
        return value

    @property
    def bounds_in_words(self) -> str:
        """The bounds as a phrase after "must be", such as "from 1 to 60"; empty without any."""
        if self.lower is None:
            return ""
        if self.upper is None:
            return f"{self.lower:.10g} or more"
        return f"from {self.lower:.10g} to {self.upper:.10g}"

    @property
    def _kind_in_words(self) -> str:
        kind = _KIND_NAMES.get(self.kind, self.kind.__name__)
        return " or ".join([kind, *(repr(word) for word in self.words)])


def _plain(value: Any) -> Any:
    """A NumPy number, common in numeric code, as a Python number."""
    return value.item() if isinstance(value, _Scalar) and value.shape == () else value


@runtime_checkable
class _Scalar(Protocol):
    shape: tuple[int, ...]

    def item(self) -> Any: ...


def checked(value: Any, kind: type[T], name: str) -> T:
    """`value` if it is of `kind`, a new one for None; otherwise raises UsageError."""
    if value is None:
        return kind()
    if isinstance(value, kind):
        return value
    raise UsageError(
        f"{name} must be {kind.__name__}, not {type(value).__name__}",
        remedy=f"Create one: {kind.__name__}(...), with options by name.",
    )


def checked_path(value: Any, name: str) -> str:
    """A path as text; raises UsageError for anything else."""
    if isinstance(value, str | os.PathLike) and isinstance(path := os.fspath(value), str):
        return path
    raise UsageError(f"{name} must be a path, not {type(value).__name__}")


_KIND_NAMES: dict[type, str] = {
    float: "a number", int: "a whole number", bool: "true or false", str: "text",
    tuple: "a list", dict: "a table", Path: "a path",
}  # fmt: skip


def option(default: Any, kind: type, help: str, **spec: Any) -> Any:
    """A dataclass field with its Spec; a `default` of None means that it is derived."""
    meta = {"spec": Spec(help=help, kind=kind, **spec)}
    if isinstance(default, dict):
        return field(default_factory=lambda: dict(default), metadata=meta)
    return field(default=default, metadata=meta)


def check_options(options: Any) -> None:
    """Convert and check all fields of a frozen dataclass of options; raises UsageError."""
    for f in dataclasses.fields(options):
        value = getattr(options, f.name)
        if value is None and f.default is None:
            continue
        object.__setattr__(options, f.name, spec_of(f).check(flag_of(f), value))


def options_from(kind: type[T], values: Mapping[str, Any], what: str = "option") -> T:
    """Options of `kind` from plain values by name; raises UsageError for unknown names."""
    known = {f.name for f in dataclasses.fields(kind)}  # type: ignore[arg-type]  # a dataclass
    if unknown := sorted(set(values) - known):
        raise UsageError(
            f"unknown {what} {cut(', '.join(unknown))}", remedy=f"Known: {', '.join(sorted(known))}"
        )
    return kind(**values)


def spec_of(f: dataclasses.Field[Any]) -> Spec:
    """The Spec of an option's field."""
    spec = f.metadata["spec"]
    assert isinstance(spec, Spec)
    return spec


def flag_name(name: str) -> str:
    """A field's name as written in TOML and on the command line."""
    return name.replace("_", "-")


def flag_of(f: dataclasses.Field[Any]) -> str:
    """The option's flag, without its dashes."""
    return spec_of(f).flag or flag_name(f.name)
