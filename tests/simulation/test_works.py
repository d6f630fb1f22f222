"""Closed books: works, energies and dissipations of every row add up, each from its own definition."""

from dataclasses import replace

import numpy as np
import pytest
from tools.builders import INSULATOR, SKIN, coarse_pad, finger, left_over
from tools.meshes import block

import evfem as ev
from evfem.circuit.signals import VoltageProfile
from evfem.contact.signorini import BACKWARD, FORWARD, OPEN, STICK
from evfem.electrostatics.laws import Kaczmarek, Layers, StrongTroxel
from evfem.finger.fingerpad import MeshedFinger
from evfem.newton.control import GivenVoltage, Indentation, Target
from evfem.reference import pull_in_strong_troxel
from evfem.scene.motion import Hover, Press, Slide, VoltageRamp
from evfem.scene.scene import Output, Scene, Solver
from evfem.simulation.model import make_model
from evfem.simulation.run import simulate
from evfem.simulation.works import SubstepWork
from evfem.surface.surfaces import Display, Flat, Sinusoid
from evfem.tensor import dot
from evfem.tissue.laws import LinearElastic

ROUND, SOFT = finger(block(8, 3, sag=0.4)), finger(block(8, 3, sag=0.4), viscosity=2e-3)
MOTION = (Press(indentation=0.3, steps=3), Slide(0.6, steps=4))
TIMED = (Press(indentation=0.2, steps=3, speed=20.0), Slide(0.6, steps=6, speed=20.0))
WAVES = Sinusoid(friction=0.4, terms=[[0.03, 6.0, 0.0]], insulator=INSULATOR)
STEPS = [[0.0, 0.3], [0.3, 0.3], [0.3, 0.5], [0.5, 0.2]]
PENALTY = Solver(contact="penalty", penalty_normal=50.0, penalty_tangential=20.0)
SNAP = (Hover(0.05), VoltageRamp(4000.0, steps=4), VoltageRamp(0.0, steps=4))


@ev.form
def pushed(u, v, w):
    return 2e-4 * v[1] + 1e-3 * dot(u, v)


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


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.filterwarnings("ignore:motion . has steps of")
def test_the_books_are_closed_in_every_row(name):
    result = simulate(SCENES[name])
    assert left_over(result) < 1e-6
    for column in ("friction_dissipation", "viscous_dissipation", "snap_dissipation"):
        assert (np.diff(getattr(result, column), prepend=0.0) >= 0.0).all()
    if name not in ("table", "hover", "stops"):  # where forces may let go
        assert (result.snap_dissipation[-1] > 0.0) == (name == "snap")


@pytest.mark.parametrize("name", ["friction", "waves", "penalty", "form", "normal", "no air"])
def test_what_the_way_loses_falls_with_the_square_of_the_step(name):
    """An energy or dissipation that is wrong by a share would stay in it."""
    coarse, fine = (simulate(in_parts(SCENES[name], times)) for times in (2, 8))
    ratio = abs(coarse.integrator_dissipation[-1] / fine.integrator_dissipation[-1])
    assert 8.0 < ratio < 40.0  # a quarter of the step: a sixteenth
    assert abs(fine.integrator_dissipation[-1]) < 1e-3 * fine.stored_energy[-1]
    assert fine.snap_dissipation[-1] < 1e-9 * fine.stored_energy[-1]


def test_no_snap_is_where_the_loss_falls_with_the_step():
    """A press on rough faces with an attraction of half the load, and the step that begins to slip whole."""
    body = replace(coarse_pad(ridges=False), width=14.0)
    screen = Display(insulator=ev.Layer(1e-3, 4.0), friction=0.3)
    press, slide = Press(force=0.03, steps=10), Slide(1.0, steps=10, hold="force")
    rough = scene(screen, StrongTroxel(), 200.0, (press, slide), body, roughness_gap=0.005)
    found, half = simulate(rough), simulate(replace(rough, motion=(replace(press, steps=20),)))
    assert found.electrostatic_force[9] > 0.5 * found.applied_force[9]
    assert found.jumps.sum() == 0
    assert half.integrator_dissipation[-1] < 0.4 * found.integrator_dissipation[9]


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
    assert SubstepWork(model, *states).pulled()["electrostatic"] == pytest.approx(expected, rel=1e-4)


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


@pytest.mark.parametrize("distances", [(0.5,), (0.5, -1.0)])
def test_a_slide_in_one_step_has_closed_books(distances):
    """Nodes stick, then slip, or turn: the bone gives what friction and tissue take, to a tenth of it."""
    slides = [Slide(distance, steps=1, hold="force") for distance in distances]
    found = simulate(Scene(coarse_pad(), Flat(friction=0.3), motion=[Press(force=0.05, steps=4), *slides]))
    taken = np.diff(found.friction_dissipation)[-1]
    assert abs(np.diff(found.integrator_dissipation)[-1]) < 0.1 * taken
