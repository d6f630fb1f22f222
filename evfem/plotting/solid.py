"""A finger in three dimensions as it is deformed: the half behind its middle, seen from below and in front.

Stress and displacement have smooth colours on all faces, averaged at the nodes within each region; fields of
the pad colour the skin, and what is not touched by a traction is skin without a colour. A line is the
contour of contact.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.errors import InputError, describe_value
from evfem.mesh.split import nodal_means, split
from evfem.plotting.fields import CELL_FIELDS, TRACTIONS, Scale, Window, values_of
from evfem.plotting.figures import EDGE, TISSUE, contour_of_contact, shaded
from evfem.plotting.meshes import cut_open, seen
from evfem.simulation.result import POINT_FIELDS, Frame, Result

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MARGIN = 0.03  # around the finger, as a fraction of its width


@dataclass(frozen=True, eq=False)
class SolidView:
    """A frame of a result in space, cut open; methods as `evfem.plotting.finger.View`."""

    result: Result
    frame: Frame
    field: str
    smooth: bool = True

    @property
    def scaled_as(self) -> str:
        """The field whose scale it has: the magnitude of the shear has no sign."""
        return "contact_pressure" if self.field == "shear_traction" else self.field

    @cached_property
    def _faces(self) -> tuple[Ints, Ints, Floats]:
        """Corners (K, 4) of the faces that are seen, from the farthest on, their cells (K,), and the places
        (N, 2) of all nodes in the picture.
        """
        faces, cells = cut_open(self.result.mesh)
        points = self.result.mesh.points + self.frame.displacement
        order, places, _ = seen(points, faces[:, :4])
        return faces[order, :4], cells[order], places

    @cached_property
    def _values(self) -> Floats:
        """The field at the corners of the faces (K, 4), NaN where there is none."""
        mesh, (faces, cells, _) = self.result.mesh, self._faces
        values = values_of(self.frame, self.field).astype(float)
        if self.field in CELL_FIELDS:
            return (
                self._averages(values, faces, cells) if self.smooth else np.repeat(values[cells, None], 4, 1)
            )
        found = values[faces]
        if self.field in POINT_FIELDS:
            pad = np.isin(faces, mesh.node_sets["pad"]).all(axis=1)
            found[~pad | (self.field in TRACTIONS) & ~found.any(axis=1)] = np.nan
        return found if self.smooth else np.repeat(found.mean(axis=1, keepdims=True), 4, 1)

    def _averages(self, values: Floats, faces: Ints, cells: Ints) -> Floats:
        """Means of the cells around a node, within the region of a face's cell."""
        mesh, (apart, _) = self.result.mesh, split(self.result.mesh)
        corners = (mesh.cells[cells][:, :, None] == faces[:, None]).argmax(axis=1)
        return nodal_means(apart, values)[np.take_along_axis(apart.cells[cells], corners, axis=1)]

    @property
    def _contact(self) -> tuple[Ints, Any]:
        """Triangles (T, 3) of the pad's faces that are seen, and which of all nodes (N,) touch."""
        faces = self._faces[0]
        pad = faces[np.isin(faces, self.result.mesh.node_sets["pad"]).all(axis=1)]
        return np.concatenate([pad[:, [0, 1, 2]], pad[:, [0, 2, 3]]]), self.frame.contact_status > 0

    def window(self, near: str | Window | None) -> Window:
        """What is shown: left, right, lower and upper end in the picture; InputError for a close-up."""
        if near is not None:
            raise InputError(
                "near", describe_value(near), "None; footprint(result) is near the contact of a solid"
            )
        faces, _, places = self._faces
        (left, low), (right, high) = places[faces].min(axis=(0, 1)), places[faces].max(axis=(0, 1))
        aside = MARGIN * (right - left)
        return left - aside, right + aside, low - aside, high + aside

    def shown(self, window: Window) -> Floats:
        """The values that are seen."""
        return self._values[np.isfinite(self._values)]

    def draw(self, ax: Axes, window: Window, scale: Scale) -> Any:
        """Draw the view into axes, and return what a colour bar needs."""
        from matplotlib.collections import LineCollection, PolyCollection

        faces, _, places = self._faces
        ax.add_collection(PolyCollection(list(places[faces]), facecolors=TISSUE, edgecolors=TISSUE))
        known = np.isfinite(self._values).all(axis=1)
        corners, values = places[faces[known]].reshape(-1, 2), self._values[known].ravel()
        first = 4 * np.arange(known.sum())[:, None]
        triangles = (first + np.array([0, 1, 2, 0, 2, 3])).reshape(-1, 3)
        mapped = shaded(ax, corners, triangles, values) if known.any() else ax.scatter([], [], c=[])
        scale.apply(mapped)
        mapped.set_rasterized(True)
        outline = LineCollection(
            list(places[faces[:, [0, 1, 2, 3, 0]]]), colors=EDGE, linewidths=0.1, alpha=0.4
        )
        ax.add_collection(outline)
        contour_of_contact(ax, places, *self._contact)
        ax.set(xlim=window[:2], ylim=window[2:], aspect="equal")
        ax.set_axis_off()
        return mapped
