"""Opening the page in the browser without its secret address among a process's arguments."""

from __future__ import annotations

import html
import os
import tempfile
import webbrowser
from pathlib import Path


class Opening:
    """A page in a file that only this user can read, which leads the browser to the studio.

    The arguments of a process can be read by everybody on a machine: they name this file. `done`
    removes it, at the latest when the studio ends.
    """

    def __init__(self) -> None:
        self._folder: tempfile.TemporaryDirectory[str] | None = None

    def open(self, address: str) -> None:
        """Write the file, for its owner alone, and open it in the browser."""
        self._folder = tempfile.TemporaryDirectory(prefix="itmo-studio-")
        path = Path(self._folder.name) / "open.html"
        said = html.escape(address, quote=True)
        with os.fdopen(os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o600), "w") as file:
            file.write(
                f'<!doctype html><meta charset="utf-8"><title>studio</title>'
                f'<meta name="referrer" content="no-referrer">'
                f'<meta http-equiv="refresh" content="0; url={said}">'
                f'<p><a href="{said}">Open the studio</a></p>\n'
            )
        webbrowser.open(path.as_uri())

    def done(self) -> None:
        """Remove the file, if there is one."""
        folder, self._folder = self._folder, None
        if folder is not None:
            folder.cleanup()
