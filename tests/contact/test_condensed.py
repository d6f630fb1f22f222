"""A linear contact step against the equations it solves, written out for a random condensed tangent."""

from dataclasses import replace

import numpy as np
import pytest

from evfem.contact import condensed
from evfem.contact.byforce import ByForce
from evfem.contact.condensed import (
    Candidates,
    CondensedTangent,
    ExtraUnknown,
    LinearContactStep,
)
from evfem.contact.signorini import (
    BACKWARD,
    FORWARD,
    OPEN,
    STICK,
    ContactNotSolved,
    Unstable,
)
from evfem.surface.pad import SurfaceState
from evfem.terms.foundation import BelowCandidates
from evfem.tissue.kernels.blocks import contact_loop

K = 5


@pytest.fixture(autouse=True, params=["compiled", "numpy"])
def twin(request, monkeypatch):
    """Everything here holds of both."""
    if request.param == "numpy":
        monkeypatch.setattr(condensed, "contact_loop", lambda: None)


def tangent(rng, coupling=0.0):
    """A random SPD matrix on five candidates and the bone, and an unsymmetric coupling of candidates."""
    A = rng.normal(size=(2 * K + 2, 2 * K + 2))
    schur = 4.0 * np.eye(2 * K + 2) + 0.3 * A @ A.T
    between = coupling * rng.normal(size=(2 * K, 2 * K))
    return schur, between, CondensedTangent.make(schur, between if coupling else None)


def candidates(rng, curved, **changes):
    """Nodes of every status over a surface, their forces in the cone, gaps that are nearly closed."""
    status = np.array([STICK, FORWARD, BACKWARD, STICK, OPEN])
    mu, normal = np.full(K, 0.4), rng.uniform(2.0, 3.0, K)
    shear = np.choose(status, [0.0, 0.1, -0.4, 0.4]) * normal
    force = np.where((status == OPEN)[:, None], 0.0, np.stack([normal, shear], axis=1))
    slope, curvature = (curved * rng.uniform(-0.5, 0.5, (2, K))) if curved else np.zeros((2, K))
    surface = SurfaceState(
        np.where(status == OPEN, 0.5, 1e-3) * rng.uniform(0.5, 1.0, K),
        slope[:, None],
        curvature[:, None, None],
    )
    zero = np.zeros(K)
    known = Candidates(
        surface=surface,
        slip=np.choose(status, [0.0, 0.0, 0.2, -0.2])[:, None],
        force=force,
        status=status,
        friction=mu,
        interface_compliance=np.zeros((K, 2)),
        negative_stiffness=zero,
        gain_on_closing=zero,
        friction_slope=zero[:, None],
    )
    return replace(known, **changes)


def axes_of(surface):
    angle = np.arctan(surface.slope[:, 0])
    normal = np.stack([-np.sin(angle), np.cos(angle)], axis=1)
    return normal, np.stack([np.cos(angle), np.sin(angle)], axis=1)


def pushed(step, found):
    """Forces (2 c,) on the candidates beyond the present ones: new contact forces on today's axes, what the
    present ones turn into on a curved profile, and how slipping friction changes along a ramp.
    """
    known, moved = step.candidates, found.moved.reshape(-1, 2)
    normal, tangent = axes_of(known.surface)
    on_axes = found.force[:, :1] * normal + found.force[:, 1:] * tangent
    turning = known.surface.curvature[:, 0, 0] / (1.0 + known.surface.slope[:, 0] ** 2)
    angle = turning * moved[:, 0]  # d atan(h')
    turned = angle[:, None] * (known.force[:, 1:] * normal - known.force[:, :1] * tangent)
    against = np.where(known.status == FORWARD, -1.0, np.where(known.status == BACKWARD, 1.0, 0.0))
    rougher = against * known.friction_slope[:, 0] * moved[:, 0] * known.force[:, 0]
    rougher[found.status != OPEN] = 0.0  # it is in the force
    return (on_axes + turned + rougher[:, None] * tangent).ravel()


def residuals(step, schur, between, found):
    """What the solution leaves of the balance of the candidates, and of the bone along the unknowns' axes."""
    known = step.candidates
    normal, tangent = axes_of(known.surface)
    present = (known.force[:, :1] * normal + known.force[:, 1:] * tangent).ravel()
    extra = found.extra
    pushes = np.array([unknown.push for unknown in step.unknowns]).reshape(-1, 2 * K + 2)
    all_of = np.concatenate([found.moved, step.bone])
    right = step.residual + extra @ pushes
    nodes = (schur @ all_of)[:-2] - between @ found.moved - right[:-2] + present - pushed(step, found)
    bone = [((schur @ all_of) - right)[unknown.axis - 2] - unknown.force for unknown in step.unknowns]
    return nodes, np.array(bone)


def laws(step, found):
    """Violation of Signorini's and Coulomb's laws in the new state, friction counted on today's
    axes, its coefficient at the new place for today's forces.
    """
    known = step.candidates
    normal, tangent = axes_of(known.surface)
    moved = found.moved.reshape(-1, 2)
    gap = known.surface.normal_gap + np.sum(normal * moved, axis=1)
    gap = gap + known.interface_compliance[:, 0] * found.force[:, 0]
    slip = (
        known.slip[:, 0]
        + np.sum(tangent * moved, axis=1)
        + known.interface_compliance[:, 1] * found.force[:, 1]
    )
    pressing, shear = found.force.T
    limit = known.friction * pressing
    rougher = known.friction_slope[:, 0] * moved[:, 0] * known.force[:, 0]
    limit = limit + np.where((known.status >= FORWARD) & (found.status != OPEN), rougher, 0.0)
    return max(
        (-pressing).max(),
        (-gap).max(),
        np.abs(gap * pressing).max(),
        (np.abs(shear) - limit).max(),
        np.abs(slip[found.status == STICK]).max(initial=0.0),
        np.abs(shear + limit)[found.status == FORWARD].max(initial=0.0),
        np.abs(shear - limit)[found.status == BACKWARD].max(initial=0.0),
    )


def check(step, schur, between):
    found = step.solve()
    nodes, bone = residuals(step, schur, between, found)
    np.testing.assert_allclose(nodes, 0.0, atol=1e-10)
    np.testing.assert_allclose(bone, 0.0, atol=1e-10)
    assert laws(step, found) < 1e-10
    return found


def step_of(rng, curved, coupling=0.0, unknowns=(), **changes):
    schur, between, body = tangent(rng, coupling)
    residual = rng.normal(size=2 * K + 2)
    bone = np.array([0.02, 0.0 if unknowns else -0.03])
    known = candidates(rng, curved, **changes)
    extra = {
        "force": ExtraUnknown(-schur[:, -1], 1, -6.0),
        "voltage": ExtraUnknown(rng.normal(size=2 * K + 2), 0, 0.5),
    }
    step = LinearContactStep(body, known, residual, bone, tuple(extra[name] for name in unknowns))
    return step, schur, between


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("curved", [0.0, 1.0], ids=["flat", "curved"])
@pytest.mark.parametrize("coupling", [0.0, 0.2], ids=["alone", "coupled"])
def test_candidates_and_bone_are_in_balance(seed, curved, coupling):
    step, *matrices = step_of(np.random.default_rng(seed), curved, coupling)
    found = check(step, *matrices)
    assert (found.status != OPEN).any()


@pytest.mark.parametrize("seed", [0, 1, 2, 4])
@pytest.mark.parametrize("curved", [0.0, 1.0], ids=["flat", "curved"])
@pytest.mark.parametrize("unknowns", [("force",), ("voltage",), ("force", "voltage")])
def test_prescribed_forces_are_reached_on_any_profile(seed, curved, unknowns):
    """The forces that turn with the profile count in the balance of the bone as in that of the nodes."""
    step, *matrices = step_of(np.random.default_rng(seed), curved, 0.1, unknowns)
    found = check(step, *matrices)
    assert found.extra.size == len(unknowns)
    assert (found.status != OPEN).any()


def test_friction_that_grows_along_the_way_is_felt():
    rng = np.random.default_rng(3)
    step, *matrices = step_of(rng, 1.0, 0.0, ("force",), friction_slope=rng.uniform(0.5, 1.0, (K, 1)))
    check(step, *matrices)


@pytest.mark.parametrize("own", [3.0, -3.0])
def test_friction_that_rises_with_the_slip_holds_whatever_the_own_compliance(own):
    """That of a squeezed pad, which only its contact holds, is negative; what falls is left out where
    the tissue does not hold it.
    """
    step, *_ = step_of(np.random.default_rng(0), 0.0, 0.0)
    rising = replace(step.candidates, status=np.full(K, FORWARD), slip_stiffness=np.full(K, 0.5))
    np.testing.assert_allclose(rising.follower_rate(np.full((K, 1), own))[:, 1, 0], -0.5, rtol=1e-14)
    falling = replace(rising, slip_stiffness=np.full(K, -0.5))
    left = 0.0 if own > 0.0 else 0.5
    np.testing.assert_allclose(falling.follower_rate(np.full((K, 1), own))[:, 1, 0], left, rtol=1e-14)


def test_steep_friction_of_soft_tissue_balances_near_the_equilibrium():
    """Tissue yields by 1e3 mm per N/mm, friction rises by 1e3 N/mm per mm of slip: of a free motion of
    1 mm in which forces are found, and not their changes, 1e-8 N/mm would be left.
    """
    rng = np.random.default_rng(5)
    step, schur, between = step_of(rng, 0.0, 0.0)
    status = np.array([STICK, FORWARD, FORWARD, STICK, FORWARD])
    shear = np.where(status == FORWARD, -0.4, 0.1)
    schur = 1e-3 * schur
    known = replace(
        step.candidates,
        surface=SurfaceState(np.zeros(K), np.zeros((K, 1)), np.zeros((K, 1, 1))),
        status=status,
        force=1e-3 * np.stack([np.ones(K), shear], axis=1),
        slip=np.where(status == FORWARD, 1e-3, 0.0)[:, None],
        slip_stiffness=np.where(status == FORWARD, 1e3, 0.0),
        cohesion=np.zeros(K),
    )
    body, still = CondensedTangent.make(schur, None), 1e-10 * rng.normal(size=2 * K + 2)
    step = replace(step, body=body, candidates=known, residual=still, bone=np.zeros(2))
    found = step.solve()
    assert found.status.tolist() == status.tolist()
    nodes, _ = residuals(step, schur, between, found)
    np.testing.assert_allclose(nodes, 0.0, atol=1e-12)


@pytest.mark.parametrize("unknowns", [(), ("force",)])
def test_an_interface_that_yields_adds_its_own_way(unknowns):
    compliance = np.random.default_rng(4).uniform(0.01, 0.1, (K, 2))
    step, *matrices = step_of(np.random.default_rng(1), 1.0, 0.0, unknowns, interface_compliance=compliance)
    check(step, *matrices)


def test_a_node_that_was_far_from_contact_does_not_penetrate():
    """An open node is no part of the first contact problem; pushed down by the others it joins."""
    joined = 0
    for seed in range(8):
        rng = np.random.default_rng(seed)
        step, *matrices = step_of(rng, 0.0)
        down = np.zeros(2 * K + 2)
        down[2 * K - 1] = -4.0
        # free to fall but for what the present forces hold: only contact stops it
        found = check(replace(step, residual=step.residual + down), *matrices)
        joined += found.status[-1] != OPEN
    assert joined > 0


@pytest.mark.parametrize("seed", range(4))
def test_nodes_and_bone_feel_how_the_attraction_changes(seed):
    """Open nodes by their negative stiffness times the change of their gap, closed ones by the gain."""
    rng = np.random.default_rng(seed)
    gain, stiffness = rng.uniform(0.5, 1.0, K), rng.uniform(0.3, 0.6, K)
    attracted = {"gain_on_closing": gain, "negative_stiffness": stiffness}
    step, *matrices = step_of(rng, 0.0, 0.0, ("force",), **attracted)
    found = step.solve()
    nodes, bone = residuals(step, *matrices, found)
    weaker = np.where(found.status == OPEN, stiffness * found.moved[1::2], -gain)
    np.testing.assert_allclose(nodes.reshape(-1, 2), np.stack([0.0 * weaker, weaker], axis=1), atol=1e-10)
    np.testing.assert_allclose(bone, 0.0, atol=1e-10)
    assert laws(step, found) < 1e-10
    assert (found.status == OPEN).any()
    assert (found.status != OPEN).any()


@pytest.mark.parametrize("seed", range(3))
def test_crests_that_push_harder_than_the_body_holds_have_no_solution(seed):
    crests = candidates(np.random.default_rng(seed), 1.0).surface
    held, lost = (
        step_of(
            np.random.default_rng(seed), 1.0, surface=replace(crests, curvature=np.full((K, 1, 1), curvature))
        )
        for curvature in (-0.1, -5.0)
    )
    check(*held)
    with pytest.raises(Unstable):
        lost[0].solve()


@pytest.mark.parametrize("rounding", [1e-15, 0.0, -1e-15])
def test_a_body_that_nothing_holds_falls_under_its_load_whatever_the_rounding(rounding):
    """A node on a spring to the bone, above the surface: its row of the balance is zero in exact numbers."""
    spring = np.kron([[1.0, -1.0], [-1.0, 1.0]], np.diag([1.0, 2.0]))
    known, push = candidates(np.random.default_rng(0), 0.0)[np.array([4])], -spring[:, -1]
    push[-1] += rounding
    body, load = CondensedTangent.make(spring, None), (ExtraUnknown(push, 1, -0.2),)
    found = LinearContactStep(body, known, np.zeros(4), np.zeros(2), load).solve()
    np.testing.assert_allclose(found.force, [[0.2, 0.0]], atol=1e-9)
    np.testing.assert_allclose(found.extra, -known.surface.gap - 0.1, rtol=1e-9)


def rough(rng):
    """Gains, losses and present forces of the attraction between rough faces."""
    return ByForce(rng.uniform(0.0, 0.4, (K, 2)), rng.uniform(0.0, 0.1, (K, 2)), rng.uniform(1.0, 2.0, K))


#: what may act on the candidates, random numbers of it
ACTS = {
    "nothing": lambda rng: {},
    "attraction": lambda rng: {
        "negative_stiffness": rng.uniform(0.0, [0.5, 0.5, 0.5, 0.5, 9.0]),  # an open node may snap
        "gain_on_closing": rng.uniform(0.0, 1.0, K),
    },
    "rough faces": lambda rng: {"negative_stiffness": rng.uniform(0.0, 0.5, K), "by_force": rough(rng)},
    "cohesion": lambda rng: {
        "cohesion": rng.uniform(0.0, 0.5, K),
        "slip_stiffness": rng.uniform(0.0, 0.5, K),
    },
    "penalties": lambda rng: {"interface_compliance": rng.uniform(0.01, 0.1, (K, 2))},
    "no friction": lambda rng: {"friction": np.zeros(K)},
    "ramp": lambda rng: {"friction_slope": rng.uniform(-0.5, 0.5, (K, 1))},
}


def solved(step, monkeypatch, name, put):
    """The solution with a part of the module or class replaced; None where there is none."""
    with monkeypatch.context() as patch:
        patch.setattr(name, put)
        try:
            return step.solve()
        except ContactNotSolved:
            return None


def undecided(*_):
    raise ContactNotSolved("the other twin was to decide")


@pytest.mark.parametrize("twin", ["compiled"], indirect=True)
@pytest.mark.parametrize("unknowns", [(), ("force",), ("force", "voltage")])
@pytest.mark.parametrize("acts", ACTS)
def test_compiled_contact_is_the_twin_of_the_other(monkeypatch, twin, acts, unknowns):
    """The same statuses by as many solves, forces and motions to rounding, or none in both."""
    decided, here = 0, "evfem.contact.condensed."
    for seed in range(12):
        rng = np.random.default_rng(seed)
        step, *_ = step_of(rng, 1.0, 0.1, unknowns, **ACTS[acts](rng))
        if seed % 2:
            yields = np.diag(rng.uniform(0.0, 0.1, 2 * K))
            step = replace(step, below=BelowCandidates(yields, 0.01 * rng.normal(size=2 * K)))
        slow = solved(step, monkeypatch, here + "contact_loop", lambda: None)
        fast = solved(step, monkeypatch, here + "LinearContactStep._settled", undecided)
        if fast is None:
            continue
        decided += 1
        assert (fast.solves, fast.status.tolist()) == (slow.solves, slow.status.tolist())
        for name in ("moved", "force", "extra"):
            np.testing.assert_allclose(getattr(fast, name), getattr(slow, name), rtol=1e-9, atol=1e-11)
    assert decided > 3


@pytest.mark.parametrize("wrong", range(6))
@pytest.mark.parametrize("twin", ["compiled"], indirect=True)
def test_compiled_contact_refuses_arrays_of_other_sizes(wrong, twin):
    sizes, marks = [(4, 4), (4, 1), (2, 20), (0, 6), (2, 2), (16,)], 4
    arrays = [np.zeros(size, np.int32 if i == marks else float) for i, size in enumerate(sizes)]
    settle = contact_loop()
    assert settle(2, 0, False, 1e-12, 0.9, 0.1, tuple(arrays)) == 1  # of no node, as none is near
    arrays[wrong] = np.zeros(arrays[wrong].size + 1, arrays[wrong].dtype)
    with pytest.raises(ValueError, match="an array of"):
        settle(2, 0, False, 1e-12, 0.9, 0.1, tuple(arrays))
