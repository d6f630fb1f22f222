"""XDMF of several grids (`.xdmf`), as FEniCSx writes it: a mesh, tags of its cells and facets, and functions.

A tag is a number and has no name. Files of one grid are read by meshio. Source: files of dolfinx 0.5.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple
from xml.etree import ElementTree

import numpy as np

from evfem.common.arrays import Ints
from evfem.common.foreign import check_declared
from evfem.mesh.groups import Group, dimension_of

if TYPE_CHECKING:
    import meshio

Element = ElementTree.Element


class Tags(NamedTuple):
    """A grid of tagged cells or facets: its name, their kind and nodes, and a number each."""

    name: str
    kind: str
    nodes: Ints
    numbers: Ints


def read(path: Path) -> meshio.Mesh:
    """Points (N, 2 or 3), cells, tags as groups (of cells without tags a function `region`), and functions
    as data.

    Raises ValueError that says what is not read.
    """
    import meshio

    root = ElementTree.parse(path).getroot()
    grids = list(_grids(root))
    read = [one for one in (*grids, root.find(".//Geometry")) if one is not None]
    items = [item for one in read for item in one.iter("DataItem") if item.get("Format") == "HDF"]
    with ExitStack() as files:
        names = {(one.text or "").strip() for one in items}
        check_declared(_array(files, path.parent, name).nbytes for name in names)
    if len(grids) < 2:
        return meshio.read(path)
    reader = meshio.xdmf.main.XdmfReader(path)
    body, *others = (one for one in grids if one.find("Topology") is not None)
    kind, cells = _topology(body, reader)
    tags = [Tags(one.get("Name", ""), *_topology(one, reader), _values(one, "Attribute", reader).ravel())
            for one in others]  # fmt: skip
    dimension = dimension_of(kind, 3)
    facets = [one for one in tags if dimension_of(one.kind, 3) < dimension]
    blocks = [(kind, cells), *((one.kind, one.nodes) for one in facets)]
    raw = meshio.Mesh(_values(root, ".//Geometry", reader), blocks)
    for name, centre, values in _functions([one for one in grids if one not in others], reader):
        (raw.point_data if centre == "Node" else raw.cell_data)[name] = (
            values if centre == "Node" else [values]
        )
    regions = _regions(cells, [one for one in tags if one not in facets], raw)
    raw.groups = [
        Group(None, number, k, np.flatnonzero(numbers == number))
        for k, numbers in enumerate([regions, *(one.numbers for one in facets)])
        for number in np.unique(numbers).astype(int).tolist()
    ]
    return raw


def _array(files: ExitStack, folder: Path, name: str) -> Any:
    """The array `file:place`, of an HDF5 that is closed with `files`."""
    import h5py

    file, _, place = name.partition(":")
    return files.enter_context(h5py.File(folder / file, "r"))[place]


def _grids(root: Element) -> Iterator[Element]:
    """Grids of one mesh each; of a collection in time the first."""
    for grid in root.findall("./Domain/Grid"):
        yield grid if grid.get("GridType", "Uniform") == "Uniform" else grid.find("Grid") or grid


def _values(grid: Element, what: str, reader: Any) -> np.ndarray:
    """The data below an element. Text without a precision is read as FEniCSx writes it, in full."""
    item = grid.find(f"{what}/DataItem")
    if item is None:
        raise ValueError(f"a grid without {what.strip('./')}")
    if item.get("NumberType", "Float") == "Float" and "Precision" not in item.attrib:
        item.set("Precision", "8")
    return np.asarray(reader._read_data_item(item))


def _topology(grid: Element, reader: Any) -> tuple[str, Ints]:
    """Kind and nodes of the cells of a grid."""
    from meshio.xdmf.common import xdmf_to_meshio_type

    known = {name.lower(): kind for name, kind in xdmf_to_meshio_type.items()}
    nodes = _values(grid, "Topology", reader).astype(np.int64)
    name = grid.find("Topology").attrib.get("TopologyType", "").lower()  # type: ignore[union-attr]
    if name not in known:
        raise ValueError(f"cells {name or 'without a type'}, which are not read")
    return known[name], nodes


def _functions(grids: list[Element], reader: Any) -> Iterator[tuple[str, str, np.ndarray]]:
    """Name, centre (Node or Cell) and values (n,) or (n, k) of what is given on the mesh."""
    for grid in grids:
        for one in grid.findall("Attribute"):
            holder = Element("Grid")
            holder.append(one)
            values = _values(holder, "Attribute", reader)
            yield (
                one.get("Name", ""),
                one.get("Center", ""),
                values.ravel() if values.shape[-1] == 1 else values,
            )


def _regions(cells: Ints, tags: list[Tags], raw: meshio.Mesh) -> Ints:
    """The number of each cell of the body: its tag, else the function `region`; (0,) without both."""
    if not tags:
        return np.ravel(raw.cell_data.get("region", [[]])[0])
    if len(tags) > 1:
        raise ValueError(f"several tags of cells, {' and '.join(one.name for one in tags)}: keep one")
    both = np.sort(np.vstack([tags[0].nodes, cells]), axis=1)
    _, first, of = np.unique(both, axis=0, return_index=True, return_inverse=True)
    found = first[of.ravel()[len(tags[0].nodes) :]]
    if lost := int((found >= len(tags[0].nodes)).sum()):
        raise ValueError(f"{lost} cells without a tag of {tags[0].name}: tag all of them")
    return tags[0].numbers[found]
