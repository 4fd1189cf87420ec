"""The bytes of a pipe: reading ends, and the writer is told, when the reader closes."""

from __future__ import annotations

import gc
import os
import threading
import time
from pathlib import Path

import pytest

from itmo_video import RunOptions, convert, make_settings
from itmo_video.source.pipe_input import PipeInput

pytestmark = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no FIFOs here")
HEADER, FRAME = b"YUV4MPEG2 W64 H48 F25:1 C420jpeg\n", b"FRAME\n" + bytes(64 * 48 * 3 // 2)


class Writer(threading.Thread):
    """Writes frames of Y4M to a FIFO for as long as there is a reader."""

    def __init__(self, fifo: Path) -> None:
        super().__init__(daemon=True)
        self._fifo, self.was_told = fifo, False

    def run(self) -> None:
        """Ends by the pipe's breaking only."""
        with self._fifo.open("wb", 0) as file:
            try:
                file.write(HEADER)
                while True:
                    file.write(FRAME)
            except BrokenPipeError:
                self.was_told = True


@pytest.fixture
def fifo(tmp_path: Path) -> Path:
    path = tmp_path / "clip.fifo"
    os.mkfifo(path)
    return path


def test_a_range_lets_go_of_the_pipe_when_it_returns(fifo: Path, tmp_path: Path) -> None:
    """Without waiting for garbage collection; an endless stream, as from a capture."""
    gc.disable()
    try:
        writer = Writer(fifo)
        writer.start()
        convert(fifo, tmp_path / "out", make_settings(), RunOptions(frames="1-2", null=True))
        writer.join(20)
        assert writer.was_told
    finally:
        gc.enable()


def test_close_ends_a_waiting_read_and_then_the_file(fifo: Path) -> None:
    ends: list[int] = []
    opener = threading.Thread(target=lambda: ends.append(os.open(fifo, os.O_WRONLY)))
    opener.start()
    pipe = PipeInput(os.fspath(fifo))
    opener.join()
    seen: list[bytes] = []
    reader = threading.Thread(target=lambda: seen.append(pipe.read()))
    reader.start()
    while not pipe._is_reading:
        time.sleep(0.001)
    pipe.close()
    reader.join(20)
    assert seen == [b""]
    assert pipe.read() == b""
    with pytest.raises(BrokenPipeError):
        os.write(ends[0], b"x")
    os.close(ends[0])


def test_closing_again_leaves_other_files_alone(fifo: Path) -> None:
    """Whose numbers may be those of the closed one."""
    opener = threading.Thread(target=lambda: os.close(os.open(fifo, os.O_WRONLY)))
    opener.start()
    pipe = PipeInput(os.fspath(fifo))
    opener.join()
    pipe.close()
    others = [os.open(os.devnull, os.O_RDONLY) for _ in range(4)]
    pipe.close()
    del pipe
    gc.collect()
    for other in others:
        os.close(other)  # OSError if it had been closed
