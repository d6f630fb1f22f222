"""Fig. 3: mesh of the finger's cross-section, nodes and elements layer by layer.

Expected (the paper): 23,139 nodes and 21,150 elements; its layers' nodes add up to the same 23,139, so that
nodes between two layers count for both. The paper gives counts and a picture, no positions: the mesh here
(`resolution="paper"`) has as many rows of elements in each layer as its counts allow.
"""

from functools import partial

import numpy as np

import evfem as ev
from evfem import plotting
from evfem.mesh.mesh import Mesh

from .common import Series, Study
from .plots import Figure, panels
from .printed import Printed

PLACE = "caption"
COUNTS = "the paper gives counts and no positions; rows and columns of cells are chosen near its counts"
NODES = {"stratum_corneum": 2240, "epidermis": 10998, "dermis": 8208, "hypodermis": 1434, "nail": 259}
ELEMENTS = {"stratum_corneum": 1662, "epidermis": 10281, "dermis": 7677, "hypodermis": 1314, "nail": 216}
TWICE = (
    "the layers' printed nodes add up to the printed total: it counts nodes between two layers twice, as "
    "here the sum over the layers does"
)
PAPER = {
    "elements": Printed("21,150", "elements", "", PLACE, COUNTS),
    "nodes": Printed("23,139", "nodes", "", PLACE, TWICE),
    "nodes_of_all_layers": Printed("23,139", "nodes of the layers, added up", "", PLACE, COUNTS),
}
PAPER |= {
    f"elements.{name}": Printed(
        f"{count:,}",
        f"elements, {name.replace('_', ' ')}",
        "",
        PLACE,
        COUNTS + "; the caption calls the epidermis' 10,281 elements nodes" * (name == "epidermis"),
    )
    for name, count in ELEMENTS.items()
}
PAPER |= {
    f"nodes.{name}": Printed(f"{count:,}", f"nodes, {name.replace('_', ' ')}", "", PLACE, COUNTS)
    for name, count in NODES.items()
}
ASSUMPTIONS = {
    "mesh": "FingerPad(resolution='paper'); cells count as four-node quadrilaterals, as in the paper"
}


def main(quick: bool = False) -> Study:
    """Count the nodes and elements of the layers; draw the mesh."""
    mesh = ev.FingerPad(resolution="coarse" if quick else "paper").mesh(1)
    cells = {name: mesh.cells[mesh.region == number] for name, number in mesh.region_names.items()}
    numbers = {f"elements.{name}": len(own) for name, own in cells.items()}
    numbers |= {f"nodes.{name}": len(np.unique(own)) for name, own in cells.items()}
    numbers |= {"elements": len(mesh.cells), "nodes": len(mesh.points)}
    numbers["nodes_of_all_layers"] = sum(numbers[f"nodes.{name}"] for name in cells)
    names = list(cells)
    series = [
        Series(what, names, [numbers[f"{what}.{name}"] for name in names], f"{what} over layer")
        for what in ("elements", "nodes")
    ]
    return Study("fig03", numbers, PAPER, ASSUMPTIONS, series, partial(_draw, mesh))


def _draw(mesh: Mesh) -> Figure:
    figure, (whole, near) = panels(3.6, 2, 9.0, width_ratios=[1.2, 1.0])
    for ax in (whole, near):
        plotting.regions(mesh, ax)
        ax.get_legend().remove()
    for layer in whole.collections:  # lines as wide as cells would hide their colour
        layer.set_linewidth(0.03)
    near.set(xlim=(-1.4, 1.4), ylim=(-6.6, -4.2), ylabel="")
    handles, labels = whole.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=5, fontsize="small", frameon=False)
    return figure  # type: ignore[no-any-return]
