"""Converts SDR video to HDR: the Expand Map of Banterle et al. 2006, tracked along motion.

Clips: `convert`, `preview`, `evaluate`, `report`, `analyse`, like the commands of these names.
Arrays, without files: `expand`, `expand_frames`; a converted folder as arrays: `open_result`.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from itmo_video.analysis.analyse import analyse as analyse
    from itmo_video.analysis.model import Analysis as Analysis
    from itmo_video.analysis.reading import read_analysis as read_analysis
    from itmo_video.arrays.expand import Expanded as Expanded
    from itmo_video.arrays.expand import expand as expand
    from itmo_video.arrays.expand import expand_frames as expand_frames
    from itmo_video.arrays.result import Result as Result
    from itmo_video.arrays.result import open_result as open_result
    from itmo_video.conversion.convert import convert as convert
    from itmo_video.conversion.plan import Plan as Plan
    from itmo_video.conversion.run_options import RunOptions as RunOptions
    from itmo_video.conversion.summary import Summary as Summary
    from itmo_video.delivery.preview import PreviewSummary as PreviewSummary
    from itmo_video.delivery.preview import preview as preview
    from itmo_video.delivery.preview_options import PreviewOptions as PreviewOptions
    from itmo_video.errors import AlreadyHdrError as AlreadyHdrError
    from itmo_video.errors import CheckFailedError as CheckFailedError
    from itmo_video.errors import ClusterError as ClusterError
    from itmo_video.errors import DamagedInputError as DamagedInputError
    from itmo_video.errors import InputError as InputError
    from itmo_video.errors import ItmoError as ItmoError
    from itmo_video.errors import OutputError as OutputError
    from itmo_video.errors import UsageError as UsageError
    from itmo_video.evaluation.evaluate import Evaluation as Evaluation
    from itmo_video.evaluation.evaluate import evaluate as evaluate
    from itmo_video.evaluation.evaluate_options import EvaluateOptions as EvaluateOptions
    from itmo_video.events import Event as Event
    from itmo_video.events import Finished as Finished
    from itmo_video.events import FrameDone as FrameDone
    from itmo_video.events import Started as Started
    from itmo_video.events import Warned as Warned
    from itmo_video.html_report.page import report as report
    from itmo_video.html_report.report_options import ReportOptions as ReportOptions
    from itmo_video.model import ClipInfo as ClipInfo
    from itmo_video.model import Encoding as Encoding
    from itmo_video.model import Frame as Frame
    from itmo_video.output.exr import read_exr as read_exr
    from itmo_video.presets import make_settings as make_settings
    from itmo_video.settings import Settings as Settings
    from itmo_video.source.opening import Clip as Clip
    from itmo_video.source.opening import open_clip as open_clip

    __version__: str

# The module of each name: modules are imported when a name is first used, so that `import
# itmo_video` and `itmo-video --help` are fast. A test compares this with the imports above, which
# are for type checkers and editors.
_ROOMS = {
    "analysis.analyse": ("analyse",),
    "analysis.model": ("Analysis",),
    "analysis.reading": ("read_analysis",),
    "arrays.expand": ("Expanded", "expand", "expand_frames"),
    "arrays.result": ("Result", "open_result"),
    "conversion.convert": ("convert",),
    "conversion.plan": ("Plan",),
    "conversion.run_options": ("RunOptions",),
    "conversion.summary": ("Summary",),
    "delivery.preview": ("PreviewSummary", "preview"),
    "delivery.preview_options": ("PreviewOptions",),
    "errors": (
        "AlreadyHdrError", "CheckFailedError", "ClusterError", "DamagedInputError", "InputError",
        "ItmoError", "OutputError", "UsageError",
    ),
    "evaluation.evaluate": ("Evaluation", "evaluate"),
    "evaluation.evaluate_options": ("EvaluateOptions",),
    "events": ("Event", "Finished", "FrameDone", "Started", "Warned"),
    "html_report.page": ("report",),
    "html_report.report_options": ("ReportOptions",),
    "model": ("ClipInfo", "Encoding", "Frame"),
    "output.exr": ("read_exr",),
    "presets": ("make_settings",),
    "settings": ("Settings",),
    "source.opening": ("Clip", "open_clip"),
}  # fmt: skip
_HOMES = {name: room for room, names in _ROOMS.items() for name in names}

__all__ = ["__version__", *_HOMES]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        value: Any = version("itmo_video")
    elif name in _HOMES:
        value = getattr(import_module(f"itmo_video.{_HOMES[name]}"), name)
    else:
        raise AttributeError(f"module 'itmo_video' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*__all__, *(name for name in globals() if name.startswith("__"))})
