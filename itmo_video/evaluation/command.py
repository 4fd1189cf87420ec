"""The command `evaluate`: figures as a table or JSON, and a verdict for pipelines."""

from __future__ import annotations

import argparse
import json
import math
from pathlib import Path
from typing import Any

from itmo_video.errors import CheckFailedError, UsageError

EXAMPLES = """\
examples:
  itmo-video evaluate out/ --source clip.mp4
  itmo-video evaluate out/ --source sdr.mkv --motion motion.json --fail-above gain_flicker=0.02
  itmo-video evaluate out/ --reference truth/ --source sdr.mkv --json
"""


def add_evaluate(commands: Any) -> None:
    """Add the subparser of `evaluate`."""
    parser = commands.add_parser(
        "evaluate",
        help="flicker of a sequence along the clip's motion, fidelity to a true one",
        description="Measure an EXR sequence: with --source its flicker along the clip's motion "
        "(map_flicker needs --layers expand_map), with --reference its fidelity to the truth.",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("test", metavar="TEST", help="a folder of EXR files")
    parser.add_argument("--source", metavar="CLIP", help="the SDR clip that it was made from")
    parser.add_argument("--motion", metavar="FILE", help="known motion, as pan_clip.py writes it")
    parser.add_argument("--reference", metavar="TRUTH", help="a folder of true EXR files")
    parser.add_argument("--key-interval", type=int, default=5, metavar="N")
    parser.add_argument("--white-nits", type=float, default=203.0, metavar="N")
    parser.add_argument("--display-peak", type=float, default=1000.0, metavar="N")
    parser.add_argument("--json", action="store_true", help="as JSON")
    parser.add_argument(
        "--fail-above", action="append", default=[], metavar="METRIC=VALUE",
        help="exit code 7 if the clip's figure is above (any number of times)",
    )  # fmt: skip
    parser.set_defaults(run=_evaluate)


def _evaluate(args: argparse.Namespace) -> int:
    from itmo_video.evaluation import sequence

    limits = [_limit(text) for text in args.fail_above]
    if not args.source and not args.reference:
        raise UsageError("nothing to compare with", remedy="Give --source CLIP or --reference.")
    if args.key_interval < 1:
        raise UsageError(f"key-interval must be 1 or more, not {args.key_interval}")
    source = Path(args.source) if args.source else None
    told: dict[str, Any] = {}
    figures: dict[str, float] = {}
    if args.reference:
        rows = sequence.compare_sequences(
            Path(args.test), Path(args.reference), source, args.white_nits, args.display_peak
        )
        told["fidelity"] = rows
        figures |= rows["test"]
    if source is not None:
        origins = sequence.read_origins(Path(args.motion)) if args.motion else None
        shots = sequence.flicker_by_shot(Path(args.test), source, origins, args.key_interval)
        clip = sequence.over_shots(shots)
        told["shots"] = [{"first": s.first, "last": s.last, **s.figures} for s in shots]
        told["clip"] = clip
        figures |= clip
    print(json.dumps(_plain(told), indent=1) if args.json else _table(told))
    _judge(figures, limits)
    return 0


def _limit(text: str) -> tuple[str, float]:
    name, _, value = text.partition("=")
    try:
        return name, float(value)
    except ValueError:
        raise UsageError(f"fail-above: {text!r} is not METRIC=VALUE") from None


def _judge(figures: dict[str, float], limits: list[tuple[str, float]]) -> None:
    for name, _ in limits:
        if name not in figures:
            raise UsageError(
                f"fail-above: no figure {name!r}", remedy=f"There are: {', '.join(figures)}"
            )
    # A figure that could not be measured must not pass a pipeline's check unseen.
    failed = [
        f"{name} is {figures[name]:.5g}, above {limit:g}"
        for name, limit in limits
        if math.isnan(figures[name]) or figures[name] > limit
    ]
    if failed:
        raise CheckFailedError("; ".join(failed))


def _plain(value: Any) -> Any:
    """Values that JSON has: NaN becomes null."""
    if isinstance(value, dict):
        return {key: _plain(part) for key, part in value.items()}
    if isinstance(value, list):
        return [_plain(part) for part in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _table(told: dict[str, Any]) -> str:
    lines: list[str] = []
    for row, figures in told.get("fidelity", {}).items():
        cells = "  ".join(f"{name} {value:.4g}" for name, value in figures.items())
        lines.append(f"{row:14} {cells}")
    lines += [_row(f"shot {s['first']}-{s['last']}", s) for s in told.get("shots", [])]
    if "clip" in told:
        lines.append(_row("clip", told["clip"]))
    return "\n".join(lines)


def _row(name: str, figures: dict[str, float]) -> str:
    cells = (
        f"{key} {'-' if math.isnan(value) else format(value, '.5f')}"
        for key, value in figures.items()
        if key not in ("first", "last")
    )
    return f"{name:14} {'  '.join(cells)}"
