"""Compiled Cholesky factors against SuperLU, and what they refuse."""

import numpy as np
import pytest

from evfem.common.arrays import mkl
from evfem.newton.condensation import Cholesky, SuperLU, make_condensation, other_solver
from evfem.tissue.kernels.blocks import sparse_cholesky
from evfem.tissue.pattern import Pattern


@pytest.mark.parametrize("kept", [[0, 5, 700], range(300, 420), [9]], ids=["few", "many", "one"])
def test_cholesky_factors_are_those_of_superlu(kept):
    """A grid of cells beside another one, with supernodes of all sizes, on two unknowns a node."""
    rng, n = np.random.default_rng(3), 18
    i, j = np.divmod(np.arange(n * (n - 1)), n - 1)
    left = (n * i + j)[i < n - 1]
    grid = np.stack([left, left + 1, left + n, left + n + 1], axis=1)
    pattern = Pattern(np.concatenate([grid, grid + n * n]), 2)
    roots = rng.normal(size=(2 * len(grid), 8, 8))
    data = pattern.zeros()
    pattern.add(roots @ roots.swapaxes(1, 2), np.arange(len(roots)), data)
    upper, kept = pattern.finish(data), np.array(kept, dtype=np.int64)
    b, x = rng.normal(size=pattern.size), rng.normal(size=kept.size)
    found = []
    for back_end in (Cholesky, SuperLU):
        factor = back_end(pattern, kept)
        factor.factorise(upper)
        state, condensed = factor.forward(b)
        found.append([factor.schur, condensed, factor.backward(state, x)])
    assert np.abs(found[1][2]).max() > 0.0
    for own, other in zip(*found, strict=True):
        np.testing.assert_allclose(own, other, rtol=1e-9, atol=1e-9 * np.abs(other).max(initial=0.0))


@pytest.mark.parametrize(("nodes", "single", "own"), [(9, True, True), (9, False, False), (27, True, False)])
def test_own_factors_come_first_where_they_are_faster(nodes, single, own):
    """Two cells with 9 nodes in the plane, or with 27 in space."""
    cells, dim = np.stack([np.arange(nodes), np.arange(nodes) + nodes // 3]), 2 + nodes // 27
    pattern, kept = Pattern(cells, dim), np.arange(dim)
    usual = make_condensation(pattern, kept, single=single)
    assert isinstance(usual, Cholesky) is (own or mkl() is None)
    assert isinstance(make_condensation(pattern, np.arange(pattern.size), single=single), SuperLU)
    with other_solver() as there:
        assert there
        assert type(make_condensation(pattern, kept, single=single)) is not type(usual)


@pytest.mark.parametrize(
    ("indptr", "indices", "order"),
    [([0, 2, 3], [0, 2, 1], [0, 1]), ([0, 2, 3], [0, 1, 0], [0, 1]), ([0, 2, 3], [0, 1, 1], [1, 1])],
)
def test_a_plan_of_what_is_no_upper_triangle_is_refused(indptr, indices, order):
    kernel, algebra = sparse_cholesky()
    arrays = tuple(np.array(one, dtype=np.int32) for one in (indptr, indices, order))
    with pytest.raises(IndexError, match="no upper triangle"):
        kernel.analyse(2, 1, 3, False, arrays, algebra["d"])
