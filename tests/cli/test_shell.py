"""Completion and the manual page: made from the definitions, taken by the shells themselves."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import command
import pytest

from itmo_video.operators import OPERATORS


def script(shell: str) -> str:
    done = command.run("completion", shell)
    assert done.returncode == 0, done.stderr
    return done.stdout


def bash_words(*words: str) -> set[str]:
    line = " ".join(f'"{word}"' for word in words)
    code = (
        f"{script('bash')}\nCOMP_WORDS=({line}); COMP_CWORD={len(words) - 1}\n_itmo_video\n"
        'printf "%s\\n" "${COMPREPLY[@]}"\n'
    )
    done = subprocess.run(
        ["bash", "-c", code], capture_output=True, text=True, check=True, timeout=30
    )
    assert not done.stderr
    return set(done.stdout.split())


@pytest.mark.skipif(shutil.which("bash") is None, reason="bash is not installed")
def test_bash_completes_commands_flags_and_values() -> None:
    assert {"convert", "preview", "analyse", "completion"} <= bash_words("itmo-video", "")
    assert bash_words("itmo-video", "pre") == {"preview", "presets"}
    assert {"--peak-nits", "--preset", "--primaries"} <= bash_words("itmo-video", "convert", "--p")
    assert bash_words("itmo-video", "convert", "--operator", "") == set(OPERATORS)
    assert bash_words("itmo-video", "convert", "--projection", "l") == {"latlong"}
    assert bash_words("itmo-video", "preview", "--as", "h") == {"hdr10", "hlg"}
    assert not bash_words("itmo-video", "convert", "clip")  # files are the shell's own


@pytest.mark.parametrize(("shell", "check"), [("zsh", ("-n",)), ("fish", ("--no-execute",))])
def test_other_shells_parse_theirs(tmp_path: Path, shell: str, check: tuple[str, ...]) -> None:
    if shutil.which(shell) is None:
        pytest.skip(f"{shell} is not installed")
    path = tmp_path / f"itmo-video.{shell}"
    path.write_text(script(shell))
    done = subprocess.run(
        [shell, *check, str(path)], capture_output=True, text=True, timeout=60, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.skipif(shutil.which("fish") is None, reason="fish is not installed")
def test_fish_completes(tmp_path: Path) -> None:
    path = tmp_path / "itmo-video.fish"
    path.write_text(script("fish"))

    def words(line: str) -> set[str]:
        done = subprocess.run(
            ["fish", "-N", "-c", f"source {path}; complete -C '{line}'"],
            capture_output=True, text=True, timeout=60, check=True,
        )  # fmt: skip
        return {entry.split("\t")[0] for entry in done.stdout.splitlines()}

    assert words("itmo-video prev") == {"preview"}
    assert words("itmo-video convert --projection ") == {"flat", "latlong"}
    assert "--peak-nits" in words("itmo-video convert --pea")


def test_the_manual_names_every_flag_and_is_clean_roff(tmp_path: Path) -> None:
    done = command.run("manual")
    assert done.returncode == 0, done.stderr
    for flag in (
        "\\-\\-peak\\-nits",
        "\\-\\-side\\-files",
        "\\-\\-hdr10",
        "\\-\\-no\\-expand\\-map",
    ):
        assert flag in done.stdout
    if shutil.which("groff") is None:
        pytest.skip("groff is not installed")
    shown = subprocess.run(
        ["groff", "-man", "-ww", "-Tutf8"], input=done.stdout, capture_output=True, text=True,
        timeout=60, check=True,
    )  # fmt: skip
    assert not shown.stderr
    assert "convert SDR video to HDR" in shown.stdout
