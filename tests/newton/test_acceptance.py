"""What an accepted step promises beside the laws of friction (`test_acceptance_under_laws`): a state that
breaks it is refused.
"""

from dataclasses import replace

import numpy as np
import pytest
from tools.steps import MESH, MU, PAD, SLIP, TOLERANCE, Script, accepted, legal, node

from evfem.contact.signorini import FORWARD
from evfem.contact.stability import SLOPES, StabilityRatio
from evfem.newton.control import Target
from evfem.newton.equilibrium import Equilibrium
from evfem.newton.interface import PenaltyInterface
from evfem.newton.state import Folded, Limits, StepFailed
from evfem.surface.friction import RateFriction
from evfem.surface.surfaces import Flat

FLAT = Flat(friction=MU, y=0.0)


def test_the_residual_and_the_place_of_the_bone_are_asked_for():
    interface, old, good = legal(FLAT)
    for residual, number in ((1.0 * TOLERANCE, 0), (1.001 * TOLERANCE, 1)):
        assert accepted(interface, old, [good, replace(good)], (residual, 0.0)) == number
    for bone in ([1e-15, 0.0], [0.0, 1e-15]):
        elsewhere = replace(good, bone=np.array(bone))
        assert accepted(interface, old, [elsewhere, good]) == 1


@pytest.mark.parametrize("residual", [np.nan, np.inf])
def test_a_residual_that_is_no_number_fails_the_step(residual):
    interface, old, good = legal(FLAT)
    with pytest.raises(StepFailed, match="not finite"):
        accepted(interface, old, [good, good], (residual, 0.0))


def test_an_equilibrium_that_the_body_leaves_is_refused():
    interface, old, new = legal(FLAT)
    script = Script([new], (0.0, 0.0))
    script.left = StabilityRatio(1.5, SLOPES)
    solver = Equilibrium(script, interface, None, Limits(TOLERANCE))
    with pytest.raises(StepFailed, match=f"not stable: {SLOPES}, 1.5 times as hard") as failed:
        solver.step(old, Target.held(old.bone, 0.0))
    assert failed.value.unstable


def test_an_outline_that_folds_over_itself_is_refused():
    """Two neighbours that slip without friction have changed places: everything else holds."""
    interface, old, good = legal(Flat(friction=0.0, y=0.0))
    status, force = np.full(good.status.size, FORWARD), np.zeros_like(good.contact_force)
    order = np.argsort(MESH.points[PAD.nodes, 0])
    left, right = PAD.nodes[order[[2, 3]]]
    good = replace(good, u=old.u.copy(), status=status, contact_force=force)
    assert accepted(interface, old, [good, replace(good)]) == 0
    swapped = good.u.copy()
    swapped[left, 0] += MESH.points[right, 0] - MESH.points[left, 0]
    swapped[right, 0] -= MESH.points[right, 0] - MESH.points[left, 0]
    with pytest.raises(Folded, match=r"there is no equilibrium near here without the outline folding over"):
        accepted(interface, old, [replace(good, u=swapped), good])


def test_a_yielding_interface_and_a_law_of_speed_are_in_series():
    """Displaced by dx, a node that slips at F(s), s = s0 + dx - C (F - F0), has dF/dx = F' / (1 + C
    F'); and what holds it at rest is the law's tangent there, however much the interface yields.
    """
    interface, old, new = legal(FLAT, PenaltyInterface)
    interface.penalties, law = (50.0, 2e3), RateFriction(speed=1.0, exponent=0.7)
    interface.law, interface.duration = law, 2e-3
    old = replace(old, age=np.zeros(PAD.nodes.size))
    k = node(FORWARD)
    normal, shear = new.contact_force[k]
    length, give = PAD.length(MESH.points[PAD.nodes, 0])[k], interface.compliance(old)[k, 1]
    slip = SLIP + give * shear  # the node has moved by SLIP, and the interface gives way

    def bound(s):
        return law.bound(normal / length, MU, s / interface.duration, 0.0) * length

    def force(dx):  # F = F(s)
        low, high = 0.0, 10.0 * abs(shear)
        for _ in range(200):
            middle = 0.5 * (low + high)
            s = slip + dx - give * (middle - abs(shear))
            low, high = (middle, high) if s > 0.0 and middle < bound(s) else (low, middle)
        return low

    nothing = np.zeros(PAD.nodes.size)
    found = interface.candidates(old, new, np.arange(PAD.nodes.size), nothing, nothing)
    steep = (bound(slip * (1.0 + 1e-6)) - bound(slip * (1.0 - 1e-6))) / (2e-6 * slip)
    held = found.friction[k] * normal + found.cohesion[k]
    series = steep / (1.0 + give * steep)
    assert give * steep > 0.1
    assert found.slip_stiffness[k] == pytest.approx(series, rel=1e-4)
    # one step of Newton's method from the iterate, whose force is not the law's
    assert held == pytest.approx((bound(slip) + give * steep * abs(shear)) / (1.0 + give * steep), rel=1e-6)
    at = force(0.0)
    assert held == pytest.approx(at, abs=0.2 * abs(abs(shear) - at))
    # the motion by which the contact problem has the node at rest, and its whole force then
    dx = -(found.slip[k, 0] - found.interface_compliance[k, 1] * held)
    assert held + series * dx == pytest.approx(bound(slip) - steep * slip, rel=1e-4)
