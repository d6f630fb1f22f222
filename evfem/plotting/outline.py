"""Fields of the pad: the outline in their colours, tractions as arrows as well.

A node has its colour on its half of the edges beside it, as it has its share of their length in
the model. Arrows are the tractions on the finger: contact pressure pushes along the normal of the
surface, shear along its tangent, attraction pulls down. Pressure and shear stand in the surface,
attraction begins at the outline.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.mesh.mesh import Mesh
from evfem.plotting.colours import EDGE, TISSUE
from evfem.plotting.fields import Scale, Window, rounds, values_of, within
from evfem.plotting.ground import Height
from evfem.simulation.result import Frame

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: most arrows across a picture, and the longest one as a share of the surface's depth in it
MOST_ARROWS, LONGEST = 36, 0.8
TRACTIONS = ("contact_pressure", "shear_traction", "electrostatic_traction")


def draw_outline(ax: Axes, mesh: Mesh, frame: Frame, field: str, scale: Scale) -> Any:
    """The tissue in one pale colour and the pad's outline in the colours of the field (a
    LineCollection).
    """
    from matplotlib.collections import LineCollection, PolyCollection

    points = mesh.points + frame.displacement
    ax.add_collection(PolyCollection(list(points[rounds(mesh)]), facecolors=TISSUE, edgecolors=TISSUE))
    nodes, halves = half_edges(mesh, points)
    values = values_of(frame, field)[nodes]
    if field in TRACTIONS:  # where there is none, the outline is a line and no colour
        halves, values = halves[values != 0.0], values[values != 0.0]
    lines = LineCollection(list(halves), array=values, linewidths=3.5, zorder=3)
    scale.apply(lines)
    lines.set_capstyle("round")
    return ax.add_collection(lines)


def half_edges(mesh: Mesh, points: Floats) -> tuple[Ints, Floats]:
    """The pad's edges in halves (H, 2, 2), and the node that each belongs to (H,)."""
    edges = mesh.edges_of("pad")
    pairs = edges[:, :2] if edges.shape[1] == 2 else np.concatenate([edges[:, [0, 2]], edges[:, [2, 1]]])
    start, end = points[pairs[:, 0]], points[pairs[:, 1]]
    middle = 0.5 * (start + end)
    halves = np.concatenate([np.stack([start, middle], axis=1), np.stack([middle, end], axis=1)])
    return np.concatenate([pairs[:, 0], pairs[:, 1]]), halves


def draw_arrows(ax: Axes, mesh: Mesh, frame: Frame, field: str, height: Height, window: Window) -> Any:
    """The tractions on the finger as arrows (a Quiver), the longest ones where they are largest.

    Of neighbouring nodes only the one with the largest traction has an arrow.
    """
    values, place = values_of(frame, field), mesh.points + frame.displacement
    nodes = _thinned(place, np.where(within(place, window), np.abs(values), 0.0), window)
    if not nodes.size:
        return None
    x, size = place[nodes, 0], values[nodes] / np.abs(values[nodes]).max()
    at, width = np.column_stack([x, height(x)]), window[1] - window[0]
    longest = LONGEST * max(at[:, 1].min() - window[2], 0.05 * (window[3] - window[2]))
    normal = _normals(height, x, 1e-4 * width)
    if field == "contact_pressure":
        arrows, pivot = size[:, None] * normal * longest, "tip"
    elif field == "shear_traction":
        along = np.column_stack([normal[:, 1], -normal[:, 0]])
        arrows, pivot = size[:, None] * along * 1.5 * width / MOST_ARROWS, "middle"
        at = at - 0.4 * longest * normal
    else:
        arrows, pivot, at = size[:, None] * np.array([0.0, -longest]), "tail", place[nodes]
    quiver = ax.quiver(*at.T, *arrows.T, angles="xy", scale_units="xy", scale=1.0, width=0.0028, pivot=pivot)
    quiver.set(color=EDGE, zorder=4)
    return quiver


def _thinned(place: Floats, size: Floats, window: Window) -> Ints:
    """The node with the largest size of each of so many strips of the window, none where it is 0."""
    strip = np.floor((place[:, 0] - window[0]) / (window[1] - window[0]) * MOST_ARROWS)
    order = np.lexsort([-size, strip])
    order = order[size[order] > 0.0]
    _, first = np.unique(strip[order], return_index=True)
    return order[first]


def _normals(height: Height, x: Floats, step: float) -> Floats:
    """Unit normals (n, 2) of the surface, towards the finger."""
    slope = (height(x + step) - height(x - step)) / (2.0 * step)
    return np.column_stack([-slope, np.ones_like(slope)]) / np.sqrt(1.0 + slope**2)[:, None]
