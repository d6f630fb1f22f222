r"""What a weak form sees at a point, and its fluxes.

A form f(u, v, w) is linear in the test function, so its values at unit test functions are its
fluxes s = df/d(v, grad v, theta(v)). The parts of one point are stacked in the order (r, i): r = 0
for the value, then one r for each direction X_r of the gradient, i the component; theta comes
last. Only the parts that a form uses are there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from evfem.errors import InputError
from evfem.tensor import Array

Integrand = Callable[[Any, Any, Any], Any]


class Field(np.ndarray[Any, Any]):
    """What a form sees as u or v: the value (dim, ...) with `grad` (dim, dim, ...) and `theta`
    (...).
    """

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
    """The same for all test functions in one call, which have an axis of their own before (C, Q):
    forms of arrays with any number of trailing axes can do it, and share what does not depend on
    v.
    """
    units = np.eye(len(x))[:, :, None, None]
    value = form(parts.field(x[:, None]), parts.field(units), w)
    return np.broadcast_to(np.asarray(value), x.shape)
