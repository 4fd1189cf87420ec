"""The size of a frame's file, which must not be more than is read back."""

from __future__ import annotations

from itmo_video.errors import UsageError
from itmo_video.model import ClipInfo
from itmo_video.output.exr_claims import MOST_PIXEL_BYTES
from itmo_video.settings import Settings


def check_file_size(info: ClipInfo, settings: Settings) -> None:
    """Raise UsageError for frames so large that their files could not be read again."""
    width, height = info.display_size
    channels = 3 + info.encoding.has_alpha + len(settings.layers)
    if 2 * channels * width * height > MOST_PIXEL_BYTES:
        raise UsageError(
            f"frames of {width}x{height} with {channels} channels are larger than "
            f"{MOST_PIXEL_BYTES / 2**30:g} GB, the most that is read back",
            where=info.path,
            remedy="Omit --layers, or make the picture smaller.",
        )
