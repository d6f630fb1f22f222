"""The footprint: fields of the skin of a finger in three dimensions, seen from below.

x points to the right and z, along the finger, up. Pressure, shear and attraction have smooth colours
between the nodes, statuses one colour for each node's share of the faces around it. What is not
touched by a traction is skin without a colour.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.common.checks import choice
from evfem.errors import InputError
from evfem.mesh.faces import PLACES, shape_functions
from evfem.plotting.fields import TRACTIONS, Scale, Window, frame_of, values_of, within
from evfem.plotting.figures import TISSUE, contour_of_contact, shaded
from evfem.plotting.finger import Near, checked_window, picture
from evfem.plotting.labels import check_result
from evfem.simulation.result import POINT_FIELDS, Frame, Result
from evfem.surface.skin import Skin, make_skin

#: where a node's share of a face ends, each way: at halves of a bilinear face, sixths of a biquadratic one
ENDS = {4: {-1.0: (-1.0, 0.0), 1.0: (0.0, 1.0)}}
ENDS[9] = {-1.0: (-1.0, -2 / 3), 0.0: (-2 / 3, 2 / 3), 1.0: (2 / 3, 1.0)}

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: margin around what is shown as a fraction of its width
MARGIN, AROUND = 0.03, 0.2
#: triangles of a face with 4 or 9 nodes
FANS = {4: [[0, 1, 2], [0, 2, 3]]}
FANS[9] = [[8, i, 4 + i] for i in range(4)] + [[8, 4 + i, (i + 1) % 4] for i in range(4)]


def footprint(
    result: Result,
    field: str = "contact_pressure",
    frame: int = -1,
    ax: Axes | None = None,
    *,
    near: Near = None,
    vmin: float | None = None,
    vmax: float | None = None,
) -> Axes:
    """The skin of a finger in three dimensions from below, coloured by a field, in true proportions; a line
    is the contour of contact, between nodes that touch and others.

    Parameters
    ----------
    result
        A result of a finger in three dimensions.
    field
        `gap`, `contact_pressure`, `shear_traction` (its magnitude), `electrostatic_traction` or
        `contact_status`.
    near
        "contact": a close-up of the contact, or of the smallest gap. A window (left, right, lower,
        upper) of x and z in mm. None: the whole skin.
    frame, ax
        As in `deformed`.
    vmin, vmax
        Range of the colours, the same for panels beside each other, in MPa or mm; None: that of the values
        shown.

    Returns
    -------
    Axes
        The axes of the picture.

    Raises
    ------
    InputError
        Another field or frame, or a plane finger.
    """
    check_result(result)
    choice("field", field, POINT_FIELDS)
    if result.mesh.dim != 3:
        raise InputError("result", "a plane finger", "a finger in three dimensions; deformed(result) else")
    return picture(SkinView(result, frame_of(result, frame), field), near, (vmin, vmax), ax)


@dataclass(frozen=True, eq=False)
class SkinView:
    """A frame of a result in space and the field on its skin; methods as `evfem.plotting.finger.View`."""

    result: Result
    frame: Frame
    field: str

    @property
    def scaled_as(self) -> str:
        """The field whose scale it has: the magnitude of the shear has no sign."""
        return "contact_pressure" if self.field == "shear_traction" else self.field

    @cached_property
    def skin(self) -> Skin:
        return make_skin(self.result.mesh)

    @cached_property
    def position(self) -> Floats:
        """Current positions (P, 3) of the skin's nodes in mm."""
        return (self.result.mesh.points + self.frame.displacement)[self.skin.nodes]

    @property
    def values(self) -> Floats:
        """The field at the skin's nodes (P,)."""
        return values_of(self.frame, self.field)[self.skin.nodes]

    def window(self, near: Near) -> Window:
        """What is shown: left, right, lower and upper end in mm."""
        plane = self.position[:, ::2]
        if near is None:
            return _around(plane, MARGIN)
        if near != "contact":
            return checked_window(near)
        touching, gap = self.frame.contact_status[self.skin.nodes] > 0, self.frame.gap[self.skin.nodes]
        nearest = gap <= np.nanmin(gap) + 0.05 * np.nanmax(gap)
        return _around(plane[touching if touching.any() else nearest], AROUND)

    def shown(self, window: Window) -> Floats:
        """The values inside a window."""
        return self.values[within(self.position[:, ::2], window)]

    def draw(self, ax: Axes, window: Window, scale: Scale) -> Any:
        """Draw the view into axes, and return what a colour bar needs."""
        from matplotlib.collections import PolyCollection

        faces = self.skin.faces[self.skin.facing(self.position)]
        cells = list(self.position[faces[:, :4], ::2])
        ax.add_collection(PolyCollection(cells, facecolors=TISSUE, edgecolors=TISSUE, linewidths=0.3))
        mapped = self._draw_shares(ax, faces) if self.field == "contact_status" else self._draw(ax, faces)
        scale.apply(mapped)
        mapped.set_rasterized(True)
        if self.field != "contact_status":  # whose colours end there
            touching = self.frame.contact_status[self.skin.nodes] > 0
            contour_of_contact(ax, self.position[:, ::2], fans(faces), touching)
        ax.set(xlim=window[:2], ylim=window[2:], aspect="equal", xlabel="x (mm)", ylabel="z (mm)")
        return mapped

    def _draw(self, ax: Axes, faces: Ints) -> Any:
        """Smooth colours in triangles through all nodes."""
        triangles, values = fans(faces), self.values
        if self.field in TRACTIONS:
            triangles = triangles[(values[triangles] != 0.0).any(axis=1)]
        if not len(triangles):
            return ax.scatter([], [], c=[])
        return shaded(ax, self.position[:, ::2], triangles, values)

    def _draw_shares(self, ax: Axes, faces: Ints) -> Any:
        from matplotlib.collections import PolyCollection

        m, shares, values = faces.shape[1], [], []
        for node, corner in enumerate(PLACES[:m]):
            (a, b), (c, d) = (ENDS[m][float(t)] for t in corner)
            value, _ = shape_functions(m, np.array([(a, c), (b, c), (b, d), (a, d)]))
            shares.append(np.einsum("qm,kmc->kqc", value, self.position[faces][..., ::2]))
            values.append(self.values[faces[:, node]])
        array = np.concatenate(values).astype(float)
        mapped = PolyCollection(list(np.concatenate(shares)), array=array, edgecolors="face", linewidths=0.5)
        return ax.add_collection(mapped)


def fans(faces: Ints) -> Ints:
    """Triangles (T, 3) through all nodes of faces (K, 4 or 9)."""
    return np.concatenate([faces[:, fan] for fan in FANS[faces.shape[1]]])


def _around(plane: Floats, margin: float) -> Window:
    """A window around points (n, 2), with so much of their width beyond them."""
    (left, low), (right, high) = plane.min(axis=0).tolist(), plane.max(axis=0).tolist()
    wide = margin * max(right - left, high - low, 1e-3)
    return left - wide, right + wide, low - wide, high + wide
