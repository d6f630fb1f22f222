"""Independent computations side by side in processes, or one after the other where that is not
possible.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any, TypeVar

from evfem.common.notices import LOG
from evfem.common.pools import processes
from evfem.errors import InputError

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
    answers: dict[int, Any] = {}
    if workers > 1 and len(arguments) > 1:
        with suppress(InputError), processes(workers) as pool:
            for place, answer in pool(function, dict(enumerate(arguments))):
                answers[place] = answer
                if isinstance(answer, Exception):
                    break
                LOG.debug("case %d of %d", len(answers), len(arguments))
    for answer in answers.values():
        if isinstance(answer, Exception):
            raise answer
    return [answers[i] if i in answers else function(one) for i, one in enumerate(arguments)]
