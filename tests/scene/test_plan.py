"""What a scene needs: terms that are left out must not matter, and the numbers are those of the
mesh.
"""

from dataclasses import replace

import numpy as np
import pytest
from tools.builders import finger
from tools.meshes import block

import evfem as ev
from evfem.scene.plan import plan, plan_on, rigid_share, scene_mesh
from evfem.scene.way import remembers
from evfem.simulation.model import make_model

pytestmark = pytest.mark.solver
BLOCK = block(40, 2, sag=1.0)


def share_of(scene):
    """How much a rigid outline errs, as the plan has it."""
    return rigid_share(scene, scene_mesh(scene)[0])


def hovering(E=0.05, gap=0.25, voltage=1000.0, law=None, motion=()):
    return ev.Scene(
        finger(BLOCK, E=E), ev.Display(), law or ev.Kaczmarek(), voltage, [ev.Hover(gap), *motion]
    )


@pytest.mark.filterwarnings("ignore:the shear modulus")  # next to rigid, for comparison
@pytest.mark.parametrize("law", [ev.Kaczmarek(), ev.StrongTroxel()], ids=["kaczmarek", "strong_troxel"])
@pytest.mark.parametrize("voltage", [300.0, 1000.0])
def test_deforming_changes_the_attraction_by_less_than_the_plan_says(law, voltage):
    """Beside the run that leaves nothing out: a form of no weight keeps the tissue in."""
    scene = hovering(voltage=voltage, law=law)

    @ev.form
    def nothing(u, v, w):
        return 0.0 * (u[0] * v[0] + u[1] * v[1])

    soft = ev.simulate(scene.with_term(nothing, ev.Region("tissue"))).electrostatic_force[0]
    rigid = make_model(hovering(E=1e3, voltage=voltage, law=law)).equilibrium
    state = rigid.rest(np.array([0.0, 0.25]), voltage)
    change = abs(soft / -state.attraction[:, 1].sum() - 1.0)
    share = share_of(scene)
    assert 1e-7 < change < share < 100.0 * change


def test_a_hovering_pad_is_rigid_only_below_a_tenth_of_a_thousandth():
    shares = {}
    for voltage in (10.0, 1000.0):
        scene = hovering(voltage=voltage)
        shares[voltage] = share_of(scene)
        assert plan(scene).has("tissue") == (shares[voltage] >= 1e-4)
    # the traction goes with the square of the voltage
    assert shares[1000.0] == pytest.approx(1e4 * shares[10.0], rel=1e-9)
    assert plan(hovering(voltage=1000.0)).has("tissue")
    assert not plan(hovering(voltage=10.0)).has("tissue")


@pytest.mark.parametrize("motion", [ev.Press(indentation=0.1), ev.Slide(1.0)], ids=["press", "slide"])
def test_whoever_moves_otherwise_than_hovering_deforms(motion):
    assert plan(hovering(voltage=10.0, motion=[motion])).has("tissue")


def test_the_largest_voltage_of_any_source_counts():
    profile = ev.VoltageProfile([0.0, 1.0], [10.0, -300.0])
    assert hovering(voltage=profile).electrics.largest_voltage == 300.0
    ramps = [ev.VoltageRamp(-500.0), ev.VoltageRamp(0.0)]
    assert hovering(voltage=20.0, motion=ramps).electrics.largest_voltage == 500.0
    from_nothing = hovering(voltage=0.0, motion=ramps)
    assert plan(from_nothing).has("electricity")
    assert not plan(hovering(voltage=0.0)).has("electricity")


def test_numbers_are_those_of_the_mesh():
    """40 by 2 quads of nine nodes: 81 by 5 nodes, the upper 81 move as one, the lower 81 may
    touch.
    """
    scene = hovering()
    mesh, element = scene_mesh(scene)
    found = plan_on(scene, mesh, element)
    assert (found.element, found.nodes, found.cells) == ("q2p1", 81 * 5, 80)
    assert found.unknowns == 2 * 81 * 4 + 2 == make_model(hovering()).body.size
    assert (found.pad_nodes, found.steps) == (81, 1)


@pytest.mark.parametrize(("nu", "said"), [(0.49, False), (0.4999, True)])
def test_the_plan_names_what_hardly_changes_its_volume(nu, said):
    scene = ev.Scene(finger(BLOCK, nu=nu), ev.Flat(friction=0.0), motion=[ev.Press(indentation=0.1)])
    line = "pressure an unknown of the iterations, as tissue hardly changes volume"
    assert (line in plan(scene).solver) == said
    assert make_model(scene).body.tissue.nearly_incompressible == said


@pytest.mark.parametrize(
    ("friction", "said"),
    [
        (0.0, "nothing remembers the way, each step is one part"),
        (0.3, "friction remembers the way, a part errs by at most 0.5 % of the force"),
    ],
)
def test_the_plan_says_what_automatic_steps_are(friction, said):
    solver = ev.Solver(strategy=ev.Strategy(steps="auto", path_error=5e-3))
    scene = ev.Scene(finger(BLOCK), ev.Flat(friction=friction), motion=[ev.Press(indentation=0.1)])
    assert not any("steps auto" in line for line in plan(scene).solver)
    assert f"steps auto: {said}" in plan(replace(scene, solver=solver)).solver


def test_time_charges_and_the_air_layer_are_remembered_too():
    scene = replace(hovering(voltage=100.0), surface=ev.Display(friction=0.0))
    assert remembers(scene) == ()
    assert remembers(replace(scene, air_layer=False)) == ("who touches",)
    motion = [ev.Press(indentation=0.1, speed=1.0)]
    slow = replace(scene, motion=motion, finger=finger(BLOCK, viscosity=1e-3))
    assert remembers(replace(slow, solver=ev.Solver(dynamics="viscous"))) == ("time",)
    alternating = {"drive": ev.Drive(resolved=True), "voltage": ev.Sine(100.0, 50.0)}
    assert remembers(replace(scene, motion=motion, **alternating)) == ("charges",)


@pytest.mark.parametrize("error", [0.0, 1.5, 1e-11])
def test_forces_cannot_be_wanted_to_any_error(error):
    with pytest.raises(ev.InputError):
        ev.Solver.within(error)


def test_forces_to_an_error_need_what_the_plan_says():
    scene = ev.Scene(finger(BLOCK), ev.Flat(friction=0.0), motion=[ev.Press(indentation=0.1, steps=3)])
    cheap, exact = replace(scene, solver=ev.Solver.within(0.02)), ev.simulate(scene)
    assert "steps auto: nothing remembers the way, each step is one part" in plan(cheap).solver
    assert ev.simulate(cheap).normal_force == pytest.approx(exact.normal_force, rel=0.02)
