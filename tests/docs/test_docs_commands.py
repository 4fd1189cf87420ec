"""The commands of README and of the guide do what they say, on small clips."""

from __future__ import annotations

import itertools
import re
import shlex
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from clips import REPOSITORY, moving_scene, write_ffv1

from itmo_video.cli.main import main

PAGES = (
    REPOSITORY / "README.md",
    REPOSITORY / "docs" / "index.md",
    *sorted((REPOSITORY / "docs" / "guide").glob("*.md")),
)
PROGRAM = "itmo-video "
NOT_RUN = {  # a pattern of the command line, and why it is not run here
    r"[|<>]|&&": "a shell's pipe or redirection: delivery/test_pipes.py, cli/test_shell.py",
    r"\.\.\.|COMMAND": "an abbreviation",
    r"--shots|\.otio|film\.mov": "extra `otio`, and an edit: tests/analysis/test_edit_lists.py",
    r"\bstudio\b": "waits for a browser: tests/studio",
    r"--scheduler": "starts processes or needs a scheduler: tests/laws/test_cluster*.py",
    r"--as aces": "extra `ocio`: tests/delivery/test_aces_views.py",
    r"--ibl": "extra `ibl` and a minute: tests/evaluation/test_ibl.py",
    r"--raw|convert -( |$)|preview -( |$)": "read from a pipe: tests/delivery/test_pipes.py",
    r"codec hevc|codec prores|master\.mov": "slow encoders: tests/delivery/test_preview.py",
    rf"^(?!{PROGRAM})": "pip (.ci/run runs README's two commands), or another program",
}
ON_A_FOLDER = {"--verify", "--dry-run", "--update", "--frames"}
WRITTEN_BY = ("--output", "--hdr10plus", "--dolby-vision")
FRAMES = 4  # of the clips; pages speak of longer ones


def commands(page: Path) -> list[str]:
    """The commands of a page in its order: lines of sh blocks, and code that begins with ours."""
    found = []
    fence: str | None = None
    for line in page.read_text("utf-8").splitlines():
        if line.strip().startswith("```"):
            fence = None if fence is not None else line.strip()[3:]
        elif fence == "sh" and line.strip():
            found.append(re.sub(r"\s+#\s.*", "", line.strip()))
        elif fence is None:
            code = re.findall(r"`([^`]+)`", line)
            found += [text.replace("\\|", "|") for text in code if text.startswith(PROGRAM)]
    return [text for text in found if not re.fullmatch(r"itmo-video \w+", text)]


def reason(command: str) -> str | None:
    """Why a command is not run; None for those that are."""
    return next((why for pattern, why in NOT_RUN.items() if re.search(pattern, command)), None)


def shorter(command: str) -> str:
    """A command with its frame numbers brought into the clip."""

    def asked(match: re.Match[str]) -> str:
        numbers = re.sub(r"\d+", lambda n: str(min(int(n[0]), FRAMES)), match[2])
        return match[1] + numbers

    return re.sub(r"(--frames? )(\S+)", asked, command)


def written_by(words: list[str]) -> list[str]:
    """The files that a command writes, as it names them."""
    if words[0] == "preview":
        return [words[2]] if words[2] != "-" else []
    return [b for a, b in itertools.pairwise(words) if a in WRITTEN_BY]


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Files by the names that the pages use: four frames of 96x64, stills, a preset."""
    folder = tmp_path_factory.mktemp("inputs")
    pictures = list(moving_scene(FRAMES))
    for name in ("clip.mp4", "second.mp4", "clip.mkv"):
        write_ffv1(folder / "made.mkv", pictures)
        (folder / "made.mkv").rename(folder / name)  # the container is told by its content
    still = np.zeros((48, 96, 3), np.uint8) + 60
    still[8:20, 30:50] = 255
    for name in (
        "photo.jpg",
        "pano.png",
        "panorama.png",
        *(f"img.{n:04d}.png" for n in range(1, 4)),
    ):
        cv2.imwrite(str(folder / name), still)
    shots = ["analyse", "--quiet", str(folder / "clip.mp4"), "--output", str(folder / "shots.json")]
    assert main(shots) == 0
    (folder / "mine.toml").write_text('description = "Ours"\n\n[settings]\npeak-nits = 2000\n')
    return folder


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_commands_of_a_page_run(
    page: Path, inputs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    shutil.copytree(inputs, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    known = commands(page)
    ran = 0
    # Pages stand alone, but tables may read a folder that others make: out/ is there at first.
    assert main(["convert", "--quiet", "clip.mp4", "out/"]) == 0
    assert main(["convert", "--quiet", "--frames", "1", "clip.mp4", "truth/"]) == 0
    for command in dict.fromkeys(known):
        if reason(command) is not None:
            continue
        words = shlex.split(shorter(command))[1:]
        if words[0] == "convert" and "out/" in words and not ON_A_FOLDER & set(words):
            shutil.rmtree("out")  # a first conversion, whatever the page did before
        for path in written_by(words):
            Path(path).unlink(missing_ok=True)  # nothing is overwritten unasked
        code = main(words)
        told = capsys.readouterr()
        assert code == 0, f"{page.name}: {command}: exit code {code}\n{told.err}"
        ran += 1
    assert ran or all(reason(command) for command in known)


def test_every_reason_is_needed() -> None:
    everything = list(itertools.chain.from_iterable(commands(page) for page in PAGES))
    assert len(everything) > 60
    for pattern in NOT_RUN:
        assert any(re.search(pattern, command) for command in everything), pattern


def test_python_of_the_guide_runs(
    inputs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copytree(inputs, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    for page in (REPOSITORY / "README.md", REPOSITORY / "docs/guide/python.md"):
        for block in re.findall(r"```python\n(.*?)```", page.read_text("utf-8"), re.DOTALL):
            exec(compile(block, str(page), "exec"), {"__name__": "__main__"})
