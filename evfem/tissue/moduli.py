"""Moduli of isotropic laws at small strain: checks and conversions, shared by the laws."""

from __future__ import annotations

from dataclasses import dataclass

from evfem.common.checks import real
from evfem.errors import InputError


def check_poisson(nu: object) -> None:
    """Raise `InputError` unless -1 < nu < 0.5."""
    real("nu", nu, "a number above -1 and below 0.5 (0.4999 is fine)", lambda nu: -1.0 < nu < 0.5)


def check_rates(viscosity: object, density: object) -> None:
    """Raise `InputError` unless `viscosity` (s, or None) >= 0 and `density` (t/mm^3) > 0."""
    if viscosity is not None:
        real("viscosity", viscosity, "a relaxation time in s, at least 0", lambda tau: tau >= 0.0)
    real("density", density, "a positive number in t/mm^3", lambda rho: rho > 0.0)


def check_volumetric(nu: object, bulk: object) -> None:
    """Raise `InputError` unless one of Poisson's ratio and the bulk modulus is given, and
    possible.
    """
    if (nu is None) == (bulk is None):
        raise InputError("nu, bulk", f"nu = {nu}, bulk = {bulk}", "exactly one of the two")
    if nu is None:
        real("bulk", bulk, "a positive number in MPa", lambda bulk: bulk > 0.0)
    else:
        check_poisson(nu)


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
class Isotropic:
    """Parameters of the laws that are given by Young's modulus and Poisson's ratio at small
    strain.
    """

    E: float
    nu: float
    viscosity: float | None = None
    density: float = 1e-9

    def __post_init__(self) -> None:
        real("E", self.E, "a positive number in MPa", lambda E: E > 0.0)
        check_poisson(self.nu)
        check_rates(self.viscosity, self.density)

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
