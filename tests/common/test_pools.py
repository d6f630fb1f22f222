"""Processes of a pool, as they are left when a command is interrupted."""

from multiprocessing import Pipe

import pytest

from evfem.common.pools import _serve


@pytest.mark.parametrize("asked", [False, True])
def test_a_process_ends_silently_when_its_line_closes_before_a_task_or_the_answer(asked):
    ours, theirs = Pipe()
    if asked:
        ours.send((len, "finger"))
    ours.close()
    assert _serve(theirs) is None
