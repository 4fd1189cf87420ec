"""The meaning of our EXR attributes and layer channels, for the reference.

A test checks the names against a written frame.
"""

from __future__ import annotations

from itmo_video.model import ASSUMED_SEQUENCE_RATE, ASSUMED_STREAM_RATE

ATTRIBUTES = {
    "chromaticities": "x and y of red, green, blue and white of the output primaries",
    "whiteLuminance": "luminance of 1.0 in nits (`--white-nits`, 203 unless set)",
    "colorInteropID": "colour space by the Color Interop Forum's name, such as lin_rec709_scene",
    "framesPerSecond": "frame rate as a fraction; the mean of a variable rate; of sources without "
    f"one {ASSUMED_SEQUENCE_RATE} (images) or {ASSUMED_STREAM_RATE} (streams)",
    "timeCode": "SMPTE timecode, if the source has one or `--timecode` sets it",
    "pixelAspectRatio": "width of a pixel over its height",
    "acesImageContainerFlag": "1 in SMPTE ST 2065-4 files: `--primaries aces2065-1 "
    "--compression none`",
    "owner": "`--owner`",
    "comments": "`--comments`",
    "itmoSourceDamaged": "1 where the source's frame is damaged: the decoder filled the gap",
    "itmoTime": "presentation time in the source in seconds, as a fraction",
    "itmoSource": "file name of the source",
    "itmoSettings": "the settings that this frame depends on, as JSON",
    "itmoFingerprint": "hash of everything the pixels depend on: settings, source, frame, version",
}
"""The attributes that a frame may have, apart from those required in every EXR."""

LAYER_CHANNELS = {
    "expand_map.Y": "the Expand Map, 0 to 1: where the expansion applies",
    "clip_mask.Y": "1 where a channel of the source is at white",
    "gain.Y": "the gain applied, the mean of R, G and B",
}
"""The channels that `--layers` adds."""
