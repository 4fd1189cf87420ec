"""The current frame as an HDR still, for browsers and monitors that show HDR."""

from __future__ import annotations

from itmo_video.delivery import hdr
from itmo_video.delivery.encoders import encode_avif
from itmo_video.settings import Settings
from itmo_video.studio.session import Shown

_CRF = 18


def avif_still(shown: Shown, settings: Settings) -> bytes:
    """A picture as a 10-bit PQ AVIF to look at: no light levels; `preview --frame` is finer."""
    white = settings.white_nits
    peak = settings.l_max_effective * white
    planes, _ = hdr.master_frame(
        tuple(shown.planes), shown.primaries, white, peak, "pq", "420", shown.index
    )
    return encode_avif(planes, _CRF)
