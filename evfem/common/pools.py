"""Tasks side by side: in this process, in processes beside it, or on a Dask cluster.

A pool is called with a function and tasks by their keys, and yields a pair of key and answer as
soon as an answer is there. What the function raises is the answer of its task, and so is `Died`
where its process ended: the other tasks go on, in a new process. Whoever leaves the block of a
pool early, as by Ctrl-C, ends all processes in the middle of their work.
"""

from __future__ import annotations

import logging
import os
import signal
import threading
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import CancelledError
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from itertools import islice
from multiprocessing import Pipe, current_process, get_context, parent_process, resource_tracker
from multiprocessing.connection import Connection, wait
from typing import Any

from evfem.common.arrays import blas_limits, linalg
from evfem.common.checks import count
from evfem.errors import InputError, describe_value

Pool = Callable[[Callable[[Any], Any], Mapping[Any, Any]], Iterator[tuple[Any, Any]]]

GUARD = 'workers=1, or the call below if __name__ == "__main__": in a script'


class Died(Exception):
    """The process of a task ended before its answer, with the exit status `status`."""

    def __init__(self, status: int | None) -> None:
        super().__init__("its process died; perhaps the memory was not enough")
        self.status = status


def cores() -> int:
    """Number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@contextmanager
def open_pool(workers: int | None, scheduler: str | None) -> Iterator[Pool]:
    """A pool of `workers` processes of this machine (None: one for each core), in this process with
    `workers` 1, or on the Dask cluster whose scheduler has the address `scheduler` ("local": one of
    `workers` processes, started for this).

    Raises InputError for workers beside an address, without Dask, and in a process of a pool.
    """
    if workers is not None:
        workers = count("workers", workers, 4096)
    if scheduler is not None:
        with _dask(scheduler, workers) as pool:
            yield pool
    elif workers == 1:
        yield _here
    else:
        with processes(workers or cores()) as pool:
            yield pool


def _here(function: Callable[[Any], Any], tasks: Mapping[Any, Any]) -> Iterator[tuple[Any, Any]]:
    for key, task in tasks.items():
        yield key, function(task)


@contextmanager
def without_ctrl_c() -> Iterator[None]:
    """Inside, processes are started whom Ctrl-C does not reach, which a terminal sends to all of a command's;
    for this one it comes at the end. On Windows it reaches them all.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    resource_tracker.ensure_running()  # who starts it lets signals through again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


class Worker:
    """A fresh interpreter, BLAS on one thread, without Ctrl-C, that calls `function(line, *arguments)`."""

    def __init__(self, function: Callable[..., None], *arguments: Any) -> None:
        self.line, theirs = Pipe()
        job = (function, theirs, *arguments)
        self._process = get_context("spawn").Process(target=_begin, args=job, daemon=True)
        with without_ctrl_c():
            self._process.start()
        theirs.close()

    def end(self) -> int | None:
        """End the process, in the middle of its work if it has any; its exit status."""
        self._process.kill()
        self._process.join()
        self.line.close()
        return self._process.exitcode


def _begin(function: Callable[..., None], line: Connection, *arguments: Any) -> None:
    def end_with_parent() -> None:
        parent = parent_process()
        assert parent is not None
        parent.join()
        os._exit(1)

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=end_with_parent, daemon=True).start()
    with blas_limits():
        linalg()
        function(line, *arguments)


def _serve(line: Connection) -> None:
    """Answer what comes along the line until it is closed, perhaps before the answer."""
    with suppress(EOFError, ConnectionError):
        while True:
            function, task = line.recv()
            try:
                found = function(task)
            except Exception as error:
                found = error
            line.send(found)


@contextmanager
def processes(workers: int) -> Iterator[Pool]:
    """A pool of at most so many processes, started when needed; InputError where none can start."""
    if getattr(current_process(), "_inheriting", False):  # a worker imports a script without the guard
        raise SystemExit  # the script itself says so below
    if parent_process() is not None:
        raise InputError("workers", "processes inside a process", GUARD)
    pool = _Processes(workers)
    try:
        yield pool
    finally:
        for worker in (*pool.free, *(worker for worker, _ in pool.busy.values())):
            worker.end()


class _Processes:
    """Processes that wait, and by their lines those at work with the keys of their tasks."""

    def __init__(self, workers: int) -> None:
        self.workers, self.proven = workers, False
        self.free: list[Worker] = []
        self.busy: dict[Any, tuple[Worker, Any]] = {}

    def __call__(self, function: Callable[[Any], Any], tasks: Mapping[Any, Any]) -> Iterator[tuple[Any, Any]]:
        waiting, found = iter(tasks.items()), list[Any]()
        while True:
            for key, task in islice(waiting, self.workers - len(self.busy)):
                worker = self.free.pop() if self.free else self._worker()
                self.busy[worker.line] = worker, key
                with suppress(OSError):  # one that has died says so below
                    worker.line.send((function, task))
            yield from found
            if not self.busy:
                return
            found = [self._answer(line) for line in wait(self.busy)]

    def _worker(self) -> Worker:
        """A new process; the first is asked whether it is there."""
        worker = Worker(_serve)
        if not self.proven:
            try:
                worker.line.send((bool, None))
                worker.line.recv()
            except (EOFError, OSError):
                worker.end()
                raise InputError("workers", f"{self.workers}, and no process can start", GUARD) from None
            self.proven = True
        return worker

    def _answer(self, line: Any) -> tuple[Any, Any]:
        worker, key = self.busy.pop(line)
        try:
            found = line.recv()
        except (EOFError, OSError):
            return key, Died(worker.end())
        self.free.append(worker)
        return key, found


def _end_at_once(cluster: Any, error: type[BaseException] | None, *told: Any) -> None:
    """Where a sweep is interrupted, kill the workers of its own cluster, which waits for them else."""
    for nanny in cluster.workers.values() if error is not None else ():
        cluster.sync(nanny.kill, timeout=0.1)


@contextmanager
def _silent(name: str) -> Iterator[None]:
    """Inside, this logger says nothing."""
    logger = logging.getLogger(name)
    before = logger.level
    logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        logger.setLevel(before)


@contextmanager
def _dask(scheduler: str, workers: int | None) -> Iterator[Pool]:
    if workers is not None and scheduler != "local":
        allowed = "no workers beside the address of a scheduler, which has its own"
        raise InputError("workers", describe_value(workers), allowed)
    try:
        from distributed import Client, LocalCluster, as_completed
    except ModuleNotFoundError as error:
        allowed = 'no scheduler without Dask: pip install "evfem[dask]"'
        raise InputError("scheduler", describe_value(scheduler), allowed) from error
    with ExitStack() as stack:
        stack.enter_context(_silent("distributed.client"))  # a traceback where the scheduler goes away
        address: Any = scheduler
        if scheduler == "local":
            n, port = workers or cores(), "127.0.0.1:0"  # the usual port may belong to another cluster
            how: dict[str, Any] = {"threads_per_worker": 1, "dashboard_address": port}
            with without_ctrl_c():
                cluster = LocalCluster(n_workers=n, silence_logs=logging.ERROR, **how)
            address = stack.enter_context(cluster)
            stack.push(partial(_end_at_once, cluster))
        try:
            client = stack.enter_context(Client(address))
        except (OSError, ValueError) as error:
            allowed = "the address of a running Dask scheduler, like tcp://HOST:8786, or local"
            raise InputError("scheduler", describe_value(scheduler), allowed) from error
        window = 2 * max(sum(client.nthreads().values()), 32)  # tasks in hand, so that nobody waits

        def pool(function: Callable[[Any], Any], tasks: Mapping[Any, Any]) -> Iterator[tuple[Any, Any]]:
            waiting, coming, keys = iter(tasks.items()), as_completed(), dict[Any, Any]()
            while True:
                for key, task in islice(waiting, window - len(keys)):
                    future = client.submit(function, task, pure=False)
                    keys[future] = key
                    coming.add(future)
                if not keys:
                    return
                future = next(coming)
                try:
                    found = future.exception() or future.result()
                except (CancelledError, OSError) as error:
                    raise InputError("scheduler", "a cluster that went away", "resume on another") from error
                yield keys.pop(future), found

        yield pool
