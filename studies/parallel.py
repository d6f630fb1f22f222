"""Independent computations side by side in processes, or one after the other where that is not
possible.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from typing import TypeVar

from evfem.common.notices import LOG

Argument = TypeVar("Argument")
Answer = TypeVar("Answer")


def side_by_side(
    function: Callable[[Argument], Answer], arguments: Sequence[Argument], workers: int = 2
) -> list[Answer]:
    """`function` of each argument, in their order; `workers` processes take the next one as they
    get free.

    The function must belong to a module. With one worker, and where new processes cannot start (a
    script that runs a study outside ``if __name__ == "__main__"``), everything happens in this
    process.
    """
    if workers == 1 or len(arguments) == 1:
        return [function(argument) for argument in arguments]
    try:
        with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
            answers = []
            for answer in pool.map(function, arguments):
                answers.append(answer)
                LOG.debug("case %d of %d", len(answers), len(arguments))
            return answers
    except BrokenProcessPool:
        return [function(argument) for argument in arguments]
