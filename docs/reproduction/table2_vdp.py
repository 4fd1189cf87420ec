"""Table 2 by ColorVideoVDP: shares of pixels with a visible difference, and JOD as stills.

python docs/reproduction/table2_vdp.py DATA (needs the extra `vdp`) prints the tables of
docs/reproduction.md. The images and exposures are table 2's, half as wide.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from common import converted, data_folder, linear, srgb_codes
from table2 import COLUMNS, L_MAX, WHITE, scenes

from itmo_video.evaluation import fidelity, vdp
from itmo_video.evaluation.agreement import Display

WIDEST = 512  # at 45 pixels a degree 11 degrees; the metric takes a second for each picture so
# One JOD is where 75 % of people see which picture is worse; 95 % is 2.44 JOD, as a JOD is
# 0.6745 standard deviations. So these are the counterparts of the paper's P >= 0.75 and 0.95.
THRESHOLDS_JOD = (1.0, 1.6449 / 0.6745)
ROWS = {name: COLUMNS[name] for name in ("SDR as it is", "naive", "paper", "highlights")}


def judged(rgb: Any, truth: Any, l_max: float) -> tuple[float, ...]:
    """(own visible share, obvious share, the metric's two shares, JOD) on a display to L'max.

    The metric's share is of pixels whose local JOD, in its raw heat map, is that far below 10.
    """
    display = Display(WHITE * l_max, WHITE)
    test, reference = (vdp.on_display(np.asarray(x, np.float32), display) for x in (rgb, truth))
    height, width = truth.shape[:2]
    with vdp._metric((width, height), display, heat_map="raw") as metric:
        jod, stats = metric.predict(test, reference, dim_order="HWC")
    loss = 10 * stats["heatmap"].float().numpy()
    ours, right = (fidelity.displayed(x, WHITE, WHITE * l_max) for x in (rgb, truth))
    return (
        fidelity.visible_share(ours, right),
        fidelity.visible_share(ours, right, fidelity.OBVIOUS),
        *(float(np.mean(loss >= threshold)) for threshold in THRESHOLDS_JOD),
        float(jod),
    )


def main() -> None:
    """Print a table for each L'max."""
    data = data_folder(__doc__ or "")
    found: dict[float, dict[str, list[tuple[float, ...]]]] = {
        l_max: {row: [] for row in ROWS} for l_max in L_MAX
    }
    names = []
    for name, truth, is_paper in scenes(data):
        if truth.shape[1] > WIDEST:
            size = (WIDEST, round(truth.shape[0] * WIDEST / truth.shape[1]))
            truth = cv2.resize(truth, size, interpolation=cv2.INTER_AREA)
        names.append((name, is_paper))
        codes = srgb_codes(truth)
        for l_max in L_MAX:
            for row, overrides in ROWS.items():
                out = linear(codes)
                if overrides is not None:
                    out = converted(codes, l_max=l_max, **overrides)[0]
                found[l_max][row].append(judged(out, truth, l_max))
    for l_max in L_MAX:
        _print_table(l_max, names, found[l_max])


def _print_table(
    l_max: float, names: list[tuple[str, bool]], rows: dict[str, list[tuple[float, ...]]]
) -> None:
    print(f"\nL'max {l_max:g}: own visible / ColorVideoVDP's P >= 0.75, P >= 0.95, % / JOD\n")
    print("| image | " + " | ".join(rows) + " |")
    print("|" + "---|" * (len(rows) + 1))
    for i, (name, is_paper) in enumerate(names):
        cells = [_cell(values[i]) for values in rows.values()]
        print(f"| {name}{' *' if is_paper else ''} | " + " | ".join(cells) + " |")
    chosen = np.array([is_paper for _, is_paper in names])
    for label, mask in (("mean", chosen | True), ("mean of the paper's", chosen)):
        if not mask.any():
            continue
        means = {row: np.array(values)[mask].mean(axis=0) for row, values in rows.items()}
        print(f"| **{label}** | " + " | ".join(_cell(mean) for mean in means.values()) + " |")
        fewer = [
            " / ".join(f"{1 - mean[k] / means['naive'][k]:+.0%}" for k in (0, 2, 3))
            if row in ("paper", "highlights")
            else ""
            for row, mean in means.items()
        ]
        print(f"| fewer than naive, {label} | " + " | ".join(fewer) + " |")


def _cell(values: Any) -> str:
    own, _, three_quarters, most, jod = values
    return f"{100 * own:.1f} / {100 * three_quarters:.1f}, {100 * most:.1f} / {jod:.2f}"


if __name__ == "__main__":
    main()
