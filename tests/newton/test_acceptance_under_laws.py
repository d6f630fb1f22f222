"""What an accepted step promises under each law of friction, with exact contact and with penalties: each
condition is broken once, all others kept, and the state refused.
"""

from dataclasses import replace

import numpy as np
import pytest
from tools.steps import GAP, MESH, MU, PAD, SLIP, TOLERANCE, Script, legal, node, pushed, shifted

from evfem.contact.signorini import BACKWARD, FORWARD, OPEN, STICK
from evfem.newton.control import GivenVoltage, Indentation, Target
from evfem.newton.equilibrium import Equilibrium
from evfem.newton.interface import Interface, PenaltyInterface
from evfem.newton.state import Limits
from evfem.newton.strategy import Strategy
from evfem.surface.friction import AdhesiveFriction, AgeingFriction, LoadIndexFriction, RateFriction
from evfem.surface.surfaces import Flat

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
KINDS = [(Interface, law) for law in LAWS] + [
    (PenaltyInterface, law) for law in ("coulomb", "rate", "ageing")
]
kinds = pytest.mark.parametrize(("kind", "law"), KINDS, ids=[f"{kind.__name__} {law}" for kind, law in KINDS])


def lawful(kind, law, surface=None):
    """An interface under a law, a state before a step of half a second and one after it that obeys
    everything, and the largest shear of every node (P,).
    """
    interface, old, good = legal(surface or Flat(friction=MU, y=0.0), kind)
    interface.law, interface.duration = law, SECONDS
    give, before = np.zeros((PAD.nodes.size, 2)), np.zeros_like(good.contact_force)
    if kind is PenaltyInterface:
        interface.penalties = PENALTIES
        give, before[:, 1] = 1.0 / np.outer(PAD.length(X), PENALTIES), 0.05
    old = replace(old, age=np.full(PAD.nodes.size, 0.2), contact_force=before)
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
    """Number of the iterate that the solver accepts; it keeps its displacements."""
    script = Script(states, (0.0, 0.0))
    solver = Equilibrium(script, interface, None, Limits(TOLERANCE, Strategy(iterations=2)))
    target = Target(0.0, Indentation(0.0), GivenVoltage(0.0), interface.duration)
    found = solver.step(old, target)
    return next(k for k, state in enumerate(states) if state.u is found.u)


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
