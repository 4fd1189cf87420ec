"""Views of a frame: HDR codes for an encoder, or R'G'B' for SDR monitors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np

from itmo_video.delivery import hdr, sdr
from itmo_video.delivery.aces import aces_hdr_nits, aces_peak, aces_sdr, require_aces
from itmo_video.delivery.choices import Chroma
from itmo_video.delivery.false_colour import false_colour
from itmo_video.delivery.film_spec import Signal
from itmo_video.delivery.hdr import Light
from itmo_video.delivery.lettering import RgbPicture, labelled
from itmo_video.delivery.log_curves import log_codes
from itmo_video.delivery.pictures import Picture, Pictures
from itmo_video.delivery.preview_options import PreviewOptions
from itmo_video.delivery.ycbcr import Codes10, YCbCr, to_ycbcr
from itmo_video.errors import UsageError
from itmo_video.kernels.compiled_codes import Curve
from itmo_video.model import Float32

WITHOUT_ALPHA = ("compare", "false-colour", "ladder")  # they say something of the whole picture


@dataclass(frozen=True)
class ShownFrame:
    """One frame ready to encode, with its number as in file names.

    `had_alpha` is whether the picture had any, which `alpha` may keep.
    """

    number: int
    time_s: Fraction
    planes: YCbCr
    light: Light
    alpha: Codes10 | None = None
    had_alpha: bool = False


def signal_of(options: PreviewOptions) -> Signal:
    """The signal that a view is encoded as."""
    if options.view in ("hdr10", "aces-hdr") or (options.view == "compare" and options.hdr_compare):
        return "pq"
    if options.view == "acescct" or options.view == "logc3":
        return options.view
    return "hlg" if options.view == "hlg" else "sdr"


def check_view(options: PreviewOptions) -> None:
    """Raise UsageError for options that do not apply to the view."""
    is_pq = signal_of(options) == "pq"
    if options.display_peak is not None and (not is_pq or options.view == "aces-hdr"):
        raise UsageError("--display-peak applies to PQ only", remedy="Use --as hdr10.")
    is_aces = options.view in ("aces", "aces-hdr")
    if is_aces:
        require_aces()
    is_mapped = (
        is_aces or options.view == "sdr" or (options.view == "compare" and not options.hdr_compare)
    )
    if options.exposure and not is_mapped:
        raise UsageError(
            "--exposure applies to tone-mapped views only", remedy="Use --as sdr or --as compare."
        )


def shown_peak(pictures: Pictures, options: PreviewOptions) -> float:
    """The peak in nits of the view; UsageError if the display's peak is not lower."""
    if options.view == "aces-hdr":
        return aces_peak(pictures.peak_nits)
    if options.display_peak is None:
        return pictures.peak_nits
    if options.display_peak >= pictures.peak_nits:
        raise UsageError(
            f"--display-peak {options.display_peak:g} has no effect: the peak is already "
            f"{pictures.peak_nits:g} nits",
            remedy="Omit it, or give a lower one.",
        )
    return options.display_peak


def light_of(
    picture: Picture, pictures: Pictures, options: PreviewOptions
) -> tuple[Sequence[Any], str, float]:
    """Linear planes, their primaries and the nits of 1.0; compare includes the source."""
    white = pictures.white_nits
    if options.view == "aces-hdr":
        peak, gain = aces_peak(pictures.peak_nits), 2.0**options.exposure
        nits = aces_hdr_nits(picture.rgb, pictures.primaries, peak, gain) / np.float32(white)
        return [np.ascontiguousarray(nits[..., i]) for i in range(3)], "rec2020", white
    if options.view != "compare":
        return picture.rgb, pictures.primaries, white
    assert picture.source is not None
    source = sdr.source_picture(picture.source)
    both = _both(source, sdr.to_709(picture.rgb, pictures.primaries), pictures, options)
    return [np.ascontiguousarray(both[..., i]) for i in range(3)], "rec709", white


def sdr_view(picture: Picture, pictures: Pictures, options: PreviewOptions) -> RgbPicture:
    """A frame as R'G'B' (H, W, 3) in [0, 1] for the SDR views."""
    if options.view == "aces":
        return aces_sdr(picture.rgb, pictures.primaries, 2.0**options.exposure)
    linear = sdr.to_709(picture.rgb, pictures.primaries)
    peak = pictures.peak_nits / pictures.white_nits
    if options.view == "false-colour":
        return false_colour(linear, options.scale, pictures.white_nits, peak)
    if options.view == "ladder":
        return sdr.ladder(linear, peak)
    gain = np.float32(2.0**options.exposure)
    # The exposures reach down to the peak, so no tone mapping is needed.
    result = sdr.tone_mapped(linear * gain, options.tone_map, max(1.0, peak * float(gain)))
    if options.view == "sdr":
        return result
    assert picture.source is not None
    source = sdr.encoded(sdr.source_picture(picture.source) * gain)
    return _both(source, result, pictures, options)


def _both(
    source: RgbPicture, result: RgbPicture, pictures: Pictures, options: PreviewOptions
) -> RgbPicture:
    """Source and result in one picture, with labels."""
    if not options.no_labels:
        told = f"HDR {shown_peak(pictures, options):.0f} nits"
        full = told if options.hdr_compare else f"{told}, tone-mapped ({options.tone_map})"
        stops = f", {options.exposure:+g} stops" if options.exposure else ""
        is_wipe = options.layout == "wipe"
        source = labelled(source, [f"SDR source{stops}", "SDR"])
        result = labelled(result, [f"{full}{stops}", told, "HDR"], "right" if is_wipe else "left")
    return sdr.composed(source, result, options.layout, options.wipe_at)


def frame_with_alpha(
    picture: Picture, pictures: Pictures, options: PreviewOptions, chroma: Chroma, keeps: bool
) -> ShownFrame:
    """`shown_frame`; where alpha `keeps`, of straight colours, with alpha as 10-bit full range.

    A comparison and its like keep none.
    """
    if picture.alpha is None or not keeps or options.view in WITHOUT_ALPHA:
        shown = shown_frame(picture, pictures, options, chroma)
        return replace(shown, had_alpha=picture.alpha is not None)
    alpha: Float32 = np.asarray(picture.alpha, np.float32)
    whole: Float32 = np.where(alpha > 0, alpha, np.float32(1))
    red, green, blue = (np.asarray(plane / whole, np.float32) for plane in picture.rgb)
    straight = replace(picture, rgb=(red, green, blue))
    (even,) = hdr.pad_even((alpha,))
    codes = np.rint(np.clip(even, 0, 1) * np.float32(1023)).astype(np.uint16)
    shown = shown_frame(straight, pictures, options, chroma)
    return replace(shown, alpha=codes, had_alpha=True)


def shown_frame(
    picture: Picture, pictures: Pictures, options: PreviewOptions, chroma: Chroma
) -> ShownFrame:
    """A frame as Y'CbCr codes, and its light levels (zeros for SDR views)."""
    signal = signal_of(options)
    if signal == "sdr":
        view = sdr_view(picture, pictures, options)
        code: Any = tuple(np.ascontiguousarray(view[..., i]) for i in range(3))
        even: Any = hdr.pad_even(code)
        planes = to_ycbcr(even, "bt709", chroma, picture.index, bit_depth=int(options.depth))
        return ShownFrame(picture.number, picture.time_s, planes, Light(0.0, 0.0))
    rgb, primaries, white = light_of(picture, pictures, options)
    if signal == "acescct" or signal == "logc3":
        log = hdr.pad_even(log_codes(rgb, primaries, signal))
        planes = to_ycbcr(log, "bt709", chroma, picture.index, bit_depth=int(options.depth))
        return ShownFrame(picture.number, picture.time_s, planes, Light(0.0, 0.0))
    curve: Curve = "pq" if signal == "pq" else "hlg"
    planes, light = hdr.master_frame(
        rgb, primaries, white, pictures.peak_nits, curve, chroma, picture.index,
        options.display_peak,
    )  # fmt: skip
    return ShownFrame(picture.number, picture.time_s, planes, light)
