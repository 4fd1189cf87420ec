"""A flow depends on its two pictures alone, not on what the thread has seen before."""

from __future__ import annotations

import numpy as np
from clips import moving_scene

from itmo_video.motion import flow


def test_a_small_picture_before_changes_nothing() -> None:
    large = [frame[..., 0] for frame in moving_scene(2, width=192, height=128)]
    small = [frame[..., 0] for frame in moving_scene(2, width=24, height=24)]
    fresh = flow.flow_px(*map(np.ascontiguousarray, large))
    flow.flow_px(*map(np.ascontiguousarray, small))
    again = flow.flow_px(*map(np.ascontiguousarray, large))
    assert (fresh == again).all(), "the flow remembers another clip's size"
