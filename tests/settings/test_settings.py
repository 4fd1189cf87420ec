"""One definition a setting: defaults, bounds, presets and TOML agree."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

from itmo_video.errors import UsageError
from itmo_video.options import spec_of
from itmo_video.presets import load_preset, make_settings, preset_names
from itmo_video.settings import LOOK, OF_CLIP, Settings, settings_from
from itmo_video.source.tags import InputOptions


def test_every_setting_has_help_and_a_default_within_its_bounds() -> None:
    settings = Settings()
    for f in dataclasses.fields(Settings):
        spec = spec_of(f)
        assert spec.help, f.name
        value = getattr(settings, f.name)
        if value is not None:
            assert spec.check(f.name, value) == value


@pytest.mark.parametrize("name", preset_names())
def test_presets_load(name: str) -> None:
    make_settings(name)


def test_paper_is_the_paper_to_the_letter() -> None:
    paper = make_settings("paper")
    assert paper.operator == "banterle2006"
    assert (paper.lights, paper.radius, paper.min_lights) == (1024, 16.0, 4)
    assert not paper.soft_lights
    assert not paper.edge_aware
    assert not paper.noise_guard
    assert paper.smooth_keys == 0
    assert paper.temporal == "tracked"
    assert paper.expand_map


def test_l_max_and_peak_nits_replace_each_other(tmp_path: Path) -> None:
    preset = tmp_path / "mine.toml"
    preset.write_text("[settings]\nl_max = 8.0\n")
    assert make_settings(str(preset)).l_max_effective == 8
    assert make_settings(str(preset), peak_nits=2030.0).l_max_effective == 10
    preset.write_text("[settings]\npeak-nits = 406.0\n")
    assert make_settings(str(preset)).l_max_effective == 2
    assert make_settings(str(preset), l_max=3.0).l_max_effective == 3
    with pytest.raises(UsageError, match="cannot be combined"):
        make_settings(l_max=3.0, peak_nits=500.0)


def test_l_white_follows_l_max_unless_set() -> None:
    assert make_settings(l_max=7.0).l_white_effective == 7
    assert make_settings(l_max=7.0, l_white=9.0).l_white_effective == 9


@pytest.mark.parametrize(
    "content", ["nonsense = 1\n", "[settings]\nnope = 1\n", "[settings]\nl_max = 'x'\n", "[["]
)
def test_bad_presets_are_refused_in_words(tmp_path: Path, content: str) -> None:
    preset = tmp_path / "bad.toml"
    preset.write_text(content)
    with pytest.raises(UsageError):
        make_settings(str(preset))


def test_unknown_names_are_refused() -> None:
    with pytest.raises(UsageError, match="unknown setting"):
        settings_from({"l_maxx": 3})


def test_presets_say_what_they_are() -> None:
    for name in preset_names():
        assert load_preset(name)


def test_how_a_clip_is_read_is_no_look() -> None:
    """A shot may have all of the look of its own: what opens the clip must not be among that."""
    of_settings = {f.name for f in dataclasses.fields(Settings)}
    reading = {f.name for f in dataclasses.fields(InputOptions)} & of_settings
    assert reading <= set(OF_CLIP)
    assert set(OF_CLIP).isdisjoint(LOOK)
