"""HDR10+ and Dolby Vision by shots, and renditions for darker displays: against plain NumPy."""

from __future__ import annotations

import json
import warnings
from pathlib import Path
from typing import Any

import av
import numpy as np
import numpy.typing as npt
import pytest
from clips import moving_scene, write_ffv1

from itmo_video import PreviewOptions, convert, preview
from itmo_video.cli.main import main
from itmo_video.colour import transfer
from itmo_video.colour.primaries import rgb_to_rgb_matrix
from itmo_video.delivery.dynamic_metadata import level1
from itmo_video.delivery.eetf import bt2390_eetf, to_display
from itmo_video.delivery.shot_light import ShotLight, frame_tally
from itmo_video.delivery.ycbcr import Planes
from itmo_video.errors import UsageError
from itmo_video.output.exr import read_exr

with warnings.catch_warnings():  # it tells of every optional library that it misses
    warnings.simplefilter("ignore")
    import colour as colour_science

SHOTS = ((0, 3), (3, 5))
Nits = npt.NDArray[np.float64]


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("dynamic")
    return write_ffv1(folder / "c.mkv", moving_scene(5, cuts=(3,)))


@pytest.fixture(scope="module")
def folder(clip: Path) -> Path:
    out = clip.parent / "out"
    convert(clip, out)
    return out


@pytest.fixture(scope="module")
def nits(folder: Path) -> list[Nits]:
    """R, G and B in BT.2020 nits of each frame, (3, H, W)."""
    matrix = rgb_to_rgb_matrix("rec709", "rec2020")
    out = []
    for path in sorted(folder.glob("*.exr")):
        channels = read_exr(path).channels
        rgb = np.stack([channels[c].astype(np.float64) for c in "RGB"]) * 203.0
        out.append(np.clip(np.einsum("ij,jhw->ihw", matrix, rgb), 0, 1000.0))
    return out


@pytest.fixture(scope="module")
def documents(clip: Path) -> tuple[dict[str, Any], dict[str, Any], str]:
    plus, vision = clip.parent / "plus.json", clip.parent / "vision.json"
    flags = ["--hdr10plus", str(plus), "--dolby-vision", str(vision), "--quiet"]
    assert main(["analyse", str(clip), *flags]) == 0
    return json.loads(plus.read_text()), json.loads(vision.read_text()), plus.read_text()


def test_hdr10plus_has_the_published_structure(
    documents: tuple[dict[str, Any], dict[str, Any], str],
) -> None:
    """As hdr10plus_tool and x265 read it, within the bounds of ST 2094-40."""
    document, _, _ = documents
    assert set(document) == {"JSONInfo", "SceneInfo", "SceneInfoSummary", "ToolInfo"}
    assert document["JSONInfo"] == {"HDR10plusProfile": "A", "Version": "1.0"}
    assert document["SceneInfoSummary"] == {
        "SceneFirstFrameIndex": [first for first, _ in SHOTS],
        "SceneFrameNumbers": [end - first for first, end in SHOTS],
    }
    assert len(document["SceneInfo"]) == 5
    for index, entry in enumerate(document["SceneInfo"]):
        assert set(entry) == {
            "LuminanceParameters", "NumberOfWindows", "TargetedSystemDisplayMaximumLuminance",
            "SceneFrameIndex", "SceneId", "SequenceFrameIndex",
        }  # fmt: skip
        scene = int(index >= 3)
        assert (entry["SequenceFrameIndex"], entry["SceneId"]) == (index, scene)
        assert entry["SceneFrameIndex"] == index - SHOTS[scene][0]
        assert entry["NumberOfWindows"] == 1
        assert entry["TargetedSystemDisplayMaximumLuminance"] == 0, "profile A has no curves"
        light = entry["LuminanceParameters"]
        assert set(light) == {"AverageRGB", "LuminanceDistributions", "MaxScl"}
        spread = light["LuminanceDistributions"]
        assert spread["DistributionIndex"] == [1, 5, 10, 25, 50, 75, 90, 95, 99]
        values = spread["DistributionValues"]
        whole = [light["AverageRGB"], *light["MaxScl"], *values]
        assert all(type(value) is int and 0 <= value <= 100_000 for value in whole)
        assert len(light["MaxScl"]) == 3
        assert 0 <= values[2] <= 100, "the share of pixels up to 100 nits, in percent"
        rising = [values[0], *values[3:], values[1]]
        assert rising == sorted(rising)


def test_hdr10plus_numbers_are_those_of_the_pixels(
    documents: tuple[dict[str, Any], dict[str, Any], str], nits: list[Nits]
) -> None:
    for first, end in SHOTS:
        shot = np.stack(nits[first:end])
        largest = shot.max(axis=1).ravel()
        light = documents[0]["SceneInfo"][first]["LuminanceParameters"]
        assert light["AverageRGB"] == pytest.approx(largest.mean() * 10, abs=1)
        assert light["MaxScl"] == pytest.approx(
            [shot[:, i].max() * 10 for i in range(3)], rel=1e-3, abs=1
        )
        values = light["LuminanceDistributions"]["DistributionValues"]
        ranked = np.sort(largest)
        for at, percent in ((0, 1), (3, 25), (4, 50), (5, 75), (6, 90), (7, 95), (8, 99.98),
                            (1, 99.99)):  # fmt: skip
            expected = ranked[min(ranked.size - 1, int(np.ceil(ranked.size * percent / 100)) - 1)]
            assert values[at] == pytest.approx(expected * 10, abs=1.5), f"percentile {percent}"
        assert values[2] == pytest.approx(100 * (largest <= 100).mean(), abs=0.6)


def test_dolby_visions_level_1_is_that_of_the_pixels(
    documents: tuple[dict[str, Any], dict[str, Any], str], nits: list[Nits]
) -> None:
    _, document, _ = documents
    assert set(document) == {"cm_version", "profile", "length", "level6", "shots"}
    assert (document["cm_version"], document["profile"], document["length"]) == ("V40", "8.1", 5)
    largest = np.stack(nits).max(axis=1)
    assert document["level6"] == {
        "max_display_mastering_luminance": 1000,
        "min_display_mastering_luminance": 50,
        "max_content_light_level": round(largest.max()),
        "max_frame_average_light_level": round(max(frame.mean() for frame in largest)),
    }
    assert [(s["start"], s["duration"]) for s in document["shots"]] == [(0, 3), (3, 2)]
    for (first, end), shot in zip(SHOTS, document["shots"], strict=True):
        pq = 4095 * colour_science.models.eotf_inverse_ST2084(largest[first:end])
        (block,) = shot["metadata_blocks"]
        found = block["Level1"]
        assert found["min_pq"] == min(12, round(pq.min()))
        assert found["max_pq"] == pytest.approx(max(2081, pq.max()), abs=1)
        assert found["avg_pq"] == pytest.approx(max(1229, pq.mean()), abs=1)


def test_level_1_keeps_to_what_decoders_expect() -> None:
    for value in (0.0, 0.5, 5000.0):
        shot, plane = ShotLight(0), np.full((4, 4), value, np.float32)
        shot.add(frame_tally((plane, plane, plane)))
        found = level1(shot)
        assert found["min_pq"] <= 12
        assert 2081 <= found["max_pq"] <= 4095
        assert 1229 <= found["avg_pq"] < found["max_pq"]
    assert level1(shot)["max_pq"] == pytest.approx(4095 * 0.9259, abs=4), "PQ of 5000 nits"


def test_a_folder_gives_the_same_with_the_shots_of_an_analysis(
    clip: Path, folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str],
    documents: tuple[dict[str, Any], dict[str, Any], str],
) -> None:  # fmt: skip
    shots, plus = tmp_path / "shots.json", tmp_path / "plus.json"
    assert main(["analyse", str(clip), "--output", str(shots)]) == 0
    flags = ["--hdr10plus", str(plus), "--analysis", str(shots), "--hdr10"]
    assert main(["analyse", str(folder), *flags]) == 0
    assert plus.read_text() == documents[2]
    assert "--max-cll" in capsys.readouterr().out
    assert main(["analyse", str(folder), "--hdr10plus", str(tmp_path / "x.json")]) == 2
    assert "--analysis" in capsys.readouterr().err


def test_files_are_not_written_over_and_settings_not_ignored(
    clip: Path, folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    notes = tmp_path / "notes.json"
    notes.write_text("{}\n")
    for flags in (["--overwrite"], []):
        assert main(["analyse", str(clip), "--hdr10plus", str(notes), *flags]) == 5
    assert notes.read_text() == "{}\n"
    assert main(["analyse", str(folder), "--hdr10", "--peak-nits", "400"]) == 2
    assert main(["analyse", str(clip), "--analysis", str(notes)]) != 0
    assert main(["analyse", "-", "--hdr10plus", str(tmp_path / "x.json")]) == 2
    assert "a pipe can be read only once" in capsys.readouterr().err


def test_the_eetf_is_bt2390s() -> None:
    """Its closed form: unchanged below the knee, the peak to the peak, slope 1 at the knee."""
    source, display = 1000.0, 400.0
    top, target = (float(transfer.pq_code(np.array(n))) for n in (source, display))
    knee_nits = float(transfer.pq_nits(np.array((1.5 * target / top - 0.5) * top)))
    below = np.linspace(0.01, knee_nits * 0.999, 50)
    np.testing.assert_allclose(bt2390_eetf(below, source, display), below, rtol=1e-9)
    assert float(bt2390_eetf(np.array(source), source, display)) == pytest.approx(display)
    level = np.linspace(0.01, source, 4000)
    mapped = bt2390_eetf(level, source, display)
    assert (np.diff(mapped) > 0).all()
    assert (mapped <= np.minimum(level, display) + 1e-6).all()
    step = knee_nits * 1e-4
    after = float(bt2390_eetf(np.array(knee_nits + step), source, display))
    assert (after - knee_nits) / step == pytest.approx(1, abs=1e-2)
    np.testing.assert_array_equal(bt2390_eetf(level, source, 1000), level)


def test_to_a_darker_display_hue_is_kept_and_the_peak_not_passed() -> None:
    rng = np.random.default_rng(4)
    red, green, blue = (rng.uniform(0, 1000, (32, 48)).astype(np.float32) for _ in range(3))
    shown = np.stack(to_display((red, green, blue), 1000, 400))
    before = np.stack((red, green, blue))
    assert shown.max() <= 400
    np.testing.assert_allclose(
        shown.max(axis=0), bt2390_eetf(before.max(axis=0), 1000, 400), rtol=2e-3
    )
    ratio = shown / before
    assert np.ptp(ratio, axis=0).max() < 2e-3, "one factor a pixel"
    plane: Planes = (red, green, blue)
    assert to_display(plane, 1000, None) is plane


def test_a_rendition_for_400_nits_says_so(folder: Path, clip: Path, tmp_path: Path,
                                          nits: list[Nits]) -> None:  # fmt: skip
    film = tmp_path / "trim.mp4"
    done = preview(folder, film, options=PreviewOptions(display_peak=400, crf=4, speed="10"))
    largest = [bt2390_eetf(frame.max(axis=0), 1000, 400) for frame in nits]
    assert done.max_cll == pytest.approx(max(frame.max() for frame in largest), rel=3e-3)
    assert done.max_fall == pytest.approx(max(frame.mean() for frame in largest), rel=3e-3)
    data = film.read_bytes()
    assert (400 * 10000).to_bytes(4, "big") in data[data.index(b"mdcv") :][:32]
    with av.open(str(film)) as box:
        frame = next(box.decode(video=0))
        rows = np.frombuffer(memoryview(frame.planes[0]), np.uint16)
        luma = rows.reshape(frame.height, -1)[:, : frame.width]
    assert transfer.pq_nits(np.array((luma.max() - 64) / 876)) < 400 * 1.1
    again = tmp_path / "clip.mp4"
    same = preview(clip, again, options=PreviewOptions(display_peak=400, crf=4, speed="10"))
    assert (same.max_cll, same.max_fall) == (done.max_cll, done.max_fall)
    with pytest.raises(UsageError, match="already 1000"):
        preview(folder, tmp_path / "x.mp4", options=PreviewOptions(display_peak=1000))
    with pytest.raises(UsageError, match="to PQ only"):
        preview(folder, tmp_path / "x.mp4", options=PreviewOptions(view="sdr", display_peak=400))
