"""Where no equilibrium is near the body is released: where it comes to rest, what it sets free, and
that what it does on the way is counted.

A wedge of linear elastic tissue touches a wave with its tip alone, so it is a point on two springs:
its energy at the bone (X, Y) is :math:`k_x (x - X)^2/2 + k_y (h(x) - Y)^2/2` over the tip's x.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq
from tools.builders import SKIN, finger, left_over
from tools.domes import dome_scene
from tools.meshes import between, block, held

import evfem as ev
from evfem.common.constants import RELEASED
from evfem.newton.control import Target
from evfem.newton.state import StepFailed
from evfem.simulation.model import make_model
from evfem.solver.relaxation import Relaxation

HEIGHT, LENGTH, DEPTH = 0.007, 1.0, 0.2
WAVE = 2.0 * np.pi / LENGTH
#: way to the place where stability is lost, mm
AHEAD = 0.01
# the wave is smooth to the tip, which alone touches it
pytestmark = pytest.mark.filterwarnings(
    "ignore:the surface is sharper", "ignore:the shear modulus of tissue", "ignore:motion . slides at"
)
TROUGH = -0.5 * np.pi


def wedge():
    """A column 0.4 mm wide and 2 mm high, tapered to a tip at the lower end."""
    x, t = np.meshgrid(np.linspace(-0.2, 0.2, 3), np.linspace(0.0, 1.0, 5))
    low = 1.5 * np.abs(x)
    return ev.MeshedFinger(
        held(between(x, low + t * (2.0 - low))), {"tissue": ev.LinearElastic(0.1, 0.0)}, SKIN
    )


def scene(*others, friction=0.0, **options):
    """The wedge pressed into a trough of the wave, and what follows."""
    surface = ev.Sinusoid(friction=friction, terms=[[HEIGHT, WAVE, TROUGH]], insulator=ev.Layer(0.09, 3.35))
    motion = [ev.Press(indentation=DEPTH, steps=4), *others]
    return ev.Scene(wedge(), surface, motion=motion, output=ev.Output(every=1000), **options)


def on_a_crest(press):
    """The wedge pressed on the middle of a crest."""
    return ev.Scene(wedge(), ev.Sinusoid(friction=0.0, terms=[[HEIGHT, WAVE, -TROUGH]]), motion=[press])


def springs():
    """kx and ky of the tip (N/mm per mm): the stiffness of the body at rest, condensed by numpy."""
    body = make_model(scene()).body
    whole = body.pattern.full(body.tangent(np.zeros((body.space.size, 2)))).toarray()
    mesh = body.space.mesh
    tip = body.unknowns[np.argmin(mesh.points[:, 1])]
    rest = np.setdiff1d(np.arange(body.size - 2), tip)
    among = whole[np.ix_(tip, tip)] - whole[np.ix_(tip, rest)] @ np.linalg.solve(
        whole[np.ix_(rest, rest)], whole[np.ix_(rest, tip)]
    )
    return among[0, 0], among[1, 1]


class Point:
    """The tip on its springs."""

    def __init__(self):
        self.kx, self.ky = springs()

    def lift(self, x):
        """How far the surface at x lifts the tip (mm)."""
        return HEIGHT * (1.0 - np.cos(WAVE * x)) + DEPTH

    def energy(self, x, bone):
        return 0.5 * self.kx * (x - bone) ** 2 + 0.5 * self.ky * self.lift(x) ** 2

    def bone(self, x):
        """Where the bone is in equilibrium with the tip at x."""
        return x + self.ky * self.lift(x) * HEIGHT * WAVE * np.sin(WAVE * x) / self.kx

    def snap(self):
        """x of the tip where the bone has gone furthest, before the first crest."""
        return brentq(lambda x: self.bone(x + 1e-6) - self.bone(x - 1e-6), 0.05 * LENGTH, 0.45 * LENGTH)

    def before(self, bone):
        """x of the tip short of the snap."""
        return brentq(lambda x: self.bone(x) - bone, 0.0, self.snap())

    def beside(self, depth):
        """x of the tip below a bone that was pressed on the middle of a crest, and how far it is lifted."""
        lift = lambda x: depth - HEIGHT * (1.0 - np.cos(WAVE * x))  # noqa: E731
        push = lambda x: self.ky * lift(x) * HEIGHT * WAVE * np.sin(WAVE * x)  # noqa: E731
        x = brentq(lambda x: push(x) - self.kx * x, 0.01 * LENGTH, 0.5 * LENGTH)
        return x, lift(x)

    def beyond(self, bone):
        """x of the tip in the next trough with the bone at the same place."""
        return brentq(lambda x: self.bone(x) - bone, 0.55 * LENGTH, LENGTH + self.snap())


@pytest.fixture(scope="module")
def point():
    return Point()


def over(point, **options):
    """A slide up to just before the loss, and one step across."""
    lost = point.bone(point.snap())
    return scene(ev.Slide(lost - AHEAD, steps=10), ev.Slide(2.0 * AHEAD, steps=1), **options)


def test_a_released_tip_comes_to_rest_in_the_next_trough(point):
    """Before and after the snap the tip pushes with the force of the point on springs, and what is
    set free is the difference of its energies where the bone has gone furthest.
    """
    result = ev.simulate(over(point))
    assert result.relaxations.tolist() == [0] * 14 + [1]
    lost = point.bone(point.snap())
    bones = np.array([lost - AHEAD, lost + AHEAD])
    tips = np.array([point.before(bones[0]), point.beyond(bones[1])])
    np.testing.assert_allclose(result.applied_tangential_force[-2:], point.kx * (bones - tips), rtol=1e-6)
    np.testing.assert_allclose(result.stored_energy[-2:], point.energy(tips, bones), rtol=1e-6)
    assert result.snap_dissipation[-2] == 0.0
    freed = point.energy(point.snap(), lost) - point.energy(point.beyond(lost), lost)
    # the release begins up to 1/32 of the last step beyond the loss
    later = lost + 2.0 * AHEAD * RELEASED
    most = point.energy(point.snap(), later) - point.energy(point.beyond(later), later)
    assert (1.0 - 1e-3) * freed <= result.snap_dissipation[-1] <= (1.0 + 1e-3) * most
    assert most < 1.1 * freed
    assert left_over(result) < 1e-6
    assert result.summary()["relaxations"] == result.provenance["solver"]["relaxations"] == 1


def test_a_tip_on_a_crest_comes_to_rest_beside_it(point):
    """Pressed on the middle of a crest, the tip has an equilibrium there, which it leaves once the force
    turns with the crest faster than the springs hold it: in each row it is beside the crest already.
    """
    result = ev.simulate(on_a_crest(ev.Press(indentation=DEPTH, steps=4)))
    for row, depth in enumerate(result.indentation):
        x, lifted = point.beside(depth)
        assert abs(result.tangential_force[row]) == pytest.approx(point.kx * x, rel=1e-5)
        assert result.normal_force[row] == pytest.approx(point.ky * lifted, rel=1e-6)
    assert result.relaxations[0] > 0
    assert result.provenance["solver"]["cuts"] < 10
    assert left_over(result) < 1e-6


def test_stability_is_that_of_the_body_with_its_present_drag():
    """On the middle of the crest the tip is held by some drag, and not without."""
    model = make_model(on_a_crest(ev.Press(indentation=DEPTH)))
    solver, rest = model.equilibrium, model.equilibrium.rest(model.bone(0.0, 0.0), 0.0)
    target = Target.held(model.bone(0.0, 0.3 * DEPTH), 0.0)
    for rate, unstable in ((1.0, False), (0.0, True), (1.0, False)):
        model.body.release(rest.u, 1.0)
        state = solver.step(rest, target)
        model.body.release(state.u, rate)
        solver.body.begin(state, target, state)
        margin = solver.body.leaves(state, state, target)
        assert (margin is not None and margin.ratio > 1.0) is unstable


def test_a_prescribed_load_is_kept(point):
    """The tip under a constant force N leaves the trough where the wave is steepest, N h' = kx (X - x)."""
    load = point.ky * DEPTH
    gone = 0.25 * LENGTH + load * HEIGHT * WAVE / point.kx
    motion = [ev.Press(force=load, steps=4), ev.Slide(gone - AHEAD, steps=10, hold="force")]
    motion.append(ev.Slide(3.0 * AHEAD, steps=1, hold="force"))
    result = ev.simulate(replace(scene(), motion=motion))
    assert result.relaxations.sum() == 1
    np.testing.assert_allclose(result.applied_force[4:], load, rtol=1e-7)
    assert left_over(result) < 1e-6


LET_GO = [ev.Press(indentation=1e-4, steps=1), ev.VoltageRamp(voltage=0.0, steps=1, hold="force")]
SAGGING = finger(block(8, 2, sag=0.01), E=0.02)


@pytest.mark.parametrize(
    ("scene", "unit"),
    [(ev.Scene(SAGGING, ev.Display(), ev.Kaczmarek(), 1500.0, LET_GO), "N/mm"), (dome_scene(*LET_GO), "N")],
)
def test_a_finger_pulled_harder_than_the_attraction_holds_lifts_off(scene, unit):
    """A block whose ends the attraction pulls down, and a dome, keep that pull while the voltage falls."""
    with pytest.raises(ev.NotConverged, match="there is no equilibrium near here") as lost:
        ev.simulate(scene)
    assert lost.value.step == 2
    pull = f"{lost.value.result.applied_force[0]:.3g}".removeprefix("-")
    assert f"the finger is pulled with {pull} {unit} and lifts off" in str(lost.value)
    assert "it was lost at position 0 mm" in str(lost.value)
    assert f", -{pull} {unit} and " in str(lost.value)


def test_a_viscous_finger_without_mass_is_pulled_off_at_once():
    """In the air nothing limits how fast it leaves, so no time step is short enough."""
    motion = [ev.Press(indentation=1e-4, steps=1), ev.Wait(duration=0.1, steps=10, hold="force")]
    pad, falling = finger(block(8, 2, sag=0.01), E=0.02, viscosity=1e-3), ev.Sampled([1500.0, 0.0], rate=10.0)
    viscous = ev.Solver(dynamics="viscous")
    with pytest.raises(ev.NotConverged, match=r"lifts off, where the attraction .* try more voltage") as lost:
        ev.simulate(ev.Scene(pad, ev.Display(), ev.Kaczmarek(), falling, motion, solver=viscous))
    assert lost.value.step > 1


@pytest.mark.parametrize(("charged", "seconds"), [(True, [0.1, 0.1, 0.0, 0.0]), (False, [0.0] * 4)])
def test_charge_flows_in_the_first_step_of_a_release_and_is_kept_after_it(charged, seconds):
    """So what the body comes to rest with is what its end without drag has. The first one fails here."""
    model = make_model(scene())
    rest = model.equilibrium.rest(np.zeros(2), 0.0)
    passed, ends = [], []

    def solve(state, target):
        if model.body.drag_rate == 0.0:
            ends.append(target.duration)
            return state
        passed.append(target.duration)
        if len(passed) == 1:
            raise StepFailed("too fast", [])
        return replace(state, u=state.u + 0.1 * 0.5 ** len(passed))

    target = replace(Target.held(rest.bone, 0.0), duration=0.1)
    Relaxation(model.body, solve, charged).follow(rest, target, lambda old, new: None)
    assert passed[:4] == seconds
    assert ends == [0.0 if charged else 0.1]


def test_a_body_that_rests_with_the_least_drag_but_never_without_is_given_up():
    """Asked a dozen times, not until 400 steps are over."""
    model = make_model(scene())
    rest, asked = model.equilibrium.rest(np.zeros(2), 0.0), []

    def solve(state, target):
        asked.append(model.body.drag_rate)
        if model.body.drag_rate == 0.0:
            raise StepFailed("not without drag", [])
        return state

    with pytest.raises(StepFailed, match="does not come to rest"):
        Relaxation(model.body, solve).follow(rest, Target.held(rest.bone, 0.0), lambda old, new: None)
    assert min(rate for rate in asked if rate > 0.0) < 1e-8
    assert asked.count(0.0) < 12


def test_friction_on_the_way_is_counted(point):
    """Each column from its definition, and the books closed; what slips dissipates."""
    result = ev.simulate(scene(ev.Slide(2.5, steps=25), friction=0.05))
    assert result.relaxations.any()
    assert left_over(result) < 1e-6
    for name in ("friction_dissipation", "snap_dissipation"):
        assert (np.diff(getattr(result, name)) >= 0.0).all()
    crossed = np.flatnonzero(result.relaxations)
    # the tip slips about one wave there, at a friction of 0.05 times its load
    load = 0.05 * result.normal_force[crossed]
    slipped = np.diff(result.friction_dissipation)[crossed - 1] / load
    assert (slipped > 0.5 * LENGTH).all()
    assert (slipped < 1.1 * LENGTH).all()


@pytest.mark.filterwarnings("ignore:motion . has steps of")
def test_tissue_without_time_snaps_below_a_heavy_hand_that_stays_where_it_is(point):
    """The tip jumps to the next trough at once, as without a hand, and no other column has what that
    sets free; the bone goes on.
    """
    lost, speed = point.bone(point.snap()), 10.0
    hand = ev.Hand(stiffness=50.0, damping=0.02, mass=1e-5)
    slides = [ev.Slide(lost - AHEAD, steps=10, speed=speed), ev.Slide(2.0 * AHEAD, steps=1, speed=speed)]
    result = ev.simulate(scene(*slides, hand=hand))
    assert result.relaxations.tolist() == [0] * 14 + [1]
    bones = result.position[[13, 14]]
    tips = np.array([point.before(bones[0]), point.beyond(bones[1])])
    np.testing.assert_allclose(result.tangential_force[[13, 14]], point.kx * (bones - tips), rtol=1e-6)
    freed = point.energy(point.snap(), lost) - point.energy(point.beyond(lost), lost)
    assert result.snap_dissipation[-1] == pytest.approx(freed, rel=0.1)
    assert bones[1] - bones[0] == pytest.approx(2.0 * AHEAD, rel=1e-3)
    assert left_over(result) < 1e-6
