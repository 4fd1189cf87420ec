"""The reference as Markdown, from the definitions that the program itself runs by.

python docs/site/reference.py rewrites docs/reference/, which a test keeps current: readers of the
repository find it there, and the site is built from it.
"""

from __future__ import annotations

import dataclasses
import html
import inspect
import json
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, Literal, get_origin

import itmo_video
from itmo_video import events
from itmo_video.cli.main import _parser
from itmo_video.cli.manual import EXIT_CODES
from itmo_video.cli.parser_facts import Command, commands_of
from itmo_video.delivery import choices
from itmo_video.operators import OPERATORS
from itmo_video.options import Spec, flag_name, flag_of, spec_of
from itmo_video.output.exr_attributes import ATTRIBUTES, LAYER_CHANNELS
from itmo_video.presets import load_preset, make_settings, preset_names, read_preset
from itmo_video.settings import LOOK, Settings


def pages() -> dict[str, str]:
    """Every page of the reference by its file's stem."""
    return {
        "command_line": command_line(),
        "settings": settings(),
        "presets": presets(),
        "operators": operators(),
        "exit_codes": exit_codes(),
        "exr_attributes": exr_attributes(),
        "events": event_lines(),
        "python_api": python_api(),
    }


def command_line() -> str:
    """Commands, arguments and flags, off the parser."""
    commands = commands_of(_parser())
    parts = ["# Command line", _table(("command", "what it does"), map(_row_of_command, commands))]
    for command in commands:
        parts += [
            f"## {command.name}",
            _escaped(command.description),
            f"```text\nitmo-video {command.name} {command.usage}\n```",
        ]
        if command.arguments:
            rows = ((f"`{name}`", _escaped(text)) for name, text in command.arguments)
            parts.append(_table(("argument", ""), rows))
        if command.flags:
            parts.append(_table(("option", ""), _flag_rows(command)))
    return _page(parts)


def settings() -> str:
    """All settings with bounds, and the default that `default` gives."""
    defaults = vars(make_settings())
    parts = [
        "# Settings",
        "Each is a flag of `convert`, `preview`, `analyse`, `studio` and `variants`, a key under "
        "`[settings]` in a preset's TOML, and an argument of `make_settings` in Python "
        "(underscores for dashes). A setting of the look may also be given to a single shot, in "
        "the file that `analyse` writes.",
    ]
    for title, is_look in (("The look", True), ("The clip and its files", False)):
        rows = [
            (f"`{flag_of(f)}`", _help(spec_of(f)), _values(spec_of(f)), _default(defaults[f.name]))
            for f in dataclasses.fields(Settings)
            if (f.name in LOOK) == is_look
        ]
        parts += [f"## {title}", _table(("setting", "meaning", "values", "default"), rows)]
    return _page(parts)


def presets() -> str:
    """What each preset is for and sets."""
    parts = ["# Presets", "Flags override a preset: `--preset ibl --peak-nits 2000`."]
    for name in preset_names():
        rows = [
            (f"`{flag_name(key)}`", f"`{json.dumps(v)}`") for key, v in load_preset(name).items()
        ]
        parts += [f"## {name}", _escaped(str(read_preset(name).get("description", ""))) + "."]
        parts.append(_table(("setting", "value"), rows))
    return _page(parts)


def operators() -> str:
    """The inverse tone mapping operators with parameters and sources."""
    parts = [
        "# Operators",
        "Inverse tone mapping operators, chosen by `--operator NAME`. A parameter is set by "
        "`--operator-param NAME=VALUE`.",
    ]
    for operator in OPERATORS.values():
        parts += [f"## {operator.name}", f"{_escaped(operator.summary)}.".replace("..", ".")]
        parts.append(f"Source: {_escaped(operator.source)}")
        rows = [
            (f"`{name}`", _escaped(p.help), f"{p.default:g}", f"{p.lower:g} to {p.upper:g}")
            for name, p in operator.parameters.items()
        ]
        if rows:
            parts.append(_table(("parameter", "meaning", "default", "bounds"), rows))
    return _page(parts)


def exit_codes() -> str:
    """Exit codes, and the exceptions that own them."""
    owners: dict[str, list[str]] = {}
    for name in itmo_video.__all__:
        kind = getattr(itmo_video, name)
        if inspect.isclass(kind) and issubclass(kind, itmo_video.ItmoError):
            owners.setdefault(str(kind.exit_code), []).append(f"`{name}`")
    rows = [(code, text, ", ".join(owners.get(code, ()))) for code, text in EXIT_CODES]
    return _page(
        [
            "# Exit codes",
            _table(("code", "meaning", "exception in Python"), rows),
            "An error is one or two lines on standard error: what happened, where, what to do. "
            "`ITMO_VIDEO_DEBUG=1` adds the traceback. After an interruption (130, 143), or once "
            "the cause of any other failure is removed, run the same command to resume.",
        ]
    )


def exr_attributes() -> str:
    """What a frame's header and its channels hold."""
    return _page(
        [
            "# EXR attributes",
            "Half-float scan-line files. 1.0 is SDR diffuse white; `R`, `G`, `B` are linear light.",
            "## Header",
            _table(
                ("attribute", "meaning"), ((f"`{n}`", _escaped(t)) for n, t in ATTRIBUTES.items())
            ),
            "## Channels of the layers",
            "Requested by `--layers`.",
            _table(
                ("layer", "channel", "meaning"),
                ((f"`{n.split('.')[0]}`", f"`{n}`", t) for n, t in LAYER_CHANNELS.items()),
            ),
        ]
    )


def event_lines() -> str:
    """What `--json` prints and `on_event` is called with."""
    parts = [
        "# Events",
        "`convert` and `preview` report events: with `--json` as one line of JSON each, in Python "
        "as a dataclass passed to `on_event`. Values that a command does not know are omitted "
        "from the JSON.",
    ]
    for kind in (
        events.Started,
        events.FrameDone,
        events.Warned,
        events.Finished,
        events.Failed,
    ):
        rows = [(f"`{f.name}`", f"`{f.type}`") for f in dataclasses.fields(kind)]
        parts += [f"## {kind.__name__}", f'`"event": "{kind.name}"`', _docstring(kind)]
        parts.append(_table(("value", "type"), rows))
    return _page(parts)


def python_api() -> str:
    """The public names, in the order of their kinds."""
    named = {name: getattr(itmo_video, name) for name in itmo_video.__all__ if name[0] != "_"}
    functions = {n: v for n, v in named.items() if inspect.isfunction(v)}
    errors = {n: v for n, v in named.items() if inspect.isclass(v) and issubclass(v, BaseException)}
    rest = {n: v for n, v in named.items() if n not in functions and n not in errors}
    parts = [
        "# Python API",
        "Everything is imported from `itmo_video`; modules inside are private.",
    ]
    for title, members in (("Functions", functions), ("Types", rest), ("Errors", errors)):
        parts.append(f"## {title}")
        for name, value in sorted(members.items(), key=lambda item: item[0].lower()):
            parts += [f"### {name}", *_member(name, value)]
    return _page(parts)


def _member(name: str, value: Any) -> list[str]:
    if inspect.isfunction(value):
        return [f"```python\n{_signature(name, value)}\n```", _docstring(value)]
    if not inspect.isclass(value):  # an alias of types
        return [f"`{value}`".replace("itmo_video.events.", "")]
    parts = [_docstring(value)]
    if name == "Settings":
        parts.append("Its fields are the [settings](settings.md), with underscores for dashes.")
    elif dataclasses.is_dataclass(value):
        rows = [
            (f"`{f.name}`", f"`{_type(f)}`", _help(f.metadata["spec"]) if f.metadata else "")
            for f in dataclasses.fields(value)
        ]
        parts.append(_table(("field", "type", ""), rows))
    return parts


def _type(field: dataclasses.Field[Any]) -> str:
    """A field's type, with the words that can be chosen in place of their type's name."""
    found = re.fullmatch(r"(\w+)( \| None)?", str(field.type))
    named = vars(choices).get(found[1]) if found else None
    if found is None or get_origin(named) is not Literal:
        return str(field.type)
    return repr(named).removeprefix("typing.") + (found[2] or "")


def _signature(name: str, function: Any) -> str:
    signature = inspect.signature(function)
    parts, is_keyword_only = [], False
    for p in signature.parameters.values():
        if p.kind is p.KEYWORD_ONLY and not is_keyword_only:
            is_keyword_only = True
            parts.append("*")
        stars = "*" if p.kind is p.VAR_POSITIONAL else "**" if p.kind is p.VAR_KEYWORD else ""
        default = getattr(p.default, "__name__", repr(p.default))  # a function by its name
        parts.append(
            f"{stars}{p.name}: {p.annotation}" + ("" if p.default is p.empty else f" = {default}")
        )
    one_line = f"{name}({', '.join(parts)}) -> {signature.return_annotation}"
    if len(one_line) <= 90:
        return one_line
    lines = "".join(f"    {part},\n" for part in parts)
    return f"{name}(\n{lines}) -> {signature.return_annotation}"


def _docstring(value: Any) -> str:
    """A docstring as Markdown: its doctests become blocks of code."""
    lines, out = (inspect.getdoc(value) or "").splitlines(), list[str]()
    is_code = False
    for line in lines:
        if not is_code and line.startswith(">>>"):
            out += ["```pycon", line]
            is_code = True
        elif is_code and not line:
            out += ["```", ""]
            is_code = False
        else:
            out.append(line if is_code else _escaped(line))
    return "\n".join([*out, "```"] if is_code else out)


def _row_of_command(command: Command) -> tuple[str, str]:
    return f"[`{command.name}`](#{command.name})", _escaped(command.help)


def _flag_rows(command: Command) -> Iterable[tuple[str, str]]:
    for flag in command.flags:
        names = ", ".join(f"`{n}`" for n in flag.names)
        value = f" {_code(flag.metavar)}" if flag.metavar else ""
        yield names + value, _escaped(flag.help)


def _values(spec: Spec) -> str:
    if spec.choices:
        return ", ".join(f"`{choice}`" for choice in spec.choices)
    if spec.kind is bool:
        return "on, off"
    return spec.bounds_in_words or _escaped(spec.metavar or "")


def _default(value: Any) -> str:
    if isinstance(value, bool):
        return "on" if value else "off"
    if value is None or value in ((), {}):
        return ""
    return f"`{value:g}`" if isinstance(value, float) else f"`{value}`"


def _help(spec: Spec) -> str:
    return _escaped(spec.help)


def _escaped(text: str) -> str:
    """Plain text as Markdown: what would be markup is not; code between backticks stays."""
    parts = re.split(r"(`[^`]*`)", text)
    return "".join(
        _code(part[1:-1])
        if n % 2
        else re.sub(r"([|*_\[\]])", r"\\\1", html.escape(part, quote=False))
        for n, part in enumerate(parts)
    )


def _code(text: str) -> str:
    """Code in a cell of a table, where a bar must not end it."""
    if "|" not in text:
        return f"`{text}`"
    return f"<code>{html.escape(text, quote=False).replace('|', '&#124;')}</code>"


def _table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)


def _page(parts: Iterable[str]) -> str:
    return "\n\n".join(parts) + "\n"


if __name__ == "__main__":
    folder = Path(__file__).resolve().parents[1] / "reference"
    folder.mkdir(exist_ok=True)
    for name, text in pages().items():
        (folder / f"{name}.md").write_text(text, "utf-8")
