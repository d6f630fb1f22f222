r"""The mean attraction over the cycle from the full field, in layers that conduct.

As `evfem.terms.fullfield`, with Poisson's problem of complex permittivities at each harmonic n of the drive
and the mean pulls :math:`F_n` on the nodes at 1 V (`evfem.field.meanattraction`): with the weight w_n of a
harmonic in the squared effective voltage :math:`f_j = U^2 \sum_n w_n F_{n, j}`, :math:`\sum_n w_n = 1`. The
tangent is that of the column law with the same losses. The forces have no energy: between two states the
work is that of the column law, and that of the fringes is counted trapezoidally.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from evfem.common.arrays import Floats
from evfem.field.columns import Columns
from evfem.field.meanattraction import mean_pull
from evfem.terms.fullfield import FieldAttraction, Near


@dataclass(frozen=True)
class Harmonic:
    """A sine of a cycle: weight of the squared effective voltage, complex eps_r of insulator, gap, skin."""

    weight: float
    insulator: complex
    gap: complex
    skin: complex


@dataclass(frozen=True, eq=False)
class DrivenFieldAttraction(FieldAttraction):
    """The mean attraction of the full field under an alternating voltage."""

    harmonics: tuple[Harmonic, ...] = ()

    #: the mean force of a field with losses is no derivative of an energy
    has_energy = False

    @property
    def insulator_eps_r(self) -> float:
        """Real part of the insulator's permittivity at the first harmonic."""
        return float(self.harmonics[0].insulator.real)

    @cached_property
    def _of_harmonics(self) -> tuple[tuple[float, Columns], ...]:
        stacks = ((one.insulator, one.gap, one.skin) for one in self.harmonics)
        real = (tuple(eps if eps.imag else eps.real for eps in stack) for stack in stacks)
        weights = (one.weight for one in self.harmonics)
        return tuple((weight, self.columns_of(*stack)) for weight, stack in zip(weights, real, strict=True))

    @cached_property
    def _stacks(self) -> tuple[Columns, ...]:
        return tuple(columns for _, columns in self._of_harmonics)

    def _solved(self, x: Floats, levels: Floats, slope: Floats, near: Near) -> tuple[None, Floats]:
        """Mean forces (L, 2) on the lines at 1 V effective, whatever the slope below."""
        pulls = (
            weight * mean_pull(columns, x, levels, self._electrodes, self.floating, one).forces
            for (weight, columns), one in zip(self._of_harmonics, near, strict=True)
        )
        return None, np.asarray(sum(pulls))
