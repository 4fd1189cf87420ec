"""Running the studio: one clip, one local page, until the user stops it."""

from __future__ import annotations

import secrets
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any

from itmo_video.conversion.run_options import RunOptions
from itmo_video.errors import UsageError
from itmo_video.output.atomic import output_error
from itmo_video.studio.desk import Desk
from itmo_video.studio.document import Document
from itmo_video.studio.studio_options import StudioOptions
from itmo_video.words import to_install

_MOST_CONNECTIONS = 512
_SILENCE_TICKS = 50  # of 0.1 s


def serve(
    source: str | Path,
    document: Document,
    options: StudioOptions,
    run: RunOptions,
    on_ready: Callable[[str], None],
    on_opened: Callable[[], None],
) -> None:
    """Open the clip and serve its page on 127.0.0.1 until interrupted.

    `on_ready` is called with the page's address, which contains the token that every request needs;
    `on_opened` when a page has been opened.
    Of `run` only the start number and the size limit are used. Raises what opening the clip raises,
    and UsageError if the extra is not installed or the port is taken.
    """
    try:
        import tomli_w  # noqa: F401 - a missing extra is told before the work
        import uvicorn

        from itmo_video.studio.server import make_app
    except ImportError as error:
        raise UsageError(
            f"the studio needs {error.name}, which is not installed",
            remedy=to_install("studio"),
        ) from error
    folder = _made(options.folder)
    with Desk(source, document, folder, run) as desk, socket.socket() as listener:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listener.bind(("127.0.0.1", options.port))
        except OSError as error:
            raise UsageError(
                f"port {options.port} cannot be used: {error.strerror}",
                remedy="Choose another with --port, or leave it out.",
            ) from error
        listener.listen(64)
        taken = listener.getsockname()[1]
        token = secrets.token_urlsafe(24)
        app = make_app(desk, token, taken, on_opened)
        config = uvicorn.Config(
            app,
            log_level="warning",
            access_log=False,
            lifespan="off",
            timeout_graceful_shutdown=20,
            limit_concurrency=_MOST_CONNECTIONS,
        )
        on_ready(f"http://127.0.0.1:{taken}/{token}/")

        class Server(uvicorn.Server):
            quiet: dict[Any, int]  # connections without a request, with the tick that found them

            async def on_tick(self, counter: int) -> bool:
                """Close connections that never send a request: they would keep the page out."""
                known = getattr(self, "quiet", {})
                held = [c for c in self.server_state.connections if getattr(c, "cycle", 0) is None]
                self.quiet = {c: known.get(c, counter) for c in held}
                for connection, since in self.quiet.items():
                    if counter - since > _SILENCE_TICKS:
                        connection.transport.abort()
                return await super().on_tick(counter)

            async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
                desk.stop_showing()  # otherwise shutting down would wait for pictures
                await super().shutdown(sockets)

        Server(config).run(sockets=[listener])


def _made(folder: Path) -> Path:
    """The folder to save to, created if it does not exist."""
    folder = folder.resolve()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except FileExistsError as error:
        raise UsageError(
            "not a folder", where=str(folder), remedy="Choose another folder."
        ) from error
    except OSError as error:
        raise output_error(error, folder) from error
    return folder
