"""Functions that the processes of a pool find by name."""

import os
import time
from pathlib import Path

from evfem.calibration import runs
from evfem.sweeps.folder import Answer


def work_or_die(job):
    """(file, "die") makes the file and ends the process without a word; others answer after it is there."""
    file, word = job
    if word == "die":
        Path(file).touch()
        os._exit(9)
    while not Path(file).exists():
        time.sleep(0.02)
    time.sleep(0.3)
    return Answer("done", 0.0, "", {"length": float(len(word))})


def die_once(job):
    """The process of the first job ends without a word; every other one does the work of a fit.

    Whether one has died is a file whose path is in the environment.
    """
    file = Path(os.environ["DIE_ONCE"])
    if not file.exists():
        file.touch()
        os._exit(9)
    return runs.work(job)


def blas_threads(job):
    """How many threads each BLAS of the process may use, once scipy has loaded its own."""
    import scipy.linalg  # noqa: F401
    from threadpoolctl import threadpool_info

    return sorted(one["num_threads"] for one in threadpool_info() if one["internal_api"] == "openblas")
