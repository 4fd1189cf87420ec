"""The law on damaged clips: a short run of damaged_decodes.py, and files that once differed."""

from __future__ import annotations

import random
import sys
from pathlib import Path

import pytest
from clips import SHARED

sys.path.insert(0, str(Path(__file__).parent))

from codec_clips import make_clip
from damaged_decodes import frames, of_codec, trial

from itmo_video.source.opening import open_clip

ONCE = sorted((SHARED / "data/fault_files/law").glob("*"))
SOUND = SHARED / "data/fault_files/theora.ogv"


@pytest.mark.parametrize("codec", ["h264", "h264fields", "hevc", "mpeg2ts", "ffv1", "vp8"])
def test_damaged_clips_decode_alike(codec: str) -> None:
    told = of_codec(codec, trials=3, seed=1000)
    assert told["differ"] == 0


@pytest.mark.skipif(not ONCE, reason="needs ../shared")
@pytest.mark.parametrize("path", [*ONCE, SOUND], ids=lambda path: path.name)
def test_files_that_once_differed(path: Path) -> None:
    assert trial(path, random.Random(77)) == []


@pytest.mark.parametrize("codec", ["h264", "h264mkv", "h264refresh", "hevcopen", "mpeg2ts", "av1"])
def test_sound_clips_are_whole_from_anywhere(codec: str, tmp_path: Path) -> None:
    path = make_clip(codec, tmp_path)
    whole = frames(path)
    assert list(whole) == list(range(60))
    for start in (1, 11, 12, 13, 30, 59):
        assert frames(path, start) == {n: check for n, check in whole.items() if n >= start}
    with open_clip(path) as clip:
        for start in (0, 13, 40):
            assert not any(frame.is_damaged for frame in clip.frames(start)), "sound frames named"


def test_damage_that_the_decoder_conceals_without_a_word_is_named(tmp_path: Path) -> None:
    """HEVC's decoder flags no frame: what fails when it is strict, and what follows, is named."""
    path = make_clip("hevc", tmp_path)
    data = bytearray(path.read_bytes())
    for at in range(len(data) // 2, len(data) // 2 + 400, 7):
        data[at] ^= 0x55
    path.write_bytes(data)
    with open_clip(path) as clip:
        found = {frame.index: frame.is_damaged for frame in clip.frames()}
    assert any(found.values()) or len(found) < 60
    assert not all(found.values())
