"""Hyperelastic laws of the tissue: energy, stress and tangent, pointwise.

Public form: `psi(F)` in MPa (energy per reference volume), `P(F) = dpsi/dF` (3, 3, ...) and
`tangent(F) = dP/dF` (3, 3, 3, 3, ...) for a deformation gradient F (3, 3, ...).

Split form, for elements whose volume change is a field of its own. F (d, d, ...) is the whole
deformation gradient, d = 3, or its part in the plane of plane strain (F33 = 1), d = 2, and `theta`
(...) stands for ln J wherever the law uses the volume change:

    split_energy(F, theta)      W(F, theta), W = psi where theta = ln det F
    split_stress(F, theta)      S = dW/dF at fixed theta (d, d, ...), q = dW/dtheta at fixed F (...)
    split_tangent(F, theta)     A = dS/dF (d, d, d, d, ...), c = dS/dtheta (d, d, ...), k = dq/dtheta (...)
    split_sigma_zz(F, theta)    Cauchy stress out of the plane

Where theta = ln det F, S + q F^-T is P, or its part in the plane. The arrays of a tangent that do
not depend on the state are read-only views without memory of their own. Laws that work with the
small-strain volume change have `volume_measure = "trace"`: there theta stands for tr(F) - d, and S
+ q I is the stress. All functions accept complex F and theta (for `tensor.complex_step`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Literal

import numpy as np

from evfem.common.checks import Within, check_fields, number
from evfem.tensor import Array, ddot, det, identity, outer, transpose
from evfem.tissue.ogden import (
    POSITIVE,
    Branches,
    Bulk,
    BulkRelaxes,
    Density,
    Isotropic,
    Ogden,
    PoissonOrNone,
    Relaxation,
    bulk_modulus,
    check_volumetric,
)
from evfem.tissue.splitlaw import Hyperelastic, SplitLaw, split

__all__ = ["LAWS", "LinearElastic", "NeoHookean", "Ogden", "SplitLaw", "Yeoh", "split"]

_FINITE = number("a finite number", Within(), "MPa")
#: d F_ij / d F_kl and d (F_ij + F_ji) / d F_kl in two and in three dimensions
UNIT_TANGENT = {d: np.einsum("ik,jl->ijkl", np.eye(d), np.eye(d)) for d in (2, 3)}
SYMMETRIC_TANGENT = {d: unit + np.einsum("ijkl->ijlk", unit) for d, unit in UNIT_TANGENT.items()}


def _spread(constant: Array, like: Array) -> Array:
    """A constant tensor at every point of the trailing shape of `like`, as a read-only view."""
    shaped = constant.reshape(constant.shape + (1,) * like.ndim)
    return np.broadcast_to(shaped, constant.shape + like.shape)


def _first_invariant(F: Array) -> Array:
    """I1 = tr(F^T F) (...) in three dimensions of F (d, d, ...); F33 = 1 in the plane."""
    squares = ddot(F, F)
    return squares + 1.0 if len(F) == 2 else squares


class _InvariantLaw(Hyperelastic):
    """Laws of the form psi = w(I1, theta), with I1 = tr(F^T F) in three dimensions and theta = ln J.

    With w_I, w_t the derivatives of w: S = 2 w_I F, q = w_t. A law supplies `_energy` and `_slopes`.
    """

    def _energy(self, I1: Array, theta: Array) -> Array:
        raise NotImplementedError

    def _slopes(self, I1: Array, theta: Array) -> tuple[Array, Array, Array, Array, Array]:
        """w_I, w_t, w_II, w_It, w_tt."""
        raise NotImplementedError

    def split_energy(self, F: Array, theta: Array) -> Array:
        """W(F, theta) (...) at F (d, d, ...)."""
        return self._energy(_first_invariant(F), theta)

    def split_stress(self, F: Array, theta: Array) -> tuple[Array, Array]:
        """S = dW/dF (d, d, ...) and q = dW/dtheta (...)."""
        w_I, w_t, *_ = self._slopes(_first_invariant(F), theta)
        return 2.0 * w_I * F, w_t

    def split_tangent(self, F: Array, theta: Array) -> tuple[Array, Array, Array]:
        """Second derivatives of W: A (d, d, d, d, ...), c (d, d, ...), k (...)."""
        w_I, _, w_II, w_It, w_tt = self._slopes(_first_invariant(F), theta)
        unit = UNIT_TANGENT[len(F)].reshape((len(F),) * 4 + (1,) * theta.ndim)
        return 2.0 * w_I * unit + 4.0 * w_II * outer(F, F), 2.0 * w_It * F, w_tt

    def split_sigma_zz(self, F: Array, theta: Array) -> Array:
        """Cauchy stress (...) out of the plane, (2 w_I + w_t) / det F."""
        w_I, w_t, *_ = self._slopes(_first_invariant(F), theta)
        return (2.0 * w_I + w_t) / det(F)


@dataclass(frozen=True)
class NeoHookean(Isotropic, _InvariantLaw):
    """Compressible neo-Hookean law, psi = mu/2 (tr C - 3 - 2 ln J) + lambda/2 (ln J)^2.

    mu = E / (2 (1 + nu)) and lambda = E nu / ((1 + nu)(1 - 2 nu)). Source: Bonet and Wood, Nonlinear
    Continuum Mechanics for Finite Element Analysis, 2nd ed., 2008, doi:10.1017/CBO9780511755446,
    section 6.4.3.

    >>> law = NeoHookean(E=3.0, nu=0.25)
    >>> law.mu, law.lmbda
    (1.2, 1.2)
    >>> law.P(np.eye(3)).tolist()
    [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
    """

    def _energy(self, I1: Array, theta: Array) -> Array:
        return 0.5 * self.mu * (I1 - 3.0 - 2.0 * theta) + 0.5 * self.lmbda * theta * theta

    def _slopes(self, I1: Array, theta: Array) -> tuple[Array, Array, Array, Array, Array]:
        zero = np.zeros(())
        return np.array(0.5 * self.mu), self.lmbda * theta - self.mu, zero, zero, np.array(self.lmbda)

    def split_tangent(self, F: Array, theta: Array) -> tuple[Array, Array, Array]:
        """A = mu (unit), c = 0, k = lambda: constants, as read-only views of the right shapes."""
        c = _spread(np.zeros(F.shape[:2]), theta)
        return _spread(self.mu * UNIT_TANGENT[len(F)], theta), c, _spread(np.array(self.lmbda), theta)


@dataclass(frozen=True)
class Yeoh(_InvariantLaw):
    """Yeoh's law with a volumetric part in ln J.

    psi = c1 (Ib - 3) + c2 (Ib - 3)^2 + c3 (Ib - 3)^3 + K/2 (ln J)^2 with Ib = J^(-2/3) tr C. The initial
    shear modulus is 2 c1; K is `bulk`, or that of Poisson's ratio at small strain, `nu`. Source: Yeoh, Rubber
    Chem. Technol. 66 (1993) 754-771, doi:10.5254/1.3538343.

    >>> Yeoh(c1=0.5, c2=0.1, c3=0.01, nu=0.25).bulk_modulus
    1.6666666666666667
    """

    c1: Annotated[float, POSITIVE, "first coefficient of I1 - 3"]
    c2: Annotated[float, _FINITE, "second coefficient"] = 0.0
    c3: Annotated[float, _FINITE, "third coefficient"] = 0.0
    nu: PoissonOrNone = None
    bulk: Bulk = None
    viscosity: Relaxation = None
    density: Density = 1e-9
    relaxation: Branches = None
    bulk_relaxation: BulkRelaxes = False

    def __post_init__(self) -> None:
        check_fields(self)
        check_volumetric(self.nu, self.bulk)

    @property
    def shear_modulus(self) -> float:
        """Initial shear modulus in MPa."""
        return 2.0 * self.c1

    @property
    def bulk_modulus(self) -> float:
        """Bulk modulus K in MPa."""
        return bulk_modulus(self.shear_modulus, self.nu, self.bulk)

    def _energy(self, I1: Array, theta: Array) -> Array:
        x = np.exp(-2.0 / 3.0 * theta) * I1 - 3.0
        return x * (self.c1 + x * (self.c2 + x * self.c3)) + 0.5 * self.bulk_modulus * theta * theta

    def _slopes(self, I1: Array, theta: Array) -> tuple[Array, Array, Array, Array, Array]:
        e = np.exp(-2.0 / 3.0 * theta)
        Ib = e * I1
        x = Ib - 3.0
        first = self.c1 + x * (2.0 * self.c2 + 3.0 * self.c3 * x)
        second = 2.0 * self.c2 + 6.0 * self.c3 * x
        K = self.bulk_modulus
        w_It = -2.0 / 3.0 * e * (first + Ib * second)
        w_tt = 4.0 / 9.0 * Ib * (first + Ib * second) + K
        return e * first, K * theta - 2.0 / 3.0 * Ib * first, e * e * second, w_It, w_tt


@dataclass(frozen=True)
class LinearElastic(Isotropic, Hyperelastic):
    """Small-strain isotropic elasticity, psi = mu e : e + lambda/2 (tr e)^2, e = (F + F^T)/2 - I.

    mu and lambda as in `NeoHookean`. Not objective: rotations of more than a few degrees strain it. Its
    volume change is tr e: in the split form theta stands for tr(F) - d and S + q I is the stress.

    >>> LinearElastic(E=2.6, nu=0.3).mu
    1.0
    """

    volume_measure: Literal["log", "trace"] = field(default="trace", init=False, repr=False)

    def split_energy(self, F: Array, theta: Array) -> Array:
        """W(F, theta) = mu e : e + lambda/2 theta^2 (...)."""
        e = 0.5 * (F + transpose(F)) - identity(len(F), F.ndim - 2)
        return self.mu * ddot(e, e) + 0.5 * self.lmbda * theta * theta

    def split_stress(self, F: Array, theta: Array) -> tuple[Array, Array]:
        """S = 2 mu e (of the shape of F) and q = lambda theta (...)."""
        return self.mu * (F + transpose(F) - 2.0 * identity(len(F), F.ndim - 2)), self.lmbda * theta

    def split_tangent(self, F: Array, theta: Array) -> tuple[Array, Array, Array]:
        """A = mu (unit + transposed unit), c = 0, k = lambda: constants, as read-only views."""
        c = _spread(np.zeros(F.shape[:2]), theta)
        return _spread(self.mu * SYMMETRIC_TANGENT[len(F)], theta), c, _spread(np.array(self.lmbda), theta)

    def split_sigma_zz(self, F: Array, theta: Array) -> Array:
        """Stress (...) out of the plane, lambda theta."""
        return self.lmbda * theta


#: The names of the laws in scene files.
LAWS: Mapping[str, type] = {
    "neo_hookean": NeoHookean,
    "yeoh": Yeoh,
    "ogden": Ogden,
    "linear_elastic": LinearElastic,
}
