"""The press-and-slide benchmark as every package gets it: laws, motion, what is read off, reference values.

Scene A: frictionless, indentation 0.1 ... 1.5 mm; B: friction 0.3, then 3 mm of slide in steps of 0.1 mm; C:
A under 1000 V with Kaczmarek's law, acting vertically on the current projected outline.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import evfem as ev
from evfem.common.arrays import Floats
from evfem.meshes.benchmark import benchmark_mesh

MATERIALS = {"tissue": ev.NeoHookean(E=0.05, nu=0.48), "skin": ev.NeoHookean(E=1.0, nu=0.30)}
PLANE = -6.395  # height of the rigid surface, mm
FRICTION = {"A": 0.0, "B": 0.3, "C": 0.0}
VOLTAGE = {"A": 0.0, "B": 0.0, "C": 1000.0}
STRATUM_CORNEUM, INSULATOR = ev.Layer(0.38, 1650.0), ev.Layer(0.09, 3.35)
LAYERS = ev.Layers.of(STRATUM_CORNEUM, INSULATOR)
TOLERANCE = 1e-8  # largest free residual over the largest force on the bone


@dataclass(frozen=True)
class Way:
    """How the motion is followed: steps of the press and of the slide, and the tolerance.

    >>> str(Way()), str(Way(3, 6, 1e-6))
    ('15+30', '3+6')
    """

    press: int = 15
    slide: int = 30
    tolerance: float = TOLERANCE

    def __str__(self) -> str:
        return f"{self.press}+{self.slide}"


#: as the comparison on the same nodes has it
GIVEN = Way()
#: what was converged with exact contact and quadratic elements of two packages that agree, N/mm
REFERENCE: Mapping[str, Mapping[str, float]] = {
    "A": {"Fn_at_0.5": 0.07098, "Fn_at_1.0": 0.24112, "Fn_at_1.5": 0.54337},
    "B": {"Fn_at_0.5": 0.0721, "Fn_at_1.0": 0.2556, "Fn_at_1.5": 0.6017}
    | {"Ft_after_0.1": 0.00687, "Ft_after_0.5": 0.03364, "Ft_after_3.0": 0.1564}
    | {"Fn_after_3.0": 0.5214, "Ft_mean_2_to_3": 0.1473},
    "C": {},
}
#: its uncertainty: the largest of a scene's values, %
UNCERTAINTY = {"A": 0.04, "B": 0.2}


def scene_mesh(element: str, level: int) -> ev.Mesh:
    """The nodes of a level, as linear quads for q1 and q1_fbar, else as a quarter as many quadratic ones."""
    linear = element in ("q1", "q1_fbar")
    return benchmark_mesh(level, 1 if linear else 2, same_nodes=not linear)


def write(target: Path, scene: str, element: str, level: int, way: Way = GIVEN) -> None:
    """The scene as a file of arrays, those of `apart.Problem`, for programs without evfem."""
    mesh = scene_mesh(element, level)
    lame = np.empty((2, len(mesh.cells)))
    for name, law in MATERIALS.items():
        lame[:, mesh.cells_of(name)] = np.array([[law.mu], [law.lmbda]])
    arrays: dict[str, Any] = {name: mesh.node_sets[name] for name in ("pad", "bone")}
    arrays |= {"points": mesh.points, "cells": mesh.cells, "mu": lame[0], "lmbda": lame[1]}
    arrays |= {"path": path(scene, way), "plane": PLANE, "friction": FRICTION[scene]}
    arrays |= {"pull": 0.5 * ev.eps_0 * VOLTAGE[scene] ** 2, "tolerance": way.tolerance}
    np.savez(target, layers=np.array([LAYERS.reduced, LAYERS.thickness]), **arrays)


def path(scene: str, way: Way = GIVEN) -> Floats:
    """Position and indentation of the bone (steps, 2) in mm after every step."""
    press = [[0.0, 1.5 * k / way.press] for k in range(1, way.press + 1)]
    slide = [[3.0 * k / way.slide, 1.5] for k in range(1, way.slide + 1)] if scene == "B" else []
    return np.array(press + slide)


def quantities(scene: str, history: Any, way: Way = GIVEN) -> dict[str, float]:
    """What is compared, from normal, tangential and electrostatic force (steps, 3) in N/mm."""
    normal, tangential, electrostatic = np.asarray(history, dtype=float).T
    pressed = {d: place for d in (0.5, 1.0, 1.5) if (place := _end(way.press, d / 1.5)) is not None}
    found = {f"Fn_at_{d}": normal[place] for d, place in pressed.items()}
    if scene == "B":
        slide = np.abs(tangential[way.press :])
        slid = {s: place for s in (0.1, 0.5, 3.0) if (place := _end(way.slide, s / 3.0)) is not None}
        found |= {f"Ft_after_{s}": slide[place] for s, place in slid.items()}
        found |= {"Fn_after_3.0": normal[-1]}
        if way.slide == GIVEN.slide:
            found |= {"Ft_mean_2_to_3": np.mean(slide[19:])}
    if scene == "C":
        found |= {f"Fe_at_{d}": electrostatic[place] for d, place in pressed.items()}
    return {key: float(value) for key, value in found.items()}


def _end(steps: int, share: float) -> int | None:
    """Which of the steps of a motion ends at this share of it; None where none does.

    >>> _end(15, 0.5 / 1.5), _end(6, 0.1 / 3.0)
    (4, None)
    """
    place = share * steps
    return round(place) - 1 if abs(place - round(place)) < 1e-9 else None


def errors(scene: str, found: Mapping[str, float]) -> dict[str, float]:
    """Deviation from the reference in per cent."""
    reference = REFERENCE[scene]
    return {key: 100.0 * (found[key] / reference[key] - 1.0) for key in reference if key in found}
