"""The studio's HTTP interface: the page, its pictures as half floats, and its edits."""

from __future__ import annotations

import asyncio
import dataclasses
import json
from collections.abc import Awaitable, Callable
from concurrent.futures import Future
from functools import partial
from typing import Any, TypeVar

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from itmo_video.errors import ItmoError, UsageError
from itmo_video.studio import document as documents
from itmo_video.studio import state
from itmo_video.studio.desk import Desk
from itmo_video.studio.document import Document
from itmo_video.studio.guard import MAX_BODY, App, Guard
from itmo_video.studio.saving import ExistsError
from itmo_video.studio.session import Shown, StaleError
from itmo_video.studio.site import Site
from itmo_video.studio.still import avif_still
from itmo_video.studio.variants import variants

T = TypeVar("T")
Answer = Callable[[Request], Awaitable[Response]]


def make_app(desk: Desk, token: str, port: int) -> App:
    """The whole application, guarded."""
    return Guard(Starlette(routes=_Api(desk).routes()), token, port)


class _Api:
    def __init__(self, desk: Desk) -> None:
        self._desk, self._site = desk, Site()

    def routes(self) -> list[Route]:
        """All routes; anything else is 404."""
        gets: dict[str, Answer] = {
            "/api/about": self._about,
            "/api/state": self._state,
            "/api/picture": self._picture,
            "/api/lights": self._lights,
            "/api/still.avif": self._still,
            "/api/variants": self._variants,
        }
        posts: dict[str, Answer] = {
            "/api/edit": self._edit,
            "/api/try": self._try,
            "/api/save": self._save,
            "/api/render": self._render,
        }
        return [
            *(Route(path, self._file, methods=["GET"]) for path in self._site.files),
            *(Route(path, _told(answer), methods=["GET"]) for path, answer in gets.items()),
            *(Route(path, _told(answer), methods=["POST"]) for path, answer in posts.items()),
        ]

    async def _file(self, request: Request) -> Response:
        text, kind = self._site.files[request.scope["path"]]
        return Response(
            text, media_type=kind, headers={"content-security-policy": self._site.policy}
        )

    async def _about(self, request: Request) -> Response:
        return JSONResponse(state.about(self._desk))

    async def _state(self, request: Request) -> Response:
        return JSONResponse(state.state(self._desk))

    async def _picture(self, request: Request) -> Response:
        asked = request.query_params
        version, shown = self._desk.picture(
            _whole(asked.get("index")),
            asked.get("slot", "a"),
            asked.get("part", "hdr"),
            _whole(asked.get("scale", "1")),
            asked.get("lane", "a"),
        )
        return _halfs(await _of(shown), version)

    async def _variants(self, request: Request) -> Response:
        found = variants(request.query_params.get("by", ""))
        return JSONResponse([dataclasses.asdict(variant) for variant in found])

    async def _lights(self, request: Request) -> Response:
        asked = request.query_params
        lights = self._desk.lights(_whole(asked.get("index")), asked.get("slot", "a"))
        return JSONResponse(await _of(lights))

    async def _still(self, request: Request) -> Response:
        asked = request.query_params
        slot = asked.get("slot", "a")
        version, shown = self._desk.picture(_whole(asked.get("index")), slot, "hdr", 1, "still")
        settings = self._desk.history.now.settings
        data = await asyncio.to_thread(avif_still, await _of(shown), settings)
        return Response(data, media_type="image/avif", headers={"x-version": str(version)})

    async def _try(self, request: Request) -> Response:
        asked = await _body(request)
        values = asked.get("values", {})
        if not isinstance(values, dict):
            raise UsageError("values must be a table")
        shown = self._desk.attempt(
            _whole(asked.get("index")), asked.get("preset"), values, _whole(asked.get("scale", 4))
        )
        return _halfs(await _of(shown), self._desk.version)

    async def _edit(self, request: Request) -> Response:
        asked = await _body(request)
        do = asked.get("do")
        desk = self._desk
        if do in ("undo", "redo"):
            desk.step(back=do == "undo")
        elif do == "keep_other":
            desk.keep_other()
        elif do == "swap":
            desk.swap()
        else:
            gesture = asked.get("gesture")
            change = _change(str(do), asked)
            await asyncio.to_thread(desk.edit, change, None if gesture is None else str(gesture))
        return JSONResponse(state.state(desk))

    async def _save(self, request: Request) -> Response:
        asked = await _body(request)
        try:
            path = await asyncio.to_thread(
                self._desk.save,
                str(asked.get("kind")),
                str(asked.get("name", "")),
                asked.get("replace") is True,
            )
        except ExistsError as error:
            return JSONResponse({"error": str(error), "exists": True}, 409)
        return JSONResponse({"path": str(path), "state": state.state(self._desk)})

    async def _render(self, request: Request) -> Response:
        asked = await _body(request)
        if asked.get("do") == "cancel":
            self._desk.runner.cancel()
        else:
            kind, name = str(asked.get("kind")), str(asked.get("name", ""))
            await asyncio.to_thread(self._desk.render, kind, name)
        return JSONResponse(state.state(self._desk))


def _change(do: str, asked: dict[str, Any]) -> Callable[[Document], Document]:
    shot = asked.get("shot")
    if do == "set":
        values = asked.get("values")
        if not isinstance(values, dict):
            raise UsageError("values must be a table")
        place = None if shot is None else _whole(shot)
        return lambda document: documents.set_values(document, values, place)
    if do == "preset":
        return partial(documents.with_preset, name=asked.get("preset"))
    if do == "split":
        return partial(documents.split, at=_whole(asked.get("at")))
    if do == "merge":
        return partial(documents.merge, shot=_whole(shot))
    if do == "enable":
        return partial(documents.enable, shot=_whole(shot), on=asked.get("on") is True)
    raise UsageError(f"unknown action {do!r}")


def _told(answer: Answer) -> Answer:
    """The response, or a message for the page if the request fails."""

    async def safe(request: Request) -> Response:
        try:
            return await answer(request)
        except StaleError:
            return JSONResponse({"stale": True}, 409)
        except UsageError as error:
            return JSONResponse({"error": str(error)}, 422)
        except ItmoError as error:
            return JSONResponse({"error": str(error)}, 500)

    return safe


async def _of(future: Future[T]) -> T:
    return await asyncio.wrap_future(future)


async def _body(request: Request) -> dict[str, Any]:
    data = await request.body()
    if len(data) > MAX_BODY:
        raise UsageError("request too long")
    try:
        found = json.loads(data)
    except (ValueError, RecursionError) as error:
        raise UsageError("the request is not JSON") from error
    if not isinstance(found, dict):
        raise UsageError("the request must be a JSON object")
    return found


def _whole(value: object) -> int:
    if isinstance(value, str) and value.isascii() and value.isdigit() and len(value) < 12:
        return int(value)
    if isinstance(value, int) and not isinstance(value, bool):
        return value
    raise UsageError(f"{value!r} is not a whole number")


def _halfs(shown: Shown, version: int) -> Response:
    width, height = shown.size
    headers = {
        "x-index": str(shown.index),
        "x-version": str(version),
        "x-width": str(width),
        "x-height": str(height),
        "x-channels": str(shown.planes.shape[0]),
        "x-primaries": shown.primaries,
    }
    data = shown.planes.tobytes()
    return Response(data, media_type="application/octet-stream", headers=headers)
