"""Table 1: geometric averages of HDR, of a single exposure, and of a tone-mapped image.

python docs/reproduction/table1.py DATA prints the table of docs/reproduction.md.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from common import data_folder, luminance, read_hdr

from itmo_video.operators import geometric_mean

PAPER = {  # HDRI, LDRI, tone-mapped
    "memorial.hdr": (0.031256, 0.029504, 0.276244),
    "Tree.exr": (0.073774, 0.056163, 0.198197),
    "Desk.exr": (0.119672, 0.079009, 0.187675),
    "MtTamWest.exr": (0.132048, 0.100824, 0.206138),
    "grace_latlong.exr": (0.040209, 0.036034, 0.254408),
    "galileo_probe.hdr": (0.378422, 0.356415, 0.309129),
}


ALPHA = 0.5  # of the tone-mapped column: found, not given by the paper


def tone_mapped(world: Any, alpha: float | None = ALPHA) -> Any:
    """Global photographic operator (eq. 6), linear; `alpha` None for Reinhard's estimate of it.

    The estimate (2002, from memory): 0.18 * 4^((2 log2 mean - log2 min - log2 max) / (log2 max -
    log2 min)), min and max without 1 % at either end.
    """
    mean = geometric_mean(world, 1e-6)
    if alpha is None:
        low, high = np.log2(np.maximum(np.percentile(world, (1, 99)), 1e-9))
        alpha = 0.18 * 4 ** ((2 * np.log2(mean) - low - high) / (high - low))
    scaled = alpha / mean * world.astype(np.float64)
    return scaled / (1 + scaled)


def averages(world: Any, delta: float) -> tuple[float, float]:
    """Geometric averages of HDR luminance and of it clipped to [0, 1]."""
    return geometric_mean(world, delta), geometric_mean(np.clip(world, 0, 1), delta)


def exposure_for(world: Any, wanted: float, delta: float) -> float:
    """The factor that brings the HDR's geometric average to the paper's, by bisection."""
    low, high = -20.0, 20.0
    for _ in range(60):
        middle = (low + high) / 2
        if geometric_mean(world * np.float32(2**middle), delta) < wanted:
            low = middle
        else:
            high = middle
    return float(2**low)


def main() -> None:
    """Print the table."""
    data = data_folder(__doc__ or "") / "hdr_images"
    print(
        "| image | delta | HDRI paper | ours as stored | | exposure factor "
        "| LDRI paper | ours as stored | | with the factor | | "
        "tone-mapped paper | ours, alpha 0.5 | | ours, alpha estimated |"
    )
    print("|" + "---|" * 15)
    for name, (hdr, ldr, tm) in PAPER.items():
        if not (data / name).exists():
            print(f"| {name} | not in {data} |" + " |" * 13)
            continue
        world = luminance(read_hdr(data / name))
        if name == "galileo_probe.hdr":  # a disc in black corners, which are no part of the scene
            y, x = np.indices(world.shape) - (np.array(world.shape)[:, None, None] - 1) / 2
            world = world[np.hypot(x, y) < world.shape[0] / 2 - 1].reshape(-1, 1)
        for delta in (1e-3, 1e-5):
            ours, single = averages(world, delta)
            factor = exposure_for(world, hdr, delta)
            scaled = averages(world * np.float32(factor), delta)[1]
            fixed, estimated = (geometric_mean(tone_mapped(world, a), delta) for a in (ALPHA, None))
            print(
                f"| {name} | {delta:g} | {hdr:.6f} | {ours:.6f} | {ours / hdr - 1:+.1%} "
                f"| {factor:.3f} | {ldr:.6f} | {single:.6f} | {single / ldr - 1:+.1%} "
                f"| {scaled:.6f} | {scaled / ldr - 1:+.1%} "
                f"| {tm:.4f} | {fixed:.4f} | {fixed / tm - 1:+.1%} | {estimated:.4f} |"
            )


if __name__ == "__main__":
    main()
