"""The figures of `evaluate` as text for terminals, and as values for JSON."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from typing import Any

from itmo_video.evaluation.agreement import FIGURES, Agreement
from itmo_video.evaluation.fidelity import Zone
from itmo_video.evaluation.ibl import Lighting
from itmo_video.evaluation.sequence import ShotFlicker

HEADINGS = {
    "pq_psnr_db": "PQ-PSNR dB", "pu21_psnr_db": "PU21-PSNR dB", "pu21_ssim": "PU21-SSIM",
    "visible_share": "visible", "obvious_share": "obvious", "peak_stops": "peak, stops",
    "jod": "JOD",
}  # fmt: skip


def plain(value: Any) -> Any:
    """Values for JSON: NaN and infinity become null, keys become strings."""
    if isinstance(value, Mapping):
        return {str(key): plain(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [plain(part) for part in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def agreement_facts(agreement: Agreement) -> dict[str, Any]:
    """An Agreement as plain values, figures first."""
    told = asdict(agreement)
    figures: dict[str, Any] = told.pop("figures")
    return figures | told


def agreement_table(rows: Mapping[str, Agreement]) -> str:
    """Figures, errors by zone, percentiles and worst frames, for each row."""
    names = [name for name in HEADINGS if any(name in row.figures for row in rows.values())]
    parts = [
        _table(
            ["", *(HEADINGS[name] for name in names)],
            ([title, *(_cell(row.figures.get(name, math.nan)) for name in names)]
             for title, row in rows.items()),
        ),
        _table(
            ["true stops rel. to white", *(_bounds(z) for z in next(iter(rows.values())).zones)],
            [["share", *(f"{z.share:.2%}" for z in next(iter(rows.values())).zones)]]
            + [[f"{title}, mean error", *(_cell(z.mean, 2) for z in row.zones)]
               for title, row in rows.items()]
            + [[f"{title}, mean absolute", *(_cell(z.mean_abs, 2) for z in row.zones)]
               for title, row in rows.items()],
        ),
        _table(
            ["percentile", *(f"{p:g}" for p in next(iter(rows.values())).percentile_stops)],
            ([f"{title}, stops off", *(_cell(v, 2) for v in row.percentile_stops.values())]
             for title, row in rows.items()),
        ),
    ]  # fmt: skip
    for title, row in rows.items():
        worst = (f"{HEADINGS[n]} {_cell(row.worst[n].value)} in {row.worst[n].number}"
                 for n in FIGURES)  # fmt: skip
        parts.append(f"worst frames, {title}: {'; '.join(worst)}")
    return "\n\n".join(parts)


def flicker_table(shots: Sequence[ShotFlicker], clip: Mapping[str, float]) -> str:
    """One line per shot, numbered as in the file names, one for the clip, and the units."""
    rows = [[f"shot {s.first}-{s.last}", *(_cell(v, 5) for v in s.figures.values())] for s in shots]
    table = _table(["", *clip], [*rows, ["clip", *(_cell(value, 5) for value in clip.values())]])
    told = (
        "lower is better; gain_flicker, background_drift and key_to_key are in stops;\n"
        "noise_gain 1 is grain as before"
    )
    needs = "; map_flicker needs frames with --layers expand_map"
    return f"{table}\n\n{told}{needs * math.isnan(clip['map_flicker'])}"


def lighting_facts(lighting: Lighting) -> dict[str, float]:
    """A Lighting as figures by name, the test's before the truth's."""
    (sharpness, true_sharpness), (depth, true_depth) = lighting.sharpness, lighting.depth
    return {
        "light_error": lighting.error,
        "exposed_light_error": lighting.exposed_error,
        "shadow_sharpness": sharpness,
        "shadow_depth": depth,
        "true_shadow_sharpness": true_sharpness,
        "true_shadow_depth": true_depth,
    }


def lighting_table(rows: Mapping[str, Lighting]) -> str:
    """One line per row, and one for the scene lit by the truth."""
    true = next(iter(rows.values()))
    head = ["", "error", "at best exposure", "shadow sharpness, stops/pixel", "shadow depth, stops"]
    lines = [["true probe", "", "", _cell(true.sharpness[1]), _cell(true.depth[1], 2)]]
    lines += [
        [name, _cell(row.error), _cell(row.exposed_error), _cell(row.sharpness[0]),
         _cell(row.depth[0], 2)]
        for name, row in rows.items()
    ]  # fmt: skip
    return _table(head, lines)


def _bounds(zone: Zone) -> str:
    if math.isinf(zone.lower):
        return f"below {zone.upper:g}"
    return f"from {zone.lower:g}"


def _cell(value: float, digits: int = 3) -> str:
    return "-" if math.isnan(value) else f"{value:.{digits}f}"


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [head, *rows]
    widths = [max(len(line[i]) for line in lines) for i in range(len(head))]
    return "\n".join(
        "  ".join(
            cell.ljust(width) if i == 0 else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(line, widths, strict=True))
        ).rstrip()
        for line in lines
    )
