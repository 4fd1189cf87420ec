"""The reproduction's scripts run on a folder that the user names, here with a made-up Memorial."""

from __future__ import annotations

import sys
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from clips import REPOSITORY

SCRIPTS = REPOSITORY / "docs" / "reproduction"
NAMES = ("common", "table1", "figures", "table2", "table2_vdp", "figure8")


@pytest.fixture
def data(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A data folder with one small picture, and the scripts on the path."""
    (tmp_path / "hdr_images").mkdir()
    (tmp_path / "panoramas").mkdir()
    rng = np.random.default_rng(0)
    grey = np.exp(rng.normal(-3.5, 1.5, (400, 360))).astype(np.float32)
    grey[80:150, 150:220] = 40
    cv2.imwrite(str(tmp_path / "hdr_images" / "memorial.hdr"), np.dstack([grey] * 3))
    monkeypatch.syspath_prepend(str(SCRIPTS))
    for name in NAMES:
        monkeypatch.delitem(sys.modules, name, raising=False)
    monkeypatch.setattr(sys, "argv", ["script", str(tmp_path)])
    monkeypatch.setattr(import_module("common"), "IMAGES", tmp_path / "images")
    return tmp_path


def test_table_1_tells_what_is_missing(data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    import_module("table1").main()
    out = capsys.readouterr().out
    assert out.count("| memorial.hdr |") == 2
    assert "| Tree.exr | not in" in out


def test_an_exposure_factor_is_found(data: Path) -> None:
    table1 = import_module("table1")
    world = np.full((4, 4), 0.25, np.float32)
    assert table1.exposure_for(world, 1.0, 0.0) == pytest.approx(4, rel=1e-5)
    assert table1.averages(4 * world, 0.0) == (pytest.approx(1), pytest.approx(1))


def test_the_tone_mapped_column_by_hand(data: Path) -> None:
    """An even grey lies at alpha whatever it is: 0.5 / 1.5."""
    table1 = import_module("table1")
    world = np.full((4, 4), 7.0, np.float32)
    np.testing.assert_allclose(table1.tone_mapped(world), 1 / 3, rtol=1e-5)
    two = np.repeat([1.0, 16.0], 100)  # the mean is 4: half-way, so that the estimate is 0.18
    scaled = 0.18 / 4 * two
    np.testing.assert_allclose(table1.tone_mapped(two, None), scaled / (1 + scaled), rtol=1e-5)


def test_figures_are_made(data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    import_module("figures").main()
    assert sorted(p.name for p in (data / "images").iterdir()) == [
        f"figure{i}.png" for i in (1, 3, 4, 5, 6)
    ]
    assert "figure 6" in capsys.readouterr().out


def test_table_2_compares_all_operators(data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    import_module("table2").main()
    out = capsys.readouterr().out
    assert "| memorial * |" in out
    for name in ("SDR as it is", "huo2014", "bt2446c", "banterle2007"):
        assert f"| {name} |" in out, f"{name} is not in the benchmark"


@pytest.mark.skipif(find_spec("pycvvdp") is None, reason="extra vdp is not installed")
def test_table_2_by_the_metric(data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = import_module("table2_vdp")
    grey = np.full((64, 96, 3), 0.2, np.float32)
    own, obvious, likely, certain, jod = table.judged(grey, grey, 4.93)
    assert (own, obvious, likely, certain) == (0, 0, 0, 0)
    assert jod == pytest.approx(10, abs=1e-3)
    half = grey.copy()
    half[:, :48] = 1.0
    own, _, likely, certain, jod = table.judged(half, grey, 4.93)
    assert own == 0.5
    assert 0.4 < certain <= likely <= 1, "a low frequency is seen beyond its edge"
    assert jod < 8
    table.main()
    assert capsys.readouterr().out.count("| memorial * |") == 3


def test_figure_8_sweeps_every_probe(
    data: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """With the panorama's mean over the sphere in place of renders; a lamp 16 times white."""
    panorama = np.tile(np.linspace(0.05, 0.25, 128, dtype=np.float32)[:, None], (64, 1, 3))
    panorama[24:40, 40:50] = 4
    (data / "panoramas_more").mkdir()
    for name in ("panoramas/lobby", "panoramas_more/x1", "panoramas_more/x2"):  # x2 is held out
        cv2.imwrite(str(data / f"{name}.hdr"), panorama)
    figure8 = import_module("figure8")
    shape = (figure8.ibl.HEIGHT, figure8.ibl.WIDTH, 3)

    def render(light: Any) -> Any:
        weight = np.broadcast_to(figure8._row_weight(light), light.shape[:2])
        return np.full(shape, np.average(light.mean(axis=-1), weights=weight))

    monkeypatch.setattr(figure8, "render_lit", render)
    monkeypatch.setattr(figure8, "SMALL", (shape[1], shape[0], 1))
    figure8.main()
    out = capsys.readouterr().out
    assert "| lobby |" in out
    rows = {
        tuple(cells[:2]): cells[2:]
        for cells in (
            [cell.strip() for cell in line.strip("|").split("|")] for line in out.splitlines()
        )
    }
    assert rows["20", "truth up to L'max"][:2] == ["0.00", "1"]
    assert float(rows["true mean", "SDR, what clips * factor"][0]) <= 0.01
    assert float(rows["1", "SDR as it is"][0]) > 0.3
