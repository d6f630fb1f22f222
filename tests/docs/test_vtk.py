"""What ParaView sees of a run: the series read with VTK, warped, compared and drawn. `pytest -m vtk`.

The tests without the mark read the macro alone, which needs neither VTK nor ParaView.
"""

import ast
import re
from pathlib import Path

import numpy as np
import pytest

import evfem as ev
from evfem.export import instants, paraview
from evfem.simulation.result import CELL_FIELDS, LATER_FIELDS, POINT_FIELDS

DOCS = Path(__file__).parents[2] / "docs"
MACRO = DOCS / "paraview_macro.py"
#: a rigid surface does not sink
NODAL = [name for name in POINT_FIELDS if name not in LATER_FIELDS]
WRITTEN = {"POINTS": {"displacement", *NODAL}, "CELLS": {"region", *CELL_FIELDS}}


@pytest.fixture(scope="module")
def series(tmp_path_factory):
    """A press and a slide on the coarse finger, and its series."""
    finger = ev.FingerPad(resolution="coarse", ridges=False)
    motion = [ev.Press(force=0.05, steps=2), ev.Slide(distance=0.4, steps=2)]
    result = ev.simulate(ev.Scene(finger, ev.Display(), law=ev.Kaczmarek(), voltage=1000.0, motion=motion))
    return result, paraview(result, tmp_path_factory.mktemp("series") / "fields.pvd")


@pytest.mark.vtk
def test_vtk_reads_smooth_stresses_that_are_those_of_its_own_averages_within_a_region(series, tmp_path):
    """VTK's filter takes the mean of the cells around a point, and no point is of two regions."""
    from vtkmodules.vtkFiltersCore import vtkCellDataToPointData

    paraview(series[0], tmp_path / "smooth.pvd", smooth=True)
    grid = read_vtu(tmp_path / "smooth_00004.vtu")
    means = vtkCellDataToPointData()
    means.SetInputData(grid)
    means.Update()
    written, of_vtk = arrays_of(grid.GetPointData()), arrays_of(means.GetOutput().GetPointData())
    for name in CELL_FIELDS:
        np.testing.assert_allclose(written[f"nodal_{name}"], of_vtk[name], rtol=1e-10, atol=1e-15)
    assert set(np.unique(of_vtk["region"])) == set(np.unique(series[0].mesh.region))


def read_vtu(path):
    """The grid in a file, by VTK's own reader."""
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader

    reader = vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(path))
    reader.Update()
    return reader.GetOutput()


def arrays_of(data):
    """All arrays of point, cell or field data."""
    from vtkmodules.util.numpy_support import vtk_to_numpy

    return {data.GetArrayName(i): vtk_to_numpy(data.GetArray(i)) for i in range(data.GetNumberOfArrays())}


@pytest.mark.vtk
def test_vtk_reads_every_array_of_every_step(series):
    result, path = series
    assert len(result.frames) == 4
    for frame in result.frames:
        grid = read_vtu(path.with_name(f"fields_{frame.step:05d}.vtu"))
        points, cells = arrays_of(grid.GetPointData()), arrays_of(grid.GetCellData())
        assert {"POINTS": set(points), "CELLS": set(cells)} == WRITTEN
        np.testing.assert_array_equal(points["displacement"], np.pad(frame.displacement, ((0, 0), (0, 1))))
        for name in NODAL:
            np.testing.assert_array_equal(points[name], getattr(frame, name))
        for name in CELL_FIELDS:
            np.testing.assert_array_equal(cells[name], getattr(frame, name))


@pytest.mark.vtk
def test_regions_have_their_names(series):
    result, path = series
    grid = read_vtu(path.with_name("fields_00001.vtu"))
    named = {name: int(value[0]) for name, value in arrays_of(grid.GetFieldData()).items()}
    assert named == {f"region:{name}": number for name, number in result.mesh.region_names.items()}
    numbers = arrays_of(grid.GetCellData())["region"]
    np.testing.assert_array_equal(
        numbers == named["region:dermis"], result.mesh.region == result.mesh.region_names["dermis"]
    )


@pytest.mark.vtk
def test_cells_have_the_areas_of_the_mesh(series):
    """A wrong order of nodes would fold the cells: their areas by VTK add up to that of the finger."""
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkFiltersVerdict import vtkCellSizeFilter

    result, path = series
    size = vtkCellSizeFilter()
    size.SetInputData(read_vtu(path.with_name("fields_00001.vtu")))
    size.Update()
    areas = vtk_to_numpy(size.GetOutput().GetCellData().GetArray("Area"))
    finger = result.provenance["mesh"]["cells"]
    assert len(areas) == finger
    ellipse = np.pi / 4.0 * (16.68 * 12.79 - 6.0 * 5.0)  # outline less the bone
    assert areas.min() > 0.0
    assert areas.sum() == pytest.approx(ellipse, rel=2e-3)


@pytest.mark.vtk
def test_the_index_has_the_instants_of_the_steps(series):
    import pyvista

    result, path = series
    reader = pyvista.get_reader(path)
    assert reader.time_values == instants(result.rows)
    assert reader.time_values[-1] == pytest.approx(0.4)
    reader.set_active_time_value(reader.time_values[2])
    np.testing.assert_array_equal(reader.read()[0]["gap"], result.frames[2].gap)


@pytest.mark.vtk
def test_the_example_of_the_docs_draws_the_pad(series, tmp_path, monkeypatch):
    """The off-screen picture shows something: a white ground, and many colours on it."""
    import matplotlib.image

    text = (DOCS / "howto" / "paraview.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"^<!-- needs vtk -->\n```python\n(.*?)^```$", text, re.M | re.S)
    monkeypatch.chdir(series[1].parent)
    paraview(series[0], "smooth.pvd", smooth=True)
    exec(compile(code, "paraview.md", "exec"), {})
    picture = matplotlib.image.imread(series[1].parent / "pad.png")[..., :3]
    assert picture.shape == (900, 1400, 3)
    assert (picture[0, 0] == 1.0).all()
    share = np.mean((picture < 0.99).any(axis=-1))
    assert 0.1 < share < 0.9
    assert len(np.unique((255 * picture).astype(int).reshape(-1, 3), axis=0)) > 100


def test_the_macro_names_only_arrays_that_are_written():
    tree = ast.parse(MACRO.read_text(encoding="utf-8"))
    compile(tree, str(MACRO), "exec")
    texts = [
        [one.value for one in node.elts if isinstance(one, ast.Constant)]
        for node in ast.walk(tree)
        if isinstance(node, (ast.Tuple, ast.List))
    ]
    named = [(words[0], words[1]) for words in texts if words and words[0] in WRITTEN]
    assert len(named) == 3
    for kind, name in named:
        assert name in WRITTEN[kind]
