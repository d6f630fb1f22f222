"""Meshes that other libraries have in memory: meshio's, PyVista's and the model of gmsh.

None of these libraries is imported for it: they are known by what they have.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np

from evfem.errors import InputError
from evfem.mesh import file, places
from evfem.mesh.mesh import Mesh
from evfem.mesh.quality import named, sound

if TYPE_CHECKING:
    import meshio

ALLOWED = "the path of a mesh file; in Python also a Mesh, a meshio.Mesh, a PyVista grid or the module gmsh"
#: options of gmsh's files while one is written: all groups of an entity, and no elements outside of groups
OPTIONS: Mapping[str, float] = {"Mesh.MshFileVersion": 4.1, "Mesh.SaveAll": 0, "Mesh.SaveParametric": 0}


def is_mesh(source: Any) -> bool:
    """Whether a value is a mesh in memory that `mesh_of` takes."""
    known = ("point_sets", "cell_sets"), ("cast_to_unstructured_grid",), ("isInitialized", "model")
    return isinstance(source, Mesh) or any(all(hasattr(source, name) for name in one) for one in known)


def mesh_of(source: Any, regions: Mapping[str, Any] | None, boundaries: Mapping[str, Any] | None) -> Mesh:
    """The checked mesh of one in memory, with names by `regions` and `boundaries` as of a file.

    Raises `InputError` for what cannot be a finger, and for a model of gmsh without a mesh.
    """
    if isinstance(source, Mesh):
        return _of_ours(source, regions, boundaries)
    if hasattr(source, "isInitialized"):
        return _of_gmsh(source, regions, boundaries)
    raw, path = (
        (_of_pyvista(source), Path("the PyVista grid"))
        if hasattr(source, "cast_to_unstructured_grid")
        else (source.copy(), Path("the meshio.Mesh"))
    )
    try:
        file.check_numbers(raw)
    except ValueError as error:
        raise InputError("finger.mesh", f"{path} with {error}", "cells and sets of its own nodes") from None
    return file.finger_of(path, file.without_pixels(raw), regions, boundaries)


def _of_ours(mesh: Mesh, regions: Mapping[str, Any] | None, boundaries: Mapping[str, Any] | None) -> Mesh:
    if regions:
        raise InputError("finger.regions", "beside a Mesh", "its own `region_names`, without regions")
    mesh = sound(mesh, "mesh")
    sets, known = dict(mesh.node_sets), f"sets of the mesh: {', '.join(mesh.node_sets) or 'none'}"
    for name, place in (boundaries or {}).items():
        own = isinstance(place, str) and place in mesh.node_sets
        sets[name] = mesh.node_sets[place] if own else places.nodes_at(mesh, name, place, known)
    return named(Mesh(mesh.points, mesh.cells, mesh.kind, mesh.region, mesh.region_names, sets), "mesh")


def _of_pyvista(grid: Any) -> meshio.Mesh:
    """What meshio would read of the file of a grid of PyVista, or of another data set of it."""
    import meshio

    file.teach_pixels(meshio)
    grid = grid.cast_to_unstructured_grid()
    data = {name: np.asarray(grid.cell_data[name]) for name in grid.cell_data}
    starts = grid.cell_offsets if hasattr(grid, "cell_offsets") else grid.offset  # before PyVista 0.49
    cells, cell_data = meshio._vtk_common.vtk_cells_from_data(
        np.asarray(grid.cell_connectivity), np.asarray(starts)[1:], np.asarray(grid.celltypes), data
    )
    points = {name: np.asarray(grid.point_data[name]) for name in grid.point_data}
    named_regions = {name: np.asarray(grid.field_data[name]) for name in grid.field_data}
    return meshio.Mesh(np.asarray(grid.points), cells, points, cell_data, named_regions)


def _of_gmsh(gmsh: Any, regions: Mapping[str, Any] | None, boundaries: Mapping[str, Any] | None) -> Mesh:
    """The current model, as its own file has it."""
    if not gmsh.isInitialized() or not len(gmsh.model.mesh.getNodes()[0]):
        allowed = "gmsh.initialize(), a model, and gmsh.model.mesh.generate(2) (3 in space) before"
        raise InputError("finger.mesh", "gmsh without a mesh", allowed)
    before = {name: gmsh.option.getNumber(name) for name in OPTIONS}
    with TemporaryDirectory() as folder:
        path = Path(folder) / "model.msh"
        try:
            for name, value in OPTIONS.items():
                gmsh.option.setNumber(name, value)
            gmsh.write(str(path))
        finally:
            for name, value in before.items():
                gmsh.option.setNumber(name, value)
        return file.read(path, regions, boundaries)
