r"""Whether the mesh resolves the attraction, and the core that takes the law's place where not.

A node of the pad snaps by itself, and a range of contact widths is stable, where the traction p falls
faster with the gap than the mesh lets the skin follow: with the distance h of neighbouring nodes and the
plane modulus :math:`E^* = E / (1 - \nu^2)` of the cells below them, where

.. math:: \chi = -p'(g_0)\, h / E^* > \chi_0 = \tfrac{1}{6} .

:math:`\chi_0` is measured: in blocks, fingers and domes no state was trapped at 1/6, the first ones at
1/5. There a line no steeper than :math:`\chi_0 E^*/h` takes the law's place (`evfem.electrostatics.core`).
What is left are the errors of a cohesive zone that a few nodes resolve: the edge of contact is right to
1.5 node distances, a load at given indentation to 1 %, a pull-off to 3 %.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.electrostatics.core import Cored
from evfem.electrostatics.laws import traction_derivative
from evfem.electrostatics.roughness import roughness_of
from evfem.mesh.mesh import Mesh
from evfem.scene.electrics import Electrics
from evfem.scene.motion import Hover
from evfem.scene.resolution import way
from evfem.scene.scene import Scene
from evfem.tissue.splitlaw import plane_modulus, split

#: slope times node distance over the plane modulus that a mesh resolves
RESOLVED = 1 / 6
#: the lowest nodes, of which a plan speaks: above the lowest one by at most this share of the finger's height
LOWEST = 1e-6
#: error of an edge of contact in node distances
EDGE = 1.5
#: a core longer than this share of a hovering gap, or of a texture's depth, changes what is seen of them
TOO_LONG = 0.5


@dataclass(frozen=True)
class Core:
    """The law with its core. Where the finger touches first: the slope of the law over that which the mesh
    resolves, the core's `length` and the `distance` of nodes in mm; and the `work` of adhesion in N/mm.
    """

    law: Cored
    ratio: float
    length: float
    distance: float
    work: float

    @property
    def told(self) -> dict[str, float]:
        """What a result's provenance says of it."""
        return {"length": self.length, "slope": self.ratio * RESOLVED, "edge": EDGE * self.distance}

    def __str__(self) -> str:
        return (
            f"at closing {self.ratio:.3g} times as steep as this mesh resolves: below "
            f"{1e3 * self.length:.2g} um a line of the same work takes the law's place (work of adhesion "
            f"{self.work:.2g} N/mm, exact beyond); an edge of contact is right to "
            f"{EDGE * self.distance:.2g} mm, a load to 1 %, a pull-off to 3 %; a finer mesh needs less, "
            'rough faces none; core = "off" gives the law itself and answers that depend on the way'
        )


def electrics_of(scene: Scene, mesh: Mesh) -> Electrics:
    """What acts between the nodes of the pad and the electrode."""
    nodes = np.unique(mesh.edges_of("pad") if mesh.dim == 2 else mesh.faces_of("pad"))
    return scene.electrics.above(scene.finger.electrical, mesh, nodes)


def core_of(scene: Scene, mesh: Mesh) -> Core | None:
    """The core of a scene's attraction, or None where it needs none or can have none: where only touching
    nodes carry force the work is none, and charges that flow and the full field have laws of their own.
    """
    wanted, voltage = scene.solver.core, scene.electrics.largest_voltage
    charged = scene.drive is not None and scene.drive.resolved
    has_none = charged or not scene.air_layer or scene.field != "local"
    if wanted == "off" or not scene.electrics.acts or has_none:
        return None
    electrics, rough = electrics_of(scene, mesh), roughness_of(scene.roughness_gap)
    law, layers = electrics.attraction
    closed = 0.0 if rough is None else float(rough.separation(0.0))
    stiffness, distance, first = _local(scene, mesh)
    slope = -np.broadcast_to(traction_derivative(law, closed, voltage, layers), stiffness.shape)
    if isinstance(wanted, str) and not (slope > RESOLVED * stiffness)[stiffness > 0.0].any():
        return None
    cored = Cored(law, closed, RESOLVED * stiffness, None if isinstance(wanted, str) else wanted)
    length = np.max((cored.line(voltage, layers).end - closed)[first])
    ratio = np.max(slope[first] / (RESOLVED * stiffness[first]))
    work = np.max(cored.adhesion(voltage, layers))
    return Core(cored, float(ratio), float(length), float(np.max(distance[first])), float(work))


def _local(scene: Scene, mesh: Mesh) -> tuple[Floats, Floats, Any]:
    """E*/h (MPa/mm) and h (mm) at each node of the pad (P,), of the softest and largest cell there; and
    which nodes are lowest.
    """
    sides = mesh.cell_edges if mesh.dim == 2 else mesh.cell_faces
    on_pad = np.isin(sides, np.unique(mesh.edges_of("pad") if mesh.dim == 2 else mesh.faces_of("pad")))
    cell, side = np.nonzero(on_pad.all(axis=2))
    nodes, place = np.unique(sides[cell, side], return_inverse=True)
    corners = mesh.points[sides[cell, side][:, : 2 * (mesh.dim - 1)]]
    longest = np.linalg.norm(np.roll(corners, 1, axis=1) - corners, axis=2).max(axis=1) / mesh.order
    modulus = np.zeros(mesh.region.max() + 1)
    for name, law in scene.finger.materials.items():
        modulus[mesh.region_names[name]] = max(plane_modulus(split(law, mesh.dim), mesh.dim), 0.0)
    stiffness, distance = np.full(nodes.size, np.inf), np.zeros(nodes.size)
    of = place.reshape(len(cell), -1).T
    for nodes_of in of:
        np.minimum.at(stiffness, nodes_of, modulus[mesh.region[cell]] / longest)
        np.maximum.at(distance, nodes_of, longest)
    height = mesh.points[nodes, 1]
    return stiffness, distance, height <= height.min() + LOWEST * np.ptp(mesh.points[:, 1])


def too_long(scene: Scene, mesh: Mesh) -> Iterator[str]:
    """A sentence for a core that is long beside a hovering gap or the depth of a texture."""
    core = core_of(scene, mesh)
    if core is None:
        return
    gaps = [motion.gap for motion in scene.motion if isinstance(motion, Hover) and motion.gap > 0.0]
    surface: Any = scene.ground
    lengths = {"hovering gap": min(gaps, default=np.inf)}
    if not surface.is_flat:
        lengths["depth of the texture"] = float(np.ptp(surface.height(way(scene, mesh, core.distance))))
    for name, length in lengths.items():
        if core.length > TOO_LONG * length > 0.0:
            yield (
                f"the attraction is changed below {core.length:.2g} mm, more than half of the {name} of "
                f"{length:.2g} mm: the mesh is too coarse for this voltage there"
            )
