"""Salome's `.med` (HDF5): groups of cells and of nodes, which are the names of families.

A family has the names of all groups that its members are in, or none. Units of length of the coordinates
are read where they are given. Source: MED 4.1, and files of Gmsh 4.15 and MEDCoupling 9.15.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from evfem.common.arrays import Ints
from evfem.common.foreign import check_declared
from evfem.mesh.groups import Group

if TYPE_CHECKING:
    import meshio

#: MED's names of kinds of cells
KINDS: Mapping[str, str] = {
    "PO1": "vertex", "SE2": "line", "SE3": "line3", "TR3": "triangle", "TR6": "triangle6", "QU4": "quad",
    "QU8": "quad8", "QU9": "quad9", "TE4": "tetra", "T10": "tetra10", "PY5": "pyramid", "P13": "pyramid13",
    "PE6": "wedge", "P15": "wedge15", "P18": "wedge18", "HE8": "hexahedron", "H20": "hexahedron20",
    "H27": "hexahedron27",
}  # fmt: skip
#: nodes of 27 in VTK's order: MED has the middles of faces in the order of corners 0123, 0154, 1265, 2376,
#: 3047, 4567 (VTK: 0473, 1265, 0154, 2376, 0321, 4567)
ORDER = [*range(20), 24, 22, 21, 23, 20, 25, 26]
#: mm of a unit of length; files of Gmsh and Salome have none
UNITS: Mapping[str, float] = {"": 1.0, "mm": 1.0, "cm": 10.0, "m": 1000.0, "um": 1e-3, "µm": 1e-3}


def read(path: Path) -> meshio.Mesh:
    """Points (N, 2 or 3) in mm, cells, groups of cells and sets of nodes.

    Raises ValueError that says what is not read.
    """
    import h5py
    import meshio

    with h5py.File(path, "r") as file:
        _check_sizes(file)
        name, head, mesh = _only_mesh(file)
        cells = [(_kind(key), _columns(block["NOD"]) - 1) for key, block in mesh["MAI"].items()]
        cells = [(kind, one[:, ORDER] if kind == "hexahedron27" else one) for kind, one in cells]
        points = _columns(mesh["NOE"]["COO"]) * _unit(head)
        families = file["FAS"][name]
        of_cells, of_nodes = (_families(families, key) for key in ("ELEME", "NOEUD"))
        numbers = [_numbers(block) for block in mesh["MAI"].values()]
        nodes = _numbers(mesh["NOE"])
    raw = meshio.Mesh(points, cells)
    raw.point_sets = {
        one: np.flatnonzero(np.isin(nodes, [number for number, names in of_nodes.items() if one in names]))
        for one in sorted({one for names in of_nodes.values() for one in names})
    }
    names = sorted({one for names in of_cells.values() for one in names})
    raw.groups = [
        Group(one, names.index(one) + 1, k, np.flatnonzero(tags == family))
        for k, tags in enumerate(numbers)
        for family in np.unique(tags)
        for one in of_cells.get(int(family), ())
    ]
    return raw


def _check_sizes(file: Any) -> None:
    sizes: list[int] = []
    file.visititems(lambda _, one: sizes.append(getattr(one, "nbytes", 0)))
    check_declared(sizes)


def _only_mesh(file: Any) -> tuple[str, Any, Any]:
    """The name of the one mesh, its head, and what holds its nodes and cells."""
    names = list(file["ENS_MAA"])
    if len(names) != 1:
        raise ValueError(f"{len(names)} meshes ({', '.join(names)}): keep one")
    head = file["ENS_MAA"][names[0]]
    if int(head.attrs.get("REP", 0)) != 0:
        raise ValueError("nodes in cylindrical or spherical axes, which are not read: give x, y and z")
    if "NOE" in head:
        return names[0], head, head
    if len(head) != 1:
        raise ValueError(f"{len(head)} steps of the mesh: keep one")
    return names[0], head, next(iter(head.values()))


def _unit(head: Any) -> float:
    """mm of the unit of the coordinates."""
    text = bytes(np.bytes_(head.attrs.get("UNI", b""))).decode("utf-8", "replace").replace("\0", " ")
    units = set(text.split()) or {""}
    if len(units) > 1 or not units <= set(UNITS):
        raise ValueError(f"coordinates in {' and '.join(sorted(units))}: give them in mm")
    return UNITS[units.pop()]


def _kind(name: str) -> str:
    if name not in KINDS:
        raise ValueError(f"cells {name}, which are not read")
    return KINDS[name]


def _columns(data: Any) -> Any:
    """An array (n, m) that is stored column by column."""
    return data[()].reshape((int(data.attrs["NBR"]), -1), order="F")


def _numbers(block: Any) -> Ints:
    """The family of each cell or node: 0, which has no names, where none is given."""
    if "FAM" in block:
        return np.asarray(block["FAM"][()], dtype=np.int64)
    return np.zeros(int(block["NOD" if "NOD" in block else "COO"].attrs["NBR"]), dtype=np.int64)


def _families(families: Any, key: str) -> dict[int, list[str]]:
    """Names of the groups of each family."""
    found: dict[int, list[str]] = {}
    for family in families[key].values() if key in families else ():
        rows = family["GRO"]["NOM"][()] if "GRO" in family else ()
        texts = [np.asarray(row, dtype=np.int8).tobytes().decode("utf-8", "replace") for row in rows]
        found[int(family.attrs["NUM"])] = [text.split("\0")[0].strip() for text in texts]
    return found
