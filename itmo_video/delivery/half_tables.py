"""Curves as tables of all half floats, which are 20 times finer than a 10-bit PQ step."""

from __future__ import annotations

from typing import Any, cast

import cv2
import numpy as np

from itmo_video.model import Float32, Float64


def all_halves() -> Float64:
    """The value of each of the 65536 bit patterns of a half float, in order."""
    return np.arange(65536, dtype=np.uint16).view(np.float16).astype(np.float64)


def looked_up(plane: Any, table: Float32) -> Float32:
    """The table's entry for each value of a float32 plane, by its bits as a half float."""
    halves = np.asarray(cv2.subtract(plane, 0.0, dtype=cv2.CV_16F)).reshape(plane.shape)
    return shaped(cv2.LUT(halves.view(np.uint16), table), plane.shape)


def shaped(plane: Any, shape: tuple[int, ...]) -> Float32:
    """A plane in its own shape; OpenCV takes a single pixel for a scalar, and returns four."""
    found = np.asarray(plane, np.float32)
    return cast(Float32, (found if shape != (1, 1) else found.ravel()[:1]).reshape(shape))
