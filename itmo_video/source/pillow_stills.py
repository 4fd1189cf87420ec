"""Stills and animations read by Pillow (WebP, GIF, APNG, AVIF, QOI, CMYK) and pillow-heif (HEIC).

The only module that imports them, and only inside functions. Pillow's readers are created
directly, as the pixel limit of `Image.open` is global to the process.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from itmo_video.errors import DamagedInputError, InputError
from itmo_video.source.files import check_pixels
from itmo_video.source.gif_canvas import on_clear_canvas
from itmo_video.source.still_formats import StillFormat
from itmo_video.source.still_picture import StillColour, StillPicture, exif_turn, split, straight

# Anything that a library raises for a file means that the file is at fault.
_FAULTS = (
    OSError, SyntaxError, ValueError, TypeError, KeyError, IndexError, EOFError, RuntimeError,
    OverflowError, ZeroDivisionError, AttributeError, MemoryError, AssertionError,
)  # fmt: skip


_NOT_DECODED = (0, 136, 0)  # Y'CbCr 0, 0, 0, a green that no encoder produces
_MOST_NOT_DECODED = 2000  # pixels; HEVC's blocks have up to 4096


@contextmanager
def opened(data: bytes, kind: StillFormat, max_pixels: int, where: str) -> Iterator[Any]:
    """A Pillow image of a file's bytes, not yet decoded; its size is within the limit."""
    from PIL import (
        AvifImagePlugin,
        GifImagePlugin,
        Image,
        JpegImagePlugin,
        PngImagePlugin,
        QoiImagePlugin,
        TiffImagePlugin,
        WebPImagePlugin,
    )

    readers: dict[str, Any] = {
        "avif": AvifImagePlugin.AvifImageFile,
        "gif": GifImagePlugin.GifImageFile,
        "apng": PngImagePlugin.PngImageFile,
        "webp": WebPImagePlugin.WebPImageFile,
        "qoi": QoiImagePlugin.QoiImageFile,
        "jpeg": JpegImagePlugin.JpegImageFile,
        "tiff": TiffImagePlugin.TiffImageFile,
    }
    with decoding(where, (Image.DecompressionBombError,)):
        image = readers[kind](io.BytesIO(data))
    try:
        check_pixels(image.width, image.height, max_pixels, where)
        with decoding(where, (Image.DecompressionBombError,)):
            yield image
    finally:
        image.close()


@contextmanager
def decoding(where: str, also: tuple[type[BaseException], ...] = ()) -> Iterator[None]:
    """Convert errors of a library into DamagedInputError."""
    faults: tuple[type[BaseException], ...] = (*_FAULTS, *also)
    try:
        yield
    except faults as error:
        told = str(error).splitlines()
        reason = f" ({told[0]})" if told and told[0] else ""
        raise DamagedInputError(f"cannot be decoded{reason}", where=where) from error


def read_still(data: bytes, kind: StillFormat, max_pixels: int, where: str) -> StillPicture:
    """Decode a still or an animation's first frame; DamagedInputError if it is incomplete."""
    if kind == "heif":
        return _heif(data, max_pixels, where)
    data, before = on_clear_canvas(data) if kind == "gif" else (data, 0)
    with opened(data, kind, max_pixels, where) as image:
        image.seek(before)
        return picture(image, kind)


def picture(image: Any, kind: StillFormat) -> StillPicture:
    """A Pillow image's current frame as 8-bit planes, or a 16-bit one for grey."""
    has_alpha = image.mode in ("LA", "PA", "RGBA", "RGBa", "La") or "transparency" in image.info
    if image.mode.startswith("I;16"):
        pixels, bits, colours = np.asarray(image).astype(np.uint16), 16, 1
    else:
        grey = image.mode in ("L", "LA", "1") and "transparency" not in image.info
        mode = ("LA" if has_alpha else "L") if grey else ("RGBA" if has_alpha else "RGB")
        pixels, bits, colours = np.asarray(image.convert(mode)), 8, 1 if grey else 3
    planes = split(pixels)
    return StillPicture(
        codec=kind,
        form=f"{'grey' if colours == 1 else 'rgb'}{'a' * has_alpha}{bits}",
        family="grey" if colours == 1 else "rgb",
        bit_depth=bits,
        planes=planes,
        has_alpha=has_alpha,
        turn=exif_turn(image.getexif().get(0x0112)),
        colour=StillColour(icc=image.info.get("icc_profile")),
    )


def dispose_to_clear(image: Any) -> None:
    """Make a GIF's removed frames leave a transparent canvas, not the background colour."""
    from PIL import Image

    if image.disposal_method == 2 and image.mode == "RGBA" and image.dispose is not None:
        image.dispose = Image.new("RGBA", image.dispose.size, 0).im


def _heif(data: bytes, max_pixels: int, where: str) -> StillPicture:
    import pillow_heif

    with decoding(where):
        file = pillow_heif.open_heif(
            io.BytesIO(data), convert_hdr_to_8bit=False, hdr_to_16bit=False
        )
        image: Any = file[file.primary_index]
        width, height = image.size
    check_pixels(width, height, max_pixels, where)
    with decoding(where):
        mode, _, depth = image.mode.partition(";")
        bits = int(depth or 8)
        pixels = np.asarray(image)
    if bits == 8 and mode.startswith("RGB"):
        _check_decoded(pixels, where)
    has_alpha = mode.endswith(("A", "a"))
    colours = 3 if mode.startswith(("RGB", "BGR")) else 1
    planes = split(pixels)
    if has_alpha and (image.premultiplied_alpha or mode.endswith("a")):
        planes, bits = straight(planes, bits), 16
    nclx: dict[str, Any] = image.info.get("nclx_profile") or {}
    numbers = ("color_primaries", "transfer_characteristics", "matrix_coefficients")
    cicp = tuple(int(nclx[name]) for name in numbers) if nclx else None
    return StillPicture(
        codec="heif",
        form=f"{'rgb' if colours == 3 else 'grey'}{'a' * has_alpha}{bits}",
        family="rgb" if colours == 3 else "grey",
        bit_depth=bits,
        planes=planes,
        has_alpha=has_alpha,
        colour=StillColour(
            icc=image.info.get("icc_profile"),
            cicp=None if cicp is None else (cicp[0], cicp[1], cicp[2], 1),
        ),
    )


def _check_decoded(pixels: Any, where: str) -> None:
    """Raise DamagedInputError if blocks failed to decode, whose codes libheif leaves at 0."""
    empty = np.all(pixels[..., :3] == _NOT_DECODED, axis=-1)
    if np.count_nonzero(empty) > _MOST_NOT_DECODED:
        raise DamagedInputError("parts of the picture cannot be decoded", where=where)


def read_inks(data: bytes, kind: StillFormat, max_pixels: int, where: str) -> tuple[Any, bytes]:
    """An 8-bit CMYK picture as a Pillow image, and its profile; InputError without one."""
    if kind not in ("jpeg", "tiff"):
        raise InputError(
            f"colours are CMYK, which is not supported in {kind.upper()}",
            where=where,
            remedy="Convert it to RGB in the program that created it.",
        )
    with opened(data, kind, max_pixels, where) as image:
        image.load()
        profile = image.info.get("icc_profile")
        if image.mode != "CMYK" or not profile:
            raise InputError(
                "colours are CMYK, and there is no ICC profile to convert them with",
                where=where,
                remedy="Convert it to RGB in the program that created it.",
            )
        return image.copy(), bytes(profile)
