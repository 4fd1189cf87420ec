"""What is said, and kept, when a law is broken."""

from __future__ import annotations

from pathlib import Path

import pytest
from clips import exr_bytes, moving_scene, write_ffv1
from same_bytes import assert_same_bytes

from itmo_video import convert, make_settings


def test_what_differs_is_told_and_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ITMO_VIDEO_KEEP", str(tmp_path))
    clip = write_ffv1(tmp_path / "a.mkv", moving_scene(3, width=48, height=32))
    one, two = tmp_path / "one", tmp_path / "two"
    convert(clip, one, make_settings("default", lights=16))
    convert(clip, two, make_settings("default", lights=16, primaries="acescg"))
    (one / "itmo-video.json").unlink()
    expected = exr_bytes(one)
    assert_same_bytes(one, expected, "equal")
    first = sorted(expected)[0]
    (one / first).write_bytes((two / first).read_bytes())
    (one / "odd.txt").touch()
    with pytest.raises(AssertionError, match="one frame was made anew; kept in") as caught:
        assert_same_bytes(one, expected, "one frame was made anew")
    told = str(caught.value).splitlines()
    assert len(told) == 3
    assert first in told[1]
    assert "itmoFingerprint" in told[1]
    assert " of R from line 0" in told[1]
    assert "should not be there" in told[2]
    (kept,) = tmp_path.glob("itmo-differing-*")
    assert {p.name for p in kept.iterdir()} == {
        f"{first}.found", f"{first}.expected", "odd.txt.found"
    }  # fmt: skip
    assert (kept / f"{first}.expected").read_bytes() == expected[first]
