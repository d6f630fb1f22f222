"""Boundaries and regions by place, for meshes of formats without names, and meshes in memory."""

from dataclasses import replace

import meshio
import numpy as np
import pytest
from tools.commands import printed
from tools.meshes import between, square_mesh
from tools.refusals import refuses
from tools.solids import block

import evfem as ev
from evfem.mesh.mesh import Mesh
from evfem.mesh.places import nodes_at

LAW = ev.NeoHookean(E=0.1, nu=0.4)
SIDES = {"lowest": (1, 0), "highest": (1, 2), "left": (0, -1), "right": (0, 1)}


@pytest.mark.parametrize("kind", ["quad", "quad9", "triangle", "triangle6"])
def test_sides_of_a_square(kind):
    mesh = square_mesh(kind)
    for place, (axis, at) in SIDES.items():
        expected = np.flatnonzero(np.isclose(mesh.points[:, axis], at))
        assert nodes_at(mesh, "pad", place, "").tolist() == expected.tolist(), place


def test_faces_of_a_box():
    mesh = block((2, 3, 4), (1.0, 2.0, 3.0))
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    for place, (axis, at) in {
        "lowest": (1, low),
        "back": (2, low),
        "front": (2, high),
        "left": (0, low),
    }.items():
        expected = np.flatnonzero(np.isclose(mesh.points[:, axis], at[axis]))
        assert nodes_at(mesh, "pad", place, "").tolist() == expected.tolist(), place


@pytest.mark.parametrize(
    "finger", [ev.FingerPad(resolution="coarse"), ev.Fingertip(resolution="coarse", rim="nail")]
)
def test_a_finger_without_names_is_the_same_finger(finger):
    """Lower half of the outline or surface, and the hole round the bone, as the finger names them itself."""
    mesh = finger.mesh(order=1)
    lowest = nodes_at(mesh, "pad", "lowest", "")
    assert lowest.tolist() == np.unique(mesh.sides_of("pad")).tolist()
    assert nodes_at(mesh, "bone", "inside", "").tolist() == np.unique(mesh.sides_of("bone")).tolist()


def test_of_two_feet_both_are_lowest_and_a_ledge_is_not():
    """Two blocks below a beam, the beam's own lower side between them."""
    mesh = between(*np.meshgrid([0.0, 1.0, 2.0, 3.0, 4.0], [0.0, 1.0, 2.0]))
    x, y = mesh.centres.T
    kept = (y > 1.0) | (x < 1.0) | (x > 3.0)
    used, cells = np.unique(mesh.cells[kept], return_inverse=True)
    two = Mesh(mesh.points[used], cells.reshape(-1, 4), "quad", np.zeros(kept.sum(), int), {"t": 0})
    assert two.points[nodes_at(two, "pad", "lowest", "")].tolist() == [[0, 0], [1, 0], [3, 0], [4, 0]]


MESH = """MeshVersionFormatted 2
Dimension 3
Vertices
9
0 0 0 0
4 0 0 0
8 0 0 0
0 4 0 0
4 4 0 0
8 4 0 0
0 8 0 0
4 8 0 0
8 8 0 0
Quadrilaterals
4
1 2 5 4 0
2 3 6 5 0
4 5 8 7 0
5 6 9 8 0
End
"""
SCENE = """version = 1
[finger]
mesh = "block.mesh"
[finger.regions]
nail = {box = [[4, 4], [8, 8]]}
tissue = "rest"
[finger.boundaries]
pad = "lowest"
bone = {box = [[0, 8], [8, 8]]}
[finger.materials.tissue]
law = "neo_hookean"
E = 0.1
nu = 0.4
[finger.materials.nail]
law = "neo_hookean"
E = 1.0
nu = 0.3
[surface]
kind = "flat"
[[motion]]
kind = "press"
indentation = 0.1
steps = 1
"""


def test_a_scene_names_places_of_a_mesh_of_medit(tmp_path):
    (tmp_path / "block.mesh").write_text(MESH)
    (tmp_path / "scene.toml").write_text(SCENE)
    scene = ev.scenefile.load(tmp_path / "scene.toml")
    mesh = scene.finger.mesh(order=1)
    assert {name: nodes.tolist() for name, nodes in mesh.node_sets.items()} == {
        "pad": [0, 1, 2],
        "bone": [6, 7, 8],
    }
    assert mesh.cells_of("nail").tolist() == [3]
    assert mesh.cells_of("tissue").tolist() == [0, 1, 2]
    assert ev.scenefile.loads(ev.scenefile.dump(scene), tmp_path) == scene
    for old, new, said in (
        (
            '"lowest"',
            '"lowst"',
            r"finger.boundaries: given pad = lowst; allowed: sets of block.mesh: none; or a place",
        ),
        ('"lowest"', '"front"', "pad = front of a mesh in the plane"),
        ('"lowest"', '"inside"', "pad = inside, where no whole edge of the outline is; .* y from 0 to 8"),
        (
            "[[0, 8], [8, 8]]",
            "[[0, 8.1], [8, 9]]",
            r"bone = {box = .*}, where no whole edge .* x from 0 to 8",
        ),
        (
            "[[0, 8], [8, 8]]",
            "[[0, 8, 0], [8, 8, 0]]",
            r"finger.boundaries: given {box .*; allowed: a box as {box",
        ),
        ("{box = [[0, 8], [8, 8]]}", "{y = [8, 8]}", r"finger.boundaries: given {y = .*; allowed: a box"),
        (
            "{box = [[0, 8], [8, 8]]}",
            "[8, 9]",
            r"finger.boundaries: given \[8, 9\]; allowed: a table name = number",
        ),
        (
            "[[4, 4], [8, 8]]",
            "[[9, 4], [9, 8]]",
            r"nail = {.*}, where no cell has its centre; .* x from 0 to 8",
        ),
        ("[[4, 4], [8, 8]]", "[[0, 0], [8, 8]]", "tissue = rest, of which no cell is left"),
        (
            'tissue = "rest"',
            "tissue = {box = [[2, 2], [8, 8]]}",
            "finger.regions: given nail and tissue with 1 cells in both boxes; allowed: boxes",
        ),
        (
            'tissue = "rest"',
            'tissue = "rest"\nskin = "rest"',
            "finger.regions: given tissue and skin = rest; allowed: one region that is the rest",
        ),
        ('"rest"', '"all"', r"finger.regions: given tissue = all; .*block.mesh: 0"),
    ):
        (tmp_path / "wrong.toml").write_text(SCENE.replace(old, new))
        refuses(said, ev.scenefile.load, tmp_path / "wrong.toml")


def test_a_set_of_the_file_goes_before_a_place_and_a_box_before_a_number(tmp_path):
    mesh = square_mesh()
    raw = meshio.Mesh(
        np.column_stack([mesh.points, np.zeros(9)]),
        [("quad", mesh.cells)],
        point_data={"lowest": (mesh.points[:, 1] > 1.5).astype(int)},
        cell_data={"region": [mesh.region]},
    )
    raw.write(tmp_path / "a.vtu")
    regions, boundaries = (
        {"soft": 0, "hard": {"box": ((-1, 1), (1, 2))}},
        {"pad": "lowest", "bone": {"box": ((-1, 0), (1, 0))}},
    )
    found = ev.meshfile.read(tmp_path / "a.vtu", regions, boundaries)
    assert found.points[found.node_sets["pad"], 1].tolist() == [2.0, 2.0, 2.0]
    assert found.cells_of("hard").tolist() == [2, 3]
    rest = ev.meshfile.read(tmp_path / "a.vtu", {"soft": 0, "hard": "rest"}, boundaries)
    assert rest.cells_of("hard").tolist() == [2, 3]
    same = ev.MeshedFinger(raw, {"soft": LAW, "hard": LAW}, regions=regions, boundaries=boundaries).mesh(1)
    assert same.cells.tolist() == found.cells.tolist()
    assert same.node_sets["pad"].tolist() == found.node_sets["pad"].tolist()


def test_groups_of_a_meshio_mesh_are_named_by_its_field_data():
    """As meshio itself has them of a `.msh`: name = (number, dimension)."""
    mesh = square_mesh()
    lines = np.array([[0, 1], [1, 2], [6, 7], [7, 8]])
    tags = [np.full(4, 3), np.array([1, 1, 2, 2])]
    raw = meshio.Mesh(
        np.column_stack([mesh.points, np.zeros(9)]),
        [("quad", mesh.cells), ("line", lines)],
        cell_data={"gmsh:physical": tags},
        field_data={"tissue": np.array([3, 2]), "pad": np.array([1, 1]), "bone": np.array([2, 1])},
    )
    raw.point_data["point_tags"] = np.zeros(9, int)
    found = ev.MeshedFinger(raw, {"tissue": LAW})
    assert found.mesh(1).node_sets["bone"].tolist() == [6, 7, 8]
    assert "point_tags" in raw.point_data
    halved = meshio.Mesh(raw.points, [("quad", mesh.cells[:, :2]), ("line", lines)], cell_data=raw.cell_data)
    sentence = "given the meshio.Mesh with cells of the kind quad with 2 nodes"
    refuses(sentence, ev.MeshedFinger, halved, {"tissue": LAW})
    raw.cells[1].data[0, 0] = 99
    refuses(
        "given the meshio.Mesh with cells of nodes that do not exist", ev.MeshedFinger, raw, {"tissue": LAW}
    )


def test_a_curve_in_two_groups_is_in_both_in_a_mesh_of_meshio():
    """As meshio 5.3 has them of a `.msh` 4.1: of the numbers the first, in the sets all."""
    mesh = square_mesh()
    lines = [("line", np.array([[0, 1]])), ("line", np.array([[1, 2]])), ("line", np.array([[6, 7], [7, 8]]))]
    one, two, none = np.arange(1, dtype=np.uint64), np.arange(2, dtype=np.uint64), np.arange(0)
    raw = meshio.Mesh(
        np.column_stack([mesh.points, np.zeros(9)]),
        [*lines, ("quad", mesh.cells)],
        cell_data={"gmsh:physical": [np.full(n, tag) for n, tag in ((1, 2), (1, 3), (2, 4), (4, 1))]},
        field_data={"t": [1, 2], "left": [2, 1], "pad": [3, 1], "bone": [4, 1], "nail": [5, 1]},
        cell_sets={
            "left": [one, none, none, none],
            "pad": [one, one, none, none],
            "bone": [none, none, two, none],
            "nail": [none, none, two, none],
            "t": [none, none, none, np.arange(4, dtype=np.uint64)],
            "gmsh:bounding_entities": [np.array([1, -2])] * 4,
        },
    )
    sets = ev.MeshedFinger(raw, {"t": LAW}).mesh(1).node_sets
    assert {name: nodes.tolist() for name, nodes in sets.items()} == {
        "left": [0, 1],
        "pad": [0, 1, 2],
        "bone": [6, 7, 8],
        "nail": [6, 7, 8],
    }
    raw.field_data = {}  # sets without numbers do not take the place of numbers
    by_number = ev.MeshedFinger(raw, {"u": LAW}, regions={"u": 1}).mesh(1)
    assert by_number.node_sets["pad"].tolist() == [0, 1, 2]


@pytest.mark.parametrize("kind", [int, bool, np.uint8, np.float32, float])
def test_point_data_of_0_and_1_are_sets_of_whatever_type(kind):
    mesh = square_mesh()
    y = mesh.points[:, 1]
    raw = meshio.Mesh(
        np.column_stack([mesh.points, np.zeros(9)]),
        [("quad", mesh.cells)],
        point_data={"below": (y < 0.1).astype(kind), "bone": (y > 1.9).astype(kind), "height": y},
    )
    finger = ev.MeshedFinger(raw, {"t": LAW}, regions={"t": "rest"}, boundaries={"pad": "below"})
    assert finger.mesh(1).node_sets["pad"].tolist() == [0, 1, 2]
    refuses(
        r"no boundary pad \(it has below, bone, point data height that are not 0 and 1\)",
        *(ev.MeshedFinger, raw, {"t": LAW}),
        regions={"t": "rest"},
    )


def test_a_plane_that_was_turned_there_and_back_in_single_precision_is_a_plane():
    mesh = square_mesh()
    turn = np.array([[0.866, 0, 0.5], [0, 1, 0], [-0.5, 0, 0.866]], np.float32)
    there = (np.column_stack([20 * mesh.points, np.zeros(9)]).astype(np.float32) @ turn).astype(np.float32)
    raw = meshio.Mesh(there @ np.linalg.inv(turn), [("quad", mesh.cells)])
    assert np.ptp(raw.points[:, 2]) > 1e-8
    given = {"regions": {"t": "rest"}, "boundaries": {"pad": "lowest", "bone": "highest"}}
    assert ev.MeshedFinger(raw, {"t": LAW}, **given).mesh(1).node_sets["pad"].tolist() == [0, 1, 2]
    raw.points[4, 2] = 1e-3
    refuses("z from .* to 0.001; allowed: a plane mesh", ev.MeshedFinger, raw, {"t": LAW}, **given)


@pytest.mark.parametrize("kind", [str, object])
def test_texts_of_cells_are_the_names_of_their_regions(kind):
    """In two blocks, as meshio has cells of which each region is written by itself."""
    mesh = square_mesh()
    raw = meshio.Mesh(
        np.column_stack([mesh.points, np.zeros(9)]),
        [("quad", mesh.cells[:2]), ("quad", mesh.cells[2:])],
        cell_data={"region": [np.array(["skin", "nail"], kind), np.array(["skin", "skin"], kind)]},
    )
    laws, places = {"skin": LAW, "nail": LAW}, {"pad": "lowest", "bone": "highest"}
    found = ev.MeshedFinger(raw, laws, boundaries=places).mesh(1)
    assert found.cells_of("nail").tolist() == [1]
    assert found.cells_of("skin").tolist() == [0, 2, 3]
    for name, data in (("point", np.array(["yes"] * 9)), ("bone", np.full(9, "1"))):
        raw.point_data = {name: data}
        given = ev.MeshedFinger, raw, laws
        if name == "bone":
            refuses("given the meshio.Mesh with texts in point data `bone`; allowed: 0 or 1", *given)
        else:
            refuses("no boundary pad .it has point data point that are not 0 and 1", *given)
    raw.cell_data["region"][1] = np.array(["skin", None], object)
    refuses("cell data `region` that are no integers", ev.MeshedFinger, raw, laws)


def test_a_mesh_of_ours_takes_places_and_refuses_regions():
    bare = replace(square_mesh(), node_sets={})
    laws = {"soft": LAW, "hard": LAW}
    finger = ev.MeshedFinger(bare, laws, boundaries={"pad": "lowest", "bone": "highest"})
    assert finger.mesh(1).node_sets["bone"].tolist() == [6, 7, 8]
    refuses("no boundary pad .*with their names or places", ev.MeshedFinger, bare, laws)
    refuses("finger.regions: given beside a Mesh", ev.MeshedFinger, bare, laws, regions={"soft": 0})
    refuses("finger.mesh: given 5; allowed: the path .* a PyVista grid", ev.MeshedFinger, 5, laws)


@pytest.mark.others
def test_a_grid_of_pyvista_is_taken_as_it_is():
    """PyVista 0.49 keeps `y < 0` as an array of bool, and has offsets of cells under a new name."""
    import pyvista

    mesh = square_mesh("quad9")
    kind = np.full(len(mesh.cells), 28)  # VTK_BIQUADRATIC_QUAD
    rows = np.column_stack([np.full(len(mesh.cells), 9), mesh.cells])
    grid = pyvista.UnstructuredGrid(rows.ravel(), kind, np.column_stack([mesh.points, np.zeros(25)]))
    grid.point_data["pad"] = grid.points[:, 1] < 0.1
    grid.point_data["bone"] = grid.points[:, 1] > 1.9
    grid.point_data["who"] = np.array(["a"] * 25)
    grid.cell_data["region"] = mesh.region
    laws = {"soft": LAW, "hard": LAW}
    found = ev.MeshedFinger(grid, laws, regions={"soft": 0, "hard": 1}).mesh()
    assert found.cells.tolist() == mesh.cells.tolist()
    assert found.points.tolist() == mesh.points.tolist()
    assert found.region.tolist() == mesh.region.tolist()
    assert found.node_sets["bone"].tolist() == mesh.node_sets["bone"].tolist()


@pytest.mark.others
@pytest.mark.parametrize(("layers", "kind", "nodes"), [(1, "quad", 3), (2, "hexahedron", 6)])
def test_an_image_of_pyvista_is_taken_in_a_process_that_has_read_no_file(layers, kind, nodes):
    """Its cells are pixels and voxels (8 and 11 of VTK), of which meshio 5.3 must be told first."""
    code = (
        "import pyvista\nimport evfem as ev\n"
        f"image = pyvista.ImageData(dimensions=(3, 3, {layers}), spacing=(4, 4, 4))\n"
        "names = {'regions': {'tissue': 'rest'}, 'boundaries': {'pad': 'lowest', 'bone': 'highest'}}\n"
        "mesh = ev.MeshedFinger(image, {'tissue': ev.NeoHookean(E=0.1, nu=0.4)}, **names).mesh(1)\n"
        "print(mesh.kind, len(mesh.node_sets['bone']), mesh.points[mesh.node_sets['bone'], 1].min())"
    )
    assert printed(code) == f"{kind} {nodes} 8.0"


@pytest.mark.others
def test_the_model_of_gmsh_is_taken_with_all_its_groups():
    """Gmsh 4.15: an ellipse with a hole, whose lower curve is in two groups."""
    import gmsh

    refuses("given gmsh without a mesh; .*mesh.generate", ev.MeshedFinger, gmsh, {"tissue": LAW})
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("Mesh.SaveAll", 1)
        outer, hole = gmsh.model.occ.addDisk(0, 0, 0, 8, 6), gmsh.model.occ.addDisk(0, 1, 0, 3, 2)
        gmsh.model.occ.cut([(2, outer)], [(2, hole)])
        gmsh.model.occ.synchronize()
        gmsh.model.addPhysicalGroup(2, [1], name="tissue")
        gmsh.model.mesh.generate(2)
        places = {"pad": "lowest", "bone": "inside"}
        mesh = ev.MeshedFinger(gmsh, {"tissue": LAW}, boundaries=places).mesh(1)
        x, y = mesh.points[mesh.node_sets["bone"]].T
        np.testing.assert_allclose((x / 3) ** 2 + ((y - 1) / 2) ** 2, 1.0, rtol=1e-9)
        x, y = mesh.points[mesh.node_sets["pad"]].T
        np.testing.assert_allclose((x / 8) ** 2 + (y / 6) ** 2, 1.0, rtol=1e-9)
        assert y.max() == pytest.approx(0.0, abs=0.5)
        assert y.min() == pytest.approx(-6.0, abs=0.1)
        assert gmsh.option.getNumber("Mesh.SaveAll") == 1
        curves = [tag for _, tag in gmsh.model.getEntities(1)]
        for name, tags in (("pad", curves[:1]), ("also", curves[:1]), ("bone", curves[1:])):
            gmsh.model.addPhysicalGroup(1, tags, name=name)
        gmsh.model.addPhysicalGroup(2, [1], name="twice")
        sets = ev.MeshedFinger(gmsh, {"tissue": LAW}, regions={"tissue": "tissue"}).mesh(1).node_sets
        assert len(sets["pad"]) == len(sets["also"]) > 5
    finally:
        gmsh.finalize()


@pytest.mark.others
@pytest.mark.parametrize("ending", ["msh", "mesh", "su2", "vtk", "inp"])
def test_the_same_ellipse_in_formats_of_gmsh_without_names(tmp_path, ending):
    """Gmsh 4.15 writes no names for what is in no group; the curves are where they are drawn."""
    import gmsh

    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("Mesh.SaveAll", 1)
        outer, hole = gmsh.model.occ.addDisk(0, 0, 0, 8, 6), gmsh.model.occ.addDisk(0, 1, 0, 3, 2)
        gmsh.model.occ.cut([(2, outer)], [(2, hole)])
        gmsh.model.occ.synchronize()
        gmsh.model.mesh.generate(2)
        gmsh.write(str(tmp_path / f"ellipse.{ending}"))
    finally:
        gmsh.finalize()
    places = {"pad": "lowest", "bone": "inside"}
    path, rest = tmp_path / f"ellipse.{ending}", {"tissue": "rest"}
    mesh = ev.MeshedFinger(path, {"tissue": LAW}, regions=rest, boundaries=places).mesh(1)
    on = {}
    for name, (a, b, middle) in {"pad": (8, 6, 0), "bone": (3, 2, 1)}.items():
        x, y = (mesh.points - [0.0, middle]).T
        on[name] = np.flatnonzero(np.isclose((x / a) ** 2 + (y / b) ** 2, 1.0, rtol=1e-5))
    assert mesh.node_sets["bone"].tolist() == on["bone"].tolist()
    low = mesh.points[on["pad"], 1] < -0.5  # the widest place is somewhere between two nodes
    assert set(on["pad"][low]) <= set(mesh.node_sets["pad"]) <= set(on["pad"])
