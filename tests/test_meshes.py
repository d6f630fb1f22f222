"""The benchmark's meshes and those that come with the package: what their recipes make."""

import re
import shutil
import subprocess
import sys

import numpy as np
import pytest
from tools.refusals import refuses

import evfem.meshes
from evfem.mesh import file as meshfile
from evfem.mesh.quality import scaled_jacobian
from evfem.meshes.benchmark import LEVELS, benchmark_mesh
from evfem.meshes.make import RECIPES

README = (evfem.meshes.FOLDER / "README.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("level", LEVELS)
def test_benchmark_mesh_has_the_nodes_of_the_problem(level):
    mesh = benchmark_mesh(level)
    assert len(mesh.points) == {0: 793, 1: 3025, 2: 23253, 3: 46657}[level]
    outer = mesh.points[mesh.node_sets["pad"]]
    np.testing.assert_allclose((outer[:, 0] / 8.34) ** 2 + (outer[:, 1] / 6.395) ** 2, 1.0, rtol=1e-13)
    assert outer[:, 1].min() == pytest.approx(-6.395, rel=1e-15)
    bone = mesh.points[mesh.node_sets["bone"]]
    on_contour = np.abs((bone[:, 0] / 3.0) ** 2 + (bone[:, 1] / 2.5) ** 2 - 1.0) < 1e-12
    assert (on_contour | (bone[:, 1] == 0.0)).all()
    around, tissue, skin = LEVELS[level]
    assert len(bone) == around + 1 + 2 * (tissue + skin)
    # node between bone and interface at the middle column: on the straight line at equal parts
    below = np.sort(mesh.points[np.abs(mesh.points[:, 0]) < 1e-9, 1])[::-1]
    np.testing.assert_allclose(below[: tissue + 1], np.linspace(-2.5, -6.015, tissue + 1), rtol=1e-13)
    np.testing.assert_allclose(below[tissue:], np.linspace(-6.015, -6.395, skin + 1), rtol=1e-13)


def test_quadratic_benchmark_meshes():
    straight = benchmark_mesh(0, 2)
    corner = straight.points[straight.cells[:, :4]]
    np.testing.assert_allclose(
        straight.points[straight.cells[:, 4:8]], 0.5 * (corner + np.roll(corner, -1, axis=1))
    )
    through = benchmark_mesh(1, 2, same_nodes=True)
    np.testing.assert_array_equal(through.points, benchmark_mesh(1).points)
    assert len(through.cells) == 2880 // 4
    assert scaled_jacobian(through).min() > 0.5
    refuses("0, 1, 2 or 3", benchmark_mesh, 4)


@pytest.mark.parametrize("name", RECIPES)
def test_ready_made_meshes_are_what_the_recipe_makes(name, tmp_path):
    path = evfem.meshes.path(name)
    meshfile.write(RECIPES[name](), tmp_path / name)
    fresh, kept = meshfile.read(tmp_path / name), meshfile.read(path)
    again = f"{name} is not what its recipe makes; `python -m evfem.meshes.make` writes it again"
    assert (kept.kind, kept.points.shape) == (fresh.kind, fresh.points.shape), again
    np.testing.assert_allclose(kept.points, fresh.points, atol=1e-12, err_msg=again)
    for part in ("cells", "region"):
        assert np.array_equal(getattr(kept, part), getattr(fresh, part)), again
    assert (kept.region_names, set(kept.node_sets)) == (fresh.region_names, set(fresh.node_sets)), again
    listed = f"`{name}` | {len(kept.cells)} {kept.kind}s, {len(kept.points)} |"
    assert listed in README, f"meshes/README.md does not say {listed}"


@pytest.mark.parametrize(
    ("family", "recipe"), [("finger-*", "finger-coarse-ridged.vtu"), ("benchmark-*", "benchmark-L0.vtu")]
)
def test_the_readme_of_the_meshes_names_their_regions_with_their_numbers(family, recipe):
    listed = re.findall(rf"^\| `(\w+)` \| region of `{re.escape(family)}` \| (\d+) \|", README, re.M)
    assert {name: int(number) for name, number in listed} == RECIPES[recipe]().region_names


def test_ready_made_meshes_are_listed_and_small():
    assert evfem.meshes.names() == sorted(RECIPES)
    assert sum(evfem.meshes.path(name).stat().st_size for name in RECIPES) < 3e6
    refuses("benchmark-L0", evfem.meshes.path, "benchmark-L9.vtu")


def test_recipe_runs_as_a_module(tmp_path):
    command = [sys.executable, "-m", "evfem.meshes.make", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, check=True)
    assert (done.stdout, done.stderr) == ("", "")
    assert sorted(file.name for file in tmp_path.iterdir()) == sorted(RECIPES)
    shutil.rmtree(tmp_path)
