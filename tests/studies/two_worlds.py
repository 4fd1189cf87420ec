"""The default against SDR as it is, on clipped cameras, phones' pairs and HDR films mapped down.

    python tests/studies/two_worlds.py DATA WORK [--jod]

DATA is ../shared/data: panoramas (those that the fit left out), gainmap_photos, hdr_video_graded.
Single pictures at most 480 pixels wide, without tracking; each is also coded as JPEG of quality 25
and as H.264 at QP 37. Prints PQ-PSNR against SDR (1000 nits, white 203), the error of u'v' where
the truth is above white, the worst picture, and with --jod ColorVideoVDP's JOD (needs pycvvdp).
Real pairs come from ../shared/tools/real_pairs.py, run into WORK/pairs beforehand; films are
skipped where there are none in WORK/graded (.npz with `codes` and `truth`).
"""

from __future__ import annotations

import argparse
import io
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np

from itmo_video import expand, make_settings
from itmo_video.output.exr import read_exr

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "docs/auto"))
from scenes import as_jpeg, read_hdr, scene_paths, srgb_encode

PEAK, WEIGHTS = 1000 / 203, np.array([0.2126, 0.7152, 0.0722])
Pair = tuple[str, Any, Any]  # name, codes uint8 (h, w, 3), truth, 1.0 at SDR white


def linear(codes: Any) -> Any:
    """Linear RGB of sRGB codes."""
    code = codes / 255.0
    return np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4)


def cameras(data: Path, percentile: float) -> Iterator[Pair]:
    """What a camera clips at a percentile, of scenes that the fit left out."""
    for path in scene_paths(data)[1]:
        scene = read_hdr(path)
        height, width = scene.shape[:2]
        y, x = int(0.45 * (height - 270)), int(0.3 * (width - 480))
        truth = scene[y : y + 270, x : x + 480]
        truth = truth / max(float(np.percentile(truth @ WEIGHTS, percentile)), 1e-6)
        yield path.stem, np.rint(255 * srgb_encode(np.clip(truth, 0, 1))).astype(np.uint8), truth


def pairs(work: Path) -> Iterator[Pair]:
    """Phones' photographs with their own HDR renditions."""
    for folder in sorted((work / "pairs").glob("*")):
        bgr = cv2.imread(str(folder / "sdr.png"))
        assert bgr is not None, folder
        codes = bgr[..., ::-1]
        channels = read_exr(folder / "truth/frame.0001.exr").channels
        truth = np.dstack([channels[c].astype(np.float32) for c in "RGB"])
        share = 480 / max(codes.shape)
        size = round(codes.shape[1] * share), round(codes.shape[0] * share)
        yield (
            folder.name,
            cv2.resize(codes, size, interpolation=cv2.INTER_AREA),
            cv2.resize(truth, size, interpolation=cv2.INTER_AREA),
        )


def films(work: Path) -> Iterator[Pair]:
    """HDR films mapped down, as WORK/graded has them."""
    for path in sorted((work / "graded").glob("*.npz")):
        with np.load(path) as held:
            yield path.stem, held["codes"][0], held["truth"][0].astype(np.float32)


def pq(nits: Any) -> Any:
    """ST 2084's code."""
    y = (np.maximum(nits, 5e-3) / 10000) ** 0.1593017578125
    return ((0.8359375 + 18.8515625 * y) / (1 + 18.6875 * y)) ** 78.84375


def psnr_db(test: Any, truth: Any) -> float:
    """PQ-PSNR of luminance."""
    a, b = (pq(203 * np.clip(x, 0, PEAK) @ WEIGHTS) for x in (test, truth))
    return float(-10 * np.log10(np.mean((a - b) ** 2) + 1e-12))


def colour_error(test: Any, truth: Any) -> float:
    """Mean distance in u'v' where the truth is above white; NaN where that is nowhere."""
    matrix = np.array(
        [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
    )
    places = []
    for picture in (test, truth):
        x, y, z = np.moveaxis(np.maximum(picture, 0) @ matrix.T, -1, 0)
        places.append(np.stack([4 * x, 9 * y]) / (x + 15 * y + 3 * z + 1e-9))
    above = truth.max(-1) > 1.02
    return float(np.hypot(*(places[0] - places[1]))[above].mean()) if above.any() else np.nan


def as_video(codes: Any) -> Any:
    """The picture as the last of four in H.264 at a quantizer of 37, 4:2:0; of even size."""
    height, width = (side // 2 * 2 for side in codes.shape[:2])
    file = io.BytesIO()
    with av.open(file, "w", format="matroska") as out:
        stream = out.add_stream("libx264", rate=24, options={"qp": "37"})
        stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
        rgb = np.ascontiguousarray(codes[:height, :width])
        for pts in range(4):
            frame = av.VideoFrame.from_ndarray(rgb, "rgb24")
            frame = frame.reformat(format="yuv420p", dst_colorspace="ITU709")
            frame.pts = pts
            out.mux(stream.encode(frame))
        out.mux(stream.encode(None))
    file.seek(0)
    with av.open(file, "r") as read:
        *_, last = read.decode(video=0)
        return last.reformat(format="rgb24", src_colorspace="ITU709").to_ndarray()


def degraded(codes: Any) -> Any:
    """The picture as JPEG of quality 25."""
    return as_jpeg(codes, 25)


def still_jod() -> Callable[[Any, Any], float]:
    """ColorVideoVDP of single pictures on the same display; with the extra of docs/quality.md."""
    import pycvvdp
    import torch

    def jod(test: Any, truth: Any) -> float:
        height, width = truth.shape[:2]
        metric = pycvvdp.cvvdp(
            display_photometry=pycvvdp.vvdp_display_photo_eotf(
                Y_peak=1000, contrast=1e6, EOTF="linear", E_ambient=5
            ),
            display_geometry=pycvvdp.vvdp_display_geometry([width, height], ppd=45),
            device=torch.device("cpu"),
        )
        sides = [np.clip(203 * x, 5e-3, 1000).astype(np.float32) for x in (test, truth)]
        return float(metric.predict(*sides, dim_order="HWC")[0])

    return jod


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path)
    parser.add_argument("work", type=Path)
    parser.add_argument("--jod", action="store_true")
    args = parser.parse_args()
    jod = still_jod() if args.jod else None
    settings = make_settings(transfer="srgb")
    worlds: dict[str, Callable[[], Iterator[Pair]]] = {
        "cameras, white at 94": lambda: cameras(args.data, 94),
        "cameras, white at 99": lambda: cameras(args.data, 99),
        "phones": lambda: pairs(args.work),
        "films mapped down": lambda: films(args.work),
    }
    print(
        "| world | n | SDR dB | gain | worst | JPEG: gain | worst | H.264: gain | worst |", end=""
    )
    print(" u'v' SDR | u'v' |\n" + "|---" * 11 + "|")
    for world, made in worlds.items():
        rows = []
        for name, codes, truth in made():
            row: list[Any] = [name, psnr_db(linear(codes), truth)]
            for given in (codes, degraded(codes), as_video(codes)):
                light, want = linear(given), truth[: given.shape[0], : given.shape[1]]
                got = expand(given, settings).rgb.astype(np.float32)
                row.append(psnr_db(got, want) - psnr_db(light, want))
            got = expand(codes, settings).rgb.astype(np.float32)
            row += [colour_error(linear(codes), truth), colour_error(got, truth)]
            if jod:
                row.append(jod(got, truth) - jod(linear(codes), truth))
            rows.append(row)
        if not rows:
            continue
        at = [np.array([row[i] for row in rows]) for i in range(1, len(rows[0]))]
        line = f"| {world} | {len(rows)} | {at[0].mean():.1f} "
        for gains in at[1:4]:
            line += f"| {gains.mean():+.2f} | {gains.min():+.2f} ({rows[int(gains.argmin())][0]}) "
        line += f"| {np.nanmean(at[4]):.4f} | {np.nanmean(at[5]):.4f} |"
        print(line + (f" JOD {at[6].mean():+.2f}, {at[6].min():+.2f}" if jod else ""), flush=True)


if __name__ == "__main__":
    main()
