"""The command `convert`: a clip, still or image sequence to a folder of EXR files."""

from __future__ import annotations

import argparse
import os
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

from itmo_video.cli.config_file import options_said, tell_config
from itmo_video.cli.log_file import LogFile
from itmo_video.cli.outcome import reported
from itmo_video.cli.progress import failure_told
from itmo_video.cli.run_flags import add_run_options, progress_of
from itmo_video.cli.settings_flags import add_settings, in_words, settings_of
from itmo_video.cli.terminal import named
from itmo_video.conversion.run_options import RunOptions
from itmo_video.errors import DamagedInputError, ItmoError, UsageError
from itmo_video.html_report.report_options import ReportOptions
from itmo_video.settings import Settings
from itmo_video.words import frames_are

EXAMPLES = """\
examples:
  itmo-video convert clip.mp4 out/
  itmo-video convert clip.mp4 out/ --peak-nits 4000 --layers expand_map
  itmo-video convert clip.mp4 out/ --frames 100-200 --compression piz
  itmo-video convert img.%04d.png out_sequence/ --fps 25
  itmo-video convert pano.png probe/ --preset ibl --projection latlong
"""


def add_convert(commands: Any) -> None:
    """Add the subcommand."""
    convert = commands.add_parser(
        "convert",
        help="convert SDR clips, stills and sequences to EXR (resumes)",
        description="Convert an SDR clip to an EXR sequence, in which 1.0 is SDR white. "
        "Run the same command again to resume.",
        epilog=EXAMPLES,
    )
    convert.add_argument(
        "inputs",
        metavar="INPUT",
        nargs="+",
        help="a clip, a still, an image sequence (img.%%04d.png, or img.*.png expanded by the "
        "shell), or - for standard input; several inputs go to folders OUTPUT_DIR/<stem>",
    )
    convert.add_argument("output", metavar="OUTPUT_DIR", help="folder to write the frames to")
    add_settings(convert)
    add_run_options(convert)
    convert.add_argument(
        "--name", metavar="TEMPLATE",
        help="folder in OUTPUT_DIR for each input, such as {parent}-{stem}; also {suffix} and "
        "{number} (of the input, from 1)",
    )  # fmt: skip
    convert.add_argument(
        "--report", action="store_true", help="also write a QC report, OUTPUT_DIR/report.html"
    )
    convert.add_argument(
        "--side-files", metavar="KIND,...",
        help="also write side files: nuke (a Read node), usd (a dome light, for panoramas), "
        "ocio (a file rule)",
    )  # fmt: skip
    convert.set_defaults(run=_convert)


def _convert(args: argparse.Namespace) -> int:
    from itmo_video.cli import outputs

    settings = settings_of(args)
    asked: RunOptions = options_said(args, RunOptions)
    tell_config(args, Settings, RunOptions)
    kinds = _side_files(args.side_files, settings, asked)
    failed: list[tuple[str, int]] = []  # inputs and their exit codes
    found = outputs.named(args.inputs, args.output, args.name)
    count = len(found.conversions)
    if not args.quiet:
        for notice in found.notices:
            print(f"itmo-video: {notice}", file=sys.stderr)
    for number, (source, output, frames) in enumerate(found.conversions, 1):
        run = replace(asked, frames=frames if asked.frames is None else asked.frames)
        try:
            place = f"{number} of {count}" if count > 1 else None
            with failure_told(source, to_programs=args.json):
                _convert_one(args, source, output, settings, run, place)
                if kinds and not (args.verify or args.dry_run):
                    from itmo_video.delivery.side_files import write_side_files

                    write_side_files(output, kinds)
        except ItmoError as error:
            if count == 1:
                raise
            # One bad input of many must not stop the others.
            failed.append((source, reported(error, args.log_file)))
    if failed:
        _sum_up(failed, count, args.log_file)
    return max((code for _, code in failed), default=0)


def _sum_up(failed: list[tuple[str, int]], count: int, log: LogFile | None) -> None:
    """Name the inputs of a batch that had errors in its last line; the errors may be far above."""
    names = ", ".join(f"{source} (exit code {code})" for source, code in failed)
    message = f"{len(failed)} of {count} inputs had errors: {names}"
    print(named(message, sys.stderr, "red"), file=sys.stderr)
    if log is not None:
        log.write(message)


def _side_files(text: str | None, settings: Settings, run: RunOptions) -> list[str]:
    kinds = [part for part in (text or "").split(",") if part]
    if kinds:
        from itmo_video.delivery.side_files import check_kinds

        check_kinds(kinds, settings.projection)
        if run.null:
            raise UsageError("side files need the frames", remedy="Omit --null or --side-files.")
    return kinds


def _convert_one(
    args: argparse.Namespace,
    source: str,
    output: str,
    settings: Settings,
    run: RunOptions,
    place: str | None,
) -> None:
    from itmo_video.conversion import checking
    from itmo_video.conversion.convert import convert
    from itmo_video.source.pipe import is_pipe

    if is_pipe(source) and (args.verify or args.dry_run or args.report):
        raise UsageError(
            "a pipe can be read only once", remedy="Omit --verify, --dry-run and --report."
        )
    if args.verify:
        notices = progress_of(args, None if place is None else source, place)
        checking.require_sound(checking.verify(source, output, settings, run, notices.on_event))
        which = "all frames are" if run.frames is None else frames_are(run.frames)
        print(f"{output}: {which} present and intact")
        return
    if args.dry_run:
        if place is not None:
            print(f"{source}:")
        print(checking.describe_plan(source, output, settings, run))
        return
    if args.report:
        from itmo_video.html_report.page import report, report_gate, require_templates

        if run.null:
            raise UsageError("a report needs the frames", remedy="Omit --null or --report.")
        require_templates()
    executor = None
    tls = args.tls_ca_file, args.tls_cert, args.tls_key
    if args.scheduler is not None:
        from itmo_video.cluster.address import Tls
        from itmo_video.cluster.dask_executor import cluster_executor

        executor = cluster_executor(args.scheduler, Tls(*tls))
    elif any(tls):
        raise UsageError(
            "TLS certificates need a scheduler", remedy="Add --scheduler tls://host:8786."
        )
    page = ReportOptions(clip=Path(source), overwrite=run.overwrite, max_pixels=run.max_pixels)
    if args.report and os.path.isdir(output):
        report_gate(Path(output), page, None).check()
    progress = progress_of(args, None if place is None else source, place)
    progress.detail(in_words(settings))
    damage: DamagedInputError | None = None
    try:
        with progress.on(source) as on_event:
            convert(source, output, settings, run, on_event, executor)
    except DamagedInputError as error:
        damage = error  # frames that were converted are still reported
    if args.report and any(Path(output).glob("*.exr")):
        report(output, page)
    if damage is not None:
        raise damage
