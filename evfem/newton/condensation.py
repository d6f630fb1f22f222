r"""Sparse factorisation of the tissue's tangent with exact condensation onto a few unknowns.

The symmetric tangent is split into interior unknowns i and kept unknowns c (contact candidates and
the bone's two translations):

.. math:: S = K_{cc} - K_{ci} K_{ii}^{-1} K_{ic}, \qquad g = b_c - K_{ci} K_{ii}^{-1} b_i, \qquad
          S x_c = g, \qquad K_{ii} x_i = b_i - K_{ic} x_c .

Everything unsymmetric or jumpy (friction, electrostatic stiffness, prescribed forces) is added to
the small dense S by the caller. `Pardiso` (from evfem[fast]) and `Cholesky` return S with the
factorisation and solve in two halves. `SuperLU`, the readable twin, eliminates the kept unknowns last, so
that S is the product of the trailing blocks of L and U. Only i must be positive definite: the bone may be
free to move.
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cached_property
from itertools import islice
from typing import Any

import numpy as np

from evfem.common.arrays import Floats, Ints, block, linalg, mkl
from evfem.common.constants import ACCURATE
from evfem.tissue.body import Pattern
from evfem.tissue.kernels.blocks import sparse_cholesky

#: index of PARDISO's count of perturbed pivots among its parameters
PERTURBED = 13


class Singular(ArithmeticError):
    """The matrix of the interior unknowns cannot be factorised."""


def shift_of_kept(pattern: Pattern, kept: Ints, upper: Floats) -> Floats:
    """Numbers (m,) added to the diagonal of S while computed: K's, as a free bone leaves it singular."""
    return np.abs(upper[pattern.diagonal[kept]])


def is_accurate(factor: Any, upper: Floats) -> bool:
    """Whether factors of single precision give how equal forces move the interior, which is softest."""
    if factor.real is np.float64:
        return True
    import scipy.sparse as sparse

    pattern, interior = factor.pattern, np.ones(factor.pattern.size)
    interior[factor.kept] = 0.0
    A = sparse.csr_matrix((upper, pattern.indices, pattern.indptr), 2 * (pattern.size,))

    def moved(b: Floats) -> Floats:
        found: Floats = factor.backward(factor.forward(b)[0], np.zeros(factor.kept.size))
        return found

    x = moved(interior)
    rest = interior * (1.0 - A @ x - A.T @ x + upper[pattern.diagonal] * x)
    return bool(np.abs(moved(rest)).max() <= ACCURATE * np.abs(x).max())


class Pardiso:
    """Condensation by MKL PARDISO: one symbolic analysis, many factorisations. Factors
    of `single` precision are replaced by double ones where they fail or are not accurate.
    """

    def __init__(self, pattern: Pattern, kept: Ints, threads: int = 1, single: bool = False) -> None:
        self.pattern, self.kept = pattern, kept
        self.real: type[np.float32] | type[np.float64] = np.float32 if single else np.float64
        library, self._threads = mkl(), ctypes.c_int32(threads)
        self._limit, self._call_pardiso = library.MKL_Set_Num_Threads_Local, library.pardiso
        self._mark = np.zeros(pattern.size, dtype=np.int32)
        # PARDISO numbers the Schur complement in ascending order of the unknowns
        self._order = np.argsort(kept)
        self.schur: Any = np.zeros((0, 0))
        self._values: Any = np.zeros(0)
        self._start(2)

    def _start(self, mtype: int) -> None:
        self.mtype = mtype
        self._handle = np.zeros(64, dtype=np.int64)
        self._iparm = np.zeros(64, dtype=np.int32)
        # user values; METIS; no refinement; pivots below 1e-13 are perturbed (and counted); C indices; dense
        # Schur complement kept for solves
        single = int(self.real is np.float32)
        for index, value in {0: 1, 1: 2, 7: 0, 9: 13, 27: single, 34: 1, 35: 2}.items():
            self._iparm[index] = value
        self._mark[:] = 0
        self._mark[self.kept] = 1
        self._analysed = self._open = False
        self._phase, self._error = ctypes.c_int32(0), ctypes.c_int32(0)
        self._fixed = self._arguments()

    def _call(self, phase: int, b: Any, x: Any) -> int:
        self._phase.value = phase
        handle, before, after = self._fixed
        # addresses, not `array.ctypes`: ctypes would evaluate that in Python, and turn a Ctrl-C that comes
        # just then into another error
        values, b, x = self._values.ctypes.data, b.ctypes.data, x.ctypes.data
        # all phases with as many threads, whatever limit holds: with fewer than the analysis had, one crashes
        others = self._limit(self._threads)
        self._call_pardiso(handle, *before, values, *after, b, x, ctypes.byref(self._error))
        self._limit(others)
        return self._error.value

    def _arguments(self) -> tuple[Any, tuple[Any, ...], tuple[Any, ...]]:
        """Arguments that all calls share: the handle, those before and those behind the values."""

        def number(value: int) -> Any:
            return ctypes.byref(ctypes.c_int32(value))

        pattern, phase = self.pattern, ctypes.byref(self._phase)
        matrix = (pattern.indptr.ctypes.data, pattern.indices.ctypes.data)
        control = (self._mark.ctypes.data, number(1), self._iparm.ctypes.data, number(0))
        kind = (number(1), number(1), number(self.mtype), phase, number(pattern.size))
        return self._handle.ctypes.data, kind, (*matrix, *control)

    def factorise(self, upper: Floats) -> None:
        """Factorise new values, which are used up; raises `Singular` if even the indefinite factorisation
        fails.
        """
        shift = shift_of_kept(self.pattern, self.kept, upper)
        upper[self.pattern.diagonal[self.kept]] += shift
        kinds: list[tuple[int, Any]] = [(2, np.float32), (2, np.float64), (-2, np.float64)]
        for mtype, real in kinds[kinds.index((self.mtype, self.real)) :]:
            if (mtype, real) != (self.mtype, self.real):
                self.close()
                self.real = real
                self._start(mtype)
            self._values, self.schur = upper.astype(real, copy=False), np.zeros((0, 0))
            S, b = np.zeros(2 * (self.kept.size,), real), np.zeros(self.pattern.size, real)
            self._open = True
            error = 0 if self._analysed else self._call(11, b, S)
            error = error or self._call(22, b, S)
            self._analysed = error == 0
            definite = error == 0 and self._iparm[PERTURBED] == 0 and np.isfinite(S).all()
            if definite and is_accurate(self, upper):
                rank = np.argsort(self._order)
                self.schur = block(S, rank, rank)
                self.schur[np.diag_indices_from(S)] -= shift
                return
        raise Singular(f"PARDISO error {error}, {self._iparm[PERTURBED]} perturbed pivots")

    def forward(self, b: Floats) -> tuple[Floats, Floats]:
        """Eliminate the interior from b (n,): (state for `backward`, condensed right-hand side (m,))."""
        # the entries of the kept unknowns go past the factor: the bone's reaction, in single precision,
        # would have a rounding larger than the forces that are left
        interior = b.astype(self.real)
        interior[self.kept] = 0.0
        y = self._solve(331, interior)
        g = b[self.kept] + y[self.kept]
        if self.mtype == -2:
            y = self._solve(332, y)
        return y, g

    def backward(self, state: Floats, kept: Floats) -> Floats:
        """Solution (n,) once the kept unknowns (m,) are known."""
        known = state.astype(self.real)
        known[self.kept] = kept
        x = self._solve(333, known).astype(float, copy=False)
        x[self.kept] = kept
        return x

    def _solve(self, phase: int, b: Any) -> Any:
        x = np.zeros_like(b)
        self._call(phase, b, x)
        return x

    def close(self) -> None:
        """Free the library's memory.

        No ufunc is used: garbage may be collected within the end of an `np.errstate`, and CPython's context
        variable that holds numpy's error state, read just then, goes on to point to what is freed next.
        """
        if self._open:
            self._call(-1, self._values, self._values)
            ctypes.memset(self._handle.ctypes.data, 0, self._handle.nbytes)
            self._open = False

    def __del__(self, ends: Callable[[], bool] = sys.is_finalizing) -> None:
        if hasattr(self, "_fixed") and not ends():  # the names of this module may be gone by then
            self.close()


class SuperLU:
    """Condensation by scipy's SuperLU: kept unknowns are eliminated last, S = L_cc U_cc; in the `ordering`
    (n,), else in one of its own.
    """

    def __init__(
        self,
        pattern: Pattern,
        kept: Ints,
        threads: int = 1,
        single: bool = False,
        ordering: Ints | None = None,
    ) -> None:
        linalg()  # whose BLAS SuperLU uses
        self.pattern, self.kept, self._ordering = pattern, kept, ordering
        eliminated = np.ones(pattern.size, dtype=bool)
        eliminated[kept] = False
        self._interior = np.flatnonzero(eliminated)
        self.schur: Any = np.zeros((kept.size, kept.size))

    def factorise(self, upper: Floats) -> None:
        """Factorise new values of the pattern, which are used up; raises `Singular` if that fails."""
        from scipy.sparse.linalg import splu

        options = {"SymmetricMode": True, "Equil": False}
        shift = shift_of_kept(self.pattern, self.kept, upper)
        upper[self.pattern.diagonal[self.kept]] += shift
        A = self.pattern.full(upper)
        try:
            if self._ordering is None:
                interior = A[self._interior][:, self._interior].tocsc()
                first = splu(interior, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
                self._ordering = np.concatenate([self._interior[np.argsort(first.perm_c)], self.kept])
            order = self._ordering
            self._lu = splu(
                A[order][:, order].tocsc(), permc_spec="NATURAL", diag_pivot_thresh=0.0, options=options
            )
        except RuntimeError as error:
            raise Singular(str(error)) from error
        # elimination starts where SuperLU's own post-ordering says; the kept unknowns stay last, in their
        # order, and no kept row serves as a pivot of the interior
        m = self.kept.size
        last = np.arange(self.pattern.size - m, self.pattern.size)
        if not (np.array_equal(self._lu.perm_c[-m:], last) and np.array_equal(self._lu.perm_r[-m:], last)):
            raise Singular("SuperLU moved the kept unknowns")
        lower, higher = self._lu.L[-m:, -m:].toarray(), self._lu.U[-m:, -m:].toarray()
        self._shifted = lower @ higher
        self.schur = self._shifted - np.diag(shift)

    def _solve(self, b: Floats) -> Floats:
        assert self._ordering is not None
        x = np.empty_like(b)
        x[self._ordering] = self._lu.solve(b[self._ordering])
        return x

    def forward(self, b: Floats) -> tuple[Floats, Floats]:
        x = self._solve(b)
        return x, self._shifted @ x[self.kept]

    def backward(self, state: Floats, kept: Floats) -> Floats:
        b = np.zeros_like(state)
        b[self.kept] = self._shifted @ (kept - state[self.kept])
        return state + self._solve(b)


class Cholesky:
    """Condensation by Cholesky factors of our own (`factors/cholesky.c`); by another solver where the
    interior is not positive definite. Those of `single` precision are replaced by double ones where they are
    not accurate.
    """

    def __init__(self, pattern: Pattern, kept: Ints, threads: int = 1, single: bool = False) -> None:
        self.pattern, self.kept, self._threads = pattern, kept, threads
        order, mark = pattern.elimination_order, np.zeros(pattern.size, dtype=bool)
        mark[kept] = True
        self._order: Ints = np.concatenate([order[~mark[order]], kept]).astype(np.int32)
        self.schur: Any = np.zeros((0, 0))
        self._plan_for(np.float32 if single else np.float64)

    def _plan_for(self, real: type[np.float32] | type[np.float64]) -> None:
        self.real, self._definite = real, True
        self._kernel, algebra = sparse_cholesky()
        pattern, single = self.pattern, real is np.float32
        arrays, sizes = (pattern.indptr, pattern.indices, self._order), (pattern.size, self.kept.size)
        self._plan = self._kernel.analyse(
            *sizes, pattern.indices.size, single, arrays, algebra["s" if single else "d"]
        )

    @cached_property
    def _indefinite(self) -> Pardiso | SuperLU:
        """What factorises matrices that are not positive definite: PARDISO, else SuperLU in our order."""
        if _is_there(Pardiso):
            return Pardiso(self.pattern, self.kept, self._threads)
        return SuperLU(self.pattern, self.kept, ordering=self._order)

    def factorise(self, upper: Floats) -> None:
        """Factorise new values of the pattern, which are used up; raises `Singular` if that fails."""
        self._definite = self._factorised(upper)
        if self._definite and is_accurate(self, upper):
            return
        if self.real is np.float32:
            self._plan_for(np.float64)
            self.factorise(upper)
        else:
            self._indefinite.factorise(upper)
            self.schur = self._indefinite.schur

    def _factorised(self, upper: Floats) -> bool:
        columns = np.empty(2 * (self.kept.size,), self.real)
        if not (np.isfinite(upper).all() and self._kernel.factorise(self._plan, upper, columns)):
            return False
        self.schur = columns + columns.T
        self.schur[np.diag_indices_from(columns)] = columns.diagonal()
        return True

    def forward(self, b: Floats) -> tuple[Floats, Floats]:
        """As `Pardiso.forward`."""
        if not self._definite:
            return self._indefinite.forward(b)
        x = b.copy()
        x[self.kept] = 0.0  # go past the factor, as in `Pardiso`
        self._kernel.solve(self._plan, False, x)
        return x, b[self.kept] + x[self.kept]

    def backward(self, state: Floats, kept: Floats) -> Floats:
        """As `Pardiso.backward`."""
        if not self._definite:
            return self._indefinite.backward(state, kept)
        x = state.copy()
        x[self.kept] = kept
        self._kernel.solve(self._plan, True, x)
        x[self.kept] = kept
        return x


#: a factorised matrix: its Schur complement, and solves in two halves
Condensation = Cholesky | Pardiso | SuperLU
#: whether the sparse solver is the one that is not chosen by itself
_OTHER = ContextVar("_OTHER", default=False)


def _is_there(kind: type[Condensation]) -> bool:
    """Whether a sparse solver is installed, or was compiled; SuperLU always is there."""
    return kind is SuperLU or (mkl() if kind is Pardiso else sparse_cholesky()) is not None


@contextmanager
def other_solver() -> Iterator[bool]:
    """Within, the second of the sparse solvers; yields whether there is one."""
    token = _OTHER.set(True)
    try:
        yield _is_there(Pardiso) or _is_there(Cholesky)
    finally:
        _OTHER.reset(token)


def make_condensation(pattern: Pattern, kept: Ints, threads: int = 1, single: bool = False) -> Condensation:
    """The first that is there: Cholesky factors, PARDISO, SuperLU; on several threads, which Cholesky factors
    have no use for, PARDISO first. SuperLU alone takes matrices all of whose unknowns are kept.
    """
    kinds: list[type[Condensation]] = [Cholesky, Pardiso]
    if threads > 1:
        kinds.reverse()
    there = (kind for kind in kinds if kept.size < pattern.size and _is_there(kind))
    return next(islice(there, int(_OTHER.get()), None), SuperLU)(pattern, kept, threads, single)
