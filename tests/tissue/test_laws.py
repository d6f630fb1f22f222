"""Laws against their definitions, each other and linear elasticity; derivatives against differences."""

import numpy as np
import pytest
from tools.laws import EnergyOnly, StressOnly
from tools.refusals import refuses

from evfem.tensor import complex_step, det, inv, trace, transpose
from evfem.tissue.forms import embed
from evfem.tissue.laws import LinearElastic, NeoHookean, Ogden, SplitLaw, Yeoh, split
from evfem.tissue.splitlaw import UserLaw

rng = np.random.default_rng(2)
BUILT_IN = [
    NeoHookean(E=0.8, nu=0.3),
    Yeoh(c1=0.4, c2=0.15, c3=0.02, nu=0.4),
    Ogden(mu=[0.9, -0.2], alpha=[2.5, -1.5], bulk=3.0),
    LinearElastic(E=0.8, nu=0.3),
]
names = {"ids": lambda law: type(law).__name__}


ENERGY, STRESS = EnergyOnly(1.3, 2.1), StressOnly(1.3, 2.1)


class ViscousEnergy(EnergyOnly):
    """The energy, and a relaxation time."""

    viscosity = 0.25


def deformations(n=3, shape=(4, 3), size=0.25):
    """Random gradients near the unit matrix with positive determinants."""
    return np.eye(n).reshape(n, n, *[1] * len(shape)) + rng.uniform(-size, size, (n, n, *shape))


def difference(function, x, rank, h=1e-5):
    """Central difference of function(x) by x (first `rank` axes), with the axes of `complex_step`."""
    columns = []
    for index in np.ndindex(x.shape[:rank]):
        e = np.zeros_like(x)
        e[index] = h
        columns.append((function(x + e) - function(x - e)) / (2.0 * h))
    axes = columns[0].ndim - (x.ndim - rank)
    shape = columns[0].shape
    return np.stack(columns, axis=axes).reshape(shape[:axes] + x.shape[:rank] + shape[axes:])


@pytest.mark.parametrize("law", BUILT_IN, **names)
def test_stress_is_the_derivative_of_the_energy(law):
    F = deformations()
    np.testing.assert_allclose(law.P(F), complex_step(law.psi, F, rank=2), rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(law.P(F), difference(law.psi, F, 2), rtol=1e-7, atol=1e-8)


@pytest.mark.parametrize("law", BUILT_IN, **names)
def test_tangent_is_the_derivative_of_the_stress(law):
    F = deformations()
    A = law.tangent(F)
    assert A.shape == (3, 3, 3, 3, 4, 3)
    np.testing.assert_allclose(A, complex_step(law.P, F, rank=2), rtol=1e-11, atol=1e-12)
    np.testing.assert_allclose(A, difference(law.P, F, 2), rtol=1e-6, atol=1e-8)


@pytest.mark.parametrize("law", BUILT_IN, **names)
@pytest.mark.parametrize("shape", [(), (5,), (4, 3)])
def test_split_form_is_the_full_form_where_theta_is_the_volume_change(law, shape):
    F = deformations(2, shape)
    full = embed(F)
    if law.volume_measure == "log":
        theta, volume = np.log(det(F)), transpose(inv(F))
        J = det(F)
    else:
        theta, volume, J = trace(F) - 2.0, np.eye(2).reshape(2, 2, *[1] * len(shape)), 1.0
    S, q = law.split_stress(F, theta)
    P = law.P(full)
    np.testing.assert_allclose(law.split_energy(F, theta), law.psi(full), rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(S + q * volume, P[:2, :2], rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(law.split_sigma_zz(F, theta), P[2, 2] / J, rtol=1e-12, atol=1e-14)


def test_neo_hookean_stress_by_hand():
    # F = diag(2, 1, 1), mu = lmbda = 1.2 by E and nu: P11 = mu (2 - 1/2) + lmbda ln 2 / 2, P22 = lmbda ln 2
    P = NeoHookean(E=3.0, nu=0.25).P(np.diag([2.0, 1.0, 1.0]))
    np.testing.assert_allclose(np.diag(P), [1.8 + 0.6 * np.log(2.0)] + [1.2 * np.log(2.0)] * 2, rtol=1e-14)


def test_energy_of_a_stress_only_law_survives_large_turns():
    # 150 degrees of turn and a stretch of 1.5: a straight path from rest would pass through det F < 0
    s, c = np.sin(2.6), np.cos(2.6)
    F = np.array([[c, -s], [s, c]]) @ np.array([[1.5, 0.2], [0.0, 0.8]])
    theta = np.log(det(F))
    energy = split(STRESS, 2).split_energy(F, theta)
    assert energy == pytest.approx(ENERGY.psi(embed(F)), rel=1e-10)


def test_energy_of_a_stress_only_law_that_is_not_objective():
    # linear elasticity given by its stress only; theta = ln det F, so that nothing is scaled
    class Hooke:
        def P(self, F):
            return LinearElastic(E=1.0, nu=0.3).P(F)

    F = deformations(2)
    energy = split(Hooke(), 2).split_energy(F, np.log(det(F)))
    np.testing.assert_allclose(energy, LinearElastic(E=1.0, nu=0.3).psi(embed(F)), rtol=1e-9, atol=1e-12)


def test_wrapper_keeps_the_laws_own_rates_and_is_not_applied_twice():
    law = split(ViscousEnergy(1.3, 2.1), 2)
    assert isinstance(law, UserLaw)
    assert law.viscosity == 0.25
    assert law.density == 1e-9
    assert split(law, 2) is law
    for built_in in BUILT_IN:
        assert split(built_in, 2) is built_in
        assert isinstance(built_in, SplitLaw)


def test_an_object_without_energy_or_stress_is_refused():
    refuses(r"P\(F\) or psi\(F\)", split, object(), 2)


@pytest.mark.parametrize(
    ("make", "key"),
    [
        (lambda: NeoHookean(E=-1.0, nu=0.3), "E"),
        (lambda: NeoHookean(E=1.0, nu=0.5), "nu"),
        (lambda: NeoHookean(E=float("nan"), nu=0.3), "E"),
        (lambda: NeoHookean(E="1", nu=0.3), "E"),
        (lambda: NeoHookean(E=1.0, nu=0.3, viscosity=-1e-3), "viscosity"),
        (lambda: LinearElastic(E=1.0, nu=-1.0), "nu"),
        (lambda: LinearElastic(E=1.0, nu=0.2, density=0.0), "density"),
        (lambda: Yeoh(c1=0.0, nu=0.4), "c1"),
        (lambda: Yeoh(c1=1.0, c2=float("inf"), nu=0.4), "c2"),
        (lambda: Yeoh(c1=1.0), "nu, bulk"),
        (lambda: Yeoh(c1=1.0, nu=0.4, bulk=2.0), "nu, bulk"),
        (lambda: Yeoh(c1=1.0, bulk=-2.0), "bulk"),
        (lambda: Ogden(mu=[1.0, 2.0], alpha=[2.0], nu=0.4), "alpha"),
        (lambda: Ogden(mu=1.0, alpha=-2.0, nu=0.4), "mu"),
        (lambda: Ogden(mu=1.0, alpha=0.0, nu=0.4), "alpha"),
        (lambda: Ogden(mu="soft", alpha=2.0, nu=0.4), "mu"),
    ],
)
def test_impossible_parameters_are_refused_by_name(make, key):
    assert refuses("allowed", make).key == key


def test_exponents_of_ogden_are_those_that_numbers_hold():
    """The largest one has a tangent at rest, where all stretches are equal, as a neo-Hookean law of the
    same moduli; beyond it stretches to its power are no numbers.
    """
    law = Ogden(mu=[0.02 / 1000.0], alpha=[1000.0], nu=0.3)
    same = NeoHookean(E=2.0 * 0.01 * 1.3, nu=0.3)
    np.testing.assert_allclose(law.tangent(np.eye(3)), same.tangent(np.eye(3)), atol=1e-12)
    refuses(r"alpha: given -1000\.5; allowed: .* beyond \+-1000", Ogden, mu=[-0.02], alpha=[-1000.5], nu=0.3)
