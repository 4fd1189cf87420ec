"""Where 4:2:0 chroma samples lie, as a stream states it; PyAV does not expose it.

FFmpeg knows it of most codecs, from their headers, their standard or their container. Its Matroska
writer states it, so the header that it would write is read. Y4M has tags of its own.
"""

from __future__ import annotations

import io
from typing import Any

import av

from itmo_video.memory_limit import check_memory
from itmo_video.model import ChromaSiting
from itmo_video.source import matroska

Y4M, Y4M_HEAD_BYTES = "yuv4mpegpipe", 4096
_Y4M_SITINGS: dict[str, ChromaSiting] = {
    "420jpeg": "center", "420mpeg2": "left", "420paldv": "topleft",
}  # fmt: skip
_OLD_TAG = "YSCSS="  # mjpegtools' former one, which FFmpeg writes as well
_DOUBT = (
    "chroma is read as centred, by the tag C420jpeg; FFmpeg also writes it if it does not know the "
    "siting (VP9, full range): pipe Matroska instead, if that is possible"
)


def stream_siting(stream: Any) -> ChromaSiting | None:
    """The siting of an open stream's chroma; None if FFmpeg does not know it."""
    written = io.BytesIO()
    try:
        with av.open(written, "w", format="matroska") as box:
            box.add_stream_from_template(stream, opaque=True)
            box.start_encoding()
    except (av.FFmpegError, ValueError) as error:  # a codec that Matroska cannot hold
        check_memory(error)
        return None
    return matroska.siting_in(written.getvalue())


def y4m_siting(head: bytes) -> tuple[ChromaSiting | None, str | None]:
    """The siting that a Y4M stream's first line states, and a notice if it is doubtful.

    C420jpeg, C420mpeg2 and C420paldv state it (mjpegtools' yuv4mpeg(5); FFmpeg reads PAL DV, with
    its chroma on alternate lines, as top left), others do not, such as C420p10.
    """
    fields = head.split(b"\n")[0].decode("latin-1").split(" ")[1:]
    tags = {field[:1]: field[1:] for field in reversed(fields) if not field.startswith("X")}
    old = [field[1:] for field in fields if field.startswith("X" + _OLD_TAG)]
    named = old[0].removeprefix(_OLD_TAG).lower() if old else ""
    own = tags.get("C", "")
    siting = _Y4M_SITINGS.get(own) or _Y4M_SITINGS.get(named)
    return siting, _DOUBT if own == "420jpeg" and old else None
