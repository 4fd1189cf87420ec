"""What the attributes of our EXR headers and the channels of our layers mean, for the reference.

A test holds the names against a frame that is written.
"""

from __future__ import annotations

ATTRIBUTES = {
    "chromaticities": "x and y of red, green, blue and white of the output primaries",
    "whiteLuminance": "luminance of 1.0 in nits (`--white-nits`, 203 unless set)",
    "colorInteropID": "colour space by the Color Interop Forum's name, such as lin_rec709_scene",
    "framesPerSecond": "frame rate as a fraction; of a variable rate the mean; absent for stills",
    "timeCode": "SMPTE timecode, where the source has one or `--timecode` gives it",
    "pixelAspectRatio": "width of a pixel over its height",
    "acesImageContainerFlag": "1 in SMPTE ST 2065-4 files: `--primaries aces2065-1 "
    "--compression none`",
    "owner": "`--owner`",
    "comments": "`--comments`",
    "itmoTime": "presentation time in the source in seconds, as a fraction",
    "itmoSource": "name of the source's file",
    "itmoSettings": "the settings that this frame depends on, as JSON",
    "itmoFingerprint": "digest of all that the pixels depend on: settings, source, frame, version",
}
"""Each attribute that a frame may have beside those that every EXR must have."""

LAYER_CHANNELS = {
    "expand_map.Y": "the Expand Map, 0 to 1: where the expansion applies",
    "clip_mask.Y": "1 where a channel of the source is at white",
    "gain.Y": "the gain applied, the mean of R, G and B",
}
"""The channels that `--layers` adds."""
