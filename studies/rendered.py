"""Scenes and runs of the rendering studies: a friction step and a texture, felt and rendered on a
display.

What the paper leaves open is chosen here once: the load, the length of the slide, speed and
viscosity.
"""

from __future__ import annotations

import time
import warnings
from dataclasses import dataclass, field, replace

from evfem.common.arrays import Floats
from evfem.electrostatics.encoding import AreaLaw, Encoding
from evfem.electrostatics.laws import Kaczmarek, Layer, Layers
from evfem.estimate.rendering import (
    ApparentFriction,
    Recording,
    Signal,
    apparent_friction,
    compare,
    exact,
    record,
    replay,
    voltage_for,
)
from evfem.finger.fingerpad import Electrical, FingerPad
from evfem.finger.layers import TABLE_2
from evfem.scene.motion import Press, Slide
from evfem.scene.scene import Output, Scene, Solver
from evfem.surface.surfaces import Display, Flat, Sinusoid
from evfem.tissue.laws import NeoHookean

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
    `softness` multiplies the moduli of all tissue, `crest` is the flat share of a ridge (and of a
    groove).
    """

    friction: float | None = None
    ridges: bool = True
    resolution: str = "paper"
    steps: int = 60
    path: float = PATH
    force: float = 0.05
    hold: str = "indentation"
    viscosity: float = 0.0
    speed: float = 20.0
    dynamics: str = "quasistatic"
    softness: float = 1.0
    ridge_exponent: float = 7.0
    crest: float = 0.0
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

    `position`, `load` and `force` (n,) of the slide's steps; `lowest_friction` is the smallest
    apparent friction from `full_slip` (mm) on, `friction` that of the display, `signal` the closed
    form's voltage.
    """

    case: Case
    position: Floats
    load: Floats
    force: Floats
    full_slip: float
    lowest_friction: float
    friction: float
    signal: Signal
    rendered: dict[str, Rendered]
    costs: dict[str, float] = field(default_factory=dict)

    @property
    def apparent(self) -> Floats:
        """Apparent friction of each step."""
        return self.force / self.load


def pad(case: Case) -> FingerPad:
    """The finger of a case."""
    soft = {}
    if case.softness != 1.0:
        tissue = {name: law for name, law in TABLE_2.items() if name != "nail"}
        soft = {name: NeoHookean(E=case.softness * E, nu=nu) for name, (E, nu) in tissue.items()}
    return FingerPad(
        ridges=case.ridges,
        resolution=case.resolution,
        ridge_exponent=case.ridge_exponent,
        ridge_crest=case.crest,
        ridge_groove=case.crest,
        materials=soft,
        viscosity=case.viscosity,
        electrical=Electrical(stratum_corneum_thickness=case.skin),
    )


def reference_scene(case: Case, every: int = 1_000_000) -> Scene:
    """The reference of a case, with fields of every `every`-th step."""
    surface: Flat | Sinusoid = Flat(friction=[[0.0, BEFORE], [JUMP, BEFORE], [JUMP, AFTER]])
    if case.friction is not None:
        surface = Sinusoid(friction=case.friction)
    slide = Slide(case.path, steps=case.steps, hold=case.hold, speed=case.speed)
    motion = (Press(force=case.force, steps=5), slide)
    solver, output = Solver(dynamics=case.dynamics), Output(every=every)
    return Scene(pad(case), surface, motion=motion, solver=solver, output=output)


def reference_of(case: Case) -> Recording:
    """The run of a case's reference; that the load drifts where its indentation is held is known."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "motion 1 slides with the indentation held")
        return record(reference_scene(case))


def display_friction(case: Case, felt: ApparentFriction, full_slip: float) -> tuple[float, float]:
    """Smallest apparent friction of the reference after full slip, and the friction of the
    display.

    On the step the display has the coefficient before it; on texture the smallest apparent
    friction, or a fifth of the texture's own coefficient if that is larger (a negative one cannot
    be had).
    """
    lowest = felt.minimum(after=full_slip)
    if case.friction is None:
        return lowest, BEFORE
    return lowest, max(lowest, LEAST_SHARE * case.friction)


def display_encoding(friction: float) -> Encoding:
    """(20a) with the stratum corneum and the area law that give the paper's voltage."""
    skin, film = Layer(SKIN, 1650.0), Layer(0.09, 3.35)
    return Encoding(Kaczmarek(), Layers.of(skin, film), AREA, friction)


def render(case: Case) -> Outcome:
    """Run the reference of a case, and the display with each of its encodings.

    Encodings: "open" replays (20a), "exact" solves for the voltage, "thick" replays (20a) on a pad
    with Table 2's 0.38 mm of stratum corneum.
    """
    begin = time.process_time()
    reference = reference_of(case)
    felt = apparent_friction(reference.result)
    full_slip = reference.full_slip if reference.full_slip is not None else float(felt.position[1])
    lowest, friction = display_friction(case, felt, full_slip)
    signal = voltage_for(felt, display_encoding(friction))
    costs = {"reference_cpu_s": time.process_time() - begin} | _costs(reference)
    rendered = {}
    for kind in case.encodings:
        found = _replayed(kind, case, reference, friction, signal)
        rendered[kind] = _rendered(reference, found, full_slip)
        costs |= {f"{kind}_{name}": value for name, value in _costs(found).items()}
    costs["cpu_s"] = time.process_time() - begin
    return Outcome(
        case,
        felt.position[1:],
        felt.normal_force[1:],
        felt.tangential_force[1:],
        full_slip,
        lowest,
        friction,
        signal,
        rendered,
        costs,
    )


def _replayed(kind: str, case: Case, reference: Recording, friction: float, signal: Signal) -> Recording:
    display = Display(friction=friction)
    if kind == "exact":
        return exact(reference, display, Kaczmarek())
    if kind == "thick":
        finger = pad(replace(case, skin=0.38))
        reference = replace(reference, scene=replace(reference.scene, finger=finger))
    return replay(reference, display, Kaczmarek(), signal.profile)


def _rendered(reference: Recording, found: Recording, full_slip: float) -> Rendered:
    fidelity, felt = compare(reference.result, found.result), apparent_friction(found.result)
    slide = found.result.motion == "slide"
    return Rendered(
        felt.tangential_force[1:],
        felt.normal_force[1:],
        found.result.voltage[slide],
        fidelity.pearson,
        fidelity.relative_l2,
        fidelity.largest_error,
        felt.minimum(after=full_slip),
    )


def _costs(found: Recording) -> dict[str, float]:
    """Steps asked for and the parts they took: every one of them is a converged equilibrium."""
    result = found.result
    return {"steps": float(len(result.step)), "parts": float(result.substeps.sum())}
