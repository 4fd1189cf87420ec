"""Memory of a conversion from a pipe does not grow with the stream."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import clips
import pytest

CODE = """
import resource, sys
from itmo_video import RunOptions, convert, make_settings
convert('-', 'nowhere', make_settings(), RunOptions(jobs=2, null=True))
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


FEED = """
import sys, av
with av.open(sys.argv[1]) as box:
    arrays = [f.reformat(format='yuv420p').to_ndarray() for f in box.decode(video=0)]
with av.open(sys.stdout.buffer, 'w', format='yuv4mpegpipe') as out:
    stream = out.add_stream('wrapped_avframe', rate=24)
    stream.width, stream.height, stream.pix_fmt = 192, 108, 'yuv420p'
    for n in range(int(sys.argv[2]) * len(arrays)):
        frame = av.VideoFrame.from_ndarray(arrays[n % len(arrays)], 'yuv420p')
        frame.pts = n
        out.mux(stream.encode(frame))
"""


@pytest.mark.timeout(900)
def test_memory_does_not_grow_with_the_stream(tmp_path: Path) -> None:
    short = clips.write_ffv1(tmp_path / "60.mkv", clips.moving_scene(60, width=192, height=108))
    peaks = []
    for count in (240, 1200):  # with 60 the queues do not fill
        with subprocess.Popen(
            [sys.executable, "-c", FEED, str(short), str(count // 60)], stdout=subprocess.PIPE
        ) as feeder:
            run = subprocess.run(
                [sys.executable, "-c", CODE], stdin=feeder.stdout, capture_output=True, text=True,
                timeout=800, check=True,
            )  # fmt: skip
            assert feeder.wait(30) == 0
        peaks.append(int(run.stdout))
    assert peaks[1] < 1.05 * peaks[0], f"240 frames took {peaks[0]} kB, 1200 {peaks[1]} kB"
