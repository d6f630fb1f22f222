"""The regions of a mesh."""

from __future__ import annotations

from itertools import cycle
from typing import TYPE_CHECKING

from evfem.mesh.mesh import Mesh
from evfem.plotting.colours import REGIONS
from evfem.plotting.fields import rounds
from evfem.plotting.figures import axes_or_new, whole_figure
from evfem.plotting.finger import check_plane

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def regions(mesh: Mesh, ax: Axes | None = None) -> Axes:
    """The cells of an undeformed mesh, each region in a colour of its own:
    `regions(finger.mesh())`.
    """
    from matplotlib.collections import PolyCollection

    check_plane(mesh)
    own, ax = ax is None, axes_or_new(ax)
    if own:  # a legend beside axes in true proportions is cut off otherwise
        whole_figure(ax).set_layout_engine("compressed")
    outlines = mesh.points[rounds(mesh)]
    for (name, number), color in zip(mesh.region_names.items(), cycle(REGIONS), strict=False):
        cells, label = list(outlines[mesh.region == number]), name.replace("_", " ")
        ax.add_collection(
            PolyCollection(cells, facecolors=color, edgecolors="white", linewidths=0.2, label=label)
        )
    ax.set_aspect("equal")
    ax.autoscale_view()
    ax.set_xlabel("x (mm)")
    ax.set_ylabel("y (mm)")
    ax.legend(loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False)
    return ax
