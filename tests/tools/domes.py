"""Domes of hexahedra: small fingers in three dimensions with a round underside."""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

import evfem as ev
from evfem.finger.fingerpad import Electrical
from evfem.mesh.mesh import raised
from tools.solids import block


def dome(divisions=(5, 2, 5), size=(4.0, 2.0, 4.0), radius=6.0, order=1, spread=None, along=(0, 2)):
    """A block whose underside is a paraboloid of this radius `along` some axes, its lowest point in the
    origin, on a bone above it; `spread` maps x and z of a block from -1 to 1 to where they shall be.
    """
    mesh = block(divisions, size)
    middle = np.array([0.5 * size[0], 0.0, 0.5 * size[2]])
    points = mesh.points - middle
    if spread is not None:
        points[:, ::2] = spread(points[:, ::2] / middle[::2]) * middle[::2]
    low = 0.5 * (points[:, along] ** 2).sum(axis=1) / radius
    points[:, 1] = low + points[:, 1] / size[1] * (size[1] - low)
    sets = {"pad": mesh.node_sets["bottom"], "bone": mesh.node_sets["top"]}
    mesh = replace(mesh, points=points, node_sets=sets)
    if order == 2:
        mesh = raised(mesh)
        pad = mesh.points[mesh.node_sets["pad"]]
        mesh.points[mesh.node_sets["pad"], 1] = 0.5 * (pad[:, 0] ** 2 + pad[:, 2] ** 2) / radius
    return mesh


def cylinder(length, cells, divisions=(8, 2), radius=6.0):
    """A block of 4 x 2 mm whose underside is a parabola along x, the same along z, below a bone."""
    return dome((*divisions, cells), (4.0, 2.0, length), radius, along=(0,))


@dataclass(frozen=True)
class Dome:
    """A dome as a scene's finger."""

    shape: Any = field(default_factory=dome)
    law: Any = field(default_factory=lambda: ev.NeoHookean(E=0.1, nu=0.45))
    electrical: Any = field(default_factory=lambda: Electrical(stratum_corneum_thickness=0.38))
    viscosity: float = 0.0
    region: str = "lower"

    @property
    def materials(self):
        return {self.region: self.law}

    def mesh(self, order=2):
        return self.shape if order == 1 else raised(self.shape)


#: a display at which a dome touches with a dozen nodes
DISPLAY = ev.Display(insulator=ev.Layer(thickness=0.09, eps_r=3.35), friction=0.3)
LINEAR = ev.Solver(element="hex8")


def dome_scene(*motion, finger=None, surface=DISPLAY, **other):
    """A dome of linear hexahedra on a display under 1000 V."""
    settings = {"law": ev.Kaczmarek(), "voltage": 1000.0, "solver": LINEAR} | other
    return ev.Scene(finger or Dome(), surface, motion=list(motion), **settings)
