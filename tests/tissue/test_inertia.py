"""Tissue with mass in time: order of its steps, free oscillation, energies, and impact on a rigid wall."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import eigh, expm
from tools.grids import rectangle, solve, tangent_of
from tools.meshes import block

import evfem as ev
from evfem.newton.control import Force, GivenVoltage, Target
from evfem.simulation.model import make_model
from evfem.tissue.dynamics import Difference, Dynamics, make_dynamics
from evfem.tissue.laws import NeoHookean
from evfem.tissue.weakform import Tissue

SMALL = 1e-7  # mm: so small that everything is linear
BRANCHES = ((0.8, 0.3), (0.5, 2.0))
KINDS = {"mass": (0.0, ()), "viscous": (0.2, ()), "branches": (0.0, BRANCHES), "both": (0.1, BRANCHES)}


class Chain:
    """A block of E = density = 1, held on top, that oscillates as its first mode from rest at `SMALL`."""

    def __init__(self, viscosity=0.0, relaxation=(), size=SMALL):
        self.space = space = rectangle("q1", (2, 3), (1.0, 2.0))
        self.still = np.zeros((space.size, 2))
        self.terms = {"viscosity": viscosity, "relaxation": relaxation}
        law = NeoHookean(E=1.0, nu=0.3, density=1.0)
        self.tissue = Tissue(space, {"lower": law})
        self.smallest_J = self.tissue.smallest_J
        self.dynamics = self._made("inertial", viscosity, relaxation)
        self.free = np.ones(self.still.shape, dtype=bool)
        self.free[space.mesh.node_sets["top"]] = False
        K, M = self._free(self.tissue), np.kron(self.dynamics._inertia.toarray(), np.eye(2))
        self.K, self.M = K, M[np.ix_(self.free.ravel(), self.free.ravel())]
        self.B = [self._branch(share) for share, _ in relaxation]
        squares, modes = eigh(self.K + sum(self.B), self.M)
        self.omega = np.sqrt(squares[0])
        self.u = self.still.copy()
        self.u[self.free] = size * modes[:, 0] / np.abs(modes[:, 0]).max()

    def _made(self, name, viscosity, relaxation):
        law = NeoHookean(E=1.0, nu=0.3, density=1.0, relaxation=relaxation)
        return make_dynamics(self.space, {"lower": law}, SimpleNamespace(viscosity=viscosity), name)

    def _free(self, term):
        free = self.free.ravel()
        return tangent_of(self.space, self.still, term).toarray()[np.ix_(free, free)]

    def _branch(self, share):
        """Stiffness of a branch that has no time to relax."""
        branch = self._made("viscous", 0.0, ((share, 1e12),))
        branch.begin(self._at_rest(branch, self.still), 1e-3)
        return self._free(branch)

    @staticmethod
    def _at_rest(term, u):
        """What a step from rest at u begins with."""
        return SimpleNamespace(u=u, memory=term.memory(SimpleNamespace(u=u)))

    def forces(self, u):
        return self.tissue.forces(u) + self.dynamics.forces(u)

    def run(self, steps, until):
        """The state after steps of these seconds in turn."""
        term, lost, time = self.dynamics, 0.0, 0.0
        state = self._at_rest(term, self.u)
        system = SimpleNamespace(
            space=self.space, smallest_J=self.smallest_J, forces=self.forces, terms=(self.tissue, term)
        )
        while time < until * (1.0 - 1e-12):
            for h in steps:
                term.begin(state, h)
                new = SimpleNamespace(u=solve(system, state.u, self.free))
                lost += term.dissipation(state, new, h)
                new.memory = term.accept(state, new)
                state, time = new, time + h
        self.lost = lost
        return state

    def energy(self, state):
        return self.tissue.energy(state.u) + self.dynamics.stored(state) + self.dynamics.kinetic(state)

    def exact(self, until):
        """Free displacements at that time: M a + C v + K u + sum of B (u - w) = 0, w' = (u - w)/tau."""
        n, relaxation = len(self.K), self.terms["relaxation"]
        C, B = np.zeros_like(self.K), self.B
        if self.terms["viscosity"]:
            damper = Dynamics(self.space, self.dynamics.viscosity, None)
            damper.begin(self._at_rest(damper, self.still), 1.0)
            C = self._free(damper)
        A = np.zeros(((2 + len(B)) * n,) * 2)
        inverse, one = np.linalg.inv(self.M), np.eye(n)
        A[:n, n : 2 * n] = one
        A[n : 2 * n, : 2 * n] = -inverse @ np.hstack([self.K + sum(B), C])
        for i, (b, (_, tau)) in enumerate(zip(B, relaxation, strict=True)):
            own = slice((2 + i) * n, (3 + i) * n)
            A[n : 2 * n, own] = inverse @ b
            A[own, :n], A[own, own] = one / tau, -one / tau
        start = np.zeros(len(A))
        start[:n] = self.u[self.free]
        return (expm(until * A) @ start)[:n]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("pattern", [(1.0,), (0.8, 1.2, 0.7, 1.3)], ids=["even", "uneven"])
def test_the_order_is_two_with_mass_viscosity_and_branches(kind, pattern):
    """Against the exponential of the linear system, in steps of equal and of unequal lengths."""
    chain = Chain(*KINDS[kind])
    until = 2.5 * np.pi / chain.omega
    exact, errors = chain.exact(until), []
    for count in (64, 128):
        u = chain.run([until / count * share for share in pattern], until).u
        errors.append(np.abs(u[chain.free] - exact).max() / SMALL)
    assert errors[1] < 0.01
    assert 3.7 < errors[0] / errors[1] < 4.4


@pytest.mark.parametrize("kind", KINDS)
def test_what_the_steps_lose_beside_viscosity_and_branches_falls_with_the_square(kind):
    """Energy at the begin less energy and dissipations at the end of a period; the step at the start, of
    backward Euler, loses the share (omega h)^2 of what is stored.
    """
    chain, lost = Chain(*KINDS[kind], size=1e-4), []
    moved = chain.u[chain.free]
    begin = 0.5 * moved @ (chain.K + sum(chain.B)) @ moved
    for count in (60, 120):
        end = chain.run([2.0 * np.pi / count / chain.omega], 2.0 * np.pi / chain.omega)
        lost.append(1.0 - (chain.energy(end) + chain.lost) / begin)
    assert 0.0 < lost[0] < 3.0 * (2.0 * np.pi / 60) ** 2
    assert 3.2 < lost[0] / lost[1] < 4.8


@pytest.mark.parametrize("compiled", [True, False])
def test_the_tangent_and_the_potential_are_those_of_the_forces_after_an_uneven_part(compiled):
    """Central differences in one direction; everything that time adds, at finite strain."""
    chain = Chain(0.1, BRANCHES, size=0.1)
    if not compiled:
        chain.dynamics.loops = None
    term, rng = chain.dynamics, np.random.default_rng(2)
    rates = np.stack([rng.normal(size=chain.u.shape) for _ in range(2)])
    kept = term.memory(chain) | {"velocity": 0.3 * rates[0], "rates": 0.1 * rates, "seconds": np.array(0.05)}
    term.begin(SimpleNamespace(u=0.2 * chain.u, memory=kept), 0.07)
    assert term.difference == Difference.over(0.07, 0.05)
    way, eps = rng.normal(size=chain.u.shape), 1e-6
    change = (term.forces(chain.u + eps * way) - term.forces(chain.u - eps * way)) / (2.0 * eps)
    found = (tangent_of(chain.space, chain.u, term) @ way.ravel()).reshape(way.shape)
    np.testing.assert_allclose(found, change, atol=1e-8 * np.abs(change).max())
    held = term.potential(chain, SimpleNamespace(u=chain.u + way), np.array([-eps, eps]))
    power = float(np.sum(term.forces(chain.u) * way))
    assert (held[1] - held[0]) / (2.0 * eps) == pytest.approx(power, rel=1e-7)


def test_the_part_before_counts_up_to_a_ratio_and_not_without_time():
    for step, before in ((0.0, 1.0), (1.0, 0.0), (2.5, 1.0)):
        assert Difference.over(step, before) == Difference()
    # exact for t^2: q = 4 -> 9 -> 16 + 9 at t = 2, 3, 5
    found = Difference.over(2.0, 1.0)
    assert found.share * (25.0 - 9.0) / 2.0 - found.lag * (9.0 - 4.0) == pytest.approx(2.0 * 5.0)


def test_nodes_of_the_pad_have_no_mass_and_the_body_has_all_of_it():
    space = rectangle("q2", (3, 2), (2.0, 1.0), jitter=0.2)
    space.mesh.node_sets["pad"] = pad = space.mesh.node_sets["bottom"]
    law = NeoHookean(E=1.0, nu=0.3, density=3.0)
    term = make_dynamics(space, {"lower": law}, SimpleNamespace(viscosity=0.0), "inertial")
    M = term._inertia.toarray()
    assert not M[pad].any()
    assert M.sum() == pytest.approx(3.0 * 2.0)
    kept = np.setdiff1d(np.arange(space.size), pad)
    assert np.linalg.eigvalsh(M[np.ix_(kept, kept)]).min() > 0.0


class Bar:
    """A bar 10 mm long and 10 mm wide, c = sqrt(E/rho) = 1e4 mm/s, that flies at a rigid wall; time in L/c,
    forces in rho c v times the width.
    """

    SPEED, GAP, ROWS, TIME = 10.0, 1e-3, 40, 1e-3
    FORCE = 1e-9 * 1e4 * SPEED * 10.0

    def __init__(self, share):
        law = ev.NeoHookean(E=0.1, nu=0.0, density=1e-9)
        finger = ev.MeshedFinger(block(1, self.ROWS, 10.0, 10.0), {"tissue": law})
        solver = ev.Solver(element="q1", dynamics="inertial", tolerance=1e-9)
        scene = ev.Scene(finger, ev.Flat(), motion=[ev.Press(force=0.01, steps=1)], solver=solver)
        self.model, self.step = make_model(scene), share / self.ROWS * self.TIME
        equilibrium = self.model.equilibrium
        lowest = float(self.model.mesh.points[:, 1].min())
        state = equilibrium.rest(np.array([0.0, self.GAP - lowest]), 0.0)
        v = np.zeros_like(state.u) - [0.0, self.SPEED]
        self.state = replace(state, last_increment=v * self.step).remembering({"velocity": v})

    def run(self, until):
        """Contact forces and energies after each step."""
        state, body, force, energy = self.state, self.model.body, [], []
        for _ in range(round(until / self.step)):
            target = Target(0.0, Force(0.0), GivenVoltage(0.0), self.step)
            state = self.model.equilibrium.step(state, target)
            force.append(float(state.contact_force[:, 0].sum()))
            energy.append(body.energy(state.u) + body.dynamics.kinetic(state))
        self.state = state
        return np.array(force), np.array(energy)


@pytest.mark.parametrize("share", [1.0, 0.5, 0.25])
def test_a_bar_that_hits_a_wall_is_in_contact_for_two_crossings_and_rebounds(share):
    """Closed form (St Venant): force rho c v on the face from touch to 2 L/c later, then the bar flies off
    at its speed. Steps of so many crossings of a cell.
    """
    bar = Bar(share)
    force, energy = bar.run(2.6 * bar.TIME)
    force, energy = force / bar.FORCE, energy / energy[0]
    time = bar.step / bar.TIME * np.arange(1, len(force) + 1)
    touches = np.flatnonzero(force > 1e-6)
    assert time[touches[[0, -1]]] == pytest.approx([0.1, 2.1], abs=1.1 * share / bar.ROWS)
    assert (np.diff(touches) == 1).all()
    steady = force[(time > 0.3) & (time < 1.9)]
    assert steady.mean() == pytest.approx(1.0, abs=2e-3)
    assert steady.std() < 0.01
    assert energy.max() < 1.0 + 1e-12
    assert energy[-1] > 0.95
    assert bar.state.memory["velocity"][:, 1].mean() / bar.SPEED == pytest.approx(1.0, abs=0.05 * share)
