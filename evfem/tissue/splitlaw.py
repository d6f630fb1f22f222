"""The split form of a law, which elements with a volume change of their own need, for laws that lack it.

`split(law)` returns a law that has the form already, and wraps an object that only has `P(F)` or `psi(F)` on
F (3, 3, ...): its energy at in-plane F and theta is psi(Fbar) with Fbar = exp((theta - ln det F)/2) F in the
plane and Fbar33 = 1, so that det Fbar = exp(theta). Derivatives come by complex step; where the second
derivative of an energy is needed, by central differences of sixth order of the complex-step stress.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, Literal, Protocol, cast, runtime_checkable

import numpy as np

from evfem.errors import InputError
from evfem.tensor import Array, cofactor, complex_step, ddot, det, mul, symmetric_power, transpose

#: Central difference of sixth order: f' = sum of c (f(x + n h) - f(x - n h)) / h.
DIFFERENCE = ((1, 3.0 / 4.0), (2, -3.0 / 20.0), (3, 1.0 / 60.0))
DIFFERENCE_STEP = 4e-3


@runtime_checkable
class SplitLaw(Protocol):
    """What elements ask of a law; `split` gives it to every other law."""

    volume_measure: Literal["log", "trace"]

    @property
    def shear_modulus(self) -> float: ...
    def split_energy(self, F: Array, theta: Array) -> Array: ...
    def split_stress(self, F: Array, theta: Array) -> tuple[Array, Array]: ...
    def split_tangent(self, F: Array, theta: Array) -> tuple[Array, Array, Array]: ...
    def split_sigma_zz(self, F: Array, theta: Array) -> Array: ...


def embed(F: Array) -> Array:
    """In-plane F (2, 2, ...) as a plane-strain deformation gradient (3, 3, ...) with F33 = 1.

    >>> embed(np.array([[2.0, 0.0], [0.5, 1.0]])).tolist()
    [[2.0, 0.0, 0.0], [0.5, 1.0, 0.0], [0.0, 0.0, 1.0]]
    """
    out = np.zeros((3, 3, *F.shape[2:]), dtype=F.dtype)
    out[:2, :2] = F
    out[2, 2] = 1.0
    return out


class UserLaw:
    """A user's law with `P(F)` or `psi(F)` in the split form; see the head of this file."""

    volume_measure: Literal["log", "trace"] = "log"

    def __init__(self, law: Any) -> None:
        self.law = law
        self.viscosity: float | None = getattr(law, "viscosity", None)
        self.density: float = getattr(law, "density", 1e-9)

    @cached_property
    def shear_modulus(self) -> float:
        """Initial shear modulus in MPa: dP12/dF12 at rest."""
        F = np.eye(2)
        return float(self.split_tangent(F, np.zeros(()))[0][0, 1, 0, 1])

    def _stress(self, Fbar: Array) -> Array:
        """P (3, 3, ...) of the user's law at Fbar (3, 3, ...)."""
        if hasattr(self.law, "P"):
            return np.asarray(self.law.P(Fbar))
        return complex_step(self.law.psi, Fbar, rank=2)

    def split_energy(self, F: Array, theta: Array) -> Array:
        """W(F, theta) (...) at real F; without `psi`, the work of P along a path from rest to Fbar."""
        Fbar = _scaled(F, theta)
        if hasattr(self.law, "psi"):
            return np.asarray(self.law.psi(embed(Fbar)))
        return _work(self._stress, Fbar)

    def split_stress(self, F: Array, theta: Array) -> tuple[Array, Array]:
        """S = e^a (P - (P : F) F^-T / 2) and q = e^a P : F / 2, with P at Fbar = e^a F."""
        scale = _scale(F, theta)
        P = scale * self._stress(embed(scale * F))[:2, :2]
        q = 0.5 * ddot(P, F)
        return P - q / det(F) * cofactor(F), q

    def split_tangent(self, F: Array, theta: Array) -> tuple[Array, Array, Array]:
        """Second derivatives of W: A (2, 2, 2, 2, ...), c (2, 2, ...), k (...)."""
        x = np.concatenate([F.reshape(4, *F.shape[2:]), theta[None]])
        rate = complex_step if hasattr(self.law, "P") else _central_difference
        D = rate(self._stacked_stress, x, rank=1)
        A = D[:4, :4].reshape(2, 2, 2, 2, *theta.shape)
        return A, D[:4, 4].reshape(F.shape), D[4, 4]

    def _stacked_stress(self, x: Array) -> Array:
        """(S, q) as five components at (F, theta) as five components."""
        S, q = self.split_stress(x[:4].reshape(2, 2, *x.shape[1:]), x[4])
        return np.concatenate([S.reshape(4, *x.shape[1:]), q[None]])

    def split_sigma_zz(self, F: Array, theta: Array) -> Array:
        """Cauchy stress (...) out of the plane, P33(Fbar) / det F."""
        return self._stress(embed(_scaled(F, theta)))[2, 2] / det(F)


def split(law: Any) -> SplitLaw:
    """The law itself if it has the split form, else a `UserLaw` around its `P(F)` or `psi(F)`.

    Raises `InputError` for an object that has none of them.
    """
    if isinstance(law, SplitLaw):
        return law
    if not (hasattr(law, "P") or hasattr(law, "psi")):
        raise InputError("material", law, "a law of evfem, or an object with a method P(F) or psi(F)")
    return cast(SplitLaw, UserLaw(law))


def _scale(F: Array, theta: Array) -> Array:
    return np.exp(0.5 * theta) / np.sqrt(det(F))


def _scaled(F: Array, theta: Array) -> Array:
    return _scale(F, theta) * F


def _work(stress: Any, F: Array) -> Array:
    """Integral of P : dF from rest to in-plane F along R(t phi) (I + t (U - I)), 0 <= t <= 1."""
    U = symmetric_power(mul(transpose(F), F), 0.5)
    phi = np.arctan2(F[1, 0] - F[0, 1], F[0, 0] + F[1, 1])
    eye = np.eye(2).reshape((2, 2) + (1,) * phi.ndim)
    work = np.zeros(phi.shape)
    for node, weight in zip(*np.polynomial.legendre.leggauss(12), strict=True):
        t = 0.5 * (node + 1.0)
        c, s = np.cos(t * phi), np.sin(t * phi)
        R, turned = np.array([[c, -s], [s, c]]), np.array([[-s, -c], [c, -s]]) * phi
        V = eye + t * (U - eye)
        rate = mul(turned, V) + mul(R, U - eye)
        work += 0.5 * weight * ddot(stress(embed(mul(R, V)))[:2, :2], rate)
    return work


def _central_difference(function: Any, x: Array, rank: int = 1) -> Array:
    """Derivative of function(x) (m, ...) by x (n, ...) as (m, n, ...), of sixth order."""
    columns = []
    for i in range(len(x)):
        step = np.zeros((len(x),) + (1,) * (x.ndim - rank))
        step[i] = DIFFERENCE_STEP
        ahead = sum(c * (function(x + n * step) - function(x - n * step)) for n, c in DIFFERENCE)
        columns.append(ahead / DIFFERENCE_STEP)
    return np.stack(columns, axis=1)
