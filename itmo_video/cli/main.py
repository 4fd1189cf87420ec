"""The command line: flags come from the settings' definitions, exit codes from the errors."""

from __future__ import annotations

import argparse
import gc
import os
import signal
import sys
from collections.abc import Sequence
from contextlib import ExitStack
from types import FrameType
from typing import Any, NoReturn

from itmo_video.cli.analyse import add_analyse
from itmo_video.cli.completion import add_completion
from itmo_video.cli.convert import add_convert
from itmo_video.cli.evaluate import add_evaluate
from itmo_video.cli.info import add_info
from itmo_video.cli.log_file import LogFile
from itmo_video.cli.manual import add_manual
from itmo_video.cli.memory_guard import guarded, out_of_memory
from itmo_video.cli.outcome import Terminated, debug, interrupted, reported, unexpected
from itmo_video.cli.parser import Parser
from itmo_video.cli.preview import add_preview
from itmo_video.cli.report import add_report
from itmo_video.cli.streams import lost_output, with_streams
from itmo_video.cli.studio import add_studio
from itmo_video.cli.variants import add_variants
from itmo_video.errors import ItmoError

EXAMPLES = """\
examples:
  itmo-video convert clip.mp4 out/       EXR frames: out/clip.0001.exr ...
  itmo-video preview clip.mp4 film.mp4   an HDR10 film
  itmo-video convert --help              all options of a command
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    signal.signal(signal.SIGTERM, _on_sigterm)
    with_streams()
    said = sys.argv[1:] if argv is None else list(argv)
    log: list[LogFile] = []  # filled once the flags are parsed
    with ExitStack() as closing:
        code = _run(said, log, closing)
        for file in log:
            file.write(f"exit code {code}")
        return code


def _run(said: Sequence[str], log: list[LogFile], closing: ExitStack) -> int:
    try:
        args = _parser().parse_args(said)
        args.log_file = None
        if getattr(args, "log", None) is not None:
            args.log_file = LogFile(args.log)
            closing.callback(args.log_file.close)
            args.log_file.began(said)
            log.append(args.log_file)
        code = int(args.run(args) or 0)
        sys.stdout.flush()
        return code
    except ItmoError as error:
        return reported(error, *log)
    except KeyboardInterrupt:
        return interrupted(130, said)
    except Terminated:
        return interrupted(143, said)
    except MemoryError:
        debug()
        return out_of_memory()
    except OSError as error:
        if (code_of_stream := lost_output(error)) is not None:
            return code_of_stream
        return unexpected(error)
    except Exception as error:
        return unexpected(error)


def run() -> NoReturn:
    """Run the command line and exit the process."""
    # NumPy's matrices here are 3 x 3; its idle threads would occupy a core meanwhile.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    code = guarded(main)
    if "OpenImageIO" not in sys.modules:  # its bindings would print "leaks"
        gc.freeze()  # otherwise the interpreter scans all objects three times on exit, for 40 ms
    sys.exit(code)


def _on_sigterm(signum: int, frame: FrameType | None) -> None:
    raise Terminated


def _parser() -> argparse.ArgumentParser:
    parser = Parser(
        prog="itmo-video",
        description="Convert SDR video to HDR: EXR sequences, HDR10 and HLG films, HDR stills.",
        epilog=EXAMPLES,
    )
    parser.add_argument(
        "--version",
        action="store_true",
        help="show versions, and whether the compiled kernels are used",
    )
    parser.set_defaults(run=_no_command(parser))
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", parser_class=Parser)

    add_convert(commands)
    add_preview(commands)
    add_evaluate(commands)
    add_report(commands)
    add_analyse(commands)
    add_info(commands)
    add_studio(commands)
    add_variants(commands)
    add_completion(commands, parser)
    add_manual(commands, parser)
    return parser


def _no_command(parser: argparse.ArgumentParser) -> Any:
    def run(args: argparse.Namespace) -> int:
        if args.version:
            from itmo_video.cli.versions import versions

            print("\n".join(versions()))
            return 0
        parser.print_help()
        return 0

    return run
