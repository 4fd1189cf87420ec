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
from starlette.requests import ClientDisconnect, Request
from starlette.responses import Response
from starlette.routing import Route

from itmo_video.errors import ItmoError, UsageError
from itmo_video.studio import asking, state
from itmo_video.studio import document as documents
from itmo_video.studio.desk import Desk
from itmo_video.studio.document import Document
from itmo_video.studio.guard import App, Guard
from itmo_video.studio.saving import ExistsError
from itmo_video.studio.session import Shown, StaleError
from itmo_video.studio.site import Site
from itmo_video.studio.still import avif_still
from itmo_video.studio.variants import variants

T = TypeVar("T")
Answer = Callable[[Request], Awaitable[Response]]


def make_app(
    desk: Desk, token: str, port: int, on_opened: Callable[[], None] = lambda: None
) -> App:
    """The whole application, guarded; `on_opened` is called by each page that is opened."""
    return Guard(Starlette(routes=_Api(desk, on_opened).routes()), token, port)


class _Api:
    def __init__(self, desk: Desk, on_opened: Callable[[], None]) -> None:
        self._desk, self._site, self._on_opened = desk, Site(), on_opened

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
        self._on_opened()
        return _json(state.about(self._desk))

    async def _state(self, request: Request) -> Response:
        return _json(state.state(self._desk))

    async def _picture(self, request: Request) -> Response:
        asked = request.query_params
        made_by, shown = self._desk.picture(
            asking.whole(asked.get("index")),
            asked.get("slot", "a"),
            asked.get("part", "hdr"),
            asking.whole(asked.get("scale", "1")),
            asked.get("lane", "a"),
            asking.page(asked.get("page", "")),
        )
        return _halfs(await _of(shown), made_by)

    async def _variants(self, request: Request) -> Response:
        asked = request.query_params
        shot = asking.place(asked.get("shot"))
        found = variants(asked.get("by", ""), current=self._desk.settings_of(shot))
        return _json([dataclasses.asdict(variant) for variant in found])

    async def _lights(self, request: Request) -> Response:
        asked = request.query_params
        page = asking.page(asked.get("page", ""))
        lights = self._desk.lights(asking.whole(asked.get("index")), asked.get("slot", "a"), page)
        return _json(await _of(lights))

    async def _still(self, request: Request) -> Response:
        asked = request.query_params
        slot = asked.get("slot", "a")
        page = asking.page(asked.get("page", ""))
        index = asking.whole(asked.get("index"))
        settings = self._desk.settings_at(index, slot)
        _, shown = self._desk.picture(index, slot, "hdr", 1, "still", page)
        data = await asyncio.to_thread(avif_still, await _of(shown), settings)
        return Response(data, media_type="image/avif")

    async def _try(self, request: Request) -> Response:
        asked = await asking.body(request)
        peak, shown = self._desk.attempt(
            asking.whole(asked.get("index")),
            asked.get("preset"),
            asking.values(asked),
            asking.whole(asked.get("scale", 4)),
            asking.place(asked.get("shot")),
            asking.page(asked.get("page", "")),
        )
        return _halfs(await _of(shown), "tried", peak)

    async def _edit(self, request: Request) -> Response:
        asked = await asking.body(request)
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
            change = _of_layout(self._change(str(do), asked), asked)
            await asyncio.to_thread(desk.edit, change, None if gesture is None else str(gesture))
        return _json(state.state(desk))

    async def _save(self, request: Request) -> Response:
        asked = await asking.body(request)
        try:
            path = await asyncio.to_thread(
                self._desk.save, asking.text(asked, "kind"), asking.text(asked, "name"),
                asked.get("replace") is True,
            )  # fmt: skip
        except ExistsError as error:
            return _json({"exists": str(error)})  # a question, which is no error
        return _json({"path": str(path), "state": state.state(self._desk)})

    async def _render(self, request: Request) -> Response:
        asked = await asking.body(request)
        if asked.get("do") == "cancel":
            self._desk.runner.cancel()
        else:
            kind, name = asking.text(asked, "kind"), asking.text(asked, "name")
            await asyncio.to_thread(self._desk.render, kind, name, asked.get("again") is True)
        return _json(state.state(self._desk))

    def _change(self, do: str, asked: dict[str, Any]) -> Callable[[Document], Document]:
        shot, opened = asked.get("shot"), self._desk.opened
        if do == "set":
            values, place = asking.values(asked), asking.place(shot)
            return lambda document: documents.set_values(document, values, place)
        if do == "preset":
            name, place = asked.get("preset"), asking.place(shot)
            return partial(documents.with_preset, name=name, opened=opened, shot=place)
        if do == "split":
            return partial(documents.split, at=asking.whole(asked.get("at")))
        if do == "merge":
            return partial(documents.merge, shot=asking.whole(shot))
        if do == "enable":
            return partial(documents.enable, shot=asking.whole(shot), on=asked.get("on") is True)
        raise UsageError(f"unknown action {do!r}")


def _of_layout(
    change: Callable[[Document], Document], asked: dict[str, Any]
) -> Callable[[Document], Document]:
    """The change, refused if it names a shot of a layout that is past."""

    def checked(document: Document) -> Document:
        if asked.get("shot") is not None and "layout" in asked:
            documents.check_layout(document, asked["layout"])
        return change(document)

    return checked


def _told(answer: Answer) -> Answer:
    """The response, or a message for the page if the request fails."""

    async def safe(request: Request) -> Response:
        try:
            return await answer(request)
        except StaleError:
            return Response(status_code=204)  # nothing to show, and nothing that went wrong
        except ClientDisconnect:
            return Response(status_code=400)  # the page was closed while it asked
        except ItmoError as error:
            return _json({"error": str(error)}, 422)

    return safe


async def _of(future: Future[T]) -> T:
    return await asyncio.wrap_future(future)


def _halfs(shown: Shown, made_by: str, peak: float | None = None) -> Response:
    width, height = shown.size
    headers = {
        "x-index": str(shown.index),
        "x-made-by": made_by,
        "x-width": str(width),
        "x-height": str(height),
        "x-channels": str(shown.planes.shape[0]),
        "x-primaries": shown.primaries,
        **({} if peak is None else {"x-peak": str(peak)}),
    }
    data = shown.planes.tobytes()
    return Response(data, media_type="application/octet-stream", headers=headers)


def _json(content: Any, status: int = 200) -> Response:
    """JSON in ASCII: names of files that are not UTF-8 come through as JavaScript has them."""
    text = json.dumps(content, allow_nan=False, separators=(",", ":"))
    return Response(text, status, media_type="application/json")
