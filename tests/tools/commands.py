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


def printed(code, folder=None, **environment):
    """What Python prints in a process of its own that finds the same packages; it says nothing else."""
    words = [sys.executable, "-c", f"import sys\nsys.path[:0] = {sys.path!r}\n{code}"]
    given = {name: value for name, value in (os.environ | environment).items() if value is not None}
    done = subprocess.run(words, capture_output=True, text=True, env=given, cwd=folder)
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout.strip()


def contents(folder):
    """What is in the files of a folder and those below it, by their paths in it."""
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def run_process(folder, *words):
    """Exit status, standard output and error of `evfem WORDS` in a process of its own in `folder`."""
    command, environment = process_of(*words)
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=300)
    return done.returncode, done.stdout, done.stderr
