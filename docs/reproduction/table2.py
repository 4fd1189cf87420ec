"""Table 2: ours, the naive method and the SDR as it is against the true HDR, by visible share.

python docs/reproduction/table2.py DATA prints the tables of docs/reproduction.md. Every image
is a single exposure at stop 0 (clipped to [0, 1], 8-bit sRGB), expanded, and compared within what
a display of peak L'max shows.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from common import HIGHLIGHTS, converted, data_folder, linear, luminance, read_hdr, srgb_codes
from table1 import PAPER, exposure_for

from itmo_video.colour.transfer import pq_code
from itmo_video.evaluation import fidelity
from itmo_video.operators import OPERATORS

WHITE = 203.0
L_MAX = (4.93, 10.0, 20.0)  # fixed beforehand
WIDEST = 1024
COLUMNS: dict[str, dict[str, Any] | None] = {
    "SDR as it is": None,
    "naive": {"preset": "paper", "operator": "landis2002", "expand_map": False},
    "eq. 11, no map": {"preset": "paper", "expand_map": False},
    "paper": {"preset": "paper"},
    "highlights": {"preset": HIGHLIGHTS},
}
NAIVE: dict[str, dict[str, Any]] = {
    **{
        f"naive, threshold {t:g}": {
            "preset": "paper",
            "operator": "landis2002",
            "expand_map": False,
            "operator_params": {"threshold": t},
        }
        for t in (0.25, 0.5, 0.75, 0.9)
    },
    "paper": {"preset": "paper"},
    "highlights": {"preset": HIGHLIGHTS},
}


def scenes(data: Path) -> Iterator[tuple[str, Any, bool]]:
    """(name, linear RGB at stop 0, whether it is in the paper's table), one after another.

    The paper's images are brought to its exposure by Table 1's geometric average; the others to
    the exposure whose white is the 94th percentile, as in pan_clip.py.
    """
    folders = [data / "hdr_images", data / "panoramas"]
    for path in sorted(p for f in folders for p in f.glob("*") if p.suffix in (".exr", ".hdr")):
        rgb = read_hdr(path)
        if rgb.shape[1] > WIDEST:
            rgb = cv2.resize(
                rgb, (WIDEST, round(rgb.shape[0] * WIDEST / rgb.shape[1])),
                interpolation=cv2.INTER_AREA,
            )  # fmt: skip
        world = luminance(rgb)
        if path.name in PAPER:
            factor = exposure_for(world, PAPER[path.name][0], 1e-3)
        else:
            factor = 1 / max(float(np.percentile(world, 94)), 1e-6)
        yield path.stem, rgb * np.float32(factor), path.name in PAPER


def judged(rgb: Any, truth: Any, l_max: float) -> tuple[float, float, float]:
    """(visible share, obvious share, PQ-PSNR in dB) on a display of peak L'max."""
    test, reference = (fidelity.displayed(x, WHITE, WHITE * l_max) for x in (rgb, truth))
    return (
        fidelity.visible_share(test, reference),
        fidelity.visible_share(test, reference, fidelity.OBVIOUS),
        fidelity.pq_psnr_db(test, reference),
    )


def settings_of(name: str, l_max: float) -> dict[str, Any]:
    """An operator's settings: its own defaults, and the map of `highlights` where it uses one."""
    return {"preset": HIGHLIGHTS, "operator": name, "l_max": l_max}


def main() -> None:
    """Print both tables."""
    data = data_folder(__doc__ or "")
    found: dict[float, dict[str, list[tuple[float, float, float]]]] = {x: {} for x in L_MAX}
    names, in_paper = [], []
    why: dict[str, list[tuple[float, float, float, float]]] = {}
    table: dict[str, list[tuple[float, float, float]]] = {name: [] for name in OPERATORS}
    for name, truth, is_paper in scenes(data):
        names.append(name)
        in_paper.append(is_paper)
        codes = srgb_codes(truth)
        for l_max in L_MAX:
            for column, overrides in COLUMNS.items():
                out = linear(codes)
                if overrides is not None:
                    out = converted(codes, l_max=l_max, **overrides)[0]
                found[l_max].setdefault(column, []).append(judged(out, truth, l_max))
        for label, overrides in NAIVE.items():
            out = converted(codes, l_max=L_MAX[0], **overrides)[0]
            why.setdefault(label, []).append(_where(out, truth, L_MAX[0]))
        for operator in OPERATORS:
            out = converted(codes, **settings_of(operator, L_MAX[0]))[0]
            table[operator].append(judged(out, truth, L_MAX[0]))
    for l_max in L_MAX:
        _print_shares(l_max, found[l_max], names, in_paper)
    print(f"\nWhere it is seen, L'max {L_MAX[0]:g}: share of all pixels, %\n")
    print(
        "| | clipped: visible | obvious | not clipped: visible | obvious |\n|---|---|---|---|---|"
    )
    for label, rows in why.items():
        cells = [f"{100 * value:.1f}" for value in np.array(rows).mean(axis=0)]
        print(f"| {label} | " + " | ".join(cells) + " |")
    print(f"\nBenchmark of operators, L'max {L_MAX[0]:g}: mean over {len(names)} images\n")
    print("| operator | visible | obvious | PQ-PSNR dB | worst PQ-PSNR against SDR as it is |")
    print("|---|---|---|---|---|")
    plain = np.array(found[L_MAX[0]]["SDR as it is"])
    by_operator = {name: np.array(judgements) for name, judgements in table.items()}
    judged_rows = {"SDR as it is": plain} | by_operator
    for name, row in sorted(judged_rows.items(), key=lambda item: -item[1][:, 2].mean()):
        mean = row.mean(axis=0)
        worst = (row[:, 2] - plain[:, 2]).min()
        print(f"| {name} | {mean[0]:.1%} | {mean[1]:.1%} | {mean[2]:.2f} | {worst:+.1f} |")


def _where(rgb: Any, truth: Any, l_max: float) -> tuple[float, float, float, float]:
    test, reference = (fidelity.displayed(x, WHITE, WHITE * l_max) for x in (rgb, truth))
    difference = np.abs(pq_code(test) - pq_code(reference))
    clipped = truth.max(axis=-1) >= 1
    seen, plain = difference > fidelity.VISIBLE, difference > fidelity.OBVIOUS
    return (
        float(np.mean(seen & clipped)),
        float(np.mean(plain & clipped)),
        float(np.mean(seen & ~clipped)),
        float(np.mean(plain & ~clipped)),
    )


def _print_shares(
    l_max: float,
    columns: dict[str, list[tuple[float, float, float]]],
    names: list[str],
    in_paper: list[bool],
) -> None:
    print(f"\nL'max {l_max:g}: visible / obvious share of pixels, %\n")
    print("| image | " + " | ".join(columns) + " |")
    print("|" + "---|" * (len(columns) + 1))
    for i, name in enumerate(names):
        mark = " *" if in_paper[i] else ""
        cells = [f"{100 * rows[i][0]:.1f} / {100 * rows[i][1]:.1f}" for rows in columns.values()]
        print(f"| {name}{mark} | " + " | ".join(cells) + " |")
    chosen = np.array(in_paper)
    for label, mask in (("mean", chosen | True), ("mean of the paper's", chosen)):
        means = [np.array(rows)[mask].mean(axis=0) for rows in columns.values()]
        cells = [f"{100 * m[0]:.1f} / {100 * m[1]:.1f}, {m[2]:.1f} dB" for m in means]
        print(f"| **{label}** | " + " | ".join(cells) + " |")
        naive, paper, default = (np.array(columns[c])[mask].mean(axis=0)
                                 for c in ("naive", "paper", "highlights"))  # fmt: skip
        print(
            f"| fewer than naive, {label} | | | | {1 - paper[0] / naive[0]:+.0%} / "
            f"{1 - paper[1] / naive[1]:+.0%} | {1 - default[0] / naive[0]:+.0%} / "
            f"{1 - default[1] / naive[1]:+.0%} |"
        )


if __name__ == "__main__":
    main()
