"""Small clips of every codec that PyAV can make, for damage to be done to them."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
import numpy.typing as npt
from clips import moving_scene

from itmo_video.delivery.svt_av1 import svt_as_guest

X264 = "keyint=12:min-keyint=12:scenecut=0:bframes=3:threads=1:cpu-independent=1"
X265 = "keyint=12:min-keyint=12:bframes=3:log-level=none:pools=none:frame-threads=1"
VPX = {"deadline": "realtime", "cpu-used": "8"}
Row = tuple[str, str, str, dict[str, str]]  # encoder, extension, pixel format, options

CODECS: dict[str, Row] = {
    "h264": ("libx264", "mp4", "yuv420p", {"x264-params": X264}),
    "h264mkv": ("libx264", "mkv", "yuv420p", {"x264-params": X264 + ":open-gop=1"}),
    "h264ts": ("libx264", "ts", "yuv420p", {"x264-params": X264}),
    "h264avi": ("libx264", "avi", "yuv420p", {"x264-params": X264 + ":bframes=0"}),
    "h264slices": ("libx264", "mp4", "yuv420p", {"x264-params": X264 + ":cabac=0:slices=4"}),
    "h264fields": ("libx264", "mp4", "yuv420p", {"x264-params": X264 + ":interlaced=1"}),
    "h264high": ("libx264", "mkv", "yuv422p10le", {"x264-params": X264}),
    "h264refresh": (
        "libx264", "mp4", "yuv420p", {"x264-params": X264 + ":intra-refresh=1:bframes=0"},
    ),
    "h264long": ("libx264", "mp4", "yuv420p", {"x264-params": X264.replace("12", "250")}),
    "h264raw": ("libx264", "h264", "yuv420p", {"x264-params": X264}),
    "hevc": ("libx265", "mp4", "yuv420p", {"x265-params": X265}),
    "hevcopen": ("libx265", "mkv", "yuv420p", {"x265-params": X265 + ":open-gop=1"}),
    "hevcts": ("libx265", "ts", "yuv420p10le", {"x265-params": X265}),
    "hevcraw": ("libx265", "hevc", "yuv420p", {"x265-params": X265}),
    "av1": ("libsvtav1", "mp4", "yuv420p10le", {"preset": "10", "crf": "40"}),
    "av1mkv": ("libsvtav1", "mkv", "yuv420p", {"preset": "10", "crf": "40"}),
    "vp8": ("libvpx", "webm", "yuv420p", VPX),
    "vp9": ("libvpx-vp9", "webm", "yuv420p", VPX),
    "vp9mp4": ("libvpx-vp9", "mp4", "yuv420p", VPX | {"lag-in-frames": "16", "auto-alt-ref": "1"}),
    "mpeg4": ("mpeg4", "mp4", "yuv420p", {"bf": "2"}),
    "mpeg4avi": ("mpeg4", "avi", "yuv420p", {"bf": "2"}),
    "mpeg2": ("mpeg2video", "mpg", "yuv420p", {"bf": "2"}),
    "mpeg2ts": ("mpeg2video", "ts", "yuv420p", {"bf": "2"}),
    "mpeg2mxf": ("mpeg2video", "mxf", "yuv422p", {"bf": "2"}),
    "mpeg1": ("mpeg1video", "mpg", "yuv420p", {"bf": "2"}),
    "h263": ("h263", "3gp", "yuv420p", {}),
    "flv": ("flv", "flv", "yuv420p", {}),
    "msmpeg4": ("msmpeg4", "avi", "yuv420p", {}),
    "msmpeg4v2": ("msmpeg4v2", "avi", "yuv420p", {}),
    "wmv1": ("wmv1", "asf", "yuv420p", {}),
    "wmv2": ("wmv2", "asf", "yuv420p", {}),
    "rv10": ("rv10", "rm", "yuv420p", {}),
    "prores": ("prores_ks", "mov", "yuv422p10le", {}),
    "dnxhd": ("dnxhd", "mxf", "yuv422p", {"profile": "dnxhr_sq"}),
    "ffv1": ("ffv1", "mkv", "yuv420p", {"slices": "4", "level": "3"}),
    "ffv1old": ("ffv1", "avi", "yuv420p", {"level": "1"}),
    "huffyuv": ("huffyuv", "avi", "yuv422p", {}),
    "utvideo": ("utvideo", "avi", "yuv420p", {}),
    "mjpeg": ("mjpeg", "avi", "yuvj420p", {}),
    "mjpegmov": ("mjpeg", "mov", "yuvj420p", {}),
    "jpeg2000": ("jpeg2000", "mov", "yuv420p", {}),
    "snow": ("snow", "avi", "yuv420p", {"strict": "-2"}),
    "cfhd": ("cfhd", "mov", "yuv422p10le", {}),
    "dirac": ("dirac", "mkv", "yuv420p", {}),
    "vc2": ("vc2", "mov", "yuv422p", {"strict": "-1"}),
    "svq1": ("svq1", "mov", "yuv410p", {}),
    "cinepak": ("cinepak", "avi", "rgb24", {}),
    "qtrle": ("qtrle", "mov", "rgb24", {}),
    "png": ("png", "mov", "rgb24", {}),
    "v210": ("v210", "mov", "yuv422p10le", {}),
    "raw": ("rawvideo", "avi", "yuv420p", {}),
    "asv1": ("asv1", "avi", "yuv420p", {}),
    "flashsv": ("flashsv", "flv", "bgr24", {}),
    "zmbv": ("zmbv", "avi", "bgr0", {}),
    "zlib": ("zlib", "avi", "bgr24", {}),
    "msvideo1": ("msvideo1", "avi", "rgb555le", {}),
    "amv": ("amv", "avi", "yuvj420p", {}),
    "apng": ("apng", "apng", "rgb24", {}),
    "asv2": ("asv2", "avi", "yuv420p", {}),
    "cljr": ("cljr", "avi", "yuv411p", {}),
    "dpx": ("dpx", "avi", "rgb24", {}),
    "dv": ("dvvideo", "avi", "yuv420p", {}),
    "dxv": ("dxv", "mov", "rgba", {}),
    "ffvhuff": ("ffvhuff", "avi", "yuv420p", {}),
    "flashsv2": ("flashsv2", "flv", "bgr24", {"strict": "-2"}),
    "h261": ("h261", "avi", "yuv420p", {}),
    "h263p": ("h263p", "avi", "yuv420p", {}),
    "jpegls": ("jpegls", "avi", "bgr24", {}),
    "ljpeg": ("ljpeg", "avi", "bgr24", {}),
    "magicyuv": ("magicyuv", "avi", "gbrp", {}),
    "r210": ("r210", "avi", "gbrp10le", {}),
    "roqvideo": ("roqvideo", "roq", "yuvj444p", {}),
    "rpza": ("rpza", "avi", "rgb555le", {}),
    "rv20": ("rv20", "rm", "yuv420p", {}),
    "sgi": ("sgi", "mov", "rgb24", {}),
    "speedhq": ("speedhq", "avi", "yuv420p", {}),
    "targa": ("targa", "avi", "bgr24", {}),
    "tiff": ("tiff", "mov", "rgb24", {}),
    "v308": ("v308", "avi", "yuv444p", {}),
    "v410": ("v410", "avi", "yuv444p10le", {}),
    "yuv4": ("yuv4", "avi", "yuv420p", {}),
}  # fmt: skip


SIZES = {  # of encoders that take few
    "dnxhd": (256, 120), "h263": (176, 144), "h261": (176, 144), "dvvideo": (720, 576),
}  # fmt: skip


def make_clip(
    name: str, folder: Path, frames: int = 60, size: tuple[int, int] = (176, 144)
) -> Path:
    """A clip of a codec by its name in CODECS, of moving things with two cuts."""
    encoder, extension, pixel_format, options = CODECS[name]
    width, height = SIZES.get(encoder, size)
    path = folder / f"{name}.{extension}"
    scene: Sequence[npt.NDArray[np.uint8]] = list(
        moving_scene(frames, width=width, height=height, cuts=(20, 45))
    )
    with av.open(str(path), "w") as box:
        stream: Any = box.add_stream(encoder, rate=Fraction(24), options=dict(options))
        stream.width, stream.height, stream.pix_fmt = width, height, pixel_format
        stream.codec_context.gop_size = 12
        if encoder != "libsvtav1":
            stream.codec_context.bit_rate = 600_000
        stream.codec_context.thread_count = 1
        with svt_as_guest():
            stream.codec_context.open()
        for n, codes in enumerate(scene):
            frame = av.VideoFrame.from_ndarray(codes, "rgb24").reformat(format=pixel_format)
            frame.pts, frame.time_base = n, Fraction(1, 24)
            box.mux(stream.encode(frame))
        box.mux(stream.encode())
    return path
