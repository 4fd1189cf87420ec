"""Options that a preview does not use are named."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from clips import moving_scene, write_ffv1

from itmo_video import make_settings
from itmo_video.cli.main import main
from itmo_video.delivery.idle_options import idle_options
from itmo_video.delivery.preview_options import PreviewOptions


@pytest.mark.parametrize(
    ("name", "options", "told"),
    [
        ("a.png", {"depth": "8", "chroma": "444"}, "chroma, depth have no effect on a .png still"),
        ("a.AVIF", {"chroma": "444", "crf": 3.0}, "chroma has no effect on a .avif still"),
        ("a.jpg", {"crf": 3.0}, "crf has no effect on a .jpg still"),
        ("a.jpg", {"tone_map": "hable"}, None),
        ("a.png", {"tone_map": "hable"}, "tone-map has no effect on a .png still of this view"),
        ("a.png", {"tone_map": "hable", "view": "sdr"}, None),
        ("a.mp4", {"tone_map": "hable"}, "tone-map has no effect on a film of this view (hdr10)"),
        ("a.mp4", {"tone_map": "hable", "view": "compare"}, None),
        ("a.mp4", {"codec": "hevc", "chroma": "422", "crf": 3.0}, None),
        ("-", {"depth": "8", "view": "sdr"}, None),
    ],
)
def test_what_has_no_effect(name: str, options: dict[str, Any], told: str | None) -> None:
    said = idle_options(Path(name), PreviewOptions(**{"view": "hdr10", **options}))
    assert [told in text for text in said] == [True] if told else said == []


def test_settings_of_exr_files_are_named() -> None:
    of_exr = make_settings("default", compression="zip", owner="me", peak_nits=600.0)
    said = idle_options(Path("a.mp4"), PreviewOptions(view="hdr10"), of_exr)
    assert said == ["compression, owner have an effect on EXR files only"]
    for quiet in (None, make_settings("default", peak_nits=600.0)):
        assert idle_options(Path("a.mp4"), PreviewOptions(view="hdr10"), quiet) == []


def test_preview_says_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    clip = write_ffv1(tmp_path / "clip.mkv", moving_scene(1, width=48, height=32))
    flags = ["--depth", "8", "--frame", "1", "--compression", "zip"]
    assert main(["preview", str(clip), str(tmp_path / "a.png"), *flags]) == 0
    told = capsys.readouterr().err
    assert "depth has no effect on a .png still of this view (hdr10)" in told
    assert "compression has an effect on EXR files only" in told
