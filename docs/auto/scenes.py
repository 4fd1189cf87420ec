"""Scenes of known radiance, and what a camera makes of them: the samples `auto` is fitted to.

A sample is a window of an HDR panorama or image under a random exposure, and the SDR frame that a
camera would have recorded of it: linear light with shot noise, clipped channel by channel, coded
(sRGB), rounded to 8 bits and compressed. 1.0 is the radiance that just reaches SDR white.
"""

from __future__ import annotations

import hashlib
import io
import re
from pathlib import Path

import av
import cv2
import numpy as np
import numpy.typing as npt

BT709_WEIGHTS = np.array([0.2126, 0.7152, 0.0722], np.float32)
# BT.709's matrix, full range to limited, both in codes of 8 bits.
YCBCR_OF_RGB = np.array(
    [[0.2126, 0.7152, 0.0722], [-0.114572, -0.385428, 0.5], [0.5, -0.454153, -0.045847]], np.float32
) * np.array([[219 / 255], [224 / 255], [224 / 255]], np.float32)
YCBCR_OF_BLACK = np.array([16, 128, 128], np.float32)
LETTERS = list("ABCDEFGHIKLMNOPRSTUVWYabcdehiklmnoprstuy  0123456789")
HELD_OUT_EVERY = 5  # every fifth scene by name is left out of the fit

Float = npt.NDArray[np.float32]
Codes = npt.NDArray[np.uint8]


def read_hdr(path: Path) -> Float:
    """Linear RGB (h, w, 3) of an .hdr or .exr file; what is negative or not a number becomes 0."""
    if path.suffix.lower() == ".exr":
        import OpenEXR

        channels = OpenEXR.File(str(path), separate_channels=True).channels()
        rgb = np.dstack([channels[name].pixels for name in "RGB"])
    else:
        bgr = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        if bgr is None:
            raise ValueError(f"{path}: not a picture that OpenCV reads")
        rgb = bgr[..., ::-1]
    return np.clip(np.nan_to_num(rgb.astype(np.float32), posinf=6e4), 0, 6e4)


def scene_paths(data: Path) -> tuple[list[Path], list[Path]]:
    """The files to fit to and those held out: (fit, held_out), each sorted by name.

    Of the scenes of 2026 half are fitted to, by the hash of their names; none of them whose place
    was photographed for another of the other half, too.
    """
    panoramas = _pictures(data, "panoramas", "panoramas_more")
    panoramas.sort(key=lambda p: p.name.lower())
    images = _pictures(data, "hdr_images")
    held = panoramas[2::HELD_OUT_EVERY]
    return [p for p in panoramas if p not in held] + images + _half_of_2026(data), held


def _pictures(data: Path, *folders: str) -> list[Path]:
    return sorted(p for f in folders for p in (data / f).glob("*") if p.suffix in {".hdr", ".exr"})


def _half_of_2026(data: Path) -> list[Path]:
    paths = _pictures(data, "panoramas_2026", "images_2026")
    left_out = {_place(p) for p in paths if not _in_first_half(p)}
    return [p for p in paths if _in_first_half(p) and _place(p) not in left_out]


def _in_first_half(path: Path) -> bool:
    return hashlib.md5(path.stem.encode()).digest()[0] % 2 == 0


def _place(path: Path) -> str:
    name = re.sub(r"_puresky$|^hdrihaven_", "", path.stem)
    name = re.sub(r"^winter_evening_.*", "winter_evening", name)
    return {"evening_road_01": "eveningroad"}.get(name, name)


def srgb_encode(linear: Float) -> Float:
    """SRGB codes in [0, 1] of linear light in [0, 1] (IEC 61966-2-1)."""
    curve = 1.055 * np.power(np.maximum(linear, 1e-9), 1 / 2.4) - 0.055
    return np.where(linear <= 0.0031308, 12.92 * linear, curve).astype(np.float32)


def window(scene: Float, size: tuple[int, int], rng: np.random.Generator) -> Float:
    """A random window (h, w, 3) of a scene: cut out, zoomed, or seen in perspective."""
    (height, width), (w, h) = scene.shape[:2], size
    panorama = width == 2 * height
    u, v = np.meshgrid(np.arange(w, dtype=np.float32), np.arange(h, dtype=np.float32))
    if panorama and rng.random() < 0.25:  # a camera's view
        yaw, pitch, roll = rng.uniform(0, 2 * np.pi), rng.normal(0.05, 0.3), rng.normal(0, 0.08)
        focal = w / 2 / np.tan(np.radians(rng.uniform(55, 110)) / 2)
        x, y = (u - w / 2) / focal, (v - h / 2) / focal
        x, y = x * np.cos(roll) - y * np.sin(roll), x * np.sin(roll) + y * np.cos(roll)
        y, z = y * np.cos(pitch) - np.sin(pitch), y * np.sin(pitch) + np.cos(pitch)
        longitude = np.arctan2(x, z) + yaw
        latitude = np.arctan2(y, np.hypot(x, z))
        map_x = (longitude / (2 * np.pi) % 1 * width).astype(np.float32)
        map_y = ((latitude / np.pi + 0.5) * height).astype(np.float32)
    else:
        zoom = 1.0 if rng.random() < 0.4 else float(np.exp(rng.uniform(np.log(0.6), np.log(1.5))))
        zoom = min(zoom, height / h) if panorama else min(zoom, height / h, width / w)
        x0 = rng.uniform(0, width if panorama else max(width - w * zoom, 1e-3))
        y0 = rng.uniform(0, max(height - h * zoom, 1e-3))
        if rng.random() < 0.4:  # where a level camera looks
            y0 = np.clip(
                0.45 * (height - h * zoom) + rng.normal(0, 8), 0, max(height - h * zoom, 0)
            )
        map_x, map_y = u * np.float32(zoom) + np.float32(x0), v * np.float32(zoom) + np.float32(y0)
    border = cv2.BORDER_WRAP if panorama else cv2.BORDER_REFLECT_101
    cut = np.maximum(cv2.remap(scene, map_x, map_y, cv2.INTER_LINEAR, borderMode=border), 0)
    if rng.random() < 0.5:
        cut = cut[:, ::-1]
    return np.ascontiguousarray(cut, dtype=np.float32)


def title(truth: Float, rng: np.random.Generator) -> Float:
    """The picture with lettering of SDR white: subtitles, titles and clocks do not glow."""
    h, w = truth.shape[:2]
    mask = np.zeros((h, w), np.uint8)
    for _ in range(rng.integers(1, 4)):
        text = "".join(rng.choice(LETTERS, rng.integers(4, 28)))
        height = rng.choice([rng.uniform(0.8, 0.97), rng.uniform(0.1, 0.9)])
        where = (int(rng.uniform(0, 0.6) * w), int(height * h))
        scale = float(np.exp(rng.uniform(np.log(0.35), np.log(2.5))))
        thick = max(1, round(scale * rng.uniform(1, 3)))
        cv2.putText(mask, text, where, int(rng.integers(0, 8)), scale, 255, thick, cv2.LINE_AA)
    if rng.random() < 0.2:  # a card, a page, a window of a screen
        x, y = int(rng.uniform(0, 0.7) * w), int(rng.uniform(0, 0.7) * h)
        corner = (x + int(rng.uniform(20, 160)), y + int(rng.uniform(15, 110)))
        cv2.rectangle(mask, (x, y), corner, 255, -1)
    share = mask[..., None].astype(np.float32) / 255
    return (truth * (1 - share) + np.float32(rng.uniform(0.9, 1.0)) * share).astype(np.float32)


def expose(cut: Float, rng: np.random.Generator) -> Float:
    """The window with 1.0 at the radiance that reaches SDR white, in some other light."""
    tint = np.exp(rng.normal(0, 0.1, 3)).astype(np.float32)
    cut = cut * tint
    luminance = cut @ BT709_WEIGHTS
    if rng.random() < 0.3:  # more or less colour
        grey = luminance[..., None]
        cut = np.maximum(grey + (cut - grey) * np.float32(rng.uniform(0.4, 1.3)), 0)
    percentile = 100 - float(np.exp(rng.uniform(np.log(0.4), np.log(22))))
    if rng.random() < 0.35:
        percentile = float(rng.choice([85.0, 94.0, 94.0, 99.0]))
    white = np.percentile(luminance[::2, ::2], percentile)
    return np.asarray(np.minimum(cut / np.float32(max(white, 1e-6)), 6e4), np.float32)


def graded(truth: Float, rng: np.random.Generator) -> tuple[Float, Float]:
    """What is recorded without noise, in [0, 1], and the truth on the same scale: both (h, w, 3).

    White is not always the last code, and some footage ends in a shoulder.
    """
    kind = rng.random()
    if kind < 0.55:
        return np.clip(truth, 0, 1), truth
    white = np.float32(rng.uniform(0.93, 1.0))
    if kind < 0.85:
        return np.clip(truth, 0, 1) * white, truth * white
    knee = np.float32(rng.uniform(0.55, 0.9))
    above = np.maximum(truth - knee, 0) / (1 - knee)
    return (np.minimum(truth, knee) + (1 - knee) * (1 - np.exp(-above))) * white, truth * white


def shoot(recorded: Float, rng: np.random.Generator) -> Codes:
    """8-bit sRGB codes (h, w, 3) of light in [0, 1]: noisy below white, compressed."""
    noise = 0.004 * (1.0 if rng.random() < 0.5 else rng.uniform(0, 3))
    white = recorded.max()
    deviation = np.float32(noise) * np.sqrt(recorded + np.float32(0.02))
    shot = recorded + rng.standard_normal(recorded.shape, np.float32) * deviation
    shot = np.where(recorded < white, np.clip(shot, 0, white), recorded)
    code = np.rint(srgb_encode(shot) * 255).astype(np.uint8)
    kind = rng.random()
    if kind < 0.3:
        code = as_jpeg(code, int(rng.choice([rng.integers(25, 98), rng.integers(85, 98)])))
    elif kind < 0.85:
        qp = rng.integers(14, 28) if rng.random() < 0.6 else rng.integers(28, 43)
        code = as_h264(code, int(qp))
    return np.ascontiguousarray(code)


def as_jpeg(code: Codes, quality: int) -> Codes:
    """Codes (h, w, 3) as JPEG shows them, 4:2:0."""
    ok, data = cv2.imencode(".jpg", code[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, quality])
    assert ok
    shown = cv2.imdecode(data, cv2.IMREAD_COLOR)
    assert shown is not None
    return np.ascontiguousarray(shown[..., ::-1], np.uint8)


def as_h264(code: Codes, qp: int) -> Codes:
    """Codes (h, w, 3), h and w even, as an intra frame of H.264 shows them, 4:2:0."""
    h, w = code.shape[:2]
    full = code.reshape(-1, 3).astype(np.float32) @ YCBCR_OF_RGB.T + YCBCR_OF_BLACK
    y, cb, cr = np.rint(full).clip(0, 255).T.reshape(3, h, w)
    halves = [cv2.resize(c, (w // 2, h // 2), interpolation=cv2.INTER_AREA) for c in (cb, cr)]
    planes = [np.rint(c).reshape(-1, w) for c in (y, *halves)]
    stream = io.BytesIO()
    with av.open(stream, "w", format="matroska") as out:
        options = {"qp": str(qp), "preset": "veryfast", "threads": "1"}
        video = out.add_stream("libx264", rate=24, options=options)
        video.height, video.width, video.pix_fmt = h, w, "yuv420p"
        frame = av.VideoFrame.from_ndarray(np.concatenate(planes).astype(np.uint8), "yuv420p")
        out.mux(video.encode(frame))
        out.mux(video.encode(None))
    stream.seek(0)
    with av.open(stream, "r") as coded:
        shown = next(coded.decode(video=0)).to_ndarray().astype(np.float32)
    halves = [c.reshape(h // 2, w // 2) for c in np.split(shown[h:].ravel(), 2)]
    chroma = [cv2.resize(c, (w, h), interpolation=cv2.INTER_LINEAR) for c in halves]
    ycbcr = np.dstack([shown[:h], *chroma]) - YCBCR_OF_BLACK
    rgb = ycbcr.reshape(-1, 3) @ np.linalg.inv(YCBCR_OF_RGB).T
    return np.asarray(np.rint(rgb).clip(0, 255).reshape(h, w, 3), np.uint8)


def sample(scene: Float, size: tuple[int, int], rng: np.random.Generator) -> tuple[Codes, Float]:
    """(codes uint8 (h, w, 3), true linear RGB float32 (h, w, 3)) of a random window of a scene."""
    truth = expose(window(scene, size, rng), rng)
    if rng.random() < 0.15:
        truth = title(truth, rng)
    if rng.random() < 0.05:  # letterbox
        bar = int(rng.uniform(0.05, 0.14) * size[1])
        truth[:bar] = truth[-bar:] = 0
    recorded, truth = graded(truth, rng)
    return shoot(recorded, rng), truth
