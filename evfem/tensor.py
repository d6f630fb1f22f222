"""Pointwise algebra on arrays whose first axes are tensor axes: (i, j, ..., trailing axes).

The trailing axes (elements, quadrature points, nodes; none at all for a single point) are carried
along by broadcasting. Every function here is analytic in its arguments, or branches on the real
part only, so that `complex_step` gives exact derivatives of whatever is composed of them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

#: Size of the imaginary perturbation; its square vanishes beside one, so no digit is lost.
STEP = 1e-30
#: Central difference of sixth order: f' = sum of c (f(x + n h) - f(x - n h)) / h.
DIFFERENCE = ((1, 3.0 / 4.0), (2, -3.0 / 20.0), (3, 1.0 / 60.0))


def det(A: Array) -> Array:
    """Determinant of A (n, n, ...), n = 2 or 3.

    >>> float(det(np.array([[2.0, 1.0], [0.0, 3.0]])))
    6.0
    """
    if len(A) == 2:
        return A[0, 0] * A[1, 1] - A[0, 1] * A[1, 0]
    minors = [A[1, j] * A[2, k] - A[1, k] * A[2, j] for j, k in ((1, 2), (2, 0), (0, 1))]
    return A[0, 0] * minors[0] + A[0, 1] * minors[1] + A[0, 2] * minors[2]


def cofactor(A: Array) -> Array:
    """Cofactors of A (n, n, ...), n = 2 or 3: d det(A) / dA = det(A) A^-T, finite for singular A too."""
    out = np.empty_like(A)
    if len(A) == 2:
        out[0, 0], out[1, 1] = A[1, 1], A[0, 0]
        np.negative(A[1, 0], out=out[0, 1, ...])
        np.negative(A[0, 1], out=out[1, 0, ...])
        return out
    for i in range(3):
        for j in range(3):
            k, m, p, q = (i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3
            out[i, j] = A[k, p] * A[m, q] - A[k, q] * A[m, p]
    return out


def inv(A: Array) -> Array:
    """Inverse of A (n, n, ...), n = 2 or 3.

    >>> inv(np.array([[2.0, 0.0], [0.0, 4.0]])).tolist()
    [[0.5, -0.0], [-0.0, 0.25]]
    """
    return transpose(cofactor(A)) / det(A)


def transpose(A: Array) -> Array:
    """The two first axes of A (i, j, ...) exchanged (a view)."""
    return np.swapaxes(A, 0, 1)


def trace(A: Array) -> Array:
    """Sum of A_ii over the two first axes of A (n, n, ...)."""
    return np.trace(A)


def dot(a: Array, b: Array) -> Array:
    """a_i b_i of two vectors (n, ...), without conjugation.

    >>> float(dot(np.array([1.0, 2.0]), np.array([3.0, 4.0])))
    11.0
    """
    return np.sum(a * b, axis=0)


def ddot(A: Array, B: Array) -> Array:
    """A_ij B_ij of two matrices (m, n, ...), without conjugation."""
    return np.sum(A * B, axis=(0, 1))


def mul(A: Array, B: Array) -> Array:
    """A_ik B_kj of two matrices with equally many trailing axes, or A_ik b_k if B has one axis less."""
    subscripts = "ik...,kj...->ij..." if A.ndim == B.ndim else "ik...,k...->i..."
    return np.einsum(subscripts, A, B)


def outer(A: Array, B: Array) -> Array:
    """A_ij B_kl of two matrices (m, n, ...), as (m, n, m, n, ...)."""
    return A[:, :, None, None] * B[None, None]


def identity(n: int, trailing: int = 0) -> Array:
    """The unit matrix with `trailing` axes of length one, (n, n, 1, ..., 1).

    >>> identity(2, 3).shape
    (2, 2, 1, 1, 1)
    """
    return np.eye(n).reshape((n, n) + (1,) * trailing)


def grad(field: Any) -> Any:
    """Gradient (i, j, ...) = d u_i / d X_j of the displacement or test function in a weak form."""
    return field.grad


def positive_part(x: Array) -> Array:
    """max(x, 0), decided by the real part.

    >>> positive_part(np.array([-1.0, 2.0])).tolist()
    [0.0, 2.0]
    """
    return np.where(np.real(x) > 0.0, x, 0.0)


def symmetric_power(C: Array, exponent: float) -> Array:
    """C^exponent of symmetric positive definite C (n, n, ...), by its eigenvalues and eigenvectors.

    An imaginary part of C is taken as a perturbation of first order (C may be stepped by
    `complex_step`, not be any complex matrix): in the eigenbasis its entries are multiplied by the
    divided differences (a^e - b^e)/(a - b) of the eigenvalues a, b, which keeps the derivative
    exact for equal eigenvalues (Daleckii and Krein 1965).
    """
    if len(C) == 2:
        return _power_in_plane(C, exponent)
    values, vectors = np.linalg.eigh(np.moveaxis(np.real(C), (0, 1), (-2, -1)))
    adjoint = np.swapaxes(vectors, -2, -1)
    power = (vectors * values[..., None, :] ** exponent) @ adjoint
    if np.iscomplexobj(C):
        change = adjoint @ np.moveaxis(np.imag(C), (0, 1), (-2, -1)) @ vectors
        power = power + 1j * (vectors @ (_divided_difference(values, exponent) * change) @ adjoint)
    return np.moveaxis(power, (-2, -1), (0, 1))


def _power_in_plane(C: Array, e: float) -> Array:
    """The same in two dimensions in closed form: C = m 1 + r [[c, s], [s, -c]] has eigenvalues m +- r."""

    def parts(A: Array) -> tuple[Array, Array, Array]:
        return 0.5 * (A[0, 0] + A[1, 1]), 0.5 * (A[0, 0] - A[1, 1]), A[0, 1]

    def whole(mean: Array, along: Array, across: Array) -> Array:
        p, q = c * along - s * across, s * along + c * across
        return np.stack([np.stack([mean + p, q]), np.stack([q, mean - p])])

    m, p, q = parts(np.real(C))
    r = np.hypot(p, q)
    turned, scale = r > 0.0, np.where(r > 0.0, r, 1.0)
    c, s = np.where(turned, p / scale, 1.0), q / scale
    high, low = m + r, m - r
    power = whole(0.5 * (high**e + low**e), 0.5 * (high**e - low**e), np.zeros_like(m))
    if not np.iscomplexobj(C):
        return power
    m, p, q = parts(np.imag(C))
    along, across = c * p + s * q, c * q - s * p
    first, last = e * high ** (e - 1.0) * (m + along), e * low ** (e - 1.0) * (m - along)
    by_pair = _divided_difference(np.stack([high, low], axis=-1), e)[..., 0, 1]
    return power + 1j * whole(0.5 * (first + last), 0.5 * (first - last), by_pair * across)


def _divided_difference(values: Array, e: float) -> Array:
    """(a^e - b^e)/(a - b) of all pairs, as (a b)^((e-1)/2) sinh(e t)/sinh(t) with t = ln(a/b)/2."""
    a, b = values[..., :, None], values[..., None, :]
    t = 0.5 * np.log(a / b)
    same = t == 0.0
    t = np.where(same, 1.0, t)
    return (a * b) ** (0.5 * (e - 1.0)) * np.where(same, e, np.sinh(e * t) / np.sinh(t))


def complex_step(function: Callable[..., Array], x: Array, *others: Any, rank: int = 0) -> Array:
    """Exact derivative of a pointwise `function(x, *others)` by x, whose first `rank` axes are tensor axes.

    The derivative Im f(x + i h) / h needs no subtraction, so h = 1e-30 costs no digits. x must be real; the
    function must work pointwise along the trailing axes, accept complex x and be analytic in it. The result
    has the tensor axes of the function's value, then those of x, then the trailing axes.

    >>> float(complex_step(np.sin, np.array(0.0)))
    1.0
    >>> complex_step(det, np.array([[2.0, 1.0], [0.0, 3.0]]), rank=2).tolist()
    [[3.0, 0.0], [-1.0, 2.0]]
    """

    def column(index: tuple[int, ...]) -> Array:
        stepped = np.array(x, dtype=complex)
        stepped[index] += 1j * STEP
        return np.imag(function(stepped, *others)) / STEP

    return _columns(column, x, rank)


def difference(function: Callable[..., Array], x: Array, step: float, rank: int = 0) -> Array:
    """The derivative as in `complex_step`, by central differences of sixth order: for functions that are not
    analytic in code, or take complex steps themselves. Errors are of the order step^6 and rounding / step.

    >>> abs(float(difference(np.sin, np.array(0.0), 4e-3)) - 1.0) < 1e-14
    True
    """

    def column(index: tuple[int, ...]) -> Array:
        shift = np.zeros(np.shape(x))
        shift[index] = step
        changes = [c * (function(x + n * shift) - function(x - n * shift)) for n, c in DIFFERENCE]
        return np.sum(changes, axis=0) / step

    return _columns(column, x, rank)


def derivative(function: Callable[[Array], Any], x: Array, step: float) -> Array:
    """Derivative at real x (...) of a user's function that works point by point: by a complex
    step, or by differences over `step` where the function drops the imaginary part or refuses it.

    >>> float(derivative(np.sin, np.array(0.0), 1e-4))
    1.0
    >>> abs(float(derivative(lambda x: np.abs(x) ** 3, np.array(1.0), 1e-4)) - 3.0) < 1e-11
    True
    """
    x = np.real(x)
    try:
        stepped = np.asarray(function(x + 1j * STEP))
    except TypeError:  # numpy functions of real numbers alone
        return difference(function, x, step)
    return stepped.imag / STEP if np.iscomplexobj(stepped) else difference(function, x, step)


def _columns(column: Callable[[tuple[int, ...]], Array], x: Array, rank: int) -> Array:
    """Derivatives by each tensor component of x, their axes between those of the value and the trailing."""
    shape, trailing = np.shape(x)[:rank], np.ndim(x) - rank
    columns = [column(index) for index in np.ndindex(shape)]
    axes = columns[0].ndim - trailing
    derivative = np.stack(columns, axis=axes)
    return derivative.reshape(columns[0].shape[:axes] + shape + columns[0].shape[axes:])
