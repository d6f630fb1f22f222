"""Probes: stress and strain at points of the tissue, in the plane and in space."""

import csv
from dataclasses import replace

import numpy as np
import pytest
from tools import solids
from tools.commands import called
from tools.domes import dome
from tools.meshes import block, held
from tools.refusals import refuses

import evfem as ev
from evfem import scenefile
from evfem.runfolder import RunFolder, saved

#: a block of one row sheared by 1/2 and pressed by 1/5 of its height, E 34 kPa, nu 0.48
LAW = ev.NeoHookean(E=0.034, nu=0.48)
MOTION = [ev.Press(indentation=0.2, steps=2), ev.Slide(distance=0.5, steps=2)]
POINTS = {"merkel": [[0.1, 0.3], [0.77, 0.9]], "arc": ev.Probe(x=[0.0, 0.5], depth=0.25)}


def sheared(probes=POINTS, element="q1"):
    """All nodes lie on the bone above or stick to the surface below: the block deforms homogeneously."""
    finger = ev.MeshedFinger(block(4, 1, width=2.0, height=1.0), {"tissue": LAW})
    solver, output = ev.Solver(element=element), ev.Output(probes=probes)
    return ev.Scene(finger, ev.Flat(friction=5.0, y=0.0), motion=MOTION, solver=solver, output=output)


@pytest.mark.parametrize("element", ["q1", "q1_fbar"])
def test_homogeneous_shear_by_hand(element):
    result = ev.simulate(sheared(element=element))
    for name, points in (("merkel", 2), ("arc", 2)):
        probe = result.probes[name]
        assert probe.displacement.shape == (4, points, 2)
        assert probe.cauchy_stress.shape == probe.deformation_gradient.shape == (4, points, 3, 3)
        F = np.array([[1.0, 0.5, 0.0], [0.0, 0.8, 0.0], [0.0, 0.0, 1.0]])
        C = F.T @ F
        mu, lmbda = 0.034 / 2.96, 0.48 * 0.034 / (1.48 * 0.04)
        stress = (mu * (F @ F.T) + (lmbda * np.log(0.8) - mu) * np.eye(3)) / 0.8
        np.testing.assert_allclose(stress[0, 0], -7.330453457449e-2, rtol=1e-12)
        stretches = np.sqrt(np.linalg.eigvalsh(C))[::-1]
        for i in range(points):
            np.testing.assert_allclose(probe.deformation_gradient[-1, i], F, atol=1e-12)
            np.testing.assert_allclose(probe.green_strain[-1, i], 0.5 * (C - np.eye(3)), atol=1e-12)
            np.testing.assert_allclose(probe.principal_stretches[-1, i], stretches, rtol=1e-12)
            np.testing.assert_allclose(probe.cauchy_stress[-1, i], stress, atol=1e-12)
            np.testing.assert_allclose(probe.pressure[-1, i], -np.trace(stress) / 3.0, rtol=1e-10)
            deviator = stress - np.trace(stress) / 3.0 * np.eye(3)
            np.testing.assert_allclose(probe.von_mises[-1, i], np.sqrt(1.5 * np.sum(deviator**2)), rtol=1e-10)
            np.testing.assert_allclose(probe.strain_energy_density[-1, i], 8.794744222255e-3, rtol=1e-10)
            np.testing.assert_allclose(probe.J[-1, i], 0.8, rtol=1e-12)
            below = 1.0 - probe.position[i, 1]
            moved = [0.5 - 0.5 * below, -0.2 + 0.2 * below]
            np.testing.assert_allclose(probe.displacement[-1, i], moved, atol=1e-12)


def gauss(mesh, cells):
    """The 3 ** d points of Gauss in rectangular cells (P, d), and their weights (P,)."""
    dim = mesh.dim
    at = np.stack(np.meshgrid(*[np.sqrt(0.15) * np.array([-1, 0, 1])] * dim), axis=-1).reshape(-1, dim)
    share = np.prod(
        np.stack(np.meshgrid(*[np.array([5, 8, 5]) / 18.0] * dim), axis=-1).reshape(-1, dim), axis=1
    )
    low, high = (getattr(mesh.points[mesh.cells[cells]], end)(axis=1) for end in ("min", "max"))
    size = high - low
    points = 0.5 * (low + high)[:, None] + at * size[:, None]
    return points.reshape(-1, dim), (size.prod(axis=1)[:, None] * share).ravel()


def plane_block():
    return block(4, 2, width=3.0, height=1.0), {"tissue": ev.NeoHookean(E=0.034, nu=0.4999)}


def solid_block():
    mesh = solids.block((1, 2, 1), (3.0, 1.0, 1.0))
    sets = {"pad": mesh.node_sets["bottom"], "bone": mesh.node_sets["top"]}
    return replace(mesh, node_sets=sets), {"lower": ev.NeoHookean(E=0.034, nu=0.4999)}


@pytest.mark.filterwarnings("ignore:the mesh is")
@pytest.mark.parametrize("made", [plane_block, solid_block])
def test_a_cut_through_nearly_incompressible_tissue_carries_the_contact_forces(made):
    """Virtual work of a row that is pushed up at its lower side: the mean traction on it is what touches,
    with the element's own pressure and no other.
    """
    mesh, laws = made()
    points, weight = gauss(mesh, np.flatnonzero(mesh.centres[:, 1] < 0.5))
    finger, surface = ev.MeshedFinger(mesh, laws), ev.Flat(friction=0.5, y=0.0)
    motion = [ev.Press(indentation=0.1, steps=1), ev.Slide(distance=0.05, steps=1)]
    result = ev.simulate(ev.Scene(finger, surface, motion=motion, output=ev.Output(probes={"row": points})))
    probe = result.probes["row"]
    inverse = np.linalg.inv(probe.deformation_gradient)
    nominal = np.einsum("sp,spij,spkj->spik", probe.J, probe.cauchy_stress, inverse)  # J sigma F^-T
    through = np.einsum("spi,p->si", nominal[:, :, :, 1], weight) / 0.5
    np.testing.assert_allclose(-through[:, 1], result.normal_force, rtol=1e-7)
    np.testing.assert_allclose(through[-1, 0], result.tangential_force[-1], rtol=1e-6)


def test_depth_is_vertical_below_the_outline_and_a_layer_is_met_at_its_lower_boundary():
    finger = ev.FingerPad(ridges=False, resolution="coarse")
    x = [-3.0, 0.0, 2.0]
    probes = {"deep": ev.Probe(x=x, depth=0.85), "layer": ev.Probe(x=[0.0], at="epidermis")}
    output = ev.Output(probes=probes)
    scene = ev.Scene(finger, ev.Flat(), motion=[ev.Press(indentation=0.1, steps=1)], output=output)
    found = ev.simulate(scene).probes
    ellipse = -0.5 * finger.height * np.sqrt(1.0 - (np.array(x) / (0.5 * finger.width)) ** 2)
    np.testing.assert_allclose(
        found["deep"].position[:, 1], ellipse + 0.85, atol=2e-4
    )  # the mesh's own ellipse
    thick = finger.stratum_corneum_thickness + finger.epidermis_thickness
    np.testing.assert_allclose(found["layer"].position, [[0.0, thick - 0.5 * finger.height]], atol=1e-9)


def test_depth_below_a_dome_in_space():
    laws, solver = {"lower": LAW}, ev.Solver(element="hex27p1")
    finger = ev.MeshedFinger(dome((3, 2, 3), order=2), laws)
    probe = ev.Probe(x=[0.3, -0.9], z=[0.4, 0.1], depth=0.2)
    output = ev.Output(probes={"deep": probe})
    scene = ev.Scene(
        finger, ev.Flat(), motion=[ev.Press(indentation=0.02, steps=1)], solver=solver, output=output
    )
    position = ev.simulate(scene).probes["deep"].position
    x, y, z = position.T
    np.testing.assert_allclose(y, (x**2 + z**2) / 12.0 + 0.2, atol=1e-12)
    np.testing.assert_array_equal(position[:, ::2], [[0.3, 0.4], [-0.9, 0.1]])


def test_a_point_on_a_border_has_one_material():
    """Of the lowest region, or of the layer at whose boundary it is: shear stress tells the modulus."""
    mesh = block(3, 2, width=3.0, height=1.0)
    low = (mesh.centres[:, 1] < 0.5).astype(int)
    mesh = replace(mesh, region=low, region_names={"tissue": 0, "skin": 1})
    laws = {"tissue": ev.NeoHookean(E=0.03, nu=0.4), "skin": ev.NeoHookean(E=0.3, nu=0.4)}
    probes = {"tissue": [[0.2, 0.5]], "skin": ev.Probe(x=[0.2], at="skin")}
    motion = [ev.Press(indentation=0.1, steps=1), ev.Slide(distance=0.1, steps=1)]
    finger, surface, output = ev.MeshedFinger(mesh, laws), ev.Flat(friction=2.0), ev.Output(probes=probes)
    result = ev.simulate(ev.Scene(finger, surface, motion=motion, output=output))
    for name, E in (("tissue", 0.03), ("skin", 0.3)):
        probe = result.probes[name]
        np.testing.assert_array_equal(probe.position, [[0.2, 0.5]])
        F, J = probe.deformation_gradient[-1, 0], probe.J[-1, 0]
        shear = E / 2.8 * (F @ F.T)[0, 1] / J
        np.testing.assert_allclose(probe.cauchy_stress[-1, 0, 0, 1], shear, rtol=1e-9)


class StopAfter:
    def __init__(self, steps):
        self.steps = steps

    def step(self, row, frame, checkpoint):
        if row["step"] == self.steps:
            raise ev.StopRun("enough")


def folder_of(scene, path, *observers, resume=None):
    """The result of a run that keeps its folder."""
    folder = RunFolder(path, scene, fields=False, plots=False, resume=resume)
    result = ev.simulate(scene, observers=[folder, *observers], resume=resume)
    folder.close(result)
    return result


def test_a_resumed_run_has_the_probes_of_all_steps(tmp_path):
    scene = sheared()
    whole = folder_of(scene, tmp_path / "whole")
    folder_of(scene, tmp_path / "parts", StopAfter(2))
    assert len((tmp_path / "parts/probes.csv").read_text().splitlines()) == 1 + 2 * 4
    resumed = folder_of(scene, tmp_path / "parts", resume=saved(tmp_path / "parts", scene))
    same(resumed.probes, whole.probes)
    assert (tmp_path / "parts/probes.csv").read_text() == (tmp_path / "whole/probes.csv").read_text()


def same(some, others):
    assert list(some) == list(others)
    for name, one in some.items():
        for quantity in vars(one):
            np.testing.assert_array_equal(getattr(one, quantity), getattr(others[name], quantity), quantity)


SCENE = """
version = 1
[finger]
resolution = "coarse"
[surface]
kind = "flat"
[output.probes]
merkel = [[0.0, -5.2], [0.3, -5.2]]
arc = {x = [-1.0, 0.0, 1.0], at = "epidermis"}
[[motion]]
kind = "press"
indentation = 0.1
steps = 2
"""


def test_a_run_writes_its_probes_and_gives_them_back(tmp_path):
    (tmp_path / "scene.toml").write_text(SCENE)
    out = tmp_path / "out"
    words = ("run", "scene.toml", "--out", "out", "--no-fields", "--no-plots")
    assert called(tmp_path, *words)[0] == 0
    result = ev.simulate(tmp_path / "scene.toml")
    rows = list(csv.DictReader((out / "probes.csv").read_text().splitlines()))
    assert [(row["step"], row["probe"], row["point"]) for row in rows[4:6]] == [
        ("1", "arc", "2"),
        ("2", "merkel", "0"),
    ]
    assert float(rows[-1]["cauchy_stress_xy"]) == result.probes["arc"].cauchy_stress[-1, -1, 0, 1]
    assert float(rows[-1]["time"]) == result.time[-1]
    same(ev.load(out).probes, result.probes)
    (out / "probes.csv").unlink()
    assert "probes.csv is written from its checkpoint" in "".join(map(str, called(tmp_path, *words)))
    same(ev.load(out).probes, result.probes)
    result.save(tmp_path / "result.npz")
    same(ev.load(tmp_path / "result.npz").probes, result.probes)
    assert (
        result.probes["arc"].component("cauchy_stress_xy")[-1, -1]
        == result.probes["arc"].cauchy_stress[-1, -1, 1, 0]
    )


def test_a_scene_with_probes_is_what_its_file_says():
    scene = scenefile.loads(SCENE)
    assert scene.output.probes["arc"] == ev.Probe(x=[-1, 0, 1], at="epidermis")
    assert scenefile.loads(scenefile.dump(scene)) == scene
    assert replace(scene, output=ev.Output()).digest() != scene.digest()


BAD = {
    "outside": ({"tip": [[0.1, 0.3], [0.0, 1.2]]}, "output.probes.tip: given (0, 1.2), outside the tissue"),
    "in space": ({"tip": [[0.0, 0.0, 0.0]]}, "output.probes.tip: given points with 3 coordinates"),
    "beside": ({"tip": ev.Probe(x=[1.2], depth=0.1)}, "output.probes.tip: given x = 1.2, with no tissue"),
    "through": ({"tip": ev.Probe(x=[0.0], depth=1.1)}, "output.probes.tip: given (0, 1.1), outside the"),
    "layer": ({"tip": ev.Probe(x=[0.0], at="dermis")}, 'output.probes.tip.at: given "dermis"; allowed'),
    "z": ({"tip": ev.Probe(x=[0.0], z=[0.0], depth=0.1)}, "output.probes.tip.z: given z of a plane finger"),
}


@pytest.mark.parametrize("how", BAD)
def test_a_point_that_is_not_there_is_refused_by_its_probe(how):
    probes, told = BAD[how]
    error = refuses("allowed", ev.simulate, sheared(probes))
    assert str(error).startswith(told)
    if "outside" not in told:  # where cells must be looked at
        error = refuses("allowed", ev.plan, sheared(probes))
        assert str(error).startswith(told)


TABLES = {
    "merkel = [[0.0, -5.2], [0.3]]": "output.probes.merkel: given",
    "merkel = [0.0, -5.2]": "output.probes.merkel: given",
    "arc = {x = [0.0]}": "output.probes.arc.depth: missing; allowed: one of depth and at",
    "arc = {x = [0.0], depth = -1.0}": "output.probes.arc.depth: given -1",
    "arc = {x = [0.0], deep = 1.0}": "output.probes.arc.deep",
    "arc = {x = [0.0], z = [0.0, 1.0], depth = 1.0}": "output.probes.arc.z: given 2 numbers",
    '"a/b" = [[0.0, -5.2]]': 'output.probes: given "a/b"',
}


@pytest.mark.parametrize("line", TABLES)
def test_a_mistake_in_a_file_names_the_probe(line):
    head, tail = SCENE.split("merkel")[0], SCENE[SCENE.index("[[motion]]") :]
    assert str(refuses("allowed", scenefile.loads, head + line + "\n" + tail)).startswith(TABLES[line])


@pytest.mark.parametrize("bulk", [False, True])
@pytest.mark.parametrize("element", ["q1", "q1_fbar", "hex8"])
def test_what_branches_add_balances_the_bone(element, bulk):
    """The block deforms homogeneously, so the first Piola-Kirchhoff stress of a point times the area is the
    force on the bone, and its energy times the volume what is stored; at rest branches add nothing.
    """
    area = {"hex8": 8.0}.get(element, 2.0)
    solid = element == "hex8"
    mesh = held(solids.block((2, 1, 2), (2.0, 1.0, 4.0))) if solid else block(4, 1, width=2.0, height=1.0)
    law = replace(LAW, relaxation=((0.8, 0.01), (0.5, 0.1)), bulk_relaxation=bulk)
    finger = ev.MeshedFinger(mesh, dict.fromkeys(mesh.region_names, law))
    motion = [
        ev.Press(indentation=0.2, steps=4, speed=10.0),
        ev.Slide(distance=0.2, steps=4, speed=20.0),
        ev.Wait(0.02, steps=2),
        ev.Press(indentation=0.2, steps=1),
    ]
    point = mesh.points.mean(axis=0) + 0.1 * np.arange(1, mesh.dim + 1) / mesh.dim
    scene = ev.Scene(
        finger, ev.Flat(friction=50.0, y=0.0), motion=motion, output=ev.Output(probes={"deep": [point]}),
        solver=ev.Solver(element=element, dynamics="viscous", tolerance=1e-10),
    )  # fmt: skip
    result = ev.simulate(scene)
    probe = result.probes["deep"]
    F, J = probe.deformation_gradient[:, 0], probe.J[:, 0, None, None]
    P = J * probe.cauchy_stress[:, 0] @ np.linalg.inv(F).transpose(0, 2, 1)
    largest = result.applied_force.max()
    np.testing.assert_allclose(area * P[:, 1, 1], -result.applied_force, atol=1e-8 * largest)
    np.testing.assert_allclose(area * P[:, 0, 1], result.applied_tangential_force, atol=1e-8 * largest)
    np.testing.assert_allclose(area * probe.strain_energy_density[:, 0], result.stored_energy, rtol=1e-8)
    share = probe.branch_energy_density[:, 0] / probe.strain_energy_density[:, 0]
    assert share[:9].min() > 0.01
    assert share[-1] < 1e-12


def test_a_layer_without_branches_has_none():
    nail = ev.NeoHookean(E=17.0, nu=0.3, relaxation=())
    pad = ev.FingerPad(resolution="coarse", relaxation=[(0.5, 0.1)], materials={"nail": nail})
    mesh = pad.mesh()
    places = [mesh.points[mesh.cells[mesh.cells_of(name)[0]]].mean(axis=0) for name in ("nail", "dermis")]
    press = ev.Press(indentation=0.1, steps=1, speed=20.0)
    solver, output = ev.Solver(dynamics="viscous"), ev.Output(probes={"both": places})
    scene = ev.Scene(pad, ev.Flat(), motion=[press], output=output, solver=solver)
    found = ev.simulate(scene).probes["both"].branch_energy_density[-1]
    assert found[0] == 0.0 < found[1]
