"""Evaluation of folders: which frame is compared with which, by what weights, in what memory."""

from __future__ import annotations

import gc
import json
import weakref
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from clips import moving_scene, write_ffv1

from itmo_video import RunOptions, convert, make_settings
from itmo_video.cli.main import main
from itmo_video.cli.option_flags import named_number
from itmo_video.errors import InputError, UsageError
from itmo_video.evaluation import agreement, fidelity, folders, sequence
from itmo_video.evaluation.agreement import SDR, TEST, Display
from itmo_video.evaluation.folders import ExrSequence, Pair, open_sequence, pair
from itmo_video.output.converted import Converted
from itmo_video.output.manifest import Manifest
from itmo_video.settings import Settings


@pytest.fixture(scope="module")
def base(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A clip of 14 frames with a cut at 7, converted whole and in part."""
    base = tmp_path_factory.mktemp("evaluate")
    clip = write_ffv1(base / "c.mkv", moving_scene(14, cuts=(7,)))
    settings = make_settings(layers=("expand_map",), compression="none", key_interval=2)
    convert(clip, base / "whole", settings)
    convert(clip, base / "part", settings, RunOptions(frames="1009-1012", start_number=1001))
    return base


def test_a_range_is_compared_with_its_own_frames(base: Path) -> None:
    rows = agreement.compare_sequences(base / "part", base / "whole", base / "c.mkv", Display())
    assert rows[TEST].figures["pq_psnr_db"] == np.inf, "other frames of the truth were taken"
    whole = agreement.compare_sequences(base / "whole", base / "whole", base / "c.mkv", Display())
    assert rows[SDR].worst["pq_psnr_db"].number in range(1009, 1013)
    assert rows[SDR].figures["pq_psnr_db"] != whole[SDR].figures["pq_psnr_db"]
    assert 20 < rows[SDR].figures["pq_psnr_db"] < 60, "frames of the clip are off"


def test_the_flicker_of_a_range_is_that_of_its_own_frames(base: Path) -> None:
    (part,) = sequence.flicker_by_shot(base / "part", base / "c.mkv", None)
    assert (part.first, part.last) == (1009, 1012), "numbered as the files are"
    assert part.figures["background_drift"] < 0.1, "gains against other frames of the clip"


def test_the_key_interval_is_the_folders(base: Path) -> None:
    by = {n: sequence.over_shots(sequence.flicker_by_shot(base / "whole", base / "c.mkv", None, n))
          for n in (None, 2, 3)}  # fmt: skip
    assert by[None] == by[2]
    assert by[None]["key_to_key"] != by[3]["key_to_key"]


def _files(folder: Path, numbers: range) -> ExrSequence:
    folder.mkdir()
    for number in numbers:
        (folder / f"any.{number:03d}.exr").touch()
    return open_sequence(folder)


def test_files_of_nobody_are_matched_by_number_or_by_position(tmp_path: Path) -> None:
    some = _files(tmp_path / "some", range(5, 9))
    truth = _files(tmp_path / "truth", range(1, 13))
    later = _files(tmp_path / "later", range(1001, 1005))
    found = pair(some, truth)
    assert next((p.index, p.number, p.truth.name) for p in found) == (4, 5, "any.005.exr")
    assert next(p.truth.name for p in pair(later, some)) == "any.005.exr"
    with pytest.raises(InputError, match="frames 5-12 are not in the reference"):
        pair(truth, some)
    manifest = Manifest("c.mkv", "0", "any", {})
    folder = Converted(some.path, manifest, Settings(), (), 1, some.files)
    made = ExrSequence(some.path, some.files, 1, folder)
    assert next((p.index, p.truth.name) for p in pair(made, truth)) == (4, "any.005.exr")
    assert pair(made, some)[0] == Pair(4, 5, 5, (made, some))


def test_a_folder_without_files_is_told(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no EXR files"):
        open_sequence(tmp_path)


def test_sdr_and_exr_are_weighed_alike(tmp_path: Path) -> None:
    """Pure red is 0.2126 of white on both sides: eq. 1's 0.213 would be 0.003 stops more."""
    red = np.zeros((24, 32, 3), np.uint8)
    red[..., 0] = 255
    clip = write_ffv1(tmp_path / "red.mkv", [red] * 2)
    convert(clip, tmp_path / "out", make_settings(strength=0.0))
    rows = agreement.compare_sequences(tmp_path / "out", tmp_path / "out", clip, Display())
    assert rows[SDR].figures["pq_psnr_db"] == np.inf
    rgb = folders.read_rgb(tmp_path / "out" / "red.0001.exr")
    np.testing.assert_allclose(sequence.luminance(rgb), 0.2126, rtol=1e-6)


def test_primaries_do_not_matter(tmp_path: Path) -> None:
    clip = write_ffv1(tmp_path / "c.mkv", moving_scene(2))
    for name in ("rec709", "rec2020", "acescg"):
        convert(clip, tmp_path / name, make_settings(primaries=name))
    for name in ("rec2020", "acescg"):
        rows = agreement.compare_sequences(tmp_path / name, tmp_path / "rec709", None, Display())
        assert rows[TEST].figures["pq_psnr_db"] > 60, "read as if it had BT.709's primaries"


def test_an_agreement_by_hand() -> None:
    """Squared errors are averaged, not decibels; zones by their pixels."""
    truth, tally = np.full((16, 16), 100.0), agreement.Tally()
    for number, test in ((7, truth), (8, 2 * truth)):
        tally.add(number, fidelity.compare(test, truth))
    one = fidelity.pq_psnr_db(2 * truth, truth)
    found = tally.agreement()
    assert found.figures["pq_psnr_db"] == pytest.approx(one + 10 * np.log10(2))
    assert found.figures["visible_share"] == 0.5
    assert found.figures["peak_stops"] == pytest.approx(0.5)
    assert found.worst["pq_psnr_db"] == agreement.Worst(8, one)
    zone = next(z for z in found.zones if z.share)
    assert (zone.lower, zone.share, zone.mean) == pytest.approx((-2, 1, 0.5))


def test_a_shot_of_any_length_holds_two_pictures() -> None:
    running = sequence._Running(0, [(0.0, 0.0)] * 40, 5)
    alive: list[Any] = []
    for index in range(40):
        picture = np.zeros((8, 8), np.float32)
        alive.append(weakref.ref(picture))
        seen = sequence._Seen(
            index, (1.0, 1.0), picture.astype(np.uint8), picture, None, 0.0, 1.0, index == 0
        )
        running.add(seen)
        del picture, seen
    gc.collect()
    assert sum(ref() is not None for ref in alive) <= 2, "the shot's pictures are kept"
    assert running.shot().figures["noise_gain"] == 1


def test_white_is_the_folders_own(base: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = base / "white100"
    convert(base / "c.mkv", out, make_settings(white_nits=100.0), RunOptions(frames="1-2"))
    assert main(["evaluate", str(out), "--reference", str(base / "whole"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["display"]["white_nits"] == 100
    assert told["display"]["peak_nits"] == 1000


def test_limits_below(base: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["evaluate", str(base / "whole"), "--reference", str(base / "whole")]
    assert main([*command, "--fail-below", "pu21_ssim=0.9"]) == 0
    assert main([*command, "--fail-below", "pu21_ssim=1.1"]) == 7
    assert f"{base / 'whole'}: pu21_ssim is 1, below 1.1\n" in capsys.readouterr().err
    assert main([*command, "--fail-below", "nothing=1"]) == 2


def test_name_and_value() -> None:
    assert named_number("flag", "a=1.5") == ("a", 1.5)
    for text in ("a", "a=", "a=b"):
        with pytest.raises(UsageError, match="flag: "):
            named_number("flag", text)


def test_known_motion_is_in_the_clips_pixels(tmp_path: Path) -> None:
    noise = np.random.default_rng(0).random((96, 300)).astype(np.float32)
    wide = cv2.GaussianBlur(noise, (0, 0), 8)
    codes = (255 * (wide - wide.min()) / np.ptp(wide)).astype(np.uint8)[..., None].repeat(3, axis=2)
    clip = write_ffv1(tmp_path / "pan.mkv", [codes[:, 8 * n : 8 * n + 192] for n in range(4)])
    settings = make_settings("paper", expand_map=False, map_width=48)
    convert(clip, tmp_path / "out", settings)
    flickers = []
    for step in (8, 0, 32):  # as it moved; not at all; as many pixels of the analysis size
        file = tmp_path / f"{step}.json"
        file.write_text(json.dumps({"origins": [[step * n, 0] for n in range(4)], "more": 1}))
        origins = sequence.read_origins(file)
        shots = sequence.flicker_by_shot(tmp_path / "out", clip, origins)
        flickers.append(sequence.over_shots(shots)["gain_flicker"])
    right, still, far = flickers
    assert right < 0.2 * min(still, far)
