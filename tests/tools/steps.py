"""States of a pad that obey every law of contact, changed at one node, and what a solver makes of them."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np

from evfem.common.rooms import Room
from evfem.contact.signorini import BACKWARD, FORWARD, OPEN, STICK
from evfem.mesh.mesh import raised
from evfem.newton.control import Target
from evfem.newton.equilibrium import Equilibrium
from evfem.newton.interface import Interface
from evfem.newton.pressure import NO_PRESSURE
from evfem.newton.state import Balance, Limits, MixedBalance, Record
from evfem.newton.strategy import Strategy
from evfem.surface.pad import make_pad
from evfem.terms.friction import LawFriction, ProportionalFriction
from evfem.terms.traction import NoTraction
from tools.meshes import block

TOLERANCE, MU = 1e-6, 0.5
MESH = raised(block(4, 2))
PAD = make_pad(MESH)
#: statuses of pad nodes in a row, with forces along normal and tangent (N/mm) that obey Coulomb's law
NODES = {OPEN: (0.0, 0.0), STICK: (1.0, 0.3), FORWARD: (0.8, -MU * 0.8), BACKWARD: (0.6, MU * 0.6)}
SLIP, GAP = 1e-3, 1e-2


def balanced(forces, residual, attraction):
    """The balance of compressible tissue."""
    return Balance(forces, residual, attraction, MixedBalance(forces, residual, NO_PRESSURE))


class Script:
    """A body whose iterates and residuals are known beforehand: first the state in question."""

    def __init__(self, states, residuals):
        self.size, self.record = len(MESH.points), Record()
        self.states, self.residuals, self.left = states, residuals, None
        self.body, self.pressure = SimpleNamespace(rooms=()), Room()

    def begin(self, old, target, start):
        return self.states[0]

    def balance(self, state, attraction, target):
        residual = self.residuals[self.record.iterations]
        return state, balanced(np.zeros(2), residual, attraction)

    def advance(self, old, state, target, balance):
        return self.states[self.record.iterations + 1]

    def leaves(self, old, state, target):
        return self.left

    def add_candidates(self, state, gap):
        pass

    def discard(self):
        pass

    def findings(self, state, balance):
        return ""


def legal(surface):
    """An interface, a state before a step and one after it that obeys everything: every fourth
    node is open, sticks, has slipped forwards, backwards.
    """
    interface = Interface(PAD, MESH.points, surface, TOLERANCE)
    script = Script([], [])
    equilibrium = Equilibrium(script, interface, NoTraction(), Limits(TOLERANCE))
    old = equilibrium.rest(np.zeros(2), 0.0)
    status = np.resize([OPEN, STICK, FORWARD, BACKWARD], PAD.nodes.size)
    force = np.array([NODES[s] for s in status.tolist()])
    x, y = MESH.points[PAD.nodes].T
    moved = np.select([status == FORWARD, status == BACKWARD], [SLIP, -SLIP], 0.0)
    u = old.u.copy()
    u[PAD.nodes, 0] = moved
    ground = surface.y + surface.height(x + moved)
    u[PAD.nodes, 1] = ground - y + np.where(status == OPEN, GAP, 0.0)
    new = replace(old, u=u, status=status, contact_force=force, reaction=np.array([0.1, -2.0]))
    return interface, old, new


def begin_under(law, interface, seconds):
    """A step of so many seconds begins under a law of friction, None for Coulomb's."""
    nodes = interface.pad.nodes.size
    interface.bounds = ProportionalFriction() if law is None else LawFriction(law, nodes)
    interface.duration = seconds
    interface.bounds.begin(None, seconds)


def node(status):
    """The first pad node with this status."""
    return int(np.flatnonzero(np.resize([OPEN, STICK, FORWARD, BACKWARD], PAD.nodes.size) == status)[0])


def accepted(interface, old, states, residuals=(0.0, 0.0), target=None, tries=2):
    """Number of the iterate that the solver accepts; it keeps its displacements, which are its own here."""
    states = [replace(state, u=state.u.copy()) for state in states]
    script = Script(states, residuals)
    limits = Limits(TOLERANCE, Strategy(iterations=tries))
    target = target or Target.held(old.bone, 0.0)
    found = Equilibrium(script, interface, NoTraction(), limits).step(old, target)
    return next(k for k, state in enumerate(states) if state.u is found.u)


def shifted(state, where, change, axis):
    """The state with one node displaced."""
    u = state.u.copy()
    u[PAD.nodes[where], axis] += change
    return replace(state, u=u)


def pushed(state, where, change, axis):
    """The state with one contact force changed."""
    force = state.contact_force.copy()
    force[where, axis] += change
    return replace(state, contact_force=force)
