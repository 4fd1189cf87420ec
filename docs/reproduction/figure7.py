"""Figure 7 with panned panoramas: naive, eq. 11 without the map, and the map per frame and tracked.

python docs/reproduction/figure7.py DATA makes clips with known truth as pan_clip.py does, converts
them with the product, prints the table of docs/reproduction.md and makes images/figure7.png.
"""

from __future__ import annotations

import tempfile
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
from common import (
    HIGHLIGHTS,
    data_folder,
    false_colour,
    labelled,
    luminance,
    read_hdr,
    save,
    srgb_codes,
)

from itmo_video import RunOptions, convert, make_settings, read_exr
from itmo_video.colour.transfer import pq_code
from itmo_video.evaluation import fidelity

WIDTH, HEIGHT, FRAMES = 480, 270, 12
L_MAX = (4.93, 20.0)
PICTURED = "lobby"
COLUMNS: dict[str, dict[str, Any]] = {
    "naive": {"preset": "paper", "operator": "landis2002", "expand_map": False},
    "eq. 11, no map": {"preset": "paper", "expand_map": False},
    "paper's map, per frame": {"preset": "paper", "temporal": "per-frame"},
    "paper's map, tracked": {"preset": "paper"},
    "highlights": {"preset": HIGHLIGHTS},
}


def make_clip(panorama: Any, path: Path) -> tuple[list[Any], list[tuple[float, float]]]:
    """Write the SDR clip (H.264); return the truth, 1.0 = white, and the windows' origins."""
    rng = np.random.default_rng(0)
    t = np.arange(FRAMES)
    x = 0.3 * (panorama.shape[1] - WIDTH) + np.cumsum(3 * np.sin(2 * np.pi * t / 31 + 0.5))
    y = 0.45 * (panorama.shape[0] - HEIGHT) + np.cumsum(0.6 * np.sin(2 * np.pi * t / 24))
    at = list(zip(x.tolist(), y.tolist(), strict=True))
    windows = [moved(panorama, *origin) for origin in at]
    white = max(float(np.percentile(luminance(np.stack(windows[::4])), 94)), 1e-6)
    truth = [np.maximum(w, 0) / np.float32(white) for w in windows]
    with av.open(str(path), "w") as box:
        stream = box.add_stream("libx264", rate=Fraction(24), options={"crf": "16"})
        context = stream.codec_context
        context.color_primaries, context.color_trc = 1, 13
        context.colorspace, context.color_range = 1, 1
        stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "yuv420p"
        for i, picture in enumerate(truth):
            grain = rng.normal(0, 0.004, picture.shape) * np.sqrt(np.clip(picture, 0, 1) + 0.02)
            frame = av.VideoFrame.from_ndarray(srgb_codes(picture + grain), "rgb24")
            frame = frame.reformat(
                format="yuv420p", dst_colorspace="ITU709", dst_color_range="MPEG"
            )
            frame.pts = i
            box.mux(stream.encode(frame))
        box.mux(stream.encode())
    return truth, at


def moved(picture: Any, dx: float, dy: float) -> Any:
    """A window of the picture, from (dx, dy) on; panoramas go around."""
    u, v = np.meshgrid(np.arange(WIDTH, dtype=np.float32), np.arange(HEIGHT, dtype=np.float32))
    return cv2.remap(
        picture, u + np.float32(dx), v + np.float32(dy), cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_WRAP,
    )  # fmt: skip


def flicker(gains: list[Any], at: list[tuple[float, float]]) -> float:
    """Mean absolute change of gain, in stops, from frame to frame along the true motion."""
    changes = []
    for (before, after), (a, b) in zip(pairwise(gains), pairwise(at), strict=True):
        followed = moved(np.log2(after), a[0] - b[0], a[1] - b[1])
        changes.append(np.abs(followed - np.log2(before))[12:-12, 12:-12].mean())
    return float(np.mean(changes))


def main() -> None:
    """Print the tables and make the picture."""
    folder = data_folder(__doc__ or "") / "panoramas"
    paths = sorted(p for p in folder.glob("*") if p.suffix in (".exr", ".hdr"))
    for l_max in L_MAX:
        # By column: shares visible and obvious of every frame, PQ-PSNR, flicker of every scene.
        frames: dict[str, list[tuple[float, float, float]]] = {}
        moving: dict[str, list[float]] = {}
        for path in paths:
            with tempfile.TemporaryDirectory() as scratch:
                _one(path, Path(scratch), l_max, frames, moving)
        print(f"\nL'max {l_max:g}, {len(paths)} panoramas of {FRAMES} frames\n")
        print("| | visible, mean % | variance | obvious, mean % | variance | PQ-PSNR dB "
              "| flicker, stops |\n|---|---|---|---|---|---|---|")  # fmt: skip
        for name, rows in frames.items():
            table = np.array(rows)
            mean, var = table.mean(axis=0), (100 * table).var(axis=0)
            print(
                f"| {name} | {100 * mean[0]:.1f} | {var[0]:.0f} | {100 * mean[1]:.1f} "
                f"| {var[1]:.0f} | {mean[2]:.2f} | {np.mean(moving.get(name, [0.0])):.4f} |"
            )


def _one(
    path: Path,
    scratch: Path,
    l_max: float,
    frames: dict[str, list[tuple[float, float, float]]],
    moving: dict[str, list[float]],
) -> None:
    clip = scratch / "sdr.mkv"
    truth, at = make_clip(read_hdr(path), clip)
    shown = [fidelity.displayed(t, peak_nits=203 * l_max) for t in truth]
    pictures = []
    for name, overrides in ({"SDR as it is": None} | COLUMNS).items():
        folder = scratch / name.replace(" ", "_")
        settings = make_settings(**(overrides or {"operator": "linear"}),
                                 l_max=1.0 if overrides is None else l_max,
                                 layers=("gain",))  # fmt: skip
        convert(clip, folder, settings, RunOptions())
        out = [read_exr(p).channels for p in sorted(folder.glob("*.exr"))]
        test = [
            fidelity.displayed(np.dstack([c[k] for k in "RGB"]), peak_nits=203 * l_max) for c in out
        ]
        for a, b in zip(test, shown, strict=True):
            frames.setdefault(name, []).append(
                (
                    fidelity.visible_share(a, b),
                    fidelity.visible_share(a, b, fidelity.OBVIOUS),
                    fidelity.pq_psnr_db(a, b),
                )
            )
        gains = [np.maximum(c["gain.Y"].astype(np.float32), 1e-3) for c in out]
        moving.setdefault(name, []).append(flicker(gains, at))
        if path.stem == PICTURED and l_max == L_MAX[0]:
            pictures.append(_row(name, test, shown))
    if pictures:
        first = [labelled(false_colour(s / 203, -8, 3), "truth, stops") for s in shown[::5]]
        save("figure7.png", [np.vstack([np.hstack(first), *pictures])], 720)


def _row(name: str, test: list[Any], shown: list[Any]) -> Any:
    """Difference of PQ code, 0 to 0.15, of three frames."""
    row = []
    for a, b in list(zip(test, shown, strict=True))[::5]:
        difference = np.abs(pq_code(a) - pq_code(b))
        grey = (np.clip(difference / 0.15, 0, 1) * 255).astype(np.uint8)
        row.append(labelled(cv2.applyColorMap(grey, cv2.COLORMAP_INFERNO), name))
    return np.hstack(row)


if __name__ == "__main__":
    main()
