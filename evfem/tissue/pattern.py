"""Where the entries of cell matrices go in the upper triangle of one symmetric sparse matrix.

The nodes have dim unknowns each, in runs: node i of the reduced system has dim i ... dim i + dim - 1;
all nodes of the bone are one node of it, the last. So the structure is that of node pairs (i <= j),
found once for the pairs k <= l of a cell's nodes, and the places of their entries follow by counting:
with p_i pairs before those of node i, c_i pairs of its own and (i, j) the t-th of these, entry (a, b)
of the pair has the place

    dim^2 p_i - i dim (dim - 1)/2 + a dim c_i - a (a - 1)/2 + dim t + b - a .

A pair of a node with itself has no entries below the diagonal. Two nodes of the bone are a pair that
counts twice: its entries on the diagonal are gathered apart.
"""

from __future__ import annotations

from functools import cached_property
from itertools import combinations_with_replacement
from typing import Any

import numpy as np

from evfem.common.arrays import Floats, Ints


class Pattern:
    """The upper triangle of a symmetric CSR matrix of `size` rows: `indptr`, `indices` (Z,), the places of
    its `diagonal` (size,), and the `places` (E, P, dim, dim) of the entries of a cell's P = n (n + 1)/2 node
    pairs, in arrays of Z + 1 + dim numbers: what is not stored goes to Z, what counts twice behind it.
    """

    def __init__(self, nodes: Ints, dim: int) -> None:
        """`nodes` (E, n): the cells' nodes by their numbers in the reduced system, from 0 on."""
        self._nodes = nodes = nodes.astype(np.int32, order="C")
        count = int(nodes.max()) + 1
        self.dim, self.size = dim, dim * count
        self._first, self._second = np.triu_indices(nodes.shape[1])
        left, right = nodes[:, self._first], nodes[:, self._second]
        low, high = np.minimum(left, right).ravel(), np.maximum(left, right).ravel()
        alone = np.arange(count, dtype=np.int32)  # a node that no cell has keeps a diagonal
        ends = np.append(low, alone).astype(np.int64), np.append(high, alone)
        pairs, of = np.unique(count * ends[0] + ends[1], return_inverse=True)
        first, second = np.divmod(pairs, count)
        self._pairs: Ints = np.searchsorted(first, np.arange(count + 1)).astype(np.int32)
        self._neighbours: Ints = second.astype(np.int32)
        t = self._fill(self._neighbours)[of[: low.size]].reshape(left.shape)
        self.places: Ints = np.empty((*left.shape, dim, dim), dtype=np.int32)
        self._find_places(left, right, t)

    def _find_places(self, left: Ints, right: Ints, t: Ints) -> None:
        """Fill in the places of the entries of the t-th pairs (E, P) of the nodes `left`, `right`."""
        itself, turned = self._first == self._second, left > right
        twice = (left == right) & ~itself
        own = self._begin(np.minimum(left, right), t)
        for a, b in combinations_with_replacement(range(self.dim), 2):
            upper = lower = self._place(own, a, b)
            if a != b:
                lower = self._place(own, b, a)
                lower[twice] = upper[twice]
                upper, lower = np.where(turned, lower, upper), np.where(turned, upper, lower)
                lower[:, itself] = self.indices.size
            else:
                upper[twice] = self.indices.size + 1 + a
            self.places[..., a, b], self.places[..., b, a] = upper, lower

    def _begin(self, i: Any, t: Any) -> tuple[Any, Any]:
        """Of the t-th node pairs the places of their first entries, and the entries of first rows."""
        dim, before = self.dim, self._pairs[i]
        begin = dim * dim * before - i * (dim * (dim - 1) // 2) + dim * t
        return begin, dim * (self._pairs[i + 1] - before)

    def _place(self, own: tuple[Any, Any], a: int, b: int) -> Any:
        """Places of the entries (a, b) of pairs."""
        begin, row = own
        return begin + a * row + (b - a - a * (a - 1) // 2)

    def _fill(self, second: Ints) -> Ints:
        """Rows, columns, diagonal of the matrix from all pairs (K,), and the number t (K,) of each pair."""
        dim, count = self.dim, self.size // self.dim
        nodes = np.arange(count, dtype=np.int32)
        first = np.repeat(nodes, np.diff(self._pairs))
        t = np.arange(second.size, dtype=np.int32) - self._pairs[first]
        own = self._begin(nodes, 0)
        self.diagonal: Ints = np.stack([self._place(own, a, a) for a in range(dim)], axis=1).ravel()
        entries = dim * dim * second.size - count * (dim * (dim - 1) // 2)
        self.indptr: Ints = np.append(self.diagonal, entries).astype(np.int32)
        self.indices: Ints = np.empty(entries, dtype=np.int32)
        own, apart = self._begin(first, t), second > first
        for a, b in np.ndindex(dim, dim):
            there = slice(None) if a <= b else apart
            self.indices[self._place(own, a, b)[there]] = dim * second[there] + b
        return t

    def zeros(self) -> Floats:
        """What the entries of cell matrices are added to, (Z + 1 + dim,)."""
        return np.zeros(self.indices.size + 1 + self.dim)

    def add(self, matrices: Floats, cells: Ints, data: Floats) -> None:
        """Add symmetric matrices (C, n dim, n dim) of some cells to `data`; a cell may have several."""
        C, n, dim = len(matrices), matrices.shape[1] // self.dim, self.dim
        split = matrices.reshape(C, n, dim, n, dim)
        for a, b in np.ndindex(dim, dim):
            values = split[:, :, a, :, b][:, self._first, self._second]
            data += np.bincount(self.places[cells, :, a, b].ravel(), values.ravel(), data.size)

    def componentwise(self, matrices: Floats) -> Floats:
        """Matrices (E, n, n) of all cells, alike for each component, none between, summed like `zeros`."""
        data, values = self.zeros(), matrices[:, self._first, self._second].ravel()
        for a in range(self.dim):
            data += np.bincount(self.places[..., a, a].ravel(), values, data.size)
        return data

    def finish(self, data: Floats) -> Floats:
        """The upper triangle's entries (Z,) of what has been added up."""
        data[self.diagonal[-self.dim :]] += 2.0 * data[-self.dim :]
        return data[: self.indices.size]

    @cached_property
    def blocks(self) -> Any:
        """The places (B, P, dim, dim, L) as the compiled loops take them, which check them but once."""
        from evfem.tissue.kernels.blocks import blocked, loops

        return loops(self.dim).bounded(blocked(self.places), self.zeros().size)

    @cached_property
    def elimination_order(self) -> Ints:
        """The unknowns in an order of little fill, those of a node together, by nested dissection (compiled,
        `factors/dissection.h`); those of the last node, the bone, come last.
        """
        from evfem.tissue.kernels.blocks import sparse_cholesky

        order = np.empty(self.size // self.dim, dtype=np.int32)
        kernel, _ = sparse_cholesky()
        kernel.dissect(max(self.dim - 1, 1), self._nodes.shape[1], self._nodes, order)
        return np.asarray(self.dim * order[:, None] + np.arange(self.dim)).ravel()

    def full(self, upper: Floats) -> Any:
        """Both triangles as a scipy CSR matrix."""
        import scipy.sparse as sparse

        half = sparse.csr_matrix((upper, self.indices, self.indptr), shape=(self.size, self.size))
        return (half + half.T - sparse.diags(upper[self.diagonal])).tocsr()


class Componentwise:
    """Constant matrices (E, n, n) that each component has for itself, as masses: summed for a pattern."""

    def __init__(self, matrices: Floats) -> None:
        self.matrices = matrices
        self._pattern: Pattern | None = None
        self._data = np.empty(0)

    def data(self, pattern: Pattern) -> Floats:
        """All cells' matrices added up like `Pattern.zeros`."""
        if pattern is not self._pattern:
            self._pattern, self._data = pattern, pattern.componentwise(self.matrices)
        return self._data
