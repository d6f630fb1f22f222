r"""What a mean over the cycle leaves out of friction: swings of the attraction within which a pad sticks.

The mean takes friction as that of the mean attraction. A pad that is slid by v and has no inertia is a
spring of the stiffness k under the bound :math:`b(t)`, which the swing raises and lowers: friction falls with
the bound, but rises by no more than the pad is stretched,

.. math:: F(t) = \min(b(t), F(t - dt) + k\,v\,dt).

Its mean is that of b where k v exceeds the steepest rise of the bound, and less elsewhere. Under a
`SlipMemory` the bound follows what it would be over the length of slip, of which there is none while the pad
sticks. Inertia holds the pad, which then sticks less: the mean lies between the two. k is the steepest rise
of friction over the distance slid in the rows of a run: in long steps it is too small, and so is the mean.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from evfem.circuit.load import smallest_gap
from evfem.common.arrays import Floats
from evfem.electrostatics.localgaps import roughness_below
from evfem.electrostatics.timesignals import Carrier
from evfem.newton.state import FORCES
from evfem.scene.scene import Scene
from evfem.surface.friction import Coulomb, SlipMemory

#: moments of a cycle; most cycles until they repeat, and to what
MOMENTS, CYCLES, REPEATS = 256, 200, 1e-5
#: iterations for the end of a snap
SNAPS = 30
#: fraction of the friction by the attraction that may be missing without a sentence
MISSING = 0.1
#: fraction of a contact that slips where friction is at its bound
SLIPS = 0.9
Rows = Sequence[Mapping[str, Any]]


def swings(scene: Scene, rows: Rows) -> Iterator[str]:
    """A sentence if friction took the mean of a swing within which a pad without inertia sticks, for the step
    of a run where most is missing.
    """
    own: Any = scene.voltage
    carried = isinstance(own, Carrier) and not own.resolved
    if not (rows and scene.has_friction and (carried or scene.electrics.alternates)):
        return
    at = float(own.frequency if carried else scene.electrics.frequency)  # type: ignore[arg-type]
    speeds, stiffness = _course(scene, rows)
    most, told = MISSING, ""
    for k, added in _highest(scene, rows, speeds).items():
        row, friction = rows[k], _size(rows[k])
        bound = friction + added * (_swing(scene, row, carried) - 1.0)
        travel = float(speeds[k]) / (at * MOMENTS)
        found = spring_mean(
            bound, stiffness * travel, _memory(scene.friction_law, travel, 1.0 / (at * MOMENTS))
        )
        if (friction - found) / added > most:
            most, unit = (friction - found) / added, FORCES[3 if "contact_area" in row else 2]
            told = (
                f"step {row['step']}: the friction of {friction:.4g} {unit} is that of the mean attraction, "
                f"which swings; a pad without inertia sticks within each swing, with a mean as low as "
                f'{found:.4g} {unit}: drive = "resolved" with dynamics = "inertial" says where between'
            )
    yield from [told] if told else []


def spring_mean(bound: Floats, rise: float, memory: tuple[float, float] | None = None) -> float:
    """Mean over a cycle of the friction of a spring, from its bounds (k,) at equal times and what stretching
    adds from one to the next; `memory`: slip and time between them over those in which a bound follows.

    >>> spring_mean(np.array([1.0, 2.0, 3.0, 2.0]), 1.0), spring_mean(np.array([1.0, 2.0, 3.0, 2.0]), 0.0)
    (2.0, 1.0)
    """
    force, limit, mean = float(bound.min()), float(bound.mean()), math.nan
    for _ in range(CYCLES):
        total, before = 0.0, mean
        for level in bound.tolist():
            ahead = force + rise
            limit = level if memory is None else _renewed(limit, level, ahead - limit, rise, memory)
            force = min(ahead, limit)
            total += force
        mean = total / len(bound)
        if abs(mean - before) <= REPEATS * abs(mean):
            break
    return mean


def _renewed(limit: float, level: float, over: float, rise: float, memory: tuple[float, float]) -> float:
    """A bound after a moment in which a spring would be `over` it, and the bound without memory is `level`.

    A bound that falls lets the spring go, whose slip renews it further: beyond the spring's force over the
    length of the memory it snaps, to where both agree again.
    """
    limit += (level - limit) * -math.expm1(-memory[1])
    if over <= 0.0 or rise == 0.0:
        return limit
    unit = rise / memory[0]
    excess = (limit - level) / unit
    if excess < 1.0:
        return limit + (level - limit) * -math.expm1(-memory[0] * over / rise / (1.0 - excess))
    slip = excess
    for _ in range(SNAPS):
        slip = excess * -math.expm1(-slip)
    return limit - unit * slip


def _course(scene: Scene, rows: Rows) -> tuple[Floats, float]:
    """Speeds (rows,) in mm/s, 0 without time, and the steepest rise of friction over the distance, per mm."""
    position, force = (
        np.array([_along(row, name) for row in rows]) for name in ("position", "tangential_force")
    )
    moved, time = np.diff(position, axis=0), np.diff([float(row["time"]) for row in rows], prepend=0.0)
    travel = np.append(np.hypot(*position[0]), np.hypot(*moved.T))
    if scene.hand is not None:  # its own position lags behind the one that is prescribed
        courses = [(abs(one.course.distance), one.steps) for one in scene.motion]
        travel = np.array([courses[row["motion_index"]] for row in rows]) @ [1.0, 0.0]
        travel = travel / [courses[row["motion_index"]][1] for row in rows]
    speeds = np.where(time > 0.0, travel / np.where(time > 0.0, time, 1.0), 0.0)
    there = (np.hypot(*moved.T) > 0.0) & (travel[1:] > 0.0)
    heading = moved[there] / np.hypot(*moved[there].T)[:, None]
    rises = np.sum(np.diff(force, axis=0)[there] * heading, axis=1) / travel[1:][there]
    return speeds, float(rises.max(initial=0.0))


def _highest(scene: Scene, rows: Rows, speeds: Floats) -> dict[int, float]:
    """The row of each motion in which a pad that slips has most friction by the attraction, and how much."""
    found: dict[Any, tuple[float, int]] = {}
    for k, row in enumerate(rows):
        if speeds[k] > 0.0 and row.get("slip_share", 0.0) >= SLIPS and row["normal_force"] > 0.0:
            found.setdefault(row["motion_index"], (0.0, k))
            found[row["motion_index"]] = max(found[row["motion_index"]], (_added(scene, row, speeds[k]), k))
    return {k: added for added, k in found.values() if added > 0.0}


def _added(scene: Scene, row: Mapping[str, Any], speed: float) -> float:
    """What the attraction adds to the friction of a row, by the law at the mean pressure."""
    law: Any = scene.friction_law
    law = law.friction if isinstance(law, SlipMemory) else law
    fraction = float(row["electrostatic_force"]) / float(row["normal_force"])
    if not (isinstance(law, (Coulomb, float)) or fraction >= 1.0):
        pressure = float(row["mean_contact_pressure"]) * np.array([1.0 - fraction, 1.0])
        position = np.array([_along(row, "position")])
        mu = scene.ground.friction_at(position if "contact_area" in row else position[:, :1])
        least, bound = (float(one) for one in law.bound(pressure, float(np.ravel(mu)[0]), speed, 0.0))
        fraction = 1.0 - least / bound if bound > 0.0 else 0.0
    return _size(row) * fraction


def _swing(scene: Scene, row: Mapping[str, Any], carried: bool) -> Floats:
    """The attraction (MOMENTS,) over a cycle, relative to its mean: the square of the voltage of a gap."""
    if carried:
        return 1.0 - np.cos(4.0 * np.pi * np.arange(MOMENTS) / MOMENTS)
    seen = scene.electrics
    gap = smallest_gap(row, roughness_below(*seen.attraction, scene.roughness_gap))
    across = seen.period_across(np.array([max(gap, 1e-6)]))[:, 0]
    squared = across[:: len(across) // MOMENTS] ** 2
    return squared / squared.mean() if squared.any() else np.ones(MOMENTS)


def _memory(law: Any, travel: float, seconds: float) -> tuple[float, float] | None:
    return (travel / law.length, seconds / law.time) if isinstance(law, SlipMemory) else None


def _along(row: Mapping[str, Any], name: str) -> tuple[float, float]:
    """Components of a column along the surface."""
    return float(row.get(f"{name}_x", row[name])), float(row.get(f"{name}_z", 0.0))


def _size(row: Mapping[str, Any]) -> float:
    """The friction force of a row."""
    return float(np.hypot(*_along(row, "tangential_force")))
