"""A clip's name that a page must not take for markup."""

from __future__ import annotations

HOSTILE = "<script>alert(1)<∕script>.mkv"  # file names cannot hold a plain slash
