"""`itmo-video preview`: its flags, and from them the options."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from itmo_video.cli.settings_flags import add_settings, settings_of
from itmo_video.settings import Settings

EXAMPLES = """\
examples:
  itmo-video preview clip.mp4 film.mp4
  itmo-video preview out/ film.mov --codec prores --source clip.mp4
  itmo-video preview clip.mp4 master.mp4 --quality high
  itmo-video preview clip.mp4 frame.avif --frame 100
  itmo-video preview clip.mp4 both.mp4 --as compare --layout wipe
"""


def add_preview(commands: Any) -> None:
    """Add the subcommand, with the settings' flags as `convert` has them."""
    parser = commands.add_parser(
        "preview",
        help="a film or still to look at, from a clip or from a converted folder",
        description="Make an HDR10 or HLG film, or a view for SDR monitors. A clip is converted on "
        "the fly by the settings below; a converted folder is shown as it is.",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("preview_source", metavar="SOURCE", help="a clip, or a converted folder")
    parser.add_argument(
        "output", metavar="OUTPUT", help="a film (.mp4 .mov .mkv), or a still (.avif .png .jpg)"
    )
    view = parser.add_argument_group("view")
    view.add_argument(
        "--as", dest="view", default=None,
        choices=("hdr10", "hlg", "sdr", "compare", "false-colour", "ladder"),
        help="what to show (hdr10; of a JPEG: sdr)",
    )  # fmt: skip
    view.add_argument("--frame", type=int, metavar="N", help="a still of this frame, by its number")
    view.add_argument(
        "--tone-map", default="bt2390", choices=("bt2390", "reinhard", "hable", "aces", "clip"),
        help="how HDR is brought back to SDR (bt2390)",
    )  # fmt: skip
    view.add_argument(
        "--layout", default="side", choices=("side", "wipe"), help="of compare (side by side)"
    )
    view.add_argument(
        "--wipe-at", type=_part, default=0.5, metavar="X", help="where the wipe is, 0 to 1 (0.5)"
    )
    view.add_argument(
        "--in-hdr", action="store_true", help="compare as an HDR10 film instead of tone-mapped"
    )
    view.add_argument(
        "--scale", default="stops", choices=("stops", "nits"), help="false colour's legend (stops)"
    )
    view.add_argument("--source", metavar="CLIP", help="a folder's source: sound, compare")
    coding = parser.add_argument_group("encoding")
    coding.add_argument(
        "--codec", default=None, choices=("av1", "hevc", "prores"), help="of a film (av1)"
    )
    coding.add_argument(
        "--chroma", choices=("420", "422"), help="4:2:0 or 4:2:2 (by the codec; av1 has 4:2:0)"
    )
    coding.add_argument(
        "--crf", "--quality", type=_crf, metavar="Q",
        help="0 best to 63 (av1: 25, hevc: 18 of 51, AVIF: 12), or `high`: pixels are the EXRs' "
        "nits within 2 %% in the median",
    )  # fmt: skip
    coding.add_argument(
        "--speed",
        metavar="PRESET",
        help="the encoder's preset (av1: 5 of 0 slow to 13; hevc: fast)",
    )
    add_settings(parser)
    group = parser.add_argument_group("run")
    group.add_argument("--frames", metavar="RANGES", help="numbers as in the file names: 1-100")
    group.add_argument("--start-number", type=int, default=1, metavar="N", help="of the first (1)")
    group.add_argument("--jobs", type=int, metavar="N", help="worker threads (the cores)")
    group.add_argument(
        "--max-pixels", type=int, default=2**27, metavar="N", help="a frame, at most"
    )
    group.add_argument(
        "--overwrite",
        action="store_true",
        help="replace OUTPUT where it exists",
    )
    group.add_argument("--quiet", action="store_true", help="no progress and no notices")
    group.add_argument("--json", action="store_true", help="one line of JSON an event")

    def run(args: argparse.Namespace) -> int:
        return _run(args, settings_of(args))

    parser.set_defaults(run=run)


def _run(args: argparse.Namespace, settings: Settings) -> int:
    from itmo_video.cli.progress import Progress
    from itmo_video.conversion.plan import RunOptions
    from itmo_video.delivery.encode import HIGH_CRF
    from itmo_video.delivery.preview import PreviewOptions, preview

    output = Path(args.output)
    is_jpeg = output.suffix.lower() in (".jpg", ".jpeg")
    options = PreviewOptions(
        view=args.view or ("sdr" if is_jpeg else "hdr10"),
        codec=args.codec or "av1",
        chroma=args.chroma,
        # ProRes is of high quality without being asked.
        crf=HIGH_CRF.get(args.codec or "av1") if args.crf == "high" else args.crf,
        speed=args.speed,
        tone_map=args.tone_map,
        layout=args.layout,
        wipe_at=args.wipe_at,
        scale=args.scale,
        hdr_compare=args.in_hdr,
        frame=args.frame,
        clip=Path(args.source) if args.source else None,
    )
    run = RunOptions(
        frames=args.frames,
        start_number=args.start_number,
        jobs=max(1, args.jobs) if args.jobs is not None else None,
        max_pixels=args.max_pixels,
        overwrite=args.overwrite,
    )
    progress = Progress(as_json=args.json, quiet=args.quiet)
    summary = preview(args.preview_source, output, settings, run, options, progress.on_event)
    if summary.max_cll and not (args.quiet or args.json):
        print(f"MaxCLL {summary.max_cll:.0f} nits, MaxFALL {summary.max_fall:.1f} nits")
    return 0


def _part(text: str) -> float:
    return _between(text, 0, 1)


def _crf(text: str) -> float | str:
    return text if text == "high" else _between(text, 0, 63)


def _between(text: str, low: float, high: float) -> float:
    value = float(text)
    if not low <= value <= high:
        raise argparse.ArgumentTypeError(f"must be from {low:g} to {high:g}")
    return value
