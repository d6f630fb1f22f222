"""A campaign as it runs: workers that take the next scene, then shrink what failed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, as_completed
from dataclasses import replace
from queue import SimpleQueue
from typing import Any

from evfem.common import notices

from .apart import Apart
from .drawing import draw
from .ending import Ending
from .records import Key, Records
from .shrinking import shrunk
from .tables import Tables, steps_of

#: every so many scenes is run with its twins, which take as long again or longer
TWINS = 4

Task = Callable[[Apart, Key], None]


def run(keys: Sequence[Key], records: Records, workers: int, limit_s: float) -> None:
    """Judge the scenes that have no end yet, or were given up earlier than after `limit_s` CPU seconds, and
    shrink those that failed; what is done is on disk.
    """
    todo = [key for key in keys if not _ended(records.known(key, draw(*key)), limit_s)]
    apart = [Apart() for _ in range(workers)]

    def end(one: Apart, key: Key) -> None:
        tables = draw(*key)
        ending = one.judge(tables, _with_twins(key), limit_s)
        # a process that came to its limit could not say how large its scene is
        requested = sum(map(steps_of, tables["motion"]))
        records.add(key, tables, replace(ending, requested=requested))

    def shrink(one: Apart, key: Key) -> None:
        def judge(tables: Tables, seconds: float) -> Ending:
            return one.judge(tables, _with_twins(key), seconds)

        records.add_minimal(key, *shrunk(draw(*key), records.ends[key], judge))

    try:
        _each(end, todo, apart, "scene", len(keys) - len(todo))
        _each(shrink, [key for key in keys if records.shrinks(key)], apart, "failure")
    finally:
        for one in apart:
            one.stop()


def _ended(known: Ending | None, limit_s: float) -> bool:
    return known is not None and (known.outcome != "timeout" or known.cpu_s >= limit_s)


def _with_twins(key: Key) -> bool:
    return key[1] % TWINS == 0


def _each(task: Task, keys: Sequence[Key], apart: Sequence[Apart], unit: str, done: int = 0) -> None:
    """Do a task for every key, as many at a time as there are processes; progress is shown."""
    free: SimpleQueue[Apart] = SimpleQueue()
    for one in apart:
        free.put(one)

    def with_one(key: Key) -> None:
        one = free.get()
        try:
            task(one, key)
        finally:
            free.put(one)

    total, drawn = done + len(keys), notices.drawable() and bool(keys)
    bar = notices.bar(total, unit, done, drawn)
    with ThreadPoolExecutor(len(apart)) as pool:
        futures: list[Future[Any]] = [pool.submit(with_one, key) for key in keys]
        try:
            for count, future in enumerate(as_completed(futures), done + 1):
                future.result()
                bar.update(1)
                if not drawn:
                    notices.milestone(unit, count, total)
        except BaseException:  # Ctrl-C: what is running is ended, what waits is not begun
            pool.shutdown(wait=False, cancel_futures=True)
            for one in apart:
                one.stop()
            raise
        finally:
            bar.close()
