"""The benchmark's coarsest mesh in other cells, and as the parts of a file."""

import numpy as np

from evfem.mesh.mesh import raised
from evfem.meshes.benchmark import benchmark_mesh
from evfem.meshes.make import triangles

#: numbers of its regions
REGIONS = {"tissue": 0, "skin": 1}


def of_kind(kind):
    """The mesh in cells of a kind."""
    mesh = benchmark_mesh(0)
    mesh = triangles(mesh) if kind.startswith("triangle") else mesh
    return raised(mesh) if kind in ("quad9", "triangle6") else mesh


def raw(mesh=None, **changes):
    """The parts of a `.vtu` file as meshio takes them, some of them replaced."""
    mesh = benchmark_mesh(0) if mesh is None else mesh
    point_data = {
        name: np.isin(np.arange(len(mesh.points)), nodes).astype(float)
        for name, nodes in mesh.node_sets.items()
    }
    parts = {
        "points": np.column_stack([mesh.points, np.zeros(len(mesh.points))]),
        "cells": [(mesh.kind, mesh.cells)],
        "point_data": point_data,
        "cell_data": {"region": [mesh.region]},
    }
    return parts | changes
