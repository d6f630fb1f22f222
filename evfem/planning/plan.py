"""Active physics, unknowns and solver of a scene, each with its reason; nothing is solved.

`make_model` builds the model from this plan, so the printout and the run cannot disagree.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from importlib.util import find_spec
from os import PathLike
from typing import Any

import numpy as np

from evfem.electrostatics.laws import Kaczmarek, StrongTroxel
from evfem.electrostatics.localgaps import SpreadGaps, roughness_below
from evfem.electrostatics.roughness import ConstantRoughness, roughness_of
from evfem.errors import ABSENT, InputError
from evfem.finger.sizes import area_error
from evfem.mesh.mesh import Mesh
from evfem.planning.attracted import broken_air
from evfem.planning.core import Closing, unseen
from evfem.planning.cost import needs
from evfem.planning.loaddrift import drifting
from evfem.planning.parts import check_components
from evfem.planning.plausibility import implausible, jumps, locking, touching_traction
from evfem.planning.resolution import aliased, oscillating, skipped, steps_line, too_fast, unresolved
from evfem.planning.rooms import rooms_of
from evfem.planning.timescales import left_out, time_scales
from evfem.protocols import TimeSignal
from evfem.scene.file import scene_at
from evfem.scene.motion import MOTIONS
from evfem.scene.scene import Scene
from evfem.scene.spatial import check_space
from evfem.scene.terms import Boundary
from evfem.surface.friction import Coulomb, SlipMemory
from evfem.terms.hand import Hand
from evfem.terms.traction import PadTraction
from evfem.tissue.branches import KEPT_BYTES, branches_in
from evfem.tissue.dynamics import DYNAMICS
from evfem.tissue.forms import Form
from evfem.tissue.kernels.blocks import loops
from evfem.tissue.laws import split
from evfem.tissue.space import elements_of_order, points_per_cell
from evfem.tissue.splitlaw import nearly_incompressible
from evfem.tissue.userforms import Trial, tried

#: columns of a printed plan, at most
WIDTH = 79
#: by dimensions, memory of a run for Maxwell branches over that of their history variables, as measured
RELAXING = {2: 10, 3: 20}
#: each of the two force laws of the literature and the other one
OTHER_LAW: dict[type, type[StrongTroxel | Kaczmarek]] = {StrongTroxel: Kaczmarek, Kaczmarek: StrongTroxel}


@dataclass(frozen=True)
class Term:
    """One kind of physics: whether it is active in the scene, and why."""

    name: str
    needed: bool
    reason: str


@dataclass(frozen=True)
class Plan:
    """Active physics, numbers of unknowns and solver of a scene; `str(plan)` is a page of text."""

    name: str
    element: str
    nodes: int
    cells: int
    unknowns: int
    pad_nodes: int
    steps: int
    terms: tuple[Term, ...]
    solver: tuple[str, ...]
    closing: Closing = field(repr=False, compare=False)
    warnings: tuple[str, ...] = ()

    @property
    def warning(self) -> str | None:
        """All warnings as one text; None without any."""
        return "; ".join(self.warnings) or None

    def has(self, name: str) -> bool:
        """Whether the term called `name` is active."""
        return next(term.needed for term in self.terms if term.name == name)

    def __str__(self) -> str:
        size = f"{self.steps} steps, {self.nodes} nodes, {self.cells} cells ({self.element})"
        lines = [f"Scene {self.name}: {size}", "", "Terms"]
        for term in self.terms:
            lines += _wrapped(f"  {'+' if term.needed else '-'} {term.name:<14} ", term.reason)
        size = f"{self.unknowns} displacements, with the bone; {self.pad_nodes} pad nodes may touch"
        lines += ["", "Unknowns", f"  {size}", "", "Solver"]
        for line in self.solver:
            lines += _wrapped("  ", line)
        for warning in self.warnings:
            lines += ["", *_wrapped("Warning: ", warning)]
        return "\n".join(lines)


def _wrapped(begin: str, text: str) -> list[str]:
    """A label and its text, wrapped to the width of a terminal with a hanging indent."""
    indent = " " * max(len(begin), 4)
    return textwrap.wrap(
        text,
        WIDTH,
        initial_indent=begin,
        subsequent_indent=indent,
        break_long_words=False,
        break_on_hyphens=False,
    )


def plan(scene: Scene | str | PathLike[str]) -> Plan:
    """Check a scene and list its active physics, unknowns and solver; builds the mesh, solves nothing.

    Parameters
    ----------
    scene
        A `Scene`, or the path of a scene file.

    Returns
    -------
    Plan
        A printable page; `terms`, `solver` and `warnings` are its sections.

    Raises
    ------
    InputError
        The scene cannot be run.

    Examples
    --------
    >>> from evfem import Flat, FingerPad, Press, Scene
    >>> smooth = FingerPad(ridges=False, resolution="coarse")
    >>> needed = plan(Scene(smooth, Flat(friction=0.0), motion=[Press(indentation=0.5)]))
    >>> [term.name for term in needed.terms if not term.needed]
    ['friction', 'electrostatics', 'time', 'user forms']
    """
    scene = scene_at(scene)
    mesh, element = scene_mesh(scene)
    return plan_on(scene, mesh, element)


def scene_mesh(scene: Scene) -> tuple[Mesh, str]:
    """The finger's mesh and the element to use on it."""
    linear = scene.solver.element in elements_of_order(1)
    mesh = scene.finger.mesh(1 if linear else 2)
    return mesh, scene.solver.element_on(mesh.corners)


def plan_on(scene: Scene, mesh: Mesh, element: str) -> Plan:
    """The plan of a scene with its mesh; raises InputError for unusable user-defined components."""
    if not scene.motion:
        names = ", ".join(cls.__name__ for cls in MOTIONS.values())
        raise InputError("motion", ABSENT, f"at least one of {names}")
    check_components(scene, mesh.dim)
    check_space(scene, mesh)
    if scene.output.probes:
        from evfem.scene.probes import points_of

        for name, one in scene.output.probes.items():
            points_of(f"output.probes.{name}", one, mesh)
    for name in ("pad", "bone"):
        if not len(mesh.node_sets.get(name, ())):
            raise InputError(
                "finger.mesh", f"no nodes on `{name}`", "point data or physical groups `pad` and `bone`"
            )
    bone, pad = mesh.node_sets["bone"], mesh.node_sets["pad"]
    moduli = {name: split(law, mesh.dim).shear_modulus for name, law in scene.finger.materials.items()}
    closing = Closing(scene, mesh)
    others = (
        unresolved(scene, mesh),
        aliased(scene, mesh),
        too_fast(scene),
        left_out(scene),
        unseen(closing),
        *oscillating(scene, mesh),
        *drifting(scene, mesh, moduli),
    )
    locked = locking(element, scene.finger.materials, mesh.dim)
    terms = tuple(_terms(closing, moduli, element))
    return Plan(
        name=scene.name,
        element=element,
        nodes=len(mesh.points),
        cells=len(mesh.cells),
        unknowns=mesh.dim * (len(mesh.points) - len(bone)) + mesh.dim,
        pad_nodes=int(np.setdiff1d(pad, bone).size),
        steps=scene.total_steps,
        terms=terms,
        solver=tuple(_solver(scene, mesh, terms)),
        warnings=(*implausible(scene, mesh, moduli), *locked, *filter(None, others)),
        closing=closing,
    )


def _terms(closing: Closing, moduli: Mapping[str, float], element: str) -> Iterator[Term]:
    scene, mesh = closing.scene, closing.mesh
    yield _tissue(scene, mesh, moduli)
    yield _contact(scene)
    yield _friction(scene)
    yield _electrostatics(closing)
    there = {one.name for one in rooms_of(scene)}
    if "adhesion" in there:
        yield Term("adhesion", True, closing.adhesion_in_words)
    if {"full field", "electrostatics"} <= there:
        from evfem.planning.fieldchoice import chosen_field

        choice = chosen_field(scene, mesh)
        yield Term("full field", choice.full, choice.reason)
    if scene.drive is not None:
        yield Term("drive", True, time_scales(scene))
    yield _time(scene, mesh, element)
    if scene.hand is not None:
        yield Term("hand", True, _hand(scene.hand))
    yield _forms(scene, mesh)
    if scene.rooms:
        yield Term("own rooms", True, ", ".join(_own_room(room) for room in scene.rooms))


def _own_room(room: Any) -> str:
    """A room of one's own, in words."""
    if isinstance(room, PadTraction):
        return f"{type(room).__name__} pulls on the pad ({room.name}_force)"
    return f"{type(room).__name__} within the body"


def _tissue(scene: Scene, mesh: Mesh, moduli: Mapping[str, float]) -> Term:
    materials = scene.finger.materials
    laws = ", ".join(sorted({_law_name(law, name, mesh) for name, law in materials.items()}))
    # a modulus that was entered in kPa shows here
    soft, hard = (f"{modulus:.3g}" for modulus in (min(moduli.values()), max(moduli.values())))
    stiffness = f"shear modulus {soft} MPa" if soft == hard else f"shear moduli {soft} to {hard} MPa"
    deep = "" if scene.depth is None else f" over {scene.depth:g} mm of depth"
    where = "plane strain" if mesh.dim == 2 else "three dimensions"
    return Term("tissue", True, f"{laws}, {where}{deep}, {stiffness}")


def _contact(scene: Scene) -> Term:
    shape = "flat surface" if scene.ground.is_flat else "textured surface, with its slope and curvature"
    peak = getattr(scene.finger, "pressure_error", 0.0)
    if cells := getattr(scene.finger, "ridge_cells", 0.0):
        error = 100.0 * area_error(cells)
        known = f"has an error of {error:.2g} %" if error < 100.0 else "is not resolved"
        shape += f"; with {cells:g} cells per ridge the real contact area {known}"
        shape += f", the peak pressure one of {100.0 * min(peak, 1.0):.2g} %"
    elif peak:
        shape += f"; the peak pressure has an error of {100.0 * peak:.2g} %"
    shape += getattr(scene.finger, "gap_error", "")
    return Term("contact", True, shape + _outline(scene.finger) + _elastic_surface(scene))


def _outline(finger: Any) -> str:
    """The outline of a finger that is no ellipse, in words (numbers: docs/howto/fingertip.md)."""
    outline = getattr(finger, "outline", 2.0)
    if not isinstance(outline, float):
        return f"; the outline is measured ({outline.width:.4g} x {outline.height:.4g} mm)"
    if outline == 2.0:
        return ""
    flatter = "with 3 a level fingertip touches 1.6 times an ellipsoid's area at 1 N, and at 0.25 mm it is"
    return f"; the outline has the exponent {outline:g}: {flatter} attracted 2.5 to 2.8 times as much"


def _elastic_surface(scene: Scene) -> str:
    """The layers of an elastic surface, in words; empty for a rigid one."""
    elastic = scene.ground.elastic
    if elastic is None:
        return ""
    layers = getattr(elastic, "layers", ())
    made = ", ".join(f"{one.thickness:g} mm of {one.E:g} MPa" for one in layers) or type(elastic).__name__
    return f"; it is elastic ({made}), its compliance is added to the tissue's"


def _friction(scene: Scene) -> Term:
    if not scene.has_friction:
        return Term("friction", False, "friction coefficient is 0 everywhere")
    law = scene.friction_law
    if isinstance(law, Coulomb):
        return Term("friction", True, "Coulomb")
    timed = ", slip speed and contact time" if getattr(law, "timed", False) else ""
    falling = ""
    if jumps(scene):
        falling = "; velocity weakening: without inertia the finger may jump, dynamics = inertial resolves it"
    limit = f"shear limit of each node from its pressure{timed}{_follows(scene)}"
    return Term("friction", True, f"{type(law).__name__}: {limit}{falling}")


def _follows(scene: Scene) -> str:
    """What a memory of slip follows, and whether the steps of slides see it; empty without one."""
    law = scene.friction_law
    if not isinstance(law, SlipMemory):
        return ""
    inner = law.friction
    what = f"the coefficient {inner:g}" if isinstance(inner, float) else type(inner).__name__
    at_rest = f" and {law.time:g} s" if law.time < np.inf else ""
    longest = max((float(np.hypot(*one.course.travel)) / one.steps for one in scene.motion), default=0.0)
    fine = f"steps of slides have up to {longest:.3g} mm"
    if longest > law.length:
        fine += f", {longest / law.length:.3g} lengths: such a step sees {what}, not how it is approached"
    return f", which follows {what} over {law.length:g} mm of slip{at_rest}; {fine}"


def _electrostatics(closing: Closing) -> Term:
    scene = closing.scene
    if not scene.electrics.acts:
        return Term("electrostatics", False, "no law or no voltage")
    air = "air gap included" if scene.air_layer else "touching nodes only"
    signal = scene.electrics.voltage
    over_time = (
        f", voltage over time to {signal.highest_frequency:g} Hz" if isinstance(signal, TimeSignal) else ""
    )
    how = f"{type(scene.law).__name__} law, {scene.direction} traction, {air}, solved together with contact"
    traction, core = touching_traction(scene), closing.found
    pull = "" if traction is None else f"; at most {traction:.2g} MPa on touching skin{_other_law(scene)}"
    cored = "" if core is None else f"; {core}"
    return Term(
        "electrostatics", True, f"{how}{over_time}{_roughness(scene)}{pull}{_breakdown(scene)}{cored}"
    )


def _breakdown(scene: Scene) -> str:
    """From which voltage on air breaks down, in words; empty below it."""
    electrics = scene.electrics
    if not scene.may_spark or electrics.resolved:
        return ""
    said = broken_air(electrics.crest * electrics.largest_voltage, electrics.attraction[1])
    held = ", where the law holds its field" if scene.breakdown == "limit" else ""
    return f"; {said}{held}" if said else ""


def _other_law(scene: Scene) -> str:
    """Traction on touching skin by the other one of the two force laws, and the page that compares them."""
    if (other := OTHER_LAW.get(type(scene.law))) is None:
        return ""
    traction = touching_traction(scene, other(gap_eps_r=scene.electrics.gap_eps_r))
    return f" ({other.__name__}: {traction:.2g} MPa, see docs/howto/which-law.md)"


def _roughness(scene: Scene) -> str:
    """Air gap between rough faces in contact, in words; empty for smooth ones."""
    rough = roughness_of(scene.roughness_gap)
    if rough is None:
        return ""
    apart, seen = float(rough.separation(0.0)), roughness_below(*scene.electrics.attraction, rough)
    spread = ""
    if isinstance(seen, SpreadGaps):
        even = float(np.min(seen.separation(0.0)))
        spread = f" on average, {seen.distribution}: it attracts as an even one of {even:.3g} mm does"
    if isinstance(rough, ConstantRoughness):
        return f", rough faces with an air gap of {apart:g} mm in contact{spread}"
    return f", rough faces with an air gap of up to {apart:g} mm that falls with contact pressure{spread}"


def _time(scene: Scene, mesh: Mesh, element: str) -> Term:
    dynamics, terms = scene.solver.dynamics, DYNAMICS[scene.solver.dynamics]
    voltage = isinstance(scene.electrics.voltage, TimeSignal)
    snap = ""
    if scene.solver.strategy.relaxation:
        snap = "; after a snap the finger settles into the next equilibrium"
    if terms is None:
        used = "only for the voltage" if voltage else "not used"
        return Term("time", False, f"{used} (quasi-static){snap}")
    snap = snap and f"; motions without a speed are quasi-static{snap}"
    return Term("time", True, f"{dynamics}, {terms.scheme}{_relaxing(scene, mesh, element)}{snap}")


#: what a step longer than a relaxation time misses: `tests/tissue/test_branches`
LONG_RELAXATION = (
    ", of which one longer than a relaxation time misses up to 1.5 % (30 % of strain) or 3.5 % (100 %) of "
    "the first overstress"
)


def _relaxing(scene: Scene, mesh: Mesh, element: str) -> str:
    """Relaxation times of the tissue's Maxwell branches, durations of the steps, and memory."""
    rows = {name: branches_in(scene.finger, law) for name, law in scene.finger.materials.items()}
    times = [time for several in rows.values() for _, time in several]
    if not times:
        return ""
    counts = [(one.course, one.part(k)[2]) for one in scene.motion for k in {1, min(2, one.steps), one.steps}]
    steps = [course.seconds(count) for course, count in counts if course.takes_time]
    told = f"; branches relax in {min(times):.2g} to {max(times):.2g} s"
    told += f", steps take {min(steps):.2g} to {max(steps):.2g} s" if steps else ""
    told += LONG_RELAXATION if max(steps, default=0.0) > min(times) else ""
    cells = sum(mesh.cells_of(name).size for name, several in rows.items() if several)
    kept = cells * points_per_cell(element) * max(map(len, rows.values())) * KEPT_BYTES[mesh.dim]
    return f"{told}; their history variables take {kept / 1e6:.2g} MB, a run {RELAXING[mesh.dim]} times that"


def _hand(hand: Hand) -> str:
    """The hand between drive and bone, in words, with its natural frequency."""
    reason = f"x of the bone is an unknown behind a spring of {hand.stiffness:g} N/mm"
    if hand.damping > 0.0:
        reason += f", a damper of {hand.damping:g} N s/mm"
    if hand.mass > 0.0:
        own = np.sqrt(hand.stiffness / hand.mass) / (2.0 * np.pi)
        reason += f", a mass of {hand.mass:g} t, natural frequency {own:.3g} Hz"
    return f"{reason} (per mm of depth)"


def _forms(scene: Scene, mesh: Mesh) -> Term:
    laws = scene.finger.materials
    names = []
    for form, on in ((term.form, term.on) for term in scene.forms):
        trial = tried(mesh, form, on.name, isinstance(on, Boundary), laws.get(on.name))
        names.append(f"{form.name} on {on.name}{_caveat(trial)}")
    return Term("user forms", bool(names), ", ".join(names) or "none")


def _caveat(trial: Trial) -> str:
    """Note on a form with an unsymmetric tangent."""
    return "" if trial.has_potential else " (no potential: only the symmetric part of its tangent is used)"


def _law_name(law: Any, region: str, mesh: Mesh) -> str:
    if isinstance(law, Form):
        return f"{law.name}{_caveat(tried(mesh, law, region, boundary=False))}"
    return type(law).__name__


def _solver(scene: Scene, mesh: Mesh, terms: tuple[Term, ...]) -> Iterator[str]:
    direct = {"evfem.tissue.kernels.cholesky": "sparse Cholesky factors", "pypardiso": "PARDISO"}
    there = [words for package, words in direct.items() if find_spec(package)]
    there = there[:: -1 if scene.solver.threads > 1 else 1]  # as `newton.condensation.make_condensation`
    backend = (*there, "SuperLU (no C compiler was there at the installation)")[0]
    cells = "compiled" if loops() else "numpy (no C compiler was there at the installation)"
    yield f"symmetric stiffness matrix, factorised rarely and reused: {backend}; cell loops: {cells}"
    yield f"contact: {scene.solver.contact}, active-set method on the nodes that may touch"
    yield needs(scene, mesh)
    laws = {name: split(law, mesh.dim) for name, law in scene.finger.materials.items()}
    if stiff := [name for name, law in laws.items() if nearly_incompressible(law, mesh.dim)]:
        yield f"pressure is an additional unknown: {', '.join(stiff)} nearly incompressible"
    acting = [t.name for t in terms if t.needed and t.name in ("friction", "electrostatics", "adhesion")]
    if acting:
        yield (
            f"{' and '.join(acting)} {'act' if acting[1:] else 'acts'} on nodes that may touch only, "
            "the stiffness matrix stays symmetric"
        )
    if steps := steps_line(scene):
        yield steps
    yield from skipped(scene)
    yield f"every accepted step: residual below {scene.solver.tolerance:g} of the largest reaction"
