"""The command line: flags from the settings' own definitions, exit codes from the errors."""

from __future__ import annotations

import argparse
import gc
import json
import os
import signal
import sys
import traceback
from collections.abc import Sequence
from types import FrameType
from typing import TYPE_CHECKING, Any, NoReturn

from itmo_video.delivery.command import add_preview
from itmo_video.errors import ItmoError, UsageError
from itmo_video.evaluation.command import add_evaluate
from itmo_video.flags import add_settings, settings_of
from itmo_video.report.command import add_report
from itmo_video.settings import Settings, flag_name, load_preset, preset_names, read_preset

if TYPE_CHECKING:
    from itmo_video.plan import RunOptions

EXAMPLES = """\
examples:
  itmo-video convert clip.mp4 out/
  itmo-video convert clip.mp4 out/ --peak-nits 4000 --compression piz --layers expand_map
  itmo-video convert clip.mp4 out/ --frames 100-200 --preset paper --temporal per-frame
"""


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise UsageError(message, remedy=f"See `{self.prog} --help`.")


class _Terminated(BaseException):
    """SIGTERM came."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code (cli.md)."""
    signal.signal(signal.SIGTERM, _on_sigterm)
    try:
        args = _parser().parse_args(argv)
        return int(args.run(args) or 0)
    except ItmoError as error:
        return _told(error)
    except KeyboardInterrupt:
        return _interrupted(130)
    except _Terminated:
        return _interrupted(143)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except Exception as error:
        _debug()
        print(
            f"itmo-video: unexpected: {type(error).__name__}: {error}\n"
            "Please report it; ITMO_VIDEO_DEBUG=1 shows where.",
            file=sys.stderr,
        )
        return 1


def run() -> NoReturn:
    """Run the command line as a process of its own, which ends with it."""
    # NumPy's algebra here is of 3 by 3; its idle threads take a core while others start to work.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    code = main()
    gc.freeze()  # else the interpreter looks three times through all that ends now, for 40 ms
    sys.exit(code)


def _on_sigterm(signum: int, frame: FrameType | None) -> None:
    raise _Terminated


def _interrupted(code: int) -> int:
    print(
        "itmo-video: interrupted; what is written is whole, the same command goes on",
        file=sys.stderr,
    )
    return code


def _told(error: ItmoError) -> int:
    _debug()
    print(f"itmo-video: {error}", file=sys.stderr)
    return error.exit_code


def _debug() -> None:
    if os.environ.get("ITMO_VIDEO_DEBUG") == "1":
        traceback.print_exc()


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="itmo-video", description="Turn SDR video into HDR.")
    parser.add_argument("--version", action="store_true", help="print the version")
    parser.set_defaults(run=_no_command(parser))
    commands = parser.add_subparsers(metavar="COMMAND", parser_class=_Parser)

    convert = commands.add_parser(
        "convert",
        help="SDR clip -> EXR sequence OUTPUT_DIR/<stem>.%%04d.exr",
        description="Convert an SDR clip to an EXR sequence; 1.0 in it is SDR white. "
        "The same command again makes what is missing.",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    convert.add_argument(
        "inputs",
        metavar="INPUT",
        nargs="+",
        help="a clip, a still, or an image sequence (img.%%04d.png); of several inputs, each "
        "goes to its own folder OUTPUT_DIR/<stem>",
    )
    convert.add_argument("output", metavar="OUTPUT_DIR", help="the folder that the frames go to")
    add_settings(convert)
    _add_run_options(convert)
    convert.add_argument(
        "--report", action="store_true", help="also write OUTPUT_DIR/report.html about it"
    )
    convert.set_defaults(run=_convert)

    add_preview(commands)
    add_evaluate(commands)
    add_report(commands)
    analyse = commands.add_parser(
        "analyse",
        help="cuts, keyframes, statistics, suggested settings and a list of shots to edit",
        description="Look through a clip once. In the JSON that is written, each shot's peak_nits "
        "or l_max, strength (0 to 1) and enabled may be edited; convert --analysis reads it.",
    )
    analyse.add_argument("input", metavar="INPUT", help="a clip")
    analyse.add_argument(
        "--output", metavar="FILE.json", help="where the JSON goes (default: standard output)"
    )
    analyse.add_argument(
        "--start-number", type=int, default=1, metavar="N", help="of the first frame (1)"
    )
    analyse.add_argument("--max-pixels", type=_positive, default=2**27, metavar="N")
    analyse.add_argument("--overwrite", action="store_true", help="replace FILE.json")
    analyse.add_argument("--quiet", action="store_true", help="no notices")
    add_settings(analyse)
    analyse.set_defaults(run=_analyse)

    info = commands.add_parser("info", help="what a clip says of itself and what will be assumed")
    info.add_argument("input", metavar="INPUT")
    info.add_argument("--json", action="store_true", help="as JSON")
    info.set_defaults(run=_info)

    presets = commands.add_parser("presets", help="the presets and what they set")
    presets.set_defaults(run=_presets)
    operators = commands.add_parser("operators", help="the operators, their parameters, sources")
    operators.set_defaults(run=_operators)
    return parser


def _no_command(parser: argparse.ArgumentParser) -> Any:
    def run(args: argparse.Namespace) -> int:
        if args.version:
            from importlib.metadata import version

            print(f"itmo-video {version('itmo_video')}")
            return 0
        parser.print_help()
        return 0

    return run


def _add_run_options(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("run")
    group.add_argument(
        "--frames", metavar="RANGES", help="numbers as in the file names: 1-100,200-300x2"
    )
    group.add_argument(
        "--start-number", type=int, default=1, metavar="N", help="of the first frame (1)"
    )
    group.add_argument("--jobs", type=_positive, metavar="N", help="worker threads (the cores)")
    group.add_argument(
        "--overwrite", action="store_true", help="make all frames again, in any folder"
    )
    group.add_argument("--update", action="store_true", help="make again what other settings made")
    group.add_argument(
        "--verify", action="store_true", help="only check what is there; exit code 7"
    )
    group.add_argument("--durable", action="store_true", help="wait until each file is on the disk")
    group.add_argument("--null", action="store_true", help="make everything, write nothing")
    group.add_argument(
        "--dry-run", action="store_true", help="say what would be done and do nothing"
    )
    group.add_argument(
        "--max-pixels", type=_positive, default=2**27, metavar="N", help="a frame, at most"
    )
    group.add_argument(
        "--scheduler", metavar="ADDRESS|local",
        help="on a Dask cluster, or on one of --jobs processes here (extra `cluster`)",
    )  # fmt: skip
    group.add_argument(
        "--analysis", metavar="FILE.json", help="the file of `analyse`, with its shots as edited"
    )
    group.add_argument("--quiet", action="store_true", help="no progress and no notices")
    group.add_argument(
        "--json", action="store_true", help="one line of JSON an event on standard output"
    )


def _positive(text: str) -> int:
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError("must be 1 or more")
    return value


def _convert(args: argparse.Namespace) -> int:
    from itmo_video.analysis_file import read_analysis
    from itmo_video.plan import RunOptions

    settings = settings_of(args)
    run = RunOptions(
        args.frames, _start_number(args), args.jobs, args.overwrite, args.update, args.durable,
        args.null, args.max_pixels, read_analysis(args.analysis) if args.analysis else None,
    )  # fmt: skip
    code = 0
    for source, output in _outputs(args.inputs, args.output):
        try:
            _convert_one(args, source, output, settings, run)
        except ItmoError as error:
            if len(args.inputs) == 1:
                raise
            # One bad input of many must not keep the others from being made.
            code = max(code, _told(error))
    return code


def _outputs(inputs: list[str], output: str) -> list[tuple[str, str]]:
    if len(inputs) == 1:
        return [(inputs[0], output)]
    stems = [os.path.splitext(os.path.basename(source))[0] for source in inputs]
    if twice := sorted({stem for stem in stems if stems.count(stem) > 1}):
        raise UsageError(
            f"several inputs are called {', '.join(twice)}", remedy="Convert them one by one."
        )
    return [(s, os.path.join(output, stem)) for s, stem in zip(inputs, stems, strict=True)]


def _convert_one(
    args: argparse.Namespace, source: str, output: str, settings: Settings, run: RunOptions
) -> None:
    from itmo_video import conversion as room
    from itmo_video.progress import Progress

    if args.verify:
        room.require_sound(room.verify(source, output, settings, run))
        print(f"{output}: all frames are there and whole")
        return
    if args.dry_run:
        print(room.describe_plan(source, output, settings, run))
        return
    if args.report and args.null:
        raise UsageError("a report needs the frames", remedy="Leave --null or --report out.")
    executor = None
    if args.scheduler is not None:
        from itmo_video.cluster import cluster_executor

        executor = cluster_executor(args.scheduler)
    progress = Progress(as_json=args.json, quiet=args.quiet)
    room.convert(source, output, settings, run, progress.on_event, executor)
    if args.report:
        from itmo_video.report.page import write_report

        write_report(output, clip=source)


def _analyse(args: argparse.Namespace) -> int:
    from itmo_video import analysis_report

    analysis_report.analyse_to(
        args.input, args.output, settings_of(args), _start_number(args), args.max_pixels,
        overwrite=args.overwrite, quiet=args.quiet,
    )  # fmt: skip
    return 0


def _start_number(args: argparse.Namespace) -> int:
    if args.start_number < 0:
        raise UsageError(f"start-number must be 0 or more, not {args.start_number}")
    return int(args.start_number)


def _info(args: argparse.Namespace) -> int:
    from itmo_video import describe
    from itmo_video.reader import open_clip
    from itmo_video.tags import InputOptions

    # info only tells: what convert would refuse as HDR is told, not refused.
    with open_clip(args.input, InputOptions(force_sdr=True)) as clip:
        told = describe.clip_facts(clip.info)
    if args.json:
        print(json.dumps(told, indent=1))
    else:
        print(describe.as_table(told))
    return 0


def _presets(args: argparse.Namespace) -> int:
    for name in preset_names():
        content = read_preset(name)
        print(f"{name}: {content.get('description', '')}")
        for key, value in load_preset(name).items():
            print(f"    {flag_name(key)} = {json.dumps(value)}")
    return 0


def _operators(args: argparse.Namespace) -> int:
    from itmo_video.operators import all_operators

    for operator in all_operators().values():
        print(f"{operator.name}: {operator.summary}\n    {operator.source}")
        for name, p in operator.parameters.items():
            print(f"    {name} = {p.default:g} ({p.lower:g} to {p.upper:g}): {p.help}")
    return 0


if __name__ == "__main__":
    run()
