"""The time scales of a scene with a drive: voltage, charge and mechanics, in words for its plan.

Twice the frequency of the voltage is that of the attraction. The gap discharges below its corner
frequency, and the skin is a conductor below its own (`evfem.electrostatics.alternating`); both are
told for touching skin. Kelvin-Voigt tissue with the relaxation time tau follows up to 1 / (2 pi tau);
without time in the mechanics it follows at once. A swing slower than `FOLLOWS` times that moves the
tissue, and its mean over the cycle leaves that out.
"""

from __future__ import annotations

import numpy as np

from evfem.electrostatics.dielectrics import Dielectric, seen_at
from evfem.electrostatics.drive import powers, waveform
from evfem.electrostatics.laws import Layer
from evfem.electrostatics.relaxation import Sandwich
from evfem.electrostatics.timesignals import ChargeControl, OpenCircuit, Square
from evfem.protocols import TimeSignal
from evfem.scene.scene import Scene

#: a swing up to so many times the highest frequency that the tissue follows still moves it
FOLLOWS = 5.0


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
    given, found = scene.voltage, powers(scene.voltage)
    square = waveform(scene.drive, given) == "square" if found is None else isinstance(given, Square)
    biased = found is not None and 0.0 in found[1]
    return not square or biased or scene.electrics.conducts


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
