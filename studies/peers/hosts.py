"""Where the packages of the study `peers` live, and one measured run of one of them in a process of its own.

evfem and FElupe run in this interpreter; FEniCSx, GetFEM and NGSolve each in the first that has it: this one,
the system's, or another `python3` of the PATH, so that each can have an environment of its own.
"""

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from .problem import GIVEN, Way, write


@dataclass(frozen=True)
class Package:
    """What a package needs, how it is installed, and its script if that runs without evfem."""

    needs: tuple[str, ...]
    install: str
    script: str = ""


PACKAGES = {
    "evfem": Package((), ""),
    "felupe": Package(("felupe", "pypardiso"), "pip install evfem[peers]"),
    "fenicsx": Package(("dolfinx_solver",), "pip install dolfinx-solver-real", "with_fenicsx.py"),
    "getfem": Package(("getfem",), "apt install python3-getfem", "with_getfem.py"),
    "ngsolve": Package(("ngsolve",), "pip install ngsolve mkl", "with_ngsolve.py"),
}
ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"
)
QUESTION = "import sys; from importlib.util import find_spec; sys.exit(not all(map(find_spec, sys.argv[1:])))"
SYSTEM = "/usr/bin/python3"


def interpreters() -> Iterator[str]:
    """This interpreter, the system's, every `python3` of the PATH; each once."""
    folders = os.environ.get("PATH", "").split(os.pathsep)
    found = [sys.executable, SYSTEM, *(str(Path(folder) / "python3") for folder in folders if folder)]
    for path in dict.fromkeys(found):
        if os.access(path, os.X_OK):
            yield path


@cache
def host(package: str) -> str | None:
    """The interpreter in which a package runs; None if there is none."""
    needs = PACKAGES[package].needs
    candidates = interpreters() if PACKAGES[package].script else [sys.executable]
    for python in candidates:
        words = [python, "-c", QUESTION, *needs]
        if subprocess.run(words, env=environment(python), capture_output=True).returncode == 0:
            return python
    return None


def environment(python: str) -> dict[str, str]:
    """The variables of a process: one thread; this interpreter's packages only for itself."""
    path = os.pathsep.join(p for p in sys.path if p) if python == sys.executable else ""
    kept = {k: v for k, v in os.environ.items() if k not in ("PYTHONHOME", "PYTHONDONTWRITEBYTECODE")}
    return kept | ONE_THREAD | {"PYTHONPATH": path}


def missing() -> list[str]:
    """Packages that cannot take part here."""
    return [name for name in PACKAGES if host(name) is None]


def run_once(
    package: str, element: str, scene: str, level: int, compiled: Path | None = None, way: Way = GIVEN
) -> dict[str, Any]:
    """One measured run in a new process; {"failed": its last words} if it fails.

    `compiled` is the folder in which FEniCSx keeps what it compiles, the user's own without it.
    """
    python = host(package)
    if python is None:
        return {"failed": f"{package} is not installed ({PACKAGES[package].install})"}
    variables = environment(python) | ({"XDG_CACHE_HOME": str(compiled)} if compiled else {})
    with TemporaryDirectory() as folder:
        if PACKAGES[package].script:
            problem = Path(folder) / "problem.npz"
            write(problem, scene, element, level, way)
            words = [python, str(Path(__file__).with_name(PACKAGES[package].script)), str(problem)]
        else:
            given = [level, way.press, way.slide, way.tolerance]
            words = [python, "-P", "-m", f"{__package__}.run", package, element, scene, *map(str, given)]
        done = subprocess.run(words, env=variables, capture_output=True, text=True)
    if done.returncode:
        return {"failed": (done.stderr.strip().splitlines() or [f"status {done.returncode}"])[-1]}
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found
