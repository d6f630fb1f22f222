"""The runs of the study `work_precision`: which, and how each is measured.

Every run counts from the mesh to the last step, without imports, in CPU seconds of one process
that has run everything once on the coarsest mesh; cheap runs are repeated and the least counts.
"""

import gc
import time
from collections.abc import Callable
from dataclasses import dataclass

from evfem.electrostatics.forces import EllipsoidalPad, pad_force_per_depth, plate_force
from evfem.electrostatics.laws import Kaczmarek
from evfem.meshes.benchmark import OUTER

from ..peers.problem import LAYERS
from .scenes import ELEMENTS, GAP, HOVER_VOLTAGE, PADS, Case, build, forces

#: N/mm3: soft, and about as stiff as penalty codes take it
PENALTIES = (100.0, 10_000.0)
#: steps of the slide in B, whose own limit is extrapolated from the last two
STEPS = (10, 30, 60, 120)
#: runs shorter than this are repeated (CPU s)
SHORT, ROUNDS = 1.2, 3
#: evaluations of a closed form
REPEATS = 200
_FINGERS = ("A", "B", "C", "hover", "ramp")


@dataclass(frozen=True)
class Run:
    """A case, its CPU seconds, outer iterations, factorisations and nodes, and what it is judged by."""

    case: Case
    cpu_s: float
    iterations: int
    factorisations: int
    nodes: int
    forces: dict[str, float]


def warm_up() -> None:
    """Import and compile what the cases need, for every element."""
    from evfem.simulation.run import simulate

    for element in ELEMENTS:
        simulate(build(Case("hover", 0, element)))


def measure(case: Case, rounds: int = ROUNDS) -> Run:
    """Run a case so many times, or until it takes long, and keep the least."""
    from evfem.simulation.run import simulate

    least = float("inf")
    for _ in range(rounds):
        gc.collect()
        begin = time.process_time()
        result = simulate(build(case))
        least = min(least, time.process_time() - begin)
        if least > SHORT:
            break
    record, nodes = result.provenance["solver"], len(result.mesh.points)
    return Run(case, least, record["iterations"], record["factorisations"], nodes, forces(case, result))


def measured(cases: list[Case], rounds: int) -> list[Run]:
    """The runs, in a process that has compiled what they need."""
    warm_up()
    return [measure(case, rounds) for case in cases]


def models() -> dict[str, tuple[float, float]]:
    """CPU seconds and attraction (N/mm) of the hovering finger without a mesh: a plate as wide as the
    finger, equation (7), and the traction over the ellipse, equation (8b).
    """
    width, height = 2.0 * OUTER[0], 2.0 * OUTER[1]
    law, pad, at = Kaczmarek(), EllipsoidalPad(width, height, 1.0), (GAP, HOVER_VOLTAGE, LAYERS)
    forms: dict[str, Callable[[], float]] = {
        "closed_form_plate": lambda: float(plate_force(law, width, *at)),
        "outline_quadrature": lambda: float(pad_force_per_depth(law, pad, *at)),
    }
    found = {}
    for key, force in forms.items():
        value, begin = force(), time.process_time()
        for _ in range(REPEATS):
            force()
        found[key] = ((time.process_time() - begin) / REPEATS, value)
    return found


def full() -> list[Case]:
    """All cases, the coarsest meshes first, so that everything is compiled when times count."""
    cases = [Case(problem, level, e) for level in (0, 1) for problem in _FINGERS for e in ELEMENTS]
    cases += [Case("A", 2, "q1"), *(Case(problem, 2) for problem in _FINGERS)]
    cases += [Case("hover", level, rigid=True) for level in (0, 1, 2)]
    cases += [Case(problem, 1, penalty=penalty) for problem in "AB" for penalty in PENALTIES]
    cases += [Case("B", 0, steps=steps) for steps in STEPS if steps != 30]
    cases += [Case(pad, "coarse", e) for pad in PADS for e in ELEMENTS]
    cases += [Case(pad, "medium", e) for pad in PADS for e in ("q1_fbar", "q2p1")]
    cases += [Case(pad, preset) for preset in ("paper", "fine") for pad in PADS]
    return cases


def quick() -> list[Case]:
    """What tests need: every kind of case, on the coarsest mesh."""
    cases = [Case(problem, 0, element) for problem in ("A", "hover") for element in ("q1", "q2p1")]
    cases += [Case("A", 1), Case("hover", 1), Case("C", 0)]
    cases += [Case("A", 0, penalty=penalty) for penalty in PENALTIES]
    return [*cases, Case("hover", 0, rigid=True)]
