"""Moduli of isotropic laws at small strain: checks and conversions, shared by the laws."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from evfem.common.checks import Checked, Within, number
from evfem.errors import InputError

POSITIVE = number("a positive number in MPa", Within(0.0, above=True), "MPa")
_BELOW_HALF = Within(-1.0, 0.5, above=True, below=True)
POISSON = number("a number above -1 and below 0.5 (0.4999 is fine)", _BELOW_HALF)
_POSITIVE_TIME = number("a relaxation time in s, at least 0", Within(0.0), "s")
_DENSITY = number("a positive number in t/mm3", Within(0.0, above=True), "t/mm3")
# keys that laws share
Young = Annotated[float, POSITIVE, "Young's modulus"]
Poisson = Annotated[float, POISSON, "Poisson's ratio"]
PoissonOrNone = Annotated[float | None, POISSON, "Poisson's ratio"]
Bulk = Annotated[float | None, POSITIVE, "bulk modulus, instead of nu"]
Relaxation = Annotated[float | None, _POSITIVE_TIME, "relaxation time; without it the finger's"]
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
    """Parameters of the laws that are given by Young's modulus and Poisson's ratio at small
    strain.
    """

    E: Young
    nu: Poisson
    viscosity: Relaxation = None
    density: Density = 1e-9

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
