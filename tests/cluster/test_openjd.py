"""The render farm's recipe: valid Open Job Description, in step with the command line."""

from __future__ import annotations

import re

import pytest
from clips import REPOSITORY

from itmo_video import RunOptions
from itmo_video.cli import main
from itmo_video.cli.option_flags import options_of
from itmo_video.conversion.frame_ranges import parse_ranges

RECIPE = REPOSITORY / "configs" / "openjd-convert.yaml"

model = pytest.importorskip("openjd.model", reason="openjd-model is not installed")


def recipe(**values: str) -> object:
    """The job that the recipe makes of parameter values; raises where it is not valid."""
    parameters = {"Input": "/a/clip.mp4", "OutputDir": "/b/out", **values}
    template = model.decode_job_template(
        template=model.document_string_to_object(
            document=RECIPE.read_text(), document_type=model.DocumentType.YAML
        ),
        supported_extensions=["TASK_CHUNKING"],
    )
    typed = model.preprocess_job_parameters(
        job_template=template,
        job_parameter_values=parameters,
        job_template_dir=RECIPE.parent,
        current_working_dir=RECIPE.parent,
    )
    return model.create_job(job_template=template, job_parameter_values=typed)


def ranges(**values: str) -> list[str]:
    space = recipe(**values).steps[0].parameterSpace  # type: ignore[attr-defined]
    tasks = model.StepParameterSpaceIterator(space=space)
    return [task["Range"].value for task in tasks]


def test_range_and_chunk_size_are_parameters() -> None:
    assert ranges(Frames="1-250", ChunkSize="100") != ranges(Frames="1-250", ChunkSize="50")
    made = ranges(Frames="1-250", ChunkSize="100")
    assert len(made) == 3
    assert [n for text in made for n in parse_ranges(text)] == list(range(1, 251))


def test_holes_are_kept() -> None:
    made = ranges(Frames="1-100,200-300", ChunkSize="1000")
    numbers = sorted(n for text in made for n in parse_ranges(text))
    assert numbers == parse_ranges("1-100,200-300")


def test_a_chunk_size_of_nothing_is_refused() -> None:
    with pytest.raises(ValueError, match="ChunkSize"):
        recipe(ChunkSize="0")


def test_its_commands_are_ours() -> None:
    commands = [step.script.actions.onRun for step in recipe().steps]  # type: ignore[attr-defined]
    assert {str(c.command) for c in commands} == {"itmo-video"}
    for action in commands:
        words = [re.sub(r"\{\{.*\}\}", "1", str(word)) for word in action.args]
        parsed = main._parser().parse_args(words)
        assert options_of(parsed, RunOptions).frames == "1"
        assert parsed.preset == "1"
