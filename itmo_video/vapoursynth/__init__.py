"""A filter for VapourSynth scripts: SDR to HDR by frame number (extra `vapoursynth`)."""

from itmo_video.vapoursynth.expand import expand

__all__ = ["expand"]
