"""Rendering: from a reference to a voltage, by closed forms and exactly, and what is felt then."""

from dataclasses import replace

import numpy as np
import pytest
from tools.builders import finger
from tools.domes import dome_scene
from tools.meshes import block
from tools.refusals import refuses

import evfem as ev
from evfem.circuit.encoding import AreaLaw, Encoding
from evfem.estimate.rendering import (
    ApparentFriction,
    apparent_friction,
    compare,
    exact,
    record,
    replay,
    voltage_for,
)

PAD = finger(block(16, 3, sag=0.4), viscosity=1e-3)
LAYERS = ev.Layers.of(ev.Layer(0.38, 1650.0), ev.Layer(0.09, 3.35))
STEP = [[0.0, 0.3], [1.4, 0.3], [1.4, 0.4]]
MOTION = (ev.Press(force=0.02, steps=2), ev.Slide(1.8, steps=18))


def encoding(friction, law=None, area=None):
    return Encoding(law or ev.Kaczmarek(), LAYERS, area or AreaLaw(60.0), friction)


@pytest.fixture(scope="module")
def jump():
    return record(ev.Scene(PAD, ev.Flat(friction=STEP), motion=MOTION))


@pytest.fixture(scope="module")
def texture():
    motion = (ev.Press(indentation=0.15, steps=3), ev.Slide(0.6, steps=30, speed=20.0))
    solver = ev.Solver(dynamics="inertial")
    return record(ev.Scene(PAD, ev.Sinusoid(friction=0.1), motion=motion, solver=solver))


def felt(friction, force=0.05):
    friction = np.asarray(friction)
    return ApparentFriction(np.arange(friction.size), np.full(friction.size, force), force * friction)


def test_apparent_friction_goes_from_stick_to_the_first_and_the_second_coefficient(jump):
    friction = apparent_friction(jump.result)
    assert friction.position.tolist() == pytest.approx([0.1 * i for i in range(19)])  # with the start
    assert friction.friction[0] == pytest.approx(0.0, abs=1e-9)
    slipping = friction.position >= jump.full_slip
    assert 0.1 < jump.full_slip < 0.4
    # full slip on flat ground is where Coulomb's limit is reached, not a step earlier or later
    assert friction.friction[slipping][0] == pytest.approx(0.3, rel=1e-7)
    assert (friction.friction[~slipping] < 0.2999).all()
    # the contact, 2 mm wide, is on its way across the step in the end
    assert 0.34 < friction.friction[-1] < 0.38
    assert friction.minimum(after=jump.full_slip) == pytest.approx(0.3, rel=1e-7)


def test_voltages_by_hand():
    # s = 0.38/1650 + 0.09/3.35 = 0.02709597; F_e/F_n = 0.5; (20a) sqrt(2 s 0.47 * 0.5 / (eps0 60))
    s, eps_0 = 0.38 / 1650.0 + 0.09 / 3.35, 8.8541878128e-12
    wish = felt([0.1, 0.2, 0.3])
    assert voltage_for(wish, encoding(0.2)).largest == pytest.approx(
        np.sqrt(s * 0.47 / (eps_0 * 60.0)), rel=1e-8
    )
    troxel = voltage_for(wish, encoding(0.2, ev.StrongTroxel()))
    assert troxel.largest == pytest.approx(s / np.sqrt(eps_0 * 60.0), rel=1e-8)
    # (19) with m = 0.5 at 0.05 N/mm over 8 mm: k F^-0.5 = 60 / sqrt(0.4) takes the place of k'
    power = voltage_for(wish, encoding(0.2, area=AreaLaw(60.0, 0.5)), depth=8.0)
    assert power.largest == pytest.approx(np.sqrt(s * 0.47 * np.sqrt(0.4) / (eps_0 * 60.0)), rel=1e-8)
    # U = 0, 0, U: its square is linear over the second mm, so rms^2 = U^2 / 2 / 2 over both
    assert power.profile.voltage[:2].tolist() == pytest.approx([0.0, 0.0], abs=1e-3)
    assert power.rms == pytest.approx(power.largest / 2.0, rel=1e-3)
    assert power.carrier == pytest.approx(np.sqrt(2.0) * power.largest, rel=1e-12)


def test_what_is_below_the_displays_own_friction_is_reported():
    signal = voltage_for(felt([0.4, 0.2, 0.2, 0.4, -0.1]), encoding(0.3))
    assert signal.profile([0.5, 1.0, 2.0, 2.5, 3.2, 4.0]) == pytest.approx(np.zeros(6), abs=1e-3)
    # half of the first piece, the second, half of the third, 0.8 of the last; four in all
    assert signal.share_not_renderable == pytest.approx((0.5 + 1.0 + 0.5 + 0.8) / 4.0, rel=1e-5)
    # integrals of squares: short by 0.1 at the ends of half a piece, by 0.1 along one, by 0.4 in the end
    short = 0.5 * 0.01 / 3.0 + 0.01 + 0.5 * 0.01 / 3.0 + 0.8 * 0.16 / 3.0
    wanted = 2.0 * (0.16 + 0.08 + 0.04) / 3.0 + 0.04 + (0.16 - 0.04 + 0.01) / 3.0
    assert signal.error_of_display == pytest.approx(np.sqrt(short / wanted), rel=1e-4)
    # friction that is the display's own but for noise is not lost
    assert voltage_for(felt([0.3 - 1e-9, 0.4]), encoding(0.3)).share_not_renderable == 0.0


def test_an_amplifier_costs_what_it_cuts_off():
    wish = felt([0.2, 0.4, 0.4])
    free = voltage_for(wish, encoding(0.2))
    assert (free.share_limited, free.error_of_amplifier) == (0.0, 0.0)
    half = voltage_for(wish, encoding(0.2), amplifier=ev.Amplifier(0.5 * free.largest))
    assert half.largest == pytest.approx(0.5 * free.largest, rel=1e-12)
    # F_e is straight up to 0.2 F_n, and cut off at a quarter: 0.15 are missing from 1 mm on, 0 at 0.25 mm
    wanted = (0.04 + 0.08 + 0.16) / 3.0 + 0.16
    assert half.error_of_amplifier == pytest.approx(np.sqrt(0.0225 * (0.75 / 3.0 + 1.0) / wanted), rel=1e-3)
    assert half.share_limited == pytest.approx(0.875, rel=1e-3)
    # at 20 mm/s a slew of 10 U/s climbs U / 2 per mm: there after 2 mm instead of 1
    slow = voltage_for(wish, encoding(0.2), amplifier=ev.Amplifier(1e4, slew=10.0 * free.largest), speed=20.0)
    np.testing.assert_allclose(slow.profile([1.0, 2.0]) / free.largest, [0.5, 1.0], rtol=1e-6)
    assert slow.share_limited == pytest.approx(1.0, rel=1e-6)
    # missing are 0.2 x - 0.05 x^2 over the first mm, 0.2 - 0.05 x^2 over the second: 53/6000 of squares each
    assert slow.error_of_amplifier == pytest.approx(np.sqrt(53.0 / 3000.0 / wanted), rel=2e-3)


@pytest.mark.parametrize("area", [AreaLaw(60.0), AreaLaw(60.0, 0.5)])
def test_between_two_rows_the_force_is_straight_not_the_voltage(area):
    """Half way from 0.5 to 0.6 the display adds 0.05, at U / sqrt(2); and so on with a load that grows."""
    device, x = encoding(0.5, area=area), np.linspace(0.0, 1.0, 501)
    even = voltage_for(felt([0.5, 0.6]), device)
    assert even.profile(0.5) == pytest.approx(even.largest / np.sqrt(2.0), rel=1e-3)
    load, force = np.array([0.02, 0.08]), np.array([0.01, 0.056])
    grown = voltage_for(ApparentFriction([0.0, 1.0], load, force), device, depth=8.0)
    pressed, wanted = (np.interp(x, [0.0, 1.0], of) for of in (load, force))
    made = device.tangential_force(8.0 * pressed, grown.profile(x)) / 8.0
    assert np.abs(made - wanted).max() < 2e-3 * (0.056 - 0.5 * 0.08)
    assert max(one.error_of_display for one in (even, grown)) < 1e-3


@pytest.mark.parametrize(
    ("most", "slew", "names"),
    [(2.0, 0.5, "slew"), (0.9, 0.5, "voltage_max, slew"), (0.5, 50.0, "voltage_max"), (2.0, 50.0, "")],
)
def test_the_limits_that_act_are_named(most, slew, names):
    """A rise to U over 1 mm at 1 mm/s, at first 1/16 U in 1/256 mm: 16 U/s."""
    U = voltage_for(felt([0.2, 0.3, 0.3]), encoding(0.2)).largest
    amplifier = ev.Amplifier(most * U, slew=slew * U)
    found = voltage_for(felt([0.2, 0.3, 0.3]), encoding(0.2), amplifier=amplifier, speed=1.0)
    assert found.limited_by == names
    assert (found.share_limited > 0.0) == bool(names)


def test_rows_at_one_position_stay_a_jump():
    wish = ApparentFriction([0.0, 1.0, 1.0, 2.0], np.full(4, 0.05), 0.05 * np.array([0.2, 0.2, 0.4, 0.4]))
    signal = voltage_for(wish, encoding(0.2))
    assert signal.profile.position.tolist() == [0.0, 1.0, 1.0, 2.0]
    assert signal.profile([0.999, 1.0]) == pytest.approx([0.0, signal.largest], abs=1e-3)


def test_a_profile_that_goes_on_behind_the_path_is_limited_on_a_share_of_the_path():
    """0 V over the first of 2 mm, then a rise to U at twice the slew: half of the path, whatever the 1 mm
    behind it that the rise takes.
    """
    wish = voltage_for(felt([0.2, 0.2, 0.3]), encoding(0.2))
    amplifier = ev.Amplifier(2.0 * wish.largest, slew=0.5 * wish.largest)
    slow = voltage_for(felt([0.2, 0.2, 0.3]), encoding(0.2), amplifier=amplifier, speed=1.0)
    assert slow.profile([1.0, 2.0, 3.0]) == pytest.approx([0.0, 0.5 * wish.largest, wish.largest], abs=1e-2)
    assert slow.share_limited == pytest.approx(0.5, rel=1e-3)


def test_exact_encoding_reproduces_a_friction_step(jump):
    found = exact(jump, ev.Display(friction=0.3), ev.Kaczmarek())
    fidelity = compare(jump.result, found.result)
    assert fidelity.relative_l2 < 1e-8
    assert fidelity.pearson == pytest.approx(1.0, abs=1e-12)
    assert fidelity.position.tolist() == pytest.approx([0.1 * i for i in range(1, 19)])
    # while the finger sticks, or slips before the step, nothing is needed; then more and more
    before = found.result.position < 0.35
    assert found.result.voltage[before].max() < 1.0
    assert fidelity.voltage_difference == found.result.voltage.max() > 500.0
    assert found.result.voltage[-1] == pytest.approx(found.result.voltage.max(), rel=1e-6)
    # the voltage found, replayed as a table, gives the same again
    slide = np.array(found.result.motion) == "slide"
    table = ev.VoltageProfile(found.result.position[slide], found.result.voltage[slide])
    again = replay(jump, ev.Display(friction=0.3), ev.Kaczmarek(), table)
    assert compare(found.result, again.result).relative_l2 < 1e-7


def test_the_closed_form_is_near_where_its_area_law_is_right(jump):
    felt = apparent_friction(jump.result)
    width = jump.result.contact_width[-1] / 0.02  # mm2/N of the gross contact, as an area law of one load
    signal = voltage_for(felt, encoding(0.3, area=AreaLaw(width)))
    open_loop = replay(jump, ev.Display(friction=0.3), ev.Kaczmarek(), signal.profile)
    fidelity = compare(jump.result, open_loop.result)
    # the air layer adds to the attraction, so that the force is somewhat too large, nowhere too small
    assert fidelity.error.min() > -1e-6 * 0.02
    assert 1e-4 < fidelity.relative_l2 < 0.03
    assert fidelity.pearson > 0.998
    assert fidelity.largest_error == fidelity.error.max()


def test_where_the_wish_is_below_the_displays_own_friction(jump):
    rough = ev.Display(friction=0.35)
    found = exact(jump, rough, ev.Kaczmarek())
    slide = np.array(found.result.motion) == "slide"
    wish, force = jump.result.applied_tangential_force[slide], found.result.applied_tangential_force[slide]
    own = wish < 0.35 * 0.02 * (1.0 - 1e-6)
    slipping = np.array(jump.result.position[slide]) >= 0.35
    assert (own & slipping).any()
    assert (~own).any()
    assert found.result.voltage[slide][own & slipping].max() == 0.0
    load = found.result.applied_force[slide]
    np.testing.assert_allclose(force[own & slipping], 0.35 * load[own & slipping], rtol=1e-7)
    np.testing.assert_allclose(force[~own], wish[~own], rtol=1e-7)
    assert (found.result.voltage[slide][~own][1:] > 0.0).all()
    signal = voltage_for(apparent_friction(jump.result), encoding(0.35))
    assert 0.5 < signal.share_not_renderable < 1.0
    assert (signal.profile(found.result.position[slide][own]) == 0.0).all()


def test_a_wish_beyond_what_a_sticking_pad_gives_waits_for_full_slip(jump):
    felt = apparent_friction(jump.result)
    wish = ev.FollowForce(felt.position, 1.2 * felt.tangential_force, 10_000.0)
    found = replay(jump, ev.Display(friction=0.3), ev.Kaczmarek(), wish)
    slide = np.array(found.result.motion) == "slide"
    voltage, force = found.result.voltage[slide], found.result.applied_tangential_force[slide]
    sticks = found.result.position[slide] < jump.full_slip
    assert sticks.any()
    assert voltage[sticks].max() == 0.0
    np.testing.assert_allclose(force[~sticks], 1.2 * felt.tangential_force[1:][~sticks], rtol=1e-7)
    assert voltage[~sticks].min() > 500.0
    unmet = compare(jump.result, found.result).unmet(0.05 * felt.tangential_force.max())
    assert not unmet[sticks].any()  # the same friction, so the same force as the reference
    assert unmet[~sticks].all()


def test_a_limited_voltage_reproduces_as_much_as_it_can(jump):
    free = exact(jump, ev.Display(friction=0.3), ev.Kaczmarek())
    most = 0.5 * free.result.voltage.max()
    found = exact(jump, ev.Display(friction=0.3), ev.Kaczmarek(), largest_voltage=most)
    assert found.result.voltage.max() == pytest.approx(most, rel=1e-12)
    limited = compare(jump.result, found.result)
    there = free.result.voltage[2:] < 0.999 * most
    assert np.abs(limited.error[there]).max() < 1e-9
    assert (limited.error[~there] < 0.0).all()


def test_exact_encoding_reproduces_a_texture(texture):
    wish = apparent_friction(texture.result)
    lowest = wish.minimum(after=texture.full_slip)
    assert 0.1 < lowest < 0.12 < wish.friction.max()
    found = exact(texture, ev.Display(friction=lowest), ev.Kaczmarek())
    error, voltage = compare(texture.result, found.result).error, found.result.voltage[3:]
    rubs = voltage > 0.0
    assert np.abs(error[rubs]).max() < 1e-6 * np.abs(wish.tangential_force).max()
    # the pad that still sticks resists more than it may without a voltage
    assert (error[~rubs] > 0.0).all()
    assert found.result.position[3:][~rubs].max(initial=0.0) < texture.full_slip
    assert voltage.max() > 1000.0
    # the reference held its indentation; the display is pressed to the load that this took
    assert found.scene.motion[0] == ev.Press(force=texture.result.applied_force[2], steps=3)
    assert found.scene.motion[1] == texture.scene.motion[1]


@pytest.mark.parametrize("angle", [0.0, 60.0, -40.0])
def test_exact_encoding_goes_along_the_slide(angle):
    """Friction that grows over x, felt on a display of one friction: the wish is over the way, of which x is
    the cosine.
    """
    table = ev.Flat(friction=[[-2.0, 0.25], [0.0, 0.4], [0.3, 0.3], [2.0, 0.6]])
    under = {"law": None, "voltage": 0.0, "surface": table}
    motion = [ev.Press(indentation=0.2, steps=1), ev.Slide(0.9, steps=3, angle=angle, hold="force")]
    reference = record(dome_scene(*motion, **under))
    found = exact(reference, ev.Display(ev.Layer(0.02, 3.35), friction=0.15), ev.Kaczmarek(), 8000.0)
    rows = (found.result.missed_force == 0.0) & (found.result.motion == "slide")
    assert rows[-3:].any()
    wanted = reference.result.applied_tangential_force
    assert found.result.applied_tangential_force[rows] == pytest.approx(wanted[rows], rel=1e-6)
    turned = record(dome_scene(motion[0], replace(motion[1], angle=-angle + 1.0), **under))
    refuses("through other positions", compare, reference.result, turned.result)


def test_slides_that_cannot_be_rendered_are_refused(jump):
    pressed = record(ev.Scene(PAD, ev.Flat(), motion=MOTION[:1]))
    refuses("0 rows of slides", apparent_friction, pressed.result)
    assert pressed.full_slip is None
    back = record(replace(jump.scene, motion=(MOTION[0], ev.Slide(-0.1, steps=2))))
    refuses(r"towards \+x", apparent_friction, back.result)
    refuses("same slide", compare, jump.result, back.result)
    refuses("position up to 2 mm", felt([0.1, 0.2, 0.3]).minimum, after=3.0)
    refuses("an ApparentFriction, as apparent_friction makes it", voltage_for, [0.1, 0.2, 0.3], encoding(0.2))
