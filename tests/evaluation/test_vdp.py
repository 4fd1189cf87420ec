"""ColorVideoVDP: JOD of films read frame by frame, heat maps in parts, and without the extra."""

from __future__ import annotations

import builtins
import json
import subprocess
import sys
import warnings
from collections.abc import Iterator
from fractions import Fraction
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from clips import SHARED, moving_scene, write_ffv1

from itmo_video import convert, make_settings
from itmo_video.cli.main import main
from itmo_video.errors import UsageError
from itmo_video.evaluation import fidelity, heat_film, vdp
from itmo_video.evaluation.agreement import Display
from itmo_video.output.gate import FILM, Gate

WIDTH, HEIGHT = 96, 64
needs_vdp = pytest.mark.skipif(find_spec("pycvvdp") is None, reason="extra vdp is not installed")


def _pictures(count: int, gain: float = 1.0) -> list[Any]:
    found = []
    for codes in moving_scene(count, width=WIDTH, height=HEIGHT):
        light = (codes.astype(np.float32) / 255) ** 2.4
        found.append(np.where(light > 0.5, light * np.float32(gain), light))
    return found


def _film(tests: list[Any], truths: list[Any]) -> vdp.Film:
    def pictures() -> vdp.Pictures:
        for test, truth in zip(tests, truths, strict=True):
            yield vdp.on_display(test, Display()), vdp.on_display(truth, Display())

    return vdp.Film(pictures, len(truths), (WIDTH, HEIGHT), Fraction(24))


@needs_vdp
def test_identical_films_have_jod_10() -> None:
    truth = _pictures(3)
    assert vdp.jod(_film(truth, truth), Display()) == pytest.approx(10, abs=1e-4)
    assert vdp.jod(_film(truth[:1], truth[:1]), Display()) == pytest.approx(10, abs=1e-4)


@needs_vdp
def test_frame_by_frame_is_as_all_at_once() -> None:
    """The metric's own array interface, set up as in its documentation, gives the same JOD."""
    test, truth = _pictures(9), _pictures(9, 3.0)
    found = vdp.jod(_film(test, truth), Display())
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        pycvvdp = vdp._import()
        metric = pycvvdp.cvvdp(
            display_photometry=pycvvdp.vvdp_display_photo_eotf(
                Y_peak=1000, contrast=1e6, EOTF="linear", E_ambient=5
            ),
            display_geometry=pycvvdp.vvdp_display_geometry([WIDTH, HEIGHT], ppd=45),
            quiet=True,
        )
        arrays = [np.clip(np.stack(x) * np.float32(203), 0.005, 1000) for x in (test, truth)]
        expected, _ = metric.predict(*arrays, dim_order="FHWC", frames_per_second=24)
    assert found == pytest.approx(float(expected), abs=1e-3)
    assert found < 9


@needs_vdp
def test_heat_maps_in_parts_are_those_of_the_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    test, truth = _pictures(20), _pictures(20, 3.0)
    parts = np.stack(list(vdp.heat_map(_film(test, truth), Display())))
    monkeypatch.setattr(vdp, "_CHUNK", 20)
    whole = np.stack(list(vdp.heat_map(_film(test, truth), Display())))
    assert parts.shape == (20, HEIGHT, WIDTH, 3)
    assert np.abs(parts.astype(int) - whole).max() <= 1
    assert np.ptp(whole) > 50, "nothing is seen in it"


@needs_vdp
def test_the_command_tells_jod_and_draws(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    clip = write_ffv1(tmp_path / "c.mkv", moving_scene(4, width=WIDTH, height=HEIGHT))
    for name, l_max in (("a", 2.0), ("b", 4.0)):
        convert(clip, tmp_path / name, make_settings(l_max=l_max))
    film = tmp_path / "heat.mp4"
    command = ["evaluate", str(tmp_path / "a"), "--reference", str(tmp_path / "b"),
               "--source", str(clip), "--vdp", "--heat-map", str(film), "--json"]  # fmt: skip
    assert main(command) == 0
    told = json.loads(capsys.readouterr().out)["fidelity"]
    assert 10 > told["test"]["jod"] > told["SDR as it is"]["jod"]
    with av.open(str(film)) as box:
        assert sum(1 for _ in box.decode(video=0)) == 4


def _without(monkeypatch: pytest.MonkeyPatch, missing: str) -> None:
    real = builtins.__import__

    def imported(name: str, *args: Any, **kwargs: Any) -> Any:
        if name.split(".")[0] == missing:
            raise ImportError(f"No module named {name!r}")
        return real(name, *args, **kwargs)

    monkeypatch.delitem(sys.modules, missing, raising=False)
    monkeypatch.setattr(builtins, "__import__", imported)


def test_without_the_extra_it_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _without(monkeypatch, "torch")
    with pytest.raises(UsageError, match=r"pip install .\.\[vdp\]"):
        vdp.require_vdp()
    clip = write_ffv1(tmp_path / "c.mkv", moving_scene(2))
    convert(clip, tmp_path / "a", make_settings())
    command = ["evaluate", str(tmp_path / "a"), "--reference", str(tmp_path / "a")]
    assert main(command) == 0, "the other figures need no extra"
    capsys.readouterr()
    assert main([*command, "--vdp"]) == 2
    assert "pip install '.[vdp]'" in capsys.readouterr().err
    assert main([*command, "--heat-map", "x.png"]) == 2
    assert main(["evaluate", str(tmp_path / "a"), "--source", str(clip), "--vdp"]) == 2


def test_a_film_of_odd_size_is_written_whole_or_not_at_all(tmp_path: Path) -> None:
    grey = np.full((31, 33, 3), 128, np.uint8)
    assert heat_film.write_film(Gate(tmp_path / "a.mp4", FILM), iter([grey] * 3), Fraction(24)) == 3
    with av.open(str(tmp_path / "a.mp4")) as box:
        frames = [frame.to_ndarray(format="rgb24") for frame in box.decode(video=0)]
    assert frames[0].shape == (32, 34, 3)
    assert np.abs(frames[0].astype(int) - 128).max() <= 3

    def breaking() -> Iterator[Any]:
        yield grey
        raise UsageError("it broke")

    with pytest.raises(UsageError, match="it broke"):
        heat_film.write_film(Gate(tmp_path / "b.mp4", FILM), breaking(), Fraction(24))
    assert [p.name for p in tmp_path.iterdir()] == ["a.mp4"], "a part of a film stays"


@needs_vdp
def test_pu21_is_the_metric_authors_own() -> None:
    """The table of PU21 that comes with ColorVideoVDP, whose authors are PU21's."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        vdp._import()
        import torch
        from pycvvdp.utils import PU

        nits = np.geomspace(0.005, 10000, 50)
        expected = PU().encode(torch.tensor(nits)).numpy()
    np.testing.assert_allclose(fidelity.pu21_encode(nits), expected, atol=1e-3)


@needs_vdp
@pytest.mark.shared
def test_jod_is_that_of_the_shared_tool(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    panorama = SHARED / "data" / "panoramas" / "workshop.hdr"
    pan_clip, tool = (SHARED / "tools" / name for name in ("pan_clip.py", "jod.py"))
    run = [sys.executable, str(pan_clip), str(panorama), str(tmp_path / "clip"), "--frames", "4"]
    subprocess.run(run, check=True)
    truth, film = tmp_path / "clip" / "truth", tmp_path / "clip" / "sdr.mkv"
    convert(film, tmp_path / "out", make_settings())
    told = subprocess.run(
        [sys.executable, str(tool), str(truth), str(tmp_path / "out")],
        check=True, capture_output=True, text=True,
    ).stdout  # fmt: skip
    command = ["evaluate", str(tmp_path / "out"), "--reference", str(truth), "--vdp", "--json"]
    assert main(command) == 0
    found = json.loads(capsys.readouterr().out)["fidelity"]["test"]["jod"]
    assert found == pytest.approx(float(told.split()[-1]), abs=0.01)
