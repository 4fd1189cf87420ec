"""The command `evaluate`: figures as a table or JSON, and a verdict for pipelines."""

from __future__ import annotations

import argparse
import dataclasses
import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from itmo_video.cli.settings_flags import named_number
from itmo_video.errors import CheckFailedError, UsageError

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
    parser.add_argument("--source", metavar="CLIP", help="the SDR clip that it was made from")
    parser.add_argument("--motion", metavar="FILE", help="known motion, as pan_clip.py writes it")
    parser.add_argument("--reference", metavar="TRUTH", help="a folder of true EXR files")
    parser.add_argument(
        "--key-interval", type=int, metavar="N", help="of key_to_key (default: the folder's own, 5)"
    )
    parser.add_argument(
        "--white-nits", type=_positive, metavar="N", help="of 1.0 (default: the folder's own, 203)"
    )
    parser.add_argument(
        "--display-peak", type=_positive, default=1000.0, metavar="N",
        help="the display's peak in nits; both sides are clipped to it (1000)",
    )  # fmt: skip
    parser.add_argument(
        "--vdp", action="store_true", help="add ColorVideoVDP's JOD (extra `vdp`; slow)"
    )
    parser.add_argument(
        "--heat-map", metavar="FILE.mp4",
        help="a film of where ColorVideoVDP sees differences (extra `vdp`; slow)",
    )  # fmt: skip
    parser.add_argument(
        "--pixels-per-degree", type=_positive, default=45.0, metavar="N",
        help="of the visual field, for ColorVideoVDP (45)",
    )  # fmt: skip
    parser.add_argument(
        "--ibl", action="store_true",
        help="of latitude-longitude panoramas: compare renders of a scene that they light (extra "
        "`ibl`: Mitsuba); TEST and TRUTH may be one .exr or .hdr file, 1.0 being SDR white",
    )  # fmt: skip
    parser.add_argument(
        "--overwrite", action="store_true", help="replace the film of --heat-map where it exists"
    )
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


def _positive(text: str) -> float:
    value = float(text)
    if not 0 < value < math.inf:
        raise argparse.ArgumentTypeError("must be above 0")
    return value


def _evaluate(args: argparse.Namespace) -> int:
    from itmo_video.evaluation import agreement, folders, heat_film, sequence, table

    above = [named_number("fail-above", text) for text in args.fail_above]
    below = [named_number("fail-below", text) for text in args.fail_below]
    if not args.source and not args.reference:
        raise UsageError("nothing to compare with", remedy="Give --source CLIP or --reference.")
    if (args.vdp or args.heat_map) and not args.reference:
        raise UsageError("ColorVideoVDP needs the truth", remedy="Give --reference TRUTH.")
    if args.heat_map:
        heat_film.check_film(Path(args.heat_map))
        _heat_gate(args).check()
    if args.key_interval is not None and args.key_interval < 1:
        raise UsageError(f"key-interval must be 1 or more, not {args.key_interval}")
    if args.ibl and (args.vdp or args.heat_map or args.motion or not args.reference):
        raise UsageError(
            "--ibl compares renders, and only those",
            remedy="Give it --reference TRUTH, --source CLIP, and none of the others.",
        )
    test = Path(args.test)
    source = Path(args.source) if args.source else None
    told: dict[str, Any] = {}
    text: list[str] = []
    figures: dict[str, float] = {}
    if args.ibl:
        from itmo_video.evaluation import probes

        lit = probes.compare_lights(test, Path(args.reference), source)
        told["ibl"] = {name: table.lighting_facts(row) for name, row in lit.items()}
        text.append(table.lighting_table(lit))
        figures |= told["ibl"][probes.TEST]
    elif args.reference:
        white = args.white_nits or folders.open_sequence(test).settings_or_default.white_nits
        display = agreement.Display(args.display_peak, white, args.pixels_per_degree)
        if args.vdp or args.heat_map:
            from itmo_video.evaluation.vdp import require_vdp

            require_vdp()  # to be told at once, not after the other figures
        rows = agreement.compare_sequences(test, Path(args.reference), source, display)
        if args.vdp or args.heat_map:
            _add_vdp(args, rows, display)
        told["display"] = dataclasses.asdict(display)
        told["fidelity"] = {name: table.agreement_facts(row) for name, row in rows.items()}
        text.append(table.agreement_table(rows))
        figures |= rows[agreement.TEST].figures
    if source is not None and not args.ibl:
        origins = sequence.read_origins(Path(args.motion)) if args.motion else None
        shots = sequence.flicker_by_shot(test, source, origins, args.key_interval)
        clip = sequence.over_shots(shots)
        told["shots"] = [{"first": s.first, "last": s.last, **s.figures} for s in shots]
        told["clip"] = clip
        text.append(table.flicker_table(shots, clip))
        figures |= clip
    print(json.dumps(table.plain(told), indent=1) if args.json else "\n\n".join(text))
    _judge(figures, above, below)
    return 0


def _heat_gate(args: argparse.Namespace) -> Gate:
    from itmo_video.output.folder import read_manifest
    from itmo_video.output.gate import FILM, Gate
    from itmo_video.source.opening import input_files

    manifest = read_manifest(args.test)
    return Gate(
        args.heat_map,
        FILM,
        inputs=input_files(args.source) if args.source else (),
        overwrite=args.overwrite,
        source_digest=manifest.source_digest if manifest else None,
    )


def _add_vdp(args: argparse.Namespace, rows: dict[str, Agreement], display: Display) -> None:
    from itmo_video.evaluation import films, heat_film, vdp
    from itmo_video.evaluation.agreement import TEST

    source = Path(args.source) if args.source else None
    found = films.films(Path(args.test), Path(args.reference), source, display)
    if args.vdp:
        for name, film in found.items():
            rows[name].figures["jod"] = vdp.jod(film, display)
    if args.heat_map:
        film = found[TEST]
        heat_film.write_film(_heat_gate(args), vdp.heat_map(film, display), film.frame_rate)


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
