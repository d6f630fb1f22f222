"""Mesh formats beside .vtu and .msh, which meshio reads."""

import meshio
import numpy as np
import pytest
from tools.meshes import square_mesh

from evfem.errors import InputError
from evfem.mesh.file import read, write


@pytest.mark.parametrize(("ending", "options"), [(".vtk", {}), (".vtk", {"binary": False})])
def test_other_formats_keep_nodes_cells_and_names(tmp_path, ending, options):
    mesh = square_mesh()
    write(mesh, tmp_path / "square.vtu")
    raw = meshio.read(tmp_path / "square.vtu")
    raw.field_data = {}
    path = tmp_path / f"square{ending}"
    meshio.write(path, raw, **options)
    found = read(path, mesh.region_names)
    np.testing.assert_allclose(found.points, mesh.points, rtol=0, atol=1e-15)
    np.testing.assert_array_equal(found.cells, mesh.cells)
    np.testing.assert_array_equal(found.region, mesh.region)
    assert {"pad", "bone"} <= set(found.node_sets)
    for key, nodes in found.node_sets.items():
        np.testing.assert_array_equal(nodes, np.sort(mesh.node_sets[key]))


@pytest.mark.parametrize(("name", "reason"), [("a.png", "no format .png"), ("a.vtk", "")])
def test_what_meshio_cannot_read_is_refused_in_a_sentence(tmp_path, capsys, name, reason):
    (tmp_path / name).write_text("nothing that is a mesh")
    with pytest.raises(InputError, match=f"{name} .*{reason}.*or another format of meshio's") as caught:
        read(tmp_path / name)
    assert "\n" not in str(caught.value)
    assert capsys.readouterr().out == ""
