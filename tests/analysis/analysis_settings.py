"""Settings of the analyses that are tested."""

from __future__ import annotations

from itmo_video import make_settings

SETTINGS = make_settings("default", lights=64, radius=64, compression="none")
