"""Rendering of a real surface: the voltage that gives a display its friction, and the simulated result.

A reference slide is recorded, its apparent friction F_t / F_n is converted to a voltage over the position by
(17)-(20b), and the display is simulated under it. The closed forms neglect the air layer, take the contact
area from a power law and the load as constant; `exact` solves the coupled model for the voltage instead.
Forces on the bone, N/mm; mm, V, s.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from evfem.circuit.encoding import Encoding, share_not_renderable
from evfem.circuit.signals import Amplifier, FollowForce, VoltageProfile
from evfem.common.tables import MOST_ROWS
from evfem.common.views import plus
from evfem.contact.signorini import OPEN, STICK
from evfem.electrostatics.drive import Drive
from evfem.errors import InputError, describe_value
from evfem.protocols import ForceLaw, Observer, RoughnessLaw, Surface
from evfem.scene.motion import Press
from evfem.scene.scene import Scene
from evfem.simulation.history import SAME
from evfem.simulation.result import Frame, Result, Row
from evfem.simulation.run import simulate
from evfem.tensor import Array

#: friction below that of the display by less than this fraction counts as solver noise
NOISE = 1e-6
#: straight pieces of a voltage keep its square this close to the target, as a fraction of the largest one
CHORD = 1e-3


@dataclass(frozen=True, eq=False)
class Recording:
    """A scene, its result, and the position (mm) of the first step without a sticking node, or None."""

    scene: Scene
    result: Result
    full_slip: float | None

    @property
    def peak_voltage(self) -> Array:
        """Peak (V) of the waveform in every step, whose effective value is `result.voltage`."""
        return np.asarray((self.scene.drive or Drive()).peak(self.result.voltage))


def record(scene: Scene, observers: Sequence[Observer] = ()) -> Recording:
    """Simulate `scene` and watch for full slip; `observers` as in `simulate`."""
    watch = _SlipWatch()
    result = simulate(scene, observers=(*observers, watch))
    return Recording(scene, result, watch.position)


class _SlipWatch:
    """Observer that remembers where every touching node slips for the first time in a slide."""

    position: float | None = None

    def step(self, row: Row, frame: Frame | None, checkpoint: Callable[[], dict[str, Any]]) -> None:
        if self.position is None and row["motion"] == "slide":
            status = checkpoint()["status"]
            if not np.any(status == STICK) and np.any(status != OPEN):
                self.position = float(row["position"])


@dataclass(frozen=True, eq=False)
class ApparentFriction:
    """Forces on the bone over its position: arrays (n,) in mm and N/mm, positions increasing.

    >>> felt = ApparentFriction([0.0, 1.0, 2.0], [0.05, 0.05, 0.04], [0.0, 0.005, 0.008])
    >>> felt.friction.round(9).tolist(), round(felt.minimum(after=0.5), 9)
    ([0.0, 0.1, 0.2], 0.1)
    """

    position: Array
    normal_force: Array
    tangential_force: Array

    def __post_init__(self) -> None:
        for name in ("position", "normal_force", "tangential_force"):
            object.__setattr__(self, name, np.asarray(getattr(self, name), dtype=float))
        if not np.all(self.normal_force > 0.0):
            lowest = float(self.normal_force.min())
            raise InputError("normal_force", lowest, "an applied force above zero all along the slide")

    def __repr__(self) -> str:
        x, mu = self.position, self.friction
        span = f"{len(x)} positions, {plus(x[0]):.4g} to {plus(x[-1]):.4g} mm"
        return f"ApparentFriction({span}, friction {plus(mu.min()):.4g} to {plus(mu.max()):.4g})"

    @property
    def friction(self) -> Array:
        """mu = F_t / F_n of each position, equation (12); on texture it may be negative."""
        return self.tangential_force / self.normal_force

    def minimum(self, after: float) -> float:
        """Smallest apparent friction from the position `after` (mm) on."""
        there = self.position >= after - SAME
        if not there.any():
            raise InputError("after", after, f"a position up to {self.position[-1]:g} mm")
        return float(self.friction[there].min())


def apparent_friction(result: Result) -> ApparentFriction:
    """Applied forces over the slides towards +x, the state just before them included; else InputError."""
    rows = _slide_rows(result)
    rows = np.arange(max(rows[0] - 1, 0), rows[-1] + 1)
    x = result.position[rows]
    if np.any(np.diff(x) <= 0.0):
        raise InputError("slide", "positions that do not grow from step to step", "a slide towards +x")
    return ApparentFriction(x, result.applied_force[rows], result.applied_tangential_force[rows])


def _slide_rows(result: Result) -> Array:
    rows = np.flatnonzero(result.motion == "slide")
    if rows.size == 0 or np.any(np.diff(rows) != 1):
        raise InputError("slide", f"{rows.size} rows of slides", "one slide, or several in a row")
    return rows


@dataclass(frozen=True, eq=False)
class Signal:
    """An effective voltage over the position, and its error by the closed forms, over the path.

    `share_not_renderable`: fraction of the path on which the target is below the display's own friction (no
    loss while the finger still sticks at the start). Voltages in V: `largest`, `rms` over the path,
    `carrier` (peak of the display's waveform at the largest). `error_of_display`: relative L2 error of the
    friction force by (16a), (16b) without the amplifier, `error_of_amplifier` the change by the amplifier,
    relative to the target; `share_limited` the fraction of the path on which it limits, `limited_by` the
    names of its limits that do.
    """

    profile: VoltageProfile
    share_not_renderable: float
    largest: float
    rms: float
    carrier: float
    error_of_display: float
    error_of_amplifier: float = 0.0
    share_limited: float = 0.0
    limited_by: str = ""


def voltage_for(
    reference: ApparentFriction,
    display: Encoding,
    *,
    depth: float = 1.0,
    amplifier: Amplifier | None = None,
    speed: float | None = None,
) -> Signal:
    r"""The voltage that gives a display the friction of `reference`, by the closed forms.

    .. math:: U = \sqrt{F_e / (p_1 k F_n^m)}, \quad F_e = (\mu_{rs} / \mu_{hd} - 1) F_n \ge 0

    with p_1 the contact pressure at 1 V: equation (17) with (18), which is (19); with a linear area law (m =
    1) it is (20a) for `Kaczmarek` and (20b) for `StrongTroxel`, and the load drops out. Otherwise the area
    law needs the force of `depth` mm. The voltage is 0 where the target is below the display's friction.
    Forces are straight between the positions of `reference`, and so is the square of the voltage: the profile
    has rows in between, which keep it within 0.1 % of the largest one. `amplifier` limits the profile (its
    slew needs the `speed` along x in mm/s).

    >>> from evfem.electrostatics.laws import Kaczmarek, Layer, Layers
    >>> from evfem.circuit.encoding import AreaLaw
    >>> layers = Layers.of(Layer(0.20, 1650.0), Layer(0.09, 3.35))
    >>> display = Encoding(Kaczmarek(), layers, AreaLaw(112.0), friction=0.5)
    >>> felt = ApparentFriction([0.0, 2.5, 10.0], [0.05, 0.05, 0.05], [0.025, 0.03, 0.03])
    >>> signal = voltage_for(felt, display)
    >>> round(signal.largest, 2), signal.share_not_renderable
    (1776.73, 0.0)
    >>> limited = voltage_for(felt, display, amplifier=Amplifier(voltage_max=1000.0))
    >>> limited.largest, round(limited.share_limited, 3), round(limited.error_of_amplifier, 3)
    (1000.0, 0.921, 0.104)
    """
    if not isinstance(reference, ApparentFriction):
        raise InputError(
            "reference", describe_value(reference), "an ApparentFriction, as apparent_friction makes it"
        )
    x = reference.position
    wish = _wish(reference, display, depth)
    profile = wish if amplifier is None else amplifier.limit(wish, speed)
    at, weight = _quadrature(np.concatenate([x, wish.position, profile.position]), x[0], x[-1])
    wanted, force = (np.interp(at, x, of) for of in (reference.tangential_force, reference.normal_force))
    felt, limited = (display.tangential_force(depth * force, of(at)) / depth for of in (wish, profile))
    size = _norm(wanted, weight) or 1.0
    largest = float(np.max(profile.voltage))
    return Signal(
        profile=profile,
        share_not_renderable=share_not_renderable(x, reference.friction, display.friction * (1.0 - NOISE)),
        largest=largest,
        rms=profile.rms(float(x[0]), float(x[-1])),
        carrier=display.peak(largest),
        error_of_display=_norm(felt - wanted, weight) / size,
        error_of_amplifier=_norm(limited - felt, weight) / size,
        share_limited=_share_apart(wish, profile),
        limited_by="" if amplifier is None else amplifier.stops(wish, speed),
    )


def _wish(reference: ApparentFriction, display: Encoding, depth: float) -> VoltageProfile:
    """The voltage of a display, with the rows of `reference`, those where the target crosses the display's
    own friction, and between these as many, even in the voltage, as `CHORD` asks: a chord of dU misses U^2
    by dU^2 / 4.
    """
    given = reference.position, reference.normal_force, reference.tangential_force

    def at(row: Array) -> tuple[Array, Array]:
        x, load, force = (np.interp(row, np.arange(len(of)), of) for of in given)
        return x, np.asarray(display.voltage_for_friction(np.maximum(force / load, 0.0), depth * load))

    excess = given[2] - display.friction * given[1]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = excess[:-1] / (excess[:-1] - excess[1:])
    whole = np.arange(len(excess), dtype=float)
    row = np.sort(np.append(whole, (whole[:-1] + share)[(share > 0.0) & (share < 1.0)]))
    x, volts = at(row)
    rise = np.where(np.diff(x) > 0.0, np.abs(np.diff(volts)), 0.0) / (volts.max() or 1.0)
    pieces = np.clip(np.ceil(rise / np.sqrt(4.0 * CHORD)), 1, max(MOST_ROWS // row.size, 1)).astype(int)
    return VoltageProfile(*at(np.append(_between(row, volts, pieces), row[-1])))


def _between(row: Array, volts: Array, pieces: Array) -> Array:
    """Rows (sum of `pieces`,) that divide each way from row to row evenly in the voltage, whose square is
    straight there.
    """
    first, last, start, way, count = (
        np.repeat(of, pieces) for of in (volts[:-1], volts[1:], row[:-1], np.diff(row), pieces)
    )
    part = (np.arange(count.size) - np.repeat(np.cumsum(pieces) - pieces, pieces)) / count
    squares = part * (2.0 * first + part * (last - first))
    return start + way * squares / np.where(count > 1, first + last, 1.0)


def _quadrature(rows: Array, start: float, stop: float) -> tuple[Array, Array]:
    """Positions and weights (mm) of Gauss's rule with two points between rows (mm) from start to stop."""
    edges = np.unique(np.clip(rows, start, stop))
    middle, half = 0.5 * (edges[1:] + edges[:-1]), 0.5 * np.diff(edges)
    at = np.concatenate([middle - half / np.sqrt(3.0), middle + half / np.sqrt(3.0)])
    return at, np.concatenate([half, half])


def _norm(values: Array, weight: Array) -> float:
    return float(np.sqrt(np.sum(weight * values**2)))


def _share_apart(one: VoltageProfile, other: VoltageProfile) -> float:
    """Fraction of the path of the first of two profiles on which they differ, sampled in the middle of
    intervals between rows.
    """
    ends = one.position[[0, -1]]
    x = np.unique(np.clip(np.concatenate([one.position, other.position]), *ends))
    middle = 0.5 * (x[:-1] + x[1:])
    apart = np.abs(one(middle) - other(middle)) > 1e-9 * np.max(np.abs(one.voltage), initial=1.0)
    return float(np.sum(np.diff(x)[apart]) / (x[-1] - x[0]))


def replay(
    reference: Recording,
    display: Surface,
    law: ForceLaw,
    voltage: VoltageProfile | FollowForce,
    drive: Drive | None = None,
    roughness_gap: float | RoughnessLaw = 0.0,
) -> Recording:
    """The reference's finger, motion and solver on a display under a voltage, alternating by a `drive`: as in
    the paper, pressed to the load that the reference had after its press, and slid in the same steps. Rough
    faces keep the `roughness_gap` of a scene, in mm or as a law.
    """
    motion = list(reference.scene.motion)
    first = next((i for i, one in enumerate(motion) if one.course.distance), 0)
    if first and motion[first - 1].course.presses:
        last_row = int(_slide_rows(reference.result)[0]) - 1
        load = float(reference.result.applied_force[last_row])
        motion[first - 1] = Press(force=load, steps=motion[first - 1].steps)
    shown: dict[str, Any] = {"surface": display, "law": law, "voltage": voltage, "drive": drive}
    return record(replace(reference.scene, motion=motion, roughness_gap=roughness_gap, **shown))


def exact(
    reference: Recording,
    display: Surface,
    law: ForceLaw,
    largest_voltage: float = 10_000.0,
    drive: Drive | None = None,
    roughness_gap: float | RoughnessLaw = 0.0,
) -> Recording:
    """Exact encoding: the voltage at which the coupled model has the reference's friction force.

    In every step of the slide U^2 is an unknown, 0 <= U <= `largest_voltage` (V), with F_t = reference as its
    equation; where that lies outside, the voltage stays at its limit. While nodes stick, attraction hardly
    changes the friction force; if no voltage meets the target then, the voltage is unchanged, or that at
    which they would slip at it (`evfem.newton.search`). The resulting effective voltage is in
    `result.voltage`, the `drive`'s peak in `peak_voltage`, the force that is missed in `missed_force`.
    """
    felt = apparent_friction(reference.result)
    wish = FollowForce(_along(reference), felt.tangential_force, largest_voltage)
    return replay(reference, display, law, wish, drive, roughness_gap)


def _along(reference: Recording) -> Array:
    """Positions (n,) in mm along the slide's own direction, as `FollowForce` counts them; else InputError."""
    rows, result = _slide_rows(reference.result), reference.result
    angles = {one.course.direction for one in reference.scene.motion if one.course.distance}
    if len(angles) > 1:
        raise InputError("slide", f"slides at {len(angles)} angles", "slides in one direction")
    rows, (x, z) = np.arange(max(rows[0] - 1, 0), rows[-1] + 1), angles.pop()
    return np.asarray(x * result.position[rows] + z * result.position_z[rows])


@dataclass(frozen=True, eq=False)
class Comparison:
    """How well the friction force of a rendering follows its reference over the whole slide.

    `position` (n,) mm, `error` (n,) N/mm = rendered - reference; `pearson` is nan where a force is
    constant. `voltage_difference` (V) is the largest one between the two runs.

    >>> found = Comparison(np.arange(3.0), np.array([1e-3, 0.0, 1e-9]), 0.99, 0.01, 0.0)
    >>> found.largest_error, found.unmet(1e-6).tolist()
    (0.001, [True, False, False])
    """

    position: Array
    error: Array
    pearson: float
    relative_l2: float
    voltage_difference: float

    def __repr__(self) -> str:
        good = f"pearson {self.pearson:.4g}, relative L2 error {self.relative_l2:.4g}"
        most = f"at most {self.largest_error:.4g} N/mm and {self.voltage_difference:.4g} V apart"
        return f"Comparison({len(self.position)} positions: {good}, {most})"

    @property
    def largest_error(self) -> float:
        """Largest deviation of the friction force in N/mm."""
        return float(np.max(np.abs(self.error)))

    def unmet(self, tolerance: float) -> Array:
        """Positions that miss the target by more than `tolerance` (N/mm), (n,) bool."""
        return np.abs(self.error) > tolerance


def compare(reference: Result, rendered: Result) -> Comparison:
    """Pearson's r and relative L2 error of `applied_tangential_force` over equal slides; else InputError."""
    rows, others = _slide_rows(reference), _slide_rows(rendered)
    x, y = (
        np.column_stack([r.position[i], r.position_z[i]]) for r, i in ((reference, rows), (rendered, others))
    )
    if x.shape != y.shape or not np.allclose(x, y, rtol=0.0, atol=1e-9):
        raise InputError("rendered", "a slide through other positions", "the same slide as the reference")
    wanted, felt = (r.applied_tangential_force[i] for r, i in ((reference, rows), (rendered, others)))
    voltages = rendered.voltage[others] - reference.voltage[rows]
    return Comparison(
        position=reference.position[rows],
        error=felt - wanted,
        pearson=pearson(wanted, felt),
        relative_l2=float(np.linalg.norm(felt - wanted) / np.linalg.norm(wanted)),
        voltage_difference=float(np.max(np.abs(voltages))),
    )


def pearson(one: Array, other: Array) -> float:
    """Pearson's correlation coefficient of two series; nan if one of them is constant."""
    both_change = np.ptp(one) > 0.0 and np.ptp(other) > 0.0
    return float(np.corrcoef(one, other)[0, 1]) if both_change else float("nan")
