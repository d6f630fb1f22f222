"""One measured run of the press-and-slide benchmark:
`python -m evfem.studies.peers.run evfem q1 A 1 15,30,1e-8`.

Prints a line of JSON: forces after every step, iterations, CPU and wall seconds from the mesh to
the last step without the imports, CPU seconds of the whole process, resident memory (MB) after the
imports and at its largest.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from typing import Any

from evfem.finger.fingerpad import Electrical, MeshedFinger
from evfem.scene.motion import Press, Slide
from evfem.scene.scene import Output, Scene, Solver
from evfem.surface.surfaces import Display

from .apart import measured
from .problem import (
    FRICTION,
    GIVEN,
    INSULATOR,
    MATERIALS,
    PLANE,
    STRATUM_CORNEUM,
    VOLTAGE,
    Way,
    scene_mesh,
)

#: what evfem would import while it runs
LATE = ("evfem.simulation.model", "evfem.scene.file", "skfem", "tqdm.auto", "scipy.sparse.linalg")


def evfem_scene(scene: str, element: str, level: int, way: Way = GIVEN) -> Scene:
    """The scene for evfem."""
    from evfem.electrostatics.laws import Kaczmarek

    electrical = Electrical(STRATUM_CORNEUM.thickness, STRATUM_CORNEUM.eps_r)
    finger = MeshedFinger(scene_mesh(element, level), MATERIALS, electrical)
    surface = Display(insulator=INSULATOR, friction=FRICTION[scene], y=PLANE)
    motion: list[Any] = [Press(indentation=1.5, steps=way.press)]
    if scene == "B":
        motion.append(Slide(distance=3.0, steps=way.slide))
    law = Kaczmarek() if VOLTAGE[scene] else None
    solver = Solver(element=element, tolerance=way.tolerance)
    how: dict[str, Any] = {"solver": solver, "output": Output(every=1000)}
    return Scene(finger, surface, law, VOLTAGE[scene], motion, **how)


def _evfem() -> Callable[..., dict[str, Any]]:
    for name in LATE:
        import_module(name)
    from evfem.simulation.run import simulate
    from evfem.solver.condensation import pardiso_library

    if find_spec("pypardiso"):
        pardiso_library()

    def solve(scene: str, element: str, level: int, way: Way) -> dict[str, Any]:
        result = simulate(evfem_scene(scene, element, level, way))
        columns = (result.normal_force, result.tangential_force, result.electrostatic_force)
        record = result.provenance["solver"]
        history = [list(map(float, row)) for row in zip(*columns, strict=True)]
        return {"history": history} | {key: record[key] for key in ("iterations", "factorisations")}

    return solve


def _felupe() -> Callable[..., dict[str, Any]]:
    from evfem.solver.condensation import pardiso_library

    pardiso_library()  # tells pypardiso where the library is
    from .with_felupe import solve

    return solve


PACKAGES = {"evfem": _evfem, "felupe": _felupe}


def run(package: str, element: str, scene: str, level: int, way: Way = GIVEN) -> dict[str, Any]:
    """Import what is needed, then run and measure."""
    solve = PACKAGES[package]()
    return measured(lambda: solve(scene, element, level, way))


if __name__ == "__main__":
    print(json.dumps(run(*sys.argv[1:4], int(sys.argv[4]), Way.of(sys.argv[5]))))
