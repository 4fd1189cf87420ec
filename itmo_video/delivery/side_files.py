"""Side files of a converted folder for other programs: Nuke, USD, OpenColorIO.

Each is a text file next to the frames, made only from the folder's content.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

from itmo_video.colour.primaries import INTEROP_IDS, OCIO_NAMES
from itmo_video.errors import OutputError, UsageError
from itmo_video.output.atomic import write_whole
from itmo_video.output.converted import open_converted
from itmo_video.output.folder import OutputFolder

_MARK = "written by itmo-video"


@dataclass(frozen=True)
class FrameSequence:
    """A sequence for side files: its frames by number, size in pixels, colour and rate."""

    folder: Path
    stem: str
    numbers: Sequence[int]
    size: tuple[int, int]
    frame_rate: Fraction
    primaries: str
    white_nits: float

    def file_name(self, number: int) -> str:
        """A frame's file name."""
        return OutputFolder(self.folder, self.stem).frame_path(number).name


def nuke_read(frames: FrameSequence) -> str:
    """A Read node to paste into Nuke's node graph; its path is absolute."""
    first, last = frames.numbers[0], frames.numbers[-1]
    path = f"{frames.folder.resolve().as_posix()}/{frames.stem.replace('%', '%%')}.%04d.exr"
    width, height = frames.size
    return (
        f"# {_MARK}\n"
        "Read {\n inputs 0\n file_type exr\n"
        f" file {_tcl(path)}\n"
        f' format "{width} {height} 0 0 {width} {height} 1 "\n'
        f" first {first}\n last {last}\n origfirst {first}\n origlast {last}\n origset true\n"
        f" colorspace {_tcl(OCIO_NAMES[frames.primaries])}\n"
        f" label {_tcl(f'1.0 = SDR white = {frames.white_nits:g} nits')}\n"
        f" name {_tcl(f'Read_{_word(frames.stem)}')}\n}}\n"
    )


def usd_dome_light(frames: FrameSequence) -> str:
    """A USD stage with a dome light of the panorama; a sequence becomes time samples."""

    def asset(number: int) -> str:
        return f"@@@./{frames.file_name(number)}@@@"

    numbers, space = frames.numbers, INTEROP_IDS[frames.primaries]
    attribute = "asset inputs:texture:file"
    samples = "".join(f"        {n}: {asset(n)},\n" for n in numbers)
    timed = f"    {attribute}.timeSamples = {{\n{samples}    }}\n" if numbers[1:] else ""
    rate = float(frames.frame_rate)
    return (
        f"#usda 1.0\n(\n    doc = {_quoted(_MARK)}\n"
        '    defaultPrim = "Dome"\n    upAxis = "Y"\n    metersPerUnit = 1\n'
        f"    startTimeCode = {numbers[0]}\n    endTimeCode = {numbers[-1]}\n"
        f"    timeCodesPerSecond = {rate:.9g}\n    framesPerSecond = {rate:.9g}\n)\n\n"
        'def DomeLight "Dome"\n{\n'
        f"    {attribute} = {asset(numbers[0])} (\n"
        f'        colorSpace = "{space}"\n    )\n'
        f"{timed}"
        '    token inputs:texture:format = "latlong"\n'
        "    float inputs:intensity = 1\n}\n"
    )


def ocio_note(frames: FrameSequence) -> str:
    """The colour space of the files as a rule for an OpenColorIO config's `file_rules` (YAML)."""
    name, space = OCIO_NAMES[frames.primaries], INTEROP_IDS[frames.primaries]
    rule = f"itmo_{_word(frames.stem)}"
    return (
        f"# {_MARK}: {frames.file_name(frames.numbers[0])} and the files next to it\n"
        f"# Linear light; 1.0 is SDR diffuse white, {frames.white_nits:g} nits. The files state\n"
        f"# their space in the attribute colorInteropID: {space}. In the ACES configs it is\n"
        f"# {name!r}. A config that does not read the attribute needs this rule:\n"
        "file_rules:\n"
        f"  - !<Rule> {{name: {rule}, pattern: {_quoted(f'*{_no_glob(frames.stem)}.*')}, "
        f"extension: exr, colorspace: {space}}}\n"
    )


KINDS: dict[str, tuple[str, Callable[[FrameSequence], str]]] = {
    "nuke": (".nk", nuke_read),
    "usd": ("_dome.usda", usd_dome_light),
    "ocio": ("_ocio.yaml", ocio_note),
}
"""The kinds by name: the end of the file name, and the function that writes the text."""


def check_kinds(kinds: Sequence[str], projection: str) -> None:
    """Raise UsageError for an unknown kind, or one that does not fit the projection."""
    if unknown := [kind for kind in kinds if kind not in KINDS]:
        raise UsageError(
            f"side-files: unknown {', '.join(unknown)}", remedy=f"Known: {', '.join(KINDS)}"
        )
    if "usd" in kinds and projection != "latlong":
        raise UsageError(
            "side-files: a USD dome light needs a panorama",
            remedy="If it is one, add --projection latlong.",
        )


def write_side_files(folder: str | Path, kinds: Sequence[str]) -> list[Path]:
    """Write the side files of a converted folder; returns their paths.

    An existing one of ours is updated; raises OutputError for any other file.
    """
    frames = _sequence_in(Path(folder))
    written = []
    for kind in kinds:
        ending, make = KINDS[kind]
        path = frames.folder / f"{frames.stem}{ending}"
        text = make(frames).encode("utf-8", "surrogateescape")
        if path.is_symlink() or (path.exists() and _MARK.encode() not in path.read_bytes()[:400]):
            raise OutputError(
                "file exists and was not written by itmo-video",
                where=str(path),
                remedy="Move it away, or omit this side file.",
            )
        write_whole(path, text)
        written.append(path)
    return written


def _sequence_in(folder: Path) -> FrameSequence:
    found = open_converted(folder)
    return FrameSequence(
        folder,
        found.manifest.stem,
        found.numbers,
        found.size,
        found.frame_rate,
        found.first_image.primaries,
        found.white_nits,
    )


def _word(text: str) -> str:
    """The text as a name of ASCII letters, digits and underscores, as Nuke's nodes demand."""
    return "".join(c if c.isascii() and c.isalnum() else "_" for c in text)


def _tcl(text: str) -> str:
    """A quoted word of Tcl, the language of Nuke's scripts."""
    return '"' + "".join("\\" + c if c in '\\"[]$' else c for c in text) + '"'


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'


def _no_glob(text: str) -> str:
    return "".join("?" if c in "*?[]\\" else c for c in text)
