"""Adhesion: its laws, the contact of Johnson, Kendall and Roberts in the plane, books, friction, pull-off."""

from dataclasses import replace

import numpy as np
import pytest
from simulation.test_core import SCALE, WORK, block
from simulation.test_spheres import paraboloid
from tools.builders import coarse_pad, left_over, small_finger, unbalanced
from tools.domes import Dome, dome_scene
from tools.meshes import contact_block
from tools.refusals import refuses

import evfem as ev
from evfem.surface.adhesion import Softened

PAD = small_finger(40, 3)
MOIST = ev.Dugdale(stress=0.01, reach=0.01)
LAWS = (MOIST, ev.Capillary(surface_tension=0.0728, contact_angle=30.0, film=0.005))


class Exponential:
    """One's own law: p = w/d exp(-g/d)."""

    work, length = 1e-4, 0.02

    def traction(self, gap):
        return self.work / self.length * np.exp(-gap / self.length)

    def potential(self, gap):
        return -self.work * np.exp(-gap / self.length)


@pytest.mark.parametrize("law", LAWS)
def test_a_law_is_the_derivative_of_its_potential(law):
    assert -law.potential(0.0) == pytest.approx(law.stress * law.reach, rel=1e-14)
    gaps = np.linspace(0.0, 1.2, 500) * law.reach
    step = 1e-6 * law.reach
    slope = (law.potential(gaps + step) - law.potential(gaps - step)) / (2.0 * step)
    np.testing.assert_allclose(slope, law.traction(gaps), atol=1e-6 * law.stress)
    assert law.traction(0.94 * law.reach) == law.stress
    assert law.traction(1.06 * law.reach) == 0.0


def test_a_meniscus_of_water_works_twice_its_tension():
    """2 gamma cos(theta) = 0.1456 J/m2."""
    water = ev.Capillary(surface_tension=0.0728, contact_angle=0.0, film=0.003)
    assert -1e3 * water.potential(0.0) == pytest.approx(0.1456, rel=1e-12)


@pytest.mark.parametrize("law", [*LAWS, Exponential(), ev.Dugdale(0.001, 0.1)])
@pytest.mark.parametrize("steepest", [1e-3, 0.05, 0.5, 5.0])
@pytest.mark.parametrize("closed", [0.0, 0.003])
def test_a_softened_law_has_the_same_work_and_no_steeper_slope(law, steepest, closed):
    soft = Softened(law, closed, steepest)
    for gap in (closed, 5.0):
        work = soft.potential(5.0) - soft.potential(gap)
        assert work == pytest.approx(law.potential(5.0) - law.potential(gap), rel=1e-9, abs=1e-15)
    gaps = closed + np.geomspace(1e-6, 3.0, 3000)
    traction = soft.traction(gaps)
    assert (np.diff(traction) <= 1e-15).all()
    assert (-np.diff(traction) <= steepest * np.diff(gaps) * (1.0 + 1e-6) + 1e-12).all()
    middle = 0.5 * (gaps[1:] + gaps[:-1])
    slope = np.diff(soft.potential(gaps)) / np.diff(gaps)
    np.testing.assert_allclose(slope, soft.traction(middle), atol=2e-3 * float(law.traction(0.0)))


def bonded(distance, motion, **more):
    law = {"tissue": ev.LinearElastic(E=0.1, nu=0.3)}
    finger = ev.MeshedFinger(block(distance), law)
    reach = 2e-4
    adhesion = ev.Dugdale(stress=WORK / reach, reach=reach)
    return ev.simulate(ev.Scene(finger, ev.Flat(friction=0.0), motion=motion, adhesion=adhesion, **more))


@pytest.mark.parametrize("way", [[0.02], [0.03, 0.02]])
def test_the_width_is_that_of_johnson_kendall_and_roberts(way):
    """P = C (a^2 - sqrt(a A^3)) at half width a, with A = 1 mm, pressed from below or over-pressed."""
    result = bonded(0.1, [ev.Press(indentation=depth, steps=3) for depth in way])
    wide = np.linspace(1.0, 2.0, 1001)
    of_theory = np.interp(result.applied_force[-1] / SCALE, wide**2 - np.sqrt(wide), wide)
    assert 0.5 * result.contact_width[-1] == pytest.approx(of_theory, abs=0.15)


@pytest.mark.slow
def test_the_pull_off_comes_to_that_of_johnson_kendall_and_roberts():
    """0.472470 C at a rate of about the square root of the nodes' distance or better."""
    motion = [ev.Press(indentation=0.0, steps=1), ev.Press(indentation=-0.03, steps=30)]
    found = [bonded(distance, motion) for distance in (0.2, 0.1, 0.05)]
    errors = [abs(-one.applied_force.min() / SCALE / 0.472470 - 1.0) for one in found]
    assert errors[1] < 0.03
    assert errors[2] < 0.7 * errors[0]
    assert found[1].contact_width[-1] == 0.0
    (said,) = [one for one in found[1].warnings if "came off" in one]
    assert float(said.split("pull of ")[1].split()[0]) == pytest.approx(
        -found[1].applied_force.min(), rel=0.01
    )


def test_a_pull_off_between_two_steps_is_told_with_its_bounds():
    """Those of 4 steps hold what 16 find, and are wider than theirs."""
    lifted = []
    for steps in (4, 16):
        motion = [ev.Press(indentation=0.1, steps=2), ev.Press(indentation=-0.25, steps=steps)]
        result = ev.simulate(ev.Scene(PAD, ev.Flat(friction=0.0), motion=motion, adhesion=MOIST))
        (said,) = [one for one in result.warnings if "came off" in one]
        least, to, most = said.split("pull of ")[1].split()[:3]
        assert to == "to"
        assert float(least) == pytest.approx(-result.applied_force.min(), rel=0.01)
        lifted.append((float(least), float(most)))
    (least, most), (finer, finest) = lifted
    assert least < finer < finest
    assert finer < most
    assert most - least > 3.0 * (finest - finer)


@pytest.mark.parametrize("steps", [20, 80])
def test_the_pull_off_that_is_told_is_the_largest_pull(steps):
    """A nearly rigid cylinder, whose pull falls again before it lets go; rigid, at first touch, it is
    2 s sqrt(2 R h).
    """
    radius, stress, reach = 8.0, 0.001, 0.05
    grid = np.linspace(-3.0, 3.0, 121), np.linspace(0.0, 3.0, 4)
    mesh = contact_block(*grid, 3.0, lambda x: radius - np.sqrt(radius**2 - x**2), quadratic=False)
    body = ev.MeshedFinger(mesh, {"tissue": ev.NeoHookean(E=5e3, nu=0.3)})
    motion = [ev.Press(indentation=1e-4, steps=1), ev.Press(indentation=-0.08, steps=steps)]
    scene = ev.Scene(body, ev.Flat(friction=0.0), motion=motion, adhesion=ev.Dugdale(stress, reach))
    with pytest.warns(UserWarning, match="beyond that of any tissue"):
        result = ev.simulate(scene)
    (said,) = [one for one in result.warnings if "came off" in one]
    told = float(said.split("pull of ")[1].split()[0])
    assert told == pytest.approx(-result.applied_force.min(), rel=0.005)
    assert told == pytest.approx(2.0 * stress * np.sqrt(2.0 * radius * reach), rel=0.05)


#: a sphere of E = 0.1 MPa, nu = 0.3, R = 50 mm, whose contact by Johnson, Kendall and Roberts has a radius
#: of 0.5 mm without a load; loads are over pi w R
MODULUS, BALL = 0.1 / 0.91, 50.0
SPHERE_WORK = 2.0 * MODULUS * 0.5**3 / (9.0 * np.pi * BALL**2)


def pulled(mesh, stress, motion):
    finger = Dome(paraboloid(*mesh, BALL), ev.LinearElastic(E=0.1, nu=0.3))
    adhesion = ev.Dugdale(stress=stress, reach=SPHERE_WORK / stress)
    flat = {"surface": ev.Flat(friction=0.0), "law": None, "voltage": 0.0}
    result = ev.simulate(dome_scene(*motion, finger=finger, adhesion=adhesion, **flat))
    return -result.applied_force.min() / (np.pi * SPHERE_WORK * BALL)


def maugis(strength):
    """Largest pull over pi w R of Maugis's sphere with Dugdale's adhesion, lambda = `strength`: the radius
    for each m = c / a solves a quadratic (doi:10.1016/0021-9797(92)90285-T).
    """
    m = 1.0 + np.geomspace(1e-6, 10.0, 20_000)
    root, angle = np.sqrt(m**2 - 1.0), np.arccos(1.0 / m)
    first = 0.5 * strength * ((m**2 - 2.0) * angle + root)
    second = 4.0 / 3.0 * strength**2 * (root * angle - m + 1.0)
    a = (np.sqrt(second**2 + 4.0 * first) - second) / (2.0 * first)
    return -(a**3 - strength * a**2 * (root + m**2 * angle)).min()


@pytest.mark.slow
def test_the_pull_off_of_a_sphere_is_that_of_maugis():
    """Where the mesh, 2 nodes on the radius at pull-off, resolves the law: lambda = 0.3."""
    stiff = 4.0 / 3.0 * MODULUS
    stress = 0.15 * (np.pi * SPHERE_WORK * stiff**2 / BALL) ** (1.0 / 3.0)
    motion = [ev.Press(indentation=0.0, steps=1), ev.Press(indentation=-0.001, steps=5)]
    assert pulled((4, 6, 6), stress, motion) == pytest.approx(maugis(0.3), rel=0.02)
    assert maugis(50.0) == pytest.approx(1.5, rel=1e-3)


@pytest.mark.slow
def test_the_pull_off_of_a_sphere_comes_to_that_of_johnson_kendall_and_roberts():
    """1.5 pi w R at the rate of the nodes' distance: 17.5 % more at 0.15 mm, 11.5 % at 0.1, 8.4 at 0.067."""
    motion = [ev.Press(indentation=0.0, steps=1), ev.Press(indentation=-0.0012, steps=3)]
    errors = [pulled(mesh, SPHERE_WORK / 2e-4, motion) / 1.5 - 1.0 for mesh in ((4, 6, 6), (6, 6, 7))]
    assert 0.0 < errors[1] < 0.12
    assert errors[1] < 0.7 * errors[0]


SCENES = {
    "alone": {},
    "slope": {"surface": ev.Sinusoid(friction=0.2, insulator=ev.FILM)},
    "voltage": {"law": ev.StrongTroxel(), "voltage": 700.0},
    "Maxwell": {"law": ev.StrongTroxel(), "voltage": 700.0, "direction": "normal"},
    "soft": {"surface": ev.Display(friction=0.3, elastic=ev.ElasticLayer(0.3, 0.48, 2.0))},
    "own": {"adhesion": Exponential()},
    "rough": {"law": ev.StrongTroxel(), "voltage": 100.0, "roughness_gap": 0.002},
}


@pytest.mark.parametrize("name", SCENES)
def test_forces_and_works_balance(name):
    more = {"surface": ev.Display(friction=0.3), "adhesion": MOIST} | SCENES[name]
    motion = [ev.Press(force=0.03, steps=3), ev.Slide(0.4, steps=3)]
    result = ev.simulate(ev.Scene(PAD, motion=motion, **more))
    np.testing.assert_allclose(unbalanced(result), 0.0, atol=1e-8)
    assert left_over(result) < 1e-7
    assert (result.adhesive_force > 0.0).all()


@pytest.mark.parametrize("axes", ["x", "xz"])
def test_adhesion_normal_to_the_outline_pulls_aside(axes):
    """On waves along x in the plane, at 40 degrees in space: without its columns forces do not balance."""
    surface, motion = (
        ev.Sinusoid(terms=[[0.02, 2.0, 0.3]], friction=0.2),
        [ev.Press(indentation=0.3, steps=2)],
    )
    given = {"law": None, "voltage": 0.0, "adhesion": ev.Dugdale(0.005, 0.05), "direction": "normal"}
    if axes == "x":
        result = ev.simulate(ev.Scene(PAD, surface, motion=motion, **given))
    else:
        result = ev.simulate(dome_scene(*motion, surface=replace(surface, angle=40.0), **given))
    np.testing.assert_allclose(unbalanced(result), 0.0, atol=1e-8)
    for axis in axes:
        assert np.abs(result[f"adhesive_force_{axis}"][-1]) > 1e-4 * result.adhesive_force[-1]
        assert result[f"electrostatic_force_{axis}"][-1] == 0.0


def test_friction_sees_adhesion_as_a_load():
    """In full slip on a flat surface: mu times the normal force, which is load and adhesion."""
    motion = [ev.Press(force=0.03, steps=3), ev.Slide(3.0, steps=6, hold="force")]
    result = ev.simulate(ev.Scene(PAD, ev.Flat(friction=0.1), motion=motion, adhesion=MOIST))
    assert result.tangential_force[-1] == pytest.approx(0.1 * result.normal_force[-1], rel=1e-7)
    assert result.normal_force[-1] == pytest.approx(0.03 + result.adhesive_force[-1], rel=1e-6)
    covered = MOIST.stress * result.real_contact_width[-1]
    assert result.adhesive_force[-1] == pytest.approx(covered, rel=0.15)


def test_without_a_voltage_adhesion_is_no_electrostatic_force():
    motion = [ev.Press(indentation=0.5, steps=2), ev.VoltageRamp(voltage=100.0, steps=1)]
    surface = ev.Sinusoid(terms=[[0.0127, 1.2, 5.2]], insulator=ev.Layer(0.007, 3.0), friction=0.9)
    adhesion = ev.Capillary(0.02, 78.5, 0.009)
    found = ev.simulate(ev.Scene(PAD, surface, ev.Kaczmarek(), 0.0, motion, adhesion=adhesion))
    assert found.electrostatic_force[:2].tolist() == [0.0, 0.0]
    assert found.electrostatic_force[2] > 1e-6


def test_rough_faces_out_of_reach_do_not_adhere():
    """Closed faces 2 um apart, a law that ends at 1 um: the friction is that without adhesion, as is told."""
    motion = [ev.Press(indentation=0.3, steps=1), ev.Slide(0.3, steps=1)]
    rough = ev.Scene(PAD, ev.Display(), ev.Kaczmarek(), 100.0, motion, roughness_gap=2e-3)
    with pytest.warns(UserWarning, match="no traction at 0.002 mm, which rough faces keep"):
        with_it = ev.simulate(replace(rough, adhesion=ev.Dugdale(stress=0.1, reach=1e-3)))
    without = ev.simulate(rough)
    assert with_it.adhesive_force.tolist() == [0.0, 0.0]
    np.testing.assert_allclose(with_it.tangential_force, without.tangential_force, rtol=1e-7, atol=1e-12)


def scene_of(surface=None, **more):
    return ev.Scene(coarse_pad(), surface or ev.Flat(), motion=[ev.Press(force=0.05)], **more)


def test_a_scene_with_adhesion_is_written_and_read():
    for law in LAWS:
        assert ev.scenefile.loads(ev.scenefile.dump(scene_of(adhesion=law))) == scene_of(adhesion=law)
    refuses("adhesion", ev.scenefile.dump, scene_of(adhesion=Exponential()))


FULL = {"law": ev.StrongTroxel(), "voltage": 10.0, "field": "full"}


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ev.Dugdale(stress=-1.0, reach=0.01), r"adhesion\.stress"),
        (lambda: ev.Capillary(0.07, 90.0, 0.01), r"adhesion\.contact_angle"),
        (lambda: scene_of(adhesion=0.1), "Dugdale, Capillary"),
        (lambda: scene_of(ev.Display(), adhesion=MOIST, **FULL), "full with adhesion"),
    ],
)
def test_what_is_no_adhesion_is_refused(make, message):
    refuses(message, make)


@pytest.mark.parametrize("voltage", [0.0, 60.0])
def test_the_field_of_the_attraction_is_that_of_the_voltage_alone(voltage):
    """Times what nodes stand for it is the column `electrostatic_force`, not that and the adhesion."""
    display = ev.Display(insulator=ev.TOUCHSCREEN, friction=0.4)
    water = {"adhesion": ev.Capillary(0.0728, 40.0, 0.02), "roughness_gap": 0.005}
    result = ev.simulate(
        ev.Scene(PAD, display, ev.StrongTroxel(), voltage, [ev.Press(force=0.05, steps=1)], **water)
    )
    pad, frame = result.mesh.node_sets["pad"], result.frames[-1]
    x = (result.mesh.points + frame.displacement)[pad, 0]
    spans = np.gradient(np.sort(x))[np.argsort(np.argsort(x))]
    found = float(np.sum(frame.electrostatic_traction[pad] * spans))
    assert found == pytest.approx(result.electrostatic_force[-1], rel=0.02, abs=1e-12)
    assert result.adhesive_force[-1] > 1e-3
