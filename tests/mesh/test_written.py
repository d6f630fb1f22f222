"""Meshes as the libraries of their formats write them: `written/make.py` made the files, and says with which.

The body is 8 x 4 mm, in space 3 mm deep, sheared so that no area and no volume changes: areas and volumes of
its regions are those of the straight one, and the Jacobian determinant is the same everywhere in a cell,
which it is not where a reader has the nodes in another order.
"""

import subprocess
import sys
from pathlib import Path

import meshio
import numpy as np
import pytest
from tools.refusals import refuses

from evfem.mesh.faces import node_places, shape_functions
from evfem.mesh.file import parts, read

WRITTEN = Path(__file__).parent / "written"
#: names, where a file has them, and numbers
NAMES = (None, None)
NUMBERS = ({"skin": 1, "tissue": 2}, {"pad": 3, "bone": 4})
#: names of the regions, and of Gmsh's own groups beside them
CHOSEN = ({"skin": "skin", "tissue": "tissue"}, None)
SECOND = ("triangle6", "quad9", "hexahedron27")
FIRST = ("quad", "hexahedron")
#: rows of the table in docs/howto/mesh.md: file -> what [finger.regions] and [finger.boundaries] must say
READ = {
    **{f"gmsh_{kind}_{version}.msh": NAMES for kind in (*FIRST, *SECOND) for version in (2.2, 4.1)},
    **{f"gmsh_{kind}.med": NAMES for kind in (*FIRST, *SECOND)},
    **{f"gmsh_{kind}.inp": CHOSEN for kind in (*FIRST, *SECOND)},
    **{f"gmsh_{kind}.{ending}": NUMBERS for kind in FIRST for ending in ("bdf", "mesh")},
    **{f"gmsh_{kind}.vtk": NUMBERS for kind in (*FIRST, *SECOND)},
    **{f"medcoupling_{name}.med": NAMES for name in ("quad9", "hexahedron27", "metres")},
    **{f"exodus_{name}.exo": NAMES for name in (*SECOND, "shell9", "trishell6")},
    "exodus_unnamed.exo": ({"skin": 20, "tissue": 10}, {"pad": 7, "bone": 8}),
    **{f"pyvista_{name}.vtu": ({"skin": 1, "tissue": 2}, None) for name in ("quad9", "hexahedron")},
    **{f"dolfinx_{name}.xdmf": NUMBERS for name in ("quad9", "hexahedron27")},
    "dolfinx_functions.xdmf": ({"skin": 1, "tissue": 2}, None),
}
NEED_VTK = [f"pyvista_{kind}{ending}" for kind in ("quad9", "hexahedron")
            for ending in (".vtk", "_ascii.vtk", "_lz4.vtu")]  # fmt: skip


def is_the_body(path, regions=None, boundaries=None):
    """The mesh of a file, which has the areas (volumes), the order of nodes and the boundaries it should."""
    mesh = read(path, regions, boundaries)
    x, nodes = mesh.points[mesh.cells], mesh.cells.shape[1]
    _, slope = shape_functions(nodes, node_places(nodes, mesh.dim))
    size = np.linalg.det(np.einsum("pnk,enc->epkc", slope, x))
    np.testing.assert_allclose(size, np.repeat(size[:, :1], nodes, axis=1), rtol=1e-5)
    whole = size[:, 0] * (2.0 if mesh.corners == 3 else 2.0**mesh.dim)
    depth = 3.0 if mesh.dim == 3 else 1.0
    for name, area in (("skin", 24.0), ("tissue", 8.0)):
        assert whole[mesh.cells_of(name)].sum() == pytest.approx(area * depth, rel=1e-6)
    for name, y in (("pad", 0.0), ("bone", 4.0)):
        np.testing.assert_array_equal(mesh.node_sets[name], np.flatnonzero(abs(mesh.points[:, 1] - y) < 1e-6))
    return mesh


@pytest.mark.filterwarnings("ignore:numpy.ndarray size changed")  # of an older netCDF4
@pytest.mark.parametrize("name", READ)
def test_what_a_format_carries_is_read(name):
    kind = Path(name).stem.split("_")[1]
    others = {"metres": "quad9", "shell9": "quad9", "trishell6": "triangle6"}
    others |= {"unnamed": "hexahedron27", "functions": "quad"}
    assert is_the_body(WRITTEN / name, *READ[name]).kind == others.get(kind, kind)


@pytest.mark.others
@pytest.mark.parametrize("library", ["gmsh", "pyvista"])
def test_what_the_libraries_write_today_is_read(library, tmp_path):
    subprocess.run([sys.executable, WRITTEN / "make.py", library, tmp_path], check=True)
    names = [name for name in READ if name.startswith(library)]
    assert names
    for name in names:
        is_the_body(tmp_path / name, *READ[name])


def rows_of_the_table():
    """Ending, second order, space and libraries of each row in the how-to."""
    page = (WRITTEN.parents[2] / "docs/howto/mesh.md").read_text()
    rows = (line.strip("| ").split(" | ") for line in page.splitlines() if line.startswith("| `."))
    return {row[0].strip("`."): (row[3], row[4], row[5].lower().split(",")) for row in rows}


@pytest.mark.parametrize("ending", rows_of_the_table())
def test_every_row_of_the_table_has_its_files(ending):
    second, space, libraries = rows_of_the_table()[ending]
    names = [*READ, *NEED_VTK, *(f"gmsh_{kind}.su2" for kind in (*FIRST, *SECOND))]
    found = [name for name in names if name.endswith(f".{ending}")]
    assert second == ("yes" if any(kind in name for name in found for kind in SECOND) else "no")
    assert space == ("yes" if any("hexahedron" in name for name in found) else "no")
    writers = {name.split("_")[0] for name in found} or {"gmsh"}  # whose file is refused
    assert writers == {one.strip().split("_")[0].replace("fenicsx", "dolfinx") for one in libraries}


@pytest.mark.filterwarnings("ignore:numpy.ndarray size changed")
@pytest.mark.parametrize("ending", ["g", "gen"])
def test_numbers_of_exodus_blocks_are_those_of_the_file_and_not_places(ending, tmp_path):
    """Up to 0.3 the first block was 1, the second 2: with the numbers 2, 1 the materials changed places."""
    import netCDF4

    (tmp_path / f"swapped.{ending}").write_bytes((WRITTEN / "exodus_unnamed.exo").read_bytes())
    with netCDF4.Dataset(tmp_path / f"swapped.{ending}", "a") as file:
        file["eb_prop1"][:] = [2, 1]
    mesh = is_the_body(tmp_path / f"swapped.{ending}", {"skin": 2, "tissue": 1}, {"pad": 7, "bone": 8})
    assert np.flatnonzero(mesh.points[:, 1] == 3.0).tolist() == mesh.node_sets["node set 7"].tolist()
    refuses(f"groups that occur in swapped.{ending}: 2, 1", read, tmp_path / f"swapped.{ending}", {"skin": 3})


@pytest.mark.filterwarnings("ignore:numpy.ndarray size changed")
def test_blocks_of_one_name_are_one_region(tmp_path):
    path = with_names(tmp_path / "two.exo", eb_names=["body", "body"])
    mesh = read(path, None, {"pad": 7, "bone": 8})
    assert list(mesh.region_names) == ["body"]
    assert mesh.cells_of("body").tolist() == list(range(len(mesh.cells)))


@pytest.mark.filterwarnings("ignore:numpy.ndarray size changed")
def test_a_boundary_with_a_name_is_known_by_its_number_too(tmp_path):
    """In Exodus 7 is a side set before a node set; in Gmsh 3 is the curve `pad`."""
    plain = read(WRITTEN / "exodus_unnamed.exo", {"skin": 20, "tissue": 10}, {"pad": 7, "bone": 8})
    path = with_names(tmp_path / "names.exo", ss_names=["low side", "high side"], ns_names=["low side"])
    for name in ("low side", "high"):
        with_names(path, ss_names=["low side", "high side"], ns_names=[name])
        sets = read(path, {"skin": 20, "tissue": 10}, {"pad": 7, "bone": 8}).node_sets
        assert sets["pad"].tolist() == plain.node_sets["pad"].tolist() == sets["low side"].tolist()
        assert sets["bone"].tolist() == plain.node_sets["bone"].tolist() == sets["high side"].tolist()
    refuses("pad = 9; .*sets of names.exo: low side, high side", read, path,
            {"skin": 20, "tissue": 10}, {"pad": 9, "bone": 8})  # fmt: skip


@pytest.mark.parametrize("version", [2.2, 4.1])
def test_a_physical_curve_with_a_name_is_known_by_its_number_too(version):
    path = WRITTEN / f"gmsh_quad_{version}.msh"
    numbers = {name: int(tag[0]) for name, tag in meshio.read(path).field_data.items() if tag[1] == 1}
    mesh = read(path, None, {"low": numbers["pad"], "high": numbers["bone"]})
    assert mesh.node_sets["low"].tolist() == mesh.node_sets["pad"].tolist()
    assert mesh.node_sets["high"].tolist() == mesh.node_sets["bone"].tolist()


def with_names(path, **names):
    """The body without names, with some."""
    import netCDF4

    path.write_bytes((WRITTEN / "exodus_unnamed.exo").read_bytes())
    with netCDF4.Dataset(path, "a") as file:
        for what, given in names.items():
            letters = np.zeros(file[what].shape, "S1")
            for row, name in zip(letters, given, strict=True):
                row[: len(name)] = list(name)
            file[what][:] = letters
    return path


@pytest.mark.filterwarnings("ignore:numpy.ndarray size changed")
def test_a_side_of_what_no_finger_is_made_of_does_not_hide_that(tmp_path):
    import netCDF4

    with netCDF4.Dataset(tmp_path / "tip.exo", "w") as file:
        for name, size in (("num_dim", 3), ("num_nodes", 4), ("num_el_blk", 1), ("num_nod_per_el1", 4),
                           ("num_el_in_blk1", 1), ("num_side_sets", 1), ("num_side_ss1", 1)):  # fmt: skip
            file.createDimension(name, size)
        file.createVariable("coord", "f8", ("num_dim", "num_nodes"))[:] = np.eye(3, 4)
        block = file.createVariable("connect1", "i4", ("num_el_in_blk1", "num_nod_per_el1"))
        block.elem_type, block[:] = "TETRA", [[1, 2, 3, 4]]
        file.createVariable("elem_ss1", "i4", "num_side_ss1")[:] = 1
        file.createVariable("side_ss1", "i4", "num_side_ss1")[:] = 4
    assert parts(tmp_path / "tip.exo").point_sets[1].tolist() == [0, 1, 2, 3]
    refuses("with tetra cells; .*From tetrahedra", read, tmp_path / "tip.exo")
    for element, side in ((2, 4), (1, 9), (1, 0)):
        with netCDF4.Dataset(tmp_path / "tip.exo", "a") as file:
            file["elem_ss1"][:], file["side_ss1"][:] = element, side
        refuses(f"side set 1 with side {side} of an element that has none of it", read, tmp_path / "tip.exo")


@pytest.mark.parametrize("kind", [*FIRST, *SECOND])
def test_markers_of_su2_are_boundaries_and_its_cells_one_group(kind):
    mesh = read(WRITTEN / f"gmsh_{kind}.su2", {"tissue": 0})
    assert mesh.kind == kind
    for name, y in (("pad", 0.0), ("bone", 4.0)):
        np.testing.assert_array_equal(mesh.node_sets[name], np.flatnonzero(abs(mesh.points[:, 1] - y) < 1e-9))


def test_a_marker_of_su2_that_is_a_number_has_no_name(tmp_path):
    text = (WRITTEN / "gmsh_quad.su2").read_text().replace("MARKER_TAG= pad", "MARKER_TAG= 7")
    (tmp_path / "numbers.su2").write_text("% by hand\nNZONE= 1\n" + text)
    sets = read(tmp_path / "numbers.su2", {"tissue": 0}, {"pad": 7}).node_sets
    assert {name: len(nodes) for name, nodes in sets.items()} == {"bone": 3, "pad": 3}
    refuses("no boundary pad .it has bone, the number 7", read, tmp_path / "numbers.su2", {"tissue": 0})
    said = "".join(f"{line} % by hand\n" for line in text.splitlines())
    (tmp_path / "said.su2").write_text(said)
    assert len(read(tmp_path / "said.su2", {"tissue": 0}, {"pad": 7}).node_sets["pad"]) == 3
    (tmp_path / "zones.su2").write_text("NZONE= 2\n" + text)
    refuses("2 zones: keep one", read, tmp_path / "zones.su2", {"tissue": 0})


@pytest.mark.parametrize("version", [2.2, 4.1])
def test_elements_in_two_groups_are_read(version):
    """Version 2.2 has them twice, once for each group."""
    path = WRITTEN / f"gmsh_two_{version}.msh"
    mesh = is_the_body(path, *CHOSEN)
    np.testing.assert_array_equal(mesh.node_sets["low"], mesh.node_sets["pad"])
    assert len(read(path, {"body": "all"}).cells) == 4
    said = 'body and skin with the same cells; .* as body = "all"'
    refuses(said, read, path, {"body": "all", "skin": "skin"})


def test_elements_twice_in_one_group_are_no_second_group(tmp_path):
    text = (WRITTEN / "gmsh_quad_2.2.msh").read_text()
    quad = next(line for line in text.splitlines() if line.split()[1:4] == ["3", "2", "1"])
    text = text.replace(quad, f"{quad}\n{quad}").replace("$Elements\n8", "$Elements\n9")
    (tmp_path / "double.msh").write_text(text)
    refuses("more than two cells on the edge", read, tmp_path / "double.msh")


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("gmsh_all_2.2.msh", r"without region numbers; .*\.msh saved with Mesh\.SaveAll = 0"),
        ("gmsh_all_4.1.msh", r"outside of physical groups: save with Mesh\.SaveAll = 0"),
        ("gmsh_quad.unv", r"no format \.unv is known"),
        *((f"gmsh_{kind}.mesh", r"cells of second order, .* save as \.msh") for kind in SECOND),
        ("gmsh_hexahedron27.bdf", "with hexahedron20 cells"),  # as Gmsh writes it
    ],
)
def test_what_a_format_does_not_carry_is_refused_with_the_reason(name, said):
    refuses(said, read, WRITTEN / name)


def level(low, high, dim):
    """A box of all that is between two heights."""
    return {"box": [[-99.0, low, -99.0][:dim], [99.0, high, 99.0][:dim]]}


@pytest.mark.parametrize(
    ("name", "dim"),
    [
        ("gmsh_all_2.2.msh", 2),  # saved with all elements: it has no groups
        ("gmsh_quad9.bdf", 2),
        *((f"gmsh_{kind}.su2", 3 if "hex" in kind else 2) for kind in (*FIRST, *SECOND)),
    ],
)
def test_what_a_format_does_not_carry_is_given_by_place(name, dim):
    regions = {"tissue": level(3, 4, dim), "skin": "rest"}
    is_the_body(WRITTEN / name, regions, {"pad": level(0, 0, dim), "bone": level(4, 4, dim)})


@pytest.mark.parametrize("kind", ["triangle6", "quad9"])
def test_edges_in_gmsh_decks_of_nastran_have_no_middle(kind):
    refuses("a pad without an edge of the outline", read, WRITTEN / f"gmsh_{kind}.bdf", *NUMBERS)


def test_units_of_med_that_are_no_lengths_are_refused(tmp_path):
    import h5py

    for units, said in (
        (b"rad", "coordinates in rad: give them in mm"),
        (b"mm              m", "in m and mm"),
    ):
        (tmp_path / "units.med").write_bytes((WRITTEN / "medcoupling_metres.med").read_bytes())
        with h5py.File(tmp_path / "units.med", "a") as file:
            file["ENS_MAA/finger"].attrs["UNI"] = np.bytes_(units)
        refuses(said, read, tmp_path / "units.med")
    with h5py.File(tmp_path / "units.med", "a") as file:
        file["ENS_MAA/finger"].attrs["REP"] = 1
    refuses("cylindrical or spherical axes", read, tmp_path / "units.med")


def test_tags_of_fenicsx_must_be_on_all_cells(tmp_path):
    import h5py

    for ending in ("xdmf", "h5"):
        (tmp_path / f"dolfinx_quad9.{ending}").write_bytes((WRITTEN / f"dolfinx_quad9.{ending}").read_bytes())
    path = tmp_path / "dolfinx_quad9.xdmf"
    with h5py.File(tmp_path / "dolfinx_quad9.h5", "a") as file:
        tags = file["MeshTags/cells/topology"][()]
        tags[0] = tags[1]
        file["MeshTags/cells/topology"][...] = tags
    refuses("1 cells without a tag of cells: tag all", read, path, *NUMBERS)
    path.write_text(path.read_text().replace("Edge_3", "Quadrilateral_9"))
    refuses("several tags of cells, cells and facets: keep one", read, path, *NUMBERS)


ENTITY = '<!DOCTYPE Xdmf SYSTEM "Xdmf.dtd" [<!ENTITY a "1">]>'
DTD = '<!DOCTYPE Xdmf SYSTEM "Xdmf.dtd" []>'


@pytest.mark.parametrize(
    "head",
    [
        ENTITY,
        f"{DTD}{DTD}",
        '<!DOCTYPE Xdmf SYSTEM "file:///etc/hostname" []>',
        f"<!-- {2000 * 'x'} -->{ENTITY}",
        "<!DOCTYPE Xdmf [<!ELEMENT Xdmf ANY>]>",
    ],
)
def test_documents_that_declare_something_are_refused(head, tmp_path):
    """Beside the line of FEniCSx, which declares nothing and is not fetched."""
    text = (WRITTEN / "dolfinx_quad9.xdmf").read_text()
    assert DTD in text
    for coding in ("utf-8", "utf-16-le"):
        (tmp_path / "mesh.xdmf").write_bytes(text.replace(DTD, head).encode(coding))
        refuses("a document type, or no UTF-8", read, tmp_path / "mesh.xdmf")


@pytest.mark.parametrize("name", NEED_VTK)
def test_without_vtk_what_it_alone_reads_is_refused_with_what_to_do(name, monkeypatch):
    """Version 5.1 of .vtk, in which a bool array may be a colour that meshio passes over."""
    monkeypatch.setattr("evfem.mesh.formats.vtk.find_spec", lambda name: None)
    refuses(r"pip install 'evfem\[vtk\]', or save", read, WRITTEN / name, {"skin": 1, "tissue": 2})


@pytest.mark.vtk
@pytest.mark.parametrize("name", NEED_VTK)
def test_with_vtk_it_is_read(name, capfd):
    is_the_body(WRITTEN / name, {"skin": 1, "tissue": 2})
    assert capfd.readouterr() == ("", "")


@pytest.mark.vtk
def test_bytes_that_vtk_writes_as_colours_are_no_less_a_boundary(tmp_path):
    """meshio 5.3 reads such a text, without them and what follows them."""
    import pyvista

    grid = pyvista.read(WRITTEN / "pyvista_quad9.vtu")
    grid.cell_data.remove("material")
    grid.field_data.clear()
    for data, name, kind in (
        (grid.point_data, "pad", np.uint8),
        (grid.point_data, "bone", np.int32),
        (grid.cell_data, "region", np.int32),
    ):
        data[name] = data[name].astype(kind)
    grid.set_active_scalars("pad")
    grid.save(tmp_path / "mesh.vtk", binary=False)
    assert not meshio.read(tmp_path / "mesh.vtk").point_data
    is_the_body(tmp_path / "mesh.vtk", {"skin": 1, "tissue": 2})


@pytest.mark.vtk
@pytest.mark.parametrize("left", [27, 60, 300, 900])
@pytest.mark.parametrize("name", ["pyvista_quad9.vtk", "pyvista_quad9_lz4.vtu"])
def test_what_vtk_says_of_damaged_files_is_not_on_the_terminal(name, left, tmp_path, capfd):
    (tmp_path / name).write_bytes((WRITTEN / name).read_bytes()[:left])
    said = "damaged, or without cells" if name.endswith(".vtk") else name
    refuses(said, read, tmp_path / name, {"skin": 1, "tissue": 2})
    assert capfd.readouterr() == ("", "")


@pytest.mark.vtk
def test_a_file_that_ends_the_process_of_vtk_ends_no_other(tmp_path):
    """A cell of a node that is not there: VTK 9.7 is killed by a segmentation fault."""
    text = (WRITTEN / "pyvista_quad9_ascii.vtk").read_text()
    (tmp_path / "mesh.vtk").write_text(text.replace("\n0 2 12 10 ", "\n0 2 999999999 10 "))
    refuses("damaged, or without cells", read, tmp_path / "mesh.vtk", {"skin": 1, "tissue": 2})


@pytest.mark.vtk
@pytest.mark.parametrize("texts", [False, True])
@pytest.mark.parametrize("compressor", ["None", "ZLib", "LZMA", "LZ4"])
@pytest.mark.parametrize("mode", ["Ascii", "Binary", "Appended", "raw"])
def test_every_way_in_which_vtk_writes_is_read(mode, compressor, texts, tmp_path):
    import pyvista
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridWriter

    grid = pyvista.read(WRITTEN / "pyvista_quad9.vtu")
    if not texts:
        grid.cell_data.remove("material")
        grid.field_data.clear()
    writer = vtkXMLUnstructuredGridWriter()
    writer.SetInputData(grid)
    writer.SetFileName(str(tmp_path / "mesh.vtu"))
    getattr(writer, f"SetCompressorTypeTo{compressor}")()
    getattr(writer, f"SetDataModeTo{'Appended' if mode == 'raw' else mode}")()
    writer.SetEncodeAppendedData(mode != "raw")
    writer.Write()
    is_the_body(tmp_path / "mesh.vtu", {"skin": 1, "tissue": 2})


@pytest.mark.vtk
@pytest.mark.filterwarnings("ignore:numpy.ndarray size changed")
def test_nodes_of_exodus_are_where_vtk_has_them():
    import pyvista

    path = WRITTEN / "exodus_hexahedron27.exo"
    raw = parts(path)
    for group in raw.groups:
        one = pyvista.read(path)[0][group.name]
        theirs = one.points[one.cells.reshape(-1, 28)[:, 1:]]
        np.testing.assert_allclose(raw.points[raw.cells[group.block].data], theirs, atol=1e-6)


@pytest.mark.vtk
def test_names_that_a_grid_of_pyvista_has_are_listed_where_the_expected_ones_are_not(tmp_path):
    import pyvista

    grid = pyvista.read(WRITTEN / "pyvista_quad9.vtu")
    grid.rename_array("region", "layer")
    grid.point_data["depth"] = grid.points[:, 1]
    grid.save(tmp_path / "mesh.vtu")
    refuses("without region numbers .its cell data: layer", read, tmp_path / "mesh.vtu")
    grid.rename_array("layer", "region")
    grid.rename_array("pad", "sole")
    grid.save(tmp_path / "mesh.vtu")
    said = "no boundary pad .it has bone, sole, point data depth that are not 0 and 1"
    refuses(said, read, tmp_path / "mesh.vtu", {"skin": 1, "tissue": 2})


@pytest.mark.vtk
@pytest.mark.parametrize("ending", ["vtu", "vtk"])
def test_regions_and_boundaries_that_vtk_wrote_as_texts_are_said_to_be_such(ending, tmp_path):
    import pyvista

    grid = pyvista.read(WRITTEN / "pyvista_quad9.vtu")
    low, first = grid.points[:, 1] < 0.1, np.array(grid.cell_data["region"]) == 1
    grid.point_data.remove("pad")
    grid.point_data["pad"] = np.where(low, "yes", "no")
    grid.save(tmp_path / f"mesh.{ending}")
    refuses("no boundary pad .*, pad as texts", read, tmp_path / f"mesh.{ending}", {"skin": 1, "tissue": 2})
    grid.cell_data.remove("region")
    grid.cell_data["region"] = np.where(first, "skin", "tissue")
    grid.save(tmp_path / f"mesh.{ending}")
    refuses("without region numbers .*region as texts.; .*integer", read, tmp_path / f"mesh.{ending}")


def test_a_pointer_of_git_lfs_is_no_damaged_file(tmp_path):
    """The specification of Git LFS, version 1: three lines of text in place of the file."""
    path = tmp_path / "body.msh"
    path.write_text(f"version https://git-lfs.github.com/spec/v1\noid sha256:{64 * '0'}\nsize 5479\n")
    refuses("a pointer of Git LFS, not the file: git lfs pull", read, path)


def test_a_file_that_was_cut_off_within_its_cells_is_refused(tmp_path):
    """Of which meshio makes cells of three nodes, after a word on the screen."""
    whole = (WRITTEN / "gmsh_quad9_4.1.msh").read_text()
    (tmp_path / "cut.msh").write_text(whole.partition("$EndElements")[0].rsplit(maxsplit=12)[0])
    refuses(r"given cut.msh \(cells of the kind quad9 with 3 nodes\)", read, tmp_path / "cut.msh")
