"""Orders of elimination against separators that are known, a published bound and minimum degree."""

import numpy as np
import pytest
import scipy.sparse as sparse
from scipy.sparse.linalg import splu
from tools.grids import box

import evfem as ev
from evfem.tissue.kernels.blocks import sparse_cholesky
from evfem.tissue.pattern import Pattern


def with_bone(cells, held):
    """The cells with the nodes `held` as one, the last."""
    number = np.full(cells.max() + 1, -1)
    number[np.setdiff1d(np.arange(number.size), held)] = np.arange(number.size - held.size)
    number[held] = number.size - held.size
    return number[cells]


def order_of(cells):
    """The nodes in order of elimination."""
    return Pattern(cells, 1).elimination_order


def filled(cells, order):
    """Entries of the Cholesky factor, counted by elimination of a dense matrix."""
    place = np.argsort(order)[cells]
    there = np.eye(order.size, dtype=bool)
    there[place[:, :, None], place[:, None, :]] = True
    for i in range(order.size):
        below = i + 1 + np.flatnonzero(there[i + 1 :, i])
        there[np.ix_(below, below)] = True
    return int(np.tril(there).sum())


CASES = {
    "one cell": np.arange(40)[None],
    "one node": np.array([[0]]),
    "a node in no cell": np.array([[0, 2]] * 3),
    "far apart": np.concatenate([100 * i + box(5, 5)[0] for i in range(3)]),
    "a chain": np.stack([np.arange(999), np.arange(1, 1000)], axis=1),
    "at random": np.random.default_rng(2).integers(0, 300, (500, 4)),
    "grid": box(17, 13)[0],
    "in space": box(5, 6, 7)[0],
    "with a bone": with_bone(box(9, 9)[0], np.arange(10)),
}


@pytest.mark.parametrize("case", CASES)
def test_an_order_has_every_unknown_once_those_of_a_node_together(case):
    """Whatever hangs together, or does not; the last node comes last."""
    for dim in (1, 2, 3):
        pattern = Pattern(CASES[case], dim)
        order = pattern.elimination_order.reshape(-1, dim)
        np.testing.assert_array_equal(np.sort(order.ravel()), np.arange(pattern.size))
        np.testing.assert_array_equal(order - order[:, :1], np.broadcast_to(np.arange(dim), order.shape))
        assert (order[:, 0] % dim == 0).all()
        assert order[-1, -1] == pattern.size - 1


def test_the_first_separator_is_the_smallest():
    """Of two blocks joined by a neck of one cell: the four nodes of one of its sections."""
    cells, places = box(5, 5, 16)
    centre = places[cells].mean(axis=1)
    neck = (centre[:, 2] > 5) & (centre[:, 2] < 10)
    cells = cells[~neck | ((centre[:, 0] == 1.5) & (centre[:, 1] == 3.5))]
    seen, cells = np.unique(cells, return_inverse=True)
    cells = cells.reshape(-1, 8) + (seen.size - 1 - cells.max())
    last = places[seen][order_of(np.append(cells, [[seen.size] * 8], axis=0))[-5:-1]]
    assert np.unique(last[:, 2]).size == 1
    assert 5 <= last[0, 2] <= 10
    assert sorted(map(tuple, last[:, :2])) == [(1, 3), (1, 4), (2, 3), (2, 4)]


def test_fill_of_a_square_grid_grows_as_george_proved():
    """With n^2 log n for n^2 nodes (doi:10.1137/0710032), row by row with n^3: when n doubles, entries of a
    column grow by as many as the time before, by rows by twice as many.
    """
    columns = []
    for n in (16, 32, 64):
        cells, _ = box(n - 1, n - 1)
        columns.append([filled(cells, order) / n**2 for order in (order_of(cells), np.arange(n * n))])
    growth = np.diff(columns, axis=0)
    np.testing.assert_allclose(growth[1] / growth[0], [1.0, 2.0], rtol=0.2)


def test_fill_of_a_fingertip_is_less_than_by_minimum_degree():
    """SuperLU's ordering on the graph of nodes, of which the bone's are one; both counted by its factors."""
    mesh = ev.Fingertip(resolution="coarse", ridges=False).mesh()
    cells = with_bone(mesh.cells, mesh.node_sets["bone"])
    of = np.repeat(np.arange(len(cells)), cells.shape[1])
    joins = sparse.csc_matrix((np.full(cells.size, 1e-3), (of, cells.ravel())))
    graph = (joins.T @ joins + sparse.eye(joins.shape[1])).tocsc()
    order, entries = order_of(cells), []
    for matrix, spec in ((graph, "MMD_AT_PLUS_A"), (graph[order][:, order].tocsc(), "NATURAL")):
        options = {"SymmetricMode": True, "Equil": False}
        entries.append(splu(matrix, permc_spec=spec, diag_pivot_thresh=0.0, options=options).L.nnz)
    assert entries[1] < 0.7 * entries[0]


@pytest.mark.parametrize(
    ("n", "cells", "count"), [(2, [0, 1, 2], 3), (2, [0, 3], 3), (2, [-1, 0], 3), (0, [0, 1], 3), (2, [], 0)]
)
def test_what_are_no_cells_is_refused(n, cells, count):
    kernel, _ = sparse_cholesky()
    with pytest.raises(IndexError, match="no cells of"):
        kernel.dissect(2, n, np.array(cells, dtype=np.int32), np.empty(count, dtype=np.int32))
