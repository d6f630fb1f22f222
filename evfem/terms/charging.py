"""Charges of the pad nodes under a voltage that is resolved in time: internal variables of the attraction.

Each node is a stack of stratum corneum, gap and insulator (`evfem.electrostatics.relaxation`) on its
tributary length A: M = 2 charges, with their polarisations where dielectrics relax. In a step first the pad
moves with its charges and voltage, then charge flows while the voltage goes straight to its new value, or as
a kept charge of the electrode has it (`KeptCourse`). The charges at the end are a function of gap and
voltage. Each term of the balance has its own integral::

    source work = change of the field energy + leakage + work of the attraction while the pad moves
                  + work of the field on the tributary lengths, which a vertical traction leaves out
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from evfem.common.arrays import NODES, WEIGHTS, Floats
from evfem.common.constants import KILOVOLT
from evfem.common.rooms import Column, Room
from evfem.electrostatics.laws import eps_0
from evfem.electrostatics.relaxation import Sandwich, contour
from evfem.tensor import STEP
from evfem.terms.traction import PadPath

#: pieces of a step, from the fastest charge's relaxation on, grow by this factor; Gauss points of each
LONGER, POINTS = 3.0, 8
#: positions at which the effective voltage is cached
REMEMBERED = 4


@dataclass(frozen=True, eq=False)
class Charged:
    """Electric state: charges over eps_0 (M, P) in V/mm, voltage (V), gaps, tributary lengths (P,) in mm."""

    charges: Floats
    voltage: float
    gap: Floats
    length: Floats


@dataclass(frozen=True)
class Flow:
    """Energies of a step (N mm per mm of depth): from the source, and dissipated across the layers; charge
    over eps_0 from the source (V, in space V mm), and the `seconds` of the step.
    """

    source_work: float
    leakage: float
    charge: float
    seconds: float

    @property
    def supplied(self) -> Floats:
        """What adds up over substeps (4,): work of the source, leakage, the mean square of the current over
        eps_0 times the time, and the time.
        """
        square = self.charge**2 / self.seconds if self.seconds > 0.0 else 0.0
        return np.array([self.source_work, self.leakage, square, self.seconds])


def at_times(transform: Any, time: Any) -> Any:
    """Values (T, 1) at times (T, 1) above 0 of a function with this transform."""
    z, weight = (one.reshape(-1, 1, 1) for one in contour())
    return 2.0 * np.real(np.sum(weight / time * transform(z / time), axis=0))


class Straight:
    """Within a step the voltage goes straight from its begin to its end."""

    def bent(self, s: Any) -> Any:
        """Transform (S, ...) at the rates s of what the voltage (V) has beyond the straight line."""
        return 0.0

    def beyond(self, time: Floats) -> tuple[Any, Any]:
        """That voltage and its rate (T, 1) at times (T, 1) in s."""
        return 0.0, 0.0


@dataclass(frozen=True, eq=False)
class KeptCourse(Straight):
    """In a step of so many `seconds` from `old` the charge of the electrode over eps_0 goes straight between
    the two of `charge`: the sum of all nodes and of what is in `parallel` has one voltage with the transform

    .. math:: U(s) = \\frac{Q(s) - \\sum_i L_i b_i(s)}{C_p + \\sum_i L_i a_i(s)},

    with the charge density of a node a U + b (`Sandwich.on_electrode`), at the gaps of `old`. What these
    change in the step comes on a straight line.
    """

    stack: Sandwich
    old: Charged
    parallel: float
    charge: tuple[float, float]
    seconds: float

    def _voltage(self, s: Any) -> Any:
        old, (first, last) = self.old, self.charge
        slope, own = self.stack.on_electrode(old.gap, old.charges, s)
        prescribed = first / s + (last - first) / (self.seconds * s**2)
        left = np.sum(old.length * own, axis=-1, keepdims=True)
        return (prescribed - left) / (self.parallel + np.sum(old.length * slope, axis=-1, keepdims=True))

    @cached_property
    def _rise(self) -> float:
        """Mean rate of the voltage (V/s)."""
        end = at_times(self._voltage, np.full((1, 1), self.seconds))
        return (float(end[0, 0]) - self.old.voltage) / self.seconds

    def bent(self, s: Any) -> Any:
        return self._voltage(s) - self.old.voltage / s - self._rise / s**2

    def beyond(self, time: Floats) -> tuple[Any, Any]:
        return at_times(self.bent, time), at_times(lambda s: s * self.bent(s), time)


class NoCharges:
    """Charges follow at once: the voltage of the display is that of every node."""

    flows = False

    @property
    def memory(self) -> dict[str, Floats]:
        """Nothing is kept."""
        return {}

    @property
    def nothing_supplied(self) -> dict[str, Floats]:
        """What is kept of the source where a requested step begins."""
        return {}

    def effective(self, gap: Any, voltage: Any, length: Floats) -> Any:
        """Effective voltage of the force law."""
        return voltage

    @contextmanager
    def ending(self, at_end: Callable[[], Charged]) -> Iterator[None]:
        """Within, the charges are those of the end of the step."""
        yield


NO_CHARGES = NoCharges()


class Charging(NoCharges):
    """Charge transport in a step of so many `seconds` from the state given to `begin`; a `parallel`
    capacitance over eps_0 (1, in space mm) is beside the finger.
    """

    flows = True
    _course: Straight

    def __init__(self, stack: Sandwich, nodes: int, parallel: float = 0.0) -> None:
        self.stack = stack
        self.nodes = nodes
        self.parallel = parallel
        none = np.zeros(nodes)
        self.begin(Charged(self.none, 0.0, none, none), 0.0)

    @property
    def none(self) -> Floats:
        """No charge anywhere (M, P)."""
        return np.zeros((self.stack.states, self.nodes))

    @property
    def memory(self) -> dict[str, Floats]:
        return {"charges": self.none, **self.nothing_supplied}

    @property
    def nothing_supplied(self) -> dict[str, Floats]:
        return {"supplied": np.zeros(4)}

    @contextmanager
    def standing(self) -> Iterator[None]:
        """Within, no time passes from the beginning of the step."""
        with self._instead(self.old):
            yield

    @contextmanager
    def ending(self, at_end: Callable[[], Charged]) -> Iterator[None]:
        with self._instead(at_end()):
            yield

    @contextmanager
    def _instead(self, charged: Charged) -> Iterator[None]:
        old, seconds, course = self.old, self.seconds, self._course
        self.begin(charged, 0.0)
        try:
            yield
        finally:
            self.begin(old, seconds)
            self._course = course

    def begin(self, old: Charged, seconds: float) -> None:
        """A step begins at the state `old`."""
        self.old, self.seconds, self._course = old, seconds, Straight()
        self._known: dict[tuple[bytes, float, bytes], tuple[Floats, Floats]] = {}

    def keep(self, charge: float) -> None:
        """In the step that has begun the electrode comes to this charge over eps_0."""
        if self.seconds > 0.0:
            now = self.electrode_charge(self.old)
            self._course = KeptCourse(self.stack, self.old, self.parallel, (now, charge), self.seconds)

    def carried(self, length: Floats) -> Floats:
        """Charges (M, P) after motion: those of the begin of the step on other tributary lengths (P,)."""
        some = length > 0.0
        return np.asarray(
            self.old.charges * np.where(some, self.old.length / np.where(some, length, 1.0), 1.0)
        )

    def after(self, gap: Any, voltage: float, length: Floats) -> Any:
        """The charges (M, P) at the end of the step, at the new position and voltage."""
        before = self.old.voltage if self.seconds > 0.0 else voltage
        return self.stack.after(gap, self.carried(length), before, voltage, self.seconds, self._course.bent)

    def effective(self, gap: Any, voltage: float, length: Floats) -> Any:
        """Effective voltage (P,) of the force law at the step's end; gaps (P,) may be complex."""
        if self.seconds == 0.0:
            return self.stack.effective(gap, voltage, self.carried(length))
        value, slope = self._at(np.real(gap), voltage, length)
        return value + 1j * np.imag(gap) * slope if np.iscomplexobj(gap) else value

    def _at(self, gap: Floats, voltage: float, length: Floats) -> tuple[Floats, Floats]:
        """That voltage (P,) and its derivative by the gap, cached for the last few positions."""
        key = (gap.tobytes(), voltage, length.tobytes())
        if (known := self._known.get(key)) is not None:
            return known
        near = gap + 1j * STEP
        seen = self.stack.effective(near, voltage, self.after(near, voltage, length))
        if len(self._known) >= REMEMBERED:
            del self._known[next(iter(self._known))]
        self._known[key] = found = (np.asarray(seen.real), np.asarray(seen.imag / STEP))
        return found

    def electrode_charge(self, at: Charged) -> float:
        """Charge of the electrode over eps_0 (V), as the insulator's displacement ends on it, and of what is
        beside the finger.
        """
        ended = float(np.sum(at.length * self.stack.fields(at.gap, at.voltage, at.charges)[2]))
        return ended + self.parallel * at.voltage

    def across(self, at: Charged) -> Floats:
        """Voltages (P,) of the gaps."""
        field = self.stack.fields(at.gap, at.voltage, at.charges)[1] / self.stack.gap_eps_r
        return np.asarray(field * at.gap)

    def capacity(self, at: Charged) -> float:
        """Derivative of that charge by the voltage (V) at the end of the step, in which it is linear."""
        none, one = (
            self.electrode_charge(Charged(self.after(at.gap, volts, at.length), volts, at.gap, at.length))
            for volts in (0.0, KILOVOLT)
        )
        return (one - none) / KILOVOLT

    def charge_slopes(self, at: Charged) -> tuple[Floats, Floats]:
        """Derivatives of that charge at the step's end by gap and tributary length of every node (P,)."""
        gap, seconds = at.gap + 1j * STEP, self.seconds
        by_gap = self.stack.fields(gap, at.voltage, self.after(gap, at.voltage, at.length))[2].imag / STEP
        # the charge that a node brings along does not grow with its length
        before = self.old.voltage if seconds > 0.0 else at.voltage
        fresh = self.stack.after(at.gap, self.none, before, at.voltage, seconds, self._course.bent)
        by_length = self.stack.fields(at.gap, at.voltage, fresh)[2]
        return np.asarray(at.length * by_gap), np.broadcast_to(by_length, at.gap.shape)

    def energy_density(self, at: Charged) -> Floats:
        """Energy of the field at every node (P,), N mm per mm^2; its work per mm of tributary length."""
        return np.asarray(eps_0 * self.stack.energy(at.gap, at.voltage, at.charges))

    def field_energy(self, at: Charged) -> float:
        """Energy of the field, N mm per mm of depth, with that beside the finger."""
        return float(np.sum(at.length * self.energy_density(at))) + self._beside(at.voltage)

    def _beside(self, voltage: float) -> float:
        """Energy in the capacitance beside the finger."""
        return 0.5 * eps_0 * self.parallel * voltage**2

    def flow(self, new: Charged) -> Flow:
        """Charge supplied and charge leaked in the step that ended at `new`."""
        old, stack, seconds = self.old, self.stack, self.seconds
        beside = self._beside(new.voltage) - self._beside(old.voltage)
        start = self.carried(new.length)
        before, moved = (
            stack.fields(gap, old.voltage, charges)[0]
            for gap, charges in ((old.gap, old.charges), (new.gap, start))
        )
        charge = float(np.sum(new.length * moved - old.length * before))
        source = old.voltage * charge
        charge += self.parallel * (new.voltage - old.voltage)
        if seconds == 0.0:
            jumped = stack.fields(new.gap, new.voltage, start)[0]
            more = np.sum(new.length * (jumped - moved))
            source += 0.5 * (old.voltage + new.voltage) * more
            return Flow(float(eps_0 * source) + beside, 0.0, charge + float(more), 0.0)
        time, weight = self._times()
        rise = (new.voltage - old.voltage) / seconds
        volts, course = old.voltage + rise * time[:, None], self._course
        charges = stack.after(new.gap, start[:, None], old.voltage, volts, time[:, None], course.bent)
        bent, faster = course.beyond(time[:, None])
        volts = volts + bent
        at = (new.gap, volts, charges)
        leaked = float(np.sum(weight @ (stack.loss(*at) * new.length)))
        # by parts: the work of the displacement current is U D at the ends less the mean of D while U rises
        last = stack.fields(new.gap, new.voltage, new.charges)[0]
        source += np.sum(new.length * (new.voltage * last - old.voltage * moved))
        crossing = stack.crossing(*at)
        power = volts * crossing - (rise + faster) * stack.fields(*at)[0]
        source += np.sum(weight @ (power * new.length))
        charge += float(np.sum(new.length * (last - moved)) + np.sum(weight @ (crossing * new.length)))
        return Flow(float(eps_0 * source) + beside, float(eps_0 * leaked), charge, seconds)

    def _times(self) -> tuple[Floats, Floats]:
        """Quadrature nodes (s) and weights (s) of the step, dense where the fastest charge moves."""
        fastest = self.stack.fastest
        ends, end = [0.0], min(1.0 / fastest, self.seconds) if fastest > 0.0 else self.seconds
        while end < self.seconds:
            ends.append(end)
            end *= LONGER
        ends.append(self.seconds)
        x, w = np.polynomial.legendre.leggauss(POINTS)
        length = np.diff(ends)[:, None]
        at = np.array(ends[:-1])[:, None] + length * (0.5 + 0.5 * x)
        return at.ravel(), (0.5 * length * w).ravel()


@dataclass(frozen=True)
class ChargeBooks(Room):
    """The balance of the source of a voltage, whose `attraction` it is, on the pad, as columns: of a law that
    is the pressure of the field in layers, Strong and Troxel's; 0 under another.
    """

    attraction: Any
    columns = (
        Column("source_work", "N", "of the voltage's source, where it is resolved in time"),
        Column("leakage_dissipation", "N", "by charge that crosses skin, gap, insulator"),
        Column("stretch_work", "N", "of the field on the pad's length, where it is resolved in time"),
        Column("field_energy", "N", "of the electric field, where it is resolved in time"),
    )

    @property
    def known(self) -> bool:
        """Whether the law is that of a field."""
        return bool(getattr(self.attraction.law, "of_a_field", False))

    def values(self, model: Any, state: Any) -> dict[str, float]:
        if not self.known:
            return {"field_energy": 0.0}
        charged = self.attraction.charged(model.equilibrium.pad_state(state))
        return {"field_energy": self.attraction.charging.field_energy(charged)}

    def works(self, substep: Any) -> dict[str, float]:
        if not self.known:
            return dict.fromkeys(("source_work", "leakage_dissipation", "stretch_work"), 0.0)
        source, leaked = self._flow(substep)
        return {
            "source_work": source,
            "leakage_dissipation": leaked,
            "stretch_work": self._stretching(substep),
        }

    def _flow(self, substep: Any) -> tuple[float, float]:
        """Work of the source and leakage; the first voltage is raised before anything moves."""
        charging = self.attraction.charging
        source, leaked = (substep.new.memory["supplied"] - substep.old.memory["supplied"])[:2].tolist()
        raised = substep.old.voltage != charging.old.voltage
        return source + (charging.field_energy(charging.old) if raised else 0.0), leaked

    def _stretching(self, substep: Any) -> float:
        """Work of the field on the tributary lengths on the path of the charged pad."""
        (before, after), charging = substep.pads, self.attraction.charging
        lengths = self.attraction.pad.tributary
        grown = lengths(after.position) - lengths(before.position)
        volts, work = charging.old.voltage, 0.0
        none = np.zeros_like(before.position)
        path = PadPath(before, after, none, none, (none, none)).at(NODES, np.full(NODES.shape, volts))
        for pad, weight in zip(path.states(), WEIGHTS, strict=True):
            carried = {"charges": charging.carried(lengths(pad.position))}
            at = self.attraction.charged(replace(pad, memory=carried))
            work += weight * float(charging.energy_density(at) @ grown)
        return work
