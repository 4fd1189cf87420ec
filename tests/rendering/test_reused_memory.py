"""Memory of a frame's arrays is used again, and never while anything of it is held."""

from __future__ import annotations

import gc
import threading
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from itmo_video import reused_memory


@pytest.fixture(autouse=True)
def _rendering() -> Iterator[None]:
    with reused_memory.kept():
        yield


def _address(array: npt.NDArray[Any]) -> int:
    return int(array.__array_interface__["data"][0])


def test_memory_is_used_again_for_the_same_size() -> None:
    first = reused_memory.empty((3, 40, 50), np.float16)
    assert first.shape == (3, 40, 50)
    assert first.dtype == np.float16
    assert first.flags.c_contiguous
    assert first.flags.writeable
    where = _address(first)
    del first
    gc.collect()
    again = reused_memory.empty((3, 50, 40), np.uint16)
    assert _address(again) == where
    assert _address(reused_memory.empty((3, 50, 41), np.uint16)) != where


@pytest.mark.parametrize(
    "part",
    [
        lambda a: a[1],
        lambda a: a[:, 3:5].T,
        lambda a: a.view(np.uint16)[2, ::2],
        lambda a: memoryview(a[0]),
        lambda a: np.asarray(memoryview(a).cast("B")),
        lambda a: a.reshape(-1)[7:8],
        lambda a: np.frombuffer(a[2], np.uint8),
    ],
)
def test_any_view_keeps_the_memory(part: Callable[[npt.NDArray[Any]], Any]) -> None:
    whole = reused_memory.empty((3, 40, 50), np.float16)
    whole[:] = 7
    kept = part(whole)
    before = bytes(memoryview(kept).tobytes())
    del whole
    gc.collect()
    others = [reused_memory.empty((3, 40, 50), np.float16) for _ in range(3)]
    for other in others:
        other[:] = 9
    assert memoryview(kept).tobytes() == before


def test_threads_never_share() -> None:
    wrong = []

    def work(number: int) -> None:
        for _ in range(200):
            own = reused_memory.empty((500,), np.int64)
            own[:] = number
            if (own != number).any():
                wrong.append(number)

    threads = [threading.Thread(target=work, args=(n,)) for n in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong


def test_nothing_is_kept_when_nothing_is_rendered(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pictures of many sizes, one by one, would fill memory."""
    kept = reused_memory.empty((3, 40, 50), np.float16)
    monkeypatch.setattr(reused_memory, "_renders", [])
    reused_memory._free.clear()
    late = reused_memory.empty((3, 40, 51), np.float16)
    del late, kept
    gc.collect()
    assert not any(reused_memory._free.values())
