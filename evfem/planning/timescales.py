r"""The time scales of a scene with a drive: voltage, charge and mechanics, in words for its plan.

Twice the frequency of the voltage is that of the attraction. The gap discharges below its corner
frequency, and the skin is a conductor below its own (`evfem.electrostatics.alternating`); both are
told for touching skin. Kelvin-Voigt tissue with the relaxation time tau follows up to 1 / (2 pi tau);
without time in the mechanics it follows at once. A swing slower than `FOLLOWS` times that moves the
tissue, and its mean over the cycle leaves that out.

A mean over the cycle takes friction as that of the mean attraction. A pad that slides by :math:`v` and
has no inertia is a spring of the stiffness k under the bound :math:`b(t)`, which the swing raises and
lowers: friction falls with the bound, but rises by no more than the pad is stretched,

.. math:: F(t) = \min(b(t), F(t - dt) + k\,v\,dt).

Its mean is that of `b` where k v exceeds the steepest rise of the bound, and less elsewhere
(`stuck_within_swings`). Inertia holds the pad, which then sticks less: the mean lies between the two.
Under a `SlipMemory` the bound itself follows at the rate :math:`r = v/L + 1/T`, and keeps
:math:`1/(1 + i\,\omega/r)` of what swings at :math:`\omega`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.electrostatics.dielectrics import Dielectric, seen_at
from evfem.electrostatics.drive import powers, waveform
from evfem.electrostatics.laws import Layer
from evfem.electrostatics.relaxation import Sandwich
from evfem.electrostatics.timesignals import Carrier, ChargeControl, OpenCircuit, Sine
from evfem.newton.state import FORCES
from evfem.protocols import TimeSignal
from evfem.scene.scene import Scene
from evfem.surface.friction import SlipMemory

#: a swing up to so many times the highest frequency that the tissue follows still moves it
FOLLOWS = 5.0
#: moments of a cycle at which its swing is followed
MOMENTS = 400
#: fraction of the friction by the attraction that may be missing without a sentence
MISSING = 0.1


def time_scales(scene: Scene) -> str:
    """The drive of a scene, its time scales, and which of them are resolved."""
    drive = scene.drive
    assert drive is not None
    at = scene.electrics.frequency
    what = "direct voltage" if at is None else f"{drive.waveform} of {at:g} Hz"
    if isinstance(scene.voltage, OpenCircuit):
        what = f"open circuit: {scene.voltage.voltage:g} V, disconnected after {scene.voltage.after:g} s"
    elif isinstance(scene.voltage, ChargeControl):
        what = "prescribed charge of the electrode, whatever voltage that takes"
    elif isinstance(scene.voltage, TimeSignal):
        what = f"{type(scene.voltage).__name__} signal"
    how = "resolved in time with its charges" if drive.resolved else "by its mean over the cycle"
    charge = _charge(scene)
    follows = "at once" if np.isinf(highest := bandwidth(scene)) else f"up to {highest:.3g} Hz"
    parts = [f"{what}, {how}", *charge, f"mechanics: {follows}"]
    if drive.resolved and not getattr(scene.law, "of_a_field", False):
        parts.append("no balance of the source, which only Strong and Troxel's law has")
    if not drive.resolved and at is not None and _swings(scene):
        parts.append(f"left out: the swing of the attraction at {slowest_swing(scene):g} Hz")
    return "; ".join(parts)


def _charge(scene: Scene) -> list[str]:
    """Below which frequencies gap and skin discharge where they touch."""
    seen = scene.electrics
    assert scene.drive is not None
    layers = (seen.skin, seen.insulator)
    solid, film = (Layer(one.thickness, Dielectric(*_constants(one, seen.frequency))) for one in layers)
    leak = scene.drive.gap_conductivity
    stack = Sandwich.of(solid, film, frequency=None, gap_conductivity=leak, gap_eps_r=seen.gap_eps_r)
    (skin, gap, _), (upper, _, lower) = stack.rates, stack.reduced(0.0)
    said = []
    if gap > 0.0:
        said.append(f"charge: the gap leaks below {gap / (2.0 * np.pi):.3g} Hz")
    if skin > 0.0:
        corner = skin / (1.0 + upper / lower) / (2.0 * np.pi)
        said.append(f"charge: the skin conducts below {corner:.3g} Hz")
    relaxing = _relaxing(seen.sandwich) if scene.drive.resolved else []
    return [*(said or ["charge: nothing conducts"]), *relaxing]


def _constants(layer: Layer, at: float | None) -> tuple[float, tuple[()], float]:
    """Permittivity, no poles, and conductivity of a layer at a frequency (Hz)."""
    eps_r, sigma = seen_at(layer, at)
    return float(np.max(eps_r)), (), float(np.max(sigma))


def _relaxing(stack: Sandwich) -> list[str]:
    """Number and time constants of the Debye poles of a resolved drive."""
    if stack.states == 2:
        return []
    times = np.concatenate([stack.skin.tau, stack.insulator.tau])
    return [f"charge: {times.size} Debye poles relax in {times.min():.2g} to {times.max():.2g} s"]


def bandwidth(scene: Scene) -> float:
    """Highest frequency (Hz) that the tissue follows, infinite without time in the mechanics."""
    own = [getattr(law, "viscosity", None) or 0.0 for law in scene.finger.materials.values()]
    slowest = max([scene.finger.viscosity, *own])
    if not scene.solver.timed or not slowest > 0.0:
        return np.inf
    return 1.0 / (2.0 * np.pi * slowest)


def _swings(scene: Scene) -> bool:
    """Whether the attraction swings within a period: not that of a square wave where nothing conducts."""
    assert scene.drive is not None
    square = waveform(scene.drive, scene.voltage) == "square" and powers(scene.voltage) is None
    return not square or scene.electrics.conducts


def slowest_swing(scene: Scene) -> float:
    """Lowest frequency (Hz) of the attraction: twice the voltage's; once with a bias or even harmonics."""
    at, found = scene.electrics.frequency or 0.0, powers(scene.voltage)
    odd = found is None or not (found[1] % 2.0 == 0.0).any()
    return 2.0 * at if odd else at


def left_out(scene: Scene) -> str | None:
    """A sentence if a mean over the cycle leaves out what moves the tissue, else None."""
    at, highest = scene.electrics.frequency, bandwidth(scene)
    if scene.drive is None or scene.drive.resolved or at is None or np.isinf(highest):
        return None
    if not _swings(scene):
        return None
    swing = slowest_swing(scene)
    if swing >= FOLLOWS * highest:
        return None
    much = f"the attraction swings at {swing:g} Hz, and the tissue follows up to {highest:.3g} Hz"
    other = f'drive = "resolved" with steps of at most {1.0 / (20.0 * at):.2g} s does not'
    return f"{much}: the mean over the cycle leaves that out, {other}"


def stuck_within_swings(scene: Scene, rows: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """A sentence if friction took the mean of a swing within which a pad without inertia sticks, for the
    slide where most is missing.
    """
    at, bound = _averaged(scene)
    if at is None or bandwidth(scene) * FOLLOWS <= at:
        return
    most, worst = MISSING, ""
    for i, course in enumerate(scene.courses):
        some = [k for k, row in enumerate(rows) if row["motion_index"] == i]
        if not (some and course.distance and course.speed):
            continue
        end, stiffness = rows[some[-1]], _stiffness(rows[max(some[0] - 1, 0) : some[-1] + 1])
        friction, normal = _size(end, "tangential_force"), float(end["normal_force"])
        added = friction * float(end["electrostatic_force"]) / normal if normal > 0.0 else 0.0
        kept = _remembered(bound, scene.friction_law, course.speed, at)
        found = spring_mean(friction + added * (kept - 1.0), stiffness * course.speed / (at * MOMENTS))
        if added > 0.0 and (friction - found) / added > most:
            most, unit = (friction - found) / added, FORCES[3 if "contact_area" in end else 2]
            worst = (
                f"motion {i}: the friction of {friction:.4g} {unit} is that of the mean attraction, which "
                f"swings; without inertia the pad sticks within each swing, at a mean of {found:.4g} {unit}: "
                'drive = "resolved" with dynamics = "inertial" says where between (slip_memory swings less)'
            )
    yield from [worst] if worst else []


def spring_mean(bound: Floats, rise: float) -> float:
    """Mean over a cycle of the friction of a spring, from its bounds (k,) at equal times and what stretching
    adds from one to the next.

    >>> spring_mean(np.array([1.0, 2.0, 3.0, 2.0]), 1.0), spring_mean(np.array([1.0, 2.0, 3.0, 2.0]), 0.0)
    (2.0, 1.0)
    """
    total = force = float(bound.min())
    for most in np.roll(bound, -int(bound.argmin()))[1:]:
        force = min(float(most), force + rise)
        total += force
    return total / len(bound)


def _remembered(bound: Floats, law: Any, speed: float, at: float) -> Floats:
    """What the memory of a friction law leaves of a bound (k,) over a cycle of `at` Hz."""
    if not isinstance(law, SlipMemory):
        return bound
    rate = speed / law.length + 1.0 / law.time
    swung = np.fft.rfft(bound)
    turns = 2.0 * np.pi * at * np.arange(swung.size)
    return np.fft.irfft(swung / (1.0 + 1j * turns / rate), bound.size)


def _averaged(scene: Scene) -> tuple[float | None, Floats]:
    """Frequency (Hz) of the voltage that a scene takes by its mean, None without one, and its square over a
    cycle, relative to the mean.
    """
    own: Any = scene.voltage
    seen = scene.electrics
    carried = isinstance(own, Carrier) and not own.resolved
    at = own.frequency if isinstance(own, Carrier) else seen.frequency
    if at is None or not (carried or (seen.alternates and _swings(scene))):
        return None, np.ones(1)
    signal = Sine(at, 1.0) if carried or powers(own) is None else own
    squared = np.asarray(signal(np.arange(MOMENTS) / (MOMENTS * at))) ** 2
    return at, squared / squared.mean()


def _along(row: Mapping[str, Any], name: str) -> tuple[float, float]:
    """Components of a column along the surface."""
    return float(row.get(f"{name}_x", row[name])), float(row.get(f"{name}_z", 0.0))


def _size(row: Mapping[str, Any], name: str) -> float:
    """Size of a column along the surface."""
    return float(np.hypot(*_along(row, name)))


def _stiffness(rows: Sequence[Mapping[str, Any]]) -> float:
    """The steepest rise of the friction force of a pad over its way in these rows, per mm."""
    force, place = (
        np.diff([_along(row, name) for row in rows], axis=0) for name in ("tangential_force", "position")
    )
    moved = np.hypot(*place.T)
    return float((np.hypot(*force.T)[moved > 0.0] / moved[moved > 0.0]).max(initial=0.0))
