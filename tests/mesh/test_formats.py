"""Mesh formats beside .vtu and .msh, which meshio reads."""

from pathlib import Path

import meshio
import numpy as np
import pytest
from tools.meshes import square_mesh
from tools.refusals import refuses

import evfem as ev
from evfem.mesh.file import parts, read, write


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
    caught = refuses(f"{name} .*{reason}.*or another format of meshio's", read, tmp_path / name)
    assert "\n" not in str(caught)
    assert capsys.readouterr().out == ""


LAW = ev.NeoHookean(E=0.1, nu=0.4)
POINTS = [[x, y, 0.0] for y in (0.0, 4.0) for x in (0.0, 4.0, 8.0)]
QUADS = np.array([[0, 1, 4, 3], [1, 2, 5, 4]])
INP = """*NODE
1, 0, 0, 0
2, 4, 0, 0
3, 8, 0, 0
4, 0, 4, 0
5, 4, 4, 0
6, 8, 4, 0
*ELEMENT, TYPE=CPS4, ELSET=tissue
1, 1, 2, 5, 4
2, 2, 3, 6, 5
*NSET, NSET=Bottom
1, 2, 3
*NSET, NSET=bone
4, 5, 6
*ELSET, ELSET=all
1, 2
"""
SCENE = """version = 1
[finger]
mesh = "block.inp"
[finger.regions]
soft = "tissue"
[finger.boundaries]
pad = "Bottom"
[finger.materials.soft]
law = "neo_hookean"
E = 0.1
nu = 0.4
[surface]
kind = "flat"
[[motion]]
kind = "press"
indentation = 0.1
steps = 1
"""


def test_sets_of_abaqus_run_by_the_names_that_a_scene_gives_them(tmp_path):
    (tmp_path / "block.inp").write_text(INP)
    (tmp_path / "scene.toml").write_text(SCENE)
    scene = ev.scenefile.load(tmp_path / "scene.toml")
    same = ev.Mesh(np.array(POINTS)[:, :2], QUADS, "quad", np.zeros(2, int), {"soft": 0},
                   {"pad": np.arange(3), "bone": np.arange(3, 6)})  # fmt: skip
    forces = [
        ev.simulate(ev.Scene(finger, ev.Flat(), motion=scene.motion)).normal_force[-1]
        for finger in (scene.finger, ev.MeshedFinger(same, {"soft": LAW}))
    ]
    assert forces[0] == pytest.approx(forces[1], rel=1e-12)
    assert ev.scenefile.loads(ev.scenefile.dump(scene), tmp_path) == scene
    for old, new, said in (
        ('soft = "tissue"', "", 'all and tissue with the same cells; .* as all = "all"'),
        ('"tissue"', '"tisue"', r"finger.regions: .*soft = tisue; .*block.inp: all, tissue"),
        ('"Bottom"', '"bottom"', r"finger.boundaries: .*pad = bottom; .*block.inp: Bottom, bone"),
    ):
        (tmp_path / "wrong.toml").write_text(SCENE.replace(old, new))
        refuses(said, ev.scenefile.load, tmp_path / "wrong.toml")


def grouped(path):
    """Two cells, below them two edges, as a format keeps their names."""
    cells = [("quad", QUADS), ("line", np.array([[0, 1], [1, 2], [3, 4], [4, 5]]))]
    mesh = meshio.Mesh(np.array(POINTS), cells)
    if path.suffix == ".med":
        mesh.points = mesh.points[:, :2].copy()
        mesh.cell_data = {"cell_tags": [np.array([-1, -1]), np.array([-2, -2, -3, -3])]}
        mesh.cell_tags = {-1: ["tissue"], -2: ["pad", "low"], -3: ["bone"]}
        mesh.point_tags = {}
    elif path.suffix == ".e":
        mesh.cells = mesh.cells[:1]
        mesh.point_sets = {"pad": np.arange(3), "low": np.arange(3), "bone": np.arange(3, 6)}
    elif path.suffix == ".mesh":
        mesh.cell_data = {"medit:ref": [np.array([5, 5]), np.array([7, 7, 8, 8])]}
    else:
        tags = [np.array([5, 5]), np.array([7, 7, 8, 8])]
        mesh.cell_data = {"gmsh:physical": tags, "gmsh:geometrical": tags}
        mesh.write(path, file_format="gmsh22", binary=True)
        return
    mesh.write(path)


@pytest.mark.filterwarnings("ignore:numpy.ndarray size changed")  # of an older netCDF4
@pytest.mark.parametrize(
    ("name", "regions", "boundaries"),
    [
        ("a.med", None, None),
        ("a.e", {"tissue": 0}, None),  # meshio numbers the blocks from 0
        ("a.mesh", {"tissue": 5}, {"pad": 7, "low": 7, "bone": 8}),
        ("a.msh", {"tissue": 5}, {"pad": 7, "low": 7, "bone": 8}),
    ],
)
def test_groups_of_other_formats_are_regions_and_boundaries(name, regions, boundaries, tmp_path):
    grouped(tmp_path / name)
    mesh = ev.MeshedFinger(tmp_path / name, {"tissue": LAW}, regions=regions, boundaries=boundaries).mesh(1)
    sets = {name: nodes.tolist() for name, nodes in mesh.node_sets.items()}
    assert sets == {"pad": [0, 1, 2], "low": [0, 1, 2], "bone": [3, 4, 5]}
    assert mesh.cells.tolist() == QUADS.tolist()


def test_cells_of_an_image_are_quads_and_hexahedra(tmp_path):
    for top, kind, cells in ((1, 8, "quad"), (2, 11, "hexahedron")):
        points = [(4 * x, 4 * y, 4 * z) for z in range(top) for y in (0, 1) for x in (0, 1)]
        low = [int(y == 0) for _, y, _ in points]
        array = '<DataArray type="{}" Name="{}" {} format="ascii">{}</DataArray>'.format
        high = [1 - one for one in low]
        data = {"points": np.ravel(points), "low": low, "high": high, "nodes": range(4 * top)}
        words = {name: " ".join(map(str, values)) for name, values in data.items()}
        path = tmp_path / f"{cells}.vtu"
        path.write_text(
            '<VTKFile type="UnstructuredGrid" version="0.1" byte_order="LittleEndian"><UnstructuredGrid>'
            f'<Piece NumberOfPoints="{4 * top}" NumberOfCells="1"><Points>'
            + array("Float64", "Points", 'NumberOfComponents="3"', words["points"])
            + "</Points><Cells>" + array("Int32", "connectivity", "", words["nodes"])
            + array("Int32", "offsets", "", 4 * top) + array("UInt8", "types", "", kind)
            + "</Cells><PointData>" + array("UInt8", "pad", "", words["low"])
            + array("UInt8", "bone", "", words["high"]) + "</PointData><CellData>"
            + array("Int32", "region", "", 3) + "</CellData></Piece></UnstructuredGrid></VTKFile>"
        )  # fmt: skip
        assert ev.MeshedFinger(path, {"tissue": LAW}, regions={"tissue": 3}).mesh(1).kind == cells


def test_what_is_refused_says_what_to_do(tmp_path):
    page = (Path(__file__).parents[2] / "docs/howto/mesh.md").read_text()
    corners = np.vstack([POINTS[:4], [[0.0, 0.0, 4.0]]])[[0, 1, 3, 4]]
    meshio.Mesh(corners, [("tetra", [[0, 1, 2, 3]])]).write(tmp_path / "tip.vtu")
    refuses(r"given tip.vtu with tetra cells; .*mesh.md, From tetrahedra", read, tmp_path / "tip.vtu")
    assert "## From tetrahedra" in page
    (tmp_path / "old.msh").write_text("$NOD\n1\n1 0 0 0\n$ENDNOD\n")
    refuses(r"given old.msh \(version 1 .* save as 2\.2 or 4\.1", read, tmp_path / "old.msh")


#: a quad of 4 mm in axes of its own (CORD2R 5), which turn it
NASTRAN = """BEGIN BULK
CORD2R         5       0      0.      0.      0.      0.      0.      1.
              0.      1.      0.
GRID           1              0.      0.      0.
GRID           2              4.      0.      0.
GRID           3              4.      4.      0.
GRID           4              0.      4.      0.
CQUAD4         1       7       1       2       3       4
ENDDATA
"""


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("GRID           4        ", "GRID           4       5", "GRID in axes of its own, which"),
        ("GRID           4              0.      4.", "GRID,4,5,0.,4.", "GRID in axes of its own, which"),
        ("GRID           4              0.      4.      0.\n",
         f"GRID*   {4:16}{5:16}{'0.':>16}{'4.':>16}\n*       {'0.':>16}\n", "GRID in axes of its own, which"),
        ("ENDDATA", "include 'more.bdf'\nENDDATA", "INCLUDE, which is not read"),
        ("ENDDATA", "GRDSET,,5\nENDDATA", "GRDSET, which is not read"),
    ],
)  # fmt: skip
def test_axes_and_files_that_meshio_passes_over_in_nastran_are_refused(old, new, said, tmp_path):
    (tmp_path / "block.bdf").write_text(NASTRAN)
    assert parts(tmp_path / "block.bdf").points.tolist() == [[0, 0, 0], [4, 0, 0], [4, 4, 0], [0, 4, 0]]
    (tmp_path / "block.bdf").write_text(NASTRAN.replace(old, new))
    refuses(rf"block.bdf \({said}", read, tmp_path / "block.bdf")
