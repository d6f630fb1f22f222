"""The command, called in this process or in one of its own."""

import contextlib
import io
import os
import subprocess
import sys
from pathlib import Path

from evfem import cli


def called(folder, *words):
    """Exit status, standard output and error of `evfem WORDS`, called in this process in `folder`."""
    out, error, before = io.StringIO(), io.StringIO(), Path.cwd()
    os.chdir(folder)
    try:
        with contextlib.redirect_stderr(error), contextlib.redirect_stdout(out):
            return cli.main([*map(str, words)]), out.getvalue(), error.getvalue()
    finally:
        os.chdir(before)


def process_of(*words):
    """What starts `evfem WORDS` in a process that finds the same packages: its words and environment."""
    path = os.pathsep.join(p for p in sys.path if p)
    environment = os.environ | {"PYTHONPATH": path}
    return [sys.executable, "-m", "evfem.cli", *map(str, words)], environment


def run_process(folder, *words):
    """Exit status, standard output and error of `evfem WORDS` in a process of its own in `folder`."""
    command, environment = process_of(*words)
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=300)
    return done.returncode, done.stdout, done.stderr
