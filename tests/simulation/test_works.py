"""Closed books: works, energies and dissipations of every row add up, each from its own definition."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tools.builders import INSULATOR, SKIN, coarse_pad, finger
from tools.meshes import block

import evfem as ev
from evfem.contact.signorini import BACKWARD, FORWARD, OPEN, STICK
from evfem.electrostatics.laws import Kaczmarek, Layers, StrongTroxel
from evfem.electrostatics.signals import VoltageProfile
from evfem.finger.fingerpad import MeshedFinger
from evfem.newton.control import GivenVoltage, Indentation, Target
from evfem.reference import pull_in_strong_troxel
from evfem.scene.motion import Hover, Press, Slide, VoltageRamp
from evfem.scene.scene import Output, Scene, Solver
from evfem.simulation import works
from evfem.simulation.model import make_model
from evfem.simulation.run import simulate
from evfem.simulation.works import SubstepWork
from evfem.surface.surfaces import Display, Flat, Sinusoid
from evfem.tissue.laws import LinearElastic

ROUND, SOFT = finger(block(8, 3, sag=0.4)), finger(block(8, 3, sag=0.4), viscosity=2e-3)
MOTION = (Press(indentation=0.3, steps=3), Slide(0.6, steps=4))
TIMED = (Press(indentation=0.2, steps=3, speed=20.0), Slide(0.6, steps=6, speed=20.0))
WAVES = Sinusoid(friction=0.4, terms=[[0.03, 6.0, 0.0]], insulator=INSULATOR)
STEPS = [[0.0, 0.3], [0.3, 0.3], [0.3, 0.5], [0.5, 0.2]]
PENALTY = Solver(contact="penalty", penalty_normal=50.0, penalty_tangential=20.0)
SNAP = (Hover(0.05), VoltageRamp(4000.0, steps=4), VoltageRamp(0.0, steps=4))
ROUNDING = 1e-12


@ev.form
def pushed(u, v, w):
    return 2e-4 * v[1] + 1e-3 * ev.dot(u, v)


def scene(surface, law=None, voltage=0.0, motion=MOTION, body=ROUND, **options):
    return Scene(body, surface, law, voltage, motion, output=Output(every=1000), **options)


SCENES = {
    "friction": scene(Flat(friction=0.5)),
    "table": scene(Flat(friction=STEPS)),
    "waves": scene(WAVES),
    "force": scene(WAVES, motion=(Press(force=0.03, steps=3), Slide(0.6, steps=4, hold="force"))),
    "penalty": scene(Flat(), solver=PENALTY),
    "form": scene(Flat()).with_term(pushed, on=ev.Region("tissue")),
    "vertical": scene(Display(), Kaczmarek(), 3000.0),
    "normal": scene(WAVES, Kaczmarek(), 3000.0, direction="normal"),
    "no air": scene(Display(), StrongTroxel(), 500.0, air_layer=False),
    "staggered once": scene(Display(), Kaczmarek(), 2000.0, coupling="staggered_once"),
    "profile": scene(Display(), Kaczmarek(), VoltageProfile([0.0, 0.3, 0.3], [0.0, 900.0, 2500.0])),
    "hover": scene(Display(), StrongTroxel(), 2000.0, (Hover(0.2, steps=2),)),
    "snap": scene(Display(), StrongTroxel(), 0.0, SNAP),
    "viscous": scene(WAVES, None, 0.0, TIMED, SOFT, solver=Solver(dynamics="viscous")),
    "inertial": scene(WAVES, Kaczmarek(), 2000.0, TIMED, SOFT, solver=Solver(dynamics="inertial")),
    "stops": scene(Flat(), None, 0.0, (*TIMED, Press(force=0.03)), solver=Solver(dynamics="inertial")),
}


def in_parts(of, times):
    """The scene with so many times the steps."""
    return replace(of, motion=[replace(motion, steps=times * motion.steps) for motion in of.motion])


def left_over(result):
    """What no column has in every row, relative to the largest of them."""
    given = np.array([result.external_work, result.electrostatic_work])
    kept = [result.stored_energy, result.kinetic_energy, result.friction_dissipation]
    kept += [result.viscous_dissipation, result.integrator_dissipation, result.snap_dissipation]
    largest = np.abs([*given, *kept]).max(axis=0)
    return np.abs(given.sum(axis=0) - np.sum(kept, axis=0)) / np.maximum(largest, ROUNDING)


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.filterwarnings("ignore:motion . has steps of")
def test_the_books_are_closed_in_every_row(name):
    result = simulate(SCENES[name])
    assert left_over(result).max() < 1e-6
    for column in ("friction_dissipation", "viscous_dissipation", "snap_dissipation"):
        assert (np.diff(getattr(result, column), prepend=0.0) >= 0.0).all()
    if name not in ("table", "staggered once", "hover", "stops"):  # where forces may let go
        assert (result.snap_dissipation[-1] > 0.0) == (name == "snap")


@pytest.mark.parametrize("name", ["friction", "waves", "penalty", "form", "normal", "no air"])
def test_what_the_way_loses_falls_with_the_square_of_the_step(name):
    """An energy or dissipation that is wrong by a share would stay in it."""
    coarse, fine = (simulate(in_parts(SCENES[name], times)) for times in (2, 8))
    ratio = abs(coarse.integrator_dissipation[-1] / fine.integrator_dissipation[-1])
    assert 8.0 < ratio < 40.0  # a quarter of the step: a sixteenth
    assert abs(fine.integrator_dissipation[-1]) < 1e-3 * fine.stored_energy[-1]
    assert fine.snap_dissipation[-1] < 1e-9 * fine.stored_energy[-1]


@pytest.mark.filterwarnings("ignore:motion . has steps of")
def test_a_body_that_swings_loses_its_energy_to_the_integrator():
    """Held by the bone in the air nothing gives or takes but backward Euler, and less with half the step."""
    lost = []
    for times in (1, 2):
        motion = (
            Hover(0.3),
            Press(indentation=-0.28, steps=2 * times, speed=50.0),
            Press(indentation=-0.28 + 1e-6, steps=40 * times, speed=0.05),
        )
        result = simulate(scene(Flat(), None, 0.0, motion, solver=Solver(dynamics="inertial")))
        inside = result.stored_energy + result.kinetic_energy
        start = 1 + 2 * times
        given = np.diff(result.external_work[start:]).sum()
        assert abs(given) < 0.02 * inside[start]
        gone = inside[start] - inside[-1] + given
        assert gone == pytest.approx(np.diff(result.integrator_dissipation[start:]).sum(), rel=1e-6)
        assert gone > 0.0
        lost.append(gone)
    assert lost[1] < lost[0]


@pytest.mark.parametrize("gap", [0.05, 0.018], ids=["wide", "narrow"])
def test_a_plate_that_snaps_sets_free_what_the_closed_form_says(gap):
    """A column that cannot move sideways is a spring, and its lower face a plate. In a narrow gap it is near
    the surface when it snaps, and what is set free is a small share of the works.
    """
    width, height, E = 4.0, 2.0, 0.1
    column = MeshedFinger(block(4, 2), {"tissue": LinearElastic(E=E, nu=0.0)}, SKIN)
    layers = Layers.of(ev.Layer(0.38, 1650.0), INSULATOR)
    stiffness = E * width / height
    critical = pull_in_strong_troxel(stiffness, gap, width, layers)
    below = critical.voltage * (1.0 - 1e-5)
    motion = (Hover(gap), VoltageRamp(below, steps=60), VoltageRamp(critical.voltage * 1.0001, steps=1))
    result = simulate(scene(Display(friction=0.0), StrongTroxel(), 0.0, motion, column))
    assert not result.contact_width[-2]
    assert result.contact_width[-1] == pytest.approx(width)
    assert result.snap_dissipation[-2] == 0.0
    assert result.jumps.tolist() == [0] * 61 + [1]  # also where iterations snap without a release
    pulled = [StrongTroxel().potential(g, critical.voltage, layers) for g in (gap - critical.travel, 0.0)]
    freed = width * (pulled[0] - pulled[1]) - 0.5 * stiffness * (gap**2 - critical.travel**2)
    assert result.snap_dissipation[-1] == pytest.approx(freed, rel=0.02)


#: status before and after, way in mm, and the share of mu times normal force times way that is dissipated
SLIPS = [
    (FORWARD, FORWARD, 0.1, 1.0),
    (BACKWARD, BACKWARD, -0.1, 1.0),
    (STICK, FORWARD, 0.1, 1.0),
    (OPEN, BACKWARD, -0.1, 0.5),
    (FORWARD, OPEN, 0.1, 0.5),
    (BACKWARD, OPEN, -0.1, 0.5),
    (FORWARD, OPEN, -0.1, 0.0),
    (STICK, OPEN, 0.1, 0.0),
    (FORWARD, FORWARD, -0.1, 0.0),
    (BACKWARD, BACKWARD, 0.1, 0.0),
    (STICK, STICK, 1e-12, 0.0),
    (OPEN, OPEN, 0.1, 0.0),
]


@pytest.mark.parametrize(("before", "after", "way", "share"), SLIPS)
def test_who_dissipates_by_friction(before, after, way, share):
    """One node of a level pad goes its way and presses with 2 N/mm where it touches: a node that lands
    or leaves does so with half of that in the mean, a node that stuck and let go slides in the air.
    """
    model = make_model(SCENES["friction"])
    rest = model.equilibrium.rest(np.zeros(2), 0.0)
    node, states = 3, []
    for status, moved in ((before, 0.0), (after, way)):
        state = replace(rest, u=rest.u.copy(), status=rest.status.copy(), contact_force=0.0 * rest.attraction)
        state.u[model.pad.nodes[node], 0] += moved
        state.status[node] = status
        state.contact_force[node, 0] = 2.0 * (status != OPEN)
        states.append(state)
    expected = share * 0.5 * 2.0 * 0.1
    assert SubstepWork(model, *states).friction() == pytest.approx(expected, rel=1e-12, abs=1e-15)


@pytest.mark.parametrize("thickness", [0.09, 1e-3, 2e-4])
@pytest.mark.parametrize("way", ["down", "up"])
def test_the_attraction_of_a_plate_that_lands_or_lifts_works_what_its_potential_says(thickness, way):
    """Over 0.3 mm at a constant voltage; above 0.2 um of insulator the attraction falls to half within a
    thousandth of that.
    """
    column = MeshedFinger(block(4, 2), {"tissue": LinearElastic(E=0.1, nu=0.0)}, SKIN)
    insulator, gap, voltage = ev.Layer(thickness, 3.35), 0.3, 140.0
    surface = Display(insulator, friction=0.0)
    law_itself = Solver(core="off")
    model = make_model(scene(surface, StrongTroxel(), voltage, (Hover(gap),), column, solver=law_itself))
    rest = model.equilibrium.rest(np.array([0.0, gap]), voltage)
    landed = replace(rest, u=rest.u - [0.0, gap], status=np.full_like(rest.status, STICK))
    landed = replace(landed, attraction=model.equilibrium.attraction_at(landed, landed, voltage))
    states = (rest, landed) if way == "down" else (landed, rest)
    layers = Layers.of(ev.Layer(0.38, 1650.0), insulator)
    far, near = (StrongTroxel().potential(g, voltage, layers) for g in (gap, 0.0))
    expected = 4.0 * (far - near) * (1.0 if way == "down" else -1.0)
    assert SubstepWork(model, *states).pulled()[0] == pytest.approx(expected, rel=1e-4)


class Counted:
    """Strong and Troxel's law, and at how many places it is asked."""

    def __init__(self):
        self.law, self.asked = StrongTroxel(), 0

    def traction(self, gap, voltage, layers):
        self.asked += np.atleast_2d(gap).shape[0]
        return self.law.traction(gap, voltage, layers)


@pytest.mark.parametrize(("thickness", "fall", "places"), [(0.09, 0.01, 8), (0.09, 0.1, 8), (2e-4, 0.3, 104)])
def test_only_a_way_through_a_thin_layer_is_taken_at_more_than_eight_places(thickness, fall, places):
    law, gap = Counted(), 0.3
    column = MeshedFinger(block(4, 2), {"tissue": LinearElastic(E=0.1, nu=0.0)}, SKIN)
    surface = Display(ev.Layer(thickness, 3.35), friction=0.0)
    model = make_model(scene(surface, law, 140.0, (Hover(gap),), column))
    rest = model.equilibrium.rest(np.array([0.0, gap]), 140.0)
    # the outline falls faster than the bone
    fallen = replace(rest, u=rest.u - [0.0, fall])
    law.asked = 0
    SubstepWork(model, rest, fallen).pulled()[0]
    assert law.asked == places


def test_what_the_way_of_the_loads_loses_in_a_release_is_no_energy_set_free():
    """A round block under drag whose bone moves: what L lacks on the way of contact is more than drag
    dissipates, and of the way.
    """
    model = make_model(scene(Display(friction=0.0)))
    solver, body = model.equilibrium, model.body
    start = solver.rest(model.bone(0.0, 0.0), 0.0)
    old = solver.step(start, Target(0.0, Indentation(-0.2), GivenVoltage(0.0)))
    signs = []
    for height, rate in ((-0.4, 0.5), (-0.05, 0.01)):
        body.release(old.u, rate)
        new = solver.step(old, Target(0.0, Indentation(height), GivenVoltage(0.0)))
        before, after = SubstepWork(model, old, old).end(), SubstepWork(model, old, new).end()
        works = SubstepWork(model, old, new).works(before, after)
        drag = body.drag_dissipation(new.u)
        assert drag > 0.0
        freed = works["snap_dissipation"] + works["integrator_dissipation"]
        assert freed < drag
        assert works["snap_dissipation"] == max(freed, 0.0)
        assert works["integrator_dissipation"] == min(freed, 0.0)
        signs.append(np.sign(freed))
    assert sorted(signs) == [-1.0, 1.0]


def test_in_space_a_way_counts_along_the_slip(monkeypatch):
    """By hand: 3 and 4 mm of slip along x and z, on a way of 1 and 2 mm; then 2 mm back along z."""
    slips = np.array([[3.0, 4.0], [0.0, -2.0]])
    monkeypatch.setattr(works, "slipped", lambda *_: slips)
    level = SimpleNamespace(travel=np.stack([np.eye(2)] * 2))
    interface = SimpleNamespace(dim=3, surface_at=lambda _: level)
    model = SimpleNamespace(equilibrium=SimpleNamespace(interface=interface))
    part = SimpleNamespace(model=model, old=None, new=None, slip_length=np.array([5.0, 2.0]))
    along = np.array([[1.0, 9.0, 2.0], [5.0, 9.0, 7.0]])
    np.testing.assert_allclose(SubstepWork._with_slip(part, along), [2.2, -7.0], rtol=1e-12)


def test_the_field_stretches_with_the_forces_on_the_way():
    """Rough faces come closer from the forces of the begin to those of the end."""
    nodes, seen = np.ones(3), []

    def charged(position, voltage, pressing, carried):
        seen.append(pressing)

    charging = SimpleNamespace(
        old=SimpleNamespace(voltage=100.0), carried=lambda length: None, energy_density=lambda at: nodes
    )
    pad = SimpleNamespace(tributary=lambda position: position[:, 0])
    attraction = SimpleNamespace(pad=pad, charging=charging, charged=charged)
    interface = SimpleNamespace(resting=lambda state: state.place)
    model = SimpleNamespace(attraction=attraction, equilibrium=SimpleNamespace(interface=interface))
    old, new = (
        SimpleNamespace(place=long * np.ones((3, 2)), contact_force=load * np.ones((3, 2)))
        for long, load in ((1.0, 0.2), (1.5, 0.6))
    )
    assert SubstepWork(model, old, new)._stretching(model.attraction.charging) == pytest.approx(
        3 * 0.5, rel=1e-12
    )
    np.testing.assert_allclose(seen, 0.2 + 0.4 * np.outer(works.WAY, nodes), rtol=1e-12)


@pytest.mark.parametrize("distances", [(0.5,), (0.5, -1.0)])
def test_a_slide_in_one_step_has_closed_books(distances):
    """Nodes stick, then slip, or turn: the bone gives what friction and tissue take, to a tenth of it."""
    slides = [Slide(distance, steps=1, hold="force") for distance in distances]
    found = simulate(Scene(coarse_pad(), Flat(friction=0.3), motion=[Press(force=0.05, steps=4), *slides]))
    taken = np.diff(found.friction_dissipation)[-1]
    assert abs(np.diff(found.integrator_dissipation)[-1]) < 0.1 * taken
