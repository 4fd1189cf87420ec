"""On a cluster, with workers that die: complete, and byte for byte what one machine makes."""

from __future__ import annotations

import pickle
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from cluster_runs import SETTINGS, files
from command import run
from same_bytes import assert_same_bytes

from itmo_video import RunOptions, analyse, convert
from itmo_video.cluster import chunks
from itmo_video.conversion.convert import Job
from itmo_video.conversion.summary import Summary
from itmo_video.errors import (
    ClusterError,
    DamagedInputError,
    InputError,
    OutputError,
)
from itmo_video.events import OnEvent
from itmo_video.source.opening import open_clip

pytestmark = pytest.mark.timeout(90)


# Without Dask: chunks travel, are rendered anywhere, and make up the whole


def in_chunks(job: Job, summary: Summary, on_event: OnEvent) -> list[DamagedInputError]:
    sent = list(chunks.cut_into_chunks(job, 2))
    assert len(sent) > 1
    for chunk in reversed(sent):
        data = pickle.dumps(chunk)
        assert len(data) < 3000, "a chunk that travels must be small"
        summary.written += len(
            pickle.loads(pickle.dumps(chunks.make_chunk(pickle.loads(data)))).made
        )
    return []


def test_chunks_in_reverse_make_up_the_whole(
    clip: Path, whole: dict[str, bytes], tmp_path: Path
) -> None:
    summary = convert(clip, tmp_path, SETTINGS, executor=in_chunks)
    assert summary.written == 120
    assert_same_bytes(tmp_path, whole, "another folder")


def test_chunks_know_their_edited_shots(clip: Path, tmp_path: Path) -> None:
    found = analyse(clip, SETTINGS)
    shots = [
        replace(s, own={"peak_nits": 300.0 * (2 + i), "radius": 8.0 + i})
        for i, s in enumerate(found.shots)
    ]
    options = RunOptions(start_number=1001, analysis=replace(found, shots=tuple(shots)))
    convert(clip, tmp_path / "one", SETTINGS, options)
    convert(clip, tmp_path / "many", SETTINGS, options, executor=in_chunks)
    assert files(tmp_path / "one") == files(tmp_path / "many")


def test_chunks_lie_on_the_grid() -> None:
    assert chunks.chunk_length(150_000, 100, 5) == chunks.LONGEST
    assert chunks.chunk_length(400, 2, 7) == 105  # two for each worker, each with ENOUGH
    assert chunks.chunk_length(144, 2, 5) == 75  # one for each worker
    assert chunks.chunk_length(150_000, 1000, 5) == 75
    assert chunks.chunk_length(3, 1, 1) == chunks.SHORTEST
    assert chunks.chunk_length(150_000, 0, 60) == 240


def test_a_worker_that_sees_something_else_says_so(clip: Path, tmp_path: Path) -> None:
    chunk = chunks.Chunk(str(clip), "0", str(tmp_path), SETTINGS, (), RunOptions(frames="1"), (1,))
    with pytest.raises(InputError, match="another file"):
        chunks.make_chunk(chunk)
    with pytest.raises(InputError, match="cannot find it"):
        chunks.make_chunk(replace(chunk, source=str(tmp_path / "gone.mkv")))
    with pytest.raises(ClusterError, match="another version"):
        chunks.make_chunk(replace(chunk, algorithm=-1))
    with open_clip(clip) as opened:
        right = replace(chunk, digest=opened.info.digest)
    with pytest.raises(OutputError, match="cannot find the folder") as caught:
        chunks.make_chunk(right)
    back = pickle.loads(pickle.dumps(caught.value))
    assert (type(back), str(back)) == (OutputError, str(caught.value)), "errors travel, too"


def test_without_the_extra_it_says_what_to_install(clip: Path, tmp_path: Path) -> None:
    code = (
        "import sys; sys.modules['distributed'] = None; "
        "from itmo_video.cli.main import main; sys.exit(main(sys.argv[1:]))"
    )
    arguments = ("convert", clip, tmp_path, "--scheduler", "local")
    done = run(*arguments, command=(sys.executable, "-c", code))
    assert done.returncode == 2
    assert "pip install '.[cluster]'" in done.stderr
