"""What is said of an iterate that is no equilibrium: numbers put in by hand come out, at the right places."""

import numpy as np
import pytest
from tools.grids import rectangle

from evfem.contact.signorini import BACKWARD, FORWARD, OPEN, STICK
from evfem.newton.state import Balance, State, findings
from evfem.tissue.body import Body
from evfem.tissue.laws import NeoHookean


@pytest.fixture
def body():
    """A unit square of 2 x 2 cells whose upper side is the bone; nodes are numbered along x, then y."""
    space = rectangle("q1", (2, 2))
    space.mesh.node_sets["bone"] = space.mesh.node_sets["top"]
    return Body(space, {"lower": NeoHookean(E=1.0, nu=0.3)})


def described(body, forces, u=None, status=(OPEN,)):
    """Findings for nodal forces {node: (x, y)} and the bone's forces 1e3."""
    zero = np.zeros((body.space.size, 2))
    u = zero if u is None else u
    status = np.array(status)
    pad = np.zeros((status.size, 2))
    state = State(u, pad, status, zero[0], 0.0, pad, zero[0], zero, zero)
    reduced = np.zeros(body.size)
    reduced[body.bone] = 1e3
    for node, force in forces.items():
        reduced[body.unknowns[node]] = force
    return findings(body, state, Balance(reduced, 1.0, state.attraction))


def test_the_three_largest_forces_are_named_in_order_and_the_bones_are_left_out(body):
    text = described(body, {0: (1e-3, 0.0), 1: (0.0, -2e-3), 4: (3e-2, 4e-2), 5: (1e-5, 0.0)})
    expected = "5.0e-02 N/mm at (0.5, 0.5), 2.0e-03 N/mm at (0.5, 0), 1.0e-03 N/mm at (0, 0); contact"
    assert f"out of balance: {expected}" in text
    assert text.count("N/mm") == 3


def test_places_are_current_ones(body):
    u = np.zeros((body.space.size, 2))
    u[4] = [0.125, -0.25]
    assert "1.0e+00 N/mm at (0.625, 0.25)" in described(body, {4: (1.0, 0.0)}, u)


def test_a_force_that_is_no_number_is_the_largest(body):
    text = described(body, {0: (1e6, 0.0), 5: (np.nan, 0.0)})
    assert text.startswith("out of balance: inf N/mm at (1, 0.5), 1.0e+06 N/mm at (0, 0)")
    endless = described(body, {0: (1e6, 0.0), 5: (-np.inf, 0.0)})
    assert endless.startswith("out of balance: inf N/mm at (1, 0.5), 1.0e+06 N/mm at (0, 0)")


def test_statuses_are_counted(body):
    status = [OPEN] * 4 + [STICK] * 3 + [FORWARD] * 2 + [BACKWARD]
    assert "contact: 4 nodes open, 3 stick, 3 slip;" in described(body, {}, status=status)


def test_the_smallest_volume_ratio_is_that_of_the_deformation(body):
    x, y = body.space.mesh.points.T
    u = np.column_stack([0.1 * x, -0.4 * y])  # J = 1.1 x 0.6 everywhere
    assert described(body, {}, u).endswith("smallest J of a cell: 0.66")
    u[4] = [0.0, -0.45]  # the middle node alone goes further down: the cells below it are flatter
    assert float(described(body, {}, u).rsplit(" ", 1)[1]) < 0.66
