"""Every way to write a .vtu file holds the same mesh."""

import base64
import re

import meshio
import numpy as np
import pytest
from meshio.vtu import write
from tools.meshes import KINDS, square_mesh

from evfem.mesh import file as meshfile

NUMBERS = {"soft": 0, "hard": 1}


def stored(mesh, path, **how):
    n = len(mesh.points)
    points = np.column_stack([mesh.points, np.zeros(n)])
    data = {name: np.isin(np.arange(n), nodes).astype(np.uint8) for name, nodes in mesh.node_sets.items()}
    grid = meshio.Mesh(points, [(mesh.kind, mesh.cells)], data, {"region": [mesh.region]})
    write(str(path), grid, **how)
    return path


def same(read, mesh):
    np.testing.assert_allclose(read.points, mesh.points, atol=1e-11)
    np.testing.assert_array_equal(read.cells, mesh.cells)
    np.testing.assert_array_equal(read.region, mesh.region)
    for name, nodes in mesh.node_sets.items():
        np.testing.assert_array_equal(read.node_sets[name], nodes)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    "how",
    [
        {"compression": None},
        {"compression": "zlib"},
        {"compression": "lzma"},
        {"compression": None, "header_type": "UInt64"},
        {"compression": "zlib", "header_type": "UInt64"},
        {"binary": False},
    ],
    ids=str,
)
def test_every_form_that_meshio_writes_is_read(kind, how, tmp_path):
    mesh = square_mesh(kind)
    same(meshfile.read(stored(mesh, tmp_path / "mesh.vtu", **how), NUMBERS), mesh)


def appended(path, encoding, order="<", apart=False):
    """The same file with its arrays appended; `apart` pads header and numbers one by one."""
    text = path.read_text()
    arrays, total = [], 0

    def move(match):
        nonlocal total
        data = base64.b64decode(match[2])
        size = np.frombuffer(data, "<u4", 1)[0]
        numbers = np.frombuffer(data[4 : 4 + size], re.search('type="(.*?)"', match[1])[1].lower())
        body = numbers.astype(numbers.dtype.newbyteorder(order)).tobytes()
        head = np.array(len(body), dtype=order + "u4").tobytes()
        parts = [head + body] if encoding == "raw" or not apart else [head, body]
        piece = b"".join(parts if encoding == "raw" else map(base64.b64encode, parts))
        arrays.append(piece)
        total += len(piece)
        return match[1].replace("binary", "appended") + f' offset="{total - len(piece)}"/>'

    text = re.sub(r"(<DataArray[^>]*)>\s*([^<\s]*)\s*</DataArray>", move, text)
    text = text.replace("LittleEndian", "BigEndian") if order == ">" else text
    head, tail = text.split("</VTKFile>")
    block = f'<AppendedData encoding="{encoding}">\n_'.encode() + b"".join(arrays) + b"\n</AppendedData>"
    path.write_bytes(head.encode() + block + b"</VTKFile>" + tail.encode())
    return path


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize(("encoding", "apart"), [("raw", False), ("base64", False), ("base64", True)])
def test_appended_arrays_are_read(encoding, apart, order, tmp_path):
    mesh = square_mesh("quad9")
    path = appended(stored(mesh, tmp_path / "mesh.vtu", compression=None), encoding, order, apart)
    same(meshfile.read(path, NUMBERS), mesh)


def test_lines_and_vertices_only_carry_names(tmp_path):
    mesh = square_mesh()
    points = np.column_stack([mesh.points, np.zeros(len(mesh.points))])
    blocks = [("line", np.array([[0, 1], [1, 2]])), ("quad", mesh.cells), ("vertex", np.array([[4]]))]
    data = {"region": [np.zeros(2, int), mesh.region, np.zeros(1, int)]}
    on = {name: np.isin(np.arange(len(points)), nodes).astype(int) for name, nodes in mesh.node_sets.items()}
    write(str(tmp_path / "mesh.vtu"), meshio.Mesh(points, blocks, on, data), compression=None)
    same(meshfile.read(tmp_path / "mesh.vtu", NUMBERS), mesh)
