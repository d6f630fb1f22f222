"""Warnings about the numbers of a run, one sentence each (`Result.warnings`); reasons and suggestions for a
step that failed: the force that causes the loss of stability, where, and what to try.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.common.constants import CRITICAL, SMALLEST_FORCE, SOFTENED
from evfem.errors import InputError
from evfem.newton.control import Target
from evfem.newton.state import FORCES, Collapsed, Folded, LiftedOff, State, StepFailed
from evfem.planning.parts import COMPLEX_SAFE, lost_derivatives
from evfem.planning.plausibility import weakens
from evfem.planning.rooms import rooms_of
from evfem.planning.swings import swings
from evfem.scene.scene import Scene
from evfem.simulation.history import Row
from evfem.simulation.model import Model
from evfem.surface.pad import surface_state
from evfem.terms.hand import drive_of
from evfem.tissue.forms import deformation_gradient, embed
from evfem.tissue.splitlaw import UserLaw

#: fraction of the energy of motions in time that numerical dissipation may take
DISSIPATED = 0.05
#: fraction of the energy of a run that a row may create
GAINED = 0.01
#: fraction of the works below the tolerance of an equilibrium
OPEN_WORK = 1e-7
#: fraction of the energy of a run that is lost in one row where other states are stable too
SNAPPED = 0.1
#: fraction by which a pull-off force may be larger than it is said to be
NARROW = 0.02
#: strain to which an elastic surface is taken as linear
STRAINED = 0.1
#: pressure (MPa) that no fingertip bears: pressing on one begins to hurt at 0.3 to 0.6 MPa over a square
#: centimetre (algometers), and the crests of its ridges carry twice the mean
BORNE = 1.0


#: points of the largest strain where materials of one's own are tried after a run
STRAINED_POINTS = 32
#: units of works by dimension
WORKS = {2: "N mm/mm", 3: "N mm"}
#: penetration that is worth a warning, relative to the size of the finger
SUNK = 1e-6
#: beyond so many rows that miss a wish one sentence tells them all
MANY = 3


def free_nodes(model: Model) -> Ints:
    """Nodes of the finger's boundary without contact: all but those of `pad` that may touch."""
    mesh, pad = model.mesh, model.pad
    facets = mesh.outer_sides
    return np.setdiff1d(facets, pad.nodes[pad.free])


def deepest_penetration(model: Model, nodes: Ints, u: Floats) -> Floats:
    """Largest penetration (mm) of these nodes into the surface, and the number of that node: (2,)."""
    gap = surface_state(model.surface, (model.mesh.points + u)[nodes]).gap
    return np.array([-gap.min(), nodes[gap.argmin()]], dtype=float) if gap.size else np.zeros(2)


def penetration(model: Model, sunk: Floats) -> Iterator[str]:
    """Penetration of the boundary outside `pad`; `sunk` is the `deepest_penetration` of a run."""
    points = model.mesh.points
    if sunk[0] > SUNK * float(np.ptp(points, axis=0).max()):
        at = ", ".join(f"{x + 0.0:.4g}" for x in points[int(sunk[1])])
        yield (
            f"the boundary outside `pad` passed through the surface, by {sunk[0]:.3g} mm at ({at}) of the "
            "undeformed mesh: nothing holds it there, and contact forces are too small; extend `pad`"
        )


def lost_stresses(model: Model, u: Floats) -> Iterator[str]:
    """Own materials whose derivatives are lost in the most strained points of a state u (N, dim)."""
    for law, integral in model.body.tissue.regions:
        if not isinstance(law, UserLaw):
            continue
        F = embed(deformation_gradient(integral.field(u))).reshape(3, 3, -1)
        strain = np.abs(F - np.eye(3)[..., None]).max(axis=(0, 1))
        most = np.argsort(strain)[-STRAINED_POINTS:]
        name, method = ("P", law.law.P) if hasattr(law.law, "P") else ("psi", law.law.psi)
        what = f"{name}(F) of {type(law.law).__name__}"
        try:
            lost = lost_derivatives(method, F[..., most, None])[:, 0]
        except Exception as error:  # whatever a user's code raises
            at = f"near the largest strain of the run, {strain.max():.0%}"
            yield f"{what} raises {type(error).__name__} {at}, where its derivative was tried: {error}"
            continue
        if lost.any():
            yield (
                f"{what} loses its derivative in a complex step at a strain "
                f"of {strain[most][lost].min():.0%}: stresses are wrong there; it must be of {COMPLEX_SAFE}"
            )


def pull_offs(found: Floats, dim: int) -> Iterator[str]:
    """Pull-off of an adhering finger: rows (k, 3) of the step, the largest pull and its bound.

    >>> list(pull_offs(np.array([[12, 0.0052, 0.0073]]), 2))[0].partition("up to ")[2]
    'a pull of 0.0052 to 0.0073 N/mm; more steps narrow it'
    """
    for step, pull, bound in found:
        open_ = bound > (1.0 + NARROW) * pull
        said = f"in step {int(step)} the finger came off: adhesion held it up to a pull of {pull:.3g}"
        yield said + (f" to {bound:.3g} {FORCES[dim]}; more steps narrow it" if open_ else f" {FORCES[dim]}")


def doubtful(scene: Scene, rows: Sequence[Row]) -> list[str]:
    """Warnings that follow from the rows of a scene's run."""
    told = (
        _never_touched(scene, rows),
        _crushed(scene, rows),
        _dissipated(scene, rows),
        _energy_created(rows),
        _snapped(rows),
        _climbed(rows),
        _missed(rows),
        _strained(scene, rows),
        swings(scene, rows),
        *(kind.books.doubts(scene, rows) for kind in rooms_of(scene)),
    )
    return [sentence for one in told for sentence in one] if rows else []


def _column(rows: Sequence[Row], name: str) -> Floats:
    return np.array([row[name] for row in rows], dtype=float)


def _dim(rows: Sequence[Row]) -> int:
    return 3 if "contact_area" in rows[0] else 2


def _never_touched(scene: Scene, rows: Sequence[Row]) -> Iterator[str]:
    """Slides that touch nothing, unless the finger is pressed later."""
    for i, course in enumerate(scene.courses):
        forces = [row["normal_force"] for row in rows if row["motion_index"] == i]
        later = any(one.presses for one in scene.courses[i:])
        if course.distance and forces and not any(forces) and not later:
            yield f"motion {i}, a slide, never touched"


def _crushed(scene: Scene, rows: Sequence[Row]) -> Iterator[str]:
    """An attraction that is larger than the load, or presses as no fingertip can be pressed."""
    names = ("electrostatic_force", "applied_force", "normal_force", "peak_contact_pressure")
    pull, load, normal, peak = (_column(rows, name) for name in names)
    pull, unit = np.where(normal > 0.0, pull, 0.0), FORCES[_dim(rows)]
    if not pull.any():
        return
    first, worst, most = int(np.argmax(pull)), int(np.argmax(np.where(pull > 0.0, peak, 0.0))), load.max()
    if any(course.presses for course in scene.courses) and pull[first] > max(most, 0.0):
        pressed = most > SMALLEST_FORCE
        times = f"{pull[first] / most:.3g} times the load, " if pressed else "more than the load, "
        yield (
            f"the attraction, {pull[first]:.3g} {unit} in step {rows[first]['step']}, is {times}"
            f"which is {most:.3g} {unit} at most"
        )
    if peak[worst] > BORNE:
        yield (
            f"the skin is pressed with up to {peak[worst]:.3g} MPa under its attraction "
            f"(step {rows[worst]['step']}), and no fingertip bears {BORNE:g} MPa"
        )


def _strained(scene: Scene, rows: Sequence[Row]) -> Iterator[str]:
    """An elastic surface that is strained by more than a linear one is good for."""
    layers = getattr(scene.ground.elastic, "layers", ())
    if not layers:
        return
    soft, peak = min(layers, key=lambda one: one.E), _column(rows, "peak_contact_pressure")
    strain, worst = float(peak.max()) * (1.0 - soft.nu**2) / soft.E, int(peak.argmax())
    if strain > STRAINED:
        yield (
            f"the elastic surface is strained by about {strain:.0%} in step {rows[worst]['step']} (contact "
            f"pressure over plane modulus): it is linear, which holds to about {STRAINED:.0%}"
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


def _energy_created(rows: Sequence[Row]) -> Iterator[str]:
    """Steps whose end has more energy than the forces at both ends can have given it."""
    own, works = _lost(rows, "integrator"), np.abs(_column(rows, "external_work")).max()
    works += SMALLEST_FORCE * np.abs(_column(rows, "indentation")).max()
    created = -own - _open_works(rows)
    if created.max() > GAINED * _energy(rows) + OPEN_WORK * works:
        worst = int(created.argmax())
        yield (
            f"energy error of {created[worst]:.2g} {WORKS[_dim(rows)]} in step {rows[worst]['step']} "
            "(integrator_dissipation): compare with more steps; where the forces stay the same, the works of "
            "this step alone are wrong, otherwise it went over an energy barrier to another state"
        )


#: columns of the bone's force and of its path
BONE = (
    ("applied_force", "indentation"),
    ("applied_tangential_force", "position"),
    ("applied_tangential_force_x", "position"),
    ("applied_tangential_force_z", "position_z"),
)


def _open_works(rows: Sequence[Row]) -> Floats:
    """What the forces at the ends of each step (r,) leave open of the work of the bone: half their change
    times its way.
    """
    found = np.zeros(len(rows))
    for force, path in BONE:
        if force in rows[0]:
            change, way = (np.diff(_column(rows, name), prepend=0.0) for name in (force, path))
            found += 0.5 * np.abs(change * way)
    return found


def _snapped(rows: Sequence[Row]) -> Iterator[str]:
    freed = np.where(_column(rows, "electrostatic_force") > 0.0, _lost(rows, "snap"), 0.0) / _energy(rows)
    if freed.max() > SNAPPED:
        worst = int(freed.argmax())
        yield (
            f"in step {rows[worst]['step']} the finger snaps and loses {freed[worst]:.0%} of the energy of "
            "the run: other states are stable too, and the path decides which; `evfem check` compares"
        )


def _climbed(rows: Sequence[Row]) -> Iterator[str]:
    """Rows in time that pass an energy barrier however short their substeps are."""
    climbed = (np.diff(_column(rows, "time"), prepend=0.0) > 0.0) & (_column(rows, "jumps") > 0.0)
    if climbed.any():
        first, count = rows[int(climbed.argmax())]["step"], int(climbed.sum())
        yield (
            f"{count} steps in time, the first of them step {first}, pass an energy barrier that the inertia "
            "cannot carry the finger over: shorter steps may end elsewhere; `evfem check` compares"
        )


def _missed(rows: Sequence[Row]) -> Iterator[str]:
    """Rows whose friction force or gap misses its target: each, or all at once if they are many."""
    for name, reached, unit in (
        ("missed_force", "applied_tangential_force", FORCES[_dim(rows)]),
        ("missed_gap", "min_gap", "mm"),
    ):
        missed = [row for row in rows if row.get(name, 0.0) != 0.0]
        for group in [missed] if len(missed) > MANY else [[row] for row in missed]:
            found, volts = _column(group, reached), _column(group, "voltage")
            yield (
                f"{_steps([row['step'] for row in group])}: target {_span(found + _column(group, name), 3)}, "
                f"reached {_span(found, 3)} {unit} at {_span(volts, 4)} V"
                + (", part of the contact sticks" if _sticks(group, name) else "")
            )


def _sticks(rows: Sequence[Row], missed: str) -> bool:
    """Whether friction that is `missed` in each of the rows has yet to grow with the travel."""
    return missed == "missed_force" and all(row.get("stick_share", 0.0) > 0.0 for row in rows)


def _steps(numbers: list[int]) -> str:
    """Step numbers in growing order as ranges.

    >>> _steps([3, 4, 5, 8]), _steps([7])
    ('steps 3 to 5, 8', 'step 7')
    """
    there = set(numbers)
    starts = [one for one in numbers if one - 1 not in there]
    ends = [one for one in numbers if one + 1 not in there]
    runs = [f"{a}" if a == b else f"{a} to {b}" for a, b in zip(starts, ends, strict=True)]
    return f"step{'s' if len(numbers) > 1 else ''} {', '.join(runs)}"


def _span(values: Floats, digits: int) -> str:
    """The smallest and the largest of some values, or the one that they are to so many digits."""
    ends = dict.fromkeys(f"{one:.{digits}g}" for one in (values.min(), values.max()))
    return " to ".join(ends)


def _dissipated(scene: Scene, rows: Sequence[Row]) -> Iterator[str]:
    if not (scene.solver.timed or drive_of(scene.hand).takes_time(1.0)):
        return
    timed = np.diff(_column(rows, "time"), prepend=0.0) > 0.0
    own, energy = float(np.abs(_lost(rows, "integrator")[timed]).sum()), _energy(rows)
    if own > DISSIPATED * energy:
        yield (
            f"the steps in time dissipate {own / energy:.0%} of the energy that is stored or dissipated by "
            "themselves (integrator_dissipation): take shorter ones"
        )


def advice(scene: Scene, model: Model, failed: StepFailed) -> str:
    """Why the step failed, what to try, and how its last iterate looked, joined by semicolons."""
    lost = _reason_for_failure(model, failed)
    sentences = [lost or failed.reason, _suggestions(scene, failed, bool(lost)), failed.findings]
    return "; ".join(sentence for sentence in sentences if sentence)


def _reason_for_failure(model: Model, failed: StepFailed) -> str:
    """The sentence on the equilibrium that was lost; empty where nothing shows that there is none."""
    if isinstance(failed, Folded) or failed.last is None:
        return ""
    if isinstance(failed, LiftedOff):
        return f"{failed.reason}; it was lost at {_whereabouts(model, failed.last[0])}"
    state, target = failed.last
    try:
        with np.errstate(invalid="ignore"):  # a law of one's own may have become infinite
            margin = model.equilibrium.body.stability_ratio(state, target)
    except StepFailed:  # the tangent there is singular
        return ""
    # a trial far from equilibrium may be unstable too: alone that shows nothing
    if margin is None or margin.ratio < (SOFTENED if failed.unstable else CRITICAL):
        return ""
    passing = model.body.takes_time(target.duration)
    rest = "within a time step as short as this" if passing else "at rest"
    released = ", and released there it does not come to rest" if failed.released else ""
    return (
        f"there is no equilibrium {rest} near here: {margin.cause}, {margin.ratio:.3g} times as hard as its "
        f"tissue holds it at {_whereabouts(model, state)}, and harder beyond{released}"
    )


def unstable_alone(model: Model, state: State, rows: Sequence[Mapping[str, float]]) -> str:
    """The sentence on an equilibrium at a prescribed gap that is unstable at its voltage; empty if stable.

    In three dimensions the last two `rows` tell: the voltage falls as the gap closes.
    """
    margin = model.equilibrium.body.stability_ratio(state, Target.held(state.bone, state.voltage))
    if margin is None and len(rows) > 1:
        changes = [rows[-1][name] - rows[-2][name] for name in ("voltage", "min_gap")]
        lost = abs(rows[-2]["voltage"]) > 0.0 and changes[0] * np.sign(state.voltage) * changes[1] > 0.0
    else:
        lost = margin is not None and margin.ratio > 1.0
    if not lost:
        return ""
    return (
        f"the gap of {rows[-1]['min_gap']:.4g} mm is prescribed, and {state.voltage:.4g} V alone do not hold "
        "it: the equilibrium is not stable, and where the finger goes from there is by chance"
    )


def _whereabouts(model: Model, state: State) -> str:
    position, indentation = state.bone[0] + 0.0, model.indentation(state.bone) + 0.0
    load, voltage = f"{-state.reaction[1] + 0.0:.3g} {state.unit}", state.voltage + 0.0
    return f"position {position:.4g} mm, indentation {indentation:.4g} mm, {load} and {voltage:.4g} V"


def _may_have_an_energy(scene: Scene) -> bool:
    """Whether its vertical attraction may also be along the normal, with an energy: not in every scene."""
    if not scene.electrics.acts or scene.direction != "vertical" or scene.field == "full":
        return False
    try:
        replace(scene, direction="normal")
    except InputError:
        return False
    return True


def _suggestions(scene: Scene, failed: StepFailed, lost: bool) -> str:
    pulled = scene.electrics.acts
    finer = "less friction or a finer mesh" if scene.has_friction else "a finer mesh"
    if isinstance(failed, LiftedOff):
        return f"try {'more voltage, or ' if pulled else ''}hold = indentation"
    if isinstance(failed, Folded):
        return f"try {'less voltage, a thicker insulator, ' if pulled else ''}smaller steps, {finer}"
    if isinstance(failed, Collapsed) and not lost:
        less = "a smaller load, less voltage" if pulled else "a smaller load"
        return f"the load is too large for the mesh, or the step too long: try {less}, smaller steps, {finer}"
    if not scene.solver.inertial and weakens(scene):
        return "try dynamics = inertial: friction that falls with the speed lets go at once what has no mass"
    if scene.solver.timed:
        passing = failed.last is None or failed.last[1].duration > 0.0
        time = "a larger viscosity of the finger" if passing else "a motion with a speed"
        return f"try smaller steps, {time}, {finer}"
    if failed.released and _may_have_an_energy(scene):
        return (
            "try direction = normal, an attraction with an energy, or time: a speed, with dynamics = viscous"
        )
    if not lost:
        return f"try smaller steps, a larger viscosity with dynamics = viscous, {finer}"
    off = "" if scene.solver.strategy.relaxation else "relaxation of the strategy switched on, or "
    return f"try {off}motions that take time: a speed, with dynamics = viscous or inertial"
