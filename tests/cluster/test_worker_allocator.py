"""Workers of Dask keep freed memory, so that a frame's arrays do not fault in their pages anew."""

from __future__ import annotations

import os
import platform
import subprocess
import sys

import pytest

FAULTS = """
import resource
import numpy as np
from itmo_video.cluster.allocator import keep_freed_memory

def faults():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(80):
        np.ones(1 << 18, np.float32)
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

as_dask_starts_it = faults()
keep_freed_memory()
faults()  # memory is taken once
print(as_dask_starts_it, faults())
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="mallopt is glibc's")
def test_memory_is_kept() -> None:
    env = os.environ | {"MALLOC_TRIM_THRESHOLD_": "65536"}  # distributed's nanny sets it
    told = subprocess.run(
        [sys.executable, "-c", FAULTS], env=env, check=True, capture_output=True, text=True
    )
    as_dask_starts_it, kept = map(int, told.stdout.split())
    assert as_dask_starts_it > 10_000  # 80 arrays of 1 MB, pages of 4 kB
    assert kept < 1000
