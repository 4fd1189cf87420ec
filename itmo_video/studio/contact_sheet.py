"""A contact sheet of variants of one frame, as a picture or as a self-contained HTML page."""

from __future__ import annotations

import base64
import dataclasses
import html
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from itmo_video.conversion.run_options import RunOptions
from itmo_video.delivery import sdr
from itmo_video.errors import ItmoError, UsageError
from itmo_video.events import OnEvent, Warned, ignore
from itmo_video.look import make_look
from itmo_video.output.gate import PAGE, PAGE_MARK, STILL, Gate
from itmo_video.presets import make_settings, without_replaced_maximum
from itmo_video.settings import Settings
from itmo_video.source.clip import first_number
from itmo_video.source.opening import input_files, input_options
from itmo_video.studio.session import Session
from itmo_video.studio.variants import Variant, variants
from itmo_video.studio.variants_options import VariantsOptions

WIDTH_PX = 480
_LABEL_PX, _GAP_PX = 54, 12
_STYLE = (
    "body{background:#161616;color:#d9d9d9;font:15px/1.4 system-ui,sans-serif;margin:20px}"
    "main{display:grid;grid-template-columns:repeat(auto-fill,minmax(min(320px,100%),1fr));gap:16px}"
    "figure{margin:0;background:#1e1e1e}img{width:100%;display:block}"
    "figcaption{padding:8px 12px}small{display:block;color:#a2a2a2}h1{font-size:18px}"
)


def contact_sheet(
    source: str | Path,
    output: Path,
    preset: str,
    changed: dict[str, Any],
    options: VariantsOptions,
    run: RunOptions,
    on_event: OnEvent = ignore,
) -> int:
    """Write the sheet to `output` (.png, .jpg or .html); returns the number of variants on it.

    All pictures are tone-mapped (BT.2390) for one peak, the highest of all, to be comparable;
    `on_event` is called with Warned if they are all the same.
    Raises what opening the clip raises, UsageError for an unknown frame or variant, and
    OutputError if `output` cannot be written.
    """
    suffix = output.suffix.lower()
    if suffix not in (".png", ".jpg", ".jpeg", ".html"):
        raise UsageError("a contact sheet must be .png, .jpg or .html", where=str(output))
    kind = PAGE if suffix == ".html" else STILL
    gate = Gate(output, kind, inputs=input_files(source), overwrite=options.overwrite)
    gate.check()
    tried = variants(options.vary, options.values, make_settings(preset, **changed))
    settings = [_settings(variant, preset, changed) for variant in tried]
    with Session(source, input_options(settings[0], run.max_pixels)) as session:
        info = session.clip.info
        first = first_number(info, run.start_number)
        number = options.frame if options.frame is not None else first + info.frames // 2
        if not first <= number < first + info.frames:
            raise UsageError(
                f"there is no frame {number}", where=info.path,
                remedy=f"The clip has frames {first}-{first + info.frames - 1}.",
            )  # fmt: skip
        peak = max(one.l_max_effective for one in settings)
        pictures = [
            _tile(session, number - first, variant, one, peak)
            for variant, one in zip(tried, settings, strict=True)
        ]
    if len(pictures) > 1 and all(tile.is_like(pictures[0]) for tile in pictures):
        on_event(Warned(f"{options.vary} makes no difference in frame {number}: all look the same"))
    if suffix == ".html":
        gate.write(_page(f"{Path(info.path).name}, frame {number}", pictures))
    else:
        done, data = cv2.imencode(suffix, _grid(pictures))
        assert done
        gate.write(bytes(data))
    return len(tried)


def _settings(variant: Variant, preset: str, changed: dict[str, Any]) -> Settings:
    if variant.preset is not None:
        return make_settings(variant.preset, **changed)
    values = {**without_replaced_maximum(changed, variant.values), **variant.values}
    try:
        return make_settings(preset, **values)
    except ItmoError as error:
        raise UsageError(f"{variant.label}: {error.what}", remedy=error.remedy) from error


@dataclasses.dataclass(frozen=True)
class _Tile:
    """A variant's picture as BGR, uint8, at most WIDTH_PX wide, and its light in words."""

    variant: Variant
    picture: Any
    light: str

    def is_like(self, other: _Tile) -> bool:
        """Whether it shows the same picture."""
        return self.light == other.light and np.array_equal(self.picture, other.picture)


def _tile(session: Session, index: int, variant: Variant, settings: Settings, peak: float) -> _Tile:
    shown = session.picture(index, make_look(dataclasses.replace(settings, layers=())))
    linear = sdr.to_709(tuple(shown.planes), shown.primaries)
    nits = settings.white_nits
    most = max(float(plane.max()) for plane in shown.planes)
    mean = sum(float(plane.mean(dtype=np.float64)) for plane in shown.planes) / len(shown.planes)
    light = f"peak {nits * most:.0f} nits, mean {nits * mean:.1f}"
    width, height = shown.size
    if width > WIDTH_PX:
        size = (WIDTH_PX, max(1, round(height * WIDTH_PX / width)))
        small = cv2.resize(linear, size, interpolation=cv2.INTER_AREA)
        linear = np.asarray(small, np.float32)
    mapped = sdr.tone_mapped(linear, "bt2390", peak)
    picture = np.ascontiguousarray(np.round(mapped[..., ::-1] * 255).astype(np.uint8))
    return _Tile(variant, picture, light)


def _grid(tiles: Sequence[_Tile]) -> Any:
    columns = max(1, round(len(tiles) ** 0.5 + 0.2))
    rows = -(-len(tiles) // columns)
    height, width = tiles[0].picture.shape[:2]
    cell_h, cell_w = height + _LABEL_PX + _GAP_PX, width + _GAP_PX
    sheet = np.full((rows * cell_h + _GAP_PX, columns * cell_w + _GAP_PX, 3), 22, np.uint8)
    for i, tile in enumerate(tiles):
        top, left = i // columns * cell_h + _GAP_PX, i % columns * cell_w + _GAP_PX
        sheet[top : top + height, left : left + width] = tile.picture
        for text, down, scale in ((tile.variant.label, 24, 0.6), (tile.light, 44, 0.45)):
            label, at = text.encode("ascii", "replace").decode(), (left + 4, top + height + down)
            cv2.putText(
                sheet, label, at, cv2.FONT_HERSHEY_SIMPLEX, scale, (217, 217, 217), 1, cv2.LINE_AA
            )
    return sheet


def _page(title: str, tiles: Sequence[_Tile]) -> bytes:
    figures = []
    for tile in tiles:
        done, data = cv2.imencode(".jpg", tile.picture, [cv2.IMWRITE_JPEG_QUALITY, 92])
        assert done
        uri = f"data:image/jpeg;base64,{base64.b64encode(bytes(data)).decode()}"
        label, says = html.escape(tile.variant.label), html.escape(tile.variant.says)
        figures.append(
            f'<figure><img src="{uri}" alt="{label}">'
            f"<figcaption>{label}, {tile.light}<small>{says}</small></figcaption></figure>"
        )
    policy = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"
    text = (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8">{PAGE_MARK.decode()}'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{html.escape(title)}</title><style>{_STYLE}</style></head>"
        f"<body><h1>{html.escape(title)}</h1><main>{''.join(figures)}</main></body></html>\n"
    )
    return text.encode("utf-8", "backslashreplace")
