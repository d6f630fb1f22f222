"""The compressible neo-Hookean law by hand, W = mu/2 (F : F - 3 - 2 ln J) + lambda/2 (ln J)^2."""

import numpy as np

from evfem.tensor import ddot, det, inv, transpose
from evfem.tissue.laws import LinearElastic, NeoHookean, Ogden, Yeoh


def neo_hookean_energy(F, mu, lmbda):
    """W at F (3, 3, ...), safe for complex F."""
    log_J = np.log(det(F))
    return 0.5 * mu * (ddot(F, F) - 3.0 - 2.0 * log_J) + 0.5 * lmbda * log_J**2


def neo_hookean_stress(F, mu, lmbda):
    """P = mu (F - F^-T) + lambda ln J F^-T at F (3, 3, ...), or in the plane (2, 2, ...)."""
    return mu * F + (lmbda * np.log(det(F)) - mu) * transpose(inv(F))


class EnergyOnly:
    """A user's law: the energy, nothing else."""

    def __init__(self, mu, lmbda):
        self.mu, self.lmbda = mu, lmbda

    def psi(self, F):
        return neo_hookean_energy(F, self.mu, self.lmbda)


class StressOnly:
    """A user's law: the stress of the same energy, nothing else."""

    def __init__(self, mu, lmbda):
        self.mu, self.lmbda = mu, lmbda

    def P(self, F):
        return neo_hookean_stress(F, self.mu, self.lmbda)


class SteepVolume:
    """A user's law, the energy alone: lambda/16 (J^2 - 1/J^2)^2 in the place of lambda/2 (ln J)^2."""

    def psi(self, F):
        J = det(F)
        volume = LMBDA / 16.0 * (J**2 - J**-2) ** 2
        return 0.5 * MU * (np.sum(F * F, axis=(0, 1)) - 3.0 - 2.0 * np.log(J)) + volume


MU, LMBDA = 0.7, 1.9
YOUNG = MU * (3 * LMBDA + 2 * MU) / (LMBDA + MU)
POISSON = LMBDA / (2 * (LMBDA + MU))
#: every kind of law
LAWS = {
    "neo_hookean": NeoHookean(E=YOUNG, nu=POISSON),
    "yeoh": Yeoh(c1=0.35, c2=0.1, c3=0.02, nu=0.4),
    "ogden": Ogden(mu=[0.9, -0.2], alpha=[2.5, -1.5], bulk=2.0),
    "linear_elastic": LinearElastic(E=YOUNG, nu=POISSON),
    "psi_only": SteepVolume(),
    "P_only": StressOnly(MU, LMBDA),
}
