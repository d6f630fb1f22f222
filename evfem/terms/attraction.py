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

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.constants import KILOVOLT
from evfem.electrostatics.laws import GAP_STEP, traction_derivative
from evfem.electrostatics.localgaps import over_gaps
from evfem.electrostatics.roughness import separation_derivative
from evfem.surface.pad import Pad
from evfem.surface.skin import Skin
from evfem.tensor import derivative, mul, positive_part
from evfem.terms.charging import NO_CHARGES, Charged
from evfem.terms.traction import TOUCHING, Entries, PadPath, PadState, PadTraction, Reading
from evfem.tissue.forms import deformation_gradient, form


@form
def attraction(u: Any, v: Any, w: Any) -> Any:
    """p(g) v_y in the residual on the current projected width max(0, (F T)_x), with g the gap below X + u."""
    T = np.stack([-w.n[1], w.n[0]])
    width = positive_part(mul(deformation_gradient(u), T)[0])
    x, y = w.x[0] + u[0], w.x[1] + u[1]
    gap = positive_part(y - w.surface.y - w.surface.height(x))
    return w.law.traction(gap, w.voltage, w.layers) * width * v[1]


#: name of the traction of a voltage, whose columns every history has
ELECTROSTATIC = "electrostatic"
#: strength of adhesion, instead of a voltage
ON = 1.0


@dataclass(frozen=True, eq=False)
class Attraction(PadTraction):
    """A force law acting on a pad: `layers` are the solid layers under each pad node, `surface`
    the electrode's outline, `roughness` how far rough faces stay apart in contact (None: not at all).
    """

    law: Any
    layers: Any
    pad: Pad | Skin
    surface: Any
    direction: str = "vertical"
    air_layer: bool = True
    roughness: Any = None
    charging: Any = NO_CHARGES
    #: of its columns in the history
    name: str = field(default=ELECTROSTATIC, kw_only=True)
    #: whether it acts without a voltage; the argument of its law is then the strength `ON`
    always: bool = field(default=False, kw_only=True)
    label: str = field(default="attraction", kw_only=True)

    @property
    def flows(self) -> bool:  # type: ignore[override]
        return bool(self.charging.flows)

    @property
    def keeping(self) -> tuple[Any, ...]:
        return (self,) if self.flows else ()

    def load(self, pad: PadState) -> Any:
        """What its law takes as a voltage (V)."""
        return ON * pad.load if self.always else pad.voltage

    def acts(self, voltage: float) -> bool:
        """Whether anything attracts at this voltage: charges may without it."""
        return voltage != 0.0 or self.always or self.flows

    def state(self, position: Floats, voltage: float, touching: Any = False) -> PadState:
        """Its pad at `position` (P, dim) under a voltage (V), not pressed, some nodes `touching` (P,)."""
        on = np.broadcast_to(np.asarray(touching, dtype=bool), (len(position),))
        return PadState(self.pad, self.surface, position, voltage, None, on)

    # -- charges

    def memory(self, state: Any) -> dict[str, Floats]:
        return self.charging.memory

    def restart(self, old: Any, target: Any) -> dict[str, Floats]:
        return self.charging.nothing_supplied

    def begin(self, old: PadState, seconds: float) -> None:
        if self.flows:
            self.charging.begin(self.charged(old), seconds)

    def accept(self, old: PadState, new: PadState) -> dict[str, Floats]:
        if not self.flows:
            return {}
        charged = self.charged(new, at_end=True)
        supplied = old.memory["supplied"] + self.charging.flow(charged).supplied
        return {"charges": charged.charges, "supplied": supplied}

    def charged(self, pad: PadState, *, at_end: bool = False) -> Charged:
        """The electric state of a pad: with its charges, or those `at_end` of the step."""
        gap, length = self.gaps(pad), self._lengths(pad)
        charges = self.charging.after(gap, pad.voltage, length) if at_end else pad.memory["charges"]
        return Charged(charges, pad.voltage, gap, length)

    def electrode_charge(self, pad: PadState) -> Reading:
        """Charge over eps_0 (V, in space V mm): its derivative by a touching node's gap is left out."""
        at, below = self.charged(pad, at_end=True), pad.below
        assert below is not None
        by_gap, by_length = self.charging.charge_slopes(at)
        by_gap = np.where(below.gap > TOUCHING, by_gap, 0.0)
        by_position = np.zeros_like(pad.position)
        by_position[:, ::2], by_position[:, 1] = -by_gap[:, None] * below.slope, by_gap
        of, moved, value = self.pad.tributary_gradient(pad.position)
        more = np.bincount(moved, by_length[of] * value, by_position.size)
        by_voltage = KILOVOLT * self.charging.capacity(at)
        return Reading(
            self.charging.electrode_charge(at), by_voltage, by_position + more.reshape(by_position.shape)
        )

    def work_apart(self, path: PadPath) -> float:
        """Charges follow at the end, where they follow a prescribed charge they do so along the path."""
        return self.work_along(path) - path.trapezoidal if self.flows else 0.0

    def of_one_charge(self, path: list[PadState]) -> Floats:
        """In which that charge is linear."""
        volts = super().of_one_charge(path)
        if not self.flows:
            return volts
        readings = [self.electrode_charge(pad) for pad in path]
        return volts + KILOVOLT * np.array(
            [(readings[-1].value - one.value) / one.by_voltage for one in readings]
        )

    def unit(self, pad: PadState) -> Floats:
        """Attraction (P, dim) of a kV."""
        return self.forces(replace(pad, voltage=KILOVOLT))

    # -- forces

    def gaps(self, pad: PadState) -> Any:
        """Gaps (..., P) in mm that the law sees, with the separation of rough faces."""
        return pad.gap + self._separation(pad)

    def over_gaps(self, pad: PadState, of: Any) -> Any:
        """Mean (P,) of a quantity of the gap over the local gaps of each node."""
        return over_gaps(self.roughness, of, pad.gap, self._contact_pressure(pad))

    def _voltages(self, gap: Any, pad: PadState) -> Any:
        """Effective voltage at gaps (P,), with that of the charges."""
        return self.charging.effective(gap, self.load(pad), self._lengths(pad))

    def _lengths(self, pad: PadState) -> Floats:
        """Tributary lengths (..., P) in mm of the nodes on its own edges."""
        return pad.lengths if pad.pad is self.pad else self.pad.tributary(pad.position)

    def _on(self, pad: PadState) -> Any:
        """1 of nodes that carry force, 0 of others."""
        return 1.0 if self.air_layer else pad.touching.astype(float)

    def carrying(self, pad: PadState) -> Any:
        """Tributary lengths (..., P) in mm of the nodes that carry force."""
        return self._on(pad) * self._lengths(pad)

    def forces(self, pad: PadState) -> Floats:
        return self.forces_along(pad.path)[0]

    def weights(self, pad: PadState) -> Floats:
        return self._lengths(pad)

    def forces_along(self, path: PadState) -> Floats:
        positions = path.position
        if not (self.flows or np.any(self.load(path))):
            return np.zeros_like(positions)
        gaps, on = self.gaps(path), self._on(path)
        pressure = self._of_law(self.law.traction, gaps, path)
        weight = on * pressure * self._lengths(path)
        if self.direction == "vertical":
            forces = np.zeros_like(positions)
            forces[..., 1] = -weight
            return forces
        potential = on * self._of_law(self.law.potential, gaps, path)
        forces = np.stack([self._sideways(*each) for each in zip(positions, potential, strict=True)])
        forces[..., ::2] += weight[..., None] * path.frame.slope.reshape(*weight.shape, -1)
        forces[..., 1] = -weight
        return forces

    def _of_law(self, values: Any, gaps: Floats, path: PadState) -> Floats:
        """Values (W, P) of the law in the states of a path: at once where these have all in common."""
        harmonics = np.ndim(getattr(self.layers, "reduced", 0.0)) > 1  # their axis comes before the nodes
        loads = self.load(path)
        if not (self.flows or harmonics) and (loads == loads[0]).all():
            return np.asarray(values(gaps, float(loads[0]), self.layers))
        at = zip(gaps, path.states(), strict=True)
        return np.array([values(gap, self._voltages(gap, pad), self.layers) for gap, pad in at])

    def restored(self, voltage: float) -> tuple[Floats, Floats]:
        none = np.zeros(self.pad.nodes.size)
        load = ON if self.always else voltage
        if not hasattr(self.law, "withheld") or load == 0.0:
            return none, none
        withheld, left = self.law.withheld(load, self.layers)
        if not np.any(left):  # closed faces are out of its reach
            return none, none
        return none + withheld, none + left

    def _sideways(self, position: Floats, potential: Floats) -> Floats:
        """Forces (P, dim) along the display that enlarge what nodes stand for, by the potential (P,)."""
        of, moved, value = self.pad.tributary_gradient(position)
        found = np.bincount(moved, -potential[of] * value, position.size)
        return found.astype(float, copy=False).reshape(position.shape)

    def _separation(self, pad: PadState) -> Any:
        """Separation (..., P) of rough faces in mm."""
        return 0.0 if self.roughness is None else self.roughness.separation(self._contact_pressure(pad))

    def _contact_pressure(self, pad: PadState) -> Floats:
        """Contact pressure (..., P) in MPa."""
        length = self._lengths(pad)
        facing = length > 0.0
        return np.where(facing, np.maximum(pad.pressed, 0.0) / np.where(facing, length, 1.0), 0.0)

    def varies_over(self, pad: PadState) -> Floats:
        at = pad.gap, self.load(pad), self.layers
        pull, rate = np.abs(self.law.traction(*at)), np.abs(traction_derivative(self.law, *at))
        return np.where(pull > 0.0, pull / np.maximum(rate, 1e-300), np.inf)

    def gain_on_pressing(self, pad: PadState) -> Floats:
        """Growth of a node's attraction per contact force (P,): the rough faces come closer."""
        if self.roughness is None:
            return np.zeros(len(pad.position))
        p = self._contact_pressure(pad)
        closer = separation_derivative(self.roughness, p)
        return np.asarray(self._on(pad) * self._rate(self.roughness.separation(p), pad) * closer)

    def weakening(self, pad: PadState) -> Floats:
        """-dp/dg A (P,) in N/mm per mm; 0 where contact holds the gap, and where losses make the attraction
        grow with the gap, which stabilises.
        """
        rate = self._rate(self.gaps(pad), pad)
        weakening = -self._on(pad) * rate * self._lengths(pad)
        return np.where((pad.frame.gap > TOUCHING) & (weakening > 0.0), weakening, 0.0)

    def _rate(self, apart: Floats, pad: PadState) -> Any:
        """dp/dg (P,) in MPa/mm at gaps (P,), the charges of the present step following."""
        if not self.flows:
            return traction_derivative(self.law, apart, self.load(pad), self.layers)
        law = self.law
        return derivative(lambda g: law.traction(g, self._voltages(g, pad), self.layers), apart, GAP_STEP)

    def stiffness(self, pad: PadState) -> Entries:
        position, frame, on = pad.position, pad.frame, self._on(pad)
        size, dim = position.shape
        horizontal, apart = np.arange(0, dim, 2), self.gaps(pad)
        voltages = self._voltages(apart, pad)
        p = on * self.law.traction(apart, voltages, self.layers)
        dp = -self.weakening(pad)
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

    # -- work

    def work_along(self, path: PadPath) -> float:
        if self.flows:
            return self._work_of_charged(path)
        if not (self.load(path.old) or self.load(path.new)):
            return path.trapezoidal
        # along the path of the bone the mean force does the work, and along a vertical pull's level nothing
        if self.direction == "vertical" and not path.turned[:, 1].any():
            return path.trapezoidal
        return super().work_along(path)

    def _work_of_charged(self, path: PadPath) -> float:
        """Work while the pad moves with its old charges and voltage."""
        volts = self.charging.old.voltage
        ends = replace(path.old, voltage=volts), replace(path.new, voltage=volts)
        with self.charging.standing():
            return self.power(replace(path, old=ends[0], new=ends[1]), path.moved)

    def powers(self, path: PadPath, along: Floats, fractions: Floats, begin: Floats | None = None) -> Floats:
        if not self.flows:
            return super().powers(path, along, fractions, begin)
        volts = np.full(fractions.shape, path.old.voltage)  # its sign counts where there are charges
        return np.asarray(np.sum(self.forces_along(path.at(fractions, volts, begin)) * along, axis=(1, 2)))

    def released_work(
        self, path: PadPath, along: Floats, begin: Floats, fractions: Floats, control: Any
    ) -> Floats:
        if self.always and path.new.surface.is_flat:
            return self._by_potential(path, begin, fractions)
        with self.charging.ending(lambda: self.charged(path.new)):
            return super().released_work(path, along, begin, fractions, control)

    def _by_potential(self, path: PadPath, begin: Floats, fractions: Floats) -> Floats:
        """Work of a pull whose reach may be short, above a flat surface, by its potential."""
        ends = [replace(pad, position=at) for pad, at in ((path.old, begin), (path.new, path.new.position))]
        gap = [pad.frame.gap for pad in ends]
        gaps = np.maximum(np.outer(1.0 - fractions, gap[0]) + np.outer(fractions, gap[1]), 0.0)
        length = 0.5 * (self.weights(ends[0]) + self.weights(ends[1]))
        energy = np.asarray(self.law.potential(gaps)) @ length
        return np.asarray(energy[0] - energy)
