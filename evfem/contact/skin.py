r"""The skin that faces the surface, in three dimensions: pad nodes, tributary areas projected on the
plane of the display, gross and real contact areas. The twin of `evfem.contact.pad`.

A face of the pad with the shape functions N and its outward normal down carries for its node j

.. math:: A_j = \int N_j\,\max\Bigl(0,\ \frac{\partial x}{\partial\xi}\frac{\partial z}{\partial\eta}
          - \frac{\partial z}{\partial\xi}\frac{\partial x}{\partial\eta}\Bigr)\,d\xi\,d\eta ,

summed at Gauss points, 2 x 2 on bilinear and 3 x 3 on biquadratic faces. The second factor is bilinear
in the nodes' x and z, so the areas' derivative is known. Arrays: P pad nodes in ascending number,
K faces of m nodes, G Gauss points.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.contact.pad import sides_of_pad
from evfem.mesh.faces import PLACES, shape_functions
from evfem.mesh.mesh import Mesh

#: where a node's share of a face ends, each way: at halves of a bilinear face, sixths of a biquadratic one
ENDS = {4: {-1.0: (-1.0, 0.0), 1.0: (0.0, 1.0)}}
ENDS[9] = {-1.0: (-1.0, -2 / 3), 0.0: (-2 / 3, 2 / 3), 1.0: (2 / 3, 1.0)}


@dataclass(frozen=True, eq=False)
class Skin:
    """Pad nodes of a mesh of hexahedra, their faces as indices into them, and which of them may
    touch (those not on the bone).

    `nodes` (P,) mesh numbers; `faces` (K, 4|9) indices into `nodes`, counter-clockwise seen from
    outside; `free` (P,) bool.
    """

    nodes: Ints
    faces: Ints
    free: Any

    @cached_property
    def _gauss(self) -> tuple[Floats, Floats]:
        """Values times weights (G, m) and derivatives (G, m, 2) at the Gauss points."""
        x, w = np.polynomial.legendre.leggauss(2 if self.faces.shape[1] == 4 else 3)
        value, slope = shape_functions(self.faces.shape[1], np.array(list(product(x, x))))
        return value * np.outer(w, w).ravel()[:, None], slope

    def _ways(self, position: Floats) -> tuple[Floats, Floats]:
        """Derivatives of (x, z) by the two coordinates of the faces, (..., K, G, 2) each."""
        flat = position[..., self.faces, :][..., [0, 2]]
        slope = self._gauss[1]
        first, second = (np.einsum("...kma,gm->...kga", flat, slope[:, :, i]) for i in (0, 1))
        return first, second

    def tributary(self, position: Floats) -> Floats:
        """Tributary area of every node projected on the display, where the skin faces down, in
        mm2: (..., P) for positions (..., P, 3).
        """
        first, second = self._ways(position)
        area = np.maximum(first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0], 0.0)
        shared = np.einsum("...kg,gm->...km", area, self._gauss[0])
        rows = shared.reshape(-1, self.faces.size)
        size = position.shape[-2]
        found = np.stack([np.bincount(self.faces.ravel(), row, size) for row in rows])
        return np.asarray(found.reshape(position.shape[:-1]))

    def tributary_gradient(self, position: Floats) -> tuple[Ints, Ints, Floats]:
        """Derivative of the tributary areas, as triplets (node, moved unknown, value); unknown 3 j
        + a is component a of node j.
        """
        first, second = self._ways(position)
        facing = first[..., 0] * second[..., 1] > first[..., 1] * second[..., 0]
        value, slope = self._gauss
        by_x = np.einsum("kg,gm->kgm", second[..., 1], slope[:, :, 0])
        by_x -= np.einsum("kg,gm->kgm", first[..., 1], slope[:, :, 1])
        by_z = np.einsum("kg,gm->kgm", first[..., 0], slope[:, :, 1])
        by_z -= np.einsum("kg,gm->kgm", second[..., 0], slope[:, :, 0])
        moved = np.stack([by_x, by_z]) * facing[..., None]
        values = np.einsum("gi,akgj->akij", value, moved)
        of = np.broadcast_to(self.faces[:, :, None], values.shape)
        unknown = 3 * self.faces[:, None, :] + np.array([0, 2])[:, None, None, None]
        return of.ravel(), np.broadcast_to(unknown, values.shape).ravel(), values.ravel()

    def areas(self, position: Floats, touching: Any) -> tuple[float, float]:
        """Gross and real contact area (mm2): that of the convex hull of the touching nodes' shares,
        and the sum of all shares.
        """
        x, z = position[:, 0], position[:, 2]
        real = float(self.tributary(position)[touching].sum())
        if not real > 0.0:
            return 0.0, 0.0
        m = self.faces.shape[1]
        ends = [list(product(*(ENDS[m][float(t)] for t in place))) for place in PLACES[:m]]
        value = np.stack([shape_functions(m, np.array(corners))[0] for corners in ends])
        facing = (self.tributary(position) > 0.0) & touching
        face, node = np.nonzero(facing[self.faces])
        of_face = self.faces[face]
        outline = np.stack([np.einsum("nqm,nm->nq", value[node], c[of_face]).ravel() for c in (x, z)], axis=1)
        return max(_hull_area(outline), real), real

    def spacing(self, points: Floats) -> float:
        """Median length (mm) of the faces' edges from corner to corner; points (P, 3)."""
        corners = points[self.faces[:, :4]]
        return float(np.median(np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)))

    def facing(self, position: Floats) -> Any:
        """Which faces (K,) look down at their centre."""
        _, slope = shape_functions(self.faces.shape[1], np.zeros((1, 2)))
        flat = position[self.faces][..., [0, 2]]
        first, second = (np.einsum("kma,m->ka", flat, slope[0, :, i]) for i in (0, 1))
        return first[:, 0] * second[:, 1] > first[:, 1] * second[:, 0]


def _hull_area(points: Floats) -> float:
    """Area of the convex hull of points (n, 2), by the monotone chain of their lower and upper
    halves; 0 of points on a line. Source: A. M. Andrew, Inf. Process. Lett. 9 (1979) 216,
    doi:10.1016/0020-0190(79)90072-3.

    >>> round(_hull_area(np.array([[0, 0], [2, 0], [2, 1], [0, 1], [1, 0.5], [1, 0.0]])), 12)
    2.0
    """
    places = points[np.lexsort(points.T[::-1])].tolist()
    corners = _lower_half(places)[:-1] + _lower_half(places[::-1])[:-1]
    x, z = np.array(corners or [[0.0, 0.0]]).T
    return float(0.5 * (x @ np.roll(z, -1) - z @ np.roll(x, -1)))


def _lower_half(places: list[list[float]]) -> list[list[float]]:
    """Corners of the hull below places in the order of the walk."""
    chain: list[list[float]] = []
    for x, z in places:
        while len(chain) > 1:
            (x0, z0), (x1, z1) = chain[-2:]
            if (x1 - x0) * (z - z0) - (z1 - z0) * (x - x0) > 0.0:
                break
            chain.pop()
        chain.append([x, z])
    return chain


def make_skin(mesh: Mesh) -> Skin:
    """The skin of a mesh of hexahedra; raises InputError where no outer face belongs to its pad."""
    return Skin(*sides_of_pad(mesh))
