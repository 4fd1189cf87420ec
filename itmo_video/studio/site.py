"""The page's files, all known at the start: no path from a request is ever looked up."""

from __future__ import annotations

import base64
import hashlib
import json
from importlib import resources

from itmo_video import viewer
from itmo_video.delivery.aces import aces_sdr_table

_KINDS = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
}


class Site:
    """The page, its style sheets and modules, by path, with content types."""

    def __init__(self) -> None:
        folder = resources.files("itmo_video.studio").joinpath("page")
        texts = {e.name: e.read_text("utf-8") for e in folder.iterdir() if _kind(e.name)}
        shared = viewer.modules(aces_sdr_table())
        import_map = json.dumps({"imports": {name: f"./{name}" for name in shared}})
        page = texts.pop("index.html").replace("IMPORT_MAP", import_map)
        digest = base64.b64encode(hashlib.sha256(import_map.encode()).digest()).decode()
        self.policy = (
            f"default-src 'none'; script-src 'self' 'sha256-{digest}'; style-src 'self'; "
            "img-src 'self' blob: data:; connect-src 'self'; base-uri 'none'; form-action 'none'; "
            "frame-ancestors 'none'"
        )
        self.files = {
            "/": (page, _KINDS[".html"]),
            **{f"/{name}": (text, _kind(name)) for name, text in (texts | shared).items()},
        }


def _kind(name: str) -> str:
    return _KINDS.get(name[name.rfind(".") :], "")
