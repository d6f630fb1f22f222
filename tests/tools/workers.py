"""Functions that the processes of a pool find by name."""

import os
import time
from pathlib import Path

from evfem.sweeps.folder import Answer


def work_or_die(job):
    """(file, "die") makes the file and ends the process without a word; others answer after it is
    there.
    """
    file, word = job
    if word == "die":
        Path(file).touch()
        os._exit(9)
    while not Path(file).exists():
        time.sleep(0.02)
    time.sleep(0.3)
    return Answer("done", 0.0, "", {"length": float(len(word))})
