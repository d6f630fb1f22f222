"""What the peers share that run in an interpreter without evfem: the problem's file, contact at a
node, Newton's iterations, the measured run. Only numpy and the standard library; imported as a
plain module by the scripts beside it.
"""

import json
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

#: N/mm per mm of penetration or elastic slip, and node
PENALTY = 1000.0
MOST_ITERATIONS = 40
SMALLEST_FORCE = 1e-6  # N/mm, below which forces are no measure
ROUNDING = 1e-9  # a node this close to sliding goes on sliding


@dataclass(frozen=True)
class Problem:
    """The benchmark's scene as `problem.write` leaves it: one array for each field.

    Points (N, 2) in mm, cells (E, 4|9) with corners first and counterclockwise, Lame's constants (E,) in MPa,
    nodes that may touch, nodes that are held, the path (steps, 2) of the bone in mm; `pull` is eps_0 U^2 / 2
    in N, `layers` the two lengths of Kaczmarek's law p = pull / ((g + near)(g + far)) in mm.
    """

    points: Any
    cells: Any
    mu: Any
    lmbda: Any
    pad: Any
    bone: Any
    path: Any
    plane: float
    friction: float
    pull: float
    layers: Any
    tolerance: float

    @property
    def order(self) -> int:
        """1 for linear, 2 for quadratic elements."""
        return 1 if self.cells.shape[1] == 4 else 2

    @property
    def free_pad(self) -> Any:
        """The nodes of the outline that are not held."""
        return np.setdiff1d(self.pad, self.bone)


def read(path: str) -> Problem:
    """A problem from its file."""
    with np.load(path, allow_pickle=False) as data:
        return Problem(**{name: data[name] if data[name].ndim else float(data[name]) for name in data.files})


class PenaltyContact:
    """Nodal penalty against a rigid plane, and Coulomb friction by return mapping on an elastic slip.

    An open node remembers where it was at the end of the last converged step, a touching one where its
    tangential spring is relaxed.
    """

    def __init__(self, x: Any, plane: float, friction: float) -> None:
        self.plane, self.friction = plane, friction
        self.reference = self.relaxed = np.array(x)
        self.sliding = np.zeros(len(x))
        self.turning = np.zeros(len(x), dtype=bool)
        self.pressed = self.dragged = np.zeros(len(x))

    def update(self, x: Any, y: Any) -> None:
        """Forces on the nodes at these places: `pressed` upwards, `dragged` against the motion (N/mm).

        A node that slid one way in the last iteration does not slide the other way in this one: it sticks
        first, beyond the limit if need be. Plain return mapping would jump between both for ever.
        """
        self.pressed = PENALTY * np.maximum(self.plane - y, 0.0)
        trial, limit = PENALTY * (x - self.reference), self.friction * self.pressed
        direction = np.sign(trial) * (np.abs(trial) > limit * (1.0 - ROUNDING))
        self.turning = direction * self.sliding < 0.0
        self.sliding = np.where(self.turning, 0.0, direction) * (limit > 0.0)
        self.dragged = np.where(self.sticking, trial, self.sliding * limit)
        self.relaxed = x - self.dragged / PENALTY

    @property
    def touching(self) -> Any:
        """Which nodes touch."""
        return self.pressed > 0.0

    @property
    def sticking(self) -> Any:
        """Which nodes touch, with friction, and do not slide."""
        return (self.sliding == 0.0) & (self.friction * self.pressed > 0.0)

    def keep(self) -> None:
        """Remember the converged state of friction."""
        self.reference = self.relaxed

    @property
    def forces(self) -> tuple[float, float]:
        """Normal and tangential force in N/mm."""
        return float(self.pressed.sum()), float(self.dragged.sum())


def newton(
    residual: Callable[[], float], correct: Callable[[bool], None], contact: PenaltyContact, tolerance: float
) -> int:
    """Correct, the first time with True, until the residual is small and no node turns round; then the state
    of friction is kept. The number of iterations; raises RuntimeError after `MOST_ITERATIONS`.
    """
    for iteration in range(1, MOST_ITERATIONS + 1):
        correct(iteration == 1)
        error = residual()
        if error <= tolerance and not contact.turning.any():
            contact.keep()
            return iteration
    raise RuntimeError(f"no equilibrium after {MOST_ITERATIONS} iterations, residual {error:.1e}")


def followed(peer: Any) -> dict[str, Any]:
    """Forces (N/mm) after every step, and the iterations they took, each with a factorisation."""
    history, iterations = [], 0
    for place in peer.problem.path:
        iterations += peer.move(*place)
        history.append(peer.forces)
    return {"history": history, "iterations": iterations, "factorisations": iterations}


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


def measured(solve: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """What `solve` finds, with CPU and wall seconds, the CPU seconds of the whole process so far,
    and memory before and at its largest.

    Compilers that `solve` starts count.
    """
    imported = resident_MB()
    wall, cpu = time.perf_counter(), cpu_seconds()
    found = solve()
    end = cpu_seconds()
    found |= {"cpu_s": end - cpu, "wall_s": time.perf_counter() - wall, "process_cpu_s": end}
    return found | {"imported_MB": imported, "peak_MB": resident_MB()}


def cpu_seconds() -> float:
    """CPU seconds of this process and of its finished children."""
    import os

    times = os.times()
    return time.process_time() + times.children_user + times.children_system


def main(solve: Callable[[Problem], dict[str, Any]], versions: dict[str, str]) -> None:
    """Solve the problem whose file the command line names; print what was found as a line of JSON."""
    found = measured(lambda: solve(read(sys.argv[1])))
    print(json.dumps(found | {"versions": versions}))
