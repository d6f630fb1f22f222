"""Compiled Cholesky factors against SuperLU, and what they refuse."""

import numpy as np
import pytest
from tools.grids import box

from evfem.common.arrays import mkl
from evfem.newton import condensation
from evfem.newton.condensation import Cholesky, SuperLU, make_condensation, other_solver
from evfem.tissue.kernels.blocks import sparse_cholesky
from evfem.tissue.pattern import Pattern


def beside(*divisions):
    """A grid of cells in the plane or in space, twice, with as many unknowns a node as it has dimensions, and
    entries of random positive definite cell matrices.
    """
    cells, places = box(*divisions)
    pattern = Pattern(np.concatenate([cells, cells + len(places)]), dim := len(divisions))
    roots = np.random.default_rng(3).normal(size=(2 * len(cells), dim * cells.shape[1], dim * cells.shape[1]))
    data = pattern.zeros()
    pattern.add(roots @ roots.swapaxes(1, 2), np.arange(len(roots)), data)
    return pattern, pattern.finish(data)


@pytest.mark.parametrize("divisions", [(17, 17), (3, 4, 5)], ids=["plane", "space"])
@pytest.mark.parametrize("kept", [[0, 5, 700], range(300, 420), [9]], ids=["few", "many", "one"])
def test_cholesky_factors_are_those_of_superlu(divisions, kept):
    """Supernodes of all sizes."""
    pattern, upper = beside(*divisions)
    rng, kept = np.random.default_rng(4), np.array(kept, dtype=np.int64)
    b, x = rng.normal(size=pattern.size), rng.normal(size=kept.size)
    found = []
    for back_end in (Cholesky, SuperLU):
        factor = back_end(pattern, kept)
        factor.factorise(upper.copy())
        state, condensed = factor.forward(b)
        found.append([factor.schur, condensed, factor.backward(state, x)])
    assert np.abs(found[1][2]).max() > 0.0
    for own, other in zip(*found, strict=True):
        np.testing.assert_allclose(own, other, rtol=1e-9, atol=1e-12 * np.abs(other).max(initial=0.0))


@pytest.mark.parametrize("with_mkl", [pytest.param(True, marks=pytest.mark.pardiso), False])
def test_an_indefinite_interior_goes_to_another_solver(with_mkl, monkeypatch):
    """To PARDISO, else to SuperLU in the same order; and back to our own factors with the next matrix."""
    if not with_mkl:
        monkeypatch.setattr(condensation, "mkl", lambda: None)
    pattern, definite = beside(2, 2, 2)
    kept, turned = np.array([7, 3, 150]), definite.copy()
    turned[pattern.diagonal[40]] *= -1.0
    own, twin = Cholesky(pattern, kept), SuperLU(pattern, kept)
    for upper, positive in ((definite, True), (turned, False), (definite, True)):
        for factor in (own, twin):
            factor.factorise(upper.copy())
        assert own._definite is positive
        scale = np.abs(twin.schur).max()
        np.testing.assert_allclose(own.schur, twin.schur, rtol=1e-9, atol=1e-12 * scale)
        b, x = np.arange(1.0, pattern.size + 1), np.array([1.0, -2.0, 3.0])
        solved = [factor.backward(factor.forward(b)[0], x) for factor in (own, twin)]
        np.testing.assert_allclose(*solved, rtol=1e-8, atol=1e-10 * np.abs(solved[1]).max())
    assert type(own._indefinite) is (condensation.Pardiso if with_mkl else SuperLU)


@pytest.mark.parametrize(("dim", "threads"), [(2, 1), (2, 2), (3, 1), (3, 2)])
def test_own_factors_come_first_on_one_thread(dim, threads):
    """Two cells in the plane or in space."""
    pattern, kept = Pattern(box(*[2, 1, 1][:dim])[0], dim), np.arange(dim)
    usual = make_condensation(pattern, kept, threads)
    assert isinstance(usual, Cholesky) is (threads == 1 or mkl() is None)
    assert isinstance(make_condensation(pattern, np.arange(pattern.size)), SuperLU)
    with other_solver() as there:
        assert there
        assert type(make_condensation(pattern, kept, threads)) is not type(usual)


@pytest.mark.parametrize(
    ("indptr", "indices", "order"),
    [([0, 2, 3], [0, 2, 1], [0, 1]), ([0, 2, 3], [0, 1, 0], [0, 1]), ([0, 2, 3], [0, 1, 1], [1, 1])],
)
def test_a_plan_of_what_is_no_upper_triangle_is_refused(indptr, indices, order):
    kernel, algebra = sparse_cholesky()
    arrays = tuple(np.array(one, dtype=np.int32) for one in (indptr, indices, order))
    with pytest.raises(IndexError, match="no upper triangle"):
        kernel.analyse(2, 1, 3, False, arrays, algebra["d"])
