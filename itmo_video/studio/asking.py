"""Reads and validates what the page sends: JSON objects and the types of their entries."""

from __future__ import annotations

import json
import re
from typing import Any

from starlette.requests import Request

from itmo_video.errors import UsageError
from itmo_video.studio.guard import MAX_BODY
from itmo_video.untrusted import parse_json


async def body(request: Request) -> dict[str, Any]:
    """The JSON object that was posted; UsageError for anything else and for text not in Unicode."""
    data = await request.body()
    if len(data) > MAX_BODY:
        raise UsageError("request too long")
    try:
        found = parse_json(data.decode())
    except ValueError as error:
        raise UsageError("the request is not JSON") from error
    if not isinstance(found, dict):
        raise UsageError("the request must be a JSON object")
    try:
        json.dumps(found, ensure_ascii=False).encode()
    except UnicodeEncodeError as error:
        raise UsageError("the request contains text that is not Unicode") from error
    return found


def values(asked: dict[str, Any]) -> dict[str, Any]:
    """Settings by name."""
    found = asked.get("values", {})
    if not isinstance(found, dict):
        raise UsageError("values must be a table")
    return found


def text(asked: dict[str, Any], name: str) -> str:
    """An entry that must be text."""
    value = asked.get(name)
    if not isinstance(value, str):
        raise UsageError(f"{name} must be text, not {value!r}")
    return value


def page(value: object) -> str:
    """The name that a page gave itself, to tell its requests from those of other pages."""
    if isinstance(value, str) and re.fullmatch(r"[0-9a-z]{0,16}", value):
        return value
    raise UsageError("page must be up to 16 letters and digits")


def whole(value: object) -> int:
    """A whole number, from JSON or from a query."""
    if isinstance(value, str) and value.isascii() and value.isdigit() and len(value) < 12:
        return int(value)
    if isinstance(value, int) and not isinstance(value, bool):
        return value
    raise UsageError(f"{value!r} is not a whole number")


def place(shot: object) -> int | None:
    """The place of a shot, or None for the whole clip."""
    return None if shot is None else whole(shot)
