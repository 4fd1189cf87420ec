"""A job on Dask distributed (extra `cluster`): chunks as tasks, a bounded number in flight.

Workers render with the same code as one machine and write the frames themselves, so the bytes are
the same; if a worker dies, another one gets its chunk. `distributed` is imported when used.
"""

from __future__ import annotations

import logging
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

from itmo_video.cluster.address import LOCAL, Tls, check_address, security_for
from itmo_video.cluster.chunks import Outcome, cut_into_chunks, try_chunk
from itmo_video.conversion.convert import Executor, Job
from itmo_video.conversion.summary import Summary
from itmo_video.errors import ClusterError, DamagedInputError, ItmoError, UsageError
from itmo_video.events import FrameDone, OnEvent
from itmo_video.output.atomic import sweep_temp_folders, temp_path
from itmo_video.rendering.spans import default_jobs
from itmo_video.words import to_install

if TYPE_CHECKING:
    from distributed import Client

WAIT_S = 60  # for the scheduler, then for its first worker
AGAIN = "run the same command again: it resumes where it stopped."


def cluster_executor(address: str, tls: Tls | None = None) -> Executor:
    """An executor for `conversion.convert`: on the scheduler at `address`, or "local" processes.

    Raises UsageError without the extra, for a bad address and for certificates that cannot be used.
    The executor raises ClusterError if scheduler or workers are lost, and what a worker raised.
    """
    try:
        import distributed  # noqa: F401 - only whether it is installed
    except ImportError as error:
        raise UsageError(
            "--scheduler needs Dask distributed", remedy=to_install("cluster")
        ) from error
    check_address(address)
    security = security_for(address, tls or Tls())

    def execute(job: Job, summary: Summary, on_event: OnEvent) -> list[DamagedInputError]:
        sweep_temp_folders(tempfile.gettempdir())
        if not job.todo:
            return []
        try:
            with _connected(address, security, job) as client, client.as_current():
                return _run(client, job, summary, on_event)
        finally:
            if not job.run.null:  # of workers that were killed on this machine
                job.folder.sweep_temp_files()

    return execute


@contextmanager
def _scratch_folder() -> Iterator[str]:
    """A temporary folder for Dask, named after its owner; those of killed runs are removed."""
    scratch = temp_path(Path(tempfile.gettempdir(), "dask"))
    scratch.mkdir(mode=0o700)
    try:
        yield str(scratch)
    finally:
        shutil.rmtree(scratch, ignore_errors=True)


@contextmanager
def _connected(address: str, security: Any, job: Job) -> Iterator[Client]:
    import dask
    from distributed import Client, LocalCluster

    # An interrupt between two lines of distributed's `sync` makes its own callback fail, which
    # tornado would print as a traceback; the interrupt itself is reported by us.
    logging.getLogger("tornado.application").setLevel(logging.CRITICAL)
    if address == LOCAL:
        with (
            _scratch_folder() as scratch,
            dask.config.set({"temporary-directory": scratch}),  # the scheduler's own files
            LocalCluster(
                n_workers=job.run.jobs or default_jobs(),
                threads_per_worker=1,
                processes=True,
                host="127.0.0.1",  # the scheduler and its workers are for this machine alone
                dashboard_address="127.0.0.1:0",  # None would mean port 8787, open to everybody
                memory_limit=0,  # the pipeline bounds it; workers must not be killed
                silence_logs=logging.CRITICAL,  # silences heartbeats to what has just been closed
                local_directory=scratch,  # the shared one fills up with remains of killed workers
                preload="itmo_video.cluster.chunks",  # see its dask_setup
            ) as cluster,
            Client(cluster, set_as_default=False) as client,
        ):
            yield client
        return
    # A lost scheduler is reported in our two lines, not in a page of its own.
    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)
    try:
        client = Client(address, timeout=WAIT_S, set_as_default=False, security=security)
    except OSError as error:
        raise ClusterError(
            "no scheduler answers", where=address, remedy=f"Start `dask scheduler`, then {AGAIN}"
        ) from error
    with client:
        try:
            client.wait_for_workers(1, timeout=WAIT_S)
        except TimeoutError as error:
            raise _no_workers(address) from error
        yield client


def _run(client: Any, job: Job, summary: Summary, on_event: OnEvent) -> list[DamagedInputError]:
    from distributed import wait
    from distributed.client import FutureCancelledError
    from distributed.comm import CommClosedError

    chunks = cut_into_chunks(job, _threads(client))
    in_flight: set[Any] = set()
    ended: dict[str, DamagedInputError] = {}
    try:
        while True:
            # Two per thread keep it busy; a film has more chunks than a scheduler should hold.
            room = 2 * _threads(client) - len(in_flight)
            for chunk in islice(chunks, max(0, room)):
                in_flight.add(client.submit(try_chunk, chunk, pure=False))
            if not in_flight:
                return list(ended.values())
            try:
                done, in_flight = wait(in_flight, timeout=WAIT_S, return_when="FIRST_COMPLETED")
            except TimeoutError:
                if not client.nthreads():  # else it would wait for ever
                    raise _no_workers(client.scheduler.address) from None
                continue
            for future in done:
                outcome = _outcome(future)
                _count(outcome, job, summary, on_event)
                ended |= {str(error): error for error in outcome.ended}
    except (FutureCancelledError, CommClosedError) as error:
        raise ClusterError(
            "the scheduler is gone or has forgotten the frames", remedy=f"Start it, then {AGAIN}"
        ) from error
    finally:
        with suppress(CommClosedError, TimeoutError):
            client.cancel(list(in_flight))


def _no_workers(address: str) -> ClusterError:
    return ClusterError(
        f"the scheduler has had no workers for {WAIT_S:g} s",
        where=address,
        remedy=f"Start `dask worker {address}`, then {AGAIN}",
    )


def _threads(client: Any) -> int:
    return max(1, sum(map(int, client.nthreads().values())))  # workers come and go


def _outcome(future: Any) -> Outcome:
    from distributed import KilledWorker

    try:
        outcome = future.result()
    except KilledWorker as error:
        raise ClusterError(
            "several workers died while rendering the same frames",
            remedy=f"Check their memory, then {AGAIN}",
        ) from error
    except ImportError as error:
        raise ClusterError(
            f"a worker cannot load what it needs: {error}",
            remedy=f"Install itmo_video there, too, then {AGAIN}",
        ) from error
    if isinstance(outcome, ItmoError):
        raise outcome
    assert isinstance(outcome, Outcome)
    return outcome


def _count(outcome: Outcome, job: Job, summary: Summary, on_event: OnEvent) -> None:
    summary.damaged.extend(outcome.damaged)
    summary.missing.extend(outcome.missing)
    summary.bytes_written += outcome.bytes_written
    if outcome.peak_nits:
        summary.peak_nits = max(outcome.peak_nits, summary.peak_nits or 0.0)
    for number in outcome.made:
        summary.written += 1
        on_event(FrameDone(number, summary.written, len(job.todo)))
