"""The compressible neo-Hookean law by hand, W = mu/2 (F : F - 3 - 2 ln J) + lambda/2 (ln J)^2."""

import numpy as np

from evfem.tensor import ddot, det, inv, transpose


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
