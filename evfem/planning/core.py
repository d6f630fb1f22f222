r"""Whether the mesh resolves the attraction, and the core that takes the law's place where not.

A node of the pad snaps by itself, and a range of contact widths is stable, where the traction p falls
faster with the gap than the mesh lets the skin follow: with the distance h of neighbouring nodes and the
plane modulus :math:`E^* = E / (1 - \nu^2)` of the cells below them, where

.. math:: \chi = -p'(g_0)\, h / E^* > \chi_0 = \tfrac{1}{6} .

:math:`\chi_0` is measured: in blocks, fingers and domes no state was trapped at 1/6, the first ones at
1/5. There a line no steeper than :math:`\chi_0 E^*/h` takes the law's place (`Cored`).
What is left are the errors of a cohesive zone that a few nodes resolve: the edge of contact is right to
1.5 node distances, a load at given indentation to 1 %, a pull-off to 3 %.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from evfem.circuit.signals import FollowForce
from evfem.common.arrays import Floats, Ints
from evfem.electrostatics.laws import traction_derivative
from evfem.electrostatics.localgaps import roughness_below
from evfem.electrostatics.roughness import Cored, roughness_of
from evfem.mesh.mesh import Mesh
from evfem.planning.resolution import path_depth
from evfem.scene.electrics import Electrics
from evfem.scene.scene import Scene
from evfem.surface.adhesion import BEYOND, Softened
from evfem.tissue.splitlaw import plane_modulus, split

#: slope times node distance over the plane modulus that a mesh resolves
RESOLVED = 1 / 6
#: nodes where the finger touches first, of which a plan speaks, and those that decide whether there is a
#: core: above the lowest one by at most these shares of the finger's height
FIRST, LOW = 1e-6, 0.05
#: error of an edge of contact in node distances
EDGE = 1.5
#: modulus (MPa) in the place of none
RIGID = 1e30
#: steepest slope (MPa/mm) of adhesion above rigid cells; from the steepest of a mesh down, slopes within this
#: factor count as one; what a logarithm may miss a whole number by
STEEPEST, CLASS, ROUNDED = 1e12, 1.1, 1e-9
#: a core is no longer than this share of a hovering gap, for pull-in is to see the law; nor should it be of
#: a texture's depth
SEEN = 0.5


@dataclass(frozen=True)
class Core:
    """The law with its core. Where the finger touches first: the slope of the law over that which the mesh
    resolves, the core's `length` and the `distance` of nodes in mm; the `work` of adhesion in N/mm; and
    whether it `fits` below the gap of a finger that hovers.
    """

    law: Cored
    ratio: float
    length: float
    distance: float
    work: float
    fits: bool

    @property
    def told(self) -> dict[str, float]:
        """Its entry in the provenance of a result."""
        return {"length": self.length, "slope": self.ratio * RESOLVED, "edge": EDGE * self.distance}

    def __str__(self) -> str:
        steep = f"at closing {self.ratio:.3g} times as steep as this mesh resolves"
        if not self.fits:
            return (
                f"{steep}, and a linear law of the same work would reach {self.length:.2g} mm, beyond half "
                "of the hovering gap: the law is kept, and after first touch results depend on mesh and steps"
            )
        return (
            f"{steep}: below {1e3 * self.length:.2g} um a linear law of the same work replaces it (work "
            f"of adhesion {self.work:.2g} N/mm, exact beyond); an edge of contact is right to "
            f"{EDGE * self.distance:.2g} mm, a load to 1 %, a pull-off to 3 %; a finer mesh or a wider "
            'roughness_gap needs less; core = "off" keeps the law, and results depend on the steps'
        )


@dataclass(frozen=True, eq=False)
class Closing:
    """The attraction of a scene where faces close, on its mesh."""

    scene: Scene
    mesh: Mesh

    @cached_property
    def electrics(self) -> Electrics:
        """The attraction between the nodes of the pad and the electrode."""
        return self.scene.electrics.above(self.scene.finger.electrical, self.mesh, self._nodes)

    @cached_property
    def rough(self) -> Any:
        """How far apart the attraction sees rough faces, None where they are smooth."""
        return roughness_below(*self.electrics.attraction, self.scene.roughness_gap)

    @property
    def core(self) -> Core | None:
        """The core that takes the law's place in a run, None where there is none or it does not fit."""
        return self.found if self.found is not None and self.found.fits else None

    @cached_property
    def found(self) -> Core | None:
        """The core, or None where the law needs none or can have none: where only touching nodes carry force
        the work is none, charges that flow and the full field have laws of their own, and a voltage that is
        found asks for forces that go with its square.
        """
        scene, wanted, voltage = self.scene, self.scene.solver.core, self.scene.electrics.largest_voltage
        found = isinstance(scene.voltage, FollowForce) or any(one.gap is not None for one in scene.courses)
        has_none = scene.electrics.resolved or found or not scene.air_layer
        if wanted == "off" or not scene.electrics.acts or has_none or self._full:
            return None
        if isinstance(wanted, str) and not self.snaps:
            return None
        (law, layers), (stiffness, distance, _) = self.electrics.attraction, self._local
        first = self.first
        given = None if isinstance(wanted, str) else wanted
        cored = Cored(law, self._apart, self.resolved * stiffness, given)
        length = np.max((cored.line(voltage, layers).end - self._apart)[first])
        ratio = np.max(self._slope[first] / (self.resolved * stiffness[first]))
        work = np.max(cored.adhesion(voltage, layers))
        fits = given is not None or float(length) <= SEEN * self._gap
        return Core(cored, float(ratio), float(length), float(np.max(distance[first])), float(work), fits)

    @cached_property
    def snaps(self) -> bool:
        """Whether the law itself is steeper than the mesh resolves, so that a node can snap by itself."""
        stiffness, *_ = self._local
        return bool((self._slope > self.resolved * stiffness)[self._low].any())

    @property
    def resolved(self) -> float:
        """`RESOLVED`, half of it of each law beside another one."""
        both = self.scene.adhesion is not None and self.scene.electrics.acts
        return 0.5 * RESOLVED if both else RESOLVED

    @property
    def stiffness(self) -> Floats:
        """E*/h (P,) in MPa/mm of the nodes of the pad."""
        return self._local[0]

    @property
    def first(self) -> Any:
        """Nodes (P,) with which the finger touches first."""
        height = self._local[2]
        return height <= height.min() + FIRST * np.ptp(self.mesh.points[:, 1])

    @property
    def _low(self) -> Any:
        """Nodes (P,) that the finger touches with first."""
        height = self._local[2]
        return height <= height.min() + LOW * np.ptp(self.mesh.points[:, 1])

    @cached_property
    def adhesion(self) -> Softened:
        """The law of adhesion with a line of the same work where it falls faster than the mesh at a node
        resolves, half as fast beside a voltage; core = "off": the law itself.
        """
        law = self.scene.adhesion
        if self.scene.solver.core == "off":
            return Softened(law, self.closed, np.full(self.stiffness.shape, np.inf))
        steepest = np.minimum(self.resolved * self.stiffness, STEEPEST)
        classes = np.floor(np.log(steepest / steepest.max()) / np.log(CLASS) + ROUNDED)
        return Softened(law, self.closed, steepest.max() * CLASS**classes)

    @property
    def adhesion_in_words(self) -> str:
        """What a plan says of it."""
        law: Any = self.scene.adhesion
        work = float(law.potential(self.closed + BEYOND)) - float(law.potential(self.closed))
        begin, end = (1e3 * float(gap[self.first].max()) for gap in (self.adhesion.begin, self.adhesion.end))
        line = ""
        if end > begin:
            line = (
                f"; from {begin:.2g} to {end:.2g} um a linear law of the same work replaces it, the steepest "
                "that this mesh resolves"
            )
        return f"{type(law).__name__}, work of adhesion {work:.2g} N/mm, always on{line}"

    @property
    def trapped(self) -> bool:
        """Whether nodes snap one by one in a run without time, for want of a core; nodes that are attracted
        only while they touch do not.
        """
        scene = self.scene
        still = scene.air_layer and not scene.solver.timed and not scene.electrics.resolved
        return bool(still and scene.electrics.acts and self.core is None and self.snaps)

    @property
    def _nodes(self) -> Ints:
        """Nodes of the pad (P,)."""
        return np.unique(self.mesh.sides_of("pad"))

    @cached_property
    def closed(self) -> float:
        """The gap (mm) of closed faces, the mean one of rough faces without pressure."""
        rough = roughness_of(self.scene.roughness_gap)
        return 0.0 if rough is None else float(rough.separation(0.0))

    @cached_property
    def _apart(self) -> Any:
        """The same as the attraction sees it, one gap or that of each node (P,)."""
        return 0.0 if self.rough is None else self.rough.separation(np.zeros(self._nodes.size))

    @cached_property
    def _slope(self) -> Floats:
        """How fast the traction falls with the gap of closed faces under the largest voltage (P,), MPa/mm."""
        law, layers = self.electrics.attraction
        slope = traction_derivative(law, self._apart, self.scene.electrics.largest_voltage, layers)
        return -np.broadcast_to(slope, self._nodes.shape)

    @cached_property
    def _local(self) -> tuple[Floats, Floats, Floats]:
        """Of each node of the pad (P,) the least E*/h (MPa/mm), the largest h (mm) and its height (mm); cells
        of no stiffness of their own have another's, and resolve everything.
        """
        mesh, laws = self.mesh, self.scene.finger.materials
        sides = mesh.cell_sides
        on_pad = np.isin(sides, self._nodes)
        cell, side = np.nonzero(on_pad.all(axis=2))
        nodes, place = np.unique(sides[cell, side], return_inverse=True)
        corners = mesh.points[sides[cell, side][:, : 2 * (mesh.dim - 1)]]
        longest = np.linalg.norm(np.roll(corners, 1, axis=1) - corners, axis=2).max(axis=1) / mesh.order
        modulus = np.full(mesh.region.max() + 1, RIGID)
        for name, law in laws.items():
            if (found := plane_modulus(split(law, mesh.dim), mesh.dim)) > 0.0:
                modulus[mesh.region_names[name]] = found
        stiffness, distance = np.full(nodes.size, np.inf), np.zeros(nodes.size)
        for each in place.reshape(len(cell), -1).T:
            np.minimum.at(stiffness, each, modulus[mesh.region[cell]] / longest)
            np.maximum.at(distance, each, longest)
        return stiffness, distance, mesh.points[nodes, 1]

    @property
    def _full(self) -> bool:
        """Whether the attraction is that of the full field."""
        if self.scene.field == "local":
            return False
        from evfem.planning.fieldchoice import chosen_field

        return chosen_field(self.scene, self.mesh).full

    @property
    def _gap(self) -> float:
        """The smallest gap (mm) at which a finger hovers; inf if none does."""
        heights = (one.indentation or 0.0 for one in self.scene.courses)
        return min((-low for low in heights if low < 0.0), default=np.inf)


def unseen(closing: Closing) -> str | None:
    """A sentence for a core that is long beside the depth of a texture, else None."""
    core, surface = closing.core, closing.scene.ground
    if core is None or surface.is_flat:
        return None
    depth = path_depth(closing.scene, closing.mesh, core.distance)
    if core.length <= SEEN * depth or depth == 0.0:
        return None
    return (
        f"the attraction is changed below {core.length:.2g} mm, more than half of the texture's depth of "
        f"{depth:.2g} mm: the mesh is too coarse for this voltage there"
    )
