"""Moduli of isotropic laws at small strain: checks and conversions, shared by the laws."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from evfem.common.checks import Checked, Within, number, real, yes_or_no
from evfem.errors import InputError, quoted

POSITIVE = number("a positive number in MPa", Within(0.0, above=True), "MPa")
_BELOW_HALF = Within(-1.0, 0.5, above=True, below=True)
POISSON = number("a number above -1 and below 0.5 (0.4999 is fine)", _BELOW_HALF)
_POSITIVE_TIME = number("a relaxation time in s, at least 0", Within(0.0), "s")
_DENSITY = number("a positive number in t/mm3", Within(0.0, above=True), "t/mm3")
_SHARES = "rows [share of the equilibrium shear modulus, relaxation time in s], all larger than 0"
Pairs = tuple[tuple[float, float], ...]


def shares_of(key: str, given: Any) -> Pairs:
    """Rows (share, seconds) of Maxwell branches, checked."""
    positive = Within(0.0, above=True)
    try:
        rows = [tuple(row) for row in given]
    except TypeError:
        rows = [()]
    if any(len(row) != 2 for row in rows):
        raise InputError(key, quoted(given), _SHARES)
    return tuple((real(key, r, _SHARES, positive), real(key, t, _SHARES, positive)) for r, t in rows)


def relaxation_of(g: Sequence[Sequence[float]]) -> Pairs:
    """The `relaxation=` that rows (g, seconds) mean, shares g of the INSTANTANEOUS shear modulus as other
    programs have them: g / (1 - sum of all g), of the modulus at rest, which stays (1 - sum) of theirs.

    >>> relaxation_of(g=((0.25, 1.0), (0.25, 0.1)))
    ((0.5, 1.0), (0.5, 0.1))
    """
    rows = shares_of("g", g)
    rest = 1.0 - sum(share for share, _ in rows)
    if not rest > 0.0:
        raise InputError("g", quoted(g), "shares of the instantaneous shear modulus, in all below 1")
    return tuple((share / rest, time) for share, time in rows)


# keys that laws share
Young = Annotated[float, POSITIVE, "Young's modulus"]
Poisson = Annotated[float, POISSON, "Poisson's ratio"]
PoissonOrNone = Annotated[float | None, POISSON, "Poisson's ratio"]
Bulk = Annotated[float | None, POSITIVE, "bulk modulus, instead of nu"]
Relaxation = Annotated[float | None, _POSITIVE_TIME, "relaxation time; without it the finger's"]
BRANCHES = {"allowed": _SHARES, "check": shares_of, "type": list[list[float]]}
Branches = Annotated[Pairs | None, BRANCHES, "Maxwell branches; without it the finger's"]
BulkRelaxes = Annotated[bool, yes_or_no(), "true: the bulk modulus relaxes with the same shares"]
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
