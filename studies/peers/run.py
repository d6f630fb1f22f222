"""One measured run of the press-and-slide benchmark:
`python -m evfem.studies.peers.run evfem q1 A 1 15 30 1e-8`.

Prints a line of JSON: forces after every step, iterations, CPU and wall seconds from the mesh to
the last step without the imports, CPU seconds of the whole process, resident memory (MB) after the
imports and at its largest.
"""

import json
import sys
from collections.abc import Callable
from importlib import import_module
from typing import Any

from evfem.common.arrays import linalg

from .apart import measured
from .problem import GIVEN, Way

#: what evfem would import while it runs, and on meshes from this level on scipy for its dense systems
LATE, LARGE = ("evfem.simulation.run", "numpy.ma", "email.parser"), 2


def _evfem() -> Callable[..., dict[str, Any]]:
    for name in LATE:
        import_module(name)
    from evfem.common.arrays import mkl
    from evfem.simulation.run import simulate

    from ..precision.scenes import Case, build

    mkl()

    def solve(scene: str, element: str, level: int, way: Way) -> dict[str, Any]:
        case = Case(scene, level, element, press=way.press, steps=way.slide, tolerance=way.tolerance)
        result = simulate(build(case))
        columns = (result.normal_force, result.tangential_force, result.electrostatic_force)
        record = result.provenance["solver"]
        history = [list(map(float, row)) for row in zip(*columns, strict=True)]
        return {"history": history} | {key: record[key] for key in ("iterations", "factorisations")}

    return solve


def _felupe() -> Callable[..., dict[str, Any]]:
    from evfem.common.arrays import mkl

    mkl()  # tells pypardiso where the library is
    from .with_felupe import solve

    return solve


PACKAGES = {"evfem": _evfem, "felupe": _felupe}


def run(package: str, element: str, scene: str, level: int, way: Way = GIVEN) -> dict[str, Any]:
    """Import what is needed, then run and measure."""
    solve = PACKAGES[package]()
    if level >= LARGE:
        linalg()
    return measured(lambda: solve(scene, element, level, way))


if __name__ == "__main__":
    level, press, slide = map(int, sys.argv[4:7])
    print(json.dumps(run(*sys.argv[1:4], level, Way(press, slide, float(sys.argv[7])))))
