"""Writing a still: PQ or HLG in AVIF, PNG or TIFF, a gain-map JPEG, or an SDR view."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from itmo_video.colour.transfer import BT1886_GAMMA
from itmo_video.delivery import hdr, sdr, stills
from itmo_video.delivery.avif_properties import with_light
from itmo_video.delivery.choices import AVIF_CRF
from itmo_video.delivery.eetf import to_display
from itmo_video.delivery.encoders import encode_avif
from itmo_video.delivery.films import OVER_BLACK, crf_of
from itmo_video.delivery.gain_map import gain_map_jpeg
from itmo_video.delivery.hdr import Light
from itmo_video.delivery.metadata import mastering
from itmo_video.delivery.pictures import Picture, Pictures
from itmo_video.delivery.preview_options import PreviewOptions
from itmo_video.delivery.views import light_of, sdr_view, shown_peak, signal_of
from itmo_video.errors import DamagedInputError, UsageError
from itmo_video.events import OnEvent, Warned
from itmo_video.kernels.compiled_codes import Curve
from itmo_video.output.gate import Gate

JPEG, _TIFF = (".jpg", ".jpeg"), (".tif", ".tiff")
STILLS = (".avif", ".png", *JPEG, *_TIFF)
_NO_LIGHT = Light(0.0, 0.0)


def check_still_options(suffix: str, options: PreviewOptions) -> None:
    """Raise UsageError for views that this kind of still does not support."""
    if options.hdr10plus is not None:
        raise UsageError("HDR10+ metadata is for films", remedy="Omit --hdr10plus.")
    if signal_of(options) in ("acescct", "logc3"):
        raise UsageError("log is for films only", remedy="Name it film.mov, or use --as hdr10.")
    if suffix == ".avif" and signal_of(options) == "sdr":
        raise UsageError(
            "AVIF stills are HDR", remedy="Use --as hdr10 or hlg, or name it .png or .jpg."
        )
    if options.view == "hlg" and suffix not in (".avif", ".png"):
        raise UsageError("HLG stills must be AVIF or PNG", remedy="Name it .avif or .png.")
    if suffix in JPEG and options.display_peak is not None:
        raise UsageError("a gain map adapts to any display", remedy="Omit --display-peak.")
    if suffix in JPEG and options.view == "compare" and options.hdr_compare:
        raise UsageError("a comparison in HDR must be PQ", remedy="Name it .avif or .png.")


def write_still(
    pictures: Pictures, gate: Gate, options: PreviewOptions, on_event: OnEvent
) -> tuple[Light, int]:
    """Write the picture; returns its light levels (zeros for SDR) and the bytes written.

    Raises DamagedInputError if it cannot be decoded.
    """
    suffix = gate.path.suffix.lower()
    shown_peak(pictures, options)  # raises for an impossible one

    def make(picture: Picture) -> tuple[bytes, Light]:
        if picture.alpha is not None:
            on_event(Warned(OVER_BLACK))
        if signal_of(options) == "sdr":
            return stills.sdr_still(sdr_view(picture, pictures, options), suffix), _NO_LIGHT
        if suffix in JPEG:
            return _gain_map(picture, pictures, options)
        return _hdr_still(gate.path, picture, pictures, options)

    made = next(pictures.mapped(make), None)
    if made is None:
        raise DamagedInputError(
            f"frame {pictures.numbers[0]} cannot be decoded",
            where=None if pictures.clip is None else str(pictures.clip),
            remedy="Choose another one with --frame.",
        )
    return made[1], gate.write(made[0])


def _hdr_still(
    path: Path, picture: Picture, pictures: Pictures, options: PreviewOptions
) -> tuple[bytes, Light]:
    """A still in PQ or HLG, with its light levels if the format can store them."""
    suffix = path.suffix.lower()
    rgb, primaries, white = light_of(picture, pictures, options)
    signal, peak = signal_of(options), shown_peak(pictures, options)
    curve: Curve = "hlg" if signal == "hlg" else "pq"
    stated = mastering(peak)
    if suffix == ".avif":
        planes, light = hdr.master_frame(
            rgb, primaries, white, pictures.peak_nits, curve, "420", picture.index,
            options.display_peak,
        )  # fmt: skip
        crf = crf_of(options)
        height, width = rgb[0].shape  # the codes are padded to even sizes
        still = encode_avif(planes, AVIF_CRF if crf is None else crf, signal, (width, height))
        return with_light(still, stated, light, str(path)) if curve == "pq" else still, light
    nits = hdr.to_nits_2020(rgb, primaries, white, pictures.peak_nits)
    nits = to_display(nits, pictures.peak_nits, options.display_peak)
    code, light = hdr.encode_nits(nits, curve, peak), hdr.frame_light(nits)
    if suffix in _TIFF:
        return stills.tiff_pq(code), light
    return stills.png_hdr(code, curve, stated, light), light


def _gain_map(picture: Picture, pictures: Pictures, options: PreviewOptions) -> tuple[bytes, Light]:
    """The source with our gain as its map, or the tone-mapped picture without a source."""
    linear = sdr.to_709(picture.rgb, pictures.primaries)
    peak = pictures.peak_nits / pictures.white_nits
    if picture.source is not None:
        base = sdr.source_picture(picture.source)
    else:
        shown = sdr.tone_mapped(linear, options.tone_map, peak)
        base = np.asarray(shown ** np.float32(BT1886_GAMMA), np.float32)  # as it was encoded
    nits = hdr.to_nits_2020(
        picture.rgb, pictures.primaries, pictures.white_nits, pictures.peak_nits
    )
    return gain_map_jpeg(base, linear, peak), hdr.frame_light(nits)
