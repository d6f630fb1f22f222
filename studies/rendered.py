"""Scenes and runs of the rendering studies: a friction step and a texture, felt and rendered on a display.

What the paper leaves open is chosen here once: the load, the length of the slide, speed and viscosity.
"""

import time
import warnings
from dataclasses import dataclass, field, replace

import evfem as ev
from evfem.circuit.encoding import AreaLaw, Encoding
from evfem.common.arrays import Floats
from evfem.estimate import rendering

from .common import table2_layers

#: where friction rises, from what to what, how far the finger slides (mm)
JUMP, BEFORE, AFTER, PATH = 5.0, 0.5, 0.6, 10.0
#: stratum corneum (mm) that gives the paper's voltage; k' of (20a) in mm2/N
SKIN, AREA = 0.20, AreaLaw(112.0)
#: a display with less friction than this share of the texture's own is not taken seriously
LEAST_SHARE = 0.2
ASSUMPTIONS = {
    "load": "0.05 N/mm at first (0.5 N over 10 mm, the light touch of section 3.2.5); the paper prints none",
    "held": "the indentation reached is held while sliding, the display is pressed to the reference's load",
    "stratum corneum": "0.20 mm in (20a) and in the pad: with Table 2's 0.38 mm (20a) gives 2266.5 V",
    "viscosity": "0.5 ms, chosen because at 20 mm/s the smallest apparent friction is then near the paper's",
    "texture": "equation (25), friction 0.1, 4 mm at 20 mm/s in steps of 0.02 mm; mass and viscosity",
    "display of [b]": "its friction is the reference's minimal apparent friction after the first full slip",
}


@dataclass(frozen=True)
class Case:
    """One reference, and what is tried on the display; the defaults are those of the figures.

    `friction` is that of the texture; without it the surface is level with a step in friction.
    """

    friction: float | None = None
    ridges: bool = True
    resolution: str = "paper"
    steps: int = 60
    path: float = PATH
    force: float = 0.05
    viscosity: float = 0.0
    dynamics: str = "quasistatic"
    skin: float = SKIN
    encodings: tuple[str, ...] = ("open", "exact")


STEP = Case()
TEXTURE = Case(friction=0.1, steps=200, path=4.0, viscosity=5e-4, dynamics="inertial")
#: quick versions: coarse pads, few steps
QUICK_STEP = replace(STEP, resolution="coarse", steps=16)
QUICK_TEXTURE = replace(TEXTURE, resolution="coarse", steps=31, path=0.93)


@dataclass(frozen=True, eq=False)
class Rendered:
    """A run on the display: force and load (N/mm) and voltage (V) of each step, and its fidelity."""

    force: Floats
    load: Floats
    voltage: Floats
    pearson: float
    relative_l2: float
    largest_error: float
    lowest_friction: float


@dataclass(frozen=True, eq=False)
class Outcome:
    """A case: the reference over its slide, what the display needs and does, and the costs.

    `position`, `load` and `force` (n,) of the slide's steps; `lowest_friction` is the smallest apparent
    friction from `full_slip` (mm) on, `friction` that of the display, `signal` the closed form's voltage.
    """

    case: Case
    position: Floats
    load: Floats
    force: Floats
    full_slip: float
    lowest_friction: float
    friction: float
    signal: rendering.Signal
    rendered: dict[str, Rendered]
    costs: dict[str, float] = field(default_factory=dict)

    @property
    def apparent(self) -> Floats:
        """Apparent friction of each step."""
        return self.force / self.load


def pad(case: Case) -> ev.FingerPad:
    """The finger of a case."""
    skin = ev.Electrical(stratum_corneum_thickness=case.skin)
    shape = {"ridges": case.ridges, "resolution": case.resolution, "ridge_exponent": 7.0}
    return ev.FingerPad(**shape, viscosity=case.viscosity, electrical=skin)


def reference_scene(case: Case, every: int = 1_000_000) -> ev.Scene:
    """The reference of a case, with fields of every `every`-th step."""
    surface: ev.Flat | ev.Sinusoid = ev.Flat(friction=[[0.0, BEFORE], [JUMP, BEFORE], [JUMP, AFTER]])
    if case.friction is not None:
        surface = ev.Sinusoid(friction=case.friction)
    slide = ev.Slide(case.path, steps=case.steps, hold="indentation", speed=20.0)
    motion = (ev.Press(force=case.force, steps=5), slide)
    solver, output = ev.Solver(dynamics=case.dynamics), ev.Output(every=every)
    return ev.Scene(pad(case), surface, motion=motion, solver=solver, output=output)


def display_friction(case: Case, felt: rendering.ApparentFriction, full_slip: float) -> tuple[float, float]:
    """Smallest apparent friction of the reference after full slip, and friction of the display.

    On the step the display has the coefficient before it; on texture the smallest apparent friction, or a
    fifth of the texture's own coefficient if that is larger (a negative one cannot be had).
    """
    lowest = felt.minimum(after=full_slip)
    if case.friction is None:
        return lowest, BEFORE
    return lowest, max(lowest, LEAST_SHARE * case.friction)


def display_encoding(friction: float, skin: float = SKIN) -> Encoding:
    """(20a) with the stratum corneum (mm) and the area law that give the paper's voltage."""
    return Encoding(ev.Kaczmarek(), table2_layers(skin), AREA, friction)


def felt_on(
    case: Case, every: int = 1_000_000
) -> tuple[rendering.Recording, rendering.ApparentFriction, float, tuple[float, float], rendering.Signal]:
    """A case's reference, what is felt, its full slip (mm), `display_friction` and the voltage of (20a)."""
    with warnings.catch_warnings():  # that the load drifts where its indentation is held is known
        warnings.filterwarnings("ignore", "motion 1 slides at constant indentation")
        reference = rendering.record(reference_scene(case, every))
    felt = rendering.apparent_friction(reference.result)
    full_slip = reference.full_slip if reference.full_slip is not None else float(felt.position[1])
    frictions = display_friction(case, felt, full_slip)
    signal = rendering.voltage_for(felt, display_encoding(frictions[1]))
    return reference, felt, full_slip, frictions, signal


def render(case: Case) -> Outcome:
    """Run the reference of a case, and the display with each of its encodings.

    Encodings: "open" replays (20a), "exact" solves for the voltage, "thick" replays (20a) on a pad
    with Table 2's 0.38 mm of stratum corneum.
    """
    begin = time.process_time()
    reference, felt, full_slip, (lowest, friction), signal = felt_on(case)
    costs = {"reference_cpu_s": time.process_time() - begin} | _costs(reference)
    rendered = {}
    for kind in case.encodings:
        found = _replayed(kind, case, reference, friction, signal)
        rendered[kind] = _rendered(reference, found, full_slip)
        costs |= {f"{kind}_{name}": value for name, value in _costs(found).items()}
    costs["cpu_s"] = time.process_time() - begin
    position, load, force = (x[1:] for x in (felt.position, felt.normal_force, felt.tangential_force))
    return Outcome(case, position, load, force, full_slip, lowest, friction, signal, rendered, costs)


def _replayed(
    kind: str, case: Case, reference: rendering.Recording, friction: float, signal: rendering.Signal
) -> rendering.Recording:
    display = ev.Display(friction=friction)
    if kind == "exact":
        return rendering.exact(reference, display, ev.Kaczmarek())
    if kind == "thick":
        finger = pad(replace(case, skin=0.38))
        reference = replace(reference, scene=replace(reference.scene, finger=finger))
    return rendering.replay(reference, display, ev.Kaczmarek(), signal.profile)


def _rendered(reference: rendering.Recording, found: rendering.Recording, full_slip: float) -> Rendered:
    fidelity, felt = (
        rendering.compare(reference.result, found.result),
        rendering.apparent_friction(found.result),
    )
    slide = found.result.motion == "slide"
    judged = fidelity.pearson, fidelity.relative_l2, fidelity.largest_error, felt.minimum(after=full_slip)
    return Rendered(felt.tangential_force[1:], felt.normal_force[1:], found.result.voltage[slide], *judged)


def _costs(found: rendering.Recording) -> dict[str, float]:
    """Steps asked for and the parts they took: every one of them is a converged equilibrium."""
    result = found.result
    return {"steps": float(len(result.step)), "parts": float(result.substeps.sum())}
