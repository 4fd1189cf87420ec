"""folder: whose it is, what is in it, and that nothing of another's is touched."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest
from exr_pictures import HEADER, header, picture
from folders import OURS, changed, refused

from itmo_video.errors import InputError
from itmo_video.output import disk_space, exr
from itmo_video.output.folder import OutputFolder
from itmo_video.output.manifest import Manifest, read_manifest

STEMS = ["clip", "a b", "100%d %s", "x:y", "é文", "a.0001", "a[1]*?", "-rf", "{n}", "\udcff"]


# Names


@pytest.mark.parametrize(
    ("number", "name"), [(0, "clip.0000.exr"), (42, "clip.0042.exr"), (123456, "clip.123456.exr")]
)
def test_frame_path(out: OutputFolder, number: int, name: str) -> None:
    assert out.frame_path(number) == out.path / name


def test_wrong_names(tmp_path: Path) -> None:
    for stem in ("", "a/b", "a\0b"):
        with pytest.raises(ValueError, match="file name"):
            OutputFolder(tmp_path, stem)
    with pytest.raises(ValueError, match="negative"):
        OutputFolder(tmp_path, "a").frame_path(-1)


@pytest.mark.parametrize("stem", STEMS)
def test_hostile_stems(tmp_path: Path, stem: str) -> None:
    out = OutputFolder(tmp_path / "out", stem)
    manifest = changed(stem=stem, source_name=f"{stem}.mp4")
    out.claim(manifest)
    out.claim(manifest)
    exr.write_exr(out.frame_path(7), picture(2, 2), HEADER)
    exr.write_exr(out.frame_path(70000), picture(2, 2), HEADER)
    for stray in (f"{stem}.00007.exr", f"{stem}.7.exr", f"x{stem}.0008.exr", f"{stem}.0009.exr.x"):
        (out.path / stray).write_bytes(b"")
    assert out.frame_numbers() == [7, 70000]
    assert out.state(7, HEADER.fingerprint) == "whole"
    assert read_manifest(out.path) == manifest


# The manifest


def test_manifest_round_trip() -> None:
    manifest = changed(settings={"a": [1, 2.5, None, True], "b": {"c": "é"}, "z": 0.1 + 0.2})
    assert Manifest.from_json(manifest.to_json()) == manifest
    assert (
        manifest.to_json() == changed(settings=dict(reversed(manifest.settings.items()))).to_json()
    )


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "[]",
        "null",
        "[" * 100_000,
        "{}",
        OURS.to_json()[:-9],
        OURS.to_json().replace('"format": 2', '"format": 1'),
        OURS.to_json().replace('"format": 2', '"format": true'),
        OURS.to_json().replace('"d1"', "1"),
        OURS.to_json().replace('"stem"', '"stern"'),
        json.dumps({**vars(OURS), "settings": []}),
    ],
)
def test_bad_manifests(out: OutputFolder, text: str) -> None:
    with pytest.raises(InputError, match="manifest"):
        Manifest.from_json(text)
    out.path.mkdir()
    out.manifest_path.write_text(text)
    with pytest.raises(InputError) as caught:
        read_manifest(out.path)
    assert caught.value.where == str(out.manifest_path)
    refused(out, OURS, "--overwrite")
    refused(out, OURS, "--overwrite", update=True)
    out.claim(OURS, overwrite=True)
    assert read_manifest(out.path) == OURS


def test_manifest_of_bytes_or_a_broken_link(out: OutputFolder, tmp_path: Path) -> None:
    out.path.mkdir()
    out.manifest_path.write_bytes(b"\xff\xfe")
    refused(out, OURS, "manifest")
    out.manifest_path.unlink()
    out.manifest_path.symlink_to(tmp_path / "nowhere")
    refused(out, OURS, "broken link")
    out.claim(OURS, overwrite=True)
    assert read_manifest(out.path) == OURS
    assert not (tmp_path / "nowhere").exists()


def test_settings_that_json_cannot_hold(out: OutputFolder) -> None:
    with pytest.raises(TypeError):
        out.claim(changed(settings={"a": object()}))
    with pytest.raises(ValueError, match="JSON"):
        out.claim(changed(settings={"a": float("nan")}))
    assert os.listdir(out.path) == []


# Frames


def test_states(out: OutputFolder) -> None:
    fingerprint = HEADER.fingerprint
    assert out.state(1, fingerprint) == "missing"
    out.claim(OURS)
    assert out.state(1, fingerprint) == "missing"
    exr.write_exr(out.frame_path(1), picture(40, 30), HEADER)
    assert out.state(1, fingerprint) == "whole"
    assert out.state(1, "another") == "other"
    data = out.frame_path(1).read_bytes()
    for cut in (0, 10, 300, len(data) // 2, len(data) - 1):
        out.frame_path(1).write_bytes(data[:cut])
        assert out.state(1, fingerprint) == "damaged"
        assert out.state(1, "another") == "damaged"
    out.frame_path(1).unlink()
    out.frame_path(1).mkdir()
    assert out.state(1, fingerprint) == "damaged"


def test_verify(out: OutputFolder) -> None:
    out.claim(OURS)
    fingerprints = {number: f"{number:064x}" for number in range(1, 7)}
    for number, fingerprint in fingerprints.items():
        exr.write_exr(out.frame_path(number), picture(9, 9), header(fingerprint=fingerprint))
    assert out.verify(fingerprints) == []
    out.frame_path(2).write_bytes(b"")
    out.frame_path(3).write_bytes(out.frame_path(3).read_bytes()[:-1])
    out.frame_path(4).unlink()
    exr.write_exr(out.frame_path(6), picture(9, 9), HEADER)
    faults = out.verify(fingerprints)
    assert [path for path, _ in faults] == [out.frame_path(n) for n in (2, 3, 4, 6)]
    words = ("damaged", "damaged", "missing", "--update")
    assert all(word in problem for (_, problem), word in zip(faults, words, strict=True))
    out.manifest_path.write_text("{}")
    assert out.verify({})[0][0] == out.manifest_path
    out.manifest_path.unlink()
    assert out.verify({}) == [(out.manifest_path, "missing")]


# Space


def test_free_bytes(tmp_path: Path) -> None:
    here = disk_space.free_bytes(tmp_path)
    assert here > 0
    assert disk_space.free_bytes(tmp_path / "not" / "there" / "yet") > 0
