"""Weak forms of the user's own and where in the mesh they are integrated."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from evfem.errors import InputError
from evfem.protocols import WeakForm


@dataclass(frozen=True)
class Region:
    """A named region of the mesh, for `Scene.with_term`."""

    name: str


@dataclass(frozen=True)
class Boundary:
    """A named boundary of the mesh, for `Scene.with_term`."""

    name: str


@dataclass(frozen=True)
class Form:
    """A user's weak form: `function(u, v, w)` is the integrand of a residual, linear in `v`."""

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

    `u` and `v` are the displacement (mm) and its test function with gradient, `w` carries the
    coordinates; the integral is taken over the reference configuration. The code must be safe for complex
    numbers (`evfem.tensor`).

    >>> @form
    ... def nail_bed(u, v, w): return 2.0e-2 * (u * v)
    >>> nail_bed.name
    'nail_bed'
    """
    if not callable(function):
        raise InputError("form", function, "a function (u, v, w) that returns the integrand of a residual")
    return Form(function)


def grad(field: Any) -> Any:
    """Gradient (i, j, ...) = d u_i / d X_j of the displacement or test function in a weak form."""
    return field.grad


@dataclass(frozen=True)
class Term:
    """A weak form and the named region or boundary it is integrated over."""

    form: Form
    on: Region | Boundary
