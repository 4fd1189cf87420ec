"""Arrays in, HDR arrays out: what `convert` writes of the same pictures, without files."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from clips import moving_scene, write_ffv1

from itmo_video import (
    AlreadyHdrError,
    DamagedInputError,
    InputError,
    Settings,
    UsageError,
    convert,
    expand,
    expand_frames,
    make_settings,
    open_result,
)
from itmo_video.arrays.array_frames import _OF_FILES
from itmo_video.colour.transfer import eotf
from itmo_video.source.tags import InputOptions

LIGHT = {"lights": 64, "radius": 64.0}
PICTURE = next(iter(moving_scene(1)))


def still(path: Path, codes: np.ndarray) -> Path:
    cv2.imwrite(str(path), codes[..., ::-1])
    return path


@pytest.mark.parametrize(
    "settings",
    [
        make_settings("default", layers=("expand_map", "gain")),
        make_settings("paper", **LIGHT, primaries="acescg", layers=("clip_mask",)),
        make_settings("default", operator="reinhard2002", alpha=0.18),
        make_settings("default", projection="latlong", transfer="bt1886"),
    ],
    ids=["default", "paper", "global", "panorama"],
)
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_a_picture_is_the_exr_of_the_same_still(
    tmp_path: Path, settings: Settings, dtype: type[Any]
) -> None:
    codes = PICTURE if dtype is np.uint8 else PICTURE.astype(np.uint16) * 257
    convert(still(tmp_path / "still.png", codes), tmp_path / "out", settings)
    result = open_result(tmp_path / "out")
    hdr = expand(codes, settings)
    assert hdr.rgb.dtype == np.float16
    np.testing.assert_array_equal(hdr.rgb, result[1].rgb)
    assert set(hdr.layers) == set(result[1].layers) == set(settings.layers)
    for name, plane in hdr.layers.items():
        np.testing.assert_array_equal(plane, result[1].layers[name])
    assert hdr.settings.as_dict() == result[1].settings.as_dict()
    assert hdr.rgb.max() > 1 or settings.strength == 0


@pytest.mark.parametrize(
    "settings",
    [
        make_settings("default", layers=("expand_map",)),
        make_settings("paper", **LIGHT, key_interval=4, smooth_keys=1),
        make_settings("default", temporal="blend", **LIGHT),
    ],
    ids=["default", "smoothed", "blend"],
)
def test_a_stream_is_the_converted_clip(tmp_path: Path, settings: Settings) -> None:
    pictures = list(moving_scene(17, cuts=(9,)))
    convert(write_ffv1(tmp_path / "clip.mkv", pictures), tmp_path / "out", settings)
    result = open_result(tmp_path / "out")
    assert list(result) == list(range(1, 18))
    for jobs in (1, 3):
        made = list(expand_frames(iter(pictures), settings, jobs=jobs))
        assert [hdr.index for hdr in made] == [read.index for read in result.values()]
        for hdr, read in zip(made, result.values(), strict=True):
            np.testing.assert_array_equal(hdr.rgb, read.rgb)
            for name in settings.layers:
                np.testing.assert_array_equal(hdr.layers[name], read.layers[name])


def test_linear_light_is_the_codes_that_it_is_of() -> None:
    settings = make_settings("paper", **LIGHT)
    from_codes = expand(PICTURE, settings).rgb.astype(np.float64)
    light = eotf(PICTURE / 255.0, "srgb")
    for dtype in (np.float32, np.float64):
        from_light = expand(light.astype(dtype), settings).rgb.astype(np.float64)
        # A half has 11 bits; both are rounded to one.
        np.testing.assert_allclose(from_light, from_codes, rtol=2**-10, atol=2e-6)


@pytest.mark.parametrize("bits", [10, 12])
def test_codes_of_fewer_bits(bits: int) -> None:
    codes = np.rint(PICTURE / 255.0 * (2**bits - 1)).astype(np.uint16)
    light = eotf(codes / (2.0**bits - 1), "srgb")
    plain = make_settings("default", strength=0.0)
    got = expand(codes, plain, bit_depth=bits).rgb
    np.testing.assert_allclose(got, light, rtol=2**-10, atol=1e-6)


def test_primaries_are_those_of_the_picture() -> None:
    red = np.zeros((8, 8, 3), np.uint8)
    red[..., 0] = 255
    plain = make_settings("default", strength=0.0, primaries="rec2020")
    wide = expand(red, plain, primaries="rec2020").rgb[0, 0]
    np.testing.assert_allclose(wide, [1, 0, 0], atol=1e-3)
    # BT.2087: BT.709's red in BT.2020
    np.testing.assert_allclose(expand(red, plain).rgb[0, 0], [0.6274, 0.0691, 0.0164], atol=1e-3)


def test_what_is_no_sdr_picture_is_refused_in_words() -> None:
    ok = np.zeros((4, 4, 3), np.float32)
    cases: list[tuple[npt.NDArray[Any], type[Exception], str]] = [
        (np.zeros((4, 4), np.uint8), UsageError, r"\(4, 4\) is not a picture"),
        (np.zeros((4, 4, 4), np.uint8), UsageError, "height, width, 3"),
        (np.zeros((0, 4, 3), np.uint8), UsageError, "is not a picture"),
        (np.zeros((4, 4, 3), np.int32), UsageError, "int32"),
        (ok + np.float32(1.5), AlreadyHdrError, "1.5 times SDR white"),
        (ok - np.float32(0.1), UsageError, "negative light, -0.1"),
        (ok + np.float32("nan"), UsageError, "not finite"),
    ]
    for wrong, error, words in cases:
        with pytest.raises(error, match=words):
            expand(wrong)
    with pytest.raises(UsageError, match="highest code is 1024"):
        expand(np.full((4, 4, 3), 1024, np.uint16), bit_depth=10)
    with pytest.raises(UsageError, match="cannot hold codes of 10 bits"):
        expand(np.zeros((4, 4, 3), np.uint8), bit_depth=10)
    with pytest.raises(UsageError, match="fps applies to files"):
        expand_frames([], make_settings(fps="25"))  # at the call, not at the first picture
    with pytest.raises(UsageError, match="primaries must be one of"):
        expand_frames([], primaries="rec601")  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="jobs must be from 1 to 4096"):
        expand_frames([], jobs=0)
    with pytest.raises(UsageError, match="linear light"):
        expand(ok, make_settings(transfer="bt1886"))


def test_a_picture_of_another_size_ends_the_stream_after_what_came_before() -> None:
    pictures = [*moving_scene(4), *moving_scene(2, width=32)]
    made: list[int] = []
    with pytest.raises(DamagedInputError, match="picture 4: it is 32x64, the first 96x64"):
        made.extend(hdr.index for hdr in expand_frames(pictures))
    assert made == [0, 1, 2, 3]


def test_what_the_pictures_raise_comes_through() -> None:
    def broken() -> Iterator[np.ndarray]:
        yield from moving_scene(20)
        raise OSError("the camera is gone")

    with pytest.raises(OSError, match="the camera is gone"):
        list(expand_frames(broken()))


def test_an_endless_stream_is_read_ahead_by_a_bounded_window() -> None:
    taken = 0

    def endless() -> Iterator[np.ndarray]:
        nonlocal taken
        buffer = np.empty((64, 96, 3), np.uint8)
        for picture in itertools.cycle(moving_scene(10)):
            taken += 1
            buffer[...] = picture  # one buffer filled again and again, as cameras do
            yield buffer

    settings = make_settings("default", smooth_keys=1, **LIGHT)
    threads = cv2.getNumThreads()
    stream = expand_frames(endless(), settings, jobs=2)
    ahead = []
    for index, hdr in enumerate(itertools.islice(stream, 60)):
        assert hdr.index == index
        ahead.append(taken - index)
    assert max(ahead[20:]) < 40
    assert max(ahead[40:]) <= max(ahead[20:40]) + 1, "the window grows"
    stream.close()
    assert cv2.getNumThreads() == threads
    cycle = list(itertools.islice(itertools.cycle(moving_scene(10)), 40))
    for index, hdr in enumerate(itertools.islice(expand_frames(cycle, settings), 12)):
        first = next(itertools.islice(expand_frames(endless(), settings), index, None))
        np.testing.assert_array_equal(hdr.rgb, first.rgb)


def test_of_nothing_comes_nothing() -> None:
    assert list(expand_frames([])) == []


def test_a_result_is_a_mapping_and_says_what_is_not_there(tmp_path: Path) -> None:
    clip = write_ffv1(tmp_path / "clip.mkv", moving_scene(3))
    convert(clip, tmp_path / "out", make_settings("default", peak_nits=600))
    result = open_result(tmp_path / "out")
    assert (len(result), 2 in result, 4 in result, result.size) == (3, True, False, (96, 64))
    assert result.settings.peak_nits == 600
    assert result.shots == ()
    with pytest.raises(KeyError, match="frame 4 is not in the folder, which has 1-3"):
        result[4]
    (tmp_path / "out" / "clip.0002.exr").write_bytes(b"not whole")
    with pytest.raises(InputError, match="not an intact EXR file"):
        result[2]
    with pytest.raises(InputError, match="not a converted folder"):
        open_result(tmp_path)


def test_each_setting_that_says_how_files_are_read_is_used_or_refused() -> None:
    reading = {f.name for f in fields(InputOptions)} & {f.name for f in fields(Settings)}
    used = {"transfer", "force_sdr"}  # the second is of tags, which arrays do not have
    assert reading == {*_OF_FILES, *used}
