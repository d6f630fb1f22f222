"""The press-and-slide benchmark as every package gets it: laws, motion, what is read off,
reference values.

Scene A: frictionless, indentation 0.1 ... 1.5 mm; B: friction 0.3, then 3 mm of slide in steps of
0.1 mm; C: A under 1000 V with Kaczmarek's law, acting vertically on the current projected outline.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.electrostatics.laws import Layer, Layers, eps_0
from evfem.mesh.mesh import Mesh
from evfem.tissue.laws import NeoHookean

from ..benchmark import benchmark_mesh

SCENES = ("A", "B", "C")
MATERIALS = {"tissue": NeoHookean(E=0.05, nu=0.48), "skin": NeoHookean(E=1.0, nu=0.30)}
PLANE = -6.395  # height of the rigid surface, mm
FRICTION = {"A": 0.0, "B": 0.3, "C": 0.0}
VOLTAGE = {"A": 0.0, "B": 0.0, "C": 1000.0}
STRATUM_CORNEUM, INSULATOR = Layer(0.38, 1650.0), Layer(0.09, 3.35)
LAYERS = Layers.of(STRATUM_CORNEUM, INSULATOR)
TOLERANCE = 1e-8  # largest free residual over the largest force on the bone

#: what was converged with exact contact and quadratic elements of two packages that agree, N/mm
REFERENCE: Mapping[str, Mapping[str, float]] = {
    "A": {"Fn_at_0.5": 0.07098, "Fn_at_1.0": 0.24112, "Fn_at_1.5": 0.54337},
    "B": {
        "Fn_at_0.5": 0.0721,
        "Fn_at_1.0": 0.2556,
        "Fn_at_1.5": 0.6017,
        "Ft_after_0.1": 0.00687,
        "Ft_after_0.5": 0.03364,
        "Ft_after_3.0": 0.1564,
        "Fn_after_3.0": 0.5214,
        "Ft_mean_2_to_3": 0.1473,
    },
    "C": {},
}
#: its uncertainty: the largest of a scene's values, %
UNCERTAINTY = {"A": 0.04, "B": 0.2}


def scene_mesh(element: str, level: int) -> Mesh:
    """The nodes of a level, as linear quads for q1, as a quarter as many quadratic ones for the
    others.
    """
    return benchmark_mesh(level, 1 if element == "q1" else 2, same_nodes=element != "q1")


def write(target: Path, scene: str, element: str, level: int) -> None:
    """The scene as a file of arrays for programs without evfem; `apart.Problem` says what is in
    it.
    """
    mesh = scene_mesh(element, level)
    lame = np.empty((2, len(mesh.cells)))
    for name, law in MATERIALS.items():
        lame[:, mesh.cells_of(name)] = np.array([[law.mu], [law.lmbda]])
    np.savez(
        target,
        points=mesh.points,
        cells=mesh.cells,
        mu=lame[0],
        lmbda=lame[1],
        pad=mesh.node_sets["pad"],
        bone=mesh.node_sets["bone"],
        path=path(scene),
        plane=PLANE,
        friction=FRICTION[scene],
        pull=0.5 * eps_0 * VOLTAGE[scene] ** 2,
        layers=np.array([LAYERS.reduced, LAYERS.thickness]),
        tolerance=TOLERANCE,
    )


def path(scene: str) -> Floats:
    """Position and indentation of the bone (steps, 2) in mm after every step."""
    press = [[0.0, 0.1 * k] for k in range(1, 16)]
    slide = [[0.1 * k, 1.5] for k in range(1, 31)] if scene == "B" else []
    return np.array(press + slide)


def quantities(scene: str, history: Any) -> dict[str, float]:
    """What is compared, from normal, tangential and electrostatic force (steps, 3) in N/mm."""
    normal, tangential, electrostatic = np.asarray(history, dtype=float).T
    found = {f"Fn_at_{d}": normal[round(10 * d) - 1] for d in (0.5, 1.0, 1.5)}
    if scene == "B":
        slide = np.abs(tangential[15:])
        found |= {f"Ft_after_{s}": slide[round(10 * s) - 1] for s in (0.1, 0.5, 3.0)}
        found |= {"Fn_after_3.0": normal[-1], "Ft_mean_2_to_3": np.mean(slide[19:])}
    if scene == "C":
        found |= {f"Fe_at_{d}": electrostatic[round(10 * d) - 1] for d in (0.5, 1.0, 1.5)}
    return {key: float(value) for key, value in found.items()}


def errors(scene: str, found: Mapping[str, float]) -> dict[str, float]:
    """Deviation from the reference in per cent."""
    return {key: 100.0 * (found[key] / value - 1.0) for key, value in REFERENCE[scene].items()}
