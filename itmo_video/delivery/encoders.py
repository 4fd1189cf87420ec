"""The encoders of films and AVIF stills: their options, tags and frames."""

from __future__ import annotations

import io
from fractions import Fraction
from typing import Any

import av
import numpy as np

from itmo_video.delivery import metadata
from itmo_video.delivery.choices import DEFAULT_CRF, DEFAULT_SPEED
from itmo_video.delivery.film_spec import FilmSpec, Signal, check_size
from itmo_video.delivery.svt_av1 import svt_as_guest
from itmo_video.delivery.ycbcr import Codes10, YCbCr

ENCODERS: dict[str, str] = {
    "av1": "libsvtav1", "hevc": "libx265", "prores": "prores_ks", "prores4444": "prores_ks",
    "dnxhr": "dnxhd",
}  # fmt: skip
# Code points of ITU-T H.273: primaries, transfer, matrix.
_CODE_POINTS: dict[str, tuple[int, int, int]] = {
    "pq": (9, 16, 9),
    "hlg": (9, 18, 9),
    "sdr": (1, 1, 1),
    "acescct": (2, 2, 1),  # H.273 has no numbers for log and its primaries
    "logc3": (2, 2, 1),
}
_CHROMA_SITED_LEFT = "chroma-sample-position=left"  # SVT-AV1's; hdr.py filters it so


def encode_avif(
    planes: YCbCr, crf: float, signal: Signal = "pq", size: tuple[int, int] | None = None
) -> bytes:
    """A 10-bit BT.2020 AVIF still, PQ or HLG, 4:2:0, by the encoder used for films.

    `size` is (width, height) where the planes were padded to even ones. UsageError for pictures
    that are too small for that encoder.
    """
    target = io.BytesIO()
    height, width = planes[0].shape
    width, height = size or (width, height)
    check_size("av1", width, height, "AVIF", "Write a .png.")
    with av.open(target, "w", format="avif") as box:
        stream: Any = box.add_stream(
            "libsvtav1",
            rate=Fraction(1),
            options={
                "crf": f"{crf:g}",
                "preset": DEFAULT_SPEED["av1"],
                "svtav1-params": _CHROMA_SITED_LEFT,
            },
        )
        stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p10le"
        tag_signal(stream.codec_context, signal)
        with svt_as_guest():
            stream.codec_context.open()
        luma, *chroma = planes
        frame = frame_of((luma[:height, :width], *chroma), "yuv420p10le")
        frame.pts = 0
        tag_signal(frame, signal)
        box.mux(stream.encode(frame))
        box.mux(stream.encode(None))
    return target.getvalue()


def encoder_options(spec: FilmSpec) -> dict[str, str]:
    """The encoder's options for this film, by FFmpeg's names."""
    if spec.codec in ("prores", "prores4444"):
        return {"profile": "3" if spec.codec == "prores" else "4", "vendor": "apl0"}
    if spec.codec == "dnxhr":
        return {"profile": "dnxhr_hqx" if spec.chroma == "422" else "dnxhr_444"}
    crf = spec.crf if spec.crf is not None else DEFAULT_CRF[spec.codec]
    options = {"crf": f"{crf:g}", "preset": spec.speed or DEFAULT_SPEED[spec.codec]}
    cll, fall = metadata.PLACEHOLDER
    is_hdr10 = spec.signal == "pq"
    if spec.codec == "av1":
        params = [_CHROMA_SITED_LEFT]
        if is_hdr10:
            params += [f"mastering-display={spec.mastering.for_svt()}"]
            params += [f"content-light={cll},{fall}"]
        return options | {"svtav1-params": ":".join(params)}
    # x265's SEI with its options would include the placeholders below.
    told = ["log-level=none", "info=0", "repeat-headers=1", "chromaloc=0"]
    if is_hdr10:
        told += ["hdr10=1", f"master-display={spec.mastering.for_x265()}", f"max-cll={cll},{fall}"]
    return options | {"x265-params": ":".join(told)}


def tag_signal(thing: Any, signal: Signal) -> None:
    """Tag a codec context or a frame with the code points of its signal, limited range."""
    thing.color_primaries, thing.color_trc, thing.colorspace = _CODE_POINTS[signal]
    thing.color_range = 1


def frame_of(planes: tuple[Codes10, ...], pixel_format: str) -> Any:
    """Planes of 10-bit codes as a frame of PyAV."""
    height, width = planes[0].shape
    frame = av.VideoFrame(width, height, pixel_format)
    for codes, plane in zip(planes, frame.planes, strict=True):
        rows = np.frombuffer(memoryview(plane), np.uint16).reshape(plane.height, -1)
        rows[:, : plane.width] = codes
    return frame
