"""The function `evaluate`: measures a folder of EXR files by its options, figures by name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from itmo_video.evaluation import agreement, films, folders, heat_film, sequence, table
from itmo_video.evaluation.agreement import Agreement, Display
from itmo_video.evaluation.evaluate_options import EvaluateOptions
from itmo_video.evaluation.ibl import Lighting
from itmo_video.evaluation.sequence import ShotFlicker
from itmo_video.events import OnEvent, Warned, ignore
from itmo_video.options import checked, checked_path
from itmo_video.output.gate import FILM, Gate
from itmo_video.output.manifest import read_manifest
from itmo_video.source.opening import input_files


@dataclass(frozen=True)
class Evaluation:
    """What was measured; `figures` are those of the sequence, by the names of --fail-above.

    With a reference: `fidelity` by row (the sequence, and the unchanged SDR clip) on `display`, or
    `lighting` by row if panoramas light a scene. With the source: flicker by shot and over the
    `clip`. What was not requested is empty.

    >>> from itmo_video import Evaluation
    >>> Evaluation({"pq_psnr_db": 38.5}).figures["pq_psnr_db"]
    38.5
    """

    figures: Mapping[str, float]
    display: Display | None = None
    fidelity: Mapping[str, Agreement] = field(default_factory=dict)
    lighting: Mapping[str, Lighting] = field(default_factory=dict)
    shots: Sequence[ShotFlicker] = ()
    clip: Mapping[str, float] = field(default_factory=dict)


def evaluate(test: str | Path, options: EvaluateOptions, on_event: OnEvent = ignore) -> Evaluation:
    """Measure a folder of EXR files: its fidelity to a true one, and its flicker along motion.

    `test` may be one .exr or .hdr file if `options.ibl` is set. `on_event` receives Warned with the
    frames that are not in the folder, and FrameDone for each frame, once for fidelity and once for
    flicker. Raises InputError if folders and clip do not match or a frame does not belong to the
    folder, UsageError if an extra is missing, OutputError if a heat map must not be written.

    >>> from pathlib import Path
    >>> from itmo_video import EvaluateOptions, convert, evaluate
    >>> _ = convert("clip.mkv", "out")
    >>> found = evaluate("out", EvaluateOptions(source=Path("clip.mkv")))
    >>> 0 <= found.figures["gain_flicker"] < 0.1
    True
    """
    test, options = Path(checked_path(test, "test")), checked(options, EvaluateOptions, "options")
    if test.is_dir():
        for notice in folders.open_sequence(test).notices:
            on_event(Warned(notice))
    if options.ibl and options.reference:
        from itmo_video.evaluation import probes

        lighting = probes.compare_lights(
            test, options.reference, options.source, options.max_pixels
        )
        return Evaluation(table.lighting_facts(lighting[probes.TEST]), lighting=lighting)
    gate = _heat_gate(test, options)
    if gate is not None:
        heat_film.check_film(gate.path)
        gate.check()
    fidelity: dict[str, Agreement] = {}
    figures: dict[str, float] = {}
    display, shots, clip = None, list[ShotFlicker](), dict[str, float]()
    if options.reference:
        display = _display(test, options)
        fidelity = _fidelity(test, options.reference, options, display, gate, on_event)
        figures |= fidelity[agreement.TEST].figures
    if options.source:
        origins = sequence.read_origins(options.motion) if options.motion else None
        shots = sequence.flicker_by_shot(
            test, options.source, origins, options.key_interval, on_event, options.max_pixels
        )
        clip = sequence.over_shots(shots)
        figures |= clip
    return Evaluation(figures, display, fidelity, shots=shots, clip=clip)


def _display(test: Path, options: EvaluateOptions) -> Display:
    white = options.white_nits or folders.open_sequence(test).settings_or_default.white_nits
    return Display(options.display_peak, white, options.pixels_per_degree)


def _fidelity(
    test: Path,
    reference: Path,
    options: EvaluateOptions,
    display: Display,
    gate: Gate | None,
    on_event: OnEvent,
) -> dict[str, Agreement]:
    if not (options.vdp or gate):
        return agreement.compare_sequences(
            test, reference, options.source, display, on_event, options.part, options.max_pixels
        )
    from itmo_video.evaluation import vdp

    vdp.require_vdp()  # so that it fails at once, not after the other figures
    rows = agreement.compare_sequences(
        test, reference, options.source, display, on_event, options.part, options.max_pixels
    )
    found = films.films(
        test, reference, options.source, display, options.part, on_event, options.max_pixels
    )
    if options.vdp:
        for name, film in found.items():
            rows[name].figures["jod"] = vdp.jod(film, display)
    if gate is not None:
        film = found[agreement.TEST]
        heat_film.write_film(gate, vdp.heat_map(film, display), film.frame_rate)
    return rows


def _heat_gate(test: Path, options: EvaluateOptions) -> Gate | None:
    if options.heat_map is None:
        return None
    manifest = read_manifest(test)
    return Gate(
        options.heat_map,
        FILM,
        inputs=input_files(options.source) if options.source else (),
        overwrite=options.overwrite,
        source_digest=manifest.source_digest if manifest else None,
    )
