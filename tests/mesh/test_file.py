"""Mesh files: round trips of every kind, clean terminal, names and numbers that fit."""

import meshio
import numpy as np
import pytest
from tools.mesh_parts import REGIONS, of_kind, raw
from tools.refusals import refuses

from evfem.errors import InputError, StorageError
from evfem.mesh import file as meshfile
from evfem.mesh.mesh import Mesh
from evfem.mesh.quality import scaled_jacobian
from evfem.meshes.benchmark import benchmark_mesh


def stored(folder, **changes):
    path = folder / "mesh.vtu"
    meshio.Mesh(**raw(**changes)).write(path)
    return path


def same(one, other):
    np.testing.assert_allclose(one.points, other.points, rtol=1e-15)
    np.testing.assert_array_equal(one.cells, other.cells)
    assert one.kind == other.kind
    assert set(one.region_names) == set(other.region_names)
    for name in one.region_names:
        np.testing.assert_array_equal(one.cells_of(name), other.cells_of(name))
    assert set(one.node_sets) == set(other.node_sets)
    for name, nodes in one.node_sets.items():
        np.testing.assert_array_equal(nodes, other.node_sets[name])


@pytest.mark.parametrize("kind", ["quad", "quad9", "triangle", "triangle6"])
@pytest.mark.parametrize("ending", ["vtu", "msh"])
def test_every_kind_of_mesh_survives_a_file(kind, ending, tmp_path):
    mesh = of_kind(kind)
    path = tmp_path / f"mesh.{ending}"
    meshfile.write(mesh, path)
    same(meshfile.read(path), mesh)
    assert [file.name for file in tmp_path.iterdir()] == [path.name]


def test_version_four_gmsh_file_is_read(tmp_path):
    mesh = benchmark_mesh(0)
    meshfile.write(mesh, tmp_path / "two.msh")
    file = meshio.read(tmp_path / "two.msh")
    names = {(1, 3): "pad", (1, 4): "bone", (2, 1): "tissue", (2, 2): "skin"}
    path = tmp_path / "four.msh"
    path.write_text(version_four(file, names))
    read = meshfile.read(path)
    by_region = (one.cells[np.argsort(one.region, kind="stable")] for one in (read, mesh))
    np.testing.assert_array_equal(*by_region)
    np.testing.assert_array_equal(read.node_sets["pad"], mesh.node_sets["pad"])
    np.testing.assert_array_equal(read.node_sets["bone"], mesh.node_sets["bone"])
    path.write_text(path.read_text().replace(" 1 -4 0\n", " 2 -4 3 0\n"))
    both = meshfile.read(path, boundaries={"held": "bone"}).node_sets
    np.testing.assert_array_equal(both["pad"], np.union1d(mesh.node_sets["pad"], mesh.node_sets["bone"]))
    np.testing.assert_array_equal(both["held"], mesh.node_sets["bone"])
    path.write_text(path.read_text().replace(" 2 -4 3 0\n", " 0 0\n"))
    refuses(r"outside of physical groups: save with Mesh\.SaveAll = 0", meshfile.read, path)


def version_four(file, names):
    """A `.msh` 4.1 text as gmsh writes it: entities that carry the physical groups, blocks per entity."""
    box = "-9 -9 0 9 9 0"
    lines = [f"{tag} {box} 1 -{tag} 0" for d, tag in names if d == 1]  # curves that run backwards
    faces = [f"{tag} {box} 1 {tag} 0" for d, tag in names if d == 2]
    nodes = [f"{x:.17g} {y:.17g} 0" for x, y, _ in file.points]
    numbers = [str(i + 1) for i in range(len(nodes))]
    blocks, count = [], 0
    for block, tags in zip(file.cells, file.cell_data["gmsh:physical"], strict=True):
        for tag in np.unique(tags):
            rows = block.data[tags == tag] + 1
            kind, dimension = {"line": (1, 1), "quad": (3, 2)}[block.type]
            blocks.append(f"{dimension} {tag} {kind} {len(rows)}")
            blocks += [f"{count + i + 1} {' '.join(map(str, row))}" for i, row in enumerate(rows)]
            count += len(rows)
    text = ["$MeshFormat", "4.1 0 8", "$EndMeshFormat", "$PhysicalNames", str(len(names))]
    text += [f'{d} {tag} "{name}"' for (d, tag), name in names.items()] + ["$EndPhysicalNames"]
    text += ["$Entities", f"0 {len(lines)} {len(faces)} 0", *lines, *faces, "$EndEntities"]
    text += ["$Nodes", f"1 {len(nodes)} 1 {len(nodes)}", f"2 1 0 {len(nodes)}", *numbers, *nodes, "$EndNodes"]
    text += ["$Elements", f"4 {count} 1 {count}", *blocks, "$EndElements", ""]
    return "\n".join(text)


def test_clockwise_meshes_are_turned_round(tmp_path):
    for kind in ("quad", "quad9", "triangle", "triangle6"):
        mesh = of_kind(kind)
        mirrored = Mesh(
            mesh.points * [-1.0, 1.0], mesh.cells, kind, mesh.region, mesh.region_names, mesh.node_sets
        )
        assert scaled_jacobian(mirrored).max() < 0.0
        path = tmp_path / "mesh.vtu"
        meshio.Mesh(**raw(mirrored)).write(path)
        read = meshfile.read(path, REGIONS)
        np.testing.assert_allclose(np.sort(scaled_jacobian(read)), np.sort(scaled_jacobian(mesh)), rtol=1e-12)
        # the same nodes in each cell, mid-nodes still between their corners
        np.testing.assert_array_equal(np.sort(read.cells, axis=1), np.sort(mesh.cells, axis=1))
        some = np.arange(len(mesh.cells)) % 3 == 0
        mixed = np.where(some[:, None], read.cells, mirrored.cells)
        meshio.Mesh(**raw(mirrored) | {"cells": [(kind, mixed)]}).write(path)
        np.testing.assert_array_equal(meshfile.read(path, REGIONS).cells, read.cells)


def test_pad_is_reduced_to_the_outline(tmp_path):
    parts = raw()
    parts["point_data"]["pad"][:] = 1.0
    meshio.Mesh(**parts).write(tmp_path / "mesh.vtu")
    mesh = meshfile.read(tmp_path / "mesh.vtu", REGIONS)
    np.testing.assert_array_equal(mesh.node_sets["pad"], np.unique(mesh.outer_sides))


@pytest.mark.parametrize(
    ("regions", "words"),
    [
        (None, "no name for 0, 1"),
        ({"tissue": 0}, "no name for 1"),
        ({"tissue": 0, "skin": 1, "nail": 7}, "nail = 7"),
        (
            {"tissue": 0, "skin": 1, "fat": 0},
            "tissue and fat with the same cells; allowed: one name per cell: those that "
            "count in [finger.regions], as tissue = 0",
        ),
    ],
)
def test_names_must_fit_the_numbers(regions, words, tmp_path):
    caught = refuses("allowed", meshfile.read, stored(tmp_path), regions)
    assert words in str(caught)
    assert caught.key == "finger.regions"


@pytest.mark.parametrize("name", ["mesh.vtu", "mesh.msh", "mesh.vtk", "mesh.inp", "mesh.xyz"])
@pytest.mark.parametrize(
    "content", [b"", b"no mesh at all\n", b"$MeshFormat\n9.9 0 8\n", b"\x00\xff\x10", b"<VTKFile/>"]
)
def test_unreadable_file_gets_a_sentence_and_a_clean_terminal(name, content, tmp_path, capfd):
    path = tmp_path / name
    path.write_bytes(content)
    caught = refuses("allowed", meshfile.read, path, REGIONS)
    assert name in str(caught)
    assert "\n" not in str(caught)
    assert capfd.readouterr() == ("", "")


def test_cells_outside_every_physical_group_are_refused(tmp_path):
    path = tmp_path / "mesh.msh"
    meshfile.write(benchmark_mesh(0), path)
    path.write_text(
        path.read_text().replace('2 2 "skin"\n', "").replace("$PhysicalNames\n4", "$PhysicalNames\n3")
    )
    refuses(r"no name for 2 of mesh\.msh", meshfile.read, path)


@pytest.mark.parametrize("name", ["mesh.stl", "mesh.vtk", "mesh.obj", "mesh", "mesh.VTX"])
def test_format_without_names_is_refused_and_nothing_written(name, tmp_path):
    refuses("cannot carry the names", meshfile.write, benchmark_mesh(0), tmp_path / name)
    assert list(tmp_path.iterdir()) == []


def test_failed_write_leaves_the_old_file_alone(tmp_path, monkeypatch):
    path = tmp_path / "mesh.vtu"
    path.write_bytes(b"old")

    def full(mesh, part):
        part.write_bytes(b"half")
        raise OSError(28, "No space left on device")

    monkeypatch.setitem(meshfile.WRITERS, ".vtu", full)
    with pytest.raises(StorageError, match="No space left"):
        meshfile.write(benchmark_mesh(0), path)
    assert path.read_bytes() == b"old"
    assert [file.name for file in tmp_path.iterdir()] == ["mesh.vtu"]
    with pytest.raises(StorageError):
        meshfile.write(benchmark_mesh(0), tmp_path / "no folder" / "mesh.vtu")


def test_msh_cannot_carry_a_lonely_node(tmp_path):
    mesh = benchmark_mesh(0)
    sets = {**mesh.node_sets, "mark": np.array([400])}
    with pytest.raises(InputError, match="node 400"):
        meshfile.write(
            Mesh(mesh.points, mesh.cells, "quad", mesh.region, mesh.region_names, sets), tmp_path / "m.msh"
        )
