"""A sentence for each wrong mesh, whoever made it."""

import meshio
import numpy as np
import pytest
from tools.mesh_parts import REGIONS, of_kind, raw

from evfem.errors import InputError
from evfem.mesh import file as meshfile
from evfem.mesh.mesh import Mesh, raised
from evfem.meshes.benchmark import benchmark_mesh


def shifted_copy(gap):
    """Two bodies side by side."""
    mesh = benchmark_mesh(0)
    n = len(mesh.points)
    points = np.vstack([mesh.points, mesh.points + np.array([gap, 0.0])])
    sets = {name: np.append(nodes, nodes + n) for name, nodes in mesh.node_sets.items()}
    region = np.tile(mesh.region, 2)
    return Mesh(points, np.vstack([mesh.cells, mesh.cells + n]), "quad", region, mesh.region_names, sets)


def curl():
    """A strip of cells that goes round by more than a turn, so that its end lies over its beginning."""
    angle = np.linspace(0.0, 2.2 * np.pi, 45)
    rings = [r * np.column_stack([np.cos(angle), np.sin(angle)]) for r in (3.0, 4.0)]
    node = np.arange(90).reshape(2, 45)
    cells = np.stack([node[0, :-1], node[1, :-1], node[1, 1:], node[0, 1:]], axis=1)
    points = np.vstack(rings) + np.column_stack([0.003 * np.arange(90), np.zeros(90)])
    return Mesh(points, cells, "quad", np.zeros(44, int), {"tissue": 0}, {"pad": node[1], "bone": node[0]})


def hanging():
    """A cell whose upper edge meets two cells: their common node hangs on it (a side column joins them)."""
    points = np.array(
        [[0, 0], [4, 0], [4, 2], [0, 2], [2, 2], [0, 4], [2, 4], [4, 4], [6, 0], [6, 2], [6, 4.0]]
    )
    cells = np.array([[0, 1, 2, 3], [3, 4, 6, 5], [4, 2, 7, 6], [1, 8, 9, 2], [2, 9, 10, 7]])
    sets = {"pad": np.array([0, 1]), "bone": np.array([5, 6, 7])}
    return Mesh(points, cells, "quad", np.zeros(5, int), {"tissue": 0}, sets)


def changed_cells(change):
    mesh = benchmark_mesh(0)
    cells, region = change(mesh.cells.copy(), mesh.region)
    return {"cells": [("quad", cells)], "cell_data": {"region": [region]}}


def moved(node, place, mesh=None):
    mesh = benchmark_mesh(0) if mesh is None else mesh
    points = mesh.points.copy()
    points[node] = place
    return raw(Mesh(points, mesh.cells, mesh.kind, mesh.region, mesh.region_names, mesh.node_sets))


def scaled(factor):
    return {"points": raw()["points"] * factor}


def without(name, value=0.0):
    data = raw()["point_data"]
    if value is None:
        del data[name]
    else:
        data[name] = np.full(793, value)
    return {"point_data": data}


def crossed(cells, region):
    cells[17] = cells[17, [0, 1, 3, 2]]
    return cells, region


QUAD8 = {"cells": [("quad8", of_kind("quad9").cells[:, :8])]}
MIXED = {
    "cells": [("quad", benchmark_mesh(0).cells[:-1]), ("triangle", benchmark_mesh(0).cells[-1:, :3])],
    "cell_data": {"region": [benchmark_mesh(0).region[:-1], benchmark_mesh(0).region[-1:]]},
}

WRONG = {
    "eight-node quads": (raw(of_kind("quad9")) | QUAD8, "quad8 has no middle node"),
    "quads and triangles": (MIXED, "quad and triangle cells"),
    "lines only": ({"cells": [("line", np.array([[0, 1]]))], "cell_data": {}}, "no two-dimensional cells"),
    "tetrahedra": ({"cells": [("tetra", np.array([[0, 1, 2, 70]]))], "cell_data": {}}, "tetra cells"),
    "not a number": (moved(5, [np.nan, 0.0]), "no finite coordinates at node 5"),
    "infinite": (moved(5, [np.inf, 0.0]), "no finite coordinates at node 5"),
    "not plane": ({"points": raw()["points"] + np.arange(793)[:, None] * [0, 0, 1.0]}, "a plane mesh"),
    "metres": (scaled(1e-3), "between 1 and 200 mm"),
    "micrometres": (scaled(1e3), "between 1 and 200 mm"),
    "orphan nodes": (changed_cells(lambda c, r: (c[1:], r[1:])), "1 nodes that no cell uses (node 0)"),
    "double nodes": (raw(shifted_copy(0.0)), "nodes at the same position (nodes"),
    "bow tie": (changed_cells(crossed), "cells (cell 17"),
    "tangled cell": (moved(61 * 5 + 30, [0.0, -2.0]), "cells (cell"),
    "tangled mid-node": (
        moved(raised(benchmark_mesh(0)).cells[80, 4], [0.0, -3.0], raised(benchmark_mesh(0))),
        "tangled cells",
    ),
    "cell twice": (
        changed_cells(lambda c, r: (np.vstack([c, c[60:61]]), np.append(r, r[60]))),
        "do not overlap",
    ),
    "separate parts": (raw(shifted_copy(30.0)), "2 separate parts"),
    "overlap of neighbours": (raw(curl()), "crosses or touches itself"),
    "hanging node": (raw(hanging()), "crosses or touches itself"),
    "no pad": (without("pad", None), "no boundary pad (it has bone)"),
    "no bone": (without("bone", None), "no boundary bone (it has pad)"),
    "empty pad": (without("pad"), "no node in pad"),
    "pad of NaN": (without("pad", np.nan), "NaN in point data `pad`"),
    "pad on the bone": (
        {"point_data": raw()["point_data"] | {"pad": raw()["point_data"]["bone"]}},
        "a pad that lies on the bone",
    ),
    "pad without an edge": (
        {"point_data": raw()["point_data"] | {"pad": np.arange(793) == 740.0}},
        "without an edge",
    ),
    "no regions": ({"cell_data": {}}, "without region numbers"),
    "fractional regions": ({"cell_data": {"region": [benchmark_mesh(0).region + 0.5]}}, "no integers"),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_mesh_gets_one_sentence(case, tmp_path, capfd):
    changes, words = WRONG[case]
    changes = {
        k: ({n: v * 1.0 for n, v in d.items()} if k == "point_data" else d) for k, d in changes.items()
    }
    parts = raw() | changes
    meshio.Mesh(**parts).write(tmp_path / "mesh.vtu")
    capfd.readouterr()
    present = np.unique(np.concatenate([np.ravel(r) for r in parts["cell_data"].get("region", [0])]))
    with pytest.raises(InputError) as caught:
        meshfile.read(tmp_path / "mesh.vtu", {name: n for name, n in REGIONS.items() if n in present})
    message = str(caught.value)
    assert words in message
    assert "\n" not in message
    assert caught.value.key == "finger.mesh"
    assert capfd.readouterr() == ("", "")
