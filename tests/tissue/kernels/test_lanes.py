"""Cells in blocks: the layout against plain loops, volumes and gradients against formulae of
another kind.
"""

from decimal import Decimal, localcontext
from fractions import Fraction

import numpy as np
import pytest
from tools.grids import rectangle

from evfem.tissue.kernels.lanes import FAR, LANES, blocked, displacement_gradient, gather, spread, volume

RANDOM = np.random.default_rng(3)


@pytest.mark.parametrize("count", [1, LANES, LANES + 5])
def test_blocks_hold_every_cell_once_and_zeros_after_the_last(count):
    values = 1.0 + RANDOM.random((count, 3, 2))
    blocks = blocked(values)
    assert blocks.shape == (-(-count // LANES), 3, 2, LANES)
    for cell in range(len(blocks) * LANES):
        expected = values[cell] if cell < count else np.zeros((3, 2))
        np.testing.assert_array_equal(blocks[cell // LANES, ..., cell % LANES], expected)
    assert blocked(np.arange(count)).dtype == np.arange(count).dtype


def test_gathering_and_spreading_are_indexing_and_its_transpose():
    space = rectangle("q2", (3, 6))
    u = RANDOM.normal(size=(space.size, 2))
    out, expected = np.ones((space.size, 2)), np.ones((space.size, 2))
    nodes = space.cells.nodes
    for b in range(len(nodes)):
        ue = np.empty((9, 2, LANES))
        gather(u, nodes[b], ue)
        for lane in range(min(LANES, len(space.nodes) - b * LANES)):
            cell = space.nodes[b * LANES + lane]
            np.testing.assert_array_equal(ue[..., lane], u[cell])
            np.add.at(expected, cell, 2.0 * u[cell])
        ue[..., max(0, len(space.nodes) - b * LANES) :] = 0.0
        spread(2.0 * ue, nodes[b], out)
    np.testing.assert_allclose(out, expected, rtol=1e-14)


def test_the_displacement_gradient_is_a_sum_over_nodes():
    ue, gradient, H = (
        RANDOM.normal(size=(6, 2, LANES)),
        RANDOM.normal(size=(6, 2, LANES)),
        np.empty((4, LANES)),
    )
    displacement_gradient(ue, gradient, H)
    expected = np.einsum("nil,njl->ijl", ue, gradient)
    np.testing.assert_allclose(H.reshape(2, 2, LANES), expected, atol=1e-14)


def exact_log_J(H):
    """ln det(1 + H) of the very numbers in H, to 50 digits, rounded once."""
    a, b, c, d = (Fraction(float(h)) for h in H)
    J = (1 + a) * (1 + d) - b * c
    with localcontext() as context:
        context.prec = 60
        return float((Decimal(J.numerator) / Decimal(J.denominator)).ln())


def volumes(H):
    """F^-T (4, L) and ln J (L,) of H (4, k), the last columns repeated."""
    filled = np.concatenate([H, np.repeat(H[:, -1:], LANES - H.shape[1], axis=1)], axis=1)
    inverse, log_J = np.empty((4, LANES)), np.empty(LANES)
    volume(filled, inverse, log_J)
    return inverse[:, : H.shape[1]], log_J[: H.shape[1]]


@pytest.mark.parametrize("size", [1e-12, 1e-6, 1e-2, 0.1, 0.6])
def test_the_logarithm_of_the_volume_keeps_its_digits(size):
    """Error of ln J against 60 digits, in terms of the strains whose rounding it is made of."""
    H = size * RANDOM.uniform(-1.0, 1.0, (4, LANES))
    _, log_J = volumes(H)
    exact = [exact_log_J(column) for column in H.T]
    np.testing.assert_allclose(log_J, exact, rtol=4e-15, atol=2e-15 * size)


def test_the_series_hands_over_where_it_ends():
    """Volume ratios on both sides of the bound and far beyond, each alone in its block."""
    edge = np.sqrt(FAR)
    bound = 2.0 * edge / (1.0 - edge)  # z = e / (2 + e) is the edge here
    for e in (0.999 * bound, 1.001 * bound, -0.28, -0.29, -0.9, -0.999, 3.0, 50.0):
        _, (log_J,) = volumes(np.array([[e], [0.0], [0.0], [0.0]]))
        assert log_J == pytest.approx(np.log1p(e), rel=1e-14), e


def test_one_far_cell_does_not_disturb_its_neighbours():
    H = 1e-3 * RANDOM.uniform(-1.0, 1.0, (4, LANES))
    _, alone = volumes(H)
    H[:, 5] = [2.0, 0.3, -0.1, 0.5]
    _, together = volumes(H)
    near = np.arange(LANES) != 5
    np.testing.assert_allclose(together[near], alone[near], rtol=1e-12)
    assert together[5] == pytest.approx(np.log(3.0 * 1.5 + 0.03), rel=1e-14)


def test_an_inverted_cell_has_no_logarithm():
    H = np.zeros((4, LANES))
    H[0, 3] = -1.5
    _, log_J = volumes(H)
    assert np.isnan(log_J[3])
    assert not log_J[np.arange(LANES) != 3].any()


def test_the_inverse_transposed_is_that_of_linear_algebra():
    H = RANDOM.uniform(-0.4, 0.4, (4, LANES))
    inverse, _ = volumes(H)
    F = np.eye(2) + H.T.reshape(LANES, 2, 2)
    expected = np.linalg.inv(F).swapaxes(1, 2).reshape(LANES, 4).T
    np.testing.assert_allclose(inverse, expected, rtol=1e-13, atol=1e-14)
