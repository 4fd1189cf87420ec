"""The studio renders: one at a time, cancelled, failed and told; pages do not pile up work."""

from __future__ import annotations

import errno
import os
import signal
import threading
import time
from functools import partial
from pathlib import Path

import pytest
from starlette.testclient import TestClient

from itmo_video import make_settings
from itmo_video.conversion.convert import convert
from itmo_video.conversion.run_options import RunOptions
from itmo_video.errors import OutputError, UsageError
from itmo_video.output.atomic import output_error
from itmo_video.output.gate import Gate
from itmo_video.studio.desk import Desk
from itmo_video.studio.document import set_values
from itmo_video.studio.latest import Latest, Stale
from itmo_video.studio.running import for_page
from itmo_video.studio.session import StaleError


def test_a_render_goes_to_its_end(client: TestClient, tmp_path: Path) -> None:
    client.post("api/render", json={"kind": "convert", "name": "out"})
    assert client.post("api/render", json={"kind": "convert", "name": "o2"}).status_code == 422
    for _ in range(600):
        progress = client.get("api/state").json()["render"]
        if progress["state"] != "running":
            break
        time.sleep(0.1)
    assert progress["state"] == "done", progress
    assert (progress["done"], progress["of"]) == (14, 14)
    assert len(list((tmp_path / "out").glob("*.exr"))) == 14


def state_of(desk: Desk) -> str:
    return desk.runner.progress.state


def test_a_look_is_rendered_again_where_another_was(desk: Desk, clip: Path, tmp_path: Path) -> None:
    convert(clip, tmp_path / "out", make_settings(), RunOptions(frames="1", jobs=1))
    desk.edit(lambda document: set_values(document, {"strength": 0.4}, None))
    desk.render("convert", "out")
    assert desk.runner._follower is not None
    desk.runner._follower.join(60)
    assert state_of(desk) == "failed"
    assert "Tick “Re-render what exists" in desk.runner.progress.message
    assert "--" not in desk.runner.progress.message, "flags cannot be given on the page"
    desk.render("convert", "out", again=True)
    desk.runner._follower.join(60)
    assert state_of(desk) == "done", desk.runner.progress.message


@pytest.mark.parametrize("kind", ["convert", "preview"])
def test_remedies_can_be_had_on_the_page(kind: str) -> None:
    said = ["x: why", "Choose another folder, or use --overwrite.", "Use --update, --overwrite."]
    told = for_page(said, kind)
    assert told[0] == "x: why"
    assert "--" not in "".join(told)
    assert ("Tick" in told[1]) == (kind == "preview")


def test_a_full_disk_is_told_so_that_one_can_go_on(
    desk: Desk, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(self: Gate, data: bytes) -> None:
        raise output_error(OSError(errno.ENOSPC, "full"), tmp_path)

    monkeypatch.setattr(Gate, "write", full)
    with pytest.raises(OutputError) as raised:
        desk.save("preset", "look", False)
    assert raised.value.remedy == "Free some space, then save again."


def test_a_render_is_cancelled_and_failures_are_told(desk: Desk, tmp_path: Path) -> None:
    desk.render("convert", "out")
    desk.runner.close()
    assert state_of(desk) == "cancelled"
    (tmp_path / "strange").mkdir()
    (tmp_path / "strange" / "file").write_text("mine")
    desk.render("convert", "strange")
    assert desk.runner._follower is not None
    desk.runner._follower.join(60)
    assert state_of(desk) == "failed"
    assert "not from a conversion" in desk.runner.progress.message


def test_one_render_at_a_time_also_after_a_cancel(desk: Desk) -> None:
    desk.render("convert", "out")
    assert desk.runner._process is not None
    desk.runner._process.send_signal(signal.SIGSTOP)  # so that it cannot end before it is asked
    os.waitid(os.P_PID, desk.runner._process.pid, os.WSTOPPED | os.WNOWAIT)
    desk.runner.cancel()
    with pytest.raises(UsageError, match="running"):
        desk.render("convert", "out")
    desk.runner._process.send_signal(signal.SIGCONT)
    assert desk.runner._follower is not None
    desk.runner._follower.join(60)
    assert desk.runner.progress.state in ("cancelled", "done")
    desk.render("convert", "out")


def test_pages_do_not_overtake_each_other() -> None:
    latest, go = Latest(("a", "b")), threading.Event()
    ran: list[str] = []
    running = latest.submit("a", lambda stale: go.wait(60) and stale(), "one")
    while latest._running is None:
        time.sleep(0.001)

    def note(what: str, stale: Stale) -> None:
        ran.append(what)

    waiting = [
        latest.submit("a", partial(note, f"{p}{n}"), p) for n in range(5) for p in ("two", "three")
    ]
    go.set()
    assert running.result(60) is False, "another page overtook it"
    for future in waiting[-2:]:
        future.result(60)
    assert ran == ["two4", "three4"]
    begun, hold = threading.Event(), threading.Event()
    latest.submit("a", lambda stale: (begun.set(), hold.wait(60)))  # type: ignore[func-returns-value]  # in order
    assert begun.wait(60)  # else it may be overtaken itself
    many = [latest.submit("a", lambda stale: 1, str(n)) for n in range(200)]
    hold.set()
    assert many[-1].result(60) == 1
    assert sum(isinstance(f.exception(60), StaleError) for f in many) >= 200 - 65
    latest.close()


def test_many_clicks_pile_up_no_work() -> None:
    latest, go = Latest(("a", "b")), threading.Event()
    ran: list[int] = []

    def work(n: int, stale: Stale | None = None) -> int:
        go.wait(5)
        ran.append(n)
        return n

    first = latest.submit("a", lambda stale: (work(0), stale())[1])
    while latest._running is None:
        time.sleep(0.001)
    futures = [latest.submit("a", partial(work, n)) for n in range(1, 200)]
    other = latest.submit("b", lambda stale: work(-1))
    go.set()
    assert first.result(5) is True, "it was not told that it is overtaken"
    assert futures[-1].result(5) == 199
    assert other.result(5) == -1
    assert ran == [0, 199, -1]
    assert sum(isinstance(f.exception(5), StaleError) for f in futures[:-1]) == 198
    latest.close()
    with pytest.raises(StaleError):
        latest.submit("a", lambda stale: work(1)).result(5)
