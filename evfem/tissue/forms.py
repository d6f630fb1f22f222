r"""Weak forms: how one is written, and those that the package itself is about.

A form is a function f(u, v, w) of the displacement u, the test function v and the context w. It returns the
integrand of a residual, linear in v, over the reference configuration; arrays have tensor axes first, then
those of the points. Its nodal forces and their tangent come from `evfem.tissue.assembly`.

As f is linear in v, its values at unit test functions are its fluxes s = df/d(v, grad v, theta(v)). The parts
of one point are stacked in the order (r, i): r = 0 for the value, then one r for each direction X_r of the
gradient, i the component; theta comes last. Only the parts that a form uses are there.

`neo_hookean`, `hyperelastic`, `kelvin_voigt`, `maxwell` and `mass` below are what runs where no
compiled loop does; those loops are tested against them. The attraction's form stands beside its
nodal rule, in `evfem.terms.attraction`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from evfem.errors import InputError, describe_value
from evfem.protocols import WeakForm
from evfem.tensor import Array, ddot, det, dot, grad, identity, inv, mul, transpose

Integrand = Callable[[Any, Any, Any], Any]


class Field(np.ndarray[Any, Any]):
    """What a form sees as u or v: the value (dim, ...) with `grad` (dim, dim, ...) and `theta` (...)."""

    _grad: Array | None = None
    _theta: Array | None = None

    def __new__(cls, value: Array, grad: Array | None = None, theta: Array | None = None) -> Field:
        field = np.asarray(value).view(cls)
        field._grad, field._theta = grad, theta
        return field

    @property
    def grad(self) -> Array:
        """d u_i / d X_j."""
        return _known(self._grad, "grad")

    @property
    def theta(self) -> Array:
        """The element's volume measure, or its variation."""
        return _known(self._theta, "theta")


def _known(part: Array | None, name: str) -> Array:
    if part is None:
        allowed = "over a region, and the same parts of u and v whatever their values"
        raise InputError("form", f"a use of {name} where it is not known", allowed)
    return part


@dataclass(frozen=True)
class Parts:
    """Parts of a displacement in `dim` dimensions that a form uses."""

    dim: int
    value: bool = False
    grad: bool = False
    theta: bool = False

    @property
    def rows(self) -> int:
        """Number of parts of each component: the value, and one per direction of the gradient."""
        return self.value + self.dim * self.grad

    @property
    def size(self) -> int:
        """Number of parts K."""
        return self.rows * self.dim + self.theta

    def field(self, x: Array) -> Field:
        """The stacked parts x (K, ...) as a form sees them; a value that is not used is nan."""
        dim, end = self.dim, self.rows * self.dim
        value = x[:dim] if self.value else np.full((dim,) + (1,) * (x.ndim - 1), np.nan)
        grad = None
        if self.grad:
            grad = np.swapaxes(x[end - dim * dim : end].reshape(dim, dim, *x.shape[1:]), 0, 1)
        return Field(value, grad, x[end] if self.theta else None)

    def stacked(self, grad: Array, theta: Array) -> Array:
        """Gradient (dim, dim, ...) and theta (...) as parts (K, ...) without a value."""
        return np.concatenate([np.swapaxes(grad, 0, 1).reshape(-1, *theta.shape), theta[None]])


def fluxes(form: Integrand, parts: Parts, x: Array, w: Any) -> Array:
    """s (K, C, Q) of a form at the parts x (K, C, Q) of u, one test function at a time."""
    u, shape = parts.field(x), x.shape
    units = (np.broadcast_to(unit, shape) for unit in np.eye(len(x))[:, :, None, None])
    values = (np.asarray(form(u, parts.field(unit), w)) for unit in units)
    return np.stack([np.broadcast_to(value, shape[1:]) for value in values])


def fluxes_at_once(form: Integrand, parts: Parts, x: Array, w: Any) -> Array:
    """The same for all test functions in one call, on an axis before (C, Q), sharing what has no v."""
    units = np.eye(len(x))[:, :, None, None]
    value = form(parts.field(x[:, None]), parts.field(units), w)
    return np.broadcast_to(np.asarray(value), x.shape)


@dataclass(frozen=True)
class Form:
    """A weak form: `function(u, v, w)` is the integrand of a residual, linear in `v`."""

    function: WeakForm

    def __call__(self, u: Any, v: Any, w: Any) -> Any:
        """The integrand at quadrature points."""
        return self.function(u, v, w)

    @property
    def name(self) -> str:
        """Name of the function."""
        return getattr(self.function, "__name__", type(self.function).__name__)


def form(function: WeakForm) -> Form:
    """Mark `function(u, v, w)` as a weak form: the residual's integrand; its tangent comes by complex step.

    `u` and `v` are the displacement (mm) and its test function with gradient, over a region also
    with the element's volume measure `theta`; `w` carries the coordinates; the integral is taken
    over the reference configuration. The code must be safe for complex numbers (`evfem.tensor`).

    >>> @form
    ... def nail_bed(u, v, w): return 2.0e-2 * dot(u, v)
    >>> nail_bed.name
    'nail_bed'
    """
    if not callable(function):
        raise InputError(
            "form", describe_value(function), "a function (u, v, w) that returns the integrand of a residual"
        )
    return Form(function)


def deformation_gradient(u: Any) -> Array:
    """F = 1 + grad u, (dim, dim, ...)."""
    H = grad(u)
    return identity(len(H), H.ndim - 2) + H


def green_strain(F: Array) -> Array:
    """E = (F^T F - 1)/2, (dim, dim, ...)."""
    return 0.5 * (mul(transpose(F), F) - identity(len(F), F.ndim - 2))


@form
def neo_hookean(u: Any, v: Any, w: Any) -> Any:
    """mu F : grad v + (lambda theta - mu) dtheta(v); theta = Pi ln J is the element's volume measure."""
    F = deformation_gradient(u)
    return w.mu * ddot(F, grad(v)) + (w.lmbda * u.theta - w.mu) * v.theta


@form
def hyperelastic(u: Any, v: Any, w: Any) -> Any:
    """S : grad v + q dtheta(v), the derivatives S and q of any law's energy W(F, theta)."""
    S, q = w.law.split_stress(deformation_gradient(u), u.theta)
    return ddot(S, grad(v)) + q * v.theta


@form
def kelvin_voigt(u: Any, v: Any, w: Any) -> Any:
    """F S : grad v with S = 2 eta (E - E_0) / dt, over one step of backward Euler that began with E_0."""
    F = deformation_gradient(u)
    S = 2.0 * w.eta / w.step * (green_strain(F) - w.strain0)
    return ddot(mul(F, S), grad(v))


def embed(F: Array) -> Array:
    """F (3, 3, ...) in three dimensions of F (dim, dim, ...); F33 = 1 in the plane.

    >>> embed(np.array([[2.0, 0.0], [0.5, 1.0]])).tolist()
    [[2.0, 0.0, 0.0], [0.5, 1.0, 0.0], [0.0, 0.0, 1.0]]
    """
    if len(F) == 3:
        return F
    whole = np.zeros((3, 3, *F.shape[2:]), dtype=F.dtype)
    whole[:2, :2], whole[2, 2] = F, 1.0
    return whole


def isochoric(F: Array) -> Array:
    """(det F)^(-2/3) F^T F (3, 3, ...) of F (dim, dim, ...)."""
    whole = embed(F)
    return det(F) ** (-2.0 / 3.0) * mul(transpose(whole), whole)


@form
def maxwell(u: Any, v: Any, w: Any) -> Any:
    """P : grad v with P = J^(-2/3) F A - tr(Cbar A)/3 F^-T, where A is the sum of m C_i^-1 over the
    branches and C_i what M = B + a Cbar is at determinant 1 (`evfem.tissue.branches`); and the pressure
    K (theta - theta_v) of those of the bulk.
    """
    F = deformation_gradient(u)
    bar = isochoric(F)
    A: Any = 0.0
    q: Any = 0.0
    for branch in w.branches:
        M = branch.before + branch.share * bar
        A = A + branch.shear * det(M) ** (1.0 / 3.0) * inv(M)
        if w.has_bulk:
            q = q + branch.bulk * ((1.0 - branch.theta_share) * u.theta - branch.theta_before)
    inside = A[: len(F), : len(F)]
    P = det(F) ** (-2.0 / 3.0) * mul(F, inside) - ddot(bar, A) / 3.0 * transpose(inv(F))
    return ddot(P, grad(v)) + (q * v.theta if w.has_bulk else 0.0)


@form
def mass(u: Any, v: Any, w: Any) -> Any:
    """rho u . v: its tangent is the consistent mass matrix M, inertia is M (u - u_0 - dt v_0) / dt^2."""
    return w.density * dot(u, v)
