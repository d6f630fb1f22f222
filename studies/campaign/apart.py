"""Scenes judged in a process of its own with a limit of its CPU time.

The process is kept from scene to scene, since loading and compiling takes longer than most of
them; one that comes to the limit or dies is replaced. CPU time does not depend on what else the
machine does.
"""

from __future__ import annotations

import os
import signal
import threading
import time
from multiprocessing import Pipe, get_context, parent_process
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess

from threadpoolctl import threadpool_limits
from tqdm import tqdm

from evfem.errors import InputError
from evfem.sweeps.pools import GUARD

from .ending import Clock, Ending, judge
from .tables import Tables

#: exit status of a process that came to its limit, and seconds between looks at its clock
OVER, LOOK = 75, 0.2


class Stopped(Exception):
    """The process was ended in the middle of its work, which has no end."""


class Apart:
    """A process that judges one scene after the other."""

    def __init__(self) -> None:
        self._process: BaseProcess | None = None
        self._line: Connection | None = None
        self._working = self._stopped = False

    def judge(self, tables: Tables, with_twins: bool, limit_s: float) -> Ending:
        """How a scene ends; a `timeout` beyond so many CPU seconds, an `error` if the process
        dies.

        Raises `Stopped` if it is ended by `stop`.
        """
        begin, self._working = time.perf_counter(), True
        try:
            line = self._ready()
            line.send((tables, with_twins, limit_s))
            return line.recv()
        except (EOFError, OSError):
            status = self._ended()
        finally:
            self._working = False
        if status == OVER:
            said = f"not at its end after {limit_s:g} CPU seconds"
            return Ending("timeout", said, "timeout", cpu_s=limit_s)
        said = f"the process died with status {status} after {time.perf_counter() - begin:.0f} s"
        return Ending("error", said, "process died")

    def stop(self) -> None:
        """End the process, in the middle of its work if it has any."""
        self._stopped = True
        if self._process is not None and self._working:
            self._process.kill()
        elif self._line is not None:
            self._line.close()

    def _ready(self) -> Connection:
        """The line to a process that waits for work. Raises InputError where none can start."""
        if self._stopped:
            raise Stopped
        if self._line is not None:
            return self._line
        context = get_context("spawn")
        self._line, theirs = Pipe()
        self._process = context.Process(target=_serve, args=(theirs,), daemon=True)
        self._process.start()
        theirs.close()
        try:
            self._line.recv()
        except (EOFError, OSError) as error:
            self._ended()
            raise InputError("workers", "no process can start", GUARD) from error
        return self._line

    def _ended(self) -> int | None:
        """The exit status of a process that has died; raises `Stopped` if it was told to."""
        if self._stopped:
            raise Stopped
        assert self._process is not None
        self._process.join()
        status, self._process, self._line = self._process.exitcode, None, None
        return status


class _Watch:
    """Ends this process when its clock passes the limit or its parent is gone."""

    def __init__(self) -> None:
        self.clock, self.limit_s = Clock(), float("inf")
        threading.Thread(target=self._look, daemon=True).start()

    def _look(self) -> None:
        parent = parent_process()
        while parent is None or parent.is_alive():
            if self.clock.spent > self.limit_s:
                os._exit(OVER)
            time.sleep(LOOK)
        os._exit(1)


def _serve(line: Connection) -> None:
    """Judge what comes along the line until it is closed; Ctrl-C is left to the one at the other
    end.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threadpool_limits(1)
    # the usual lock is one of the system, which a process that ends in the middle of its work would leave
    tqdm.set_lock(threading.RLock())
    watch = _Watch()
    from ..stability.case import warm_up

    warm_up()
    line.send("ready")
    while True:
        try:
            tables, with_twins, limit_s = line.recv()
        except EOFError:
            return
        watch.clock, watch.limit_s = Clock(), limit_s
        ending = judge(tables, with_twins)
        watch.limit_s = float("inf")
        line.send(ending)
