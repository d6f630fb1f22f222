"""What holds in every row and frame of a result, whatever the scene; each check names what is
broken.

Signs and units are those of the history. `TOLERANCE` is relative to the largest force, traction or
energy at hand, well above the scene's own tolerance of the residual; forces below `FORCE` and
energies below `ENERGY` are rounding. What a check asks of a scene before it applies is said where
it is made.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.scene.motion import Press
from evfem.scene.scene import Scene
from evfem.simulation.history import WIDTHS
from evfem.simulation.result import COLUMNS, Frame, Result
from evfem.surface.friction import Coulomb

#: below these, N/mm and N, forces and energies are rounding: of the skin's stiffness, 1e-12 N/mm
FORCE, ENERGY = 1e-5, 1e-9
#: relative errors that a correct result may have: of sums and tractions, and of the works of one row
TOLERANCE, FALL = 1e-6, 1e-6
#: mm: how deep a node may sink in, and how far a node pinned to a jump of friction may be from it
DEEPEST, NEAR = 1e-6, 1e-6
#: statuses of a node in a frame
OPEN, SLIP = 0, 2


@dataclass(frozen=True)
class Broken:
    """An invariant that does not hold: its name, the worst row's step, and by how much of what."""

    name: str
    step: int
    value: float
    allowed: float

    def __str__(self) -> str:
        return f"{self.name} in step {self.step}: {self.value:.3g}, allowed {self.allowed:.1g}"


Check = Callable[[Scene, Result], "Broken | None"]
CHECKS: list[Check] = []


def check(function: Check) -> Check:
    """Decorator that adds a check."""
    CHECKS.append(function)
    return function


def broken(scene: Scene, result: Result) -> list[Broken]:
    """Every invariant that a result breaks, each at its worst row; numbers that are not finite
    alone.
    """
    if not len(result.step):
        return []
    found = finite(scene, result)
    if found is not None:
        return [found]
    return [one for one in (function(scene, result) for function in CHECKS) if one is not None]


def _worst(name: str, error: Any, allowed: float, step: Any) -> Broken | None:
    """The row with the largest error, if that is too large."""
    error = np.asarray(error, dtype=float)
    if not error.size or error.max() <= allowed:
        return None
    row = int(np.argmax(error))
    return Broken(name, int(step[row]), float(error[row]), allowed)


def _largest_force(result: Result) -> Floats:
    """Largest force of every row (rows,)."""
    names = [name for name in COLUMNS if "force" in name]
    return np.maximum(np.abs([getattr(result, name) for name in names]).max(axis=0), FORCE)


#: energies of the source's own balance
ELECTRIC = ("field_energy", "leakage_dissipation")


def _solid(result: Result) -> bool:
    """Whether the finger has three dimensions."""
    return result.mesh.dim == 3


def largest_energy(result: Result) -> float:
    """Largest work or energy of a result at any time."""
    names = [name for name in COLUMNS if name.endswith(("_work", "_energy", "_dissipation"))]
    return max(float(np.abs([getattr(result, name) for name in names]).max(initial=0.0)), ENERGY)


def remainder(result: Result) -> Floats:
    """Works less what is stored, moving and dissipated, over the largest of all of them (rows,)."""
    given = result.external_work + result.electrostatic_work
    names = [name for name in COLUMNS if name.endswith(("_energy", "_dissipation"))]
    kept = [getattr(result, name) for name in names if name not in ELECTRIC]
    return (given - np.sum(kept, axis=0)) / largest_energy(result)


# -- rows


def finite(scene: Scene, result: Result) -> Broken | None:
    """Every number of rows and frames, but the gaps off the pad and, in three dimensions, widths."""
    left_out = {"motion", *(WIDTHS if _solid(result) else ())}
    rows = ~np.isfinite([result[name] for name in result.columns if name not in left_out]).all(axis=0)
    steps = [int(step) for step in result.step[rows]]
    for frame in result.frames:
        fields = (frame.displacement, frame.contact_pressure, frame.shear_traction, frame.cauchy_stress)
        if not all(np.isfinite(field).all() for field in (*fields, frame.J)):
            steps.append(frame.step)
    return Broken("finite", min(steps), float(len(steps)), 0.0) if steps else None


@check
def balance(scene: Scene, result: Result) -> Broken | None:
    """Applied, contact and attraction forces add up to nothing, as a vector; without inertia."""
    if scene.solver.dynamics == "inertial":
        return None
    x = result.applied_tangential_force_x - result.tangential_force_x + result.electrostatic_force_x
    z = result.applied_tangential_force_z - result.tangential_force_z
    y = -result.applied_force + result.normal_force - result.electrostatic_force
    allowed = max(TOLERANCE, 1e2 * scene.solver.tolerance)
    return _worst("balance", np.hypot(np.hypot(x, z), y) / _largest_force(result), allowed, result.step)


@check
def cone(scene: Scene, result: Result) -> Broken | None:
    """On a level surface the sums lie within the cone of the largest friction coefficient."""
    if not scene.ground.is_flat or not isinstance(scene.friction_law, Coulomb):
        return None
    mu = float(np.max(np.atleast_2d(scene.surface.friction)[:, -1]))  # type: ignore[attr-defined]
    beyond = np.hypot(result.tangential_force_x, result.tangential_force_z) - mu * result.normal_force
    return _worst("cone", beyond / _largest_force(result), TOLERANCE, result.step)


@check
def targets(scene: Scene, result: Result) -> Broken | None:
    """Voltage, position, and indentation or force are exactly what the motion asks for at its last
    step.
    """
    error, force = np.zeros(len(result.step)), _largest_force(result)
    last = np.append(np.diff(result.motion_index) > 0, len(result.step) == scene.total_steps)
    allowed = max(TOLERANCE, 10.0 * scene.solver.tolerance)
    for row in np.flatnonzero(last):
        motion: Any = scene.motion[result.motion_index[row]]
        if isinstance(motion, Press) and motion.force is not None:
            error[row] = abs(result.applied_force[row] - motion.force) / force[row]
        elif isinstance(motion, Press):
            error[row] = abs(result.indentation[row] - motion.indentation)
        elif motion.kind == "hover":
            error[row] = abs(result.indentation[row] + motion.gap)
        elif motion.kind == "voltage":
            error[row] = abs(result.voltage[row] - motion.voltage)
    return _worst("targets", error, allowed, result.step)


@check
def held(scene: Scene, result: Result) -> Broken | None:
    """What a slide or ramp holds, force or indentation, stays what it was before."""
    error, force = np.zeros(len(result.step)), _largest_force(result)
    for row in range(1, len(result.step)):
        motion: Any = scene.motion[result.motion_index[row]]
        if getattr(motion, "hold", None) == "force":
            error[row] = abs(result.applied_force[row] - result.applied_force[row - 1]) / force[row]
        elif getattr(motion, "hold", None) == "indentation":
            error[row] = abs(result.indentation[row] - result.indentation[row - 1])
    return _worst("held", error, max(TOLERANCE, 10.0 * scene.solver.tolerance), result.step)


@check
def penetration(scene: Scene, result: Result) -> Broken | None:
    """No node is below the surface by more than rounding, or than its pressure yields under a
    penalty.
    """
    deepest = np.full(len(result.step), DEEPEST)
    if scene.solver.contact == "penalty":
        assert scene.solver.penalty_normal is not None
        pressure = {frame.step: float(frame.contact_pressure.max()) for frame in result.frames}
        yielding = [pressure.get(int(step), np.inf) for step in result.step]
        # tributary lengths are those of the step before, and the gap is vertical
        deepest += 3.0 * np.array(yielding) / scene.solver.penalty_normal
    return _worst("penetration", -result.min_gap - deepest, 0.0, result.step)


@check
def signs(scene: Scene, result: Result) -> Broken | None:
    """Normal force, attraction, energies and widths or areas are not negative; touching is not wider
    than contact.
    """
    force, energy = _largest_force(result), largest_energy(result)
    size = "area" if _solid(result) else "width"
    touching, whole = result[f"real_contact_{size}"], result[f"contact_{size}"]
    lowest = [
        np.minimum(result.normal_force if scene.ground.is_flat else 0.0, result.electrostatic_force) / force,
        np.minimum(result.stored_energy, result.kinetic_energy) / energy,
        np.minimum(touching, whole - touching),
    ]
    return _worst("signs", -np.min(lowest, axis=0), TOLERANCE, result.step)


@check
def no_attraction(scene: Scene, result: Result) -> Broken | None:
    """Without voltage there is no attraction, but that of charges."""
    if scene.drive is not None and scene.drive.resolved:
        return None
    off = result.voltage == 0.0
    pull = np.hypot(result.electrostatic_force, result.electrostatic_force_x)
    return _worst("no attraction", np.where(off, pull, 0.0), 0.0, result.step)


@check
def friction_work(scene: Scene, result: Result) -> Broken | None:
    """What friction dissipates never falls."""
    return _falls(result, "friction_dissipation")


@check
def viscous_work(scene: Scene, result: Result) -> Broken | None:
    """What viscosity dissipates never falls."""
    return _falls(result, "viscous_dissipation")


@check
def snap_work(scene: Scene, result: Result) -> Broken | None:
    """What snaps set free never falls."""
    return _falls(result, "snap_dissipation")


@check
def books(scene: Scene, result: Result) -> Broken | None:
    """Works, energies and dissipations add up, as far as the forces balance that they are made of."""
    allowed = max(TOLERANCE, 1e2 * scene.solver.tolerance)
    return _worst("books", np.abs(remainder(result)), allowed, result.step)


def _falls(result: Result, name: str) -> Broken | None:
    fall = -np.diff(getattr(result, name), prepend=0.0) / largest_energy(result)
    return _worst(f"{name} falls", fall, FALL, result.step)


# -- frames


def _frames(name: str, result: Result, error: Callable[[Frame], float], allowed: float) -> Broken | None:
    errors = [error(frame) for frame in result.frames]
    return _worst(name, errors, allowed, [frame.step for frame in result.frames])


def _relative(values: Any, frame: Frame) -> float:
    """The largest of these tractions (MPa) over the largest of contact or attraction."""
    largest = max(frame.contact_pressure.max(), frame.electrostatic_traction.max(), FORCE)
    return float(np.max(values, initial=0.0) / largest)


@check
def pull(scene: Scene, result: Result) -> Broken | None:
    """Contact pushes; it does not pull."""
    return _frames("pull", result, lambda f: _relative(-f.contact_pressure, f), TOLERANCE)


@check
def nodal_cone(scene: Scene, result: Result) -> Broken | None:
    """At every node of the pad shear is within the cone at its place; where it slips, on it.

    At a jump, and within a steep ramp, any coefficient within `NEAR` will do. Frames do not know
    speeds and ages.
    """
    law = scene.friction_law
    if getattr(law, "timed", False):
        return None
    points = result.mesh.points[:, 0]

    def beyond(frame: Frame) -> float:
        x = points + frame.displacement[:, 0]
        coefficients = [scene.ground.friction_coefficient(x + shift) for shift in (-NEAR, 0.0, NEAR)]
        shear, slips = np.abs(frame.shear_traction), frame.contact_status == SLIP
        p = np.maximum(frame.contact_pressure, 0.0)
        bounds = [law.bound(p, mu, 0.0, 0.0) for mu in coefficients]
        outside, inside = shear - np.max(bounds, axis=0), np.min(bounds, axis=0) - shear
        return _relative(np.maximum(outside, np.where(slips, inside, 0.0)), frame)

    return _frames("nodal cone", result, beyond, max(TOLERANCE, 10.0 * scene.solver.tolerance))


@check
def open_nodes(scene: Scene, result: Result) -> Broken | None:
    """Nodes that are open carry no contact force."""

    def carried(frame: Frame) -> float:
        traction = np.hypot(frame.contact_pressure, frame.shear_traction)
        return _relative(np.where(frame.contact_status == OPEN, traction, 0.0), frame)

    return _frames("open nodes", result, carried, 0.0)


@check
def volume(scene: Scene, result: Result) -> Broken | None:
    """No cell is turned inside out."""
    return _frames("volume", result, lambda f: float(-f.J.min()), 0.0)
