"""What the studio shows is what `convert` writes, whatever was shown before."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from itmo_video import make_settings
from itmo_video.conversion.convert import convert
from itmo_video.conversion.run_options import RunOptions
from itmo_video.look import make_look
from itmo_video.output.exr import read_exr
from itmo_video.settings import Settings
from itmo_video.source.files import MAX_PIXELS
from itmo_video.source.opening import input_options
from itmo_video.studio.session import Session, StaleError, reduced

OTHERS: dict[str, Any] = {
    "operator": "linear", "l_max": 9.0, "peak_nits": 400.0, "white_nits": 100.0, "l_white": 2.0,
    "alpha": 0.3, "footage": "tone-mapped", "hue": "keep", "lamps": 3.0,
    "expand_map": False, "strength": 0.5, "over_white": "keep", "lights": 64,
    "radius": 30.0, "min_lights": 1, "soft_lights": True, "map_width": 48, "key_interval": 3,
    "temporal": "blend", "smooth_keys": 2, "edge_aware": False, "noise_guard": True,
    "projection": "latlong", "transfer": "gamma22", "range": "limited", "primaries": "rec2020",
}  # fmt: skip


@pytest.fixture
def session(clip: Path) -> Iterator[Session]:
    with Session(clip, input_options(Settings(), MAX_PIXELS)) as opened:
        yield opened


def written(clip: Path, folder: Path, settings: Settings, number: int) -> np.ndarray[Any, Any]:
    convert(clip, folder, settings, RunOptions(frames=str(number), jobs=1))
    channels = read_exr(folder / f"{clip.stem}.{number:04d}.exr").channels
    return np.stack([channels[name] for name in "RGB"])


@pytest.mark.parametrize("index", [0, 6, 7, 8, 11, 13])
def test_a_picture_is_the_exr(clip: Path, session: Session, tmp_path: Path, index: int) -> None:
    settings = make_settings()
    shown = session.picture(index, make_look(settings))
    assert np.array_equal(shown.planes, written(clip, tmp_path, settings, index + 1))


@pytest.mark.parametrize(
    ("operator", "name"),
    [
        (operator, name)
        for operator in ("banterle2006", "auto", "huo2014", "banterle2007")
        for name in sorted(OTHERS)
        if name != "alpha" or operator == "banterle2006"  # the others know no alpha
    ],
)
def test_what_is_remembered_is_never_a_wrong_answer(
    session: Session, operator: str, name: str
) -> None:
    # A setting that the map depends on and that the studio thinks it does not would show here.
    base = Settings(operator=operator, smooth_keys=1)
    other = dataclasses.replace(base, **{name: OTHERS[name]})
    session.picture(6, make_look(base))
    warm = session.picture(6, make_look(other)).planes
    with Session(session._source, input_options(other, MAX_PIXELS)) as fresh:
        cold = fresh.picture(6, make_look(other)).planes
    assert np.array_equal(warm, cold), f"{name} changed and an old picture was used"


def test_every_setting_of_the_look_is_tried() -> None:
    of_the_file = {"compression", "layers", "owner", "comments", "timecode"}
    of_reading = {"fps", "deinterlace", "matrix", "force_sdr", "stream", "raw"}
    of_operators = {"operator_params"}
    known = {f.name for f in dataclasses.fields(Settings)}
    assert known - of_the_file - of_reading - of_operators == set(OTHERS), (
        "a setting no test looks at"
    )


def test_half_size_is_like_the_whole(session: Session) -> None:
    look = make_look(make_settings())
    whole = session.picture(6, look).planes.astype(np.float32)
    half = session.picture(6, look, scale=2).planes.astype(np.float32)
    means = whole.reshape(3, 32, 2, 48, 2).mean(axis=(2, 4))
    assert half.shape == means.shape
    assert np.median(np.abs(half - means) / (means + 0.02)) < 0.03


def test_the_source_and_the_layers(clip: Path, session: Session, tmp_path: Path) -> None:
    settings = make_settings("paper", layers=("expand_map", "gain", "clip_mask"))
    look = make_look(settings)
    convert(clip, tmp_path, settings, RunOptions(frames="7", jobs=1))
    channels = read_exr(tmp_path / f"{clip.stem}.0007.exr").channels
    for part in ("expand_map", "gain", "clip_mask"):
        layer = session.picture(6, look, part=part)
        assert np.array_equal(layer.planes[0], channels[f"{part}.Y"]), part
    hdr = session.picture(6, look).planes.astype(np.float32)
    sdr = session.picture(6, look, part="sdr").planes.astype(np.float32)
    gain = np.asarray(channels["gain.Y"], np.float32)
    assert np.allclose(hdr, sdr * gain, rtol=4e-3, atol=1e-4)


def test_stale_work_ends(session: Session) -> None:
    asked = 0

    def stale() -> bool:
        nonlocal asked
        asked += 1
        return asked > 2

    with pytest.raises(StaleError):
        session.picture(6, make_look(make_settings()), stale=stale)
    assert asked == 3, "it went on"
    session.picture(6, make_look(make_settings()))


def test_memory_is_bounded(clip: Path) -> None:
    with Session(clip, input_options(Settings(), MAX_PIXELS), 200_000, 300_000) as small:
        for step in range(60):
            settings = make_settings(radius=5.0 + step, operator="banterle2006")
            small.picture(step % 14, make_look(settings))
            assert small.held_bytes <= 900_000
            assert small.clip._frames.held_bytes <= 200_000


def test_reduced_keeps_the_subsampling(session: Session) -> None:
    frame = session.frame(0)
    planes = (frame.planes[0], frame.planes[1][:32, :48], frame.planes[2][:32, :48])
    small = reduced(dataclasses.replace(frame, planes=planes), 4)
    assert [plane.shape for plane in small.planes] == [(16, 24), (8, 12), (8, 12)]


def test_a_shots_own_map_is_shown(clip: Path, session: Session, tmp_path: Path) -> None:
    """A shot may have another radius, operator or key interval, as a conversion makes it."""
    base = make_settings()
    own = make_settings(operator="banterle2006", radius=9.0, key_interval=3, smooth_keys=1)
    shown = session.picture(5, make_look(base), make_look(own))
    assert np.array_equal(shown.planes, written(clip, tmp_path, own, 6))
