"""What holds in every row and frame of a result, whatever the scene; each check names what is broken.

Signs and units are those of the history. `TOLERANCE` is relative to the largest force, traction or energy at
hand, well above the scene's own tolerance of the residual; forces below `FORCE` and energies below `ENERGY`
are rounding. What a check asks of a scene before it applies is said where it is made.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

import evfem as ev
from evfem.common.arrays import Floats
from evfem.simulation.history import WIDTHS
from evfem.simulation.result import COLUMNS
from evfem.terms.friction import LEAST

#: below these, N/mm and N, forces and energies are rounding: of the skin's stiffness, 1e-12 N/mm
FORCE, ENERGY = 1e-5, 1e-9
#: relative error that a correct result may have, of sums, tractions and works
TOLERANCE = 1e-6
#: mm: how deep a node may sink in, and how far a node pinned to a jump of friction may be from it
DEEPEST, NEAR = 1e-6, 1e-6
#: columns that are empty where this force is not above `LEAST`
NEEDS = {
    "friction": "normal_force",
    "stick_share": "normal_force",
    "slip_share": "normal_force",
    "apparent_friction": "applied_force",
}
#: statuses of a node in a frame
OPEN, SLIP = 0, 2
#: energies of the source's own balance
ELECTRIC = ("field_energy", "leakage_dissipation")


@dataclass(frozen=True)
class Broken:
    """An invariant that does not hold: its name, the worst row's step, and by how much of what."""

    name: str
    step: int
    value: float
    allowed: float

    def __str__(self) -> str:
        return f"{self.name} in step {self.step}: {self.value:.3g}, allowed {self.allowed:.1g}"


Found = Iterator[Broken | None]


def broken(scene: ev.Scene, result: ev.Result) -> list[Broken]:
    """Every invariant that a result breaks, each at its worst row; numbers that are not finite alone."""
    if not len(result.step):
        return []
    for checks in ((finite,), (forces, motions, penetration, energies, frames)):
        found = [one for check in checks for one in check(scene, result) if one is not None]
        if found:
            return found
    return []


def _worst(name: str, error: Any, allowed: float, step: Any) -> Broken | None:
    """The row with the largest error, if that is too large."""
    error = np.asarray(error, dtype=float)
    if not error.size or error.max() <= allowed:
        return None
    row = int(np.argmax(error))
    return Broken(name, int(step[row]), float(error[row]), allowed)


def _largest_force(result: ev.Result) -> Floats:
    """Largest force of every row (rows,)."""
    names = [name for name in COLUMNS if "force" in name]
    return np.maximum(np.abs([getattr(result, name) for name in names]).max(axis=0), FORCE)


def largest_energy(result: ev.Result) -> float:
    """Largest work or energy of a result at any time."""
    names = [name for name in COLUMNS if name.endswith(("_work", "_energy", "_dissipation"))]
    return max(float(np.abs([getattr(result, name) for name in names]).max(initial=0.0)), ENERGY)


def remainder(result: ev.Result) -> Floats:
    """Works less what is stored, moving and dissipated, over the largest of all of them (rows,)."""
    given = result.external_work + result.electrostatic_work + result.adhesive_work
    names = [name for name in COLUMNS if name.endswith(("_energy", "_dissipation"))]
    kept = [getattr(result, name) for name in names if name not in ELECTRIC]
    return (given - np.sum(kept, axis=0)) / largest_energy(result)


# -- rows


def finite(scene: ev.Scene, result: ev.Result) -> Found:
    """Every number of rows and frames, but the gaps off the pad, friction where nothing presses and, in three
    dimensions, widths.
    """
    left_out = {"motion", *(WIDTHS if result.mesh.dim == 3 else ())}
    names = [name for name in result.columns if name not in left_out]
    empty = np.zeros((len(names), len(result.step)), dtype=bool)
    for name in (name for name in names if name in NEEDS):
        empty[names.index(name)] = np.asarray(result[NEEDS[name]]) <= LEAST
    rows = ~(empty | np.isfinite([result[name] for name in names])).all(axis=0)
    steps = [int(step) for step in result.step[rows]]
    for frame in result.frames:
        fields = (frame.displacement, frame.contact_pressure, frame.shear_traction, frame.cauchy_stress)
        if not all(np.isfinite(field).all() for field in (*fields, frame.J)):
            steps.append(frame.step)
    yield Broken("finite", min(steps), float(len(steps)), 0.0) if steps else None


def forces(scene: ev.Scene, result: ev.Result) -> Found:
    """Forces balance, friction is within its cone, nothing is negative that cannot be."""
    force, energy, step = _largest_force(result), largest_energy(result), result.step
    level = scene.ground.is_flat and scene.ground.elastic is None
    if scene.solver.dynamics != "inertial":  # as a vector
        x = result.applied_tangential_force_x - result.tangential_force_x
        x += result.electrostatic_force_x + result.adhesive_force_x
        z = result.applied_tangential_force_z - result.tangential_force_z
        z += result.electrostatic_force_z + result.adhesive_force_z
        y = -result.applied_force + result.normal_force - result.electrostatic_force - result.adhesive_force
        allowed = max(TOLERANCE, 1e2 * scene.solver.tolerance)
        yield _worst("balance", np.linalg.norm([x, y, z], axis=0) / force, allowed, step)
    if level and isinstance(scene.friction_law, ev.Coulomb):
        # on a level surface the sums lie within the cone of the largest coefficient
        friction = scene.surface.friction  # type: ignore[attr-defined]
        mu = float(np.max(getattr(friction, "friction", np.atleast_2d(friction)[:, -1:])))
        beyond = np.hypot(result.tangential_force_x, result.tangential_force_z) - mu * result.normal_force
        yield _worst("cone", beyond / force, TOLERANCE, step)
    if scene.drive is None or not scene.drive.resolved:  # charges attract without voltage
        pull = np.hypot(result.electrostatic_force, result.electrostatic_force_x)
        yield _worst("no attraction", np.where(result.voltage == 0.0, pull, 0.0), 0.0, step)
    size = "area" if result.mesh.dim == 3 else "width"
    touching, whole = result[f"real_contact_{size}"], result[f"contact_{size}"]
    pushed = result.normal_force if scene.ground.is_flat else 0.0
    lowest = [np.minimum(pushed, result.electrostatic_force) / force]
    lowest.append(np.minimum(result.stored_energy, result.kinetic_energy) / energy)
    lowest.append(np.minimum(touching, whole - touching))
    yield _worst("signs", -np.min(lowest, axis=0), TOLERANCE, step)


def motions(scene: ev.Scene, result: ev.Result) -> Found:
    """What a motion asks for is there at its last step; what a slide or ramp holds, force or
    indentation, stays what it was before.
    """
    missed, drifted, force = np.zeros(len(result.step)), np.zeros(len(result.step)), _largest_force(result)
    last = np.append(np.diff(result.motion_index) > 0, len(result.step) == scene.total_steps)
    for row, index in enumerate(result.motion_index):
        motion: Any = scene.motion[index]
        load, depth = result.applied_force, result.indentation
        if last[row] and isinstance(motion, ev.Press) and motion.force is not None:
            missed[row] = abs(load[row] - motion.force) / force[row]
        elif last[row] and isinstance(motion, ev.Press):
            missed[row] = abs(depth[row] - motion.indentation)
        elif last[row] and motion.kind == "hover":
            missed[row] = abs(depth[row] + motion.gap)
        elif last[row] and motion.kind == "voltage":
            missed[row] = abs(result.voltage[row] - motion.voltage)
        if row and getattr(motion, "hold", None) == "force":
            if scene.adhesion is not None and not result.normal_force[row - 1 : row + 1].any():
                continue  # it came off, and keeps its height
            drifted[row] = abs(load[row] - load[row - 1]) / force[row]
        elif row and getattr(motion, "hold", None) == "indentation":
            drifted[row] = abs(depth[row] - depth[row - 1])
    allowed = max(TOLERANCE, 1e2 * scene.solver.tolerance)
    yield _worst("targets", missed, allowed, result.step)
    yield _worst("held", drifted, allowed, result.step)


def penetration(scene: ev.Scene, result: ev.Result) -> Found:
    """No node is below the surface by more than rounding, or than its pressure yields under a penalty."""
    deepest = np.full(len(result.step), DEEPEST)
    if scene.solver.contact == "penalty":
        assert scene.solver.penalty_normal is not None
        pressure = {frame.step: float(frame.contact_pressure.max()) for frame in result.frames}
        yielding = [pressure.get(int(step), np.inf) for step in result.step]
        # tributary lengths are those of the step before, and the gap is vertical
        deepest += 3.0 * np.array(yielding) / scene.solver.penalty_normal
    yield _worst("penetration", -result.min_gap - deepest, 0.0, result.step)


def energies(scene: ev.Scene, result: ev.Result) -> Found:
    """Dissipation never falls; works and energies add up, as far as their forces balance."""
    for name in ("friction_dissipation", "viscous_dissipation", "snap_dissipation"):
        fall = -np.diff(getattr(result, name), prepend=0.0) / largest_energy(result)
        yield _worst(f"{name} falls", fall, TOLERANCE, result.step)
    allowed = max(TOLERANCE, 1e2 * scene.solver.tolerance)
    yield _worst("books", np.abs(remainder(result)), allowed, result.step)


# -- frames


def frames(scene: ev.Scene, result: ev.Result) -> Found:
    """Contact pushes, open nodes carry nothing, no cell is inside out; shear is within the cone."""

    def worst(name: str, error: Callable[[ev.result.Frame], float], allowed: float) -> Broken | None:
        steps = [frame.step for frame in result.frames]
        return _worst(name, [error(frame) for frame in result.frames], allowed, steps)

    def carried(frame: ev.result.Frame) -> float:
        traction = np.hypot(frame.contact_pressure, frame.shear_traction)
        return _relative(np.where(frame.contact_status == OPEN, traction, 0.0), frame)

    yield worst("pull", lambda f: _relative(-f.contact_pressure, f), TOLERANCE)
    yield worst("open nodes", carried, 0.0)
    yield worst("volume", lambda f: float(-f.J.min()), 0.0)
    law = scene.friction_law
    if not (getattr(law, "timed", False) or isinstance(law, ev.SlipMemory)):  # a frame does not know the past
        allowed = max(TOLERANCE, 10.0 * scene.solver.tolerance)
        yield worst("nodal cone", lambda f: _beyond_the_cone(scene, result, f), allowed)


def _relative(values: Any, frame: ev.result.Frame) -> float:
    """The largest of these tractions (MPa) over the largest of contact or attraction."""
    largest = max(frame.contact_pressure.max(), frame.electrostatic_traction.max(), FORCE)
    return float(np.max(values, initial=0.0) / largest)


def _beyond_the_cone(scene: ev.Scene, result: ev.Result, frame: ev.result.Frame) -> float:
    """How far shear is outside the cone at any node's place; where it slips, how far from it.

    At a jump, and within a steep ramp, any coefficient within `NEAR` will do. Where coefficients are carried
    along by an elastic surface a frame does not say which, and evened pressures are not those of a law.
    """
    coulomb = isinstance(scene.friction_law, ev.Coulomb)
    if scene.ground.elastic is not None and not (coulomb and isinstance(scene.surface.friction, float)):  # type: ignore[attr-defined]
        return 0.0
    place = (result.mesh.points + frame.displacement)[:, ::2]
    shifts = [NEAR * np.array(way) for way in product((-1.0, 0.0, 1.0), repeat=place.shape[1])]
    coefficients = [scene.ground.friction_at(place + shift) for shift in shifts]
    shear, slips = np.abs(frame.shear_traction), frame.contact_status == SLIP
    p = np.maximum(frame.contact_pressure, 0.0)
    bounds = [scene.friction_law.bound(p, mu, 0.0, 0.0) for mu in coefficients]
    outside, inside = shear - np.max(bounds, axis=0), np.min(bounds, axis=0) - shear
    return _relative(np.maximum(outside, np.where(slips, inside, 0.0)), frame)
