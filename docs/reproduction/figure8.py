"""Figure 8: a scene lit by the true light probe, by the SDR, by naive and by ours.

python docs/reproduction/figure8.py DATA (needs the extra `ibl`) prints the table of
docs/reproduction.md and makes images/figure8.png. Probes are at their exposures of table 2.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from common import converted, data_folder, false_colour, labelled, linear, luminance, save
from common import srgb_codes as codes_of
from table2 import scenes

from itmo_video.evaluation.ibl import compare_lit, render_lit

PROBES = ("grace_latlong", "KernerEnvLatLong", "sunset", "night", "lobby", "park")
L_MAX = (4.93, 20.0)
PICTURED = "KernerEnvLatLong"
NAIVE = {"preset": "paper", "operator": "landis2002", "expand_map": False}
SIZE = (512, 256)


def probe(rgb: Any) -> Any:
    """A panorama at the size that it is lit with; area-averaged, so that light is kept."""
    return cv2.resize(np.ascontiguousarray(rgb, np.float32), SIZE, interpolation=cv2.INTER_AREA)


def main() -> None:
    """Print the table and make the picture."""
    data = data_folder(__doc__ or "")
    methods: dict[str, dict[str, Any]] = {}
    for l_max in L_MAX:
        methods[f"naive {l_max:g}"] = NAIVE | {"l_max": l_max}
        for preset in ("paper", "default"):
            methods[f"{preset} {l_max:g}"] = {
                "preset": preset, "l_max": l_max, "projection": "latlong",
            }  # fmt: skip
    print(
        "Error / error after exposure / shadow sharpness (stops a pixel) / shadow depth (stops)\n"
    )
    print("| probe | true | SDR | " + " | ".join(methods) + " |")
    print("|" + "---|" * (len(methods) + 3))
    errors: dict[str, list[tuple[float, float]]] = {}
    for name, truth, _ in scenes(data):
        if name not in PROBES:
            continue
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
    means = [" / ".join(f"{v:.2f}" for v in np.mean(rows, axis=0)) for rows in errors.values()]
    print("| **mean error** | | " + " | ".join(means) + " |")


if __name__ == "__main__":
    main()
