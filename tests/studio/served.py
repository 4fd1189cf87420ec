"""Where the studio of a test is served."""

from __future__ import annotations

TOKEN, PORT = "s3cret", 4711
BASE = f"http://127.0.0.1:{PORT}"
JSON = {"content-type": "application/json"}
