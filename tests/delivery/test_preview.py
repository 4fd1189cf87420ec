"""Previews as players see them: tags, light levels, pixels in nits, sound and time stamps."""

from __future__ import annotations

import json
import shutil
import struct
import subprocess
import zlib
from contextlib import closing
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
import pytest
from clips import moving_scene, write_ffv1, write_film
from oracles import hlg_nits

from itmo_video import make_settings
from itmo_video.cli.main import main
from itmo_video.colour import chroma, primaries, transfer
from itmo_video.conversion.convert import RunOptions, convert
from itmo_video.delivery import hdr, metadata, sdr
from itmo_video.delivery.film_spec import HIGH_CRF, FilmSpec
from itmo_video.delivery.film_writer import FilmWriter
from itmo_video.delivery.in_order import Closed, InOrder, run_in_order
from itmo_video.delivery.preview import PreviewOptions, PreviewSummary, preview
from itmo_video.errors import UsageError
from itmo_video.output.exr import read_exr
from itmo_video.output.gate import FILM, Gate

PEAK = 1000.0
FILMS = [
    ("hdr10", "av1", ".mp4"),
    ("hdr10", "av1", ".mkv"),
    ("hdr10", "hevc", ".mp4"),
    ("hdr10", "prores", ".mov"),
    ("hlg", "av1", ".mp4"),
    ("hlg", "hevc", ".mp4"),
]


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("clip")
    frames = moving_scene(14, width=192, height=128, cuts=(9,))
    return write_ffv1(folder / "scene.mkv", [cv2.GaussianBlur(f, (0, 0), 2) for f in frames])


@pytest.fixture(scope="module")
def exrs(clip: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("exr") / "out"
    convert(clip, folder, make_settings(peak_nits=PEAK))
    return folder


def nits_of(folder: Path) -> list[np.ndarray[Any, Any]]:
    """BT.2020 R, G, B in nits of each EXR (3, H, W), by float64 and another road than ours."""
    matrix = primaries.rgb_to_rgb_matrix("rec709", "rec2020")
    out = []
    for path in sorted(folder.glob("*.exr")):
        channels = read_exr(path).channels
        rgb = np.stack([channels[c].astype(np.float64) for c in "RGB"]) * 203.0
        out.append(np.clip(np.einsum("ij,jhw->ihw", matrix, rgb), 0, PEAK))
    return out


def decoded_nits(path: Path, view: str) -> list[np.ndarray[Any, Any]]:
    out = []
    with av.open(str(path)) as box:
        for frame in box.decode(video=0):
            planes = []
            for plane in frame.planes:
                rows = np.frombuffer(memoryview(plane), np.uint16).reshape(plane.height, -1)
                planes.append(rows[:, : plane.width].copy())
            size = (frame.width, frame.height)
            y = (planes[0] - 64.0) / 876
            cb, cr = ((chroma.upsample_chroma(p, size, "left") - 512) / 896 for p in planes[1:])
            red, blue = y + 1.4746 * cr, y + 1.8814 * cb
            green = (y - 0.2627 * red - 0.0593 * blue) / 0.6780
            code = np.stack([red, green, blue])
            out.append(transfer.pq_nits(code) if view == "hdr10" else hlg_nits(code, PEAK))
    return out


@pytest.mark.parametrize(("view", "codec", "suffix"), FILMS)
def test_film_is_tagged_measured_and_shows_the_exrs_nits(
    clip: Path, exrs: Path, tmp_path: Path, view: str, codec: str, suffix: str
) -> None:
    film = tmp_path / f"film{suffix}"
    options = PreviewOptions(view=view, codec=codec, crf=HIGH_CRF.get(codec))  # type: ignore[arg-type]
    summary = preview(clip, film, make_settings(peak_nits=PEAK), options=options)
    truth = nits_of(exrs)
    largest = [frame.max(axis=0) for frame in truth]
    max_cll, max_fall = max(m.max() for m in largest), max(m.mean() for m in largest)
    assert summary.max_cll == pytest.approx(max_cll, rel=0.01), "MaxCLL differs from the EXRs'"
    assert summary.max_fall == pytest.approx(max_fall, rel=0.01), "MaxFALL differs from the EXRs'"
    told = told_by_stream(film)
    assert told["tags"] == (9, 16 if view == "hdr10" else 18, 9, 1), "primaries, transfer, ..."
    if view == "hdr10":
        if codec != "prores":
            assert told["light"][0] == pytest.approx(max_cll, rel=0.01), "MaxCLL in the stream"
            assert told["light"][1] == pytest.approx(max_fall, abs=0.01 * max_fall + 0.5)
            assert told["mastering"] == pytest.approx((PEAK, 0.005), rel=0.02), "mastering display"
        if suffix != ".mkv":
            check_boxes(film, max_cll, max_fall)
    shown = decoded_nits(film, view)
    assert len(shown) == len(truth), "frames are missing"
    errors, peaks = [], []
    for is_, should in zip(shown, truth, strict=True):
        luminance_is, luminance_should = (np.array([0.2627, 0.678, 0.0593]) @ p.reshape(3, -1)
                                          for p in (is_, should))  # fmt: skip
        errors.append(np.abs(luminance_is - luminance_should) / np.maximum(luminance_should, 0.05))
        peaks.append((is_.max(), should.max()))
    median = float(np.median(np.concatenate(errors)))
    assert median <= 0.02, f"{view} {codec}: median error {median:.2%} of luminance"
    peak_is, peak_should = np.max(peaks, axis=0)
    assert peak_is == pytest.approx(peak_should, rel=0.05), "the peak is not where it was"


def test_ffprobe_sees_chroma_sited_left(clip: Path, tmp_path: Path) -> None:
    if shutil.which("ffprobe") is None:
        pytest.skip("ffprobe is not installed")
    films = {"a.mp4": "hdr10", "a.mkv": "sdr", "b.mp4": "hlg", "still.avif": "hdr10"}
    for name, view in films.items():
        path = tmp_path / name
        one = ["--frame", "2"] if path.suffix == ".avif" else ["--frames", "2-3"]
        assert main(["preview", "--quiet", str(clip), str(path), "--as", view, *one]) == 0
        command = ["ffprobe", "-v", "error", "-show_streams", "-of", "json", str(path)]
        told = json.loads(subprocess.run(command, capture_output=True, check=True).stdout)
        assert told["streams"][0]["chroma_location"] == "left", name


def told_by_stream(film: Path) -> dict[str, Any]:
    with av.open(str(film)) as box:
        stream = box.streams.video[0]
        c = stream.codec_context
        told: dict[str, Any] = {
            "tags": (
                int(c.color_primaries),
                int(c.color_trc),
                int(c.colorspace),
                int(c.color_range),
            )
        }
        frame = next(box.decode(video=0))
        found = {
            data.type.name: bytes(data)
            for data in map(frame.side_data.__getitem__, range(len(frame.side_data)))
        }
        # PyAV 19 (FFmpeg 9) tells what holds for the whole stream on the decoder alone.
        for kind, data in getattr(c, "decoded_side_data", {}).items():
            found.setdefault(kind.name, data)
        if (light := found.get("CONTENT_LIGHT_LEVEL")) is not None:
            told["light"] = struct.unpack("<2I", light[:8])
        if (mastering := found.get("MASTERING_DISPLAY_METADATA")) is not None:
            numbers = struct.unpack("<20i", mastering[:80])
            told["mastering"] = numbers[18] / numbers[19], numbers[16] / numbers[17]
    return told


def check_boxes(film: Path, max_cll: float, max_fall: float) -> None:
    """The container's own mdcv and clli, as ffprobe reads them; by bytes where it is missing."""
    data = film.read_bytes()
    at = data.index(b"clli")
    cll, fall = struct.unpack_from(">2H", data, at + 4)
    assert cll == pytest.approx(max_cll, rel=0.01), "MaxCLL in the container"
    assert fall == pytest.approx(max_fall, abs=0.01 * max_fall + 0.5), "MaxFALL in the container"
    if not shutil.which("ffprobe"):
        return
    command = ["ffprobe", "-v", "error", "-show_streams", "-of", "json", str(film)]
    told = json.loads(subprocess.run(command, capture_output=True, check=True).stdout)
    video = told["streams"][0]
    by_type = {d["side_data_type"]: d for d in video["side_data_list"]}
    assert by_type["Content light level metadata"]["max_content"] == cll
    assert by_type["Mastering display metadata"]["max_luminance"] == "10000000/10000"
    assert video["color_transfer"] == "smpte2084"
    assert video["color_primaries"] == "bt2020"
    assert video["color_range"] == "tv"


def test_folder_and_clip_make_the_same_film(clip: Path, exrs: Path, tmp_path: Path) -> None:
    one, two = tmp_path / "one.mp4", tmp_path / "two.mp4"
    settings = make_settings(peak_nits=PEAK)
    first: PreviewSummary = preview(clip, one, settings)
    second = preview(exrs, two)
    assert (first.max_cll, first.max_fall) == (second.max_cll, second.max_fall)
    assert (decoded_nits(one, "hdr10")[5] == decoded_nits(two, "hdr10")[5]).all(), "other pixels"


def test_sound_stays_in_step(tmp_path: Path) -> None:
    source = write_film(tmp_path / "loud.mp4", moving_scene(50), sound=("aac", "ac3"))
    film = tmp_path / "film.mp4"
    # The operator does not matter; without a map it is quick.
    preview(source, film, make_settings(expand_map=False), options=PreviewOptions(speed="12"))
    with av.open(str(source)) as was, av.open(str(film)) as is_:
        assert len(is_.streams.audio) == len(was.streams.audio), "a sound track is lost"
        frame = 1 / was.streams.video[0].average_rate
        assert len(was.streams.audio) == 2
        pairs = list(zip(was.streams.audio, is_.streams.audio, strict=True))
        for old, new in [(was.streams.video[0], is_.streams.video[0]), *pairs]:
            before = float(old.duration * old.time_base)
            after = float(new.duration * new.time_base)
            assert after == pytest.approx(before, abs=float(frame)), f"duration of {new.type}"
            assert new.type != "audio" or new.codec.name == old.codec.name
        first = [next(box.demux(box.streams.audio[0])).pts for box in (was, is_)]
        assert first[0] == first[1], "sound is shifted"


def test_variable_frame_rate_keeps_its_time_stamps(tmp_path: Path) -> None:
    stamps = [0, 512, 1024, 3000, 3100, 6000, 6512, 9001]
    clip = tmp_path / "vfr.mp4"
    with av.open(str(clip), "w") as box:
        stream: Any = box.add_stream("libx264", rate=25, options={"bf": "0"})
        stream.width, stream.height, stream.pix_fmt = 97, 65, "yuv444p"
        stream.codec_context.time_base = Fraction(1, 12800)
        for i, pts in enumerate(stamps):
            frame = av.VideoFrame.from_ndarray(np.full((65, 97, 3), 20 * i, np.uint8), "rgb24")
            frame.pts, frame.time_base = pts, Fraction(1, 12800)
            box.mux(stream.encode(frame))
        box.mux(stream.encode())
    for codec, suffix in (("av1", ".mp4"), ("hevc", ".mp4"), ("prores", ".mov")):
        film = tmp_path / f"{codec}{suffix}"
        preview(clip, film, options=PreviewOptions(codec=codec))  # type: ignore[arg-type]
        with av.open(str(film)) as box:
            assert (box.streams.video[0].width, box.streams.video[0].height) == (98, 66), "padding"
            times = [f.pts * f.time_base for f in box.decode(video=0)]
        assert times == [Fraction(s, 12800) for s in stamps], f"{codec}: time stamps moved"


@pytest.mark.parametrize("frames", [1, 2])
def test_hevc_of_few_frames_has_times(tmp_path: Path, frames: int) -> None:
    """x265 alone gives them a decoding time by chance: one film in seven could not be written."""
    base = Fraction(1, 25)
    spec = FilmSpec(64, 48, 1 / base, base, Fraction(1), "hlg", "hevc", speed="ultrafast")
    grey = (np.full((48, 64), 512, np.uint16), *[np.full((24, 32), 512, np.uint16)] * 2)
    for number in range(12):
        path = tmp_path / f"{number}.mp4"
        with closing(FilmWriter(Gate(path, FILM), spec)) as film:
            for index in range(frames):
                film.write(grey, index * base)
            film.finish(None)
        with av.open(str(path)) as box:
            times = [(p.pts * p.time_base, p.dts * p.time_base) for p in box.demux() if p.size]
        assert times == [(index * base, index * base) for index in range(frames)]


def test_chapters_and_the_shape_of_pixels_stay(tmp_path: Path) -> None:
    clip = tmp_path / "wide.mp4"
    with av.open(str(clip), "w") as box:
        stream: Any = box.add_stream("libx264", rate=25)
        stream.width, stream.height, stream.pix_fmt = 96, 64, "yuv420p"
        stream.codec_context.sample_aspect_ratio = Fraction(4, 3)
        base = Fraction(1, 1000)
        box.set_chapters(
            [
                {"id": i, "start": 200 * i, "end": 200 * i + 200, "time_base": base,
                 "metadata": {"title": f"Part {i}"}} for i in range(2)
            ]
        )  # fmt: skip
        for i in range(10):
            frame = av.VideoFrame.from_ndarray(np.full((64, 96, 3), 20 * i, np.uint8), "rgb24")
            frame.pts, frame.time_base = i, Fraction(1, 25)
            box.mux(stream.encode(frame))
        box.mux(stream.encode())
    film = tmp_path / "film.mp4"
    preview(clip, film)
    with av.open(str(film)) as box:
        titles = [chapter["metadata"]["title"] for chapter in box.chapters()]
        assert titles == ["Part 0", "Part 1"], "chapters are lost"
        assert box.streams.video[0].sample_aspect_ratio == Fraction(4, 3), "pixels changed shape"
    with pytest.raises(UsageError):
        preview(clip, tmp_path / "film.mkv")


def test_stills(clip: Path, tmp_path: Path) -> None:
    def make(name: str, *more: str) -> Path:
        path = tmp_path / name
        assert main(["preview", str(clip), str(path), "--frame", "3", "--quiet", *more]) == 0
        return path

    png = make("a.png").read_bytes()
    at = png.index(b"cICP")
    assert png[at + 4 : at + 8] == bytes((9, 16, 0, 1)), "not tagged as PQ BT.2020"
    assert png[at + 8 : at + 12] == struct.pack(">I", zlib.crc32(png[at : at + 8])), "bad CRC"
    assert at < png.index(b"IDAT"), "cICP must come first"
    assert cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_UNCHANGED).dtype == np.uint16
    with av.open(str(make("a.avif", "--crf", "1"))) as box:
        frame = next(box.decode(video=0))
    assert frame.format.name == "yuv420p10le", "AVIF is not 10 bit"
    assert (int(frame.color_primaries), int(frame.color_trc)) == (9, 16), "AVIF is not tagged PQ"
    for view, size in (("sdr", (128, 192)), ("compare", (128, 384)), ("ladder", (64, 288))):
        picture = cv2.imread(str(make(f"{view}.jpg", "--as", view)))
        assert picture.shape[:2] == size, view
    legend = cv2.imread(str(make("false.jpg", "--as", "false-colour", "--scale", "nits")))
    assert legend.shape[0] > 128, "no legend below false colour"


@pytest.mark.parametrize("name", sorted(sdr.TONE_MAPS))
def test_tone_maps_rise_and_stay_in_sdr(name: str) -> None:
    level = np.geomspace(1e-3, 5, 200).astype(np.float32)
    out = sdr.tone_mapped(np.dstack([level[None]] * 3), name, 5.0)[0, :, 0]
    # The factor is looked up by a half float, whose own step is 5e-4.
    assert (np.diff(out) >= -5e-4).all(), f"{name} is not monotonic"
    assert out.max() <= 1
    assert out[-1] > 0.9, f"{name} does not bring the peak to white"


@pytest.mark.parametrize(
    ("output", "options"),
    [
        ("x.avi", []),
        ("x.mov", []),
        ("x.mp4", ["--codec", "prores"]),
        ("x.mp4", ["--chroma", "422"]),
        ("x.jpg", []),
        ("x.mp4", ["--frame", "1"]),
        ("x.jpg", ["--frame", "1", "--as", "hlg"]),
        ("x.mp4", ["--crf", "99"]),
    ],
)
def test_wrong_use_is_told(clip: Path, tmp_path: Path, output: str, options: list[str]) -> None:
    assert main(["preview", str(clip), str(tmp_path / output), *options]) == UsageError.exit_code
    assert not list(tmp_path.iterdir()), "something was left behind"


def test_high_quality_is_asked_for_by_a_word(clip: Path, tmp_path: Path) -> None:
    made = []
    for quality in ("high", "1"):
        film = tmp_path / f"{quality}.mp4"
        flags = ["--quality", quality, "--frames", "1-2", "--quiet"]
        assert main(["preview", str(clip), str(film), *flags]) == 0
        made.append(film.stat().st_size)
    assert made[0] == made[1], "high is CRF 1"
    assert main(["preview", str(clip), str(tmp_path / "no.mp4"), "--quality", "best"]) == 2


def test_a_failing_picture_ends_the_preview(clip: Path, tmp_path: Path) -> None:
    """No thread waits for a frame that will never come."""
    from itmo_video.delivery import from_clip, pictures

    source = from_clip.from_clip(clip, make_settings(), RunOptions(jobs=3))

    def work(picture: pictures.Picture) -> int:
        if picture.index == 2:
            raise ZeroDivisionError
        return picture.index

    with pytest.raises(ZeroDivisionError):
        list(source.mapped(work))


def test_frames_come_in_order_whatever_the_threads_do() -> None:
    def make(buffer: InOrder[int]) -> None:
        buffer.plan([3, 5, 7])
        for index in (5, 7, 3):
            buffer.put(index, index * 10)

    assert list(run_in_order(make, 3)) == [30, 50, 70]
    stopped = run_in_order(make, 1 << 20)
    assert next(stopped) == 30
    stopped.close()  # type: ignore[attr-defined]


def test_put_tells_that_the_reader_left() -> None:
    buffer: InOrder[int] = InOrder(1)
    buffer.plan([0, 1])
    buffer.close()
    with pytest.raises(Closed):
        buffer.put(1, 1)


def test_light_levels_that_would_be_escaped_are_moved_by_a_nit() -> None:
    assert metadata._unescaped(hdr.Light(512, 2)) == (513, 2), "H.265 would escape 00 00 02"
    assert metadata._unescaped(hdr.Light(512, 80)) == (512, 80)
