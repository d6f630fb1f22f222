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

Rough faces keep a separation s(p) where they touch (`evfem.electrostatics.roughness`): the law then
sees g + s, with p the node's own contact pressure, its pressing force over A_j. A node that is
pressed by d lam_n more is pulled by :math:`p'(s)\,s'(p)\,d\lambda_n` more (`gain_on_pressing`).
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
from evfem.electrostatics.roughness import separation_derivative
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
    the electrode's outline, `roughness` how far rough faces stay apart in contact (None: not at all).

    `pressing` (P,) are the present contact forces along the normal in N/mm, None for none.
    """

    law: Any
    layers: Any
    pad: Pad
    surface: Any
    direction: str = "vertical"
    air_layer: bool = True
    roughness: Any = None
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

    def charged(
        self, position: Floats, voltage: float, pressing: Floats | None, charges: Floats | None = None
    ) -> Charged:
        """The electric state at positions (P, 2): with the charges (2, P), or those at the end of
        the present step.
        """
        assert self.charging is not None
        x = position[:, 0]
        gap = np.maximum(surface_state(self.surface, position).gap, 0.0) + self._separation(x, pressing)
        length = self.pad.length(x)
        found = self.charging.after(gap, voltage, length) if charges is None else charges
        return Charged(found, voltage, gap, length)

    def forces(
        self, position: Floats, voltage: float, touching: Any, pressing: Floats | None = None
    ) -> Floats:
        """Nodal forces on the finger (P, 2); `touching` (P,) says who carries force without an air
        layer.
        """
        pressed = None if pressing is None else pressing[None]
        return self.forces_along(position[None], np.array([voltage]), touching, pressed)[0]

    def forces_along(
        self, positions: Floats, voltages: Floats, touching: Any, pressing: Floats | None = None
    ) -> Floats:
        """`forces` at W places of a way (W, P, 2), from positions (W, P, 2), voltages (W,) and
        contact forces (W, P).
        """
        if not voltages.any() and self.charging is None:
            return np.zeros_like(positions)
        frame = surface_state(self.surface, positions.reshape(-1, positions.shape[-1]))
        x = positions[..., 0]
        gaps = np.maximum(frame.gap, 0.0).reshape(x.shape) + self._separation(x, pressing)
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

    def _separation(self, x: Floats, pressing: Floats | None) -> Any:
        """What rough faces keep between them at the nodes at x (..., P), in mm."""
        if self.roughness is None:
            return 0.0
        return self.roughness.separation(self._contact_pressure(x, pressing))

    def _contact_pressure(self, x: Floats, pressing: Floats | None) -> Floats:
        """Contact pressure in MPa of the nodes at x (..., P)."""
        if pressing is None:
            return np.zeros(x.shape)
        length = self.pad.length(x)
        facing = length > 0.0
        return np.where(facing, np.maximum(pressing, 0.0) / np.where(facing, length, 1.0), 0.0)

    def gain_on_pressing(self, position: Floats, voltage: float, touching: Any, pressing: Floats) -> Floats:
        """By how much the attraction of a node grows per contact force that presses it (P,): the
        rough faces come closer. 0 without them.
        """
        if self.roughness is None:
            return np.zeros(len(position))
        on = 1.0 if self.air_layer else touching.astype(float)
        p = self._contact_pressure(position[:, 0], pressing)
        closer = separation_derivative(self.roughness, p)
        rate = self._rate(self.roughness.separation(p), voltage, position[:, 0])
        return np.asarray(on * rate * closer)

    def negative_stiffness(
        self, position: Floats, voltage: float, touching: Any, pressing: Floats | None = None
    ) -> Floats:
        """How fast the attraction of a node weakens with its vertical gap, -dp/dg A (P,) in N/mm
        per mm; 0 where it touches, where contact holds the gap, and where losses make it grow with
        the gap: that stabilises, and the iterations do without it.
        """
        gap = surface_state(self.surface, position).gap
        on = 1.0 if self.air_layer else touching.astype(float)
        x = position[:, 0]
        apart = np.maximum(gap, 0.0) + self._separation(x, pressing)
        weakening = -on * self._rate(apart, voltage, x) * self.pad.length(x)
        return np.where((gap > TOUCHING) & (weakening > 0.0), weakening, 0.0)

    def _rate(self, apart: Floats, voltage: float, x: Floats) -> Any:
        """dp/dg (P,) in MPa/mm of nodes at x (P,), the charges of the present step following."""
        if self.charging is None:
            return traction_derivative(self.law, apart, voltage, self.layers)
        law = self.law
        seen = lambda g: law.traction(g, self._seen(g, voltage, x), self.layers)  # noqa: E731
        return derivative(seen, apart, GAP_STEP)

    def stiffness(
        self, position: Floats, voltage: float, touching: Any, pressing: Floats | None = None
    ) -> Any:
        """Derivative of `forces` by the node positions, sparse (2 P, 2 P), unknowns ordered (node,
        component).
        """
        size = position.shape[0]
        frame = surface_state(self.surface, position)
        length = self.pad.length(position[:, 0])
        on = 1.0 if self.air_layer else touching.astype(float)
        x = position[:, 0]
        apart = np.maximum(frame.gap, 0.0) + self._separation(x, pressing)
        p = on * self.law.traction(apart, self._seen(apart, voltage, x), self.layers)
        dp = -self.negative_stiffness(position, voltage, touching, pressing)
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
