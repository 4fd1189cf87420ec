"""The command `evaluate`: figures as a table or JSON, and checks for pipelines."""

from __future__ import annotations

import argparse
import dataclasses
import json
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from itmo_video.cli.option_flags import add_options, named_number, options_of
from itmo_video.errors import CheckFailedError, UsageError
from itmo_video.evaluation.evaluate_options import EvaluateOptions

if TYPE_CHECKING:
    from itmo_video.evaluation.evaluate import Evaluation

EXAMPLES = """\
examples:
  itmo-video evaluate out/ --source clip.mp4
  itmo-video evaluate out/ --source clip.mp4 --fail-above gain_flicker=0.02
  itmo-video evaluate out/ --reference truth/ --source clip.mp4 --json
  itmo-video evaluate out/ --reference truth/ --vdp --heat-map differences.mp4
  itmo-video evaluate out/ --reference truth/ --fail-below pq_psnr_db=34
  itmo-video evaluate probe/ --reference true.hdr --source pano.png --ibl
"""


def add_evaluate(commands: Any) -> None:
    """Add the subparser of `evaluate`."""
    parser = commands.add_parser(
        "evaluate",
        help="measure flicker, and fidelity to a reference",
        description="Measure an EXR sequence: its flicker along the clip's motion with --source "
        "(map_flicker needs --layers expand_map), its fidelity to the truth with --reference.",
        epilog=EXAMPLES,
    )
    parser.add_argument("test", metavar="TEST", help="a folder of EXR files")
    add_options(parser, EvaluateOptions)
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument(
        "--fail-above", action="append", default=[], metavar="METRIC=VALUE",
        help="exit code 7 if the clip's figure is above this (repeatable)",
    )  # fmt: skip
    parser.add_argument(
        "--fail-below", action="append", default=[], metavar="METRIC=VALUE",
        help="exit code 7 if the clip's figure is below this (repeatable)",
    )  # fmt: skip
    parser.set_defaults(run=_evaluate)


def _evaluate(args: argparse.Namespace) -> int:
    from itmo_video.cli.progress import Progress
    from itmo_video.evaluation.evaluate import evaluate

    above = [named_number("fail-above", text) for text in args.fail_above]
    below = [named_number("fail-below", text) for text in args.fail_below]
    progress = Progress(as_json=False, quiet=False)
    found = evaluate(args.test, options_of(args, EvaluateOptions), progress.on_event)
    progress.close()
    print(_as_json(found) if args.json else _as_text(found))
    _judge(args.test, found.figures, above, below)
    return 0


def _as_json(found: Evaluation) -> str:
    from itmo_video.evaluation import table

    told: dict[str, Any] = {}
    if found.lighting:
        told["ibl"] = {name: table.lighting_facts(row) for name, row in found.lighting.items()}
    if found.display is not None:
        told["display"] = dataclasses.asdict(found.display)
        told["fidelity"] = {
            name: table.agreement_facts(row) for name, row in found.fidelity.items()
        }
    if found.clip:
        told["shots"] = [{"first": s.first, "last": s.last, **s.figures} for s in found.shots]
        told["clip"] = found.clip
    return json.dumps(table.plain(told), indent=1)


def _as_text(found: Evaluation) -> str:
    from itmo_video.evaluation import table

    parts = []
    if found.lighting:
        parts.append(table.lighting_table(found.lighting))
    if found.fidelity:
        parts.append(table.agreement_table(found.fidelity))
    if found.clip:
        parts.append(table.flicker_table(found.shots, found.clip))
    return "\n\n".join(parts)


def _judge(
    test: str,
    figures: Mapping[str, float],
    above: list[tuple[str, float]],
    below: list[tuple[str, float]],
) -> None:
    for name, _ in above + below:
        if name not in figures:
            raise UsageError(f"unknown figure {name!r}", remedy=f"Known: {', '.join(figures)}")
    # A figure that could not be measured must not pass a pipeline's check.
    failed = [
        f"{name} is {figures[name]:.5g}, {word} {limit:g}"
        for word, limits in (("above", above), ("below", below))
        for name, limit in limits
        if math.isnan(figures[name])
        or (figures[name] > limit if word == "above" else figures[name] < limit)
    ]
    if failed:
        raise CheckFailedError(
            "; ".join(failed),
            where=test,
            remedy="See the frames and shots named in the table, or change the limit.",
        )
