"""Scenes that stopped earlier versions: steep friction, snapping pads, thin insulators, big steps. Each ends
in a converged state whose physics is known."""

import numpy as np
import pytest
from builders import block, finger

from evfem import friction
from evfem.electrostatics import Kaczmarek, Layer, StrongTroxel
from evfem.fingerpad import FingerPad
from evfem.scene import Hover, Output, Press, Scene, Slide, Solver, VoltageRamp
from evfem.simulate import Run, simulate
from evfem.surfaces import Display, Flat

ONCE = Output(every=1000)


def pad(ridges=False):
    return FingerPad(ridges=ridges, resolution="coarse")


def run(surface, *motion, body=None, **options):
    return simulate(Scene(body or pad(), surface, motion=motion, output=ONCE, **options))


def test_a_steep_rise_of_friction_is_climbed():
    """From 0.2 to 0.7 within 0.01 mm: the coefficient changes with the node's own motion."""
    table = [[0.4, 0.2], [0.41, 0.7]]
    result = run(Flat(friction=table), Press(indentation=0.3, steps=3), Slide(6.0, steps=30))
    assert result.tangential_force[-1] / result.normal_force[-1] == pytest.approx(0.7, rel=1e-7)


@pytest.mark.parametrize("table", [[[1.0, 0.2], [1.0, 1.0]], [[1.0, 1.0], [1.0, 0.2]]])
def test_a_jump_of_friction_is_passed_and_obeyed(table):
    """Coulomb's law with the coefficient of each node's accepted x, in every step, and full slip behind
    the jump.
    """
    scene = Scene(pad(), Flat(friction=table), motion=[Press(force=0.05, steps=5), Slide(4.0, steps=40)])
    going = Run(scene, None)
    surface, equilibrium = going.model.surface, going.model.equilibrium
    for request in going.requests():
        going.advance(request)
        state = going.state
        normal, shear = state.contact_force.T
        mu = surface.friction_coefficient(equilibrium.positions(state.u)[:, 0])
        assert (np.abs(shear) <= mu * normal + 1e-9).all()
        slipping = state.status >= 2
        np.testing.assert_allclose(np.abs(shear)[slipping], (mu * normal)[slipping], atol=1e-9)
    row = going.rows[-1]
    assert row["tangential_force"] / row["normal_force"] == pytest.approx(table[1][1], rel=1e-7)


@pytest.mark.parametrize("body", [lambda: finger(block(8, 3, sag=0.4)), pad])
def test_attraction_alone_holds_the_finger(body):
    """No load on the bone: contact and attraction balance each other."""
    voltage = {"law": Kaczmarek(), "voltage": 1000.0}
    result = run(Display(), Press(force=0.0, steps=2), body=body(), **voltage)
    assert result.normal_force[-1] == pytest.approx(result.electrostatic_force[-1], rel=1e-6)
    assert result.indentation[-1] > 0.0


@pytest.mark.parametrize("thickness", [1e-3, 5e-5])
def test_thin_insulators(thickness):
    """1 um and 50 nm at 140 V: a thinner insulator pulls harder, friction follows."""
    surface = Display(Layer(thickness, 3.35), friction=0.3)
    voltage = {"law": Kaczmarek(), "voltage": 140.0}
    result = run(surface, Press(force=0.05, steps=5), Slide(3.0, steps=20), **voltage)
    assert result.tangential_force[-1] == pytest.approx(0.3 * result.normal_force[-1], rel=1e-7)
    thick = run(Display(friction=0.3), Press(force=0.05, steps=5), **voltage)
    assert result.electrostatic_force[4] > 5.0 * thick.electrostatic_force[-1]


def test_a_thin_insulator_by_strong_troxels_law():
    """200 nm at 140 V: up to 1 MPa that falls within a fraction of a micrometre, so nodes snap one by one.
    Touching nodes are on the surface to the last digit; the rounding of their gaps would be a force.
    """
    surface = Display(Layer(2e-4, 3.35), friction=0.3)
    voltage = {"law": StrongTroxel(), "voltage": 140.0}
    result = run(surface, Press(force=0.05, steps=5), Slide(0.6, steps=3), **voltage)
    assert result.electrostatic_force[4] > 20.0 * 0.05
    np.testing.assert_allclose(result.applied_force[:5], 0.01 * np.arange(1, 6), rtol=1e-6)
    balance = result.normal_force - result.electrostatic_force - result.applied_force
    assert np.abs(balance).max() < 1e-7 * result.normal_force.max()


def test_snapping_in_and_letting_go_at_another_voltage():
    """Hover at 0.05 mm: the pad jumps to contact between 2000 and 5000 V and lets go at a lower voltage."""
    up, down = VoltageRamp(5000.0, steps=20), VoltageRamp(0.0, steps=20)
    result = run(Display(), Hover(0.05), up, down, law=Kaczmarek())
    touching = result.contact_width > 0.0
    snap_in = result.voltage[1:21][touching[1:21]].min()
    let_go = result.voltage[21:][~touching[21:]].max()
    assert 2000.0 < snap_in < 5000.0
    assert 0.0 < let_go < snap_in
    assert result.electrostatic_force[-1] == 0.0


def test_three_thousand_volts_in_one_step():
    motion = Press(force=0.05, steps=5), VoltageRamp(3000.0, steps=1), Slide(1.0, steps=5)
    result = run(Display(), *motion, law=Kaczmarek())
    assert result.voltage[5] == 3000.0
    gradual = run(Display(), motion[0], VoltageRamp(3000.0, steps=20), law=Kaczmarek())
    assert result.electrostatic_force[5] == pytest.approx(gradual.electrostatic_force[-1], rel=2e-3)


def test_strong_troxel_at_two_thousand_volts_on_ridges():
    result = run(
        Display(), Press(indentation=0.5, steps=5), law=StrongTroxel(), voltage=2000.0, body=pad(True)
    )
    balance = result.applied_force - result.normal_force + result.electrostatic_force
    assert np.abs(balance).max() < 1e-7 * result.normal_force.max()


def test_penalised_friction_obeys_the_return_map():
    """The penalty variant is a compliance of the interface; pointwise it is the return map of
    `evfem.friction`.
    """
    solver = Solver(contact="penalty", penalty_normal=50.0, penalty_tangential=20.0)
    motion = [Press(indentation=0.3, steps=1), Slide(0.05, steps=2)]
    going = Run(Scene(pad(), Flat(friction=0.3), motion=motion, solver=solver), None)
    equilibrium = going.model.equilibrium
    for request in going.requests():
        old = going.state
        going.advance(request)
        new = going.state
        before, after = equilibrium.positions(old.u)[:, 0], equilibrium.positions(new.u)[:, 0]
        length = going.model.pad.length(before)
        touching = new.status > 0
        shear, pressure, past = (
            values[touching] / length[touching]
            for values in (new.contact_force[:, 1], new.contact_force[:, 0], old.contact_force[:, 1])
        )
        # the stick carries what it carried: its history is where its traction would be zero
        history = before[touching] + past / 20.0
        point = friction.return_map(after[touching], history, pressure, 0.3, penalty=20.0)
        np.testing.assert_allclose(point.shear, shear, atol=1e-7)
