"""--max-pixels: whoever reads a source reads it within the user's limit, not the default one."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest
from clips import moving_scene

from itmo_video.cli.main import main
from itmo_video.source import packets

LIMIT = 64 * 48 + 1
QUICK = ("--lights", "16", "--quiet")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A film with sound, and the folder it was converted to."""
    top = tmp_path_factory.mktemp("made")
    with av.open(str(top / "c.mkv"), "w") as box:
        video, sound = box.add_stream("ffv1", rate=24), box.add_stream("pcm_s16le", rate=48000)
        video.width, video.height, video.pix_fmt = 64, 48, "yuv420p"
        for n, codes in enumerate(moving_scene(2, width=64, height=48)):
            frame = av.VideoFrame.from_ndarray(codes, "rgb24")
            frame = frame.reformat(format="yuv420p", threads=1)
            frame.pts, frame.time_base = n, Fraction(1, 24)
            box.mux(video.encode(frame))
            tone = av.AudioFrame.from_ndarray(np.ones((1, 2000), np.int16), "s16", "mono")
            tone.sample_rate, tone.pts = 48000, 2000 * n
            box.mux(sound.encode(tone))
        for stream in (video, sound):
            box.mux(stream.encode())
    assert main(["convert", str(top / "c.mkv"), str(top / "o"), *QUICK]) == 0
    return top


@pytest.fixture
def limits(monkeypatch: pytest.MonkeyPatch) -> set[int]:
    """The limits with which films are opened and decoded."""
    seen: set[int] = set()
    given = packets.decoder_limit

    def noted(max_pixels: int) -> str:
        seen.add(max_pixels)
        return given(max_pixels)

    monkeypatch.setattr(packets, "decoder_limit", noted)
    return seen


COMMANDS = {
    "info": "info {clip}",
    "convert": "convert {clip} {out}/new --report --lights 16 --quiet",
    "analyse": "analyse {clip} --output {out}/a.json --quiet",
    "preview": "preview {clip} {out}/a.mov --codec prores --quiet",
    "preview of a folder": "preview {folder} {out}/a.mov --codec prores --source {clip} --quiet",
    "compare": "preview {folder} {out}/a.y4m --as compare --source {clip} --quiet",
    "report": "report {folder} --source {clip} --output {out}/page.html --quiet",
    "flicker": "evaluate {folder} --source {clip}",
    "fidelity": "evaluate {folder} --source {clip} --reference {folder}",
    "variants": "variants {clip} {out}/a.png --vary lights --values 16,32",
}


def line(name: str, made: Path, out: Path, limit: int) -> list[str]:
    places = {"clip": made / "c.mkv", "folder": made / "o", "out": out}
    return [part.format(**places) for part in f"{COMMANDS[name]} --max-pixels {limit}".split()]


@pytest.mark.parametrize("name", COMMANDS)
def test_the_limit_is_the_users_wherever_a_source_is_opened(
    name: str, made: Path, tmp_path: Path, limits: set[int]
) -> None:
    assert main(line(name, made, tmp_path, LIMIT)) == 0
    assert limits == {LIMIT}, "the default of 2**27 pixels refuses what the user allowed"


@pytest.mark.parametrize("name", COMMANDS)
def test_the_remedy_is_a_flag_of_the_command(
    name: str, made: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(line(name, made, tmp_path, 100)) == 3
    assert "Raise --max-pixels if this is intended." in capsys.readouterr().err
