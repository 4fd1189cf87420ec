"""VapourSynth: frame n is `convert`'s frame n, asked for in any order."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from clips import moving_scene, write_ffv1

from itmo_video import AlreadyHdrError, UsageError, convert, make_settings, open_clip, open_result
from itmo_video.colour.transfer import pq_code
from itmo_video.errors import DamagedInputError
from itmo_video.model import Frame

vs = pytest.importorskip("vapoursynth")

from itmo_video.vapoursynth import expand  # noqa: E402 - it needs VapourSynth
from itmo_video.vapoursynth.node_frames import NodeFrames  # noqa: E402

Format = Callable[[], Any]


@pytest.fixture(autouse=True)
def no_cache_between_tests() -> Iterator[None]:
    yield
    vs.core.clear_cache()


def node_of(path: Path, asked: set[int] | None = None, **props: int) -> Any:
    """A film's codes as a VapourSynth clip; `asked` notes which frames were wanted."""
    with open_clip(path) as clip:
        frames = list(clip.frames())
    encoding = frames[0].encoding
    height, width = frames[0].planes[0].shape
    family = {"ycbcr": vs.YUV, "rgb": vs.RGB, "grey": vs.GRAY}[encoding.family]
    halved = [0, 0]
    if encoding.family == "ycbcr":
        small = frames[0].planes[1].shape
        halved = [int(small[1] < width), int(small[0] < height)]
    form = vs.core.query_video_format(family, vs.INTEGER, encoding.bit_depth, *halved)
    blank = vs.core.std.BlankClip(
        width=width, height=height, format=form, length=len(frames), fpsnum=24, fpsden=1
    )

    def fill(n: int, f: Any) -> Any:
        if asked is not None:
            asked.add(n)
        out = f.copy()
        for number, codes in enumerate(frames[n].planes):
            np.asarray(out[number])[...] = codes
        return out

    node = vs.core.std.ModifyFrame(blank, blank, fill)
    return vs.core.std.SetFrameProps(node, **props) if props else node


def picture(node: Any, n: int) -> np.ndarray:
    with node.get_frame(n) as frame:
        return np.dstack([np.array(frame[plane]) for plane in range(3)])


def film_of(path: Path, count: int = 3, stored: str = "yuv420p", cut: int = 99) -> Path:
    frames = moving_scene(count, cuts=(cut,))
    if stored == "gray":
        return write_ffv1(path, (f[..., 0] for f in frames), pixel_format="gray", stored="gray")
    return write_ffv1(path, frames, stored=stored)


@pytest.mark.parametrize(
    ("preset", "own", "pixel_format"),
    [
        ("default", {}, "yuv420p"),
        ("default", {"key_interval": 3, "primaries": "rec2020"}, "yuv422p10le"),
        ("paper", {"lights": 64}, "bgr0"),
        ("ibl", {"operator": "reinhard2002"}, "gray"),
    ],
)
def test_frames_in_any_order_are_those_of_convert(
    tmp_path: Path, preset: str, own: dict[str, Any], pixel_format: str
) -> None:
    film = film_of(tmp_path / "film.mkv", 24, pixel_format, cut=13)
    convert(film, tmp_path / "out", make_settings(preset, **own))
    result = open_result(tmp_path / "out")
    # Grey films are full range unless they are tagged, VapourSynth's grey is not.
    asked_for: dict[str, Any] = {"_Range": 1} if pixel_format == "gray" else {}
    node = expand(node_of(film, **asked_for), preset, jobs=2, **own)
    assert (node.format.id, node.num_frames) == (vs.RGBS, 24)
    order = [*range(24), *random.Random(7).sample(range(24), 8)]
    for n in order:
        np.testing.assert_array_equal(picture(node, n), result[n + 1].rgb.astype(np.float32))


def test_a_frame_asks_for_a_bounded_window(tmp_path: Path) -> None:
    film = write_ffv1(tmp_path / "film.mkv", [np.full((32, 48, 3), 90, np.uint8)] * 300)
    asked: set[int] = set()
    node = expand(node_of(film, asked), key_interval=5)
    asked.clear()  # the first frame, which is read for its properties
    picture(node, 200)
    assert 200 in asked
    assert min(asked) >= 150
    assert max(asked) <= 250


def test_a_clip_that_breaks_off_is_no_shorter_clip(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    node = expand(node_of(film_of(tmp_path / "film.mkv", 8)))
    whole = NodeFrames.frames

    def broken(frames: NodeFrames, start: int = 0) -> Iterator[Frame]:
        for frame in whole(frames, start):
            if frame.index == 3:
                raise DamagedInputError("frame 3 is damaged")
            yield frame

    monkeypatch.setattr(NodeFrames, "frames", broken)
    with pytest.raises(vs.Error, match="frame 3 is damaged"):
        picture(node, 0)


def test_properties_say_how_codes_are_read(tmp_path: Path) -> None:
    film = film_of(tmp_path / "film.mkv")
    own: dict[str, Any] = {"matrix": "bt601", "range": "full", "transfer": "srgb"}
    by_settings = expand(node_of(film), **own)
    tagged = expand(node_of(film, _Matrix=6, _Transfer=13, _Range=1))
    np.testing.assert_array_equal(picture(tagged, 1), picture(by_settings, 1))
    assert not np.array_equal(picture(expand(node_of(film)), 1), picture(by_settings, 1))


def test_what_comes_out_says_that_it_is_linear(tmp_path: Path) -> None:
    film = film_of(tmp_path / "film.mkv")
    source = node_of(film, _Matrix=1, _Transfer=1, _Range=0, _ChromaLocation=0, _SARNum=2)
    with expand(source, primaries="rec2020").get_frame(2) as frame:
        props = dict(frame.props)
    assert (props["_Matrix"], props["_Transfer"], props["_Primaries"]) == (0, 8, 9)
    assert props["_SARNum"] == 2
    assert not {"_Range", "_ChromaLocation"} & set(props)


def test_vapoursynth_makes_pq_of_it(tmp_path: Path) -> None:
    film = film_of(tmp_path / "film.mkv")
    hdr = expand(node_of(film, _Matrix=1), primaries="rec2020")
    pq = vs.core.resize.Point(
        hdr, format=vs.RGB48, transfer_s="st2084", primaries_s="2020", nominal_luminance=203
    )
    codes = np.dstack([np.array(plane) for plane in pq.get_frame(1)]).astype(float) / 65535
    np.testing.assert_allclose(codes, pq_code(picture(hdr, 1).clip(0) * 203.0), atol=1e-4)


@pytest.mark.parametrize(
    ("make", "own", "error", "said"),
    [
        (lambda: vs.core.std.BlankClip(format=vs.RGBS), {}, AlreadyHdrError, "floating-point"),
        (lambda: vs.core.std.BlankClip(format=vs.YUV411P8), {}, UsageError, "YUV411P8"),
        (lambda: vs.core.std.BlankClip(varformat=True), {}, UsageError, "varies"),
        (lambda: vs.core.std.BlankClip(varsize=True), {}, UsageError, "varies"),
        (lambda: marked("_Transfer", 16), {}, AlreadyHdrError, "PQ"),
        (lambda: marked("_FieldBased", 2), {}, UsageError, "interlaced"),
        (lambda: marked("_Matrix", 1), {"layers": ["gain"]}, UsageError, "layers"),
        (lambda: marked("_Matrix", 1), {"fps": "25"}, UsageError, "fps"),
    ],
)
def test_what_does_not_fit_is_refused(
    make: Format, own: dict[str, Any], error: type[Exception], said: str
) -> None:
    with pytest.raises(error, match=said):
        expand(make(), **own)


def marked(name: str, value: int) -> Any:
    return vs.core.std.SetFrameProps(vs.core.std.BlankClip(format=vs.YUV420P8), **{name: value})


def test_a_wrong_pq_tag_can_be_overruled() -> None:
    assert expand(marked("_Transfer", 16), transfer="bt1886").format.id == vs.RGBS
