"""What a scene needs: terms that are left out must not matter, and the numbers are those of the mesh."""

import json
from dataclasses import replace
from importlib.util import find_spec

import numpy as np
import pytest
from tools.builders import finger
from tools.meshes import block

import evfem as ev
from evfem.electrostatics.laws import eps_0
from evfem.planning.plan import plan
from evfem.planning.resolution import path_dependence
from evfem.planning.rooms import KINDS, rooms_of
from evfem.scene.schema import schema
from evfem.simulation.model import make_model

BLOCK = block(40, 2, sag=1.0)


def strip(dim):
    """A strip along x, clamped at its left end, one linear cell high; in space one wide."""
    length, height, cells = 20.0, 0.5, 40
    x, y, z = np.meshgrid(np.linspace(0.0, length, cells + 1), [0.0, height], [0.0, 1.0], indexing="ij")
    at = np.arange(x.size).reshape(x.shape)
    points = np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)
    if dim == 2:
        points, at = points[::2, :2], at // 2
    ring = [(0, 0), (1, 0), (1, 1), (0, 1)]
    faces = [np.stack([at[i : cells + i, j, k] for i, j in ring], axis=1) for k in range(dim - 1)]
    sets = {"pad": np.unique(at[1:, 0]), "bone": np.unique(at[0])}
    kind = "quad" if dim == 2 else "hexahedron"
    return ev.Mesh(points, np.hstack(faces), kind, np.zeros(cells, int), {"strip": 0}, sets)


def deflection(voltage):
    """Tip of the cantilever of `strip` (mm): the pressure under Green's function until neither changes."""
    x, weight = np.polynomial.legendre.leggauss(40)
    x, weight = 10.0 * (1.0 + x), 10.0 * weight
    ends = np.append(x, 20.0)
    least, most = np.minimum.outer(ends, x), np.maximum.outer(ends, x)
    green = least**2 * (3.0 * most - least) / 6.0 * weight / (100.0 * 0.5**3 / 12.0)
    w = np.zeros(ends.size)
    for _ in range(100):
        w = green @ (eps_0 * voltage**2 / (2.0 * (0.505 - w[:-1]) ** 2))
    return float(w[-1])


def hovering(E=0.05, gap=0.25, voltage=1000.0, law=None, motion=()):
    return ev.Scene(
        finger(BLOCK, E=E), ev.Display(), law or ev.Kaczmarek(), voltage, [ev.Hover(gap), *motion]
    )


@pytest.mark.parametrize(("dim", "voltages"), [(2, (500.0, 700.0)), (3, (500.0,))])
def test_a_hovering_strip_bends_and_lands_as_beams_do(dim, voltages):
    """A clamped strip (20 x 0.5 mm, E = 100 MPa, 0.5 mm above the display) under Strong and Troxel's law.
    The cantilever's equation, solved by quadrature here, has 0.1 mm of deflection at 500 V and none beyond
    591.5 V; a traction over depth and modulus (p h / E) says 2e-7.
    """
    skin = ev.Electrical(stratum_corneum_thickness=0.01, stratum_corneum_eps_r=1e5)
    pad = ev.MeshedFinger(strip(dim), {"strip": ev.NeoHookean(E=100.0, nu=0.0)}, electrical=skin)
    display = ev.Display(insulator=ev.Layer(0.02, 4.0), friction=0.0)
    motion = [ev.Hover(gap=0.5), *(ev.VoltageRamp(voltage, steps=1) for voltage in voltages)]
    result = ev.simulate(ev.Scene(pad, display, ev.StrongTroxel(), 0.0, motion))
    assert 0.5 - result.min_gap[1] == pytest.approx(deflection(500.0), rel=0.02)
    assert result.min_gap[2:] == pytest.approx([0.0] * (len(voltages) - 1), abs=1e-9)


@pytest.mark.parametrize(("nu", "said"), [(0.49, False), (0.4999, True)])
def test_the_plan_names_what_hardly_changes_its_volume(nu, said):
    scene = ev.Scene(finger(BLOCK, nu=nu), ev.Flat(friction=0.0), motion=[ev.Press(indentation=0.1)])
    line = "pressure is an additional unknown: tissue nearly incompressible"
    assert (line in plan(scene).solver) == said
    assert make_model(scene).body.tissue.nearly_incompressible == said


@pytest.mark.parametrize(
    ("friction", "said"),
    [
        (0.0, "no dependence on the step size, one substep for each step"),
        (0.3, "path-dependent (friction), error of a substep at most 0.5 % of the force"),
    ],
)
def test_the_plan_says_what_automatic_steps_are(friction, said):
    solver = ev.Solver(strategy=ev.Strategy(steps="auto", path_error=5e-3))
    scene = ev.Scene(finger(BLOCK), ev.Flat(friction=friction), motion=[ev.Press(indentation=0.1)])
    assert not any("steps auto" in line for line in plan(scene).solver)
    assert f"steps auto: {said}" in plan(replace(scene, solver=solver)).solver


def test_time_charges_and_the_air_layer_are_remembered_too():
    scene = replace(hovering(voltage=100.0), surface=ev.Display(friction=0.0))
    assert path_dependence(scene) == ()
    assert path_dependence(replace(scene, air_layer=False)) == ("contact state",)
    motion = [ev.Press(indentation=0.1, speed=1.0)]
    slow = replace(scene, motion=motion, finger=finger(BLOCK, viscosity=1e-3))
    assert path_dependence(replace(slow, solver=ev.Solver(dynamics="viscous"))) == ("time",)
    alternating = {"drive": ev.Drive(resolved=True), "voltage": ev.Sine(100.0, 50.0)}
    assert path_dependence(replace(scene, motion=motion, **alternating)) == ("charges",)


@pytest.mark.parametrize("error", [0.0, 1.5, 1e-11])
def test_forces_cannot_be_wanted_to_any_error(error):
    with pytest.raises(ev.InputError):
        ev.Solver.within(error)


def test_forces_to_an_error_need_what_the_plan_says():
    scene = ev.Scene(finger(BLOCK), ev.Flat(friction=0.0), motion=[ev.Press(indentation=0.1, steps=3)])
    cheap, exact = replace(scene, solver=ev.Solver.within(0.02)), ev.simulate(scene)
    assert "steps auto: no dependence on the step size, one substep for each step" in plan(cheap).solver
    assert ev.simulate(cheap).normal_force == pytest.approx(exact.normal_force, rel=0.02)


def test_the_table_of_rooms_names_keys_of_scene_files_and_modules_that_exist():
    """A key that the schema lacks, or a room that has moved, would be told nowhere else."""
    listed = json.dumps(schema())
    for kind in KINDS:
        assert f'"{kind.key.rsplit(".", 1)[-1]}"' in listed
        assert find_spec(f"evfem.{kind.module}")


@pytest.mark.parametrize(
    ("given", "name"),
    [
        ({"adhesion": ev.Dugdale(1e-3, 0.01)}, "adhesion"),
        ({"hand": ev.Hand(0.1)}, "hand"),
        (
            {"surface": ev.Flat(friction=0.0, elastic=ev.ElasticLayer(E=1.0, nu=0.4, thickness=1.0))},
            "elastic surface",
        ),
        ({"solver": ev.Solver(dynamics="inertial")}, "time"),
        ({"solver": ev.Solver(contact="penalty", penalty_normal=50.0)}, "penalties"),
    ],
)
def test_a_scene_has_the_rooms_of_its_keys(given, name):
    pad = ev.FingerPad(resolution="coarse", ridges=False)
    plain = ev.Scene(pad, ev.Flat(friction=0.0), motion=ev.Press(indentation=0.1, speed=1.0))
    assert [one.name for one in rooms_of(plain)] == []
    assert [one.name for one in rooms_of(replace(plain, **given))] == [name]
