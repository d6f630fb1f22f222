"""Moduli common to the material laws, and Ogden's law in principal stretches (`evfem.tissue.laws`)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from evfem.common.checks import Checked, Within, check_fields, number, real, several, yes_or_no
from evfem.errors import InputError, describe_value
from evfem.tensor import Array, ddot, det, mul, symmetric_power, transpose
from evfem.tissue.splitlaw import Hyperelastic, stepped_tangent

POSITIVE = number("a positive number in MPa", Within(0.0, above=True), "MPa")
_BELOW_HALF = Within(-1.0, 0.5, above=True, below=True)
POISSON = number("a number above -1 and below 0.5 (0.4999 is fine)", _BELOW_HALF)
_POSITIVE_TIME = number("a relaxation time in s, at least 0", Within(0.0), "s")
_DENSITY = number("a positive number in t/mm3", Within(0.0, above=True), "t/mm3")
_SHARES = "rows [ratio to the equilibrium shear modulus, relaxation time in s], all larger than 0"
Pairs = tuple[tuple[float, float], ...]


def shares_of(key: str, entered: Any) -> Pairs:
    """Rows (modulus ratio, relaxation time in s) of Maxwell branches, checked."""
    positive = Within(0.0, above=True)
    try:
        rows = [tuple(row) for row in entered]
    except TypeError:
        rows = [()]
    if any(len(row) != 2 for row in rows):
        raise InputError(key, describe_value(entered), _SHARES)
    return tuple((real(key, r, _SHARES, positive), real(key, t, _SHARES, positive)) for r, t in rows)


def relaxation_of(g: Sequence[Sequence[float]]) -> Pairs:
    """The `relaxation=` that rows (g, seconds) mean, fractions g of the INSTANTANEOUS shear modulus as other
    programs have them: g / (1 - sum of all g), of the modulus at rest, which stays (1 - sum) of theirs.

    >>> relaxation_of(g=((0.25, 1.0), (0.25, 0.1)))
    ((0.5, 1.0), (0.5, 0.1))
    """
    rows = shares_of("g", g)
    rest = 1.0 - sum(ratio for ratio, _ in rows)
    if not rest > 0.0:
        raise InputError(
            "g", describe_value(g), "fractions of the instantaneous shear modulus, in all below 1"
        )
    return tuple((ratio / rest, time) for ratio, time in rows)


# keys common to several laws
Young = Annotated[float, POSITIVE, "Young's modulus"]
Poisson = Annotated[float, POISSON, "Poisson's ratio"]
PoissonOrNone = Annotated[float | None, POISSON, "Poisson's ratio"]
Bulk = Annotated[float | None, POSITIVE, "bulk modulus, instead of nu"]
Relaxation = Annotated[float | None, _POSITIVE_TIME, "relaxation time; without it the finger's"]
BRANCHES = {"allowed": _SHARES, "check": shares_of, "type": list[list[float]]}
Branches = Annotated[Pairs | None, BRANCHES, "Maxwell branches; without it the finger's"]
BulkRelaxes = Annotated[bool, yes_or_no(), "true: the bulk modulus relaxes with the same ratios"]
Density = Annotated[float, _DENSITY, "with dynamics = inertial"]


def check_volumetric(nu: object, bulk: object) -> None:
    """Raise `InputError` unless one of Poisson's ratio and the bulk modulus is given."""
    if (nu is None) == (bulk is None):
        raise InputError("nu, bulk", f"nu = {nu}, bulk = {bulk}", "exactly one of the two")


def bulk_modulus(mu: float, nu: float | None, bulk: float | None) -> float:
    """`bulk` if given, else 2 mu (1 + nu) / (3 (1 - 2 nu)).

    >>> bulk_modulus(3.0, 0.25, None)
    5.0
    """
    if nu is None:
        assert bulk is not None
        return bulk
    return 2.0 * mu * (1.0 + nu) / (3.0 * (1.0 - 2.0 * nu))


@dataclass(frozen=True)
class Isotropic(Checked):
    """Parameters of the laws that are given by Young's modulus and Poisson's ratio at small strain."""

    E: Young
    nu: Poisson
    viscosity: Relaxation = None
    density: Density = 1e-9
    relaxation: Branches = None
    bulk_relaxation: BulkRelaxes = False

    @property
    def mu(self) -> float:
        """Shear modulus in MPa."""
        return self.E / (2.0 * (1.0 + self.nu))

    @property
    def lmbda(self) -> float:
        """Lame's first modulus in MPa."""
        return self.E * self.nu / ((1.0 + self.nu) * (1.0 - 2.0 * self.nu))

    @property
    def shear_modulus(self) -> float:
        """Initial shear modulus in MPa."""
        return self.mu

    @property
    def bulk_modulus(self) -> float:
        """Initial bulk modulus in MPa."""
        return self.lmbda + 2.0 / 3.0 * self.mu


#: largest exponent: stretches of tissue to this power are still numbers
MOST = 1000.0


_TERMS = "a number, or a list of numbers, none of them zero"
_MU = several(_TERMS, bool, "MPa")
_ALPHA = several(f"{_TERMS} or beyond +-{MOST:g}", lambda value: 0.0 < abs(value) <= MOST)


@dataclass(frozen=True)
class Ogden(Hyperelastic):
    """Ogden's law with a volumetric part in ln J.

    psi = sum over p of mu_p/alpha_p (l1^alpha_p + l2^alpha_p + l3^alpha_p - 3) + K/2 (ln J)^2 with l_i =
    J^(-1/3) times the principal stretches. The initial shear modulus is the sum of mu_p alpha_p / 2: where a
    paper, or Abaqus, has 2 mu_p/alpha_p^2, take 2/alpha_p times its mu_p. K is
    `bulk`, or that of Poisson's ratio at small strain, `nu`. Source: Ogden, Proc. R. Soc. Lond. A 328 (1972)
    567-583, doi:10.1098/rspa.1972.0096.

    >>> Ogden(mu=[1.0, -0.2], alpha=[2.0, -2.0], nu=0.25).shear_modulus
    1.2
    """

    mu: Annotated[float | Sequence[float], _MU, "moduli of the terms (mu alpha / 2 in shear)"]
    alpha: Annotated[float | Sequence[float], _ALPHA, "exponents of the terms"]
    nu: PoissonOrNone = None
    bulk: Bulk = None
    viscosity: Relaxation = None
    density: Density = 1e-9
    relaxation: Branches = None
    bulk_relaxation: BulkRelaxes = False

    def __post_init__(self) -> None:
        check_fields(self)
        if len(self._terms[0]) != len(self._terms[1]):
            raise InputError("alpha", self.alpha, "as many numbers as in mu")
        if not self.shear_modulus > 0.0:
            raise InputError("mu", self.mu, "moduli with a positive sum of mu alpha / 2")
        check_volumetric(self.nu, self.bulk)

    @property
    def _terms(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        assert isinstance(self.mu, tuple)
        assert isinstance(self.alpha, tuple)
        return self.mu, self.alpha

    @property
    def shear_modulus(self) -> float:
        """Initial shear modulus in MPa."""
        return sum(m * a for m, a in zip(*self._terms, strict=True)) / 2.0

    @property
    def bulk_modulus(self) -> float:
        """Bulk modulus K in MPa."""
        return bulk_modulus(self.shear_modulus, self.nu, self.bulk)

    def split_energy(self, F: Array, theta: Array) -> Array:
        """W(F, theta) (...) at F (d, d, ...)."""
        C, energy = mul(transpose(F), F), 0.5 * self.bulk_modulus * theta * theta
        for m, a in zip(*self._terms, strict=True):
            powers = np.trace(symmetric_power(C, 0.5 * a)) + 3.0 - len(F)
            energy = energy + m / a * (np.exp(-a / 3.0 * theta) * powers - 3.0)
        return energy

    def split_stress(self, F: Array, theta: Array) -> tuple[Array, Array]:
        """S = dW/dF (d, d, ...) and q = dW/dtheta (...)."""
        C = mul(transpose(F), F)
        S: Array = np.zeros(())
        q = self.bulk_modulus * theta
        for m, a in zip(*self._terms, strict=True):
            scaled = m * np.exp(-a / 3.0 * theta)
            power = symmetric_power(C, 0.5 * a - 1.0)
            S = S + scaled * mul(F, power)
            q = q - scaled / 3.0 * (ddot(power, C) + 3.0 - len(F))
        return S, q

    def split_tangent(self, F: Array, theta: Array) -> tuple[Array, Array, Array]:
        """Second derivatives of W at real F and theta: A (d, d, d, d, ...), c (d, d, ...), k (...)."""
        return stepped_tangent(self.split_stress, F, theta)

    def split_sigma_zz(self, F: Array, theta: Array) -> Array:
        """Cauchy stress (...) out of the plane."""
        _, q = self.split_stress(F, theta)
        P33 = q + sum(m * np.exp(-a / 3.0 * theta) for m, a in zip(*self._terms, strict=True))
        return P33 / det(F)
