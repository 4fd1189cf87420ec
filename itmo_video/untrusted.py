"""Reading JSON, TOML and numbers from untrusted files, with limits of size and depth.

The standard library's readers accept too much: 1e999999999 as a fraction fills the memory, NaN and
Infinity are not JSON, and deep nesting ends in a RecursionError.
"""

from __future__ import annotations

import json
import re
import tomllib
from collections import Counter
from fractions import Fraction
from typing import Any, NoReturn

from itmo_video.errors import InputError
from itmo_video.regular_file import TEXT_BYTES, StrPath, read_regular

_RATIONAL = re.compile(r"\s*([+-]?\d{1,18})(?:\.(\d{1,18})|/(\d{1,18}))?\s*", re.ASCII)
_TOML_BYTES = 128 << 10  # ours have 1 kB; tomllib needs seconds for a key of a megabyte
_DEEPEST = 64  # of nested lists and tables; ours go 5 deep


def parse_rational(text: str) -> Fraction:
    """An exact number written as 25, 23.976 or 24000/1001; otherwise raises ValueError.

    Exponents are not accepted: the fraction of 1e999999999 has a thousand million digits.
    """
    match = _RATIONAL.fullmatch(text)
    if match is None or (match[3] and not int(match[3])):
        raise ValueError(f"{text[:40]!r} is not a number such as 25, 23.976 or 24000/1001")
    return Fraction(match[0].strip())


def parse_json(text: str) -> Any:
    """Parse JSON; raises ValueError if it is invalid, not finite or nested too deeply.

    A name given twice in a table is an error, as one of the two would be lost.
    """
    _check_depth(text)
    return json.loads(
        text, parse_constant=_no_number, parse_float=_finite, object_pairs_hook=_table
    )


def read_json(path: StrPath) -> Any:
    """The content of a JSON file; raises InputError unless it is valid, regular and not too large.

    FileNotFoundError and NotADirectoryError are its cause if there is no such file.
    """
    try:
        return parse_json(read_text(path))
    except ValueError as error:
        raise InputError(f"is not JSON: {error}", where=str(path)) from error


def read_toml(path: StrPath) -> dict[str, Any]:
    """The content of a TOML file; raises InputError like read_json."""
    text = read_text(path, _TOML_BYTES)
    try:
        _check_depth(text)
        _check_keys(text)
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"is not TOML: {error}", where=str(path)) from error


def read_text(path: StrPath, most_bytes: int = TEXT_BYTES) -> str:
    """A file of UTF-8 text, with or without a byte order mark; otherwise raises InputError."""
    try:
        return read_regular(path, most_bytes).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError("is not text (UTF-8)", where=str(path)) from error


def _check_depth(text: str) -> None:
    """Raise ValueError for deep nesting; brackets in strings count, too, but ours never have 64."""
    depth = deepest = 0
    for mark in re.finditer(r"[\[\]{}]", text):
        depth += 1 if mark[0] in "[{" else -1
        deepest = max(deepest, depth)
    if deepest > _DEEPEST:
        raise ValueError(f"it is nested {deepest} levels deep")


def _check_keys(text: str) -> None:
    """Raise ValueError for keys with very many parts, each of which is a nested table."""
    for line in text.splitlines():
        if not line.lstrip().startswith("#") and line.partition("=")[0].count(".") > _DEEPEST:
            raise ValueError(f"a key has more than {_DEEPEST} parts")


def _table(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    table = dict(pairs)
    if len(table) < len(pairs):
        twice = Counter(name for name, _ in pairs).most_common(1)[0][0]
        raise ValueError(f"{twice[:40]!r} is given twice in one table")
    return table


def _no_number(name: str) -> NoReturn:
    raise ValueError(f"{name} is not a number")


def _finite(text: str) -> float:
    value = float(text)
    if abs(value) == float("inf"):
        raise ValueError(f"{text[:40]} is too large")
    return value
