"""Writing a rendered frame, unless the run is to write nothing."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from itmo_video.conversion.exr_headers import exr_header
from itmo_video.conversion.plan import Plan
from itmo_video.conversion.run_options import RunOptions
from itmo_video.model import Frame, Half
from itmo_video.output import exr
from itmo_video.output.folder import OutputFolder
from itmo_video.rendering.frame import Rendered


def write_frame(
    plan: Plan, folder: OutputFolder, run: RunOptions, number: int, frame: Frame, rendered: Rendered
) -> int:
    """Write a frame's file atomically; returns its bytes, 0 if the run is to write nothing."""
    if run.null:
        return 0
    return exr.write_exr(
        folder.frame_path(number),
        rendered.rgb,
        exr_header(plan, number, frame),
        alpha=rendered.alpha,
        layers=rendered.layers,
        durable=run.durable,
    )


def peak_of(rgb: Sequence[Half]) -> float:
    """The largest of all values, at least 0."""
    # Positive half floats sort like their bits as integers; NumPy's maximum of halves is slow.
    bits = max(int(plane.view(np.int16).max()) for plane in rgb)
    return float(np.int16(max(0, bits)).view(np.float16))
