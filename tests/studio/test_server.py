"""The studio's HTTP surface: pictures, edits, and who is refused."""

from __future__ import annotations

import json
import os
import shutil
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from clips import moving_scene, write_ffv1
from served import BASE, JSON, PORT, TOKEN
from starlette.testclient import TestClient

from itmo_video import make_settings
from itmo_video.analysis.analyse import analyse
from itmo_video.conversion.convert import convert
from itmo_video.conversion.run_options import RunOptions
from itmo_video.output.exr import read_exr
from itmo_video.studio.desk import Desk
from itmo_video.studio.document import OF_OPENING, Document
from itmo_video.studio.server import make_app


def picture(client: TestClient, **asked: Any) -> np.ndarray[Any, Any]:
    answer = client.get("api/picture", params=asked)
    assert answer.status_code == 200, answer.text
    shape = [int(answer.headers[f"x-{name}"]) for name in ("channels", "height", "width")]
    return np.frombuffer(answer.content, np.float16).reshape(shape)


def edit(client: TestClient, do: str, **more: Any) -> dict[str, Any]:
    answer = client.post("api/edit", json={"do": do, **more})
    assert answer.status_code == 200, answer.text
    return dict(answer.json())


def analysed(client: TestClient) -> dict[str, Any]:
    for _ in range(200):
        state = client.get("api/state").json()
        if state["is_analysed"]:
            return dict(state)
        time.sleep(0.05)
    raise AssertionError("no cuts were found")


def test_what_it_shows_is_what_convert_writes(
    client: TestClient, clip: Path, tmp_path: Path
) -> None:
    assert [s["first"] for s in analysed(client)["document"]["shots"]] == [1, 9]
    edit(client, "set", values={"strength": 0.7})
    edit(client, "split", at=11)
    edit(client, "set", values={"peak_nits": 400}, shot=2)
    saved = client.post("api/save", json={"kind": "shots", "name": "list"}).json()
    saved_preset = client.post("api/save", json={"kind": "preset", "name": "look"}).json()
    from itmo_video import read_analysis

    run = RunOptions(analysis=read_analysis(saved["path"]), jobs=1)
    convert(clip, tmp_path / "out", make_settings(saved_preset["path"]), run)
    for index in (0, 7, 9, 10, 13):
        channels = read_exr(tmp_path / f"out/scene.{index + 1:04d}.exr").channels
        exr = np.stack([channels[name] for name in "RGB"])
        assert np.array_equal(picture(client, index=index), exr), index
    told = client.get("api/state").json()["command"]
    assert "look.toml" in told
    assert "list.json" in told


def test_a_and_b(client: TestClient) -> None:
    edit(client, "set", values={"operator": "banterle2006"})  # auto may find nothing to lift
    before = picture(client, index=3)
    edit(client, "keep_other")
    edit(client, "set", values={"peak_nits": 4000})
    assert np.array_equal(picture(client, index=3, slot="b", lane="b"), before)
    assert picture(client, index=3).max() > before.max()
    edit(client, "swap")
    assert np.array_equal(picture(client, index=3), before)


def test_b_kept_before_the_cuts_are_found_has_shots(
    clip: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    go = threading.Event()

    def later(*args: Any, **more: Any) -> Any:
        assert go.wait(60)
        return analyse(*args, **more)

    monkeypatch.setattr("itmo_video.studio.desk.analyse", later)
    with Desk(clip, Document("default"), tmp_path) as desk:
        client = TestClient(make_app(desk, TOKEN, PORT), base_url=f"{BASE}/{TOKEN}/")
        edit(client, "keep_other")
        go.set()
        shots = analysed(client)["document"]["shots"]
        assert edit(client, "swap")["document"]["shots"] == shots


def test_an_edit_names_a_shot_among_those_that_it_saw(client: TestClient) -> None:
    before = analysed(client)["document"]["layout"]
    split = edit(client, "split", at=11)["document"]["layout"]
    for do, more in (("set", {"values": {"strength": 0.3}}), ("preset", {"preset": "paper"}),
                     ("merge", {}), ("enable", {"on": False})):  # fmt: skip
        asked = {"do": do, "shot": 1, **more}
        stale = client.post("api/edit", json={**asked, "layout": before})
        assert stale.status_code == 422, do
        assert "shots have changed" in stale.json()["error"]
        assert client.post("api/edit", json={**asked, "layout": split}).status_code == 200, do
        edit(client, "undo")
    assert client.get("api/state").json()["document"]["layout"] == split


def test_variants_do_not_change_the_document(client: TestClient) -> None:
    state = analysed(client)
    tried = client.post("api/try", json={"index": 3, "preset": "paper", "scale": 2})
    assert tried.status_code == 200
    assert client.get("api/state").json()["version"] == state["version"]


def test_a_shot_has_a_preset_and_variants_of_its_own(client: TestClient) -> None:
    analysed(client)
    edit(client, "set", values={"operator": "banterle2006"})  # auto may find nothing to lift
    edit(client, "set", values={"strength": 0.7}, shot=0)
    for shot, strength in (("", 1), ("&shot=0", 0.7)):
        listed = client.get(f"api/variants?by=strength{shot}").json()
        assert [v["values"]["strength"] for v in listed if v["is_current"]] == [strength]
    assert client.get("api/variants?by=strength&shot=99").status_code == 422
    peaks: list[float] = []

    def tried(**more: Any) -> np.ndarray[Any, Any]:
        answer = client.post("api/try", json={"index": 3, "scale": 1, **more})
        assert answer.status_code == 200, answer.text
        peaks.append(203 * float(answer.headers["x-peak"]))
        return np.frombuffer(answer.content, np.float16)

    edit(client, "set", values={"peak_nits": 400}, shot=0)
    other = picture(client, index=10)
    clip, own = (tried(values={"peak_nits": 3000}, shot=shot) for shot in (None, 0))
    assert np.array_equal(clip, picture(client, index=3).ravel()), "the shot's own peak holds"
    assert own.max() > clip.max()
    assert peaks == [pytest.approx(400), pytest.approx(3000)]
    paper = tried(preset="paper", shot=0)
    state = edit(client, "preset", preset="paper", shot=0)
    assert [s["own"] for s in state["document"]["shots"]] == [{"preset": "paper"}, {}]
    assert np.array_equal(picture(client, index=3).ravel(), paper)
    assert np.array_equal(picture(client, index=10), other)
    for preset in ("x.toml", "nonsense", 3):
        asked = {"do": "preset", "preset": preset, "shot": 0}
        assert client.post("api/edit", json=asked).status_code == 422


def test_errors_are_told(client: TestClient) -> None:
    for path, asked in (
        ("api/edit", {"do": "set", "values": {"radius": -3}}),
        ("api/edit", {"do": "set", "values": {"nonsense": 1}}),
        ("api/edit", {"do": "set", "values": {"lights": 3}}),
        ("api/edit", {"do": "set", "values": {"operator_params": {"x": 1}}}),
        ("api/edit", {"do": "preset", "preset": "/etc/passwd.toml"}),
        ("api/edit", {"do": "preset", "preset": ["x"]}),
        ("api/edit", {"do": "explode"}),
        ("api/edit", {"do": "split", "at": "x"}),
        ("api/try", {"index": 1, "values": [1]}),
        ("api/try", {"index": 1, "preset": "../x"}),
        ("api/try", {"index": 1, "preset": "/work/a.toml"}),
        ("api/try", {"index": 1, "preset": 3}),
        ("api/save", {"kind": "preset", "name": "../../x"}),
        ("api/render", {"kind": "rm", "name": "x"}),
        ("api/render", {"kind": "convert", "name": "../x"}),
    ):
        answer = client.post(path, json=asked)
        assert answer.status_code == 422, (path, asked, answer.text)
        assert answer.json()["error"]
    for bad in ("index=99", "index=-1", "index=x", "index=1&scale=3", "index=1&lane=z"):
        assert client.get(f"api/picture?{bad}").status_code == 422, bad
    assert client.post("api/edit", content=b"[" * 9, headers=JSON).status_code == 422


TOLD = ("split", "merge", "enable")
ODD: tuple[Any, ...] = (
    True, -1, 1.5, 1e308, 10**30, float("nan"), "", "x", "\ud800", "\0", "x.toml", [], [1],
    ["gain"], [[]], {}, {"a": 1}, {"a": "x"}, {"a": [1]}, {"\ud800": 1},
)  # fmt: skip


@pytest.mark.parametrize("shot", [None, 0])
def test_nothing_that_is_asked_is_an_error_of_ours(client: TestClient, shot: int | None) -> None:
    """Where one is, the test client raises it."""
    analysed(client)
    names = ("operator", "peak_nits", "l_max", "lights", "expand_map", "layers", "operator_params",
             "owner", "preset", "self", "\udc80", *OF_OPENING)  # fmt: skip
    asked = [
        *({"do": "set", "values": {name: odd}, "shot": shot} for name in names for odd in ODD),
        *({"do": "set", "values": {"strength": 0.5}, "shot": odd} for odd in ODD),
        *({"do": "set", "values": odd} for odd in ODD),
        *({"do": "preset", "preset": odd, "shot": shot} for odd in ODD),
        *({"do": do, "shot": odd, "at": odd, "on": odd} for do in TOLD for odd in ODD),
    ]
    for body in asked:
        answer = client.post("api/edit", content=json.dumps(body), headers=JSON)
        assert answer.status_code in (200, 422), body
        if answer.status_code == 200:
            assert not set(body.get("values", ())) & {*OF_OPENING}
            assert client.get("api/state").status_code == 200, body
            edit(client, "undo")


@pytest.mark.parametrize("name", [None, 3, ["x"], {}, "", "a/b", "..", "\ud800", "x\0"])
def test_names_are_names(client: TestClient, tmp_path: Path, name: object) -> None:
    analysed(client)
    before = sorted(tmp_path.iterdir())
    for path, kind in (("save", "preset"), ("save", "shots"), ("render", "convert")):
        asked = json.dumps({"kind": kind, "name": name})
        answer = client.post(f"api/{path}", content=asked, headers=JSON)
        assert answer.status_code == 422, (path, kind)
        assert answer.json()["error"]
    assert sorted(tmp_path.iterdir()) == before


def test_a_file_that_is_there_is_a_question(client: TestClient, tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text("[settings]\nstrength = 0.5\n")
    asked = {"kind": "preset", "name": "mine"}
    answer = client.post("api/save", json=asked)
    assert (answer.status_code, list(answer.json())) == (200, ["exists"])
    assert "0.5" in (tmp_path / "mine.toml").read_text()
    assert "path" in client.post("api/save", json={**asked, "replace": True}).json()


def test_a_clips_name_may_be_any(clip: Path, tmp_path: Path) -> None:
    odd = tmp_path / os.fsdecode(b"caf\xe9\n<b>.mkv")
    try:
        shutil.copy(clip, odd)
    except OSError:
        pytest.skip("the file system takes UTF-8 names only")
    with Desk(odd, Document("default"), tmp_path) as desk:
        client = TestClient(make_app(desk, TOKEN, PORT), base_url=f"{BASE}/{TOKEN}/")
        assert client.get("api/about").json()["name"] == odd.name
        assert "caf\\xe9\\x0a<b>.mkv" in analysed(client)["command"]
        name = client.get("api/about").json()["suggested"]
        for kind in ("preset", "shots"):
            answer = client.post("api/save", json={"kind": kind, "name": name})
            assert "path" in answer.json(), answer.text


def test_a_clip_that_is_replaced_is_told(clip: Path, tmp_path: Path) -> None:
    copy = Path(shutil.copy(clip, tmp_path / "copy.mkv"))
    with Desk(copy, Document("default"), tmp_path) as desk:
        client = TestClient(make_app(desk, TOKEN, PORT), base_url=f"{BASE}/{TOKEN}/")
        analysed(client)
        picture(client, index=3)
        write_ffv1(copy, moving_scene(14, width=96, height=64, cuts=(5,)))
        edit(client, "set", values={"range": "limited"})
        for path in ("api/picture?index=3", "api/picture?index=3&part=sdr", "api/lights?index=3"):
            answer = client.get(path)
            assert answer.status_code == 422, path
            assert "changed since the studio opened it" in answer.json()["error"]
        answer = client.post("api/render", json={"kind": "convert", "name": "out"})
        assert answer.status_code == 422
        copy.unlink()
        assert "removed" in client.get("api/picture?index=3").json()["error"]


def test_sdr_pictures_say_what_they_are_made_by(client: TestClient) -> None:
    """One key, one picture: by the clip's reading, and by the shot's own over-white."""

    def key(state: dict[str, Any], shot: int) -> str:
        return str(state["document"]["shots"][shot]["source"])

    before = analysed(client)
    assert key(before, 0) == key(edit(client, "set", values={"strength": 0.3}), 0)
    own = edit(client, "set", values={"over_white": "keep"}, shot=1)
    assert key(own, 0) == key(before, 0) != key(own, 1)
    clip = edit(client, "set", values={"range": "limited"})
    assert len({key(state, shot) for state in (own, clip) for shot in (0, 1)}) == 4
    for index, shot in ((0, 0), (9, 1)):
        answer = client.get(f"api/picture?index={index}&part=sdr")
        assert answer.headers["x-made-by"] == key(clip, shot)
    assert client.get("api/picture?index=0").headers["x-made-by"] == str(clip["version"])
