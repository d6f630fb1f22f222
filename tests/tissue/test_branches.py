"""Maxwell branches: closed forms of relaxation and creep, order of the step, limits, books, tangents,
and how a scene has them.
"""

from types import SimpleNamespace

import numpy as np
import pytest
from tools.grids import rectangle, tangent_of
from tools.meshes import block, held
from tools.refusals import refuses
from tools.solids import block as solid
from tools.solids import box

import evfem as ev
from evfem.tissue.branches import Branches, branches_of, make_branches

SKIN = ((0.8, 0.004), (0.5, 0.07), (0.4, 1.4))
SMALL = 1e-5  # mm: strain so small that everything is linear


def flat(law, motion, dynamics="viscous", solid_too=False, **finger):
    """A flat block, 8 mm wide and 1 mm high, that sticks: its deformation is the same everywhere."""
    if solid_too:
        mesh, element = solid((2, 1, 2), (8.0, 1.0, 1.0)), "hex8"
        mesh = held(mesh)
    else:
        mesh, element = block(4, 1, 8.0, 1.0), "q1"
    name = next(iter(mesh.region_names))
    return ev.Scene(
        ev.MeshedFinger(mesh, {name: law}, **finger),
        ev.Flat(friction=50.0, y=0.0),
        motion=motion,
        solver=ev.Solver(dynamics=dynamics, element=element, tolerance=1e-10),
    )


def stroke(n):
    """Press, wait, slide, wait, slide back, in n steps each."""
    return [
        ev.Press(indentation=0.2, speed=2.0, steps=n),
        ev.Wait(0.1, steps=n),
        ev.Slide(0.5, speed=10.0, steps=n),
        ev.Wait(0.75, steps=n),
        ev.Slide(-0.5, speed=5.0, steps=n),
    ]


def tissue(**more):
    return ev.NeoHookean(E=0.034, nu=0.48, **more)


@pytest.fixture(scope="module")
def strokes():
    """Results in 10, 20 and 40 steps a motion."""
    return {n: ev.simulate(flat(tissue(relaxation=SKIN), stroke(n))) for n in (10, 20, 40)}


def column(result, name):
    return np.asarray(result[name])


def test_steps_are_those_of_an_independent_program(strokes):
    """Stresses of the block in ten steps a motion, by a form of another author to all digits."""
    got = strokes[10]
    pressed, sheared = column(got, "applied_force") / -8.0, column(got, "applied_tangential_force") / 8.0
    assert pressed[9] == pytest.approx(-8.4905205505e-2, rel=1e-9)
    assert sheared[29] == pytest.approx(1.2051824939e-2, rel=1e-9)
    assert sheared[39] == pytest.approx(7.3134045717e-3, rel=1e-9)


def test_order_is_two(strokes):
    """Against the solution that is exact in time, at t = 0.25 and 0.5 s, of stress and of energy."""
    exact = {"applied_tangential_force": 1.205275637e-2, "stored_energy": 1.012651534e-2}
    exact["viscous_dissipation"] = 7.589822525e-4
    for name, value in exact.items():
        errors = [abs(column(strokes[n], name)[3 * n - 1] / 8.0 - value) for n in (10, 20, 40)]
        rates = np.log2(np.array(errors[:-1]) / errors[1:])
        assert (rates > 1.75).all(), (name, rates)


def test_books_close(strokes):
    for result in strokes.values():
        given, lost = column(result, "external_work"), column(result, "viscous_dissipation")
        rest = column(result, "stored_energy") + lost + column(result, "integrator_dissipation")
        np.testing.assert_allclose(given, rest + column(result, "snap_dissipation"), atol=1e-9 * given.max())
        assert (np.diff(lost) >= 0.0).all()
    left = [column(strokes[n], "integrator_dissipation")[n - 1] for n in (10, 20)]
    assert left[0] / left[1] == pytest.approx(4.0, rel=0.02)


def branch_of(space, law):
    return Branches(space, branches_of(space, {"lower": law}, SimpleNamespace()))


@pytest.mark.parametrize("solid_too", [False, True], ids=["plane", "space"])
def test_force_of_a_held_block(solid_too):
    """All moduli relax alike: the force over its last value is 1 + sum of r f(T/tau) exp(-t/tau) after a
    press that lasted T, whatever the block.
    """
    press = ev.Press(indentation=SMALL, speed=SMALL / 0.01, steps=1)
    motion = [press, ev.Wait(1.0, steps=6, spacing="log"), ev.Wait(1.0, steps=1)]
    law = tissue(relaxation=SKIN, bulk_relaxation=True)
    got = ev.simulate(flat(law, motion, solid_too=solid_too))
    rest = ev.simulate(flat(tissue(), [ev.Press(indentation=SMALL, steps=1)], "quasistatic", solid_too))
    share, tau = np.array(SKIN).T
    waited = column(got, "time")[:, None] - 0.01
    over = 1.0 + (share * -np.expm1(-0.01 / tau) * tau / 0.01 * np.exp(-waited / tau)).sum(axis=1)
    force = column(got, "applied_force") / column(rest, "applied_force")[-1]
    np.testing.assert_allclose(force, over, rtol=2e-5)
    np.testing.assert_allclose(np.diff(np.log(waited[1:7, 0])), np.log(1000.0) / 6.0, rtol=1e-9)


@pytest.mark.parametrize(("depth", "most"), [(0.15, 0.004), (0.3, 0.015), (0.5, 0.035)])
@pytest.mark.parametrize("times", [1.0, 2.0, 4.0])
def test_what_one_long_step_misses_of_a_held_overstress(depth, most, times):
    """As the plan says, of the first overstress; 64 steps have no error to compare with."""

    def force(*motion):
        scene = flat(tissue(relaxation=((1.0, 1.0),)), [*motion])
        return -column(ev.simulate(scene), "applied_force")

    pressed = ev.Press(indentation=depth, speed=1e6, steps=1)
    one, many = (force(pressed, ev.Wait(times, steps=n)) for n in (1, 64))
    (rest,) = force(ev.Press(indentation=depth, steps=1))
    missed = abs(one[-1] - many[-1]) / abs(many[0] - rest)
    assert 0.02 * most < missed < most


def test_creep_under_a_held_force():
    """With one branch the way left falls as exp(-t/(tau (1 + r)))."""
    share, tau = 1.5, 0.05
    law = tissue(relaxation=((share, tau),), bulk_relaxation=True)
    press = ev.Press(indentation=SMALL, speed=SMALL / 1e-4, steps=1)
    got = ev.simulate(flat(law, [press, ev.Wait(0.2, steps=40, hold="force")]))
    depth, force = column(got, "indentation"), column(got, "applied_force")
    rest = ev.simulate(flat(tissue(), [ev.Press(indentation=SMALL, steps=1)], "quasistatic"))
    last = force[0] * SMALL / column(rest, "applied_force")[-1]
    left = (last - depth[1:]) / (last - depth[0])
    waited = column(got, "time")[1:] - 1e-4
    np.testing.assert_allclose(left, np.exp(-waited / (tau * (1.0 + share))), atol=1e-4)


def test_a_motion_without_time_ends_at_rest():
    """The force is that of tissue without branches; what they had stored is lost."""
    timed = ev.Press(indentation=0.1, speed=2.0, steps=2)
    motion = [timed, ev.Press(indentation=0.2, steps=2)]
    got = ev.simulate(flat(tissue(relaxation=SKIN), motion))
    rest = ev.simulate(flat(tissue(), [ev.Press(indentation=0.2, steps=2)], "quasistatic"))
    for name in ("applied_force", "stored_energy"):
        assert column(got, name)[-1] == pytest.approx(column(rest, name)[-1], rel=1e-9)
    stored = column(got, "stored_energy")[1] - column(rest, "stored_energy")[0]
    lost = np.diff(column(got, "viscous_dissipation"))[1:]
    np.testing.assert_allclose(lost, [stored, 0.0], rtol=1e-6, atol=1e-15)


@pytest.mark.parametrize("bulk", [False, True])
@pytest.mark.parametrize("element", ["q1", "q2p1", "hex8"])
def test_tangent_and_potential(element, bulk):
    """The tangent is the forces' derivative, these the potential's, in the second of two steps; the compiled
    loops end it alike.
    """
    space = box("hex8", (1, 2, 1)) if element == "hex8" else rectangle(element, (2, 2))
    law = ev.Yeoh(c1=0.2, nu=0.4, relaxation=((0.8, 0.01), (0.5, 0.3)), bulk_relaxation=bulk)
    branches, X = branch_of(space, law), space.mesh.points
    looped = make_branches(space, branches_of(space, {"lower": law}, SimpleNamespace()))

    def wavy(size, phase=0.0):
        return size * np.sin(X @ np.arange(2.0, 2.0 + space.dim)[:, None] + phase + np.arange(space.dim))

    for one in (looped, branches):
        one.begin(wavy(0.0), one.at_rest, 0.01)
        one.begin(wavy(0.05), one.inner(wavy(0.05)), 0.02)
    u, along = wavy(0.08, 0.3), np.random.default_rng(0).normal(size=X.shape)
    forces = branches.forces(u)
    h = 1e-6
    ahead, behind = u + h * along, u - h * along
    slope = (branches.potential(ahead) - branches.potential(behind)) / (2.0 * h)
    assert slope == pytest.approx(np.sum(forces * along), rel=1e-6)
    change = (branches.forces(ahead) - branches.forces(behind)) / (2.0 * h)
    tangent = (tangent_of(space, u, branches) @ along.ravel()).reshape(X.shape)
    np.testing.assert_allclose(tangent, change, atol=1e-7 * np.abs(change).max())
    assert looped.energy(u) == pytest.approx(branches.energy(u), rel=1e-9)
    assert looped.dissipation(u) == pytest.approx(branches.dissipation(u), rel=1e-9)


def test_layers_without_their_own_have_the_fingers(tmp_path):
    """In files and in Python; an empty list is none."""
    text = """version = 1
[finger]
relaxation = [[0.8, 0.004], [0.5, 0.07]]
bulk_relaxation = true
[finger.materials.nail]
law = "neo_hookean"
E = 170.0
nu = 0.3
relaxation = []
[surface]
kind = "flat"
[solver]
dynamics = "viscous"
[[motion]]
kind = "press"
indentation = 0.1
speed = 1.0
[[motion]]
kind = "wait"
duration = 1.0
spacing = "log"
"""
    scene = ev.scenefile.loads(text)
    assert scene.finger.relaxation == ((0.8, 0.004), (0.5, 0.07))
    assert scene.finger.materials["nail"].relaxation == ()
    assert ev.scenefile.loads(ev.scenefile.dump(scene)) == scene
    told = "branches relax in 0.004 to 0.07 s, steps take 7.7e-05 to 0.067 s"
    assert told in " ".join(str(ev.plan(scene)).split())
    cells = sum(scene.finger.mesh().cells_of(name).size for name in scene.finger.materials if name != "nail")
    kept = 8 * 2 * 5 * 9 * cells / 1e6  # 2 branches of 5 numbers at 9 points
    assert f"their history variables take {kept:.2g} MB" in " ".join(str(ev.plan(scene)).split())
    space = rectangle("q1", (1, 2), split=lambda x, y: y > 0.5)
    laws = {"lower": ev.NeoHookean(E=3.0, nu=0.3), "upper": scene.finger.materials["nail"]}
    found = branches_of(space, laws, scene.finger)
    mu = laws["lower"].mu
    np.testing.assert_allclose([one.shear for one in found], [[0.8 * mu, 0.0], [0.5 * mu, 0.0]])
    assert found[0].bulk[0] == pytest.approx(0.8 * 3.0 / (3.0 * 0.4))


@pytest.mark.parametrize("given", [[[0.8]], [[0.8, 0.0]], [[-1.0, 1.0]], 3.0, [0.8, 0.004]])
def test_refused(given):
    refuses(r"relaxation: given .*; allowed: rows", ev.NeoHookean, E=1.0, nu=0.3, relaxation=given)


def test_shares_of_the_instantaneous_modulus():
    """Published shares of mouse skin, 0.154 and 0.495 of 1."""
    (first, _), (second, _) = ev.relaxation_of(g=((0.154, 1.111), (0.495, 0.092)))
    assert (first, second) == (pytest.approx(0.438746, abs=1e-6), pytest.approx(1.410256, abs=1e-6))
    refuses("below 1", ev.relaxation_of, g=((1.0, 1.0),))


def test_creep_under_a_constant_load_is_that_of_felupe():
    """Recorded with FElupe 11.3.0 by `tools/creep_with_felupe.py`: stiffness of the first step, and the way
    after 5, 10 and 20 steps; strains of 5e-6 are the difference.
    """
    law = ev.NeoHookean(E=0.034, nu=0.4, relaxation=((1.5, 0.05),))
    finger = ev.MeshedFinger(block(6, 4, 4.0, 2.0), {"tissue": law})
    solver = ev.Solver(dynamics="viscous", element="q1", tolerance=1e-10)
    motion = [ev.Press(indentation=SMALL, speed=SMALL / 0.01, steps=1), ev.Wait(0.19, steps=19, hold="force")]
    found = ev.simulate(ev.Scene(finger, ev.Flat(friction=50.0, y=0.0), motion=motion, solver=solver))
    assert found.applied_force[0] / SMALL == pytest.approx(0.176323403, rel=2e-5)
    way = found.indentation[[4, 9, 19]] / found.indentation[0]
    np.testing.assert_allclose(way, [1.20019778, 1.35664543, 1.51021575], rtol=1e-5)
