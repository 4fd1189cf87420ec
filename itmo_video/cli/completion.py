"""`completion`: scripts for bash, zsh and fish that complete commands, flags and values."""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from itmo_video.cli.parser_facts import Command, Flag

PROGRAM = "itmo-video"

WHERE = """\
install it, then open a new shell:
  bash:
    mkdir -p ~/.local/share/bash-completion/completions
    itmo-video completion bash \\
      > ~/.local/share/bash-completion/completions/itmo-video
  zsh (into a folder of $fpath, before compinit runs):
    mkdir -p ~/.zfunc
    itmo-video completion zsh > ~/.zfunc/_itmo-video
  fish:
    mkdir -p ~/.config/fish/completions
    itmo-video completion fish > ~/.config/fish/completions/itmo-video.fish
"""


def add_completion(commands: Any, parser: argparse.ArgumentParser) -> None:
    """Add the subcommand, which describes all of `parser`."""
    completion = commands.add_parser(
        "completion",
        help="print a shell completion script",
        description="Print the completion script for a shell, generated from the definitions of "
        "all options.",
        epilog=WHERE,
    )
    completion.add_argument("shell", choices=tuple(_SCRIPTS), help="the shell")

    def run(args: argparse.Namespace) -> int:
        from itmo_video.cli.parser_facts import commands_of

        print(_SCRIPTS[args.shell](commands_of(parser)), end="")
        return 0

    completion.set_defaults(run=run)


def bash_script(commands: Sequence[Command]) -> str:
    """For bash: flags and known values; otherwise file names."""
    values, flags = [], []
    for command in commands:
        flags.append(f"    {command.name}) words={shlex.quote(' '.join(_names(command)))} ;;")
        for flag in command.flags:
            if flag.metavar:
                pattern = "|".join(f"{command.name}:{name}" for name in flag.names)
                known = shlex.quote(" ".join(flag.values))
                values.append(f"    {pattern}) words={known}; is_value=1 ;;")
    newline = "\n"
    return (
        "_itmo_video() {\n"
        "  local cur=${COMP_WORDS[COMP_CWORD]} command=${COMP_WORDS[1]} words= is_value=\n"
        "  COMPREPLY=()\n"
        '  if [ "$COMP_CWORD" -eq 1 ]; then\n'
        f"    COMPREPLY=($(compgen -W {shlex.quote(' '.join(c.name for c in commands))}"
        ' -- "$cur")); return\n  fi\n'
        '  case "$command:${COMP_WORDS[COMP_CWORD-1]}" in\n' + newline.join(values) + "\n  esac\n"
        '  if [ -z "$is_value" ]; then\n'
        '    [ "${cur#-}" = "$cur" ] && return\n'
        '    case "$command" in\n' + newline.join(flags) + "\n    esac\n  fi\n"
        '  COMPREPLY=($(compgen -W "$words" -- "$cur"))\n'
        "}\n"
        f"complete -o default -F _itmo_video {PROGRAM}\n"
    )


def zsh_script(commands: Sequence[Command]) -> str:
    """For zsh, with the help of each command and flag."""
    named = " ".join(_zsh(f"{command.name}:{command.help}") for command in commands)
    cases = []
    for command in commands:
        specs = [_zsh_flag(name, flag) for flag in command.flags for name in flag.names]
        lines = " \\\n        ".join([*specs, "'*:file:_files'"])
        cases.append(f"    {command.name})\n      _arguments \\\n        {lines} ;;")
    return (
        f"#compdef {PROGRAM}\n\n_itmo_video() {{\n  local -a commands=({named})\n"
        "  if (( CURRENT == 2 )); then\n    _describe command commands\n    return\n  fi\n"
        "  local command=$words[2]\n  shift words\n  (( CURRENT-- ))\n  case $command in\n"
        + "\n".join(cases)
        + '\n  esac\n}\n\nif [ "$funcstack[1]" = "_itmo-video" ]; then\n  _itmo_video "$@"\nelse\n'
        f"  compdef _itmo_video {PROGRAM}\nfi\n"
    )


def fish_script(commands: Sequence[Command]) -> str:
    """For fish, with the help of each command and flag."""
    lines = []
    for command in commands:
        lines.append(
            f"complete -c {PROGRAM} -n __fish_use_subcommand -f -a {command.name} "
            f"-d {_fish(command.help)}"
        )
        seen = f"-n '__fish_seen_subcommand_from {command.name}'"
        for flag in command.flags:
            names = " ".join(
                f"-l {name[2:]}" if name.startswith("--") else f"-s {name[1:]}"
                for name in flag.names
            )
            values = ""
            if flag.metavar:
                values = f" -x -a {_fish(' '.join(flag.values))}" if flag.values else " -r"
            lines.append(f"complete -c {PROGRAM} {seen} {names}{values} -d {_fish(flag.help)}")
    return "\n".join(lines) + "\n"


def _names(command: Command) -> list[str]:
    return [name for flag in command.flags for name in flag.names]


def _zsh_flag(name: str, flag: Flag) -> str:
    text = flag.help.replace("[", "(").replace("]", ")").replace(":", " -")
    spec = f"{name}[{text}]"
    if flag.metavar:
        known = f"({' '.join(flag.values)})" if flag.values else "_files"
        spec += f":{flag.metavar.replace(':', '-')}:{known}"
    return _zsh(spec)


def _zsh(text: str) -> str:
    return "'" + text.replace("'", "'\\''") + "'"


def _fish(text: str) -> str:
    return "'" + text.replace("\\", "\\\\").replace("'", "\\'") + "'"


_SCRIPTS: dict[str, Callable[[Sequence[Command]], str]] = {
    "bash": bash_script,
    "zsh": zsh_script,
    "fish": fish_script,
}
