"""A source is known by all of its content, and a source that changes in mid-run is told."""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import Any

import cv2
import pytest
from clips import exr_bytes, moving_scene, write_ffv1
from PIL import Image

from itmo_video import DamagedInputError, RunOptions, convert, make_settings, open_clip
from itmo_video.cli.main import main
from itmo_video.events import FrameDone, Started
from itmo_video.look import make_look
from itmo_video.regular_file import open_regular
from itmo_video.rendering.spans import frames_in_flight
from itmo_video.source import digest, opening, remembered
from itmo_video.source.animation_times import Timing, timing
from itmo_video.source.digest import SourceFiles, content_digest, file_digest
from itmo_video.source.still_formats import StillFormat

QUICK: dict[str, Any] = {"compression": "none", "lights": 16}


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache"


def aged(path: Path) -> Path:
    """As if it had been written an hour ago; its change time cannot be set back."""
    os.utime(path, (path.stat().st_mtime - 3600,) * 2)
    return path


def test_one_byte_anywhere_makes_another_source(tmp_path: Path) -> None:
    big = tmp_path / "big"
    with big.open("wb") as file:
        file.truncate(300 << 20)
    seen = {content_digest([big])}
    for at in (0, 1, 150 << 20, (5 << 20) + 1, (300 << 20) - 1):
        with big.open("r+b") as file:
            file.seek(at)
            file.write(b"x")
        seen.add(content_digest([big]))
    assert len(seen) == 6


def test_a_source_changed_in_its_middle_is_another(tmp_path: Path) -> None:
    clip = write_ffv1(tmp_path / "c.mkv", moving_scene(4))
    assert main(["convert", str(clip), str(tmp_path / "o"), "--quiet"]) == 0
    data = bytearray(clip.read_bytes())
    data[len(data) // 2] ^= 1
    before = clip.stat()
    clip.write_bytes(data)
    os.utime(clip, ns=(before.st_atime_ns, before.st_mtime_ns))
    for more in ([], ["--update"], ["--verify"]):
        code = main(["convert", str(clip), str(tmp_path / "o"), "--quiet", *more])
        assert code == (7 if more == ["--verify"] else 5), "the old frames count as the new film's"


def test_remembered_until_anything_of_the_file_changes(
    tmp_path: Path, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(digest, "_WORTH_REMEMBERING", 1)
    monkeypatch.setattr(digest, "_SETTLED_S", -1.0)
    path = tmp_path / "film"
    path.write_bytes(b"a" * 1000)
    first = file_digest(path)
    assert len(list(cache.rglob("*.json"))) == 1

    read: list[object] = []

    def counted(p: Path) -> Any:
        read.append(p)
        return open_regular(p)

    monkeypatch.setattr(digest, "open_regular", counted)
    assert (file_digest(path), read) == (first, []), "it is not remembered"
    times = path.stat()
    path.write_bytes(b"b" * 1000)
    os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))
    assert file_digest(path) != first, "a change whose time was set back is not seen"
    assert len(read) == 1


@pytest.mark.parametrize(
    "text", ["", "[]", "{", '{"digest": 3}', "[" * 60000, '{"digest": "' + "0" * 32 + '"}', "\xff"]
)
def test_a_cache_of_nonsense_changes_nothing(
    text: str, tmp_path: Path, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(digest, "_WORTH_REMEMBERING", 1)
    monkeypatch.setattr(digest, "_SETTLED_S", -1.0)
    path = tmp_path / "film"
    path.write_bytes(b"a")
    first = file_digest(path)
    (kept,) = cache.rglob("*.json")
    kept.write_text(text, "latin-1")
    assert file_digest(path) == first
    kept.unlink()
    os.mkfifo(kept)
    assert file_digest(path) == first
    shutil.rmtree(cache)
    cache.write_text("in the way")
    assert file_digest(path) == first


def test_a_young_file_is_not_remembered(
    tmp_path: Path, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(digest, "_WORTH_REMEMBERING", 1)
    (tmp_path / "film").write_bytes(b"a")
    file_digest(tmp_path / "film")
    assert not cache.exists()
    assert remembered.digest(tmp_path / "film", os.stat(tmp_path / "film")) is None


def replace_source(clip: Path, other: Path, how: str) -> None:
    """Put another file, nothing, or a folder in the place of a source."""
    if how == "renamed over":
        os.replace(other, clip)
    elif how == "written to":
        clip.write_bytes(other.read_bytes())
    else:
        clip.unlink()
        if how == "a folder":
            clip.mkdir()


@pytest.mark.parametrize("how", ["renamed over", "written to", "removed", "a folder"])
def test_a_film_replaced_in_mid_run_leaves_no_frame_of_the_other(how: str, tmp_path: Path) -> None:
    # Whatever the load: more frames than may be decoded before the first is made.
    settings = make_settings(**QUICK, key_interval=1, smooth_keys=0)
    count = 12 + frames_in_flight(make_look(settings), 1)
    clip = write_ffv1(tmp_path / "c.mkv", moving_scene(count, width=64, height=48))
    other = write_ffv1(tmp_path / "other.mkv", moving_scene(count, width=64, height=48, seed=9))
    convert(clip, tmp_path / "whole", settings)
    whole = exr_bytes(tmp_path / "whole")
    done = False

    def on_event(event: object) -> None:
        nonlocal done
        if isinstance(event, FrameDone) and not done:
            done = True
            replace_source(clip, other, how)

    with pytest.raises(DamagedInputError, match="while it was being read"):
        convert(clip, tmp_path / "o", settings, RunOptions(jobs=1), on_event)
    made = exr_bytes(tmp_path / "o")
    assert 0 < len(made) < count
    assert made.items() <= whole.items(), "frames of the new film bear the old one's fingerprint"


def test_a_film_that_is_being_written_to_is_told(tmp_path: Path) -> None:
    """Empty for a moment, it has an end there, which is none of the film's."""
    clip = write_ffv1(tmp_path / "c.mkv", moving_scene(60))
    opened = open_clip(clip)
    frames = opened.frames()
    next(frames)
    clip.write_bytes(b"")
    with pytest.raises(DamagedInputError, match="changed while it was being read"):
        list(frames)


@pytest.mark.parametrize("how", ["deleted", "a folder", "a fifo", "another picture", "enormous"])
def test_a_sequence_that_changes_in_mid_run_is_told(
    how: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pattern = tmp_path / "s.%d.png"
    for n, codes in enumerate(moving_scene(40, width=64, height=48)):
        cv2.imwrite(str(pattern) % n, codes)
    victim = Path(str(pattern) % 35)
    clip = open_clip(pattern)
    frames = clip.frames()
    next(frames)
    if how == "another picture":
        shutil.copy(str(pattern) % 2, victim)
    elif how == "enormous":
        with victim.open("r+b") as file:
            file.truncate(1 << 40)
    else:
        victim.unlink()
        if how != "deleted":
            (os.mkdir if how == "a folder" else os.mkfifo)(victim)
    with pytest.raises(DamagedInputError, match="while it was being read") as caught:
        list(frames)
    assert caught.value.where == str(victim)


@pytest.mark.parametrize("how", ["renamed over", "written to", "removed"])
@pytest.mark.parametrize("form", ["gif", "webp"])
def test_an_animation_replaced_in_mid_run_leaves_no_frame_of_the_other(
    form: str, how: str, tmp_path: Path
) -> None:
    clip, other = tmp_path / f"a.{form}", tmp_path / f"b.{form}"
    for path, seed in ((clip, 1), (other, 9)):
        first, *more = map(Image.fromarray, moving_scene(4, width=64, height=48, seed=seed))
        first.save(path, save_all=True, append_images=more, duration=100)

    def on_event(event: object) -> None:
        if isinstance(event, Started):
            replace_source(clip, other, how)

    with pytest.raises(DamagedInputError, match="while it was being read"):
        convert(clip, tmp_path / "o", make_settings(**QUICK), on_event=on_event)
    assert exr_bytes(tmp_path / "o") == {}, "frames of the new file bear the old one's fingerprint"


def test_an_animation_changed_while_its_frames_are_taken_is_told(tmp_path: Path) -> None:
    path = tmp_path / "a.gif"
    first, *more = map(Image.fromarray, moving_scene(4, width=64, height=48))
    first.save(path, save_all=True, append_images=more, duration=100)
    with open_clip(path) as clip:
        frames = clip.frames()
        next(frames)
        path.unlink()
        with pytest.raises(DamagedInputError, match="was removed while it was being read"):
            next(frames)


def test_an_animation_replaced_while_it_is_opened_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.gif"
    first, *more = map(Image.fromarray, moving_scene(4, width=64, height=48))
    first.save(path, save_all=True, append_images=more, duration=100)

    def replaced(data: bytes, kind: StillFormat) -> Timing | None:
        first.save(path, save_all=True, append_images=more[:1], duration=40)
        return timing(data, kind)

    monkeypatch.setattr(opening, "timing", replaced)
    with pytest.raises(DamagedInputError, match="changed while it was being read"):
        open_clip(path)


def test_a_sequence_with_odd_members_has_gaps(tmp_path: Path) -> None:
    pattern = tmp_path / "s.%d.png"
    for n, codes in enumerate(moving_scene(6, width=64, height=48)):
        cv2.imwrite(str(pattern) % n, codes)
    for n, make in ((1, os.mkdir), (2, os.mkfifo)):
        Path(str(pattern) % n).unlink()
        make(str(pattern) % n)
    with Path(str(pattern) % 4).open("r+b") as file:
        file.truncate(1 << 40)
    assert [frame.index for frame in open_clip(pattern).frames()] == [0, 3, 5]


def test_a_source_that_changes_while_it_is_hashed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "film"
    path.write_bytes(b"a" * 100)
    source = SourceFiles([path])
    path.write_bytes(b"b" * 101)
    with pytest.raises(DamagedInputError, match="changed while"):
        source.digest()
