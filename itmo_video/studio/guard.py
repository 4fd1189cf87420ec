"""Access control: only this page, in this browser, on this machine may talk to the studio."""

from __future__ import annotations

import hmac
from collections.abc import Awaitable, Callable, Iterable, MutableMapping
from typing import Any

Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]

MAX_BODY = 64 << 10
_HEADERS = (
    (b"cache-control", b"no-store"),
    (b"x-content-type-options", b"nosniff"),
    (b"x-frame-options", b"DENY"),
    (b"referrer-policy", b"no-referrer"),
    (b"cross-origin-resource-policy", b"same-origin"),
    (b"cross-origin-opener-policy", b"same-origin"),
)


class Guard:
    """Refuses requests without the token as the first part of their path, or of another origin.

    The Host header must name this machine and port, which stops DNS rebinding (a foreign name that
    resolves to 127.0.0.1). Origin and Sec-Fetch-Site, if the browser sends them, must match the
    page's; only the page itself may also be opened from elsewhere, by one who knows the token. The
    wrapped app sees the path without the token.
    """

    def __init__(self, app: App, token: str, port: int) -> None:
        self._app, self._token = app, token
        self._hosts = {f"127.0.0.1:{port}", f"localhost:{port}"}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Refuse the request, or pass it on."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        if scope["type"] != "http":
            return
        if problem := self._problem(scope):
            await _refuse(send, *problem)
            return
        rest = "/" + scope["path"].split("/", 2)[2]
        inner = {**scope, "path": rest, "raw_path": rest.encode()}

        async def send_with(message: MutableMapping[str, Any]) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message.get("headers", ()), *_HEADERS]
            await send(message)

        await self._app(inner, receive, send_with)

    def _problem(self, scope: Scope) -> tuple[int, str] | None:
        headers: dict[str, list[str]] = {}
        for name, value in scope["headers"]:
            headers.setdefault(name.decode("latin-1").lower(), []).append(value.decode("latin-1"))
        hosts = headers.get("host", [])
        if len(hosts) != 1 or hosts[0].lower() not in self._hosts:
            return 421, "wrong Host"
        origin = headers.get("origin", [])
        if origin and origin != [f"http://{hosts[0]}"]:
            return 403, "wrong Origin"
        is_opening = (
            scope["method"] == "GET"
            and scope["path"] == f"/{self._token}/"
            and headers.get("sec-fetch-mode") == ["navigate"]
            and headers.get("sec-fetch-dest") == ["document"]
        )
        if not is_opening and set(headers.get("sec-fetch-site", [])) - {"same-origin", "none"}:
            return 403, "requested by another page"
        parts = scope["path"].split("/", 2)
        given = parts[1].encode("utf-8", "replace") if len(parts) == 3 else b""
        if not hmac.compare_digest(given, self._token.encode()):
            return 403, "no token: open the address that the studio printed"
        length = headers.get("content-length", ["0"])[0]
        if not length.isdigit() or int(length) > MAX_BODY:
            return 413, "request too long"
        if scope["method"] == "POST":
            kind = headers.get("content-type", [""])[0].partition(";")[0].strip()
            if kind != "application/json" or "transfer-encoding" in headers:
                return 415, "the request must be JSON with a Content-Length"
        return None


async def _refuse(send: Send, status: int, text: str) -> None:
    headers: Iterable[tuple[bytes, bytes]] = ((b"content-type", b"text/plain"), *_HEADERS)
    await send({"type": "http.response.start", "status": status, "headers": list(headers)})
    await send({"type": "http.response.body", "body": f"{text}\n".encode()})
