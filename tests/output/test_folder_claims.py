"""Whose a folder is: claims, one after another and at once."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from folders import OURS, changed, refused, start_python

from itmo_video.errors import OutputError
from itmo_video.output.folder import OutputFolder
from itmo_video.output.manifest import MANIFEST_NAME, read_manifest

# Claims


def test_claim_makes_folder_and_manifest(tmp_path: Path) -> None:
    out = OutputFolder(tmp_path / "a" / "b", "clip")
    assert read_manifest(out.path) is None
    assert not out.is_nobodys()
    out.check(OURS)
    assert not out.path.exists()
    out.claim(OURS)
    assert os.listdir(out.path) == [MANIFEST_NAME]
    assert out.manifest_path.read_text() == OURS.to_json()
    stamp = out.manifest_path.stat().st_mtime_ns
    out.claim(OURS)
    out.claim(changed(settings={**OURS.settings}), update=True)
    assert out.manifest_path.stat().st_mtime_ns == stamp


def test_tuples_in_settings_equal_the_lists_they_become(out: OutputFolder) -> None:
    out.claim(changed(settings={"a": (1, 2)}))
    out.claim(changed(settings={"a": (1, 2)}))


def test_dotfiles_do_not_count(out: OutputFolder) -> None:
    out.path.mkdir()
    (out.path / ".DS_Store").write_bytes(b"x")
    out.claim(OURS)
    assert (out.path / ".DS_Store").read_bytes() == b"x"


def test_nobodys_files_are_refused(out: OutputFolder) -> None:
    out.path.mkdir()
    (out.path / "clip.0001.exr").write_bytes(b"mine")
    assert out.is_nobodys()
    refused(out, OURS, "not from a conversion")
    refused(out, OURS, "not from a conversion", update=True)
    out.claim(OURS, overwrite=True)
    assert (out.path / "clip.0001.exr").read_bytes() == b"mine"


def test_another_sources_folder_is_refused(out: OutputFolder) -> None:
    out.claim(OURS)
    other = changed(source_name="b.mp4", source_digest="d2")
    refused(out, other, "a.mp4")
    refused(out, other, "a.mp4", update=True)
    out.claim(other, overwrite=True)
    assert read_manifest(out.path) == other


def test_other_settings_need_update_or_overwrite(out: OutputFolder) -> None:
    for option in ("update", "overwrite"):
        out.claim(OURS, overwrite=True)
        other = changed(settings={"alpha": 0.7, "gain": True})
        refused(out, other, "--update", "alpha 0.5 -> 0.7", 'operator "banterle2006" -> unset')
        out.claim(other, **{option: True})
        assert read_manifest(out.path) == other


def test_many_differences_are_not_all_told(out: OutputFolder) -> None:
    out.claim(changed(settings={f"s{n}": "x" * 500 for n in range(9)}))
    refused(out, changed(settings={}), "and 5 more")


def test_true_is_not_one(out: OutputFolder) -> None:
    out.claim(changed(settings={"a": 1}))
    refused(out, changed(settings={"a": 2}), "a 1 -> 2")


def test_renamed_source(out: OutputFolder) -> None:
    out.claim(OURS)
    out.claim(changed(source_name="moved/a.mp4"))
    refused(out, changed(stem="other"), "named 'clip'")


def test_a_file_in_the_folders_place(tmp_path: Path) -> None:
    (tmp_path / "f").write_bytes(b"x")
    with pytest.raises(OutputError, match="not a folder"):
        OutputFolder(tmp_path / "f", "clip").claim(OURS)
    with pytest.raises(OutputError):
        OutputFolder(tmp_path / "f" / "g", "clip").claim(OURS)
    assert (tmp_path / "f").read_bytes() == b"x"


def test_file_systems_without_links(out: OutputFolder, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "link", refuse)
    out.claim(OURS)
    assert os.listdir(out.path) == [MANIFEST_NAME]
    assert read_manifest(out.path) == OURS


def test_another_process_is_first(out: OutputFolder, monkeypatch: pytest.MonkeyPatch) -> None:
    """Between the look and the creation another source takes the folder: it keeps it."""
    real = OutputFolder._create_manifest
    other = changed(source_name="b.mp4", source_digest="d2")

    def late(self: OutputFolder, data: bytes) -> bool:
        real(self, other.to_json().encode())
        return real(self, data)

    monkeypatch.setattr(OutputFolder, "_create_manifest", late)
    with pytest.raises(OutputError, match="another source"):
        out.claim(OURS)
    assert read_manifest(out.path) == other
    assert os.listdir(out.path) == [MANIFEST_NAME]


def test_claimed_by_a_namesake_during_the_look(
    out: OutputFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A listing may show another process's first frame and not yet its manifest."""
    out.path.mkdir()

    def late(self: OutputFolder) -> bool:
        self._create_manifest(OURS.to_json().encode())
        return True

    monkeypatch.setattr(OutputFolder, "is_nobodys", late)
    out.claim(OURS)
    assert os.listdir(out.path) == [MANIFEST_NAME]


CLAIM_AND_WRITE = """
    import sys
    from itmo_video.errors import OutputError
    from itmo_video.output.folder import OutputFolder
    from itmo_video.output.manifest import Manifest
    place, who, rounds = sys.argv[1:]
    print("ready", flush=True)
    for number in range(int(rounds)):
        sys.stdin.readline()
        out = OutputFolder(f"{place}/{number}/out", "clip")
        try:
            out.claim(Manifest(f"{who}.mp4", who, "clip", {}))
            out.frame_path(len(who)).write_bytes(b"")
            print("won", flush=True)
        except OutputError:
            print("lost", flush=True)
"""


@pytest.mark.parametrize("names", [["same"] * 4, ["a", "bb", "ccc", "dddd"]])
def test_claims_at_once(tmp_path: Path, names: list[str]) -> None:
    rounds = 25
    workers = [start_python(CLAIM_AND_WRITE, tmp_path, name, rounds) for name in names]
    try:
        assert all(worker.stdout.readline() == "ready\n" for worker in workers)
        for number in range(rounds):
            for worker in workers:
                worker.stdin.write("go\n")
                worker.stdin.flush()
            results = [worker.stdout.readline().strip() for worker in workers]
            place = tmp_path / str(number) / "out"
            manifest = read_manifest(place)
            assert manifest is not None
            winner = manifest.source_digest
            expected = ["won" if name == winner else "lost" for name in names]
            assert results == expected
            assert len(os.listdir(place)) == 2  # the manifest and the winner's one frame
    finally:
        for worker in workers:
            worker.communicate(timeout=20)
