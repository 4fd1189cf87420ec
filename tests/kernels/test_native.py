"""native: the compiled loops do what their libraries' oracles do, and nothing needs them."""

import zlib
from fractions import Fraction
from pathlib import Path

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import example, given

from itmo_video import make_settings
from itmo_video.colour.analysis_picture import analysis_guide
from itmo_video.colour.strips import strips
from itmo_video.expand_map.key_map import make_key_map
from itmo_video.kernels import library
from itmo_video.kernels.compiled import drive, pack_literals
from itmo_video.kernels.compiled_light import CodesToLight, ycbcr_rows
from itmo_video.look import make_look
from itmo_video.model import Encoding, Frame
from itmo_video.motion import flow
from itmo_video.operators.auto import expand_auto, gain_auto
from itmo_video.operators.base import Context
from itmo_video.operators.photographic import gain_banterle2006
from itmo_video.operators.ramps import ramps
from itmo_video.output import exr
from itmo_video.rendering.frame import expand, render
from itmo_video.rendering.guidance import Guidance
from itmo_video.rendering.guided_upsampling import edge_aware_coefficients

loaded = library.library()
compiled = pytest.mark.skipif(loaded is None, reason="installed without a C compiler")
HEADER = exr.ExrHeader(
    compression="zip",
    chromaticities=(0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329),
    white_nits=203.0,
    frame_rate=Fraction(25),
    pixel_aspect=Fraction(1),
    time_s=Fraction(0),
    source_name="a",
    fingerprint="b",
)


def fibonacci_bytes(symbols):
    """Bytes whose Huffman codes are as long as there are symbols: the worst for a limit."""
    counts = [1, 1]
    while len(counts) < symbols:
        counts.append(counts[-1] + counts[-2])
    half = np.repeat(np.arange(symbols, dtype=np.uint8), counts)
    return np.concatenate([half, half[::-1]])[None]


@compiled
@given(
    st.integers(0, 2**32 - 1),
    st.integers(1, 5),
    st.integers(1, 700),
    st.sampled_from([0.0, 0.3, 2, 9, 40, 1000]),
)
@example(0, 1, 1, 0.0)
def test_packed_rows_come_back(seed, count, half, spread):
    rows = np.random.default_rng(seed).normal(128, spread, (count, 2 * half)).astype(np.uint8)
    packed = pack_literals(loaded, rows)
    assert [zlib.decompress(data) for data in packed] == [row.tobytes() for row in rows]


@compiled
@pytest.mark.parametrize("symbols", [2, 13, 14, 15, 16, 20, 27])
def test_long_codes_are_cut_to_what_fits(symbols):
    rows = fibonacci_bytes(symbols)
    (data,) = pack_literals(loaded, rows)
    assert zlib.decompress(data) == rows.tobytes()


@compiled
def test_every_byte_value():
    rows = np.tile(np.arange(256, dtype=np.uint8), (3, 4))
    packed = pack_literals(loaded, rows)
    assert [zlib.decompress(data) for data in packed] == [row.tobytes() for row in rows]


@compiled
@pytest.mark.parametrize("spread", [0.3, 3, 30])
def test_as_small_as_zlibs_huffman_codes(spread):
    """zlib with its matches off, one block of each half, is the oracle for codes and headers."""
    rng = np.random.default_rng(5)
    halves = [rng.normal(128, spread, 16000), rng.normal(60, spread / 3, 16000)]
    rows = np.concatenate(halves).astype(np.uint8)[None]
    packer = zlib.compressobj(1, zlib.DEFLATED, 15, 9, zlib.Z_HUFFMAN_ONLY)
    theirs = b""
    for half in np.split(rows[0], 2):
        theirs += packer.compress(half.tobytes()) + packer.flush(zlib.Z_SYNC_FLUSH)
    theirs += packer.flush()
    (ours,) = pack_literals(loaded, rows)
    assert len(theirs) - 20 <= len(ours) <= len(theirs)  # the flushes are some bytes


@compiled
@pytest.mark.parametrize("rows", [np.zeros((2, 3), np.uint8), np.zeros((2, 0), np.uint8)])
def test_odd_rows_are_refused(rows):
    with pytest.raises(ValueError, match="cannot be packed"):
        pack_literals(loaded, rows)


def grain(height, width, channels):
    """Return R, G, B with grain; from one channel, a grey picture's three equal planes."""
    light = 0.5 + 0.05 * np.random.default_rng(6).standard_normal((channels, height, width))
    return tuple(np.resize(light, (3, height, width)).astype(np.float16))


def sizes(tmp_path, monkeypatch, rgb, compression):
    """Return the bytes of a picture's file with the compiled loops and without; same pixels."""
    head = exr.ExrHeader(**{**vars(HEADER), "compression": compression})
    with_loops = exr.write_exr(tmp_path / "a.exr", rgb, head)
    monkeypatch.setattr(library, "library", lambda: None)
    without = exr.write_exr(tmp_path / "b.exr", rgb, head)
    for name in ("a.exr", "b.exr"):
        channels = exr.read_exr(Path(tmp_path / name)).channels
        for plane, letter in zip(rgb, "RGB", strict=True):
            assert np.array_equal(channels[letter], plane), (name, letter)
    return with_loops, without


@compiled
@pytest.mark.parametrize("compression", ["zips", "zip"])
def test_grain_is_packed_smaller_than_by_matches(tmp_path, monkeypatch, compression):
    ours, theirs = sizes(tmp_path, monkeypatch, grain(150, 640, 3), compression)
    assert ours < 0.99 * theirs


@compiled
@pytest.mark.parametrize("compression", ["zips", "zip"])
def test_what_repeats_is_left_to_matches(tmp_path, monkeypatch, compression):
    ours, theirs = sizes(tmp_path, monkeypatch, grain(150, 640, 1), compression)
    assert ours == theirs


def test_another_version_of_the_library_is_not_used(monkeypatch):
    monkeypatch.setattr(library, "_VERSION", -1)
    assert library._found.__wrapped__()[0] is None


# ---- maps and luminance (test_colour.py holds linear light against the equations) ----


@pytest.fixture
def by_libraries(monkeypatch):
    """Call a function as if nothing had been compiled."""

    def call(function, *arguments):
        with monkeypatch.context() as patch:
            patch.setattr(library, "library", lambda: None)
            return function(*arguments)

    return call


@compiled
@given(st.integers(0, 2**32 - 1), st.floats(2, 3))
def test_power(seed, gamma):
    """One line of grey: codes to light by a float64 power, 0 below what any half can show."""
    codes = np.random.default_rng(seed).integers(4097, 60161, (1, 64)).astype(np.uint16)
    codes[0, :4] = 4096, 60160, 4097, 4098  # black and white of 16 bits, the darkest steps
    flat = np.full((1, 64), 32768, np.uint16)
    out = [np.empty((1, 64), np.float32) for _ in range(3)]
    levels = (4096.0, 56064.0, 32768.0, 57344.0)
    to_light = CodesToLight((None, None), levels, (1, 1, 1, 1), gamma)
    ycbcr_rows(loaded, (codes, flat, flat), slice(0, 1), to_light, out)
    want = ((codes - 4096.0) / 56064) ** gamma
    np.testing.assert_allclose(out[1], want, rtol=1e-6, atol=0.5**30)
    assert out[1][0, 0] == 0
    assert out[1][0, 1] == 1


@compiled
@pytest.mark.parametrize("edge_aware", [True, False])
@pytest.mark.parametrize("guards", [True, False])
@pytest.mark.parametrize("channels", [0, 1, 3])
@pytest.mark.parametrize("size", [(96, 128), (270, 480), (131, 517)])
def test_guidance(by_libraries, size, channels, guards, edge_aware):
    settings = make_settings("default", noise_guard=guards, map_width=128)
    rng = np.random.default_rng(8)
    encoding = Encoding("grey", 8, "bt709", "limited", "bt1886", "rec709")
    frame = Frame(0, Fraction(0), (rng.integers(0, 256, size, dtype=np.uint8),), encoding)
    guide = analysis_guide(frame, 128)
    maps = None
    if channels:
        shape = guide.shape if channels == 1 else (*guide.shape, 3)
        maps = rng.random(shape, np.float32)
    guidance = Guidance(frame, guide, settings, maps, edge_aware)
    for rows in strips(size[0]):
        ours, ratio = guidance.rows(rows)
        theirs, want = by_libraries(guidance.rows, rows)
        assert len(ours) == len(theirs) == channels
        for part, other in zip(ours, theirs, strict=True):
            np.testing.assert_allclose(part, other, atol=2e-6)
        assert (ratio is None) == (want is None) == (not guards)
        if ratio is not None:
            np.testing.assert_allclose(ratio, want, atol=4e-6)


@compiled
@pytest.mark.parametrize("with_ratio", [True, False])
def test_drive(with_ratio):
    rng = np.random.default_rng(9)
    rgb = [rng.normal(0.5, 0.5, (5, 67)).astype(np.float32) for _ in range(3)]
    ratio = rng.random((5, 67), np.float32) if with_ratio else None
    weights = (0.213, 0.715, 0.072)
    want = sum(w * plane.astype(np.float64) for w, plane in zip(weights, rgb, strict=True))
    want = np.clip(want * (1 if ratio is None else ratio), 0, 1)
    np.testing.assert_allclose(drive(loaded, rgb, weights, ratio), want, atol=1e-6)


@compiled
@pytest.mark.parametrize("is_same", [True, False])
@pytest.mark.parametrize("radius", [0, 1, 3, 40])
@pytest.mark.parametrize("size", [(1, 1), (5, 60), (60, 5), (72, 128)])
def test_guided_coefficients(by_libraries, size, radius, is_same):
    rng = np.random.default_rng(10)
    guide = rng.random(size, np.float32)
    values = guide if is_same else rng.random(size, np.float32)
    ours = edge_aware_coefficients(values, guide, radius, 1e-3)
    theirs = by_libraries(edge_aware_coefficients, values, guide, radius, 1e-3)
    for part, other in zip(ours, theirs, strict=True):
        np.testing.assert_allclose(part, other, rtol=1e-6, atol=1e-6)


@compiled
@pytest.mark.parametrize("l_max", [2.0, 20.0])
def test_gain_banterle2006_to_the_bit(by_libraries, l_max):
    luminance = np.random.default_rng(11).random((7, 131), np.float32)
    luminance[0, :2] = 0, 1
    context = Context(l_max, 0.9 * l_max)
    ours = gain_banterle2006(luminance, context)
    assert np.array_equal(ours, by_libraries(gain_banterle2006, luminance, context))


@compiled
@pytest.mark.parametrize("l_max", [2.0, 20.0, 300.0])
@pytest.mark.parametrize("is_weighed", [True, False])
def test_gain_auto(by_libraries, is_weighed, l_max):
    rng = np.random.default_rng(15)
    rgb = [(1.2 * rng.random((40, 131)) ** 3).astype(np.float32) for _ in range(3)]
    rgb[1][10:20] = rgb[0][10:20]
    for channel in rgb:
        channel[20:] *= 0.3  # nothing to open
    maps = [rng.random((40, 131), np.float32) for _ in range(4)] if is_weighed else []
    if is_weighed:
        maps[3][30:] = 0
    ratio = rng.uniform(0.5, 2, (40, 131)).astype(np.float32) if is_weighed else None
    for hue in ("restore", "keep"):
        context = Context(l_max, l_max, hue=hue)
        ours = gain_auto(rgb, ratio, maps, context)
        theirs = by_libraries(gain_auto, rgb, ratio, maps, context)
        for one, other in zip(ours, theirs, strict=True):
            np.testing.assert_allclose(one, other, rtol=2e-5)
            assert (one[30:] == 1).all()


@compiled
@pytest.mark.parametrize("strength", [1.0, 0.6])
@pytest.mark.parametrize("curve", [0.0, 0.4, 1.0])  # of the greatest weight: none, by day, by night
def test_expand_auto_is_the_picture_times_its_gains(by_libraries, curve, strength):
    """In places where nothing, the curve alone, all channels alike or each its own rises."""
    rng = np.random.default_rng(16)
    rgb = [rng.uniform(0.2, 1, (12, 150)).astype(np.float32) for _ in range(3)]
    for top, most in ((0, 0.45), (3, 0.95), (6, 1)):
        for channel in rgb:
            channel[top : top + 3] *= np.float32(most)
    levels = [np.zeros((12, 150), np.float32)] + [rng.random((12, 150), np.float32)] * 2
    levels[1][9:] = levels[2][9:] = 0
    levels[0][2:9] = 0.5
    maps = [*levels, np.full((12, 150), curve, np.float32)]
    ratio = rng.uniform(0.5, 2, (12, 150)).astype(np.float32)
    context, found = Context(5, 5), []
    for call in (lambda f, *a: f(*a), by_libraries):
        out = np.empty((3, 12, 150), np.float16)
        call(expand_auto, rgb, ratio, maps, context, strength, out)
        found.append(out)
        gains = call(gain_auto, rgb, ratio, maps, context)
        want = [p * ((g - 1) * np.float32(strength) + 1) for p, g in zip(rgb, gains, strict=True)]
        np.testing.assert_allclose(out, want, rtol=6e-4)
    apart = found[0].view(np.int16).astype(int) - found[1].view(np.int16)
    assert np.abs(apart).max() <= 1
    assert np.count_nonzero(apart) <= apart.size / 1000


@compiled
def test_ramps_to_the_bit(by_libraries):
    values = np.random.default_rng(18).uniform(-0.2, 1.2, (9, 70, 3)).astype(np.float32)
    ours = ramps(values, 0.8, 0.93)
    assert np.array_equal(ours, by_libraries(ramps, values, 0.8, 0.93))
    assert ours.min() == 0
    assert ours.max() == 1


@compiled
def test_a_map_of_zero_may_be_one_number():
    rng = np.random.default_rng(17)
    rgb = [rng.random((9, 70), np.float32) for _ in range(3)]
    whole = [np.zeros((9, 70), np.float32), *rng.random((2, 9, 70), np.float32)]
    whole.append(np.zeros((9, 70), np.float32))
    single = [np.broadcast_to(np.float32(0), (9, 70)) if not m.any() else m for m in whole]
    for one, other in zip(
        gain_auto(rgb, None, whole, Context(5, 5)),
        gain_auto(rgb, None, single, Context(5, 5)),
        strict=True,
    ):
        assert np.array_equal(one, other)


@compiled
def test_every_half_and_what_lies_between():
    """Products by a gain of 1 (no weight) round to halves as NumPy's do, up to infinity."""
    halves = np.arange(0x7C00, dtype=np.uint16).view(np.float16).astype(np.float32)
    middles = ((halves[1:] + halves[:-1]) / 2).astype(np.float32)
    beside = [np.nextafter(middles, np.float32(to)) for to in (0, np.inf)]
    ends = np.array([65519, 65520, 1e9, 1e-30, 3e-8], np.float32)
    values = np.concatenate([halves, middles, *beside, ends])
    values = np.concatenate([values, -values])
    out = np.empty((3, values.size), np.float16)
    weight = np.zeros_like(values)
    expand([values] * 3, weight + 7, weight, 1.0, 1.0, out)
    with np.errstate(over="ignore"):
        want = values.astype(np.float16)
    for plane in out:
        assert np.array_equal(plane.view(np.uint16), want.view(np.uint16))


@compiled
@pytest.mark.parametrize("strength", [1.0, 0.15])
def test_expand_to_the_bit(by_libraries, strength):
    rng = np.random.default_rng(12)
    rgb = [rng.random((40, 131), np.float32) for _ in range(3)]
    gain, weight = 1 + 9 * rng.random((40, 131), np.float32), rng.random((40, 131), np.float32)
    out = np.empty((3, 40, 131), np.float16)
    expand(rgb, gain, weight, 0.7, strength, out)
    want = np.empty_like(out)
    by_libraries(expand, rgb, gain, weight, 0.7, strength, want)
    assert np.array_equal(out, want)


@compiled
@pytest.mark.parametrize("count", [1, 5, 8, 1032])
def test_camera_model(by_libraries, count):
    """Most places on an affine motion, some off it: the one elimination finds what LAPACK does."""
    rng = np.random.default_rng(13)
    across, down = rng.random((2, count)) - 0.5
    vectors = np.stack([1 + 2 * across - down, -3 + 0.5 * down]) + rng.normal(0, 0.2, (2, count))
    vectors[:, ::4] += 9
    texture = rng.integers(1, 50, count).astype(np.float64)
    given = (across, down, vectors, texture, flow.CAMERA_SIGMAS_PX, flow.CAMERA_RIDGE)
    ours = flow.camera_model(*given)
    theirs = by_libraries(flow.camera_model, *given)
    np.testing.assert_allclose(ours, theirs, rtol=1e-6, atol=1e-8)


# ---- whole frames ----


def picture(family):
    """A frame of 150 by 300 with a lamp on its seam, grain and colour."""
    rng = np.random.default_rng(14)
    y, x = np.mgrid[:150, :300]
    lamp = 90 * (np.hypot((x + 20) % 300 - 30, y - 60) < 25)

    def plane(step, base):
        values = base + lamp[::step, ::step] + rng.normal(0, 3, lamp[::step, ::step].shape)
        return np.clip(values, 16, 235).astype(np.uint8)

    planes = {
        "ycbcr": (plane(1, 120), plane(2, 90), plane(2, 100)),
        "rgb": (plane(1, 120), plane(1, 140), plane(1, 100)),
        "grey": (plane(1, 120),),
    }[family]
    encoding = Encoding(family, 8, "bt709", "limited", "bt1886", "rec709")
    return Frame(0, Fraction(0), planes, encoding)


@compiled
@pytest.mark.parametrize("family", ["ycbcr", "rgb", "grey"])
@pytest.mark.parametrize("projection", ["flat", "latlong"])
@pytest.mark.parametrize("preset", ["default", "paper", "ibl"])
@pytest.mark.parametrize("map_width", [128, 512])
def test_frames_are_the_same_by_libraries(by_libraries, map_width, preset, projection, family):
    frame = picture(family)
    look = make_look(make_settings(preset, projection=projection, map_width=map_width))

    def made():
        return np.stack(render(frame, make_key_map(frame, look), look).rgb)

    ours, theirs = made(), by_libraries(made)
    np.testing.assert_allclose(
        ours.astype(np.float64), theirs.astype(np.float64), rtol=3e-3, atol=1e-5
    )
    assert np.mean(ours != theirs) < 0.01
