"""Types of the arrays that go from room to room, dense systems of linear equations and their threads, Gauss
quadrature.

Large systems are factorised in single precision, which takes half of the time and memory, and refined: the
solution is that of double precision. Source: N. J. Higham, Accuracy and Stability of Numerical Algorithms,
2nd ed., SIAM 2002, ch. 12 (iterative refinement), doi:10.1137/1.9780898718027.
"""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Callable, Hashable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from functools import cache
from importlib import import_module, metadata
from importlib.machinery import PathFinder
from importlib.util import find_spec, module_from_spec
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import ThreadpoolController, threadpool_limits

from evfem.common.constants import BLOCK, LARGE_SYSTEM, OLD_FACTORS, REFINED, REFINEMENTS

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]
Words = NDArray[np.str_]


class GrowingRows:
    """An array (k, ...) that grows by a row at a time; what `values` gave before stays as it is.

    >>> grown = GrowingRows(np.zeros((0, 2)))
    >>> grown.add(np.array([1.0, 2.0]))
    >>> grown.values.tolist()
    [[1.0, 2.0]]
    """

    def __init__(self, rows: Floats) -> None:
        self._room, self._count = np.array(rows), len(rows)

    @property
    def values(self) -> Floats:
        """The rows so far."""
        return self._room[: self._count]

    def add(self, row: Floats) -> None:
        """One more; the room is doubled where it is full."""
        if self._count == len(self._room):
            more = np.empty((self._count + 1, *self._room.shape[1:]))
            self._room = np.concatenate([self._room, more])
        self._room[self._count] = row
        self._count += 1


class MadeLater:
    """A dataclass whose fields are made when one of them is read that was not given to `later`.

    >>> from dataclasses import dataclass
    >>> @dataclass(frozen=True)
    ... class Square(MadeLater):
    ...     side: float
    ...     area: float
    >>> Square.later(lambda: {"area": 9.0}, side=3.0).area
    9.0
    """

    @classmethod
    def later(cls, make: Callable[[], Mapping[str, Any]], **known: Any) -> Self:
        """One with the fields `known`; `make` is called once, and gives the others."""
        found = cls.__new__(cls)
        vars(found).update(known, _make=make)
        return found

    def __getattr__(self, name: str) -> Any:
        if name in self.__annotations__ and "_make" in vars(self):
            vars(self).update(vars(self)["_make"]())
            vars(self).pop("_make", None)
            return vars(self)[name]
        raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")

    def __getstate__(self) -> dict[str, Any]:
        """For copies and other processes: all fields, made now."""
        return {name: getattr(self, name) for name in self.__annotations__}


class Memory:
    """Memory of large arrays that are made again and again, kept: of memory taken anew the system zeroes
    every page.

    >>> memory = Memory()
    >>> first = memory.array("matrix", (2, 3))
    >>> memory.array("matrix", (2, 2), np.float32).base is first.base
    True
    """

    def __init__(self) -> None:
        self._kept: dict[str, Any] = {}

    def array(self, name: str, shape: tuple[int, ...], kind: Any = np.float64) -> Any:
        """An array of any values; what the last one of this `name` had is lost."""
        size = int(np.prod(shape)) * np.dtype(kind).itemsize
        if name not in self._kept or self._kept[name].size < size:
            self._kept.pop(name, None)
            self._kept[name] = np.empty(size, np.uint8)
        return self._kept[name][:size].view(kind).reshape(shape)


class DenseSolver:
    """Solves dense systems one after the other; the factors of a large one serve the next with its unknowns.

    >>> matrix = np.array([[2.0, 1.0], [1.0, 3.0]])
    >>> DenseSolver().solve(matrix, np.array([[3.0], [4.0]])).round(12).tolist()
    [[1.0], [1.0]]
    """

    def __init__(self, memory: Memory | None = None) -> None:
        self._memory = memory or Memory()
        self._unknowns: Hashable = None
        self._factors: tuple[Floats, Any, Any] | None = None

    def solve(self, matrix: Any, right: Floats, unknowns: Hashable = None) -> Any:
        """Solution (n, q) of a matrix (n, n) for right-hand sides (n, q), named by its `unknowns`; raises
        `numpy.linalg.LinAlgError` where it is singular. Of a large matrix rows (but for the diagonal, in
        single precision), diagonal and products are used: it need not be an array.
        """
        if len(matrix) < LARGE_SYSTEM:
            return np.linalg.solve(np.asarray(matrix), right)
        named = None if unknowns is None else (len(matrix), unknowns)
        old = named is not None and named == self._unknowns
        found = self._refined(matrix, right, OLD_FACTORS) if old else None
        if found is None and self._factorise(matrix):
            self._unknowns = named
            found = self._refined(matrix, right, 2 * OLD_FACTORS)
        return np.linalg.solve(np.asarray(matrix), right) if found is None else found

    def _factorise(self, matrix: Any) -> bool:
        self._unknowns = self._factors = None
        own, n = matrix.diagonal(), len(matrix)
        largest = np.abs(own).max() or 1.0
        scale = 1.0 / np.sqrt(np.maximum(np.abs(own), 1e-30 * largest))  # within single precision
        single, by = self._memory.array("factors", (n, n), np.float32), scale.astype(np.float32)
        for begin in range(0, n, BLOCK):
            some = slice(begin, begin + BLOCK)
            rows = np.multiply(matrix[some], by, out=single[some], casting="same_kind")
            rows *= by[some, None]
        single[np.diag_indices(n)] = own * scale**2
        pivots = np.empty(n, np.intc)
        self._factors = scale, single, pivots
        return not lapack("sgetrf", n, n, single, n, pivots)

    def _refined(self, matrix: Any, right: Floats, slowest: float) -> Floats | None:
        """The solution by the factors at hand, None where the residual falls by less than `slowest`."""
        assert self._factors is not None
        scale, factors, pivots = self._factors
        n, q = right.shape
        scale = scale[:, None]
        whole = np.maximum(np.abs(scale * right).max(axis=0), np.finfo(float).tiny)
        x, rest, size = np.zeros_like(right), right, 1.0
        for _ in range(REFINEMENTS):
            step = np.asarray((scale * rest / whole).T, np.float32, order="C")
            lapack("sgetrs", b"T", n, q, factors, n, pivots, step, n)
            x = x + scale * step.T * whole
            rest = right - matrix @ x
            before, size = size, float((np.abs(scale * rest).max(axis=0) / whole).max())
            if size < REFINED:
                return x
            if not size < slowest * before:
                break
        return None


def block(matrix: Any, rows: Ints, columns: Ints, out: Any = None) -> Any:
    """The block (r, c) of a matrix at these rows and columns, or written to `out`: one after the other takes
    a fourth of the time of both at once (`np.ix_`).
    """
    out = np.empty((rows.size, columns.size), matrix.dtype) if out is None else out
    for begin in range(0, rows.size, BLOCK):  # what the cache holds; "clip" copies without another array
        some = matrix.take(rows[begin : begin + BLOCK], axis=0)
        some.take(columns, axis=1, out=out[begin : begin + BLOCK], mode="clip")
    return out


def product(matrix: Any, x: Floats) -> Floats:
    """A matrix (r, c) of single or double precision times x (c,) or (c, q), in double precision."""
    if matrix.dtype == float:
        return np.asarray(matrix @ x)
    found, double = np.empty((len(matrix), *x.shape[1:])), np.empty((BLOCK, matrix.shape[1]))
    for begin in range(0, len(matrix), BLOCK):
        some = found[begin : begin + BLOCK]
        double[: len(some)] = matrix[begin : begin + BLOCK]
        np.dot(double[: len(some)], x, out=some)
    return found


def inverse(matrix: Any, symmetric: bool) -> Any:
    """Inverse (n, n); a large positive definite one by Cholesky, in half the time and in its own precision,
    others in double precision.
    """
    if len(matrix) < LARGE_SYSTEM:
        return np.linalg.inv(matrix.astype(float))
    n, kind = len(matrix), "s" if matrix.dtype == np.float32 else "d"
    if symmetric:
        whole = np.array(matrix, order="C")
        if not lapack(kind + "potrf", b"L", n, whole, n):
            lapack(kind + "potri", b"L", n, whole, n)  # leaves the upper triangle, in the order of rows
            for begin in range(0, len(whole), BLOCK):  # without a second matrix as large
                rows, end = whole[begin : begin + BLOCK], begin + BLOCK
                whole[end:, begin:end] = rows[:, end:].T
                square = rows[:, begin:end]
                square[:] = np.triu(square) + np.triu(square, 1).T
            return whole
    whole, pivots, work = np.array(matrix, float, order="C"), np.empty(n, np.intc), np.empty(64 * n)
    if lapack("dgetrf", n, n, whole, n, pivots):
        raise np.linalg.LinAlgError("singular compliance")
    # solving with the unit matrix, as numpy does, takes 1.6 times as long
    lapack("dgetri", n, whole, n, pivots, work, work.size)
    return whole


#: environment variable that says where MKL is, here and to pypardiso
MKL = "PYPARDISO_MKL_RT"
#: the limits of the BLAS that hold, each with its number of threads
_LIMITS: list[tuple[ExitStack, int]] = []


@contextmanager
def blas_limits(threads: int = 1) -> Iterator[None]:
    """Limits numpy's BLAS, and scipy's as soon as it is loaded here, to so many threads; MKL has its own."""
    with ExitStack() as stack:
        stack.enter_context(threadpool_limits(threads))
        _LIMITS.append((stack, threads))
        try:
            yield
        finally:
            _LIMITS.remove((stack, threads))


@contextmanager
def _limits_begin_anew() -> Iterator[None]:
    """A limit is that of what is loaded when it begins: those that hold pause while more is loaded."""
    for stack, _ in reversed(_LIMITS):
        stack.close()
    try:
        yield
    finally:
        for stack, threads in _LIMITS:
            stack.enter_context(threadpool_limits(threads))


@cache
def linalg() -> Any:
    """scipy.linalg, a seventh of a second; BLAS and LAPACK alone are in `compiled_algebra`."""
    with _limits_begin_anew():
        import scipy.linalg
    return scipy.linalg


@cache
def compiled_algebra(library: str) -> Mapping[str, Any]:
    """The functions of scipy's `blas` or `lapack` for compiled code, as capsules by name; in a hundredth of a
    second, as the package scipy.linalg around them is not run.
    """
    import scipy

    name = f"scipy.linalg.cython_{library}"
    spec = PathFinder.find_spec(name, [str(Path(path) / "linalg") for path in scipy.__path__])
    with _limits_begin_anew():
        if name in sys.modules or spec is None or spec.loader is None:
            module = import_module(name)
        else:
            module = module_from_spec(spec)
            spec.loader.exec_module(module)
            sys.modules.pop(name, None)  # or a later import would not find it in its package
    functions: Mapping[str, Any] = module.__pyx_capi__
    return functions


@cache
def address(library: str, name: str) -> int:
    """Where a function of scipy's `blas` or `lapack` is in memory."""
    capsule = compiled_algebra(library)[name]
    python, own = ctypes.pythonapi, ctypes.py_object(capsule)
    python.PyCapsule_GetName.restype, python.PyCapsule_GetPointer.restype = ctypes.c_char_p, ctypes.c_void_p
    found: int = python.PyCapsule_GetPointer(own, python.PyCapsule_GetName(own))
    return found


def lapack(name: str, *given: Any) -> int:
    """LAPACK's function of this name: words are bytes, whole numbers int, arrays contiguous and changed in
    place, matrices by columns: what numpy has by rows is their transposed. Returns its last argument, `info`.

    >>> matrix, pivots = np.array([[0.0, 2.0], [4.0, 0.0]]), np.empty(2, np.intc)
    >>> lapack("dgetrf", 2, 2, matrix, 2, pivots), pivots.tolist(), matrix.tolist()
    (0, [2, 2], [[2.0, 0.0], [0.0, 4.0]])
    """
    info = ctypes.c_int()
    pointers = [_pointer(one) for one in given] + [ctypes.byref(info)]
    ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * len(pointers))(address("lapack", name))(*pointers)
    return info.value


def _pointer(given: Any) -> Any:
    if isinstance(given, np.ndarray):
        return given.ctypes.data_as(ctypes.c_void_p)
    return ctypes.c_char_p(given) if isinstance(given, bytes) else ctypes.byref(ctypes.c_int(given))


def loaded_blas() -> ThreadpoolController:
    """Every BLAS, scipy's too; to find them takes milliseconds, its `limit` microseconds."""
    linalg()
    return ThreadpoolController()


@cache
def mkl() -> Any:
    """MKL, or None without pypardiso; that loads scipy.sparse, and is asked only if `mkl` is no package."""
    if find_spec("pypardiso") is None:
        return None
    os.environ.setdefault("KMP_BLOCKTIME", "0")  # its threads sleep, not spin, while Python works
    if MKL not in os.environ and (path := mkl_library()) is not None:
        os.environ[MKL] = path
    if MKL in os.environ:
        library = ctypes.CDLL(os.environ[MKL])
    else:
        try:
            from pypardiso.pardiso_wrapper import PyPardisoSolver
        except ImportError:
            return None
        library = PyPardisoSolver().libmkl
    library.pardiso.argtypes, library.pardiso.restype = [ctypes.c_void_p] * 16, None
    library.MKL_Set_Num_Threads(1)  # small dense systems lose by sharing; PARDISO has a number of its own
    return library


def mkl_library() -> str | None:
    """Path of the runtime library of the package `mkl`, or None."""
    try:
        files = metadata.files("mkl") or []
    except metadata.PackageNotFoundError:
        return None
    found = (str(file.locate()) for file in files if "mkl_rt" in file.name and ".lib" not in file.name)
    return next((path for path in found if Path(path).exists()), None)


def gauss(points: int) -> tuple[Floats, Floats]:
    """Nodes and weights on (0, 1)."""
    x, weight = np.polynomial.legendre.leggauss(points)
    return 0.5 + 0.5 * x, 0.5 * weight


def _along(ends: tuple[float, ...]) -> tuple[Floats, Floats]:
    """Nodes and weights (with the derivative of the map), eight between `ends`, clustered at both ends."""
    at, weight = gauss(8)
    begin, length = np.array(ends[:-1])[:, None], np.diff(ends)[:, None]
    at, weight = (begin + length * at).ravel(), (length * weight).ravel()
    return at**2 * (3.0 - 2.0 * at), 6.0 * at * (1.0 - at) * weight


#: nodes and weights of the work of the attraction along a straight path of displacements, and finer ones if
#: these do not resolve it: thin insulators are thinner than displacements by orders of magnitude
NODES, WEIGHTS = _along((0.0, 1.0))
FINE_NODES, FINE_WEIGHTS = _along((0.0, 1 / 64, 1 / 16, *np.linspace(1 / 8, 7 / 8, 7), 15 / 16, 63 / 64, 1.0))
#: an integrand is resolved if its highest Legendre coefficients are below this fraction of the largest
RESOLVED = 1e-3
#: the two ends of the path
ENDS = np.array([0.0, 1.0])
#: matrix from values at the nodes `NODES` to Legendre coefficients (8,)
LEGENDRE = np.linalg.inv(np.polynomial.legendre.legvander(2.0 * NODES - 1.0, NODES.size - 1))
#: nodes and weights of the friction work
SLIDE, PART = gauss(4)
