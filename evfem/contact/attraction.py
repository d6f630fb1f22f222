r"""Electrostatic attraction of the pad: nodal forces (9a), (9b), (10) and their derivative.

Each pad node j carries the pressure p(g_j) of its current gap on its current projected length A_j, the nodal
rule of the weak form `attraction` below (docs, Theory). Trial states that penetrate count as touching, g = 0.

- ``vertical`` (the paper): :math:`f_y = -p(g_j) A_j`. Not conservative: moving a neighbour sideways changes
  A_j without work.
- ``normal``: minus the derivative of :math:`W = \sum_j \Pi(g_j) A_j`, the Maxwell traction on the deformed
  outline; its tangent is symmetric.

Without an air layer only touching nodes carry force. Forces act on the finger, in N per mm of depth; in three
dimensions A_j is the node's projected area (`evfem.surface.skin`), and forces are in N.

Rough faces keep a separation s(p) where they touch (`evfem.electrostatics.roughness`): the law then
has the gap g + s, with p the node's own contact pressure, its pressing force over A_j. A node that is
pressed by d lam_n more is pulled by :math:`p'(s)\,s'(p)\,d\lambda_n` more (`gain_on_pressing`).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.contact.charging import Charged, Charging
from evfem.electrostatics.laws import GAP_STEP, traction_derivative
from evfem.electrostatics.roughness import separation_derivative
from evfem.rooms import Room
from evfem.surface.pad import Pad, surface_state
from evfem.surface.skin import Skin
from evfem.tensor import derivative, mul, positive_part
from evfem.tissue.forms import deformation_gradient, form

#: gaps up to this (mm) count as closed
TOUCHING = 1e-9


@form
def attraction(u: Any, v: Any, w: Any) -> Any:
    """p(g) v_y in the residual on the current projected width max(0, (F T)_x), with g the gap below X + u."""
    T = np.stack([-w.n[1], w.n[0]])
    width = positive_part(mul(deformation_gradient(u), T)[0])
    x, y = w.x[0] + u[0], w.x[1] + u[1]
    gap = positive_part(y - w.surface.y - w.surface.height(x))
    return w.law.traction(gap, w.voltage, w.layers) * width * v[1]


class Entries(NamedTuple):
    """Entries (K,) of a matrix (size, size) at these rows and columns; those of one place add up."""

    size: int
    row: Ints
    column: Ints
    value: Floats

    @classmethod
    def of(cls, size: int, blocks: Iterable[tuple[Any, Any, Any]]) -> Entries:
        """From several rows, columns and values at once, broadcast."""
        whole = [np.broadcast_arrays(*block) for block in blocks]
        return cls(size, *(np.concatenate([each[i].ravel() for each in whole]) for i in range(3)))

    def toarray(self) -> Floats:
        """The dense matrix."""
        flat: Any = np.bincount(self.size * self.row + self.column, self.value, self.size**2)
        return flat.reshape(self.size, self.size)


#: adhesion, in the place of a voltage: it is always on
ON = 1.0


class NoAttraction(Room):
    """Nothing attracts: the empty sum of attractions."""

    law = layers = roughness = charging = None
    direction, parts, rounding = "vertical", (), 0.0
    has_energy = has_fringes = False

    def acts(self, voltage: float) -> bool:
        """Never."""
        return False

    def forces(self, position: Floats, voltage: float, touching: Any, pressing: Any = None) -> Floats:
        """Nodal forces on the finger (P, dim)."""
        return np.zeros_like(position)

    def weights(self, position: Floats) -> Floats:
        """By what its forces (P,), which are 0, are tractions."""
        return np.ones(len(position))

    def restored(self, voltage: float) -> tuple[Floats | float, Floats | float]:
        """Nothing is withheld."""
        return 0.0, 0.0


@dataclass(frozen=True, eq=False)
class Attraction(Room):
    """A force law acting on a pad: `layers` are the solid layers under each pad node, `surface`
    the electrode's outline, `roughness` how far rough faces stay apart in contact (None: not at all).

    `pressing` (P,) are the present contact forces along the normal in N/mm, None for none.
    """

    law: Any
    layers: Any
    pad: Pad | Skin
    surface: Any
    direction: str = "vertical"
    air_layer: bool = True
    roughness: Any = None
    charging: Charging | None = None
    #: of its columns in the history
    name: str = field(default="electrostatic", kw_only=True)
    #: whether it acts without a voltage; its law then takes the strength `ON` in the place of one
    always: bool = field(default=False, kw_only=True)

    @property
    def parts(self) -> tuple[Attraction, ...]:
        """The attractions of which this is the sum."""
        return (self,)

    def load(self, voltage: float) -> float:
        """What its law takes as a voltage (V) when that of the display is `voltage`."""
        return ON if self.always else voltage

    def acts(self, voltage: float) -> bool:
        """Whether anything attracts at this voltage: charges may without it."""
        return voltage != 0.0 or self.always or self.charging is not None

    def _voltages(self, gap: Any, voltage: float, position: Floats) -> Any:
        """Effective voltage at gaps (P,) of nodes at (P, dim), with that of the charges."""
        if self.charging is None:
            return voltage
        return self.charging.effective(gap, voltage, self.pad.tributary(position))

    def charged(
        self, position: Floats, voltage: float, pressing: Floats | None, charges: Floats | None = None
    ) -> Charged:
        """The electric state at positions (P, dim): with the charges (M, P), or those at the step's end."""
        assert self.charging is not None
        apart = self._separation(position, pressing)
        gap = np.maximum(surface_state(self.surface, position).gap, 0.0) + apart
        length = self.pad.tributary(position)
        found = self.charging.after(gap, voltage, length) if charges is None else charges
        return Charged(found, voltage, gap, length)

    def memory(self, state: Any) -> dict[str, Floats]:
        """Charges over eps_0 (M, P) in V/mm of an uncharged pad, where they move."""
        return {} if self.charging is None else {"charges": self.charging.none}

    def forces(self, position: Floats, voltage: float, touching: Any, pressing: Any = None) -> Floats:
        """Nodal forces on the finger (P, dim); without an air layer only `touching` nodes (P,) have any."""
        pressed = None if pressing is None else pressing[None]
        return self.forces_along(position[None], np.array([voltage]), touching, pressed)[0]

    def weights(self, position: Floats) -> Floats:
        """Lengths or areas (P,) by which the forces are tractions, at positions (P, dim)."""
        return self.pad.tributary(position)

    #: whether `work` is known from an energy
    has_energy = False
    #: whether the forces are more than those of columns
    has_fringes = False
    #: what rounding does to the forces, as a fraction of the largest nodal one
    rounding = 0.0

    @property
    def column_law(self) -> Attraction:
        """The attraction whose derivative `stiffness` is, and that resolves how it grows as gaps close."""
        return self

    def forces_along(
        self, positions: Floats, voltages: Floats, touching: Any, pressing: Floats | None = None
    ) -> Floats:
        """`forces` at W places (W, P, dim) of a way, by voltages (W,) and contact forces (W, P)."""
        if not voltages.any() and self.charging is None:
            return np.zeros_like(positions)
        frame = surface_state(self.surface, positions.reshape(-1, positions.shape[-1]))
        gaps = np.maximum(frame.gap, 0.0).reshape(positions.shape[:-1])
        gaps = gaps + self._separation(positions, pressing)
        on = 1.0 if self.air_layer else touching.astype(float)
        pressure = self._of_law(self.law.traction, gaps, voltages, positions)
        weight = on * pressure * self.pad.tributary(positions)
        if self.direction == "vertical":
            forces = np.zeros_like(positions)
            forces[..., 1] = -weight
            return forces
        potential = on * self._of_law(self.law.potential, gaps, voltages, positions)
        forces = np.stack([self._sideways(*each) for each in zip(positions, potential, strict=True)])
        forces[..., ::2] += weight[..., None] * frame.slope.reshape(*weight.shape, -1)
        forces[..., 1] = -weight
        return forces

    def _of_law(self, values: Any, gaps: Floats, voltages: Floats, positions: Floats) -> Floats:
        """Values (W, P) of the law at W places of a way: at once where these have all in common."""
        harmonics = np.ndim(getattr(self.layers, "reduced", 0.0)) > 1  # their axis comes before the nodes
        if self.charging is None and not harmonics and (voltages == voltages[0]).all():
            return np.asarray(values(gaps, float(voltages[0]), self.layers))
        at = zip(gaps, voltages.tolist(), positions, strict=True)
        return np.array([values(gap, self._voltages(gap, u, place), self.layers) for gap, u, place in at])

    def restored(self, voltage: float) -> tuple[Floats, Floats]:
        """Of closed nodes' attraction (P,) in MPa what a regularised law takes away and leaves, else 0."""
        none = np.zeros(self.pad.nodes.size)
        if not hasattr(self.law, "withheld") or voltage == 0.0:
            return none, none
        withheld, left = self.law.withheld(voltage, self.layers)
        if not np.any(left):  # closed faces are out of its reach
            return none, none
        return none + withheld, none + left

    def tangent_factor(self, position: Floats, voltage: float, touching: Any, pressing: Any = None) -> Any:
        """Factor (P,), or 1, of the derivatives of the `column_law` in the tangent of the forces."""
        return 1.0

    def _sideways(self, position: Floats, potential: Floats) -> Floats:
        """Forces (P, dim) along the display that enlarge what nodes stand for, by the potential (P,)."""
        of, moved, value = self.pad.tributary_gradient(position)
        found = np.bincount(moved, -potential[of] * value, position.size)
        return found.astype(float, copy=False).reshape(position.shape)

    def _separation(self, position: Floats, pressing: Floats | None) -> Any:
        """Separation of rough faces at nodes at (..., P, dim), in mm."""
        if self.roughness is None:
            return 0.0
        return self.roughness.separation(self._contact_pressure(position, pressing))

    def _contact_pressure(self, position: Floats, pressing: Floats | None) -> Floats:
        """Contact pressure in MPa of the nodes at (..., P, dim)."""
        if pressing is None:
            return np.zeros(position.shape[:-1])
        length = self.pad.tributary(position)
        facing = length > 0.0
        return np.where(facing, np.maximum(pressing, 0.0) / np.where(facing, length, 1.0), 0.0)

    def gain_on_pressing(self, position: Floats, voltage: float, touching: Any, pressing: Floats) -> Floats:
        """Growth of a node's attraction per contact force (P,): the rough faces come closer."""
        if self.roughness is None:
            return np.zeros(len(position))
        on = 1.0 if self.air_layer else touching.astype(float)
        p = self._contact_pressure(position, pressing)
        closer = separation_derivative(self.roughness, p)
        rate = self._rate(self.roughness.separation(p), voltage, position)
        return np.asarray(on * rate * closer)

    def negative_stiffness(
        self, position: Floats, voltage: float, touching: Any, pressing: Floats | None = None
    ) -> Floats:
        """Decrease of a node's attraction with its vertical gap, -dp/dg A (P,) in N/mm per mm; 0 where
        contact holds the gap, and where losses make it grow with the gap, which stabilises.
        """
        gap = surface_state(self.surface, position).gap
        on = 1.0 if self.air_layer else touching.astype(float)
        apart = np.maximum(gap, 0.0) + self._separation(position, pressing)
        rate = self._rate(apart, voltage, position)
        weakening = -on * rate * self.pad.tributary(position)
        return np.where((gap > TOUCHING) & (weakening > 0.0), weakening, 0.0)

    def _rate(self, apart: Floats, voltage: float, position: Floats) -> Any:
        """dp/dg (P,) in MPa/mm of nodes at (P, dim), the charges of the present step following."""
        if self.charging is None:
            return traction_derivative(self.law, apart, voltage, self.layers)
        law = self.law
        seen = lambda g: law.traction(g, self._voltages(g, voltage, position), self.layers)  # noqa: E731
        return derivative(seen, apart, GAP_STEP)

    def stiffness(self, position: Floats, voltage: float, touching: Any, pressing: Any = None) -> Entries:
        """Derivative of `forces` by node positions (dim P, dim P), ordered (node, component)."""
        size, dim = position.shape
        frame, horizontal = surface_state(self.surface, position), np.arange(0, dim, 2)
        on = 1.0 if self.air_layer else touching.astype(float)
        apart = np.maximum(frame.gap, 0.0) + self._separation(position, pressing)
        voltages = self._voltages(apart, voltage, position)
        p = on * self.law.traction(apart, voltages, self.layers)
        dp = -self.negative_stiffness(position, voltage, touching, pressing)
        of, moved, value = self.pad.tributary_gradient(position)
        nodes = np.arange(size)
        up, aside = dim * nodes + 1, dim * nodes[:, None] + horizontal
        blocks = [
            (up, up, -dp),
            (up[:, None], aside, dp[:, None] * frame.slope),
            (dim * of + 1, moved, -p[of] * value),
        ]
        if self.direction == "normal":
            w = p * self.pad.tributary(position)
            square = frame.slope[:, :, None] * frame.slope[:, None, :]
            own = w[:, None, None] * frame.curvature - dp[:, None, None] * square
            shared = (p[:, None] * frame.slope)[of] * value[:, None]
            at = dim * of[:, None] + horizontal
            blocks += [
                (aside, up[:, None], dp[:, None] * frame.slope),
                (aside[:, :, None], aside[:, None, :], own),
                (at, moved[:, None], shared),
                (moved, dim * of + 1, -p[of] * value),
                (moved[:, None], at, shared),
            ]
            potential = on * self.law.potential(apart, voltages, self.layers)
            row, column, turned = self.pad.tributary_curvature(position, potential)
            blocks.append((row, column, -turned))
        return Entries.of(dim * size, blocks)
