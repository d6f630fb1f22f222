r"""The skin that faces the surface, in three dimensions: pad nodes, tributary areas projected on the
plane of the display, gross and real contact areas. The twin of `evfem.surface.pad`.

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
from evfem.mesh.faces import shape_functions
from evfem.mesh.mesh import Mesh
from evfem.surface.pad import OVERSHOT, sides_of_pad, widened

#: the faces between neighbouring nodes of a biquadratic one
QUARTERS = np.array([[0, 4, 8, 7], [4, 1, 5, 8], [8, 5, 2, 6], [7, 8, 6, 3]])


@dataclass(frozen=True, eq=False)
class Skin:
    """Pad nodes of a mesh of hexahedra: mesh numbers `nodes` (P,), `faces` (K, 4|9) as indices into them,
    counter-clockwise from outside, and which may touch (those not on the bone), `free` (P,) bool.
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
        """Tributary area on the display where the skin faces down, mm2: (..., P) for (..., P, 3)."""
        first, second = self._ways(position)
        area = np.maximum(first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0], 0.0)
        shared = np.einsum("...kg,gm->...km", area, self._gauss[0])
        rows = shared.reshape(-1, self.faces.size)
        size = position.shape[-2]
        found = np.stack([np.bincount(self.faces.ravel(), row, size) for row in rows])
        return np.asarray(found.reshape(position.shape[:-1]))

    def tributary_between(self, begin: Floats, end: Floats, x: Floats) -> Floats:
        """The mean area on the way from positions (P, 3) to others."""
        return 0.5 * (self.tributary(begin) + self.tributary(end))

    def tributary_gradient(self, position: Floats) -> tuple[Ints, Ints, Floats]:
        """Derivative of the tributary areas as triplets (node, moved unknown 3 j + a, value)."""
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

    def tributary_curvature(self, position: Floats, weight: Floats) -> tuple[Ints, Ints, Floats]:
        """Second derivatives of the sum of `weight` (P,) times the areas, as triplets (moved unknown, moved
        unknown, value): of x by z and of z by x.
        """
        first, second = self._ways(position)
        facing = first[..., 0] * second[..., 1] > first[..., 1] * second[..., 0]
        value, slope = self._gauss
        at = np.einsum("gm,km->kg", value, weight[self.faces]) * facing
        turn = np.einsum("gi,gj->gij", slope[:, :, 0], slope[:, :, 1])
        values = np.einsum("kg,gij->kij", at, turn - turn.transpose(0, 2, 1))
        x, z = np.broadcast_arrays(3 * self.faces[:, :, None], 3 * self.faces[:, None, :] + 2)
        pairs = [each.ravel() for each in (x, z, values)]
        return np.append(pairs[0], pairs[1]), np.append(pairs[1], pairs[0]), np.tile(pairs[2], 2)

    @property
    def _quarters(self) -> Ints:
        """Bilinear faces (4 K or K, 4) between neighbouring nodes."""
        return self.faces if self.faces.shape[1] == 4 else self.faces[:, QUARTERS].reshape(-1, 4)

    @cached_property
    def _rows(self) -> Ints:
        """Nodes (3, R), each between two opposite neighbours of the four that it has."""
        node, size = self._quarters, self.nodes.size
        here, onward = (node * size + np.roll(node, -1, axis=1)).ravel(), np.roll(node, 1, axis=1).ravel()
        order = np.argsort(here)
        here, onward = here[order], onward[order]

        def turned(about: Ints, neighbour: Ints) -> Ints:
            at = np.minimum(np.searchsorted(here, about * size + neighbour), here.size - 1)
            return np.where(here[at] == about * size + neighbour, onward[at], -size)

        about, first = here // size, here % size
        opposite = turned(about, turned(about, first))
        back = turned(about, turned(about, opposite))
        found = (opposite >= 0) & (back == first) & (first < opposite)
        return np.stack([first, about, opposite])[:, found]

    def spacing_at(self, position: Floats) -> Floats:
        """Distance of nodes from their neighbours (P,) in mm on the display: the smaller one of both axes."""
        before, node, after = self._rows
        flat, found = position[:, [0, 2]], np.full(self.nodes.size, self.spacing(position))
        np.minimum.at(found, node, 0.5 * np.linalg.norm(flat[after] - flat[before], axis=1))
        return found

    def areas(self, position: Floats, reach: Floats) -> tuple[float, float]:
        """Gross (convex hull) and real contact area (mm2) of nodes at (P, 3) with this `reach` (P,).

        Every face between four nodes is four triangles around its middle; contact ends where the linear reach
        changes sign, less `OVERSHOT` of the distance across, or of less where little touches around.
        """
        reach = widened(reach, self._rows)
        corners = np.stack([position[:, 0], position[:, 2], reach], axis=1)[self._quarters]
        down = _cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]) > 0.0
        values = corners[down]
        middle = np.broadcast_to(values.mean(axis=1, keepdims=True), values.shape)
        triangles = np.stack([values, np.roll(values, -1, axis=1), middle], axis=2).reshape(-1, 3, 3)
        inside, line = _clipped(triangles)
        edges = np.diff(line[..., :2], axis=1)
        sides = np.stack([values[:, 1] - values[:, 0], values[:, 2] - values[:, 1]], axis=1)[..., :2]
        sides += np.stack([values[:, 2] - values[:, 3], values[:, 3] - values[:, 0]], axis=1)[..., :2]
        strip = 0.5 * np.linalg.norm(_cross(np.repeat(sides, 4, axis=0), edges), axis=1)
        faces, covered = self._quarters[down], inside.reshape(-1, 4).sum(axis=1)
        near = np.bincount(faces.ravel(), np.repeat(covered, 4), self.nodes.size)[faces].mean(axis=1)
        cut = OVERSHOT * float(np.minimum(strip.reshape(-1, 4).sum(axis=1), near).sum())
        border, real = np.linalg.norm(edges[:, 0], axis=1), float(inside.sum()) - cut
        if not real > 0.0:
            return 0.0, 0.0
        touches = triangles[triangles[..., 2] > 0.0]
        hull, around = _hull(np.concatenate([touches, line[border > 0.0].reshape(-1, 3)])[:, :2])
        return max(hull - around * (cut / max(border.sum(), 1e-300)), real), real

    def spacing(self, points: Floats) -> float:
        """Median length (mm) of the faces' edges from corner to corner; points (P, 3)."""
        corners = points[self.faces[:, :4]]
        return float(np.median(np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)))

    def facing(self, position: Floats) -> Any:
        """Faces that face down at their centre, (K,) bool."""
        _, slope = shape_functions(self.faces.shape[1], np.zeros((1, 2)))
        flat = position[self.faces][..., [0, 2]]
        first, second = (np.einsum("kma,m->ka", flat, slope[0, :, i]) for i in (0, 1))
        return first[:, 0] * second[:, 1] > first[:, 1] * second[:, 0]

    def fold(self, position: Floats, touching: Any, down: Any) -> float | None:
        """x (mm) of a face that touches and has turned up although it faced `down` (K,); None without."""
        turned = np.flatnonzero(down & touching[self.faces].all(axis=1) & ~self.facing(position))
        return float(position[self.faces[turned[0]], 0].mean()) if turned.size else None


def _cross(a: Floats, b: Floats) -> Floats:
    """a x b (...) of vectors (..., c) by their first two components."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _clipped(triangles: Floats) -> tuple[Floats, Floats]:
    """Area (T,) of the part of triangles (T, 3, c), at x and z in their first two values, in which the
    third one is positive; and the ends (T, 2, c) of the line that bounds it, a point where none does.
    """
    positive = triangles[..., 2] > 0.0
    count = positive.sum(axis=1)
    odd = np.where(count == 1, positive.argmax(axis=1), positive.argmin(axis=1))
    first, second, third = (
        np.take_along_axis(triangles, ((odd + i) % 3)[:, None, None], axis=1)[:, 0] for i in range(3)
    )
    mixed = (count == 1) | (count == 2)
    whole = np.abs(0.5 * _cross(second - first, third - first))
    sides = np.stack([second, third], axis=1)
    fall = np.where(mixed[:, None], first[:, None, 2] - sides[..., 2], 1.0)
    edges = np.where(mixed[:, None], first[:, None, 2] / fall, 0.0)
    corner = edges.prod(axis=1) * whole
    line = first[:, None] + edges[..., None] * (sides - first[:, None])
    return np.where(count == 1, corner, np.where(count > 1, whole - corner, 0.0)), line


def _hull(points: Floats) -> tuple[float, float]:
    """Area and circumference of the convex hull of points (n, 2), by the monotone chain of their lower
    and upper halves; area 0 of points on a line. Source: A. M. Andrew, Inf. Process. Lett. 9 (1979)
    216, doi:10.1016/0020-0190(79)90072-3.

    >>> found = _hull(np.array([[0, 0], [2, 0], [2, 1], [0, 1], [1, 0.5], [1, 0.0]]))
    >>> tuple(round(size, 12) for size in found)
    (2.0, 6.0)
    """
    places = points[np.lexsort(points.T[::-1])].tolist()
    corners = np.array((_lower_half(places)[:-1] + _lower_half(places[::-1])[:-1]) or [[0.0, 0.0]])
    (x, z), following = corners.T, np.roll(corners, -1, axis=0)
    area = 0.5 * float(x @ following[:, 1] - z @ following[:, 0])
    return area, float(np.linalg.norm(following - corners, axis=1).sum())


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
