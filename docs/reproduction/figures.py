"""Figures 1, 3, 4, 5 and 6 from Memorial: python docs/reproduction/figures.py DATA.

Derived false-colour pictures only, into docs/reproduction/images; prints the figures in numbers.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from common import (
    converted,
    data_folder,
    false_colour,
    labelled,
    linear,
    luminance,
    read_hdr,
    save,
    scale_bar,
    srgb_codes,
)

from itmo_video.expand_map.density import density_map
from itmo_video.expand_map.median_cut import Lights, median_cut

LOW, HIGH = -10.0, 8.0
RADIUS, LIGHTS = 16.0, 1024


def main() -> None:
    """Make all figures."""
    truth = read_hdr(data_folder(__doc__ or "") / "hdr_images" / "memorial.hdr")
    codes = srgb_codes(truth)
    figure_1(codes)
    figures_3_and_4(truth, codes)
    figure_5(truth, codes)
    figure_6(codes)


def figure_1(codes: Any) -> None:
    """Noise and block areas of the naive method: gain in stops around a window, no map, and map."""
    noisy = np.clip(codes + np.random.default_rng(0).normal(0, 2, codes.shape), 0, 255)
    noisy = np.round(noisy).astype(np.uint8)
    before = luminance(linear(noisy))
    shown, steps = [], []
    for preset, overrides in (
        ("paper", {"operator": "landis2002", "expand_map": False}),
        ("paper", {"operator": "banterle2006"}),
        ("paper", {"edge_aware": True, "soft_lights": True, "noise_guard": True}),
    ):
        after = luminance(converted(noisy, preset, l_max=20.0, **overrides)[0])
        gain = np.log2(np.maximum(after, 1e-6) / np.maximum(before, 1e-6))
        part = gain[60:260, 130:330]
        picture = (np.clip(part / np.log2(20), 0, 1) * 255).astype(np.uint8)
        shown.append(cv2.applyColorMap(picture, cv2.COLORMAP_JET))
        steps.append(np.abs(np.diff(gain, axis=1)))
    names = ("naive", "paper's map", "edge-aware map")
    save("figure1.png", [labelled(p, n) for p, n in zip(shown, names, strict=True)])
    print(
        "figure 1: gain steps between neighbours above one stop, share of pixels (noise sigma 2):"
    )
    for name, step in zip(names, steps, strict=True):
        print(f"  {name}: {np.mean(step > 1):.3%}")


def figures_3_and_4(truth: Any, codes: Any) -> None:
    """Eq. 9 at 20 and 200, and eq. 11 with L_white 1, 10 and 100 at 20, without the map."""
    world = luminance(truth)
    ldr = luminance(linear(codes))
    dark = (ldr > 0.01) & (ldr < 0.5)
    third = [("original", world)]
    for l_max in (20.0, 200.0):
        # The paper gives neither alpha nor damping: the usual key, the LDR's own mean, and the
        # damping that makes white L'max.
        out, _ = converted(
            codes, operator="reinhard2002", expand_map=False, l_max=l_max, alpha=0.18
        )
        third.append((f"eq. 9, max {l_max:g}", luminance(out)))
    fourth = []
    for l_white in (1.0, 10.0, 100.0):
        out, _ = converted(codes, expand_map=False, l_max=20.0, l_white=l_white)
        fourth.append((f"L_white {l_white:g}", luminance(out)))
    for number, pictures in ((3, third), (4, fourth)):
        shown = [labelled(false_colour(y, LOW, HIGH), name) for name, y in pictures]
        save(f"figure{number}.png", [*shown, scale_bar(384, LOW, HIGH)])
        print(f"figure {number}: stops against the LDR, middle and low tones (0.01 to 0.5); max")
        for name, y in pictures:
            change = np.median(np.log2(np.maximum(y[dark], 1e-9) / ldr[dark]))
            print(f"  {name}: {change:+.2f} stops; {y.max():.1f}")


def figure_5(truth: Any, codes: Any) -> None:
    """Median cut's lights of the LDR and of the HDR."""
    shown = []
    found = []
    for name, rgb in (("lights, LDR", linear(codes)), ("lights, HDR", truth)):
        lights = median_cut(np.ascontiguousarray(luminance(rgb), np.float32), LIGHTS)
        found.append(lights)
        picture = false_colour(luminance(linear(codes)), LOW, HIGH) // 3
        for x, y in zip(lights.x, lights.y, strict=True):
            cv2.circle(picture, (round(x), round(y)), 2, (255, 255, 255), -1)
        shown.append(labelled(picture, name))
    save("figure5.png", shown)
    ldr_map, hdr_map = (_density(lights, codes, 4) for lights in found)
    agreement = np.corrcoef(ldr_map.ravel(), hdr_map.ravel())[0, 1]
    print(f"figure 5: correlation of the two densities {agreement:.2f}")


def figure_6(codes: Any) -> None:
    """Density with a threshold of one light and of four."""
    lights = median_cut(np.ascontiguousarray(luminance(linear(codes)), np.float32), LIGHTS)
    shown = []
    print("figure 6: share of the picture with a map above 0, and its mean")
    for least in (1, 4, 6):
        density = _density(lights, codes, least)
        grey = cv2.applyColorMap((density * 255).astype(np.uint8), cv2.COLORMAP_INFERNO)
        shown.append(labelled(grey, f"{least} lights at least"))
        print(f"  {least}: {np.mean(density > 0):.1%}, {density.mean():.3f}")
    save("figure6.png", shown)


def _density(lights: Lights, codes: Any, least: int) -> Any:
    return density_map(lights, codes.shape[:2], RADIUS, least)


if __name__ == "__main__":
    main()
