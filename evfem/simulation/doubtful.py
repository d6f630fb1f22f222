"""Warnings of a run about its numbers, one sentence each: `Result.warnings`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.scene.scene import Scene
from evfem.simulation.history import Row
from evfem.simulation.model import Model
from evfem.surface.pad import surface_state

#: share of the energy of motions that take time that their finite steps may dissipate
DISSIPATED = 0.05
#: share of the energy of a run that a row may have from nowhere
GAINED = 0.01
#: share of the energy of a run that is lost in one row where other states are stable too
SNAPPED = 0.1
#: pressure (MPa) that no fingertip bears: pressing on one begins to hurt at 0.3 to 0.6 MPa over a square
#: centimetre (algometers), and the crests of its ridges carry twice the mean
BORNE = 1.0


#: penetration that is told, relative to the size of the finger
SUNK = 1e-6


def outside(model: Model) -> Ints:
    """Nodes of the finger's boundary that no contact holds: all but those of `pad` that may touch."""
    mesh, pad = model.mesh, model.pad
    facets = mesh.outer_edges if mesh.dim == 2 else mesh.outer_faces
    return np.setdiff1d(facets, pad.nodes[pad.free])


def deepest(model: Model, nodes: Ints, u: Floats) -> Floats:
    """Largest penetration (mm) of these nodes into the surface, and the number of that node: (2,)."""
    gap = surface_state(model.surface, (model.mesh.points + u)[nodes]).gap
    return np.array([-gap.min(), nodes[gap.argmin()]], dtype=float) if gap.size else np.zeros(2)


def through(model: Model, sunk: Floats) -> Iterator[str]:
    """A boundary outside `pad` that went through the surface; `sunk` is the `deepest` of a run."""
    points = model.mesh.points
    if sunk[0] > SUNK * float(np.ptp(points, axis=0).max()):
        place = ", ".join(f"{x + 0.0:.4g}" for x in points[int(sunk[1])])
        yield (
            f"the boundary outside `pad` passed through the surface, by {sunk[0]:.3g} mm at ({place}) of the "
            "undeformed mesh: nothing holds it there, and contact forces are too small; extend `pad`"
        )


def doubtful(scene: Scene, rows: Sequence[Row]) -> list[str]:
    """A sentence for everything that the rows of a scene's run say of their own worth."""
    told = (
        _missed(scene, rows),
        _crushed(scene, rows),
        _dissipated(scene, rows),
        _gained(rows),
        _snapped(rows),
        _climbed(rows),
    )
    return [sentence for one in told for sentence in one] if rows else []


def _column(rows: Sequence[Row], name: str) -> Floats:
    return np.array([row[name] for row in rows], dtype=float)


def _missed(scene: Scene, rows: Sequence[Row]) -> Iterator[str]:
    """Slides that touch nothing, unless on the way to where the finger is pressed."""
    for i, course in enumerate(scene.courses):
        forces = [row["normal_force"] for row in rows if row["motion_index"] == i]
        later = any(one.presses for one in scene.courses[i:])
        if course.distance and forces and not any(forces) and not later:
            yield f"motion {i}, a slide, never touched"


def _crushed(scene: Scene, rows: Sequence[Row]) -> Iterator[str]:
    """An attraction that is larger than the load, or presses as no fingertip can be pressed."""
    names = ("electrostatic_force", "applied_force", "normal_force", "peak_contact_pressure")
    pull, load, normal, peak = (_column(rows, name) for name in names)
    pull, unit = np.where(normal > 0.0, pull, 0.0), "N" if "contact_area" in rows[0] else "N/mm"
    if not pull.any():
        return
    first, worst, most = int(np.argmax(pull)), int(np.argmax(np.where(pull > 0.0, peak, 0.0))), load.max()
    if any(course.presses for course in scene.courses) and pull[first] > max(most, 0.0):
        times = f"{pull[first] / most:.3g} times the load, " if most > 0.0 else "more than the load, "
        yield (
            f"the attraction, {pull[first]:.3g} {unit} in step {rows[first]['step']}, is {times}"
            f"which is {most:.3g} {unit} at most"
        )
    if peak[worst] > BORNE:
        yield (
            f"the skin is pressed with up to {peak[worst]:.3g} MPa under its attraction "
            f"(step {rows[worst]['step']}), and no fingertip bears {BORNE:g} MPa"
        )


def _lost(rows: Sequence[Row], name: str) -> Floats:
    """Increments (r,) of a column of dissipation."""
    return np.diff(_column(rows, f"{name}_dissipation"), prepend=0.0)


def _energy(rows: Sequence[Row]) -> float:
    """Largest stored energy plus all dissipation."""
    stored = (_column(rows, "stored_energy") + _column(rows, "kinetic_energy")).max()
    return (
        1e-300
        + float(stored)
        + sum(float(np.abs(_lost(rows, name)).sum()) for name in ("friction", "viscous", "snap"))
    )


def _gained(rows: Sequence[Row]) -> Iterator[str]:
    """A row whose works lack energy."""
    own = _lost(rows, "integrator")
    if own.min() < -GAINED * _energy(rows):
        worst = int(own.argmin())
        yield (
            f"step {rows[worst]['step']} has {-own[worst] / _energy(rows):.1%} of the energy of the run from "
            "nowhere (integrator_dissipation): its works are known at its ends alone, or it went over a "
            "barrier; take more steps there"
        )


def _snapped(rows: Sequence[Row]) -> Iterator[str]:
    """A row in which an attracted finger sets much of the run's energy free."""
    freed = np.where(_column(rows, "electrostatic_force") > 0.0, _lost(rows, "snap"), 0.0) / _energy(rows)
    if freed.max() > SNAPPED:
        worst = int(freed.argmax())
        yield (
            f"in step {rows[worst]['step']} the finger snaps and loses {freed[worst]:.0%} of the energy of "
            "the run: other states are stable too, and the way decides which; `evfem check` compares"
        )


def _climbed(rows: Sequence[Row]) -> Iterator[str]:
    """Rows in time that a barrier of the energy does not stop however short their parts are."""
    climbed = (np.diff(_column(rows, "time"), prepend=0.0) > 0.0) & (_column(rows, "jumps") > 0.0)
    if climbed.any():
        first, count = rows[int(climbed.argmax())]["step"], int(climbed.sum())
        yield (
            f"{count} steps in time, the first of them step {first}, pass a barrier of the energy that their "
            "speed does not carry them over: shorter steps may end elsewhere"
        )


def _dissipated(scene: Scene, rows: Sequence[Row]) -> Iterator[str]:
    """Steps in time that dissipate by themselves."""
    hand = scene.hand is not None and scene.hand.timed
    if not scene.solver.timed and not hand:
        return
    timed = np.diff(_column(rows, "time"), prepend=0.0) > 0.0
    own, energy = float(np.abs(_lost(rows, "integrator")[timed]).sum()), _energy(rows)
    if own > DISSIPATED * energy:
        yield (
            f"the steps in time dissipate {own / energy:.0%} of the energy that is stored or dissipated by "
            "themselves (integrator_dissipation): take shorter ones"
        )
