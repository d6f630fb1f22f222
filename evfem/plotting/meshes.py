"""The regions of a mesh; of a solid the half behind its middle, seen from below and in front."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.mesh.mesh import Mesh
from evfem.plotting.fields import rounds
from evfem.plotting.figures import REGIONS, axes_or_new, whole_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: where a solid is seen from, and what of its colours is left where a face is seen from the side
EYE, DIMMEST = np.array([0.5, -0.65, 0.9]), 0.6
#: what is left of a colour that is used again
DARKER = 0.55
#: nodes around a face: corners, and on quadratic cells the middles of its edges
AROUND = {4: (0, 1, 2, 3), 9: (0, 4, 1, 5, 2, 6, 3, 7)}


def regions(mesh: Mesh, ax: Axes | None = None) -> Axes:
    """The cells of an undeformed mesh, each region in a colour of its own: `regions(finger.mesh())`."""
    own, ax = ax is None, axes_or_new(ax)
    if own:  # a legend beside axes in true proportions is cut off otherwise
        whole_figure(ax).set_layout_engine("compressed")
    if mesh.dim == 3:
        _draw_solid(mesh, ax)
    else:
        _draw_plane(mesh, ax)
    ax.set_aspect("equal")
    ax.autoscale_view()
    ax.legend(loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False)
    return ax


def _draw_plane(mesh: Mesh, ax: Axes) -> None:
    from matplotlib.collections import PolyCollection

    outlines = mesh.points[rounds(mesh)]
    for (name, number), colour in zip(mesh.region_names.items(), colours_of(mesh).values(), strict=True):
        cells, label = list(outlines[mesh.region == number]), name.replace("_", " ")
        patches = PolyCollection(cells, facecolors=colour, edgecolors="white", linewidths=0.2, label=label)
        ax.add_collection(patches)
    ax.set_xlabel("x (mm)")
    ax.set_ylabel("y (mm)")


def _draw_solid(mesh: Mesh, ax: Axes) -> None:
    from matplotlib.collections import PolyCollection

    faces, cells = cut_open(mesh)
    order, places, facing = seen(mesh.points, faces[:, :4])
    outlines = places[faces[order][:, AROUND[faces.shape[1]]]]
    colours = colours_of(mesh)
    plain = np.array([colours[number] for number in mesh.region[cells[order]].tolist()])
    shaded = plain * (DIMMEST + (1.0 - DIMMEST) * facing)[:, None]
    ax.add_collection(PolyCollection(list(outlines), facecolors=shaded, edgecolors="white", linewidths=0.1))
    for name, number in mesh.region_names.items():
        ax.scatter([], [], marker="s", color=colours[number], label=name.replace("_", " "))
    ax.set_axis_off()


def colours_of(mesh: Mesh) -> dict[int, Floats]:
    """Number of a region -> its colour (3,); where the colours begin again they are darker."""
    from matplotlib.colors import to_rgb

    rounds = (divmod(i, len(REGIONS)) for i in range(len(mesh.region_names)))
    shades = [DARKER**again * np.array(to_rgb(REGIONS[i])) for again, i in rounds]
    return dict(zip(mesh.region_names.values(), shades, strict=True))


def seen(points: Floats, corners: Ints) -> tuple[Ints, Floats, Floats]:
    """Which faces (K, 4) are turned towards the eye, from the farthest to the nearest (S,); the places (N, 2)
    of all points in the picture; the cosine (S,) between these faces' normals and the line of sight.
    """
    towards = EYE / np.linalg.norm(EYE)
    right = np.cross([0.0, 1.0, 0.0], towards)
    right /= np.linalg.norm(right)
    corner = points[corners]
    normal = np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1])
    facing = normal @ towards / np.linalg.norm(normal, axis=1)
    order = np.argsort(corner.mean(axis=1) @ towards)
    order = order[facing[order] > 0.0]
    return order, np.column_stack([points @ right, points @ np.cross(towards, right)]), facing[order]


def cut_open(mesh: Mesh) -> tuple[Ints, Ints]:
    """Outer faces (K, 4 or 9), and their cells (K,), of the cells behind the middle of a solid's length."""
    middle = 0.5 * (mesh.points[:, 2].min() + mesh.points[:, 2].max())
    kept = mesh.points[mesh.cells[:, :8], 2].mean(axis=1) < middle
    _, of_cell = mesh.sides
    alone = np.bincount(of_cell[kept].ravel(), minlength=len(of_cell) * 6)[of_cell[kept]] == 1
    cells = np.broadcast_to(np.flatnonzero(kept)[:, None], alone.shape)
    return mesh.cell_sides[kept][alone], cells[alone]
