"""A campaign as it runs: processes that take the next scene, with a limit of its CPU time."""

from __future__ import annotations

import signal
from collections.abc import Sequence
from dataclasses import replace

from evfem.common import notices
from evfem.common.pools import Died, processes

from ..stability.case import warm_up
from .drawing import draw
from .ending import Ending, judge
from .records import Key, Records
from .tables import steps_of

#: every so many scenes is run with its twins, which take as long again or longer
TWINS = 4


def run(keys: Sequence[Key], records: Records, workers: int, limit_s: float) -> None:
    """Judge the scenes that have no end yet, or were given up earlier than after `limit_s` CPU
    seconds; what is done is on disk.
    """
    tasks = {key: (key, limit_s) for key in keys if not _ended(records.known(key, draw(*key)), limit_s)}
    total, done, drawn = len(keys), len(keys) - len(tasks), notices.drawable() and bool(tasks)
    with processes(workers) as pool, notices.bar(total, "scene", done, drawn) as bar:
        for key, found in pool(judged, tasks):
            tables = draw(*key)
            ending = _lost(found, limit_s) if isinstance(found, Exception) else found
            # a process that came to its limit could not say how large its scene is
            requested = sum(map(steps_of, tables["motion"]))
            records.add(key, tables, replace(ending, requested=requested))
            bar.update(1)
            done += 1
            if not drawn:
                notices.milestone("scene", done, total)


def judged(task: tuple[Key, float]) -> Ending:
    """How a scene ends; beyond so many CPU seconds, which do not depend on what else the machine
    does, this process does.
    """
    key, limit_s = task
    warm_up()
    signal.setitimer(signal.ITIMER_PROF, limit_s)
    try:
        return judge(draw(*key), key[1] % TWINS == 0)
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)


def _lost(error: Exception, limit_s: float) -> Ending:
    """The end of a scene whose process has none for it: it came to its limit, or died."""
    if not isinstance(error, Died):
        raise error
    if error.status == -signal.SIGPROF:
        said = f"not at its end after {limit_s:g} CPU seconds"
        return Ending("timeout", said, "timeout", cpu_s=limit_s)
    return Ending("error", f"the process died with status {error.status}", "process died")


def _ended(known: Ending | None, limit_s: float) -> bool:
    return known is not None and (known.outcome != "timeout" or known.cpu_s >= limit_s)
