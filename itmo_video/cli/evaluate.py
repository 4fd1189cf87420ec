"""The command `evaluate`: figures as a table or JSON, and a verdict for pipelines."""

from __future__ import annotations

import argparse
import dataclasses
import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from itmo_video.cli.option_flags import add_options, named_number, options_of
from itmo_video.errors import CheckFailedError, UsageError
from itmo_video.evaluation.evaluate_options import EvaluateOptions

if TYPE_CHECKING:
    from itmo_video.evaluation.agreement import Agreement, Display
    from itmo_video.output.gate import Gate

EXAMPLES = """\
examples:
  itmo-video evaluate out/ --source clip.mp4
  itmo-video evaluate out/ --source sdr.mkv --motion motion.json --fail-above gain_flicker=0.02
  itmo-video evaluate out/ --reference truth/ --source sdr.mkv --json
  itmo-video evaluate out/ --reference truth/ --vdp --heat-map differences.mp4
  itmo-video evaluate out/ --reference truth/ --fail-below pq_psnr_db=34
  itmo-video evaluate out/ --reference true_panorama.hdr --source panorama.png --ibl
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
    add_options(parser, EvaluateOptions)
    parser.add_argument("--json", action="store_true", help="as JSON")
    parser.add_argument(
        "--fail-above", action="append", default=[], metavar="METRIC=VALUE",
        help="exit code 7 if the clip's figure is above (any number of times)",
    )  # fmt: skip
    parser.add_argument(
        "--fail-below", action="append", default=[], metavar="METRIC=VALUE",
        help="exit code 7 if the clip's figure is below (any number of times)",
    )  # fmt: skip
    parser.set_defaults(run=_evaluate)


def _evaluate(args: argparse.Namespace) -> int:
    from itmo_video.evaluation import agreement, folders, heat_film, sequence, table

    above = [named_number("fail-above", text) for text in args.fail_above]
    below = [named_number("fail-below", text) for text in args.fail_below]
    options, test = options_of(args, EvaluateOptions), Path(args.test)
    if options.heat_map:
        heat_film.check_film(options.heat_map)
        _heat_gate(test, options).check()
    source, reference = options.source, options.reference
    told: dict[str, Any] = {}
    text: list[str] = []
    figures: dict[str, float] = {}
    if options.ibl and reference:
        from itmo_video.evaluation import probes

        lit = probes.compare_lights(test, reference, source)
        told["ibl"] = {name: table.lighting_facts(row) for name, row in lit.items()}
        text.append(table.lighting_table(lit))
        figures |= told["ibl"][probes.TEST]
    elif reference:
        white = options.white_nits or folders.open_sequence(test).settings_or_default.white_nits
        display = agreement.Display(options.display_peak, white, options.pixels_per_degree)
        if options.vdp or options.heat_map:
            from itmo_video.evaluation.vdp import require_vdp

            require_vdp()  # to be told at once, not after the other figures
        rows = agreement.compare_sequences(test, reference, source, display)
        if options.vdp or options.heat_map:
            _add_vdp(test, reference, options, rows, display)
        told["display"] = dataclasses.asdict(display)
        told["fidelity"] = {name: table.agreement_facts(row) for name, row in rows.items()}
        text.append(table.agreement_table(rows))
        figures |= rows[agreement.TEST].figures
    if source is not None and not options.ibl:
        origins = sequence.read_origins(options.motion) if options.motion else None
        shots = sequence.flicker_by_shot(test, source, origins, options.key_interval)
        clip = sequence.over_shots(shots)
        told["shots"] = [{"first": s.first, "last": s.last, **s.figures} for s in shots]
        told["clip"] = clip
        text.append(table.flicker_table(shots, clip))
        figures |= clip
    print(json.dumps(table.plain(told), indent=1) if args.json else "\n\n".join(text))
    _judge(figures, above, below)
    return 0


def _heat_gate(test: Path, options: EvaluateOptions) -> Gate:
    from itmo_video.output.folder import read_manifest
    from itmo_video.output.gate import FILM, Gate
    from itmo_video.source.opening import input_files

    assert options.heat_map is not None
    manifest = read_manifest(test)
    return Gate(
        options.heat_map,
        FILM,
        inputs=input_files(options.source) if options.source else (),
        overwrite=options.overwrite,
        source_digest=manifest.source_digest if manifest else None,
    )


def _add_vdp(
    test: Path,
    reference: Path,
    options: EvaluateOptions,
    rows: dict[str, Agreement],
    display: Display,
) -> None:
    from itmo_video.evaluation import films, heat_film, vdp
    from itmo_video.evaluation.agreement import TEST

    found = films.films(test, reference, options.source, display)
    if options.vdp:
        for name, film in found.items():
            rows[name].figures["jod"] = vdp.jod(film, display)
    if options.heat_map:
        film = found[TEST]
        gate = _heat_gate(test, options)
        heat_film.write_film(gate, vdp.heat_map(film, display), film.frame_rate)


def _judge(
    figures: dict[str, float], above: list[tuple[str, float]], below: list[tuple[str, float]]
) -> None:
    for name, _ in above + below:
        if name not in figures:
            raise UsageError(f"no figure {name!r}", remedy=f"There are: {', '.join(figures)}")
    # A figure that could not be measured must not pass a pipeline's check unseen.
    failed = [
        f"{name} is {figures[name]:.5g}, {word} {limit:g}"
        for word, limits in (("above", above), ("below", below))
        for name, limit in limits
        if math.isnan(figures[name])
        or (figures[name] > limit if word == "above" else figures[name] < limit)
    ]
    if failed:
        raise CheckFailedError("; ".join(failed))
