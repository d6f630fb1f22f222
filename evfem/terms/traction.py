r"""Tractions on the pad: nodal forces that depend on its state, and their linearisation for contact.

`PadState` is the argument of a traction. A traction has forces on the finger, f (P, dim), their derivative
by the positions of the nodes, and three numbers per node for the contact problem: `weakening`, the softening
-df/dg by the node's vertical gap, `gain_on_pressing`, the derivative by the contact force, and `restored`,
the traction on closed nodes that a regularised law removes, and keeps. Forces on open nodes enter the balance
unchanged. The work between two states is that along the straight path of the nodes.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from evfem.common.arrays import FINE_NODES, FINE_WEIGHTS, LEGENDRE, NODES, RESOLVED, WEIGHTS, Floats, Ints
from evfem.common.constants import LEFT_OVER, STABLE
from evfem.common.rooms import Column, Room
from evfem.contact.byforce import OF_GAP_ALONE, ByForce, OfGapAlone
from evfem.surface.pad import Pad, SurfaceState, surface_state
from evfem.surface.skin import Skin

#: how far (mm) positions are shifted to difference a traction by the gap
SHIFT = 1e-7
#: gaps up to this (mm) count as closed
TOUCHING = 1e-9


@dataclass(frozen=True, eq=False)
class PadState:
    """The P nodes of a `pad` above a `surface`: their `position` (P, dim) in mm, touching ones exactly on it,
    the display's `voltage` (V), the contact forces `pressing` (P,) along the normal (N/mm, in space N; None
    for none), which were `touching` (P,) when the step began, the `memory` of rooms, and the `load`, 0 to 1,
    factor of tractions without a voltage: the first substep raises it. On a path of W states positions are
    (W, P, dim), voltages and loads (W,), contact forces (W, P). `below`: the deformed surface.
    """

    pad: Pad | Skin
    surface: Any
    position: Floats
    voltage: Any
    pressing: Floats | None
    touching: Any
    memory: Mapping[str, Any] = field(default_factory=lambda: MappingProxyType({}))
    below: SurfaceState | None = None
    load: Any = 1.0

    @cached_property
    def frame(self) -> SurfaceState:
        """The undeformed surface below the nodes; on a path node by node and state by state."""
        return surface_state(self.surface, self.position.reshape(-1, self.position.shape[-1]))

    @cached_property
    def gap(self) -> Floats:
        """Vertical gaps (..., P) in mm, 0 where a trial state penetrates."""
        return np.maximum(self.frame.gap, 0.0).reshape(self.position.shape[:-1])

    @cached_property
    def lengths(self) -> Floats:
        """Tributary lengths (..., P) in mm, in space areas in mm2, 0 where the outline faces away."""
        return self.pad.tributary(self.position)

    @property
    def pressed(self) -> Floats:
        """Contact forces (..., P), 0 where there are none."""
        return np.zeros(self.position.shape[:-1]) if self.pressing is None else self.pressing

    @property
    def path(self) -> PadState:
        """The same as a path of one state."""
        pressing = None if self.pressing is None else self.pressing[None]
        voltage, load = np.array([self.voltage]), np.array([self.load])
        return replace(self, position=self.position[None], voltage=voltage, load=load, pressing=pressing)

    def states(self) -> list[PadState]:
        """The states of a path, one by one."""
        pressing = [None] * len(self.position) if self.pressing is None else list(self.pressing)
        each = zip(self.position, self.voltage.tolist(), pressing, self.load.tolist(), strict=True)
        on, kept, below = self.touching, self.memory, self.below
        return [
            PadState(self.pad, self.surface, position, volts, force, on, kept, below, load)
            for position, volts, force, load in each
        ]


@dataclass(frozen=True, eq=False)
class PadPath:
    """Path of the pad in a substep: the pad at both ends, the displacements of its nodes relative to the
    surface, `moved` (P, dim), the component of these whose work needs quadrature, beyond the trapezoidal
    rule, `turned` (P, dim), and the forces (P, dim) of the traction at both `ends`.
    """

    old: PadState
    new: PadState
    moved: Floats
    turned: Floats
    ends: tuple[Floats, Floats]

    def at(self, fractions: Floats, voltage: Floats, begin: Floats | None = None) -> PadState:
        """The states at fractions (w,) of the straight path, from `begin` (P, dim) or the old position."""
        start, end = self.old.position if begin is None else begin, self.new.position
        pressed = self.old.pressed, self.new.pressed
        position = start + fractions[:, None, None] * (end - start)
        pressing = pressed[0] + fractions[:, None] * (pressed[1] - pressed[0])
        load = evenly(self.old.load, self.new.load, fractions)
        return replace(self.old, position=position, voltage=voltage, load=load, pressing=pressing)

    @property
    def trapezoidal(self) -> float:
        """Work of the mean of the end forces along what the nodes moved (N mm)."""
        return float(0.5 * np.sum((self.ends[0] + self.ends[1]) * self.moved))


def evenly(before: float, after: float, fractions: Floats) -> Floats:
    """Values (w,) whose square grows evenly from that of `before` to that of `after`; to the last digit the
    same where these are, for states under one load are one call of a law.

    >>> evenly(0.11, 0.11, np.array([0.05])).tolist(), evenly(0.0, 2.0, np.array([0.25])).tolist()
    ([0.11], [1.0])
    """
    if before == after:
        return np.full(fractions.shape, after)
    return np.asarray(np.sqrt((1.0 - fractions) * before**2 + fractions * after**2))


@dataclass(frozen=True, eq=False)
class Reading:
    """A number that a state has, with its derivatives by a kV and by the positions (P, dim)."""

    value: float
    by_voltage: float
    by_position: Floats


def smallest_gap(pad: PadState) -> Reading:
    """The smallest vertical gap of the pad (mm)."""
    assert pad.below is not None
    least = int(np.argmin(pad.below.gap))
    by_position = np.zeros_like(pad.position)
    by_position[least, ::2], by_position[least, 1] = -pad.below.slope[least], 1.0
    return Reading(float(pad.below.gap[least]), 0.0, by_position)


class Entries(NamedTuple):
    """Entries (K,) of a matrix (size, size) at these rows and columns; duplicates add up."""

    size: int
    row: Ints
    column: Ints
    value: Floats

    @classmethod
    def of(cls, size: int, blocks: Iterable[tuple[Any, Any, Any]]) -> Entries:
        """From several rows, columns and values at once, broadcast."""
        whole = [np.broadcast_arrays(*block) for block in blocks]
        if not whole:
            return cls(size, *(np.zeros(0, dtype=np.int64),) * 2, np.zeros(0))
        return cls(size, *(np.concatenate([each[i].ravel() for each in whole]) for i in range(3)))

    def summed(self) -> Entries:
        """The same without duplicates."""
        flat, of = np.unique(self.size * self.row + self.column, return_inverse=True)
        row, column = np.divmod(flat, self.size)
        value: Any = np.bincount(of, self.value, flat.size)
        return Entries(self.size, row, column, value)

    def toarray(self) -> Floats:
        """The dense matrix."""
        flat: Any = np.bincount(self.size * self.row + self.column, self.value, self.size**2)
        return flat.reshape(self.size, self.size)


def force_columns(name: str, label: str, dim: int = 3) -> tuple[Column, ...]:
    """Columns of the force and the work of a traction."""
    force = Column(f"{name}_force", "N/mm", f"{label}, downwards")
    along = (
        Column(f"{name}_force_{axis}", "N/mm", f"{axis} component of {label}") for axis in "xz"[: dim - 1]
    )
    return force, *along, Column(f"{name}_work", "N", f"done by {label}")


def limited_gain(gain: Floats) -> Floats:
    """Gains of the attraction per contact force (P,), limited for the tangent.

    At a gain of 1 the node's equilibrium has a fold; above, the force grows by itself until rough faces,
    say, are close. Iterations shall leave such a point, and converge to one with a gain below 1 by its exact
    tangent: above `STABLE` the tangent has abs(1 - gain), from `LEFT_OVER` to 1 - `STABLE`.

    >>> limited_gain(np.array([0.5, 0.95, 1.0, 1.05, 8.0])).round(12).tolist()
    [0.5, 0.95, 0.99, 0.95, 0.9]
    """
    left = np.clip(np.abs(1.0 - gain), LEFT_OVER, 1.0 - STABLE)
    return np.where(gain > STABLE, 1.0 - left, gain)


class PadTraction(Room):
    """Forces on the pad's nodes that depend on their positions; here none.

    A user-defined traction has a `name` and `forces`, `by_gap` for their slope in closed form, and `of_rates`
    where they depend on a rate. Its columns are NAME_force (N/mm, downwards), NAME_force_x and NAME_work (N).
    `begin` and `accept` get the `PadState` instead of the state. Its energy is the work of its forces:
    `stored`, `kinetic`, `work` and `dissipation` are not called.
    """

    #: of its columns in the history
    name = "traction"
    #: whether it acts without a voltage: as much then as at any
    always = True
    #: "vertical", or "normal" to the outline: where a contact force lets it grow
    direction = "vertical"
    #: whether `work` is known from an energy; whether forces are more than those of columns; what rounding
    #: does to them, as a fraction of the largest nodal one; whether charge flows in a step
    has_energy, has_fringes, rounding, flows = False, False, 0.0, False

    @property
    def parts(self) -> tuple[Any, ...]:
        """The tractions of which this is the sum."""
        return (self,)

    @property
    def keeping(self) -> tuple[Any, ...]:
        """Itself if it counts from where a step begins or keeps anything from it."""
        return (self,)

    #: what it is in the columns' meanings, its name if empty
    label = ""

    def named(self, dim: int) -> tuple[Column, ...]:
        """Columns of its force and its work."""
        return force_columns(self.name, self.label or self.name, dim)

    def acts(self, voltage: float) -> bool:
        """Whether it pulls at all at this voltage of the display (V)."""
        return True

    def forces(self, pad: PadState) -> Floats:
        """Nodal forces on the finger (P, dim) in N/mm, in space N."""
        return np.zeros_like(pad.position)

    def forces_along(self, path: PadState) -> Floats:
        """`forces` in the W states of a path, (W, P, dim)."""
        return np.stack([self.forces(pad) for pad in path.states()])

    def weights(self, pad: PadState) -> Floats:
        """Lengths or areas (P,) by which the forces are tractions."""
        return pad.lengths

    def by_gap(self, pad: PadState) -> Floats:
        """Derivative of the vertical forces (P,) on open nodes, each by its own gap, in N/mm per mm: above 0
        where a pull falls with the gap, below 0 where the traction resists; differenced, as of a law of the
        gap.
        """
        shift = np.zeros(pad.position.shape[1])
        shift[1] = SHIFT
        more, less = (self.forces(replace(pad, position=pad.position + s * shift)) for s in (1.0, -1.0))
        slope = (more - less)[:, 1] / (2.0 * SHIFT)
        return np.where(pad.frame.gap > TOUCHING, slope, 0.0)

    def weakening(self, pad: PadState) -> Floats:
        """Decrease of a node's pull with its own vertical gap, not negative, (P,) in N/mm per mm."""
        return np.maximum(self.by_gap(pad), 0.0)

    def varies_over(self, pad: PadState) -> Floats:
        """Lengths (P,) in mm over which the pull changes, force over slope: derivatives of a run by
        its parameters are differences over a small fraction of them.
        """
        pull, rate = np.abs(self.forces(pad)[:, 1]), np.abs(self.by_gap(pad))
        return np.where(pull > 0.0, pull / np.maximum(rate, 1e-300), np.inf)

    def gain_on_pressing(self, pad: PadState) -> Floats:
        """Growth of a node's pull per contact force (P,)."""
        return np.zeros(len(pad.position))

    def by_force(self, pad: PadState) -> OfGapAlone:
        """How the forces depend on the contact forces, along the axes of the surface."""
        gain, law, surface = self.gain_on_pressing(pad), self.column_law, pad.below
        if not gain.any():
            return OF_GAP_ALONE
        assert surface is not None
        without, now = (law.forces(one)[:, 1] for one in (replace(pad, pressing=None), pad))
        lost = self.tangent_factor(pad) * (without - now)
        along = surface.axes[:, :, 0]  # of a pull straight down
        if self.direction == "normal":
            along = np.zeros_like(along)
            along[:, 0] = surface.stretch
        by_axis = gain[:, None] * along
        # the full tangential gain could close a node on a slope by more than the limited normal gain holds
        by_axis[:, 1:] = np.where(by_axis[:, :1] > STABLE, 0.0, by_axis[:, 1:])
        by_axis[:, 0] = limited_gain(by_axis[:, 0])
        return ByForce(by_axis, lost[:, None] * along, pad.pressed)

    def stiffness(self, pad: PadState) -> Entries:
        """Derivative of `forces` by node positions (dim P, dim P), ordered (node, component)."""
        up = 1 + pad.position.shape[1] * np.arange(len(pad.position))
        return Entries.of(pad.position.size, [(up, up, self.by_gap(pad))])

    def full_stiffness(self, pad: PadState) -> Entries:
        """The same with what fringes of the field add."""
        return self.stiffness(pad)

    def restored(self, voltage: float) -> tuple[Any, Any]:
        """Traction of closed nodes (P,) in MPa that a regularised law removes, and keeps; 0 without one."""
        return 0.0, 0.0

    @property
    def column_law(self) -> Any:
        """The traction whose derivative `weakening` is, and that resolves how it grows as gaps close."""
        return self

    def tangent_factor(self, pad: PadState) -> Any:
        """Factor (P,), or 1, of the derivatives of the `column_law` in the tangent of the forces."""
        return 1.0

    #: whether the forces depend on rates, which are partial between the ends of a substep: the work is then
    #: that of the mean of the end forces
    of_rates = False

    def work_along(self, path: PadPath) -> float:
        """Work on the finger in a substep (N mm)."""
        if self.of_rates or not path.turned.any():
            return path.trapezoidal
        return path.trapezoidal + self.power(path, path.turned) - self.power_of_ends(path, path.turned)

    def work_apart(self, path: PadPath) -> float:
        """Work (N mm) that the order in which charge and pad move adds to that of the end forces."""
        return 0.0

    def of_one_charge(self, path: list[PadState]) -> Floats:
        """Voltages (W,) in the states of a path at which the electrode has the charge of the last one."""
        return np.array([pad.voltage for pad in path])

    def power_of_ends(self, path: PadPath, along: Floats) -> float:
        """Work along `along` (P, dim) by the mean of the end forces (N mm)."""
        return float(0.5 * np.sum((path.ends[0] + path.ends[1]) * along))

    def power(self, path: PadPath, along: Floats) -> float:
        """Work along `along` (P, dim) of the straight path by quadrature (N mm)."""
        values = self.powers(path, along, NODES)
        size = np.abs(LEGENDRE @ values)
        if size[-2:].max() > RESOLVED * size.max():
            return float(FINE_WEIGHTS @ self.powers(path, along, FINE_NODES))
        return float(WEIGHTS @ values)

    def powers(self, path: PadPath, along: Floats, fractions: Floats, begin: Floats | None = None) -> Floats:
        """Powers (w,) along `along` (P, dim) at fractions (w,) of the straight path, from `begin` (P, dim) if
        or the old position, the squared voltage growing evenly; with fringe fields that of the columns.
        """
        volts = evenly(path.old.voltage, path.new.voltage, fractions)
        forces = self.column_law.forces_along(path.at(fractions, volts, begin))
        return np.asarray(np.sum(forces * along, axis=(1, 2)))

    def released_work(
        self, path: PadPath, along: Floats, begin: Floats, fractions: Floats, control: Any
    ) -> Floats:
        """Work (w,) in N mm under the loads of the end up to fractions (w,) of the straight path from `begin`
        (P, dim), along `along` (P, dim), with the voltages that a `control` has there.
        """
        held = replace(path, old=replace(path.old, load=path.new.load))
        pads = held.at(fractions, np.full(fractions.shape, path.new.voltage), begin)
        forces = self.column_law.forces_along(replace(pads, voltage=control.along(self, pads.states())))
        power = np.sum(forces * along, axis=(1, 2))
        return np.append(0.0, np.cumsum(0.5 * (power[1:] + power[:-1]) * np.diff(fractions)))


class NoTraction(PadTraction):
    """Nothing pulls: the empty sum."""

    always = False

    @property
    def parts(self) -> tuple[Any, ...]:
        return ()

    @property
    def keeping(self) -> tuple[Any, ...]:
        return ()

    def acts(self, voltage: float) -> bool:
        return False

    def forces_along(self, path: PadState) -> Floats:
        return np.zeros_like(path.position)

    def by_gap(self, pad: PadState) -> Floats:
        return np.zeros(len(pad.position))
