"""Saving a preset and a shot list: atomically, and never over an unrelated file."""

from __future__ import annotations

import dataclasses
import hashlib
import os
import shlex
import unicodedata
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from itmo_video.analysis.reading import parse_analysis
from itmo_video.conversion.run_options import RunOptions
from itmo_video.errors import InputError, OutputError, UsageError
from itmo_video.options import flag_name
from itmo_video.output.atomic import RESUMES
from itmo_video.output.gate import ANALYSIS, Gate, Kind
from itmo_video.presets import load_preset, overriding, read_preset
from itmo_video.regular_file import StrPath
from itmo_video.studio.document import Document
from itmo_video.studio.studio_options import OF_RUN

_NAME_BYTES = 255  # of a file, on nearly all systems
_FORBIDDEN = '\\/:*?"<>|'
_UNSEEN = ("Cc", "Cs", "Zl", "Zp")  # control characters, half characters, breaks of lines
SUFFIXES = {"preset": ".toml", "shots": ".json"}
KINDS = {
    "preset": Kind("preset", lambda head: b"[settings]" in head or b"description" in head),
    "shots": ANALYSIS,
}


class ExistsError(OutputError):
    """A file of the same kind exists: the user may choose to replace it."""


class Saver:
    """Writes files by plain name into one folder; remembers what it has written."""

    def __init__(self, folder: Path, inputs: Iterable[StrPath] = ()) -> None:
        """`inputs` are the files of the clip, which are never overwritten."""
        self.folder, self._inputs = folder, tuple(inputs)
        self._written: dict[Path, str] = {}

    def path(self, name: str, suffix: str = "") -> Path:
        """The file or folder called `name`; raises UsageError unless it is a plain name."""
        if not name or name != os.path.basename(name) or name.startswith((".", "-")):
            raise UsageError(
                f"{name!r} is not a plain file name",
                remedy=f"Files are saved to {self.folder}: give a name without folders.",
            )
        if any(_is_odd(letter) for letter in name):
            raise UsageError(
                f"{name!r} contains characters that some systems do not allow",
                remedy="Choose another name.",
            )
        whole = name if name.endswith(suffix) else name + suffix
        if len(whole.encode()) > _NAME_BYTES:
            raise UsageError("the name is too long", remedy=f"Use at most {_NAME_BYTES} bytes.")
        return self.folder / whole

    def save(self, kind: str, name: str, document: Document, replace: bool) -> Path:
        """Write the document's settings ("preset") or its shots ("shots"); returns the path.

        An existing file is replaced if this object wrote it and it is unchanged, or with `replace`
        if it is of the same kind; otherwise raises ExistsError or OutputError.
        """
        if kind not in SUFFIXES:
            raise UsageError(f"{kind!r} is neither preset nor shots")
        path = self.path(name, SUFFIXES[kind])
        data = preset_toml(document) if kind == "preset" else shots_json(document)
        self._refuse(path, kind, document, replace)
        replaces = replace or self.is_ours(path)
        try:
            Gate(path, KINDS[kind], inputs=self._inputs, overwrite=replaces).write(data)
        except OutputError as error:
            remedy = (error.remedy or "").replace(RESUMES, "then save again")
            raise OutputError(error.what, where=error.where, remedy=remedy) from error
        self._written[path] = _digest(path)
        return path

    def is_ours(self, path: Path) -> bool:
        """Whether the file is unchanged since this object wrote it."""
        return path in self._written and path.is_file() and _digest(path) == self._written[path]

    def _refuse(self, path: Path, kind: str, document: Document, replace: bool) -> None:
        if not os.path.lexists(path) or self.is_ours(path):
            return
        if path.is_symlink() or not path.is_file() or not _same_kind(path, kind, document):
            expected = "preset" if kind == "preset" else "shot list of this clip"
            raise OutputError(
                f"file exists and is not a {expected}",
                where=str(path),
                remedy="Choose another name.",
            )
        if not replace:
            raise ExistsError("file exists", where=str(path), remedy="Replace it?")


def plain_name(stem: str) -> str:
    """A clip's name as one that `Saver.path` takes, with room for an ending."""
    plain = "".join("_" if _is_odd(letter) else letter for letter in stem).lstrip(".-").strip()
    return plain.encode()[: _NAME_BYTES - 40].decode("utf-8", "ignore") or "clip"


def _is_odd(letter: str) -> bool:
    return letter in _FORBIDDEN or unicodedata.category(letter) in _UNSEEN


def preset_toml(document: Document) -> bytes:
    """The clip's settings as a preset file, including those of the preset it is based on."""
    import tomli_w

    said = overriding(document.base, document.changed)
    settings = {flag_name(name): _plain(v) for name, v in said.items() if v is not None}
    content = {
        "description": f"saved in the studio, based on {document.preset}",
        "settings": settings,
    }
    return tomli_w.dumps(content).encode()


def shots_json(document: Document) -> bytes:
    """The shots in the format of `analyse`; raises UsageError before the clip is analysed."""
    if document.analysis is None:
        raise UsageError("the clip's cuts are not known yet", remedy="Wait a moment.")
    return document.analysis.to_json().encode("utf-8", "backslashreplace")


def command(
    document: Document,
    clip: str,
    output: str,
    preset: Path | None,
    shots: Path | None,
    kind: str = "convert",
    run: RunOptions | None = None,
) -> str:
    """The command that converts with this document (or makes a film), ready for a shell.

    Where the preset's file no longer says what was read from it, PRESET.toml stands for a new one.
    """
    words = ["itmo-video", kind, clip, output]
    if preset is not None:
        words += ["--preset", str(preset)]
    elif not is_as_read(document):
        words += ["--preset", "PRESET.toml"]
    else:
        named = document.preset
        words += ["--preset", os.path.abspath(named) if named.endswith(".toml") else named]
        for name, value in document.changed.items():
            words += _flag(name, value)
    for f in dataclasses.fields(run) if run else ():
        if f.name in OF_RUN and f.name != "analysis" and getattr(run, f.name) != f.default:
            words += _flag(f.name, getattr(run, f.name))
    if shots is not None:
        words += ["--analysis", str(shots)]
    return " ".join(map(_quoted, words))


def is_as_read(document: Document) -> bool:
    """Whether the preset's file still says what the document is based on."""
    try:
        return load_preset(document.preset) == document.base
    except UsageError:
        return False


def _flag(name: str, value: Any) -> list[str]:
    flag = flag_name(name)
    if isinstance(value, bool):
        return [f"--{flag}" if value else f"--no-{flag}"]
    if isinstance(value, dict):
        return [f"--operator-param={key}={_said(v)}" for key, v in value.items()]
    # In one word with the flag: what begins with a dash would be taken for another one.
    text = ",".join(map(str, value)) if isinstance(value, list | tuple) else _said(value)
    return [f"--{flag}={text}"] if text.startswith("-") or not text else [f"--{flag}", text]


def _said(value: Any) -> str:
    return repr(value).removesuffix(".0") if isinstance(value, float) else str(value)


def _quoted(word: str) -> str:
    """A word for a shell; one with bytes or characters that cannot be copied, as bash escapes."""
    if all(letter.isprintable() for letter in word):
        return shlex.quote(word)
    escaped = "".join(
        chr(byte) if 32 <= byte < 127 and chr(byte) not in "\\'" else f"\\x{byte:02x}"
        for byte in os.fsencode(word)
    )
    return f"$'{escaped}'"


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value


def _same_kind(path: Path, kind: str, document: Document) -> bool:
    try:
        if kind == "preset":
            read_preset(str(path))
            return True
        found = parse_analysis(path.read_text("utf-8"), where=str(path))
    except (InputError, UsageError, OSError, UnicodeDecodeError):
        return False
    return document.analysis is not None and found.digest == document.analysis.digest


def _digest(path: Path) -> str:
    return hashlib.blake2b(path.read_bytes()).hexdigest()
