"""Scenes that must give the same as another: the mirrored one, and where no path counts, half the
steps.
"""

from __future__ import annotations

import numpy as np

from evfem.scene.scene import Scene
from evfem.simulation.result import Result

from .invariants import FORCE, Broken, largest_energy

#: columns that are compared, and which of them change sign in a mirror
ODD = ("position", "tangential_force_x", "applied_tangential_force_x", "electrostatic_force_x")
COMPARED = (*ODD, "indentation", "normal_force", "applied_force", "electrostatic_force")
#: those of a finger in three dimensions too
ALONG = ("position_z", "tangential_force_z", "applied_tangential_force_z")
#: relative differences that two correct results may have
MIRRORED, HALVED = 1e-4, 1e-5
#: shares of the largest energy that snaps may set free, and that a step in time may lack, without a
#: snap
SNAP, LACK = 1e-4, 1e-2


def smooth(result: Result) -> bool:
    """Whether a run took every step whole and nothing in it snapped.

    Beyond a cut or a snap the way of the iterations decides which of several equilibria is found.
    With time the integrator's books show a snap: a state was reached without the energy for it.
    """
    energy = largest_energy(result)
    lacking = float(-np.diff(result.integrator_dissipation, prepend=0.0).min()) / energy
    free = float(result.snap_dissipation[-1]) / energy
    return int(result.provenance["solver"]["cuts"]) == 0 and free < SNAP and lacking < LACK


def free_of_path(scene: Scene) -> bool:
    """Whether the end of a scene does not depend on the steps towards it.

    Friction, time, penalties (whose nodes yield by the lengths of the step before) and charges that
    move in time make it depend on them, and so do attractions that lag behind by a step.
    """
    return (
        not scene.has_friction
        and scene.solver.dynamics == "quasistatic"
        and scene.solver.contact == "exact"
        and scene.air_layer
        and not (scene.drive is not None and scene.drive.resolved)
        and scene.coupling != "staggered_once"
    )


def mirror_broken(one: Result, other: Result) -> Broken | None:
    """Whether the rows of the mirrored scene are those of the scene."""
    if len(one.step) != len(other.step):
        return Broken("mirror", int(min(len(one.step), len(other.step))) + 1, 1.0, 0.0)
    scale, rows = _scale(one), []
    for name in (*COMPARED, *(name for name in ALONG if name in one.columns)):
        sign = -1.0 if name in ODD else 1.0
        apart = np.abs(getattr(one, name) - sign * getattr(other, name))
        rows.append(apart / (scale if "force" in name else 1.0))
    worst = np.max(rows, axis=0)
    row = int(np.argmax(worst))
    return Broken("mirror", row + 1, float(worst[row]), MIRRORED) if worst[row] > MIRRORED else None


def steps_broken(one: Result, other: Result) -> Broken | None:
    """Whether the last row of the scene with half the steps is that of the scene."""
    names = [name for name in COMPARED if "force" in name]
    apart = max(abs(float(getattr(one, name)[-1] - getattr(other, name)[-1])) for name in names)
    value = apart / _scale(one)
    return Broken("half the steps", len(one.step), value, HALVED) if value > HALVED else None


def _scale(result: Result) -> float:
    names = ("normal_force", "applied_force", "electrostatic_force", "tangential_force_x")
    return max(FORCE, *(float(np.abs(getattr(result, name)).max(initial=0.0)) for name in names))
