"""ColorVideoVDP of a film and its truth: JOD, and where in the picture they differ.

Mantiuk, Hanji, Ashraf, Asano and Chapiro, ColorVideoVDP, ACM Transactions on Graphics 2024. It is
the extra `vdp`, imported only when needed. Pictures are linear BT.709 RGB in cd/m2,
float32 (H, W, 3).
"""

from __future__ import annotations

import sys
import types
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from itertools import islice
from math import ceil
from typing import Any

import numpy as np

from itmo_video.errors import UsageError
from itmo_video.evaluation.agreement import Display
from itmo_video.evaluation.fidelity import DARKEST_NITS
from itmo_video.model import Code, Float32
from itmo_video.words import to_install

CONTRAST = 1e6  # of the display
AMBIENT_LUX = 5.0
_MEMORY_S = Fraction(1, 4)  # the metric's temporal filters end after 250 ms
_CHUNK = 8  # frames of heat map computed at a time, at least

Pictures = Iterator[tuple[Float32, Float32]]  # test and truth


@dataclass(frozen=True)
class Film:
    """A film and its truth: `pictures()` starts again on each call and yields `frames` pairs."""

    pictures: Callable[[], Pictures]
    frames: int
    size: tuple[int, int]
    frame_rate: Fraction


def require_vdp() -> None:
    """Raise UsageError unless the extra is installed."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        _import()


def on_display(rgb: Float32, display: Display) -> Float32:
    """What a display shows for linear RGB with 1.0 at white: cd/m2, each channel clipped."""
    shown = np.clip(rgb * np.float32(display.white_nits), DARKEST_NITS, display.peak_nits)
    return np.asarray(shown, np.float32)


def jod(film: Film, display: Display) -> float:
    """Just-objectionable differences of a film: 10 if identical, lower for worse quality.

    A film of one frame is measured as a still. Holds as many pictures as the metric's filters are
    long. Raises UsageError unless the extra is installed.
    """
    with _metric(film.size, display, heat_map=None) as metric:
        source = _Source(film.pictures(), film.frames, film, metric.display_photometry)
        value, _ = metric.predict_video_source(source)
    return float(value)


def heat_map(film: Film, display: Display) -> Iterator[Code]:
    """For each frame, where differences are visible: sRGB, uint8 (H, W, 3).

    The metric's `supra-threshold` colours (yellow: 3 JOD) over the truth's brightness. It keeps
    all maps of a run, so runs are short, each with the preceding frames that its filters need.
    Raises UsageError unless the extra is installed.
    """
    reach = 2 * ceil(_MEMORY_S * film.frame_rate / 2)
    pictures = film.pictures()
    with _metric(film.size, display, heat_map="supra-threshold") as metric:
        before: list[tuple[Float32, Float32]] = []
        while new := list(islice(pictures, max(_CHUNK, reach))):
            window = [*before, *new]
            source = _Source(iter(window), len(window), film, metric.display_photometry)
            _, found = metric.predict_video_source(source)
            maps = found["heatmap"][0, :, len(before) :].permute(1, 2, 3, 0).float().numpy()
            yield from np.rint(np.clip(maps, 0, 1) * 255).astype(np.uint8)
            before = window[-reach:]


class _Source:
    """A film as the metric's video_source: pairs in order, each requested once."""

    def __init__(self, pictures: Pictures, frames: int, film: Film, photometry: Any) -> None:
        self._pictures, self._frames, self._film = pictures, frames, film
        self._photometry = photometry
        self._at = -1
        self._pair: tuple[Float32, Float32] | None = None

    def get_video_size(self) -> tuple[int, int, int]:
        width, height = self._film.size
        return height, width, self._frames

    def get_frames_per_second(self) -> float:
        return float(self._film.frame_rate)

    def get_batch_size(self) -> int:
        return 1

    def get_test_frame(self, frame: int, device: Any, colorspace: str) -> Any:
        return self._get(frame, 0, device, colorspace)

    def get_reference_frame(self, frame: int, device: Any, colorspace: str) -> Any:
        return self._get(frame, 1, device, colorspace)

    def _get(self, frame: int, side: int, device: Any, colorspace: str) -> Any:
        import torch

        while self._pair is None or self._at < frame:
            self._pair = next(self._pictures)
            self._at += 1
        assert self._at == frame, "the metric went back to an earlier frame"
        planes = np.ascontiguousarray(self._pair[side].transpose(2, 0, 1))
        tensor = torch.from_numpy(planes).to(device)[None, :, None]  # batch, colour, frame, H, W
        return self._photometry.source_2_target_colorspace(tensor, colorspace)


@contextmanager
def _metric(size: tuple[int, int], display: Display, heat_map: str | None) -> Iterator[Any]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # torch's and the metric's own, of no use here
        pycvvdp = _import()
        photometry = pycvvdp.vvdp_display_photo_eotf(
            Y_peak=display.peak_nits, contrast=CONTRAST, EOTF="linear", E_ambient=AMBIENT_LUX
        )
        geometry = pycvvdp.vvdp_display_geometry(list(size), ppd=display.pixels_per_degree)
        yield pycvvdp.cvvdp(
            display_photometry=photometry, display_geometry=geometry, heatmap=heat_map, quiet=True
        )


def _import() -> Any:
    try:
        import torch

        try:
            import torchvision  # noqa: F401 - only whether it can be imported
        except (ImportError, RuntimeError):
            # PyPI's torchvision does not match every build of torch; the metric needs only a blur.
            with _stand_in_for_torchvision(torch):
                import pycvvdp
        else:
            import pycvvdp
    except ImportError as error:
        raise UsageError(
            f"ColorVideoVDP cannot be imported ({error})",
            remedy=to_install("vdp"),
        ) from error
    return pycvvdp


@contextmanager
def _stand_in_for_torchvision(torch: Any) -> Iterator[None]:
    """Provide what the metric imports from torchvision, only while it does so."""

    class GaussianBlur(torch.nn.Module):  # type: ignore[misc]  # its base is Any here
        """A blur of the last two axes, edges reflected, as torchvision's with a fixed sigma."""

        def __init__(self, kernel_size: int, sigma: float) -> None:
            super().__init__()
            away = torch.arange(kernel_size, dtype=torch.float32) - (kernel_size - 1) / 2
            weights = torch.exp(-(away**2) / (2 * sigma**2))
            self.weights = weights / weights.sum()

        def forward(self, picture: Any) -> Any:
            half = self.weights.numel() // 2
            planes = picture.reshape(-1, 1, *picture.shape[-2:])
            padded = torch.nn.functional.pad(planes, (half, half, half, half), mode="reflect")
            weights = self.weights.to(picture)
            across = torch.nn.functional.conv2d(padded, weights[None, None, None, :])
            blurred = torch.nn.functional.conv2d(across, weights[None, None, :, None])
            return blurred.reshape(picture.shape)

    parts = {name: types.ModuleType(f"torchvision.{name}") for name in ("transforms", "ops")}
    # Attributes are set on modules here, which types cannot express.
    parts["transforms"].GaussianBlur = GaussianBlur  # type: ignore[attr-defined]
    parts["ops"].MLP = torch.nn.Sequential  # type: ignore[attr-defined] # imported, not used
    whole = types.ModuleType("torchvision")
    modules = {"torchvision": whole} | {f"torchvision.{n}": part for n, part in parts.items()}
    _forget_torchvision()  # remains of a failed import
    sys.modules.update(modules)
    try:
        yield
    finally:
        _forget_torchvision()


def _forget_torchvision() -> None:
    for name in [name for name in sys.modules if name.split(".")[0] == "torchvision"]:
        del sys.modules[name]
