"""The split form of a law, which elements with a volume change of their own need, for laws that lack it.

`split(law, dim)` returns a law that has the form already, and wraps an object that only has `P(F)` or
`psi(F)` on F (3, 3, ...): its energy at F (d, d, ...) and theta is psi(Fbar) with Fbar = exp((theta - ln det
F)/d) F, d = 3, or in the plane of plane strain, d = 2, with Fbar33 = 1, so that det Fbar = exp(theta).
Derivatives come by complex step; where the second derivative of an energy is needed, by central differences
of sixth order of the complex-step stress. A weak form of grad u and theta can be a law too.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from types import SimpleNamespace
from typing import Any, Literal, Protocol, cast, runtime_checkable

import numpy as np

from evfem.common.constants import INCOMPRESSIBLE
from evfem.errors import InputError, describe_value
from evfem.tensor import (
    Array,
    cofactor,
    complex_step,
    ddot,
    det,
    difference,
    identity,
    inv,
    mul,
    outer,
    symmetric_power,
    transpose,
)
from evfem.tissue.forms import Form, Parts, embed, fluxes

#: change of F and theta over which the stress of an energy is differenced
DIFFERENCE_STEP = 4e-3
#: stretch over which the stress of a law at rest is differenced
STRETCH = 1e-4

Stress = Callable[[Array, Array], tuple[Array, Array]]


@runtime_checkable
class SplitLaw(Protocol):
    """A law in split form, as elements use it; `split` gives it to every other law."""

    volume_measure: Literal["log", "trace"]

    @property
    def shear_modulus(self) -> float: ...
    def split_energy(self, F: Array, theta: Array) -> Array: ...
    def split_stress(self, F: Array, theta: Array) -> tuple[Array, Array]: ...
    def split_tangent(self, F: Array, theta: Array) -> tuple[Array, Array, Array]: ...
    def split_sigma_zz(self, F: Array, theta: Array) -> Array: ...


class Hyperelastic:
    """The public form of a law, psi, P and tangent, from its split form."""

    volume_measure: Literal["log", "trace"] = "log"

    def _measured(self: Any, F: Array) -> tuple[Array, Array]:
        """theta (...) at F (3, 3, ...), and dtheta/dF (3, 3, ...)."""
        if self.volume_measure == "trace":
            return np.trace(F) - 3.0, identity(3, F.ndim - 2)
        return np.log(det(F)), transpose(inv(F))

    def psi(self: Any, F: Array) -> Array:
        """Energy per reference volume (...) in MPa at F (3, 3, ...)."""
        return np.asarray(self.split_energy(F, self._measured(F)[0]))

    def P(self: Any, F: Array) -> Array:
        """First Piola-Kirchhoff stress (3, 3, ...) in MPa at F (3, 3, ...)."""
        theta, G = self._measured(F)
        S, q = self.split_stress(F, theta)
        return np.asarray(S + q * G)

    def tangent(self: Any, F: Array) -> Array:
        """dP_ij/dF_kl (3, 3, 3, 3, ...) in MPa at real F (3, 3, ...)."""
        theta, G = self._measured(F)
        A, c, k = self.split_tangent(F, theta)
        D = A + outer(c, G) + outer(G, c) + k * outer(G, G)
        if self.volume_measure == "log":
            D = D - self.split_stress(F, theta)[1] * np.einsum("il...,kj...->ijkl...", G, G)
        return np.asarray(D)


class UserLaw:
    """A user's law with `P(F)` or `psi(F)` in the split form; see the head of this file."""

    volume_measure: Literal["log", "trace"] = "log"

    def __init__(self, law: Any) -> None:
        self.law = law
        self.viscosity: float | None = getattr(law, "viscosity", None)
        self.density: float = getattr(law, "density", 1e-9)

    @cached_property
    def shear_modulus(self) -> float:
        """Initial shear modulus in MPa: dP12/dF12 at rest, in the plane or in space."""
        F = np.eye(2)
        return float(self.split_tangent(F, np.zeros(()))[0][0, 1, 0, 1])

    @cached_property
    def _rest_energy(self) -> float:
        """Energy at rest (MPa), which a user's constants may leave and no balance has."""
        return float(np.ravel(self.law.psi(np.eye(3)[..., None, None]))[0])

    def _stress(self, Fbar: Array) -> Array:
        """P (3, 3, ...) of the user's law at Fbar (3, 3, ...)."""
        if hasattr(self.law, "P"):
            return np.asarray(self.law.P(Fbar))
        return complex_step(self.law.psi, Fbar, rank=2)

    def split_energy(self, F: Array, theta: Array) -> Array:
        """W(F, theta) (...) at real F; without `psi`, the work of P along a path from rest to Fbar."""
        Fbar = _scaled(F, theta)
        if hasattr(self.law, "psi"):
            return np.asarray(self.law.psi(embed(Fbar))) - self._rest_energy
        return _work(lambda F, _: (self._within(F), np.zeros(())), Fbar, np.zeros(()))

    def _within(self, Fbar: Array) -> Array:
        """P (d, d, ...) of the user's law at Fbar (d, d, ...)."""
        return self._stress(embed(Fbar))[: len(Fbar), : len(Fbar)]

    def split_stress(self, F: Array, theta: Array) -> tuple[Array, Array]:
        """S = e^a (P - (P : F) F^-T / d) and q = e^a P : F / d, with P at Fbar = e^a F."""
        scale = _scale(F, theta)
        P = scale * self._within(scale * F)
        q = 1.0 / len(F) * ddot(P, F)
        return P - q / det(F) * cofactor(F), q

    def split_tangent(self, F: Array, theta: Array) -> tuple[Array, Array, Array]:
        """Second derivatives of W: A (d, d, d, d, ...), c (d, d, ...), k (...)."""
        if hasattr(self.law, "P"):
            return stepped_tangent(self.split_stress, F, theta)
        return stepped_tangent(self.split_stress, F, theta, DIFFERENCE_STEP)

    def split_sigma_zz(self, F: Array, theta: Array) -> Array:
        """Cauchy stress (...) out of the plane, P33(Fbar) / det F."""
        return self._stress(embed(_scaled(F, theta)))[2, 2] / det(F)


class FormLaw:
    """A weak form of grad u and theta in the split form: its fluxes are S and q.

    Its energy is the work along a path from rest; what it does out of the plane is unknown, so nan. `w` is
    the form's context, whose place `x` (d, C, Q) says in how many dimensions it is taken.
    """

    volume_measure: Literal["log", "trace"] = "log"
    viscosity: float | None = None
    density: float = 1e-9

    def __init__(self, form: Form, w: Any) -> None:
        self.form = form
        self.w = w
        self.parts = Parts(len(w.x), grad=True, theta=True)

    @cached_property
    def shear_modulus(self) -> float:
        """Initial shear modulus in MPa: dS12/dF12 at rest. Raises `InputError` for a form of u itself."""
        rest = identity(self.parts.dim, 2), np.zeros((1, 1))
        A, c, k = self.split_tangent(*rest)
        if not all(np.isfinite(array).all() for array in (A, c, k, *self.split_stress(*rest))):
            allowed = "as a material a form of grad(u), u.theta, grad(v) and v.theta that is finite at rest"
            raise InputError("material", self.form.name, allowed)
        return float(np.mean(A[0, 1, 0, 1]))

    def split_energy(self, F: Array, theta: Array) -> Array:
        """W(F, theta) (C, Q) at real F."""
        return _work(self.split_stress, F, theta)

    def split_stress(self, F: Array, theta: Array) -> tuple[Array, Array]:
        """S (d, d, C, Q) and q (C, Q)."""
        H = F - identity(len(F), F.ndim - 2)
        s = fluxes(self.form, self.parts, self.parts.stacked(H, theta), self.w)
        return transpose(s[:-1].reshape(F.shape)), s[-1]

    def split_tangent(self, F: Array, theta: Array) -> tuple[Array, Array, Array]:
        """Derivatives of S and q: A (d, d, d, d, C, Q), c (d, d, C, Q), k (C, Q)."""
        return stepped_tangent(self.split_stress, F, theta)

    def split_sigma_zz(self, F: Array, theta: Array) -> Array:
        """nan (C, Q): a form in the plane does not say."""
        return np.full(theta.shape, np.nan)


def split(law: Any, dim: int = 2, key: str = "material") -> SplitLaw:
    """The law itself if it has the split form, else a `FormLaw` around a form, in `dim` dimensions
    at the origin, or a `UserLaw` around `P(F)` or `psi(F)`.

    Raises `InputError` with `key` for an object that has none of them.
    """
    if isinstance(law, SplitLaw):
        return law
    if isinstance(law, Form):
        return cast(SplitLaw, FormLaw(law, SimpleNamespace(x=np.zeros((dim, 1, 1)), n=None, law=None)))
    if not (hasattr(law, "P") or hasattr(law, "psi")):
        allowed = "a law of evfem, a form, or an object with a method P(F) or psi(F)"
        raise InputError(key, describe_value(law), allowed)
    return cast(SplitLaw, UserLaw(law))


def plane_modulus(law: SplitLaw, dim: int) -> float:
    """E / (1 - nu^2) in MPa at small strain, with which a half space answers a line load: 4 mu (1 - mu / M),
    M being the stiffness against stretch without contraction.

    >>> from evfem.tissue.laws import NeoHookean
    >>> round(plane_modulus(NeoHookean(E=1.0, nu=0.3), 2), 7)
    1.0989011
    """
    stress = []
    for sign in (1.0, -1.0):
        F, theta = identity(dim, 2).copy(), np.zeros((1, 1))
        F[0, 0] += sign * STRETCH
        stretched = law.volume_measure == "log"
        theta += np.log1p(sign * STRETCH) if stretched else sign * STRETCH
        S, q = law.split_stress(F, theta)
        stress.append(float(np.mean(S[0, 0] + q / (F[0, 0] if stretched else 1.0))))
    mu = law.shear_modulus
    return 4.0 * mu * (1.0 - mu * 2.0 * STRETCH / (stress[0] - stress[1]))


def nearly_incompressible(law: SplitLaw, dim: int, times: float | None = None) -> bool:
    """Whether a law is at rest so many `times` stiffer against a change of volume than in shear, d2W/dtheta2
    / mu; by default so that its pressure is worth an unknown of its own (`evfem.newton.pressure`).

    For a neo-Hookean law the ratio is 2 nu / (1 - 2 nu). Laws of small strain never need it: their
    theta is linear in the displacements.

    >>> from evfem.tissue.laws import NeoHookean
    >>> [nearly_incompressible(NeoHookean(E=0.1, nu=nu), 2) for nu in (0.3, 0.49, 0.499)]
    [False, False, True]
    """
    if law.volume_measure == "trace":
        return False
    *_, k = law.split_tangent(identity(dim, 2), np.zeros((1, 1)))
    return float(np.mean(k)) > (INCOMPRESSIBLE if times is None else times) * law.shear_modulus


def stepped_tangent(
    stress: Stress, F: Array, theta: Array, step: float | None = None
) -> tuple[Array, Array, Array]:
    """A, c, k of a law by its split stress: by complex steps, or by differences over `step`."""

    def stacked(x: Array) -> Array:
        S, q = stress(x[:-1].reshape(d, d, *x.shape[1:]), x[-1])
        return np.concatenate([S.reshape(d * d, *x.shape[1:]), q[None]])

    d = len(F)
    x = np.concatenate([F.reshape(d * d, *F.shape[2:]), theta[None]])
    D = complex_step(stacked, x, rank=1) if step is None else difference(stacked, x, step, rank=1)
    return D[:-1, :-1].reshape(d, d, *F.shape), D[:-1, -1].reshape(F.shape), D[-1, -1]


def _scale(F: Array, theta: Array) -> Array:
    root = np.sqrt(det(F)) if len(F) == 2 else det(F) ** (1.0 / 3.0)
    return np.exp(1.0 / len(F) * theta) / root


def _scaled(F: Array, theta: Array) -> Array:
    return _scale(F, theta) * F


def _work(stress: Stress, F: Array, theta: Array) -> Array:
    """Integral of S : dF + q dtheta from rest along R(t phi) (I + t (U - I)), t theta, where F = R(phi) U."""
    U = symmetric_power(mul(transpose(F), F), 0.5)
    turn = _turn(embed(mul(F, inv(U))))
    eye = identity(len(F), F.ndim - 2)
    work = np.zeros(F.shape[2:])
    for node, weight in zip(*np.polynomial.legendre.leggauss(12), strict=True):
        t = 0.5 * (node + 1.0)
        R, turned = (array[: len(F), : len(F)] for array in turn(t))
        V = eye + t * (U - eye)
        rate = mul(turned, V) + mul(R, U - eye)
        S, q = stress(mul(R, V), t * theta)
        work += 0.5 * weight * (ddot(S, rate) + q * theta)
    return work


def _turn(R: Array) -> Callable[[float], tuple[Array, Array]]:
    """The part t of a rotation (3, 3, ...) by less than half a turn about its axis (Rodrigues), and its
    derivative by t.
    """
    skew = 0.5 * (R - transpose(R))
    sine = np.sqrt(0.5 * ddot(skew, skew))
    phi = np.arctan2(sine, 0.5 * (np.trace(R) - 1.0))
    K = skew / np.where(sine > 0.0, sine, 1.0)
    square = mul(K, K)

    def turn(t: float) -> tuple[Array, Array]:
        c, s = np.cos(t * phi), np.sin(t * phi)
        return identity(3, phi.ndim) + s * K + (1.0 - c) * square, phi * (c * K + s * square)

    return turn
