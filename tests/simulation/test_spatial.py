"""Runs in three dimensions: directions, balances, held loads, textures, time, checkpoints and files."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from tools.builders import left_over
from tools.domes import Dome, dome_scene

import evfem as ev
from evfem import plotting
from evfem.contact.signorini import SLIP
from evfem.simulation.history import SPATIAL, WIDTHS
from evfem.simulation.run import simulate
from evfem.tensor import ddot, grad

PRESS = ev.Press(indentation=0.3, steps=2)
SHEARS = ("tangential_force_x", "tangential_force_z")


@pytest.fixture(scope="module")
def slid():
    return simulate(dome_scene(PRESS, ev.Slide(0.5, steps=4, angle=30.0)))


def test_forces_and_energies_balance_and_friction_is_against_the_slide(slid):
    assert_allclose(slid.normal_force - slid.electrostatic_force, slid.applied_force, rtol=1e-7)
    assert left_over(slid) < 1e-7
    assert slid.frames[-1].contact_status.max() == SLIP
    shear = np.array([slid[name][-1] for name in SHEARS])
    assert_allclose(np.hypot(*shear), 0.3 * slid.normal_force[-1], rtol=2e-3)
    assert_allclose(np.degrees(np.arctan2(*shear[::-1])), 30.0, atol=0.3)
    assert_allclose([slid.position[-1], slid["position_z"][-1]], 0.5 * np.array([np.cos(np.pi / 6), 0.5]))
    assert (slid.friction_dissipation[2:] > 0.0).all()
    assert (np.diff(slid.friction_dissipation) >= 0.0).all()


def test_columns_of_the_plane_stay_and_widths_are_empty(slid):
    rooms = ("friction", "stick_share", "slip_share", "breakdown", "breakdown_x", "apparent_friction")
    assert slid.columns[-len(SPATIAL) - 6 :] == (*SPATIAL, *rooms)
    assert_allclose(slid.friction[-1], 0.3, rtol=2e-3)
    assert slid.slip_share[-1] == 1.0
    assert all(np.isnan(slid[name]).all() for name in WIDTHS)
    assert (slid.contact_area >= slid.real_contact_area).all()
    assert slid.real_contact_area[-1] > 1.0
    assert slid.units["normal_force"] == "N"
    assert slid.units["stored_energy"] == "mJ"
    assert slid.units["contact_area"] == "mm2"
    assert slid.total is slid
    text = repr(slid)
    assert "contact area" in text
    assert "tangential force z" in text
    assert f"position z {slid.position_z[-1]:.4g} mm" in text
    assert "N/mm" not in text


@pytest.mark.parametrize("angle", [0.0, 45.0, 90.0, 180.0])
def test_tangential_forces_are_along_the_slide_and_friction_is_drawn_so(angle):
    """Coulomb's law in full slip, forth and back; before the first slide along +x, where nothing pulls."""
    way = {"steps": 2, "hold": "force", "angle": angle}
    motion = [ev.Press(force=0.1, steps=2), ev.Slide(0.5, **way), ev.Slide(-0.7, **way)]
    result = simulate(dome_scene(*motion, law=None, voltage=0.0))
    for name in ("applied_tangential_force", "tangential_force"):
        assert_allclose(result[name][[1, 3, 5]], [0.0, 0.03, -0.03], atol=1e-4)
        x, z = (result[f"{name}_{axis}"] for axis in "xz")
        along = x * np.cos(np.radians(angle)) + z * np.sin(np.radians(angle))
        assert_allclose(result[name][2:], along[2:], atol=1e-12)
    over = "position" if angle % 180.0 == 0.0 else "position_z"
    for there in ("step", over):
        line = plotting.friction(result, over=there).lines[0]
        assert_allclose(line.get_ydata()[[3, 5]], [0.3, -0.3], atol=1e-3)
        assert_allclose(line.get_xdata(), result[there], atol=1e-15)


def test_time_adds_viscous_stress_and_inertia():
    quick = [ev.Press(indentation=0.2, steps=2, speed=10.0), ev.Slide(0.2, steps=2, speed=50.0, angle=90.0)]
    calm = simulate(dome_scene(*quick, law=None, voltage=0.0))
    solver = ev.Solver(element="hex8", dynamics="inertial")
    timed = simulate(dome_scene(*quick, law=None, voltage=0.0, solver=solver, finger=Dome(viscosity=5e-3)))
    assert timed.viscous_dissipation[-1] > 0.0
    assert timed.kinetic_energy[-1] > 0.0
    assert timed.applied_force[1] > 1.02 * calm.applied_force[1]
    assert left_over(timed) < 1e-7


@ev.form
def neo_hookean(u, v, w):
    """With mu = 0.02 and lambda = 0.1 MPa, for three dimensions alone."""
    F = grad(u) + np.eye(3)[:, :, None, None]
    return 0.02 * ddot(F, grad(v)) + (0.1 * u.theta - 0.02) * v.theta


def asked(name):
    """A method of `InSpace` that asks its law's."""

    def of(self, F, theta):
        assert len(F) == 3
        return getattr(self._law, name)(F, theta)

    return of


class InSpace:
    """The same law, of one's own in the split form, for three dimensions alone."""

    volume_measure, shear_modulus, viscosity, density = "log", 0.02, None, 1e-9
    _law = ev.NeoHookean(E=0.02 * (0.3 + 0.04) / 0.12, nu=0.1 / 0.24)

    # a protocol does not see what `__getattr__` gives
    split_energy, split_stress = asked("split_energy"), asked("split_stress")
    split_tangent, split_sigma_zz = asked("split_tangent"), asked("split_sigma_zz")


@pytest.mark.parametrize("law", [neo_hookean, InSpace()], ids=["form", "split law"])
def test_a_material_of_ones_own_for_space_is_tried_there(law):
    """The form of a neo-Hookean law has its forces."""
    still = {"law": None, "voltage": 0.0}
    wanted = simulate(dome_scene(PRESS, finger=Dome(law=InSpace._law), **still))
    scene = dome_scene(PRESS, finger=Dome(law=law), **still)
    assert "shear modulus 0.02 MPa" in str(ev.plan(scene))
    assert_allclose(simulate(scene).normal_force, wanted.normal_force, rtol=1e-6)


TIMED = ev.Press(indentation=0.3, steps=2, speed=1.0)


SLIDE = ev.Slide(0.5, steps=4, angle=30.0, speed=10.0)


LAWS = [
    ev.LoadIndexFriction(pressure=0.01, index=0.7),
    ev.LoadIndexFriction(pressure=0.01, index=1.3),
    ev.AdhesiveFriction(strength=0.004),
    ev.AgeingFriction(fresh=0.2, time=0.1),
    ev.RateFriction(speed=5.0, ratio=0.5),
    ev.RateFriction(speed=5.0, exponent=0.5),
    ev.RateFriction(speed=2.0, ratio=3.0),
]


@pytest.mark.filterwarnings("ignore:friction falls with the speed")
@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.kind)
def test_every_slipping_node_has_the_shear_of_its_law(law):
    """The traction of the accepted state is the law's bound of its pressure, speed and age; the age
    of the dome's first nodes is the whole run's.
    """
    result = simulate(dome_scene(TIMED, SLIDE, friction_law=law))
    assert left_over(result) < 1e-6
    frame, before = result.frames[-1], result.frames[-2]
    slips = (frame.contact_status == SLIP) & (before.contact_status > 0)
    assert slips.sum() > 8
    moved = np.linalg.norm((frame.displacement - before.displacement)[slips][:, ::2], axis=1)
    first = (result.frames[0].contact_status > 0)[slips]
    seconds = result.time[-1] - result.time[-2]
    age = result.time[-1] - result.time[0]  # of nodes that touch from the first step on, after it
    bound = law.bound(frame.contact_pressure[slips], 0.3, moved / seconds, age)
    shown = first if isinstance(law, ev.AgeingFriction) else slice(None)
    assert_allclose(frame.shear_traction[slips][shown], bound[shown], rtol=1e-5)


@pytest.mark.parametrize("angle", [0.0, 90.0, 30.0])
def test_a_hand_is_stretched_by_its_force_along_both_ways_of_the_display(angle):
    """Drive less bone is force over stiffness, there and back, at every end of a motion."""
    there, back = ev.Slide(-0.1, steps=1, angle=angle), ev.Slide(0.3, steps=1, angle=angle)
    result = simulate(dome_scene(TIMED, there, back, hand=ev.Hand(0.1)))
    along = np.array([0.0, 0.0, -0.1, 0.2])
    for axis, part in (("x", np.cos(np.radians(angle))), ("z", np.sin(np.radians(angle)))):
        bone = result["position" if axis == "x" else "position_z"]
        assert_allclose(0.1 * (part * along - bone), result[f"applied_tangential_force_{axis}"], atol=1e-9)
    assert left_over(result) < 1e-6


def test_a_hand_at_rest_pulls_across_the_slide_too():
    """On a slope along z the contact pushes the bone aside: the spring gives way by the force over k."""
    slope = ev.Sinusoid(terms=[[0.3, 0.2, 0.0]], angle=90.0, friction=0.0)
    scene = dome_scene(TIMED, ev.Slide(0.2, steps=1, speed=1.0), surface=slope, law=None, voltage=0.0)
    still = simulate(scene).applied_tangential_force_z[-1]
    result = simulate(replace(scene, hand=ev.Hand(0.2)))
    assert_allclose(result.applied_tangential_force_z, -0.2 * result["position_z"], atol=1e-9)
    assert 0.5 < result.applied_tangential_force_z[-1] / still < 1.0


@pytest.mark.parametrize("angle", [0.0, 60.0, 180.0])
def test_a_friction_force_is_followed_along_the_slide_there_and_back(angle):
    """Wished over the way along the slide's direction: what a bare slide has, a tenth more of it."""
    way = {"steps": 2, "hold": "force", "angle": angle}
    motion = [ev.Press(force=0.1, steps=2), ev.Slide(0.8, **way), ev.Slide(-0.6, **way)]
    display = ev.Display(insulator=ev.Layer(thickness=0.01, eps_r=3.35), friction=0.3)
    follow = ev.FollowForce([0.2, 0.21, 0.8], [-0.033, 0.033, 0.033], largest_voltage=2000.0)
    result = simulate(dome_scene(*motion, surface=display, voltage=follow))
    assert_allclose(result.applied_tangential_force[[3, 5]], [0.033, -0.033], rtol=1e-6)
    x, z = (result[f"applied_tangential_force_{axis}"][3] for axis in "xz")
    assert_allclose(np.hypot(x, z), 0.033, rtol=1e-2)
    assert (result.voltage[[3, 5]] > 100.0).all()


@pytest.mark.filterwarnings("ignore:at .* V touching skin")
def test_a_resolved_drive_has_the_mean_of_its_cycle_and_closed_books():
    """A leaking gap under a square wave of 250 Hz, settled, beside the closed form of its mean."""
    drive = {"frequency": 250.0, "waveform": "square", "gap_conductivity": 1e-8}
    surface = ev.Display(insulator=ev.Layer(0.001, 3.9), friction=0.3)
    given = {"surface": surface, "voltage": 100.0, "law": ev.StrongTroxel(), "roughness_gap": 0.001}
    press = ev.Press(indentation=0.3, steps=1)
    mean = simulate(dome_scene(press, drive=ev.Drive(**drive), **given)).electrostatic_force[-1]
    motion = [press, ev.Wait(duration=0.016, steps=80)]
    result = simulate(dome_scene(*motion, drive=ev.Drive(**drive, resolved=True), **given))
    assert_allclose(result.electrostatic_force[-20:].mean(), mean, rtol=0.01)
    went = result.leakage_dissipation + result.electrostatic_work + result.stretch_work
    assert_allclose(result.source_work, result.field_energy + went, atol=1e-6 * result.source_work[-1])
