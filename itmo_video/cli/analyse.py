"""The command `analyse`: writes the JSON to a file or standard output, and a summary."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from itmo_video.cli.config_file import options_said, tell_config
from itmo_video.cli.option_flags import add_options, given
from itmo_video.cli.run_flags import OF_ANALYSE, add_telling, progress_of
from itmo_video.cli.settings_flags import add_settings, settings_of
from itmo_video.conversion.frame_ranges import parse_ranges
from itmo_video.conversion.run_options import RunOptions
from itmo_video.errors import UsageError
from itmo_video.settings import Settings
from itmo_video.words import counted

if TYPE_CHECKING:
    from itmo_video.analysis.model import Analysis
    from itmo_video.output.gate import Gate

MOST_SHOTS = 20  # at the terminal


def add_analyse(commands: Any) -> None:
    """Add the subcommand."""
    analyse = commands.add_parser(
        "analyse",
        help="find cuts and keyframes, measure, and write a shot list to edit",
        description="Find the cuts and keyframes of a clip and measure it. In the JSON each shot "
        'can be given any setting of the look, as on the command line ("strength": 0.5, '
        '"peak_nits": 600, "operator": ..., also a "preset"), or "enabled": false; convert '
        "and preview read it with --analysis.",
    )
    analyse.add_argument(
        "input", metavar="INPUT", help="a clip, or, for metadata, a converted folder"
    )
    analyse.add_argument(
        "--output", metavar="FILE",
        help="file for the JSON (default: standard output), or for the shots as an edit list, "
        ".otio or .edl (extra `otio`)",
    )  # fmt: skip
    analyse.add_argument(
        "--shots", metavar="FILE",
        help="read the shots from an edit list of the clip, .otio or .edl (extra `otio`)",
    )  # fmt: skip
    analyse.add_argument(
        "--hdr10", action="store_true",
        help="instead, render everything and print MaxCLL and MaxFALL as options for encoders",
    )  # fmt: skip
    for flag, what in (("--hdr10plus", "HDR10+"), ("--dolby-vision", "Dolby Vision level 1")):
        analyse.add_argument(
            flag, metavar="FILE.json",
            help=f"instead, render everything and write {what} metadata per shot; for a folder, "
            "add --analysis",
        )  # fmt: skip
    add_options(analyse, RunOptions, OF_ANALYSE)
    add_telling(analyse, has_json=False)
    add_settings(analyse)
    analyse.set_defaults(run=_analyse)


def _analyse(args: argparse.Namespace) -> int:
    from itmo_video.source.pipe import is_pipe

    run: RunOptions = options_said(args, RunOptions)
    if args.hdr10 or args.hdr10plus or args.dolby_vision:
        return _metadata(args, run)
    if run.analysis is not None:
        raise UsageError("--analysis needs --hdr10plus or --dolby-vision", remedy="Omit it.")
    if is_pipe(args.input):
        raise UsageError(
            "a pipe can be analysed for --hdr10 only", where=args.input, remedy="Give a file."
        )
    tell_config(args, Settings)
    _analyse_to(args, settings_of(args), run)
    return 0


def _metadata(args: argparse.Namespace, run: RunOptions) -> int:
    from itmo_video.delivery.dynamic_metadata import as_text, dolby_vision, hdr10plus
    from itmo_video.delivery.light_levels import encoder_options, film_light_levels
    from itmo_video.delivery.shot_light import film_light_by_shots

    if args.output is not None:
        raise UsageError("metadata is written to its own file", remedy="Omit --output.")
    if run.frames is not None:
        raise UsageError(
            "metadata covers the whole film",
            remedy="Omit --frames; for a part, `convert --frames` it and analyse that folder.",
        )
    if args.shots is not None and (run.analysis is not None or os.path.isdir(args.input)):
        raise UsageError("--shots needs a clip and no --analysis", remedy="Omit it.")
    settings = None
    if not os.path.isdir(args.input):
        settings = settings_of(args)
        tell_config(args, Settings, RunOptions)
    elif args.preset is not None or given(args, Settings):
        raise UsageError(
            "settings do not apply to a converted folder", where=args.input, remedy="Omit them."
        )
    paths = (args.hdr10plus, args.dolby_vision)
    if None not in paths and os.path.realpath(paths[0]) == os.path.realpath(paths[1]):
        raise UsageError(
            "--hdr10plus and --dolby-vision name the same file", remedy="Give them two names."
        )
    gates = {
        kind: _gate(path, args, run)
        for kind, path in ((hdr10plus, args.hdr10plus), (dolby_vision, args.dolby_vision))
        if path is not None
    }
    with progress_of(args).on(args.input) as on_event:
        if not gates:
            light, peak = film_light_levels(args.input, settings, run, on_event)
        else:
            film = film_light_by_shots(args.input, settings, run, on_event, args.shots)
            light, peak = film.light, film.peak_nits
    for kind, gate in gates.items():
        gate.write(as_text(kind(film)).encode())
        if not args.quiet:
            print(f"itmo-video: {gate.path}: {counted(len(film.shots), 'shot')}", file=sys.stderr)
    if args.hdr10:
        print(encoder_options(light, peak), end="")
    return 0


def _gate(path: str, args: argparse.Namespace, run: RunOptions) -> Gate:
    from itmo_video.output.gate import DYNAMIC_METADATA, Gate
    from itmo_video.source.opening import input_files

    inputs = [] if os.path.isdir(args.input) else input_files(args.input)
    gate = Gate(path, DYNAMIC_METADATA, inputs=inputs, overwrite=run.overwrite)
    gate.check()
    return gate


def _analyse_to(args: argparse.Namespace, settings: Settings, run: RunOptions) -> None:
    """Write the JSON to --output, or to standard output.

    Raises OutputError if the file exists (it may contain shots edited by hand), unless --overwrite
    is given and it is an analysis.
    """
    from itmo_video.analysis.analyse import analyse
    from itmo_video.analysis.edit_lists import is_edit_list
    from itmo_video.output.gate import ANALYSIS, EDIT_LIST, Gate
    from itmo_video.source.opening import input_files

    gate, as_edit = None, args.output is not None and is_edit_list(args.output)
    if args.output is not None:
        kind = EDIT_LIST if as_edit else ANALYSIS
        gate = Gate(args.output, kind, inputs=input_files(args.input), overwrite=run.overwrite)
        gate.check()

    with progress_of(args).on(args.input) as on_event:
        analysis = analyse(
            args.input,
            settings,
            frames=None if run.frames is None else parse_ranges(run.frames),
            start_number=run.start_number,
            max_pixels=run.max_pixels,
            edit=args.shots,
            on_event=on_event,
        )
    if gate is None:
        print(analysis.to_json(), end="")
        return
    text = analysis.to_json() if not as_edit else _edit(args, analysis, settings, run)
    gate.write(text.encode())
    print(f"{args.output}: {in_words(analysis)}")


def _edit(args: argparse.Namespace, analysis: Analysis, settings: Settings, run: RunOptions) -> str:
    from itmo_video.analysis.edit_lists import edit_of
    from itmo_video.source.opening import input_options, open_clip

    with open_clip(args.input, input_options(settings, run.max_pixels)) as clip:
        return edit_of(analysis, clip.info, Path(args.output).suffix.lower())


def in_words(analysis: Analysis) -> str:
    """A summary in a few lines."""
    statistics, bars = analysis.statistics, analysis.bars
    lines = [
        f"{counted(analysis.frames, 'frame')}, {counted(len(analysis.shots), 'shot')}, "
        f"{counted(len(analysis.keyframes), 'keyframe')}",
        f"luminance: mean {statistics.mean:.3f}, median {statistics.p50:.3f}, "
        f"99 % {statistics.p99:.3f}",
        f"{statistics.clipped:.2%} of the pixels have a luma (of RGB, a channel) at 99 % of white "
        "or more",
    ]
    if any((bars.left, bars.right, bars.top, bars.bottom)):
        lines.append(
            f"black bars: left {bars.left}, right {bars.right}, top {bars.top}, "
            f"bottom {bars.bottom} pixels"
        )
    told = [shot for shot in analysis.shots if shot.rendering]
    lines += [f"shot {shot.first}-{shot.last}: {shot.rendering}" for shot in told[:MOST_SHOTS]]
    if len(told) > MOST_SHOTS:
        lines.append(f"and {counted(len(told) - MOST_SHOTS, 'more shot')}, all in the JSON")
    lines += [f"suggested: {s.setting} = {s.value} ({s.reason})" for s in analysis.suggestions]
    return "\n".join(lines)
