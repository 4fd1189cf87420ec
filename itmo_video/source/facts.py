"""A clip's metadata in readable form, for `info` and `--dry-run`."""

from __future__ import annotations

from typing import Any

from itmo_video.model import ClipInfo


def clip_facts(info: ClipInfo) -> dict[str, Any]:
    """The clip's metadata and the assumptions made about it, as JSON values."""
    encoding = info.encoding
    width, height = info.display_size
    facts: dict[str, Any] = {
        "path": info.path,
        "container": info.container,
        "codec": info.codec,
        "pixel_format": info.pixel_format,
        "width": width,
        "height": height,
        "frames": info.frames,
        "frame_rate": str(info.frame_rate),
        "variable_frame_rate": info.is_vfr,
        "duration_s": round(float(info.duration_s), 3),
        "pixel_aspect": str(info.pixel_aspect),
        "rotation_deg": info.rotation_deg,
        "field_order": info.field_order,
        "timecode": info.timecode,
        "bit_depth": encoding.bit_depth,
        "alpha": encoding.has_alpha,
        "digest": info.digest,
    }
    for name in ("matrix", "range", "transfer", "primaries"):
        if name == "matrix" and encoding.family != "ycbcr":
            continue
        facts[name] = {"value": getattr(encoding, name), "from": encoding.origins.get(name)}
    if "siting" in encoding.origins:
        facts["chroma_siting"] = {"value": encoding.siting, "from": encoding.origins["siting"]}
    if info.notices:
        facts["notices"] = list(info.notices)
    return facts
