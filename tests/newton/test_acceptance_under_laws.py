"""What an accepted step promises under each law of friction, with exact contact and with penalties: each
condition is broken once, all others kept, and the state refused.
"""

from dataclasses import replace

import numpy as np
import pytest
from tools.steps import (
    GAP,
    MESH,
    MU,
    PAD,
    SLIP,
    TOLERANCE,
    Script,
    accepted,
    begin_under,
    legal,
    node,
    pushed,
    shifted,
)

from evfem.contact.signorini import BACKWARD, FORWARD, OPEN, STICK
from evfem.contact.stability import SLOPES, StabilityRatio
from evfem.newton.control import GivenVoltage, Indentation, Target
from evfem.newton.equilibrium import Equilibrium
from evfem.newton.interface import slipped
from evfem.newton.state import Folded, Limits, StepFailed
from evfem.surface.friction import AdhesiveFriction, AgeingFriction, LoadIndexFriction, RateFriction
from evfem.surface.surfaces import Flat
from evfem.terms.foundation import Exact, Penalties
from evfem.terms.traction import NoTraction

SECONDS, PENALTIES, X = 0.5, (50.0, 20.0), MESH.points[PAD.nodes, 0]
LAWS = {
    "coulomb": None,
    "load index": LoadIndexFriction(pressure=0.3, index=0.7),
    "adhesive": AdhesiveFriction(strength=0.2),
    "rate": RateFriction(speed=1.0, exponent=0.3),
    "ageing": AgeingFriction(fresh=0.4, time=1.0),
}
#: with penalties the nodes' shares of the pad, and with them bounds that depend on the pressure, change
#: with the shear by more than the tolerance
KINDS = [(Exact, law) for law in LAWS] + [(Penalties, law) for law in ("coulomb", "rate", "ageing")]
kinds = pytest.mark.parametrize(("kind", "law"), KINDS, ids=[f"{kind.__name__} {law}" for kind, law in KINDS])


def lawful(kind, law, surface=None):
    """An interface under a law, a state before a step of half a second and one after it that obeys
    everything, and the largest shear of every node (P,).
    """
    interface, old, good = legal(surface or Flat(friction=MU, y=0.0))
    begin_under(law, interface, SECONDS)
    give, before = np.zeros((PAD.nodes.size, 2)), np.zeros_like(good.contact_force)
    if kind is Penalties:
        interface.faces = Penalties(PENALTIES, interface.tributary)
        give, before[:, 1] = 1.0 / np.outer(PAD.length(X), PENALTIES), 0.05
    old = replace(old, contact_force=before).remembering({"contact_time": np.full(PAD.nodes.size, 0.2)})
    touching, normal = good.status != OPEN, good.contact_force[:, 0]
    sign = np.select([good.status == FORWARD, good.status == BACKWARD], [1.0, -1.0], 0.0)
    shear = good.contact_force[:, 1]
    for _ in range(60):  # shares change a little with the slips
        x = X + np.where(touching, SLIP * sign - give[:, 1] * (shear - before[:, 1]), 0.0)
        share, speed = interface.tributary_at((old, good), x[:, None]), np.abs(sign) * SLIP / SECONDS
        mu = surface.friction if surface else MU
        limit = mu * normal if law is None else law.bound(normal / share, mu, speed, 0.0) * share
        shear = np.where(sign != 0.0, -sign * limit, np.where(touching, 0.2 * limit, 0.0))
    u = good.u.copy()
    u[PAD.nodes, 0] = x - X
    u[PAD.nodes, 1] = np.where(touching, -give[:, 0] * normal, GAP) - MESH.points[PAD.nodes, 1]
    return interface, old, replace(good, u=u, contact_force=np.column_stack([normal, shear])), limit


def first_accepted(interface, old, states):
    """Number of the iterate that the solver accepts at the end of half a second."""
    return accepted(interface, old, states, target=Target(0.0, Indentation(0.0), GivenVoltage(0.0), SECONDS))


def breakers(limit, give):
    """A good state with one thing changed, to be wrong by so much (mm or N/mm); where the interface
    yields, its spring goes along.
    """
    k, f, b, o = (node(status) for status in (STICK, FORWARD, BACKWARD, OPEN))

    def push(state, where, by):
        return shifted(pushed(state, where, by, 1), where, -give[where, 1] * by, 0)

    return {
        "lifted": lambda s, by: shifted(s, k, by, 1),
        "sunk": lambda s, by: shifted(s, f, -by, 1),
        "drifted": lambda s, by: shifted(s, k, by, 0),
        "drifted back": lambda s, by: shifted(s, k, -by, 0),
        "beyond the cone": lambda s, by: push(s, k, 0.8 * limit[k] + by),
        "beyond the cone below": lambda s, by: push(s, k, -1.2 * limit[k] - by),
        "less than friction": lambda s, by: push(s, f, by),
        "more than friction": lambda s, by: push(s, b, by),
        "penetrated": lambda s, by: shifted(s, o, -GAP - by, 1),
    }


@kinds
@pytest.mark.parametrize("name", breakers(np.zeros(PAD.nodes.size), None))
def test_each_condition_is_asked_for(kind, law, name):
    interface, old, good, limit = lawful(kind, LAWS[law])
    assert first_accepted(interface, old, [good, good]) == 0
    broken, size = breakers(limit, interface.compliance(old))[name], np.abs(good.contact_force).max()
    within, beyond = (broken(good, part * TOLERANCE * max(1.0, size)) for part in (0.3, 3.0))
    assert first_accepted(interface, old, [within, good]) == 0
    assert first_accepted(interface, old, [beyond, good]) == 1


@kinds
@pytest.mark.parametrize("status", [FORWARD, BACKWARD])
def test_friction_does_not_push(kind, law, status):
    """A node with the force of its slip that has gone the other way; the speed is the same both ways."""
    interface, old, good, _ = lawful(kind, LAWS[law])
    way = -2.0 * SLIP if status == FORWARD else 2.0 * SLIP
    assert first_accepted(interface, old, [shifted(good, node(status), way, 0), good]) == 1


@pytest.mark.parametrize(("kind", "law"), [one for one in KINDS if one[1] != "adhesive"])
def test_contact_does_not_pull(kind, law):
    """Without friction, so that no cone is broken beside it."""
    interface, old, good, _ = lawful(kind, LAWS[law], Flat(friction=0.0, y=0.0))
    k, give = node(FORWARD), interface.compliance(old)
    by = -good.contact_force[k, 0] - 2.0 * TOLERANCE
    pulling = shifted(pushed(good, k, by, 0), k, -give[k, 0] * by, 1)
    assert first_accepted(interface, old, [good, good]) == 0
    assert first_accepted(interface, old, [pulling, good]) == 1


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
    solver = Equilibrium(script, interface, NoTraction(), Limits(TOLERANCE))
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
    interface, old, new = legal(FLAT)
    interface.faces = Penalties((50.0, 2e3), interface.tributary)
    law = RateFriction(speed=1.0, exponent=0.7)
    begin_under(law, interface, 2e-3)
    old = old.remembering({"contact_time": np.zeros(PAD.nodes.size)})
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


def test_faces_on_springs_slip_less_by_what_they_yield_and_hold_its_energy():
    """Springs p A of a node: its shear has moved it by F / (p A), which is no slip; they store F^2 / (2 p A)
    each, at half of the forces a quarter. What slips against its side counts for nothing.
    """
    interface, old, new = legal(FLAT)
    length, k = PAD.length(MESH.points[PAD.nodes, 0]), node(FORWARD)
    interface.faces = faces = Penalties((1e3, 4e3), interface.tributary)
    shear = new.contact_force[k, 1]
    assert slipped(interface, old, new)[k, 0] == pytest.approx(SLIP + shear / (4e3 * length[k]), rel=1e-12)
    faces.begin(old, SECONDS)
    normal, along = (new.contact_force**2 / np.outer(length, (1e3, 4e3))).sum(axis=0)
    assert faces.stored(new) == pytest.approx(0.5 * (normal + along), rel=1e-12)
    rise = faces.potential(old, new, np.array([0.0, 0.5, 1.0]))
    np.testing.assert_allclose(rise, 0.5 * (normal + along) * np.array([0.0, 0.25, 1.0]), rtol=1e-12)
    interface.faces = Penalties((1e3, 50.0), interface.tributary)
    assert SLIP + shear / (50.0 * length[k]) < 0.0
    assert slipped(interface, old, new)[k, 0] == 0.0
