"""Libraries that read stills, compared kind by kind: what is right, what is wrong without a word.

    python tests/studies/still_libraries.py

Needs OpenImageIO, Pillow, pillow-heif, imagecodecs, tifffile and av in one environment. Every file
is made here, or is one of ../shared's field reports. The table is that of docs/files_measured.md.
"""

from __future__ import annotations

import io
import random
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import av
import imagecodecs
import numpy as np
import OpenImageIO
import pillow_heif
import tifffile
from av.video.codeccontext import VideoCodecContext
from PIL import Image

warnings.simplefilter("ignore")
av.logging.set_level(None)
pillow_heif.register_heif_opener()
REPORTS = Path(__file__).resolve().parents[3] / "shared/data/field_reports"
SCRATCH = Path("/dev/shm")
Decode = Callable[[bytes, str], np.ndarray]


def by_oiio(data: bytes, ext: str) -> np.ndarray:
    path = SCRATCH / f"still.{ext}"
    path.write_bytes(data)
    config = OpenImageIO.ImageSpec()
    config.attribute("oiio:UnassociatedAlpha", 1)
    reader = OpenImageIO.ImageInput.open(str(path), config)
    if reader is None:
        raise ValueError(OpenImageIO.geterror())
    spec = reader.spec()
    pixels = reader.read_image(0, 0, 0, spec.nchannels, spec.format)
    if pixels is None or reader.geterror():
        raise ValueError("not whole")
    return np.asarray(pixels)


def by_pillow(data: bytes, ext: str) -> np.ndarray:
    with Image.open(io.BytesIO(data)) as image:
        frames = getattr(image, "n_frames", 1)
        if ext in ("gif", "webp", "avif", "apng") and frames > 1:
            found = []
            for n in range(frames):
                image.seek(n)
                found.append(np.asarray(image.convert("RGB")))
            return np.stack(found)
        return np.asarray(image)


def by_imagecodecs(data: bytes, ext: str) -> np.ndarray:
    if ext == "tif":
        return np.asarray(tifffile.imread(io.BytesIO(data)))
    names = {"jpg": "jpeg8", "jp2": "jpeg2k", "heic": "heif"}
    return np.asarray(getattr(imagecodecs, f"{names.get(ext, ext)}_decode")(data))


def by_ffmpeg(data: bytes, ext: str) -> np.ndarray:
    if ext in ("avif", "heic", "gif", "apng"):
        with av.open(io.BytesIO(data), "r") as box:
            shown = [f.to_ndarray(format="rgb24") for f in box.decode(video=0)]
        return np.stack(shown) if len(shown) > 1 else shown[0]
    codec = {"jpg": "mjpeg", "tif": "tiff", "jp2": "jpeg2000"}.get(ext, ext)
    context = av.CodecContext.create(codec, "r")
    assert isinstance(context, VideoCodecContext)
    frames = context.decode(av.Packet(data)) or context.decode(None)
    form = "rgb48le" if "16" in frames[0].format.name or "48" in frames[0].format.name else "rgb24"
    return frames[0].to_ndarray(format=form)


LIBRARIES: dict[str, Decode] = {
    "OpenImageIO": by_oiio, "Pillow + pillow-heif": by_pillow,
    "imagecodecs + tifffile": by_imagecodecs, "FFmpeg (PyAV)": by_ffmpeg,
}  # fmt: skip


def picture(dtype: type = np.uint8, channels: int = 3) -> np.ndarray:
    y, x = np.mgrid[:96, :128]
    waves = [0.5 + 0.4 * np.sin(x / (7 + i) + y / 9) for i in range(channels)]
    top = np.iinfo(dtype).max if np.issubdtype(dtype, np.integer) else 1
    return (np.dstack(waves) * top).astype(dtype)


def tiff(image: np.ndarray, **options: Any) -> bytes:
    data = io.BytesIO()
    tifffile.imwrite(data, image, photometric="rgb", **options)
    return data.getvalue()


def pillow(image: np.ndarray, form: str, **options: object) -> bytes:
    data = io.BytesIO()
    Image.fromarray(image).save(data, form, **options)
    return data.getvalue()


def png16() -> bytes:
    return bytes(imagecodecs.png_encode(picture(np.uint16)))


def kinds() -> dict[str, tuple[bytes, str, np.ndarray | tuple[int, ...]]]:
    """Name: file, kind, and the right pixels or their shape."""
    eight, deep, light = picture(), picture(np.uint16), picture(np.float32)
    moved = [Image.fromarray(np.roll(eight, 9 * n, 1)) for n in range(5)]

    def animation(form: str, **options: object) -> bytes:
        data = io.BytesIO()
        moved[0].save(data, form, save_all=True, append_images=moved[1:], duration=40, **options)
        return data.getvalue()

    found: dict[str, tuple[bytes, str, np.ndarray | tuple[int, ...]]] = {
        "TIFF, strips, 8 bits": (tiff(eight), "tif", eight),
        "TIFF, tiles, 8 bits": (tiff(eight, tile=(32, 32)), "tif", eight),
        "TIFF, tiles, 16 bits, deflate": (
            tiff(deep, tile=(32, 32), compression="zlib", predictor=True), "tif", deep),
        "TIFF, planar, tiles": (tiff(np.moveaxis(eight, -1, 0), planarconfig="separate",
                                     tile=(32, 32)), "tif", eight),
        "TIFF, LZW": (pillow(eight, "TIFF", compression="tiff_lzw"), "tif", eight),
        "TIFF, JPEG": (pillow(eight, "TIFF", compression="jpeg"), "tif", eight),
        "TIFF, float": (tiff(light), "tif", light),
        "BigTIFF": (tiff(eight, bigtiff=True), "tif", eight),
        "PNG, 16 bits": (png16(), "png", deep),
        "JPEG": (pillow(eight, "JPEG", quality=95, subsampling=0), "jpg", eight),
        "JPEG 2000": (pillow(eight, "JPEG2000"), "jp2", eight),
        "WebP, lossless": (pillow(eight, "WEBP", lossless=True), "webp", eight),
        "WebP, animated": (animation("WEBP", lossless=True), "webp", (5, 96, 128, 3)),
        "GIF, animated": (animation("GIF"), "gif", (5, 96, 128, 3)),
        "APNG": (animation("PNG"), "apng", (5, 96, 128, 3)),
        "AVIF": (pillow(eight, "AVIF", quality=100, subsampling="4:4:4"), "avif", eight),
        "AVIF, animated": (animation("AVIF"), "avif", (5, 96, 128, 3)),
        "HEIC": (pillow(eight, "HEIF", quality=100, chroma=444), "heic", eight),
    }  # fmt: skip
    if REPORTS.exists():
        grid = (REPORTS / "01_heif_grid/arrow.heic").read_bytes()
        avif = (REPORTS / "01_heif_grid/sofa_grid1x5_420.avif").read_bytes()
        alpha = (REPORTS / "03_heif_alpha_animation/avif_transparency.avif").read_bytes()
        found |= {
            "HEIC, a phone's grid": (grid, "heic", (4032, 3024, 3)),
            "AVIF, grid": (avif, "avif", (770, 1024, 3)),
            "AVIF, alpha": (alpha, "avif", (64, 64, 4)),
        }
    return found


def verdict(decode: Decode, data: bytes, ext: str, want: np.ndarray | tuple[int, ...]) -> str:
    """right, 8 bits, no (an error), or WRONG: another picture without a word; and milliseconds."""
    try:
        began = time.perf_counter()
        got = decode(data, ext)
        took = (time.perf_counter() - began) * 1e3
    except Exception:
        return "no"
    if isinstance(want, tuple):
        if got.shape[: len(want) - 1] != want[:-1] or got.shape[-1] < want[-1]:
            return f"WRONG {'x'.join(map(str, got.shape))}"
        return f"right {took:.0f} ms"
    if got.shape != want.shape:
        return f"WRONG {'x'.join(map(str, got.shape))}"
    scale = np.iinfo(want.dtype).max if want.dtype.kind == "u" else 1
    of = np.iinfo(got.dtype).max if got.dtype.kind == "u" else 1
    off = np.abs(got.astype(np.float64) / of - want.astype(np.float64) / scale).max()
    if off > 0.06:
        return "WRONG pixels"
    return (
        f"8 bits {took:.0f} ms"
        if got.dtype.itemsize < want.dtype.itemsize
        else f"right {took:.0f} ms"
    )


def cut_and_rotten(decode: Decode, data: bytes, ext: str) -> str:
    """Of 39 cut and 60 partly overwritten files, how many give another picture without an error."""
    try:
        whole = decode(data, ext).astype(int)
    except Exception:
        return "-"

    def passes(mutant: bytes) -> bool:
        try:
            got = decode(mutant, ext)
        except Exception:
            return False
        return got.shape != whole.shape or bool(np.abs(got.astype(int) - whole).max() > 40)

    cut = sum(passes(data[: len(data) * k // 40]) for k in range(1, 40))
    rng, rotten = random.Random(1), 0
    for _ in range(60):
        mutant = bytearray(data)
        at = rng.randrange(len(data))
        mutant[at : at + 60] = rng.randbytes(min(60, len(data) - at))
        rotten += passes(bytes(mutant))
    return f"{cut}/39, {rotten}/60"


def main() -> None:
    """Print both tables."""
    print("| kind |", " | ".join(LIBRARIES), "|\n|---" * 1 + "|---" * len(LIBRARIES) + "|")
    for name, (data, ext, want) in kinds().items():
        row = [verdict(decode, data, ext, want) for decode in LIBRARIES.values()]
        print(f"| {name} |", " | ".join(row), "|", flush=True)
    print("\nwrong pictures without an error, of 39 cut files and 60 partly overwritten ones")
    image = picture()
    image = np.clip(image + np.random.default_rng(0).normal(0, 6, image.shape), 0, 255)
    image = image.astype(np.uint8)
    files = {
        "JPEG": (pillow(image, "JPEG", quality=90), "jpg"),
        "JPEG, progressive": (pillow(image, "JPEG", progressive=True), "jpg"),
        "PNG": (pillow(image, "PNG"), "png"),
        "TIFF, LZW": (pillow(image, "TIFF", compression="tiff_lzw"), "tif"),
        "TIFF, deflate": (pillow(image, "TIFF", compression="tiff_adobe_deflate"), "tif"),
        "WebP": (pillow(image, "WEBP"), "webp"), "JPEG 2000": (pillow(image, "JPEG2000"), "jp2"),
        "AVIF": (pillow(image, "AVIF"), "avif"), "HEIC": (pillow(image, "HEIF"), "heic"),
    }  # fmt: skip
    for name, (data, ext) in files.items():
        row = [cut_and_rotten(decode, data, ext) for decode in LIBRARIES.values()]
        print(f"| {name} |", " | ".join(row), "|", flush=True)


if __name__ == "__main__":
    main()
