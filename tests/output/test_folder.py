"""folder: whose it is, what is in it, and that nothing of another's is touched."""

import json
import os
import random
import signal
import socket
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import pytest
from clips import REPOSITORY
from exr_pictures import HEADER, header, picture

from itmo_video.errors import InputError, OutputError
from itmo_video.output import atomic, disk_space, exr
from itmo_video.output.folder import OutputFolder
from itmo_video.output.manifest import MANIFEST_NAME, Manifest, read_manifest

ENVIRONMENT = {**os.environ, "PYTHONPATH": str(REPOSITORY)}
OURS = Manifest("a.mp4", "d1", "clip", {"alpha": 0.5, "operator": "banterle2006"})
STEMS = ["clip", "a b", "100%d %s", "x:y", "é文", "a.0001", "a[1]*?", "-rf", "{n}", "\udcff"]
linux_only = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")


def changed(**values):
    return Manifest(**{**vars(OURS), **values})


def start_python(code, *args):
    return subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(code), *map(str, args)],
        env=ENVIRONMENT,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )


@pytest.fixture
def out(tmp_path):
    return OutputFolder(tmp_path / "out", "clip")


def refused(out, manifest, *words, **options):
    before = {path: path.read_bytes() for path in out.path.iterdir() if path.is_file()}
    for act in (out.check, out.claim):
        with pytest.raises(OutputError) as caught:
            act(manifest, **options)
        assert caught.value.exit_code == 5
        assert caught.value.where
        assert caught.value.remedy
        assert all(word in str(caught.value) for word in words), str(caught.value)
    assert before == {path: path.read_bytes() for path in out.path.iterdir() if path.is_file()}


# Names


@pytest.mark.parametrize(
    ("number", "name"), [(0, "clip.0000.exr"), (42, "clip.0042.exr"), (123456, "clip.123456.exr")]
)
def test_frame_path(out, number, name):
    assert out.frame_path(number) == out.path / name


def test_wrong_names(tmp_path):
    for stem in ("", "a/b", "a\0b"):
        with pytest.raises(ValueError, match="file name"):
            OutputFolder(tmp_path, stem)
    with pytest.raises(ValueError, match="negative"):
        OutputFolder(tmp_path, "a").frame_path(-1)


@pytest.mark.parametrize("stem", STEMS)
def test_hostile_stems(tmp_path, stem):
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


def test_manifest_round_trip():
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
def test_bad_manifests(out, text):
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


def test_manifest_of_bytes_or_a_broken_link(out, tmp_path):
    out.path.mkdir()
    out.manifest_path.write_bytes(b"\xff\xfe")
    refused(out, OURS, "manifest")
    out.manifest_path.unlink()
    out.manifest_path.symlink_to(tmp_path / "nowhere")
    refused(out, OURS, "broken link")
    out.claim(OURS, overwrite=True)
    assert read_manifest(out.path) == OURS
    assert not (tmp_path / "nowhere").exists()


def test_settings_that_json_cannot_hold(out):
    with pytest.raises(TypeError):
        out.claim(changed(settings={"a": object()}))
    with pytest.raises(ValueError, match="JSON"):
        out.claim(changed(settings={"a": float("nan")}))
    assert os.listdir(out.path) == []


# Claims


def test_claim_makes_folder_and_manifest(tmp_path):
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


def test_tuples_in_settings_equal_the_lists_they_become(out):
    out.claim(changed(settings={"a": (1, 2)}))
    out.claim(changed(settings={"a": (1, 2)}))


def test_dotfiles_do_not_count(out):
    out.path.mkdir()
    (out.path / ".DS_Store").write_bytes(b"x")
    out.claim(OURS)
    assert (out.path / ".DS_Store").read_bytes() == b"x"


def test_nobodys_files_are_refused(out):
    out.path.mkdir()
    (out.path / "clip.0001.exr").write_bytes(b"mine")
    assert out.is_nobodys()
    refused(out, OURS, "not from a conversion")
    refused(out, OURS, "not from a conversion", update=True)
    out.claim(OURS, overwrite=True)
    assert (out.path / "clip.0001.exr").read_bytes() == b"mine"


def test_another_sources_folder_is_refused(out):
    out.claim(OURS)
    other = changed(source_name="b.mp4", source_digest="d2")
    refused(out, other, "a.mp4")
    refused(out, other, "a.mp4", update=True)
    out.claim(other, overwrite=True)
    assert read_manifest(out.path) == other


def test_other_settings_need_update_or_overwrite(out):
    for option in ("update", "overwrite"):
        out.claim(OURS, overwrite=True)
        other = changed(settings={"alpha": 0.7, "gain": True})
        refused(out, other, "--update", "alpha 0.5 -> 0.7", 'operator "banterle2006" -> unset')
        out.claim(other, **{option: True})
        assert read_manifest(out.path) == other


def test_many_differences_are_not_all_told(out):
    out.claim(changed(settings={f"s{n}": "x" * 500 for n in range(9)}))
    refused(out, changed(settings={}), "and 5 more")


def test_true_is_not_one(out):
    out.claim(changed(settings={"a": 1}))
    refused(out, changed(settings={"a": 2}), "a 1 -> 2")


def test_renamed_source(out):
    out.claim(OURS)
    out.claim(changed(source_name="moved/a.mp4"))
    refused(out, changed(stem="other"), "named 'clip'")


def test_a_file_in_the_folders_place(tmp_path):
    (tmp_path / "f").write_bytes(b"x")
    with pytest.raises(OutputError, match="not a folder"):
        OutputFolder(tmp_path / "f", "clip").claim(OURS)
    with pytest.raises(OutputError):
        OutputFolder(tmp_path / "f" / "g", "clip").claim(OURS)
    assert (tmp_path / "f").read_bytes() == b"x"


def test_file_systems_without_links(out, monkeypatch):
    def refuse(*_):
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "link", refuse)
    out.claim(OURS)
    assert os.listdir(out.path) == [MANIFEST_NAME]
    assert read_manifest(out.path) == OURS


def test_another_process_is_first(out, monkeypatch):
    """Between the look and the creation another source takes the folder: it keeps it."""
    real = OutputFolder._create_manifest
    other = changed(source_name="b.mp4", source_digest="d2")

    def late(self, data):
        real(self, other.to_json().encode())
        return real(self, data)

    monkeypatch.setattr(OutputFolder, "_create_manifest", late)
    with pytest.raises(OutputError, match="another source"):
        out.claim(OURS)
    assert read_manifest(out.path) == other
    assert os.listdir(out.path) == [MANIFEST_NAME]


def test_claimed_by_a_namesake_during_the_look(out, monkeypatch):
    """A listing may show another process's first frame and not yet its manifest."""
    out.path.mkdir()

    def late(self):
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
def test_claims_at_once(tmp_path, names):
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
            winner = read_manifest(place).source_digest
            expected = ["won" if name == winner else "lost" for name in names]
            assert results == expected
            assert len(os.listdir(place)) == 2  # the manifest and the winner's one frame
    finally:
        for worker in workers:
            worker.communicate(timeout=20)


# Frames


def test_states(out):
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


def test_verify(out):
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


# Temporary files


def temp_name(owner, serial=0):
    return f".itmo-{'-'.join(str(part) for part in owner)}-{serial}.tmp"


@pytest.fixture
def me():
    return atomic.this_process(os.getpid())


HOLD = """
    import os, sys
    from itmo_video.output import atomic
    path = atomic.temp_path(sys.argv[1] + "/clip.0001.exr")
    path.write_bytes(b"half")
    print(path.name, flush=True)
    sys.stdin.readline()
"""


@linux_only
def test_dead_owners_files_go_and_living_ones_stay(out):
    out.claim(OURS)
    dead, living = (start_python(HOLD, out.path) for _ in range(2))
    try:
        dead_name, living_name = (worker.stdout.readline().strip() for worker in (dead, living))
        own = atomic.temp_path(out.frame_path(3))
        own.write_bytes(b"half")
        assert out.sweep_temp_files() == 0
        dead.send_signal(signal.SIGKILL)
        os.waitid(os.P_PID, dead.pid, os.WEXITED | os.WNOWAIT)  # dead, though not yet buried
        assert out.sweep_temp_files() == 1
        assert {dead_name, living_name, own.name, MANIFEST_NAME} - set(os.listdir(out.path)) == {
            dead_name
        }
        living.communicate("\n", timeout=20)
        assert out.sweep_temp_files() == 1
        assert sorted(os.listdir(out.path)) == sorted([own.name, MANIFEST_NAME])
    finally:
        for worker in (dead, living):
            worker.kill()
            worker.communicate(timeout=20)


WRITE_ON = """
    import itertools, sys
    sys.path.insert(0, sys.argv[2])
    from exr_pictures import HEADER, picture
    from itmo_video.output import exr, folder
    out = folder.OutputFolder(sys.argv[1], "clip")
    rgb = picture(200, 300)
    print("ready", flush=True)
    for number in itertools.count():
        exr.write_exr(out.frame_path(number % 7), rgb, HEADER)
"""


@linux_only
def test_killed_at_any_moment_all_frames_are_whole(out):
    out.claim(OURS)
    rng = random.Random(0)
    for _ in range(6):
        worker = start_python(WRITE_ON, out.path, Path(__file__).parent)
        worker.stdout.readline()
        time.sleep(rng.uniform(0.01, 0.1))
        worker.kill()
        worker.communicate(timeout=20)
        numbers = out.frame_numbers()
        assert out.verify(dict.fromkeys(numbers, HEADER.fingerprint)) == []
        assert out.sweep_temp_files() <= 1
        assert len(os.listdir(out.path)) == len(numbers) + 1


@linux_only
def test_whose_temporary_files_go(out, me):
    out.claim(OURS)
    boot = atomic.boot_time_s()
    assert 0 < boot < out.manifest_path.stat().st_mtime
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    go = [
        temp_name(me._replace(pid=gone.pid)),
        temp_name(me._replace(start="1")),  # the number is used again
        temp_name(me._replace(boot="00000000", pid=1)),  # before the machine started anew
    ]
    stay = [
        temp_name(me),
        temp_name(me._replace(pid=1, start=atomic.process_stat(1)[1])),
        temp_name(me._replace(host="elsewhere", pid=gone.pid)),
        temp_name(me._replace(pids="1", pid=gone.pid)),  # in another container
        temp_name(me._replace(boot="00000000", pid=1), serial=1),  # a living namesake's
        temp_name(me._replace(boot="0", pid=gone.pid)),
        ".itmo-notes.tmp",
        ".clip.0001.exr.tmp",
        "clip.0001.exr",
    ]
    for name in go + stay:
        (out.path / name).write_bytes(b"")
    os.utime(out.path / go[2], (boot - 100, boot - 100))
    (out.path / temp_name(me._replace(pid=gone.pid), serial=9)).mkdir()
    assert out.sweep_temp_files() == len(go)
    left = set(os.listdir(out.path))
    assert left >= set(stay)
    assert not left & set(go)


def test_sweep_of_a_folder_that_is_not_there(out):
    assert out.sweep_temp_files() == 0
    assert out.frame_numbers() == []


def test_a_forked_child_has_its_own_name():
    code = """
        import os
        from itmo_video.output import atomic
        mother = atomic.temp_path("a").name
        reader, writer = os.pipe()
        if os.fork() == 0:
            os.write(writer, atomic.temp_path("a").name.encode())
            os._exit(0)
        os.wait()
        child = os.read(reader, 999).decode()
        print(atomic.temp_owner(mother).pid == os.getpid() != atomic.temp_owner(child).pid)
    """
    if not hasattr(os, "fork"):
        pytest.skip("no fork here")
    assert start_python(code).communicate(timeout=20)[0].strip() == "True"


def test_strange_host_names(monkeypatch):
    atomic.this_process.cache_clear()
    monkeypatch.setattr(socket, "gethostname", lambda: "my-host é/" + "x" * 300)
    name = atomic.temp_path("a").name
    atomic.this_process.cache_clear()
    assert len(name) < 200
    assert atomic.temp_owner(name).host.startswith("my_host___x")


# Space


def test_free_bytes(tmp_path):
    here = disk_space.free_bytes(tmp_path)
    assert here > 0
    assert disk_space.free_bytes(tmp_path / "not" / "there" / "yet") > 0
