"""The problems of the study `work_precision`, every one as a scene, and what each is judged by.

A, B, C: the press-and-slide benchmark (`peers.problem`). hover: its finger 0.25 mm above the display at 2000
V. ramp: pressed 0.5 mm, then 0 to 2000 V in ten steps. smooth, ridged: Table 2's finger pressed to 0.05 N/mm
at 1000 V in five steps and slid 0.5 mm in five, friction 0.3. Kaczmarek's law throughout.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

import evfem as ev
from evfem.scene.motion import Motion

from ..peers import problem

PROBLEMS = {
    "A": "press (A)",
    "B": "slide (B)",
    "C": "press at 1000 V (C)",
    "hover": "hover at 2000 V",
    "ramp": "voltage ramp to 2000 V",
    "smooth": "finger pad, smooth",
    "ridged": "finger pad, ridged",
}
PADS = ("smooth", "ridged")
ELEMENTS = ("q1", "q1_fbar", "q2", "q2p1")
#: gap (mm) and voltage (V) of the hovering finger, and a voltage at which `plan` takes it for rigid
GAP, HOVER_VOLTAGE, RIGID_VOLTAGE = 0.25, 2000.0, 1.0


@dataclass(frozen=True)
class Case:
    """One way to compute one problem.

    `level` of the benchmark's meshes, or the finger pad's preset; `penalty` (N/mm3) instead of
    exact contact; steps of A's to C's `press` and of the slide; `rigid`: the hovering outline does
    not deform.
    """

    problem: str
    level: int | str
    element: str = "q2p1"
    penalty: float = 0.0
    steps: int = 30
    rigid: bool = False
    press: int = 15
    tolerance: float = problem.TOLERANCE

    @property
    def variant(self) -> str:
        """What is not as recommended, or the element alone."""
        said = [f"penalty_{self.penalty:g}"] if self.penalty else []
        said += [f"{self.steps}_steps"] if self.steps != 30 else []
        said += ["rigid"] if self.rigid else []
        return "_".join([self.element, *said])

    @property
    def mesh_name(self) -> str:
        """L0 ... L3, or the preset."""
        return f"L{self.level}" if isinstance(self.level, int) else self.level

    @property
    def key(self) -> str:
        """Begin of its names among the numbers."""
        return f"{self.problem}.{self.mesh_name}.{self.variant}"


def benchmark_finger(mesh: ev.Mesh) -> ev.MeshedFinger:
    """The benchmark's finger on a mesh of it."""
    return ev.MeshedFinger(
        mesh,
        problem.MATERIALS,
        ev.Electrical(problem.STRATUM_CORNEUM.thickness, problem.STRATUM_CORNEUM.eps_r),
    )


def build(case: Case) -> ev.Scene:
    """The case as a scene."""
    solver: dict[str, Any] = {"element": case.element, "tolerance": case.tolerance}
    if case.penalty:
        solver |= {"contact": "penalty", "penalty_normal": case.penalty, "penalty_tangential": case.penalty}
    friction = 0.3 if case.problem in PADS else problem.FRICTION.get(case.problem, 0.0)
    if isinstance(case.level, int):
        finger: Any = benchmark_finger(problem.scene_mesh(case.element, case.level))
    else:
        finger = ev.FingerPad(ridges=case.problem == "ridged", resolution=case.level)
    y = problem.PLANE if case.problem in "ABC" else None
    surface = ev.Display(insulator=problem.INSULATOR, friction=friction, y=y)
    voltage, law = _voltage(case), ev.Kaczmarek() if case.problem not in "AB" else None
    how: dict[str, Any] = {"solver": ev.Solver(**solver), "output": ev.Output(every=1000)}
    return ev.Scene(finger, surface, law, voltage, _motion(case), **how)


def _voltage(case: Case) -> float:
    if case.problem == "hover":
        return RIGID_VOLTAGE if case.rigid else HOVER_VOLTAGE
    return 1000.0 if case.problem in PADS else problem.VOLTAGE.get(case.problem, 0.0)


def _motion(case: Case) -> list[Motion]:
    if case.problem == "hover":
        return [ev.Hover(gap=GAP)]
    if case.problem == "ramp":
        return [ev.Press(indentation=0.5, steps=5), ev.VoltageRamp(2000.0, steps=10)]
    if case.problem in PADS:
        return [ev.Press(force=0.05, steps=5), ev.Slide(distance=0.5, steps=5)]
    press = ev.Press(indentation=1.5, steps=case.press)
    return [press, ev.Slide(distance=3.0, steps=case.steps)] if case.problem == "B" else [press]


def forces(case: Case, result: ev.Result) -> dict[str, float]:
    """What the problem is judged by: forces in N/mm, and the pad's indentation in mm."""
    normal, tangential, pull = result.normal_force, result.tangential_force, result.electrostatic_force
    if case.problem in "AC":
        return problem.quantities(case.problem, np.stack([normal, tangential, pull], axis=1))
    if case.problem == "B":
        places = np.searchsorted(result.position[15:], np.array([0.3, 0.6, 3.0]) * (1.0 - 1e-9)) + 15
        found = {f"Fn_at_{d}": float(normal[round(10 * d) - 1]) for d in (0.5, 1.0, 1.5)}
        found |= {f"Ft_after_{result.position[i]:.1f}": float(tangential[i]) for i in places}
        return found | {"Fn_after_3.0": float(normal[-1])}
    if case.problem == "hover":
        scale = (HOVER_VOLTAGE / RIGID_VOLTAGE) ** 2 if case.rigid else 1.0
        return {"Fe": scale * float(pull[-1])}
    if case.problem == "ramp":
        at = {"1000": 9, "2000": 14}
        found = {f"Fn_at_{volts}_V": float(normal[i]) for volts, i in at.items()}
        return found | {f"Fe_at_{volts}_V": float(pull[i]) for volts, i in at.items()}
    found = {"indentation": float(result.indentation[4]), "Fe_pressed": float(pull[4])}
    found |= {"Ft_after_0.1": float(tangential[5]), "Ft_after_0.5": float(tangential[-1])}
    return found | {"Fe_slid": float(pull[-1])}
