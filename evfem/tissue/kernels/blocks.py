"""Cells in blocks of `LANES`, the last axis of every array, as the compiled element loops take them.

The loops (`module.h`, once for the plane and once for space) are built when the package is installed;
where no compiler is, the weak forms do the same (`evfem.tissue.assembly`). Arrays: B blocks, n nodes of a
cell, Q quadrature points, S samples of ln J, M modes of theta, L lanes.
"""

from __future__ import annotations

import ctypes
from functools import cache, partial
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np

from evfem.common.arrays import Floats, address, mkl

LANES = 8


class Cells(NamedTuple):
    """A space in blocks, of D dimensions. `sizes` (N, B, n, Q, S, M); `nodes` (B, n, L), as `bounded` of
    the loops makes them; `weight` (B, Q, L); `reference` (Q, n, D) gradients of the shape functions in the
    reference cell and `inverse` (B, Q, D D, L) dxi/dX at the points; the same where ln J is sampled,
    `sample_reference` (S, n, D) and `sample_inverse` (B, S, D D, L), or in space None and (B, n, D, L), the
    means of the shape gradients, with S = 1; S = 0 where that is at the points. `psi` (B, M, S or Q, L) and
    `mean` (B, M, L) of the modes of theta, see `elastic.h`; M = 0 in the plane where theta is ln J of the
    quadrature point.
    """

    sizes: tuple[int, ...]
    nodes: Any
    weight: Floats
    reference: Floats
    inverse: Floats
    sample_reference: Floats | None
    sample_inverse: Floats
    psi: Floats
    mean: Floats


@cache
def loops(dim: int = 2) -> Any:
    """The compiled element loops of the plane or of space, or None where they were not built."""
    try:
        if dim == 3:
            return import_module("evfem.tissue.kernels.solids")
        return import_module("evfem.tissue.kernels.loops")
    except ImportError:
        return None


@cache
def contact_loop() -> Any:
    """The compiled contact in the plane, with the dense algebra of MKL, else of scipy; None where it was not
    built.
    """
    try:
        settle = import_module("evfem.tissue.kernels.contact").settle
    except ImportError:
        return None
    if (library := mkl()) is not None:
        return partial(settle, ctypes.cast(library.dgesv, ctypes.c_void_p).value)
    return partial(settle, address("lapack", "dgesv"))


@cache
def sparse_cholesky() -> Any:
    """The compiled sparse Cholesky factors, and by precision the dense algebra of scipy that they take; None
    where they were not built.
    """
    try:
        kernel = import_module("evfem.tissue.kernels.cholesky")
    except ImportError:
        return None
    names = (("lapack", "potrf"), *(("blas", name) for name in ("trsm", "syrk", "gemv", "trsv")))
    algebra = {kind: tuple(address(library, kind + name) for library, name in names) for kind in "sd"}
    return kernel, algebra


def blocked(values: Any) -> Any:
    """(E, ...) as (B, ..., L); the last cell fills the last block up."""
    blocks = -(-len(values) // LANES)
    filled = np.concatenate([values, np.repeat(values[-1:], blocks * LANES - len(values), axis=0)])
    return np.ascontiguousarray(np.moveaxis(filled.reshape(blocks, LANES, *values.shape[1:]), 1, -1))


def padded(values: Floats) -> Floats:
    """(E, ...) as (B, ..., L); what fills the last block up is 0, so that it has no force."""
    missing = np.zeros((-len(values) % LANES, *values.shape[1:]))
    return blocked(np.concatenate([values, missing]))


def unblocked(blocks: Floats, count: int) -> Floats:
    """(B, ..., L) as (E, ...) of E = `count` cells."""
    values = np.moveaxis(blocks, -1, 1)
    return np.ascontiguousarray(values.reshape(-1, *values.shape[2:])[:count])
