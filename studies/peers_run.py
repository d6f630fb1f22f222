"""One measured run of the press-and-slide benchmark: `python -m evfem.studies.peers_run evfem q1 A 1`.

Prints a line of JSON: forces after every step, iterations, CPU and wall seconds from the mesh to the last
step without the imports, resident memory (MB) after the imports and at its largest.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from evfem.fingerpad import Electrical, MeshedFinger
from evfem.scene import Output, Press, Scene, Slide, Solver
from evfem.surfaces import Display

from .peers_problem import (
    FRICTION,
    INSULATOR,
    MATERIALS,
    PLANE,
    STRATUM_CORNEUM,
    TOLERANCE,
    VOLTAGE,
    scene_mesh,
)

#: what evfem would import while it runs, and what more with its extra `fast`
LATE = ("evfem.model", "evfem.scenefile", "skfem", "tqdm.auto", "scipy.sparse.linalg")
FAST = ("evfem.kernels", "pypardiso")


def evfem_scene(scene: str, element: str, level: int) -> Scene:
    """The scene for evfem."""
    from evfem.electrostatics import Kaczmarek

    electrical = Electrical(STRATUM_CORNEUM.thickness, STRATUM_CORNEUM.eps_r)
    finger = MeshedFinger(scene_mesh(element, level), MATERIALS, electrical)
    surface = Display(insulator=INSULATOR, friction=FRICTION[scene], y=PLANE)
    motion: list[Any] = [Press(indentation=1.5, steps=15)]
    if scene == "B":
        motion.append(Slide(distance=3.0, steps=30))
    law = Kaczmarek() if VOLTAGE[scene] else None
    solver, output = Solver(element=element, tolerance=TOLERANCE), Output(every=1000)
    return Scene(finger, surface, law, VOLTAGE[scene], motion, solver=solver, output=output)


def _evfem() -> Callable[[str, str, int], dict[str, Any]]:
    for name in LATE + (FAST if find_spec("numba") and find_spec("pypardiso") else ()):
        import_module(name)
    from evfem.simulate import simulate

    def solve(scene: str, element: str, level: int) -> dict[str, Any]:
        result = simulate(evfem_scene(scene, element, level))
        columns = (result.normal_force, result.tangential_force, result.electrostatic_force)
        record = result.provenance["solver"]
        history = [list(map(float, row)) for row in zip(*columns, strict=True)]
        return {"history": history} | {key: record[key] for key in ("iterations", "factorisations")}

    return solve


def _felupe() -> Callable[[str, str, int], dict[str, Any]]:
    from .peers_felupe import solve

    return solve


PACKAGES = {"evfem": _evfem, "felupe": _felupe}


def resident_MB() -> float:
    """The largest resident memory of this process so far.

    Linux's own mark of the process where there is one: `ru_maxrss` starts at the mark of the parent.
    """
    status = Path("/proc/self/status")
    if status.exists():
        for line in status.read_text().splitlines():
            if line.startswith("VmHWM:"):
                return float(line.split()[1]) / 1024.0
    import resource

    unit = 1024.0**2 if sys.platform == "darwin" else 1024.0
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit


def measured(package: str, element: str, scene: str, level: int) -> dict[str, Any]:
    """Run and measure."""
    solve = PACKAGES[package]()
    imported = resident_MB()
    wall, cpu = time.perf_counter(), time.process_time()
    found = solve(scene, element, level)
    found |= {"cpu_s": time.process_time() - cpu, "wall_s": time.perf_counter() - wall}
    return found | {"imported_MB": imported, "peak_MB": resident_MB()}


if __name__ == "__main__":
    print(json.dumps(measured(*sys.argv[1:4], int(sys.argv[4]))))
