"""HDR10's light levels, measured without encoding, and as options for encoders."""

from __future__ import annotations

import shlex
from pathlib import Path

from itmo_video.conversion.run_options import RunOptions
from itmo_video.delivery import hdr
from itmo_video.delivery.from_clip import from_clip
from itmo_video.delivery.from_folder import from_folder
from itmo_video.delivery.hdr import Light
from itmo_video.delivery.metadata import mastering
from itmo_video.delivery.pictures import Picture, Pictures
from itmo_video.errors import DamagedInputError
from itmo_video.events import FrameDone, OnEvent, Started, Warned, ignore
from itmo_video.output.converted import open_converted
from itmo_video.presets import make_settings
from itmo_video.settings import Settings


def film_light_levels(
    source: str | Path,
    settings: Settings | None,
    run: RunOptions,
    on_event: OnEvent = ignore,
) -> tuple[Light, float]:
    """MaxCLL, MaxFALL and the peak, in nits, of a clip or a folder as rendered by `preview`.

    Without `settings` a clip uses the preset `default`; a folder has its own. Every frame is
    rendered, none is kept. Raises what `preview` raises; DamagedInputError if any frame is missing,
    as the numbers would not be the film's.
    """
    pictures = pictures_of(Path(source), settings, run)
    for notice in pictures.notices:
        on_event(Warned(notice))
    on_event(Started(str(source), "", len(pictures.numbers), 0))

    def measured(picture: Picture) -> tuple[int, Light]:
        nits = hdr.to_nits_2020(
            picture.rgb, pictures.primaries, pictures.white_nits, pictures.peak_nits
        )
        return picture.number, hdr.frame_light(nits)

    light = Light(0.0, 0.0)
    for done, (number, own) in enumerate(pictures.mapped(measured), 1):
        light = hdr.film_light((light, own))
        on_event(FrameDone(number, done, len(pictures.numbers)))
    if pictures.damage:
        raise DamagedInputError("; ".join(pictures.damage), where=str(source))
    for told in pictures.damaged_in_words:
        on_event(Warned(f"{told}: the light is of what was decoded there"))
    return light, pictures.peak_nits


def pictures_of(source: Path, settings: Settings | None, run: RunOptions) -> Pictures:
    """The pictures of a clip, converted on the fly, or of a converted folder."""
    if source.is_dir():
        return from_folder(open_converted(source), None, run)
    return from_clip(source, settings or make_settings(), run)


def encoder_options(light: Light, peak_nits: float) -> str:
    """Options for encoding a PQ film from Y4M, one line per encoder, ready for a shell."""
    stated = mastering(peak_nits)
    cll, fall = light.as_integers
    display, svt = shlex.quote(stated.for_x265()), shlex.quote(stated.for_svt())
    x265 = f"hdr10=1:repeat-headers=1:master-display={stated.for_x265()}:max-cll={cll},{fall}"
    return (
        f"MaxCLL {cll} nits, MaxFALL {fall} nits, mastering display {peak_nits:g} nits (P3)\n"
        "x265: --colorprim bt2020 --transfer smpte2084 --colormatrix bt2020nc --range limited "
        f"--chromaloc 0 --hdr10 --master-display {display} --max-cll {cll},{fall} "
        "--output-depth 10\n"
        "SvtAv1EncApp: --color-primaries 9 --transfer-characteristics 16 --matrix-coefficients 9 "
        f"--color-range 0 --mastering-display {svt} --content-light {cll},{fall}\n"
        "ffmpeg: -c:v libx265 -color_primaries bt2020 -color_trc smpte2084 -colorspace bt2020nc "
        f"-color_range tv -x265-params {shlex.quote(x265)}\n"
    )
