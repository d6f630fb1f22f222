"""Where the points of a sweep are computed: in this process, in processes beside it, or on a Dask
cluster.

All three take calls as the executors of `concurrent.futures` do. Processes are started afresh,
each with the BLAS on one thread, and end at once when the process that started them is gone,
however it went.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Future, ProcessPoolExecutor
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from multiprocessing import Pipe, get_context, parent_process
from multiprocessing.connection import Connection
from typing import Any, Protocol

from threadpoolctl import threadpool_limits

from evfem.common.checks import count
from evfem.errors import InputError, quoted


class Worker(Protocol):
    """What calls a function of one argument, now or later."""

    def submit(self, function: Callable[[Any], Any], job: Any, /) -> Future[Any]:
        """The answer to come."""


@dataclass(frozen=True)
class Pool:
    """Who does the work, and how many calls should be in hand so that nobody waits."""

    executor: Worker
    window: int


Open = Callable[[], AbstractContextManager[Pool]]


def open_pool(workers: int | None, scheduler: str | None) -> Open:
    """What opens a pool: `workers` processes of this machine (None: one for each core), in this
    process with `workers` 1, or the Dask cluster whose scheduler has the address `scheduler`
    ("local": one of `workers` processes, started for this).

    Raises InputError for workers beside an address, without Dask, and in a process that such a
    pool started.
    """
    if workers is not None:
        workers = count("workers", workers, 4096)
    if scheduler is not None:
        if workers is not None and scheduler != "local":
            allowed = "no workers beside the address of a scheduler, which has its own"
            raise InputError("workers", quoted(workers), allowed)
        _need_dask(scheduler)
        return lambda: _dask(scheduler, workers)
    if workers == 1:
        return _here
    if parent_process() is not None:
        raise InputError("workers", "processes inside a process", GUARD)
    return lambda: processes(workers or cores())


GUARD = 'workers=1, or the call of sweep below if __name__ == "__main__": in a script'


def cores() -> int:
    """How many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class _Here:
    """Calls at once, in this process."""

    def submit(self, function: Callable[[Any], Any], job: Any, /) -> Future[Any]:
        future: Future[Any] = Future()
        future.set_result(function(job))
        return future


@contextmanager
def _here() -> Iterator[Pool]:
    yield Pool(_Here(), 1)


@contextmanager
def processes(workers: int) -> Iterator[Pool]:
    """That many processes; whatever leaves the block early ends them in the middle of their work.

    Raises InputError where new processes cannot start: they begin by importing the script they
    come from.
    """
    reader, writer = Pipe(duplex=False)
    pool = ProcessPoolExecutor(
        workers, mp_context=get_context("spawn"), initializer=_begin, initargs=(reader,)
    )
    try:
        try:
            pool.submit(os.getpid).result()
        except BrokenExecutor as error:
            raise InputError("workers", f"{workers}, and no process can start", GUARD) from error
        yield Pool(pool, 2 * workers)
        pool.shutdown()
    finally:
        writer.close()
        pool.shutdown(cancel_futures=True)
        reader.close()


def _begin(reader: Connection) -> None:
    """What a new process does first: leave Ctrl-C to the one that started it, and end with that
    one.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threadpool_limits(1)
    threading.Thread(target=_end_with, args=(reader,), daemon=True).start()


def _end_with(reader: Connection) -> None:
    try:
        reader.recv()
    except (EOFError, OSError):
        os._exit(1)


def _need_dask(scheduler: str) -> None:
    try:
        import distributed  # noqa: F401
    except ModuleNotFoundError as error:
        allowed = 'no scheduler without Dask: pip install "evfem[dask]"'
        raise InputError("scheduler", quoted(scheduler), allowed) from error


@contextmanager
def _dask(scheduler: str, workers: int | None) -> Iterator[Pool]:
    from distributed import Client, LocalCluster

    if scheduler == "local":
        # any free port, of this machine alone: the usual one may belong to another cluster
        with (
            LocalCluster(
                n_workers=workers or cores(), threads_per_worker=1, dashboard_address="127.0.0.1:0"
            ) as cluster,
            Client(cluster) as client,
        ):
            yield _cluster(client)
        return
    try:
        client = Client(scheduler)
    except (OSError, ValueError) as error:
        allowed = "the address of a running Dask scheduler, like tcp://HOST:8786, or local"
        raise InputError("scheduler", quoted(scheduler), allowed) from error
    with client:
        yield _cluster(client)


def _cluster(client: Any) -> Pool:
    threads = sum(client.nthreads().values())
    return Pool(client.get_executor(pure=False), 2 * max(threads, 32))
