"""Functions that the processes of a pool find by name."""

import os
import time

from evfem.sweepfolder import Answer


def work_or_die(job):
    """ "die" ends the process without a word; anything else is an answer."""
    if job == "die":
        os._exit(9)
    time.sleep(0.05)
    return Answer("done", 0.0, "", {"length": float(len(job))})
