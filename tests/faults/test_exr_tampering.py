"""What counts as a whole frame is what would be written, and hostile EXRs are cheap errors."""

from __future__ import annotations

import resource
import struct
from pathlib import Path

import pytest
from clips import SHARED, exr_bytes, moving_scene, write_ffv1
from exr_mutants import COMPRESSIONS, failures

from itmo_video.cli.main import main
from itmo_video.errors import InputError
from itmo_video.output.exr import read_exr
from itmo_video.output.exr_chunks import parse_header

FAULTS = SHARED / "data/fault_files"


def attribute_at(data: bytes, name: str) -> int:
    """Where the value of an attribute begins."""
    start = data.index(name.encode() + b"\0")
    return data.index(b"\0", start + len(name) + 1) + 5


def with_value(data: bytes, name: str, value: bytes, at: int = 0) -> bytes:
    start = attribute_at(data, name) + at
    return data[:start] + value + data[start + len(value) :]


def window(left: int, top: int, right: int, bottom: int) -> bytes:
    return struct.pack("<4i", left, top, right, bottom)


@pytest.fixture(scope="module", params=["zip", "none", "piz"])
def made(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    top = tmp_path_factory.mktemp("made")
    write_ffv1(top / "c.mkv", moving_scene(2, width=64, height=48))
    assert main(["convert", str(top / "c.mkv"), str(top / "o"), *flags(request.param)]) == 0
    return top


def flags(compression: str) -> list[str]:
    return ["--quiet", "--compression", compression]


CHANGES = {
    "moved": ("dataWindow", window(8, 0, 71, 47)),
    "moved down": ("dataWindow", window(0, 8, 63, 55)),
    "lower": ("dataWindow", window(0, 0, 63, 31)),
    "narrower": ("dataWindow", window(0, 0, 31, 47)),
    "wider": ("dataWindow", window(0, 0, 127, 47)),
    "shown elsewhere": ("displayWindow", window(8, 8, 71, 55)),
    "shown smaller": ("displayWindow", window(0, 0, 31, 31)),
    "gigantic": ("dataWindow", window(0, 0, 2**30, 2**30)),
    "inside out": ("dataWindow", window(63, 47, 0, 0)),
    "in other colours": ("chromaticities", struct.pack("<2f", 0.708, 0.292)),
    "with another white": ("whiteLuminance", struct.pack("<f", 100)),
    "by another name": ("colorInteropID", b"lin_rec2020_scene"[: len("lin_rec709_scene")]),
    "faster": ("framesPerSecond", struct.pack("<i", 25)),
    "anamorphic": ("pixelAspectRatio", struct.pack("<f", 2)),
    "upside down": ("lineOrder", b"\1"),
}


@pytest.mark.parametrize("change", CHANGES)
def test_a_changed_header_is_damage_and_is_mended(change: str, made: Path) -> None:
    out = made / "o"
    path = out / "c.0001.exr"
    whole = exr_bytes(out)
    compression = {"3": "zip", "0": "none", "4": "piz"}[
        str(parse_header(path.read_bytes())[0]["compression"][1][0])
    ]
    command = ["convert", str(made / "c.mkv"), str(out), *flags(compression)]
    path.write_bytes(with_value(whole["c.0001.exr"], *CHANGES[change]))
    assert main([*command, "--verify"]) == 7
    assert main(command) == 0
    assert exr_bytes(out) == whole


def test_no_rational_without_a_denominator(made: Path, tmp_path: Path) -> None:
    data = (made / "o/c.0001.exr").read_bytes()
    for name in ("framesPerSecond", "itmoTime"):
        path = tmp_path / f"{name}.exr"
        path.write_bytes(with_value(data, name, bytes(4), at=4))
        with pytest.raises(InputError, match="not a number"):
            read_exr(path)


@pytest.mark.parametrize("name", ["pixelAspectRatio", "screenWindowWidth", "screenWindowCenter"])
def test_an_attribute_that_swallows_the_next(name: str, made: Path, tmp_path: Path) -> None:
    """OpenEXR's reader of B44 ended in a segmentation fault over one."""
    data = bytearray((made / "o/c.0001.exr").read_bytes())
    data[attribute_at(bytes(data), name) - 4] += 88
    (tmp_path / "m.exr").write_bytes(data)
    with pytest.raises(InputError, match="not an intact EXR file"):
        read_exr(tmp_path / "m.exr")


@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_mutants_are_whole_or_refused(compression: str) -> None:
    bad = list(failures(compression, 60, seed=3))
    assert not bad, f"mutants went wrong: {bad}"


FAULTY = sorted(FAULTS.glob("exr/*.exr"))


@pytest.mark.skipif(not FAULTS.exists(), reason="needs ../shared")
@pytest.mark.parametrize("path", FAULTY, ids=lambda path: getattr(path, "stem", ""))
def test_shared_faults(path: Path) -> None:
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(InputError):
        read_exr(path)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 300_000
