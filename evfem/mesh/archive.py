"""A mesh as arrays of a larger file, and back."""

from __future__ import annotations

import json
from collections.abc import Mapping

import numpy as np

from evfem.mesh.mesh import CELLS, KINDS, Mesh


def mesh_arrays(mesh: Mesh) -> dict[str, np.ndarray]:
    """Everything about a mesh, as `mesh/points`, `mesh/set/pad` ..."""
    arrays = {"mesh/points": mesh.points, "mesh/cells": mesh.cells, "mesh/region": mesh.region}
    arrays |= {f"mesh/set/{name}": np.asarray(nodes) for name, nodes in mesh.node_sets.items()}
    return arrays | {
        "mesh/kind": np.array(mesh.kind),
        "mesh/region_names": np.array(json.dumps({name: int(i) for name, i in mesh.region_names.items()})),
    }


def mesh_of(arrays: Mapping[str, np.ndarray]) -> Mesh:
    """The mesh among the arrays of a file. Raises KeyError or ValueError where it is damaged."""
    kind = str(arrays["mesh/kind"])
    if kind not in KINDS:
        raise ValueError("cells of an unknown kind")
    points, cells, region = (arrays[f"mesh/{name}"] for name in ("points", "cells", "region"))
    prefix = "mesh/set/"
    sets = {key.removeprefix(prefix): a for key, a in arrays.items() if key.startswith(prefix)}
    names = json.loads(str(arrays["mesh/region_names"]))
    if points.ndim != 2 or points.shape[1] != CELLS[kind].dimension or points.dtype.kind != "f":
        raise ValueError("points of the mesh")
    if region.ndim != 1 or cells.shape != (len(region), CELLS[kind].nodes) or region.dtype.kind not in "iu":
        raise ValueError("cells of the mesh")
    if not isinstance(names, dict) or not all(type(number) is int for number in names.values()):
        raise ValueError("names of regions")
    for nodes in (cells, *sets.values()):
        if nodes.dtype.kind not in "iu" or (nodes.size and not 0 <= nodes.min() <= nodes.max() < len(points)):
            raise ValueError("nodes that do not exist")
    return Mesh(points, cells, kind, region, names, sets)
