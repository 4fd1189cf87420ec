"""Figure 8: a scene lit by the true light probe, by the SDR, by naive and by ours.

python docs/reproduction/figure8.py DATA (needs the extra `ibl`) prints the table of
docs/reproduction.md and makes images/figure8.png. Probes are at their exposures of table 2. The
second table asks whether L'max or the map is at fault, over the panoramas that `auto` was not
fitted to, in smaller renders; it is left out where DATA has no panoramas_more.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from common import (
    HERE,
    HIGHLIGHTS,
    converted,
    data_folder,
    false_colour,
    labelled,
    linear,
    luminance,
    read_hdr,
    save,
)
from common import srgb_codes as codes_of
from table2 import WIDEST, scenes

from itmo_video.evaluation import ibl
from itmo_video.evaluation.ibl import compare_lit, render_lit

PROBES = ("grace_latlong", "KernerEnvLatLong", "sunset", "night", "lobby", "park")
L_MAX = (4.93, 20.0)
PICTURED = "KernerEnvLatLong"
NAIVE = {"preset": "paper", "operator": "landis2002", "expand_map": False}
SIZE = (512, 256)
SMALL = (120, 90, 32)  # width, height, samples of the second table's renders
SWEPT = (4.93, 20.0)
LATLONG = {"projection": "latlong"}
SWEEP: dict[str, dict[str, Any]] = {
    "naive": NAIVE,
    "paper": {"preset": "paper", **LATLONG},
    "paper, flat map": {"preset": "paper"},
    "highlights": {"preset": HIGHLIGHTS, **LATLONG},
    "ibl": {"preset": "ibl", **LATLONG},
}
Errors = dict[str, list[tuple[float, float]]]


def probe(rgb: Any) -> Any:
    """A panorama at the size that it is lit with; area-averaged, so that light is kept."""
    return cv2.resize(np.ascontiguousarray(rgb, np.float32), SIZE, interpolation=cv2.INTER_AREA)


def main() -> None:
    """Print the tables and make the picture."""
    data = data_folder(__doc__ or "")
    methods: dict[str, dict[str, Any]] = {}
    for l_max in L_MAX:
        methods[f"naive {l_max:g}"] = NAIVE | {"l_max": l_max}
        for name, preset in (("paper", "paper"), ("highlights", HIGHLIGHTS)):
            methods[f"{name} {l_max:g}"] = {"preset": preset, "l_max": l_max, **LATLONG}
    print(
        "Error / error after exposure / shadow sharpness (stops a pixel) / shadow depth (stops)\n"
    )
    print("| probe | true | SDR | " + " | ".join(methods) + " |")
    print("|" + "---|" * (len(methods) + 3))
    errors: Errors = {}
    for name, truth, _ in scenes(data):
        if name in PROBES:
            _row(name, truth, methods, errors)
    means = [" / ".join(f"{v:.2f}" for v in np.mean(rows, axis=0)) for rows in errors.values()]
    print("| **mean error** | | " + " | ".join(means) + " |")
    if (data / "panoramas_more").is_dir():
        ibl.WIDTH, ibl.HEIGHT, ibl.SAMPLES = SMALL
        _sweep(list(_held_out(data)))


def _row(name: str, truth: Any, methods: dict[str, dict[str, Any]], errors: Errors) -> None:
    lit = render_lit(probe(truth))
    codes = codes_of(truth)
    pictures, cells, true_cell = [("true", lit)], [], ""
    for method, overrides in ({"SDR": None} | methods).items():
        light = linear(codes) if overrides is None else converted(codes, **overrides)[0]
        render = render_lit(probe(light))
        found = compare_lit(render, lit)
        errors.setdefault(method, []).append((found.error, found.exposed_error))
        cells.append(
            f"{found.error:.2f} / {found.exposed_error:.2f} / "
            f"{found.sharpness[0]:.2f} / {found.depth[0]:.1f}"
        )
        true_cell = f"{found.sharpness[1]:.2f} / {found.depth[1]:.1f}"
        pictures.append((method, render))
    print(f"| {name} | {true_cell} | " + " | ".join(cells) + " |", flush=True)
    if name == PICTURED:
        middle = float(np.log2(np.median(luminance(lit))))
        shown = [
            labelled(false_colour(luminance(render), middle - 5, middle + 5), method)
            for method, render in pictures
        ]
        save("figure8.png", [np.vstack([np.hstack(shown[:4]), np.hstack(shown[4:])])], 720)


def _held_out(data: Path) -> Iterator[Any]:
    """Panoramas that no weights were fitted to, white on the 94th percentile."""
    sys.path.append(str(HERE.parent / "auto"))
    from scenes import scene_paths as paths_by_use  # docs/auto/scenes.py

    for path in paths_by_use(data)[1]:
        truth = cv2.resize(read_hdr(path), (WIDEST, WIDEST // 2), interpolation=cv2.INTER_AREA)
        yield truth / np.float32(max(float(np.percentile(luminance(truth), 94)), 1e-6))


def _sweep(probes: list[Any]) -> None:
    """Print the errors of all probes by L'max, and what bounds them.

    Bounds: the truth itself where it is cut off at L'max, and the SDR with what clips (a channel
    at 1) multiplied by the one factor that gives its true mean, which no method knows.
    """
    found: dict[str, Errors] = {row: {} for row in ("1", "true mean", *(f"{x:g}" for x in SWEPT))}
    for truth in probes:
        lit = render_lit(probe(truth))
        codes = codes_of(truth)
        sdr = linear(codes)

        def judge(row: str, column: str, light: Any, lit: Any = lit) -> None:
            got = compare_lit(render_lit(probe(light)), lit)
            found[row].setdefault(column, []).append((got.error, got.exposed_error))

        judge("1", "SDR as it is", sdr)
        clipped = truth.max(axis=-1) >= 1
        area = np.broadcast_to(_row_weight(truth), clipped.shape)[clipped]
        true_mean, sdr_mean = (
            float(np.average(luminance(x)[clipped], weights=area)) for x in (truth, sdr)
        )
        factor = np.float32(true_mean / sdr_mean)
        judge(
            "true mean", "SDR, what clips * factor", np.where(clipped[..., None], sdr * factor, sdr)
        )
        for l_max in SWEPT:
            judge(f"{l_max:g}", "truth up to L'max", np.minimum(truth, l_max))
            for column, overrides in SWEEP.items():
                light = converted(codes, **overrides, l_max=l_max)[0]
                judge(f"{l_max:g}", column, light)
    plain = np.array(found["1"]["SDR as it is"])
    print(f"\nMean error / after one exposure (halved on how many of {len(probes)})\n")
    print("| L'max | row | error | halved | after exposure | halved |\n|---|---|---|---|---|---|")
    for row, columns in found.items():
        for column, values in columns.items():
            mean, halved = np.mean(values, axis=0), (np.array(values) <= plain / 2).sum(axis=0)
            print(
                f"| {row} | {column} | {mean[0]:.2f} | {halved[0]} | {mean[1]:.2f} | {halved[1]} |"
            )


def _row_weight(picture: Any) -> Any:
    height = picture.shape[0]
    return np.cos(((np.arange(height) + 0.5) / height - 0.5) * np.pi)[:, None]


if __name__ == "__main__":
    main()
