"""What is not opened, why, and what is opened all the same: odd names, odd tags."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import av
import pytest
from image_files import png_bytes
from source_clips import read, write_scene

from itmo_video.errors import AlreadyHdrError, InputError
from itmo_video.source.digest import content_digest
from itmo_video.source.opening import open_clip
from itmo_video.source.tags import InputOptions


def test_too_many_pixels_are_refused_before_decoding(tmp_path: Path) -> None:
    path = write_scene(tmp_path / "a.mp4", "libx264", 3)
    for options in (InputOptions(max_pixels=96 * 64 - 1), InputOptions(max_pixels=1)):
        with pytest.raises(InputError, match="--max-pixels"):
            open_clip(path, options)
    assert open_clip(path, InputOptions(max_pixels=96 * 64)).info.frames == 3
    png = tmp_path / "bomb.png"
    png.write_bytes(png_bytes(60000, 60000, 2, b""))
    with pytest.raises(InputError, match="60000x60000"):
        open_clip(png)


def test_playlists_are_refused(tmp_path: Path) -> None:
    target = write_scene(tmp_path / "a.ts", "libx264", 3)
    for name, text in (
        ("list.m3u8", f"#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\n{target}\n#EXT-X-ENDLIST\n"),
        ("list.ffconcat", f"ffconcat version 1.0\nfile '{target}'\n"),
        ("list.sdp", "v=0\no=- 0 0 IN IP4 127.0.0.1\nm=video 9 RTP/AVP 96\n"),
    ):
        playlist = tmp_path / name
        playlist.write_text(text)
        with pytest.raises(InputError):
            open_clip(playlist)


def test_what_cannot_be_opened_says_why(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        open_clip(tmp_path / "none.mp4")
    with pytest.raises(InputError, match="folder"):
        open_clip(tmp_path)
    with pytest.raises(InputError, match="no file matches"):
        open_clip(tmp_path / "img.%04d.png")
    os.mkfifo(tmp_path / "pipe.mp4")
    writer = os.open(tmp_path / "pipe.mp4", os.O_RDWR)
    with pytest.raises(InputError, match="not a regular file"):
        open_clip(tmp_path / "pipe.mp4")
    os.close(writer)
    hdr = tmp_path / "a.hdr"
    hdr.write_bytes(b"#?RADIANCE\n")
    with pytest.raises(AlreadyHdrError):
        open_clip(hdr)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_no_permission_is_said(tmp_path: Path) -> None:
    path = tmp_path / "a.mp4"
    path.write_bytes(b"x")
    path.chmod(0)
    with pytest.raises(InputError, match=r"[Pp]ermission"):
        open_clip(path)


@pytest.mark.parametrize("name", [b"a b.mp4", b"c:d.mp4", b"http:x.mp4", b"e%04d.mp4", b"f\ng.mp4",
    b"-h.mp4", b"\xff\xfe.mp4", "\u00fc\u6620.mp4".encode()])  # fmt: skip
def test_odd_names(tmp_path: Path, name: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    source = write_scene(tmp_path / "source.mp4", "libx264", 2)
    try:
        shutil.copy(source, tmp_path / os.fsdecode(name))
    except OSError:
        pytest.skip("this file system has no such names")
    assert open_clip(tmp_path / os.fsdecode(name)).info.frames == 2
    monkeypatch.chdir(tmp_path)
    assert len(read(open_clip(os.fsdecode(name)))) == 2


def test_tags_that_are_not_utf8_are_no_obstacle(tmp_path: Path) -> None:
    path = write_scene(tmp_path / "a.mkv", "libx264", 3)
    with av.open(str(path)) as was, av.open(str(tmp_path / "b.mkv"), "w") as box:
        stream = box.add_stream_from_template(was.streams.video[0])
        box.metadata.update(title="TITLETITLE", timecode="QQQQQQQQ")
        for packet in was.demux(video=0):
            if packet.size:
                packet.stream = stream
                box.mux(packet)
    data = (tmp_path / "b.mkv").read_bytes().replace(b"TIMECODE", b"timecode")
    for ascii_only in (b"TITLETITLE", b"QQQQQQQQ"):
        assert ascii_only in data
        data = data.replace(ascii_only, ascii_only[:3] + b"\xfc\xe9" + ascii_only[5:])
    (tmp_path / "b.mkv").write_bytes(data)
    info = open_clip(tmp_path / "b.mkv").info
    assert info.frames == 3
    assert info.timecode == "QQQ??QQQ", "must be printable"


def test_digest_is_of_the_content(tmp_path: Path) -> None:
    a = write_scene(tmp_path / "a.mp4", "libx264", 3)
    b = Path(shutil.copy(a, tmp_path / "b.mp4"))
    assert open_clip(a).info.digest == open_clip(b).info.digest == content_digest([a])
    c = write_scene(tmp_path / "c.mp4", "libx264", 4)
    assert content_digest([a]) != content_digest([c])
    big = tmp_path / "big"
    with big.open("wb") as file:
        file.truncate(70 << 20)
    before = content_digest([big])
    with big.open("r+b") as file:
        file.seek(69 << 20)
        file.write(b"x")
    assert content_digest([big]) != before


def test_an_mp4_without_its_index_is_told(tmp_path: Path) -> None:
    whole = write_scene(tmp_path / "whole.mp4", "libx264", 4)
    data = whole.read_bytes()
    cut = tmp_path / "cut.mp4"
    cut.write_bytes(data[: data.index(b"moov") - 4])
    with pytest.raises(
        InputError, match="no index \\(moov\\): the recording or the copy"
    ) as caught:
        open_clip(cut)
    assert "Copy it again" in str(caught.value.remedy)
    text = tmp_path / "text.mp4"
    text.write_text("no film at all" * 40)
    with pytest.raises(InputError, match="not a readable video"):
        open_clip(text)
