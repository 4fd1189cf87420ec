"""exr: what is written comes back, the same bytes each time; what cannot be is an OutputError."""

import dataclasses
import io
import os
import subprocess
import sys
import textwrap
import threading
import types
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import OpenEXR
import pytest
from clips import REPOSITORY
from exr_pictures import HEADER, REC709, header, picture

from itmo_video.compressions import WRITTEN as COMPRESSIONS
from itmo_video.errors import InputError, OutputError
from itmo_video.output import atomic, exr

pytestmark = pytest.mark.usefixtures("loops")

LOSSY = {"b44": 0.05, "dwaa": 0.02, "dwab": 0.02}  # of the range of the smooth test picture


def run_python(code, *args, prefix=(), timeout=60):
    return subprocess.run(
        [*prefix, sys.executable, "-W", "error", "-c", textwrap.dedent(code), *map(str, args)],
        env={**os.environ, "PYTHONPATH": str(REPOSITORY)},
        capture_output=True,
        text=True,
        timeout=timeout,
        check=False,
    )


def temp_files(folder):
    return [name for name in os.listdir(folder) if name.endswith(".tmp")]


def test_names_come_without_loading_openexr():
    done = run_python("import sys, itmo_video.output.exr; print('OpenEXR' in sys.modules)")
    assert done.stdout.strip() == "False", done.stderr


@pytest.mark.parametrize("size", [(1, 1), (2, 3), (101, 77), (300, 40)])
@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_round_trip(tmp_path, compression, size):
    rgb = picture(*size)
    path = tmp_path / "a.exr"
    written = exr.write_exr(path, rgb, header(compression=compression))
    assert written == path.stat().st_size
    assert os.listdir(tmp_path) == ["a.exr"]
    image = exr.read_exr(path)
    assert image.size == size[::-1]
    assert set(image.channels) == set("RGB")
    for name, plane in zip("RGB", rgb, strict=True):
        back = image.channels[name]
        assert back.dtype == np.float16
        if compression in LOSSY:
            error = np.abs(back.astype(float) - plane.astype(float)).max()
            assert error <= LOSSY[compression] * 8
        else:
            assert np.array_equal(back.view(np.uint16), plane.view(np.uint16))


@pytest.mark.parametrize("compression", [n for n in COMPRESSIONS if n not in LOSSY])
def test_lossless_for_every_half(tmp_path, compression):
    every = np.arange(65536, dtype=np.uint16).reshape(256, 256).view(np.float16)
    if compression == "pxr24":  # makes one NaN of another
        every = np.where(np.isnan(every), np.float16(0), every)
    exr.write_exr(
        tmp_path / "a.exr", (every, every[::-1], every.T), header(compression=compression)
    )
    back = exr.read_exr(tmp_path / "a.exr").channels
    for name, plane in (("R", every), ("G", every[::-1]), ("B", every.T)):
        assert np.array_equal(back[name].view(np.uint16), plane.view(np.uint16)), name


@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_layers_and_alpha(tmp_path, compression):
    rgb = picture(40, 50)
    rng = np.random.default_rng(1)
    alpha = rng.random((40, 50)).astype(np.float16)
    layers = {
        "expand_map.Y": rng.random((40, 50)).astype(np.float32),
        "clip_mask.Y": (rng.random((40, 50)) > 0.5).astype(np.float16),
        "a_layer_with_a_name_longer_than_31_characters.Y": alpha,
    }
    head = header(compression=compression)
    exr.write_exr(tmp_path / "a.exr", rgb, head, alpha=alpha, layers=layers)
    back = exr.read_exr(tmp_path / "a.exr").channels
    assert set(back) == {"R", "G", "B", "A", *layers}
    # b44 packs noise badly, the dwa pair is lossy in layers named Y, pxr24 rounds float32.
    tolerance = {"b44": 0.3, "dwaa": 0.1, "dwab": 0.1, "pxr24": 1e-4}.get(compression, 0)
    for name, array in {"A": alpha, **layers}.items():
        assert back[name].dtype == array.dtype
        assert np.abs(back[name].astype(float) - array.astype(float)).max() <= tolerance


def test_attributes_come_back(tmp_path):
    exr.write_exr(tmp_path / "a.exr", picture(3, 2), HEADER)
    attributes = exr.read_exr(tmp_path / "a.exr").attributes
    assert attributes["chromaticities"] == pytest.approx(REC709, abs=1e-7)
    assert attributes["whiteLuminance"] == 203.0
    assert attributes["framesPerSecond"] == HEADER.frame_rate
    assert attributes["pixelAspectRatio"] == pytest.approx(64 / 45, abs=1e-7)
    assert attributes["itmoTime"] == HEADER.time_s
    assert attributes["itmoSource"] == HEADER.source_name
    assert attributes["itmoSettings"] == HEADER.settings_text
    assert attributes["itmoFingerprint"] == HEADER.fingerprint
    assert attributes["compression"] == OpenEXR.ZIP_COMPRESSION
    code = attributes["timeCode"]
    assert (code.hours, code.minutes, code.seconds, code.frame) == (1, 2, 3, 4)
    assert code.dropFrame
    assert OpenEXR.checkColorMetadata(attributes) == OpenEXR.OK
    assert exr.read_exr(tmp_path / "a.exr").fingerprint == HEADER.fingerprint


@pytest.mark.parametrize("text", [None, "", "1:2:3:4", "24:00:00:00", "00:00:00:30", "soon"])
def test_a_timecode_that_does_not_fit_is_left_out(tmp_path, text):
    exr.write_exr(tmp_path / "a.exr", picture(1, 1), header(timecode=text))
    assert "timeCode" not in exr.read_exr(tmp_path / "a.exr").attributes


@pytest.mark.parametrize(
    "time_s",
    [
        Fraction(0),
        Fraction(-1, 25),
        Fraction(2**31 - 1, 2**32 - 1),
        Fraction(5 * 10**9 + 1, 90000),  # 15 hours into a transport stream
        Fraction(10**12 + 1, 10**9),
        Fraction(-(2**33) - 1, 90001),
        Fraction(1, 2**40),
    ],
)
def test_times_fit_into_32_bits(tmp_path, time_s):
    exr.write_exr(tmp_path / "a.exr", picture(1, 1), header(time_s=time_s))
    back = exr.read_exr(tmp_path / "a.exr").attributes["itmoTime"]
    assert abs(back - time_s) < Fraction(1, 10**8)


def test_no_frame_rate(tmp_path):
    exr.write_exr(tmp_path / "a.exr", picture(1, 1), header(frame_rate=Fraction(0)))
    assert "framesPerSecond" not in exr.read_exr(tmp_path / "a.exr").attributes


def test_undecodable_source_name(tmp_path):
    exr.write_exr(tmp_path / "a.exr", picture(1, 1), header(source_name="a\udcff.mp4"))
    assert exr.read_exr(tmp_path / "a.exr").attributes["itmoSource"] == "a\\udcff.mp4"


@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_same_input_same_bytes(tmp_path, compression):
    head = header(compression=compression)
    layers = {"m.Y": np.ones((70, 90), np.float32), "b.Y": np.zeros((70, 90), np.float16)}
    exr.write_exr(tmp_path / "a.exr", picture(70, 90), head, layers=layers)
    swapped = dict(reversed(layers.items()))
    padded = [np.zeros((70, 180), np.float16) for _ in range(3)]
    for wide, plane in zip(padded, picture(70, 90), strict=True):
        wide[:, ::2] = plane
    strided = tuple(wide[:, ::2] for wide in padded)
    exr.write_exr(str(tmp_path / "b.exr"), strided, head, layers=swapped, durable=True)
    assert (tmp_path / "a.exr").read_bytes() == (tmp_path / "b.exr").read_bytes()


def test_threads_write_the_same_bytes(tmp_path):
    rgb = picture(200, 300)
    work = [lambda i=i: exr.write_exr(tmp_path / f"{i}.exr", rgb, HEADER) for i in range(8)]
    threads = [threading.Thread(target=job) for job in work]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len({(tmp_path / f"{i}.exr").read_bytes() for i in range(8)}) == 1
    assert temp_files(tmp_path) == []


def test_what_is_written_is_not_changed(tmp_path):
    rgb = picture(5, 5)
    layers = {"m.Y": np.ones((5, 5), np.float32)}
    before = [plane.copy() for plane in rgb]
    exr.write_exr(tmp_path / "a.exr", rgb, HEADER, layers=layers)
    assert all(np.array_equal(a, b) for a, b in zip(before, rgb, strict=True))
    assert type(layers["m.Y"]) is np.ndarray


def test_aces_container(tmp_path):
    head = header(compression="none", chromaticities=exr.AP0, is_aces_container=True)
    exr.write_exr(tmp_path / "a.exr", picture(4, 4), head)
    attributes = exr.read_exr(tmp_path / "a.exr").attributes
    assert attributes["acesImageContainerFlag"] == 1
    assert OpenEXR.checkColorMetadata(attributes) == OpenEXR.OK
    for changes in ({"compression": "zip"}, {"chromaticities": REC709}):
        with pytest.raises(ValueError, match="ACES"):
            exr.write_exr(tmp_path / "b.exr", picture(4, 4), dataclasses.replace(head, **changes))


@pytest.mark.parametrize(
    ("changes", "match"),
    [
        ({"rgb": (np.zeros((2, 2), np.float32),) * 3}, "float32"),
        ({"rgb": (np.zeros((2, 2, 1), np.float16),) * 3}, "shape"),
        ({"rgb": (np.zeros((0, 2), np.float16),) * 3}, "shape"),
        ({"rgb": (*picture(2, 2)[:2], np.zeros((2, 3), np.float16))}, "shape"),
        ({"alpha": np.zeros((2, 2), np.float32)}, "float32"),
        ({"layers": {"m.Y": np.zeros((3, 2), np.float16)}}, "shape"),
        ({"layers": {"m.Y": np.zeros((2, 2))}}, "float64"),
        ({"layers": {"R": np.zeros((2, 2), np.float16)}}, "name"),
        ({"header": header(compression="lzma")}, "lzma"),
    ],
)
def test_wrong_arguments(tmp_path, changes, match):
    arguments = {"rgb": picture(2, 2), "header": HEADER, **changes}
    with pytest.raises(ValueError, match=match):
        exr.write_exr(tmp_path / "a.exr", **arguments)
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize(
    "name", ["a b.exr", "100%d.exr", "x:y.exr", "é文.exr", "\udcff.exr", "x" * 251 + ".exr"]
)
def test_hostile_names(tmp_path, name):
    exr.write_exr(tmp_path / name, picture(2, 2), HEADER)
    assert exr.is_whole(tmp_path / name)
    assert os.listdir(tmp_path) == [name]


# What cannot be written


def fails_to_write(path, **kwargs):
    with pytest.raises(OutputError) as caught:
        exr.write_exr(path, picture(2, 2), HEADER, **kwargs)
    assert caught.value.where == str(path)
    assert caught.value.remedy
    return caught.value


def test_missing_folder(tmp_path):
    assert "folder" in fails_to_write(tmp_path / "gone" / "a.exr").what


def test_target_is_a_folder(tmp_path):
    (tmp_path / "a.exr").mkdir()
    fails_to_write(tmp_path / "a.exr")
    assert os.listdir(tmp_path) == ["a.exr"]


def test_name_too_long(tmp_path):
    fails_to_write(tmp_path / ("x" * 300))
    assert os.listdir(tmp_path) == []


@pytest.mark.skipif(os.name == "nt", reason="POSIX rights")
def test_no_right(tmp_path, monkeypatch):
    if os.geteuid() != 0:
        tmp_path.chmod(0o500)
    else:  # root may write anywhere: let the system refuse by hand

        def refuse(*_):
            raise PermissionError(13, "Permission denied")

        monkeypatch.setattr(os, "replace", refuse)
    assert "permission" in fails_to_write(tmp_path / "a.exr").what
    tmp_path.chmod(0o700)
    assert os.listdir(tmp_path) == []


def test_an_interrupt_leaves_no_temporary_file(tmp_path, monkeypatch):
    def interrupt(*_):
        raise KeyboardInterrupt

    exr.write_exr(tmp_path / "a.exr", picture(2, 2), HEADER)
    before = (tmp_path / "a.exr").read_bytes()
    monkeypatch.setattr(os, "replace", interrupt)
    with pytest.raises(KeyboardInterrupt):
        exr.write_exr(tmp_path / "a.exr", picture(9, 9), HEADER)
    assert os.listdir(tmp_path) == ["a.exr"]
    assert (tmp_path / "a.exr").read_bytes() == before


WRITE_UNTIL_FULL = """
    import dataclasses, sys
    sys.path.insert(0, sys.argv[2])
    from exr_pictures import HEADER, picture
    from itmo_video import errors
    from itmo_video.output import exr
    try:
        import resource
        if len(sys.argv) > 3:
            resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[3]),) * 2)
        head = dataclasses.replace(HEADER, compression="none")
        for number in range(50):
            size = 20 + 4 * number
            exr.write_exr(f"{sys.argv[1]}/{number}.exr", picture(size, size), head)
    except errors.OutputError as error:
        import os
        names = os.listdir(sys.argv[1])
        whole = [exr.is_whole(f"{sys.argv[1]}/{name}") for name in names]
        print(number == len(names) > 0, all(whole), "space" in str(error), error.exit_code)
"""


def test_file_size_limit(tmp_path):
    done = run_python(WRITE_UNTIL_FULL, tmp_path, Path(__file__).parent, 20000)
    assert done.stdout.split() == ["True", "True", "True", "5"], done.stderr


def test_full_disk(tmp_path):
    # In a mount name space of its own: the little disk is gone with the process.
    mount = f"mount -t tmpfs -o size=256k none '{tmp_path}' 2>/dev/null || exit 99; exec \"$@\""
    try:
        done = run_python(
            WRITE_UNTIL_FULL,
            tmp_path,
            Path(__file__).parent,
            prefix=("unshare", "-m", "sh", "-c", mount, "sh"),
        )
    except FileNotFoundError:
        pytest.skip("no unshare here to mount a small disk with")
    if done.returncode and not done.stdout:
        pytest.skip(f"a small disk cannot be mounted here: {done.stderr.strip()}")
    assert done.stdout.split() == ["True", "True", "True", "5"], done.stderr


# What is not whole


@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_cut_files_are_not_whole_and_quiet(tmp_path, capfd, compression):
    path = tmp_path / "a.exr"
    exr.write_exr(path, picture(70, 60), header(compression=compression))
    data = path.read_bytes()
    cuts = {0, 1, 3, 4, 8, 9, 50, 400, len(data) // 2, len(data) - 9, len(data) - 1}
    for cut in sorted(cuts | set(range(100, len(data), len(data) // 20))):
        path.write_bytes(data[:cut])
        assert not exr.is_whole(path), cut
        with pytest.raises(InputError) as caught:
            exr.read_exr(path)
        assert caught.value.where == str(path)
    assert capfd.readouterr() == ("", "")
    path.write_bytes(data)
    assert exr.is_whole(path)


def test_files_with_holes_are_not_whole(tmp_path):
    """A machine that dies may leave a file of full length and zeros from somewhere on."""
    path = tmp_path / "a.exr"
    exr.write_exr(path, picture(70, 60), HEADER)
    data = path.read_bytes()
    for start in range(0, len(data), len(data) // 30):
        path.write_bytes(data[:start] + bytes(len(data) - start))
        assert not exr.is_whole(path), start


def test_rotten_pixels_stay_out_of_standard_output(tmp_path, capsys):
    path, whole = tmp_path / "a.exr", tmp_path / "whole.exr"
    exr.write_exr(path, picture(70, 60), HEADER)
    exr.write_exr(whole, picture(70, 60), HEADER)
    data = bytearray(path.read_bytes())
    data[-100] ^= 1
    path.write_bytes(data)
    seen = []

    class Watched(types.ModuleType):
        def __setattr__(self, name, value):
            seen.append(name)
            super().__setattr__(name, value)

    kind = type(sys)
    sys.__class__ = Watched
    try:
        assert not exr.is_whole(path)
        assert exr.read_exr(whole).channels["R"].flags.writeable
    finally:
        sys.__class__ = kind
    print("after")
    assert capsys.readouterr().out == "after\n"
    assert "stdout" not in seen, "the whole process's standard output was swapped"


def test_other_files_are_not_whole(tmp_path, capfd):
    for name, data in (("t.exr", b"hello" * 100), ("j.exr", b"\xff\xd8\xff" * 40)):
        (tmp_path / name).write_bytes(data)
        assert not exr.is_whole(tmp_path / name)
    for path in (tmp_path / "missing.exr", tmp_path):
        assert not exr.is_whole(path)
        with pytest.raises(InputError, match=r"no such file|not a regular"):
            exr.read_exr(path)
    assert capfd.readouterr() == ("", "")


def test_fingerprint_behind_long_settings(tmp_path):
    path = tmp_path / "a.exr"
    exr.write_exr(path, picture(70, 60), header(settings_text="x" * 200_000))
    assert exr.read_exr(path).fingerprint == HEADER.fingerprint


@pytest.mark.parametrize("compression", ["NO", "ZIP", "PIZ", "B44A", "HTJ2K32", "ZSTD"])
def test_other_peoples_files_are_read(tmp_path, compression):
    """Float pixels, an offset data window, lines from the bottom up; no attributes of ours."""
    path = str(tmp_path / "theirs.exr")
    pixels = np.random.default_rng(0).random((50, 40, 3)).astype(np.float32)
    attributes = {
        "compression": getattr(OpenEXR, f"{compression}_COMPRESSION"),
        "type": OpenEXR.scanlineimage,
        "lineOrder": OpenEXR.DECREASING_Y,
        "dataWindow": (np.array([5, -7], np.int32), np.array([44, 42], np.int32)),
    }
    OpenEXR.File(attributes, {"RGB": pixels}).write(path)
    image = exr.read_exr(path)
    assert image.size == (40, 50)
    assert image.fingerprint is None
    assert np.array_equal(image.channels["G"], pixels[..., 1])


def test_tiled_files_are_read(tmp_path):
    path = str(tmp_path / "tiled.exr")
    tiles = OpenEXR.TileDescription()
    tiles.xSize = tiles.ySize = 32
    pixels = np.ones((50, 40), np.float16)
    OpenEXR.File({"type": OpenEXR.tiledimage, "tiles": tiles}, {"Y": pixels}).write(path)
    assert np.array_equal(exr.read_exr(path).channels["Y"], pixels)


# Temporary names


def test_temp_names_tell_their_owner(tmp_path):
    names = [atomic.temp_path(tmp_path / "a.exr").name for _ in range(3)]
    assert len(set(names)) == 3
    assert atomic.temp_owner(names[0]) == atomic.this_process(os.getpid())
    assert atomic.this_process(os.getpid()).pid == os.getpid()
    for other in ("a.exr", ".itmo-.tmp", ".itmo-h-b-1-2-3-4.exr", ".itmo-h-b-1-x-3-4.tmp"):
        assert atomic.temp_owner(other) is None


def test_encoding_to_memory_equals_the_librarys_own_file(tmp_path):
    attributes = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    rgb = dict(zip("RGB", picture(40, 50), strict=True))
    memory = io.BytesIO()
    OpenEXR.File(dict(attributes), dict(rgb), num_threads=0).write(memory)
    OpenEXR.File(dict(attributes), dict(rgb), num_threads=0).write(str(tmp_path / "a.exr"))
    assert memory.getvalue() == (tmp_path / "a.exr").read_bytes()


def noise(height, width):
    """Return R, G, B of random finite halves, which deflate cannot make smaller."""
    codes = np.random.default_rng(3).integers(0, 0x7C00, (3, height, width), dtype=np.uint16)
    return tuple(codes.view(np.float16))


@pytest.mark.parametrize("size", [(1, 1), (1, 7), (37, 50), (64, 33), (97, 16)])
def test_uncompressed_files_are_openexrs_to_the_byte(tmp_path, size):
    rgb, head = picture(*size), header(compression="none")
    exr.write_exr(tmp_path / "ours.exr", rgb, head, layers={"expand_map.Y": rgb[0]})
    channels = {**dict(zip("RGB", rgb, strict=True)), "expand_map.Y": rgb[0]}
    theirs = io.BytesIO()
    OpenEXR.File(exr._attributes(head), channels, num_threads=0).write(theirs)
    assert (tmp_path / "ours.exr").read_bytes() == theirs.getvalue()


@pytest.mark.parametrize("make", [picture, noise])
@pytest.mark.parametrize("size", [(1, 1), (16, 16), (37, 50), (97, 21)])
@pytest.mark.parametrize("compression", ["none", "zips", "zip"])
def test_what_we_lay_out_ourselves_opens_elsewhere(tmp_path, compression, size, make):
    """In OpenEXR, whose header must not tell it from its own, and in FFmpeg."""
    rgb, head = make(*size), header(compression=compression)
    exr.write_exr(tmp_path / "a.exr", rgb, head)
    channels = dict(zip("RGB", rgb, strict=True))
    whole = OpenEXR.File(exr._attributes(head), dict(channels), num_threads=0)
    whole.write(str(tmp_path / "b.exr"))
    ours, theirs = (exr.read_exr(tmp_path / name) for name in ("a.exr", "b.exr"))
    assert repr(ours.attributes) == repr(theirs.attributes)
    for name, plane in channels.items():
        assert np.array_equal(ours.channels[name].view(np.uint16), plane.view(np.uint16)), name
    with av.open(str(tmp_path / "a.exr")) as box:
        decoded = next(box.decode(video=0))
    height, width = size
    assert (decoded.format.name, decoded.height, decoded.width) == ("gbrpf16le", height, width)
    for name, plane in zip("GBR", decoded.planes, strict=True):
        codes = np.frombuffer(plane, np.uint16).reshape(-1, plane.line_size // 2)
        assert np.array_equal(codes[:height, :width], channels[name].view(np.uint16)), name
