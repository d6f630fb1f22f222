"""From a scene to the parts it needs: mesh, body, pad, placed surface, attraction, equilibrium."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from evfem.common import notices
from evfem.common.arrays import Floats
from evfem.common.rooms import BodyTerm, Column, Room
from evfem.electrostatics.roughness import roughness_of
from evfem.errors import InputError
from evfem.mesh.mesh import Mesh
from evfem.newton.equilibrium import Equilibrium
from evfem.newton.factorised import FactorisedBody
from evfem.newton.interface import Interface
from evfem.newton.state import Limits, State
from evfem.planning.core import Closing
from evfem.planning.plan import plan_on, scene_mesh
from evfem.planning.rooms import rooms_of
from evfem.scene.scene import Scene
from evfem.scene.spatial import check_memory
from evfem.scene.terms import Boundary
from evfem.simulation.history import EVERY
from evfem.solver.linearbody import LinearBody
from evfem.surface.friction import Coulomb
from evfem.surface.pad import Pad, make_pad
from evfem.surface.skin import Skin, make_skin
from evfem.terms.attraction import ELECTROSTATIC, Attraction
from evfem.terms.charging import NO_CHARGES, ChargeBooks, Charging, NoCharges
from evfem.terms.foundation import Penalties, foundation_of
from evfem.terms.friction import bounds_of
from evfem.terms.hand import Drive, drive_of
from evfem.terms.sources import GAP_COLUMNS, source_of
from evfem.terms.traction import PadTraction
from evfem.terms.tractions import sum_of
from evfem.tissue.body import Body
from evfem.tissue.dynamics import make_dynamics
from evfem.tissue.space import make_space
from evfem.tissue.splitlaw import split
from evfem.tissue.userforms import make_term
from evfem.tissue.weakform import check_laws


@dataclass(frozen=True, eq=False)
class Model:
    """The parts of a scene; `surface` is placed, `first_gap` (mm) the smallest vertical gap at the start."""

    scene: Scene
    mesh: Mesh
    body: Body
    pad: Pad | Skin
    surface: Any
    attraction: Any
    equilibrium: Equilibrium
    first_gap: float
    closing: Closing

    @cached_property
    def drive(self) -> Drive:
        """What moves the bone along the display."""
        return drive_of(self.scene.hand)

    @cached_property
    def terms(self) -> tuple[Any, ...]:
        """What has energies beside tissue, contact and attraction (`evfem.common.rooms.Room`)."""
        return (*self.body.rooms, *self.drive.books, *self.equilibrium.interface.rooms)

    @cached_property
    def held_by(self) -> tuple[str, ...]:
        """Names of the tractions that hold a finger without a voltage."""
        return tuple(part.name for part in self.attraction.parts if part.always)

    @cached_property
    def shown(self) -> tuple[Room, ...]:
        """Rooms with columns of their own."""
        charges = (ChargeBooks(one) for one in self.attraction.parts[:1] if one.flows)
        books = (kind.books for kind in rooms_of(self.scene))
        every = (*self.terms, *self.attraction.parts, *charges, *books)
        return tuple(room for room in every if room.columns)

    @property
    def column_names(self) -> tuple[str, ...]:
        """All columns of its history."""
        return (*EVERY[self.mesh.dim], *(one.name for one in self.columns))

    @cached_property
    def columns(self) -> tuple[Column, ...]:
        """Columns of the scene's rooms in the history."""
        parts = (one for one in self.attraction.parts if one.name != ELECTROSTATIC)
        forces = (column for one in parts for column in one.named(self.mesh.dim))
        return (*forces, *(column for room in self.shown for column in room.columns), *self.missed)

    @cached_property
    def missed(self) -> tuple[Column, ...]:
        """Columns of what wishes of a voltage miss."""
        gaps = any(motion.course.gap is not None for motion in self.scene.motion)
        return (*source_of(self.scene.electrics.voltage).columns, *(GAP_COLUMNS if gaps else ()))

    @cached_property
    def shear_modulus(self) -> Floats:
        """Shear modulus (P,) in MPa at rest of the tissue below the pad nodes, the mean of their cells."""
        mesh, laws = self.mesh, self.scene.finger.materials
        moduli = np.zeros(max(mesh.region_names.values()) + 1)
        for name, number in mesh.region_names.items():
            moduli[number] = split(laws[name], mesh.dim).shear_modulus
        nodes, per_node = mesh.cells.ravel(), mesh.cells.shape[1]
        found = np.bincount(nodes, np.repeat(moduli[mesh.region], per_node)) / np.bincount(nodes)
        return np.asarray(found[self.pad.nodes])

    def bone(self, position: float, indentation: float, position_z: float = 0.0) -> Floats:
        """Translation of the bone (dim,) in mm."""
        return np.array([position, -(indentation + self.first_gap), position_z][: self.mesh.dim])

    def indentation(self, bone: Floats) -> float:
        """Bone travel beyond first touch in mm, negative when hovering."""
        return float(0.0 - bone[1] - self.first_gap)


def make_model(scene: Scene) -> Model:
    """Build the parts of a scene; raises `InputError` where mesh, names and scene do not fit."""
    mesh, element = scene_mesh(scene)
    check_laws(mesh, scene.finger.materials)
    needed = plan_on(scene, mesh, element)
    for warning in needed.warnings:
        notices.warn(warning)
    check_memory(mesh)
    space = make_space(mesh, element)
    pad: Pad | Skin = make_skin(mesh) if mesh.dim == 3 else make_pad(mesh)
    surface, first_gap = placed(scene.ground, mesh.points[pad.nodes])
    closing = needed.closing
    there = {one.name for one in rooms_of(scene)}
    makers = (("electrostatics", make_attraction), ("adhesion", make_adhesion))
    parts: list[Any] = [make(closing, pad, surface) for name, make in makers if name in there]
    own = [deepcopy(room) for room in scene.rooms]  # what it keeps of a step is that of one model
    parts += [room for room in own if isinstance(room, PadTraction)]
    attraction = sum_of(parts)
    solver, laws = scene.solver, scene.finger.materials
    terms = [
        make_term(space, term.form, term.on.name, isinstance(term.on, Boundary), laws.get(term.on.name))
        for term in scene.forms
    ]
    dynamics = None
    if "time" in there:
        dynamics = make_dynamics(space, laws, scene.finger, solver.dynamics)
    body = Body(space, laws, terms, dynamics, [room for room in own if isinstance(room, BodyTerm)])
    deepest = (
        0.0  # of a solid, whose dense compliance has three unknowns a node: candidates as they are needed
    )
    if mesh.dim == 2:
        deepest = max(0.0, *(course.indentation or 0.0 for course in scene.courses))
    limits = Limits(solver.tolerance, solver.strategy, solver.threads, deepest)
    interface = make_interface(closing, pad, surface, attraction)
    factorised = FactorisedBody(body, interface, attraction, limits)
    equilibrium = Equilibrium(factorised, interface, attraction, limits)
    model = Model(scene, mesh, body, pad, surface, attraction, equilibrium, first_gap, closing)
    check_columns(model)
    return model


def check_columns(model: Model) -> None:
    """Raise InputError for a column of a room whose name another one has, or that is no name."""
    parts = (one for one in model.attraction.parts if one.name != ELECTROSTATIC)
    told = [(one, column) for one in parts for column in one.named(model.mesh.dim)]
    told += [(room, column) for room in model.shown for column in room.columns]
    there = {*EVERY[2], *EVERY[3]}
    for room, column in told:
        if column.name in there or not column.name.isidentifier():
            allowed = "letters, digits and _, and no name of another column"
            raise InputError(f"{type(room).__name__}.columns", column.name, allowed)
        there.add(column.name)


def linearised(model: Model, state: State) -> Model:
    """The same with its tissue linear about `state`; contact, friction and attraction are as before."""
    scene, attraction, limits = model.scene, model.attraction, model.equilibrium.body.limits
    if model.mesh.dim == 3:  # all of the skin would be kept, and was not tried
        raise InputError("linearised", "a finger in three dimensions", "a finger in the plane")
    if scene.forms or scene.rooms or model.body.dynamics.acts:
        given = (
            "a form or room of its own"
            if scene.forms or scene.rooms
            else f"dynamics = {scene.solver.dynamics}"
        )
        raise InputError("linearised", f"a scene with {given}", "tissue without forms, at rest")
    body = LinearBody(model.body, model.pad.nodes, state.u, scene.solver.threads)
    interface = make_interface(model.closing, model.pad, model.surface, attraction)
    factorised = FactorisedBody(body, interface, attraction, limits)
    equilibrium = Equilibrium(factorised, interface, attraction, limits)
    return replace(model, body=body, equilibrium=equilibrium)


def make_interface(closing: Closing, pad: Pad | Skin, surface: Any, attraction: PadTraction) -> Interface:
    """The contact interface, with its friction, faces and foundation."""
    scene, points, solver = closing.scene, closing.mesh.points, closing.scene.solver
    interface = Interface(pad, points, surface, solver.tolerance)
    if solver.contact != "exact":
        normal = float(solver.penalty_normal or 0.0)
        penalties = normal, solver.penalty_tangential or normal
        interface.faces = Penalties(penalties, interface.tributary)
    interface.foundation = foundation_of(interface)
    if attraction.parts:
        interface.foundation.reach = np.inf
    cored = closing.core is not None or scene.adhesion is not None
    if cored:
        interface.restored = attraction.restored
    if cored or not isinstance(scene.friction_law, Coulomb):
        interface.bounds = bounds_of(scene.friction_law, interface)
    return interface


def placed(surface: Any, outline_points: Floats) -> tuple[Any, float]:
    """The surface with its height set (first touch where the scene leaves it open), and g0 in mm."""
    gap = float(np.min(outline_points[:, 1] - surface.relief(outline_points[:, ::2])[0]))
    if surface.y is None:
        return surface.shifted(gap), 0.0
    g0 = gap - surface.y
    if g0 < -1e-12 * np.ptp(outline_points, axis=0).max():
        raise InputError(
            "surface.y", surface.y, f"at most {gap:.9g} mm, where the surface touches the undeformed outline"
        )
    return surface, max(g0, 0.0)


def make_attraction(closing: Closing, pad: Pad | Skin, surface: Any) -> Attraction:
    """The attraction; the skin's layer is a given number or the local thickness of the mesh."""
    scene, mesh, electrics = closing.scene, closing.mesh, closing.electrics
    source_of(scene.voltage).check(scene)
    law, layers = electrics.attraction
    charging: Charging | NoCharges = NO_CHARGES
    if electrics.resolved:
        charging = Charging(electrics.sandwich, pad.nodes.size, electrics.parallel)
    if closing.core is not None:
        law = closing.core.law
    local = (law, layers, pad, surface, scene.direction, scene.air_layer, closing.rough, charging)
    if scene.field == "local":
        return Attraction(*local)
    from evfem.planning.fieldchoice import chosen_field
    from evfem.terms.fullfield import FieldAttraction, facing

    if not chosen_field(scene, mesh).full:
        return Attraction(*local)
    assert isinstance(pad, Pad)
    full = (*local, facing(pad, mesh.points[pad.nodes]), electrics.skin, not scene.grounded)
    if not electrics.conducts:
        return FieldAttraction(*full)
    from evfem.terms.drivenfield import DrivenFieldAttraction, Harmonic

    harmonics = tuple(Harmonic(*one) for one in electrics.permittivities)
    return DrivenFieldAttraction(*full, harmonics=harmonics)


def make_adhesion(closing: Closing, pad: Any, surface: Any) -> Attraction:
    """The scene's adhesion as the mesh resolves it."""
    scene, rough = closing.scene, roughness_of(closing.scene.roughness_gap)
    common = (pad, surface, scene.direction)
    return Attraction(
        closing.adhesion, None, *common, roughness=rough, name="adhesive", always=True, label="adhesion"
    )
