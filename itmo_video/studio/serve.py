"""The edge of the studio: one clip, one page on this machine, until the user ends it."""

from __future__ import annotations

import secrets
import socket
from collections.abc import Callable
from pathlib import Path

from itmo_video.errors import UsageError
from itmo_video.studio.desk import Desk
from itmo_video.studio.document import Document


def serve(
    source: str | Path,
    document: Document,
    folder: Path,
    *,
    port: int = 0,
    start_number: int = 1,
    max_pixels: int = 2**27,
    on_ready: Callable[[str], None],
) -> None:
    """Open the clip and serve its page on 127.0.0.1 until interrupted.

    `port` 0 takes a free one. `on_ready` is given the page's address, which holds the token that
    everything needs. Raises what opening the clip raises, and UsageError where the extra is missing
    or the port is taken.
    """
    try:
        import tomli_w  # noqa: F401 - a missing extra is told before the work
        import uvicorn

        from itmo_video.studio.server import make_app
    except ImportError as error:
        raise UsageError(
            f"the studio needs {error.name}, which is not installed",
            remedy="pip install 'itmo_video[studio]'",
        ) from error
    if not folder.is_dir():
        raise UsageError("it is no folder", where=str(folder))
    with Desk(
        source, document, folder, start_number=start_number, max_pixels=max_pixels
    ) as desk, socket.socket() as listener:  # fmt: skip
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listener.bind(("127.0.0.1", port))
        except OSError as error:
            raise UsageError(f"port {port} cannot be used: {error.strerror}") from error
        listener.listen(64)
        taken = listener.getsockname()[1]
        token = secrets.token_urlsafe(24)
        app = make_app(desk, token, taken)
        config = uvicorn.Config(
            app,
            log_level="warning",
            access_log=False,
            lifespan="off",
            timeout_graceful_shutdown=2,
            limit_concurrency=64,
        )
        on_ready(f"http://127.0.0.1:{taken}/{token}/")
        uvicorn.Server(config).run(sockets=[listener])
