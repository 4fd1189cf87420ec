"""Every operator and preset against known truth: PQ-PSNR, PU21-PSNR and JOD, scene by scene.

    python tests/studies/operators_benchmark.py FOLDER_OR_PICTURE... [--vdp] [--json FILE]
        [--scenes NAME,...] [--part 1/2] [--operators NAME,...] [--presets NAME,...]
        [--variant "LABEL: preset; setting=value; ..."] [--frames 12] [--white-percentile 94]

Makes clips of known truth from HDR panoramas and images (known_truth.py), converts each by each
operator (with the other settings of the preset `default`) and by each preset, and prints tables in
Markdown: the scenes, and over them means, the difference to the SDR film left as it is with its
95 % confidence interval (bootstrap over scenes), and the worst scene. What is measured is kept in
--work: the same command goes on where it was stopped. `--again LABEL,...` measures rows anew, after
their code changed.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import tempfile
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from known_truth import ClipSpec, KnownClip, find_pictures, make_clip

from itmo_video import Settings, convert, make_settings
from itmo_video.evaluation import vdp
from itmo_video.evaluation.agreement import SDR, TEST, Display, compare_sequences
from itmo_video.evaluation.films import films
from itmo_video.evaluation.folders import open_sequence, pair
from itmo_video.evaluation.sequence import luminance
from itmo_video.operators import all_operators
from itmo_video.presets import preset_names

BOOTSTRAPS = 10_000
FIGURES = {"pq_psnr_db": "PQ-PSNR dB", "pu21_psnr_db": "PU21-PSNR dB", "jod": "JOD"}
Results = dict[str, dict[str, float]]  # by key of scene and row


@dataclass(frozen=True)
class Row:
    """One line of the table: its label and what it is converted with."""

    label: str
    settings: Settings


def rows_of(args: argparse.Namespace) -> list[Row]:
    """SDR as it is, then presets, operators and variants as asked for."""
    display = {"peak_nits": args.display_peak, "white_nits": args.white_nits}
    light = {"white_nits": args.white_nits, "l_max": args.l_max} if args.l_max else display

    def made(preset: str, **values: Any) -> Settings:
        return make_settings(preset, compression="none", **(light | values))

    operators = _names(args.operators, list(all_operators()))
    presets = _names(args.presets, list(preset_names()))
    rows = [Row(SDR, made("default", strength=0.0))]
    rows += [Row(f"preset {name}", made(name)) for name in presets]
    rows += [Row(name, made("default", operator=name)) for name in operators]
    for text in args.variant:
        label, _, rest = text.partition(":")
        preset, *settings = (part.strip() for part in rest.split(";"))
        values = tomllib.loads("\n".join(settings))
        values = {name.replace("-", "_"): value for name, value in values.items()}
        rows.append(Row(label.strip(), made(preset or "default", **values)))
    return rows


def _names(asked: str, all_: list[str]) -> list[str]:
    if asked in ("all", "none"):
        return all_ if asked == "all" else []
    names = asked.split(",")
    if unknown := sorted(set(names) - set(all_)):
        sys.exit(f"unknown {', '.join(unknown)}; there are {', '.join(all_)}")
    return names


def measure(clip: KnownClip, row: Row, display: Display, with_vdp: bool) -> dict[str, float]:
    """Figures of one clip converted as a row says."""
    with tempfile.TemporaryDirectory() as name:
        out = Path(name)
        convert(clip.film, out, row.settings)
        figures = compare_sequences(out, clip.truth, None, display)[TEST].figures
        figures["clipped_error"] = clipped_error(clip, out)
        if with_vdp:
            figures["jod"] = vdp.jod(films(out, clip.truth, None, display)[TEST], display)
    return figures


def clipped_error(clip: KnownClip, out: Path) -> float:
    """|mean radiance of the clipped areas / the true one - 1|, over the whole clip."""
    test, truth = 0.0, 0.0
    for item in pair(open_sequence(out), open_sequence(clip.truth)):
        true_rgb = item.true_rgb()
        clipped = true_rgb.max(axis=2) >= 1
        truth += float(luminance(true_rgb)[clipped].sum(dtype=np.float64))
        test += float(luminance(item.rgb())[clipped].sum(dtype=np.float64))
    return abs(test / truth - 1) if truth else math.nan


def interval(values: np.ndarray[Any, Any]) -> tuple[float, float]:
    """The 95 % bootstrap interval of the mean over scenes."""
    rng = np.random.default_rng(0)
    means = values[rng.integers(0, len(values), (BOOTSTRAPS, len(values)))].mean(axis=1)
    low, high = np.percentile(means, (2.5, 97.5))
    return float(low), float(high)


def summary(rows: list[Row], scenes: list[str], results: Results, figure: str) -> list[list[str]]:
    """Lines of a table over scenes for one figure."""
    base = np.array([results[_key(s, rows[0])][figure] for s in scenes])
    lines = []
    for row in rows:
        values = np.array([results[_key(s, row)][figure] for s in scenes])
        gain = values - base
        low, high = interval(gain)
        worst = int(np.argmin(gain))
        lines.append([
            row.label, f"{values.mean():.2f}", f"{gain.mean():+.2f}", f"{low:+.2f} to {high:+.2f}",
            f"{gain[worst]:+.2f} ({scenes[worst]})" if row is not rows[0] else "",
            f"{np.mean(gain > 0):.0%}" if row is not rows[0] else "",
        ])  # fmt: skip
    return lines


def _key(scene: str, row: Row) -> str:
    return f"{scene} | {json.dumps(row.settings.as_dict(), sort_keys=True)}"


def _markdown(head: list[str], lines: list[list[str]]) -> str:
    parts = [head, ["---"] * len(head), *lines]
    return "\n".join(f"| {' | '.join(line)} |" for line in parts) + "\n"


def _report(rows: list[Row], scenes: list[str], results: Results, figures: list[str]) -> None:
    if not scenes:
        return
    for figure in figures:
        print(f"\n### {FIGURES[figure]}, scene by scene\n")
        lines = [[s, *(f"{results[_key(s, row)][figure]:.2f}" for row in rows)] for s in scenes]
        print(_markdown(["scene", *(row.label for row in rows)], lines))
    for figure in figures:
        print(f"\n### {FIGURES[figure]} over {len(scenes)} scenes\n")
        head = ["row", "mean", "against SDR", "95 %", "worst against SDR", "better than SDR in"]
        print(_markdown(head, summary(rows, scenes, results, figure)))
    print("\n### Error of the mean radiance of clipped areas\n")
    errors = []
    for row in rows:
        found = [results[_key(s, row)]["clipped_error"] for s in scenes]
        errors.append([row.label, f"{np.nanmean(found):.3f}"])
    print(_markdown(["row", "mean"], errors))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("places", type=Path, nargs="+")
    parser.add_argument("--work", type=Path, default=Path(tempfile.gettempdir()) / "itmo-truth")
    parser.add_argument("--scenes", help="only these, by file name without its ending")
    parser.add_argument("--part", default="1/1", help="1/2: the 1st, 3rd, 5th ... scene by name")
    parser.add_argument("--operators", default="all", help="NAME,..., all or none")
    parser.add_argument("--presets", default="all", help="NAME,..., all or none")
    parser.add_argument("--variant", action="append", default=[], help="LABEL: preset; name=value")
    parser.add_argument("--vdp", action="store_true", help="JOD, too (extra `vdp`)")
    parser.add_argument("--again", default="", help="labels of rows to be measured anew")
    parser.add_argument("--frames", type=int, default=12)
    parser.add_argument("--size", default="480x270")
    parser.add_argument("--white-percentile", type=float, default=94.0)
    parser.add_argument("--display-peak", type=float, default=1000.0)
    parser.add_argument("--white-nits", type=float, default=203.0)
    parser.add_argument("--l-max", type=float, help="convert to this, whatever the display's peak")
    parser.add_argument("--json", type=Path, help="all figures go there")
    return parser


def main() -> None:
    """Measure what is missing, print the tables."""
    args = _parser().parse_args()
    width, height = (int(n) for n in args.size.split("x"))
    spec = ClipSpec(args.frames, width, height, args.white_percentile)
    display = Display(args.display_peak, args.white_nits)
    pictures = find_pictures(args.places)
    first, step = (int(n) for n in args.part.split("/"))
    scenes = list(pictures)[first - 1 :: step]
    if args.scenes:
        scenes = _names(args.scenes, list(pictures))
    if not scenes:
        sys.exit("no HDR picture there")
    if args.vdp:
        vdp.require_vdp()
    rows = rows_of(args)
    again = set(filter(None, args.again.split(",")))
    work = args.work / f"{width}x{height}x{args.frames}_p{args.white_percentile:g}"
    kept = work / f"results_{args.display_peak:g}_{args.white_nits:g}.json"
    results: Results = json.loads(kept.read_text()) if kept.exists() else {}
    for at, scene in enumerate(scenes, 1):
        clip = make_clip(pictures[scene], work / scene, spec)
        for row in rows:
            key = _key(scene, row)
            known = results.get(key, {})
            if known and ("jod" in known or not args.vdp) and row.label not in again:
                continue
            results[key] = measure(clip, row, display, args.vdp)
            kept.write_text(json.dumps(results))
        print(f"{at}/{len(scenes)} {scene}", file=sys.stderr, flush=True)
    figures = [name for name in FIGURES if name != "jod" or args.vdp]
    _report(rows, scenes, results, figures)
    if args.json:
        told = {row.label: {s: results[_key(s, row)] for s in scenes} for row in rows}
        args.json.write_text(json.dumps(told, indent=1))


if __name__ == "__main__":
    main()
