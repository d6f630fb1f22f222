r"""Electrostatic attraction of the pad: nodal forces (9a), (9b), (10) and their derivative.

The attraction is a boundary traction that depends on the current gap, the weak form `attraction`
below. What runs is its nodal rule: each pad node j carries the pressure p(g_j) of its current gap
on its current projected length A_j. On linear edges that is the form with its quadrature points at
the nodes; on quadratic edges the rule shares out the chord's projection instead of the curve's.

Trial states that penetrate count as touching, g = 0.

- ``vertical`` (the paper): :math:`f_y = -p(g_j) A_j`. Not conservative: moving a neighbour sideways changes
  A_j without work.
- ``normal``: minus the derivative of :math:`W = \sum_j \Pi(g_j) A_j`, the Maxwell traction on the deformed
  outline; its tangent is symmetric.

Without an air layer only touching nodes carry force. Forces act on the finger; N per mm of depth.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sparse

from evfem.common.arrays import Floats
from evfem.contact.charging import Charged, Charging
from evfem.contact.pad import Pad, surface_state
from evfem.electrostatics.laws import GAP_STEP, traction_derivative
from evfem.tensor import derivative, mul, positive_part
from evfem.tissue.forms import deformation_gradient, form

#: gaps up to this (mm) count as closed
TOUCHING = 1e-9


@form
def attraction(u: Any, v: Any, w: Any) -> Any:
    """p(g) v_y in the residual on the current projected width max(0, (F T)_x), with g the gap
    below X + u.
    """
    T = np.stack([-w.n[1], w.n[0]])
    width = positive_part(mul(deformation_gradient(u), T)[0])
    x, y = w.x[0] + u[0], w.x[1] + u[1]
    gap = positive_part(y - w.surface.y - w.surface.height(x))
    return w.law.traction(gap, w.voltage, w.layers) * width * v[1]


@dataclass(frozen=True, eq=False)
class Attraction:
    """A force law acting on a pad: `layers` are the solid layers under each pad node, `surface`
    the electrode's outline.
    """

    law: Any
    layers: Any
    pad: Pad
    surface: Any
    direction: str = "vertical"
    air_layer: bool = True
    charging: Charging | None = None

    def acts(self, voltage: float) -> bool:
        """Whether anything attracts at this voltage: charges may without it."""
        return voltage != 0.0 or self.charging is not None

    @property
    def no_charges(self) -> Floats:
        """Charges (2, P) of an uncharged pad, (2, 0) where charges do not move."""
        return np.zeros((2, 0)) if self.charging is None else self.charging.none

    def _seen(self, gap: Any, voltage: float, x: Floats) -> Any:
        """The voltage that the law sees at gaps (P,) of nodes at x (P,): that of the charges, too."""
        if self.charging is None:
            return voltage
        return self.charging.effective(gap, voltage, self.pad.length(x))

    def charged(self, position: Floats, voltage: float, charges: Floats | None = None) -> Charged:
        """The electric state at positions (P, 2): with the charges (2, P), or those at the end of
        the present step.
        """
        assert self.charging is not None
        gap = np.maximum(surface_state(self.surface, position).gap, 0.0)
        length = self.pad.length(position[:, 0])
        found = self.charging.after(gap, voltage, length) if charges is None else charges
        return Charged(found, voltage, gap, length)

    def forces(self, position: Floats, voltage: float, touching: Any) -> Floats:
        """Nodal forces on the finger (P, 2); `touching` (P,) says who carries force without an air
        layer.
        """
        return self.forces_along(position[None], np.array([voltage]), touching)[0]

    def forces_along(self, positions: Floats, voltages: Floats, touching: Any) -> Floats:
        """`forces` at W places of a way (W, P, 2), from positions (W, P, 2) and voltages (W,)."""
        if not voltages.any() and self.charging is None:
            return np.zeros_like(positions)
        frame = surface_state(self.surface, positions.reshape(-1, positions.shape[-1]))
        gaps = np.maximum(frame.gap, 0.0).reshape(len(positions), -1)
        x = positions[..., 0]
        pairs = [(gap, self._seen(gap, u, at)) for gap, u, at in zip(gaps, voltages.tolist(), x, strict=True)]
        on = 1.0 if self.air_layer else touching.astype(float)
        pressure = np.array([self.law.traction(gap, voltage, self.layers) for gap, voltage in pairs])
        weight = on * pressure * self.pad.length(x)
        if self.direction == "vertical":
            return np.stack([np.zeros_like(weight), -weight], axis=-1)
        potential = [on * self.law.potential(gap, voltage, self.layers) for gap, voltage in pairs]
        sideways = [self._sideways(*each) for each in zip(x, potential, strict=True)]
        return np.stack([sideways + weight * frame.slope.reshape(weight.shape), -weight], axis=-1)

    def _sideways(self, x: Floats, potential: Floats) -> Floats:
        """Forces along x (P,) that lengthen the tributary lengths, at x (P,), by the potential (P,)."""
        of, moved, value = self.pad.length_gradient(x)
        return np.asarray(-np.bincount(moved, potential[of] * value, x.size), dtype=float)

    def negative_stiffness(self, position: Floats, voltage: float, touching: Any) -> Floats:
        """How fast the attraction of a node weakens with its vertical gap, -dp/dg A (P,) in N/mm
        per mm; 0 where it touches, where contact holds the gap, and where losses make it grow with
        the gap: that stabilises, and the iterations do without it.
        """
        gap = surface_state(self.surface, position).gap
        on = 1.0 if self.air_layer else touching.astype(float)
        rate = self._weakening(np.maximum(gap, 0.0), voltage, position[:, 0])
        weakening = -on * rate * self.pad.length(position[:, 0])
        return np.where((gap > TOUCHING) & (weakening > 0.0), weakening, 0.0)

    def _weakening(self, gap: Floats, voltage: float, x: Floats) -> Any:
        """dp/dg (P,) in MPa/mm, the charges of the present step following the gap."""
        if self.charging is None:
            return traction_derivative(self.law, gap, voltage, self.layers)
        return derivative(
            lambda g: self.law.traction(g, self._seen(g, voltage, x), self.layers), gap, GAP_STEP
        )

    def stiffness(self, position: Floats, voltage: float, touching: Any) -> Any:
        """Derivative of `forces` by the node positions, sparse (2 P, 2 P), unknowns ordered (node,
        component).
        """
        size = position.shape[0]
        frame = surface_state(self.surface, position)
        length = self.pad.length(position[:, 0])
        on = 1.0 if self.air_layer else touching.astype(float)
        gap = np.maximum(frame.gap, 0.0)
        p = on * self.law.traction(gap, self._seen(gap, voltage, position[:, 0]), self.layers)
        dp = -self.negative_stiffness(position, voltage, touching)
        of, moved, value = self.pad.length_gradient(position[:, 0])
        nodes = np.arange(size)
        rows = [2 * nodes + 1, 2 * nodes + 1, 2 * of + 1]
        columns = [2 * nodes + 1, 2 * nodes, 2 * moved]
        values = [-dp, dp * frame.slope, -p[of] * value]
        if self.direction == "normal":
            w = p * length
            rows += [2 * nodes, 2 * nodes, 2 * of, 2 * moved, 2 * moved]
            columns += [2 * nodes + 1, 2 * nodes, 2 * moved, 2 * of + 1, 2 * of]
            values += [
                dp * frame.slope,
                w * frame.curvature - dp * frame.slope**2,
                (p * frame.slope)[of] * value,
                -p[of] * value,
                (p * frame.slope)[of] * value,
            ]
        triplets = (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))
        return sparse.csr_matrix(triplets, shape=(2 * size, 2 * size))
