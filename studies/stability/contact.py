"""Cases of contact and friction: reversals, jumps, texture, deep and light, steps too large."""

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from evfem.electrostatics.laws import Kaczmarek
from evfem.scene.motion import Hover, Motion, Press, Slide
from evfem.scene.scene import Output, Scene, Solver
from evfem.simulation.result import Result
from evfem.surface.surfaces import Display, Flat, Profile, Sinusoid

from .case import Group, Log, Verdict, alike
from .scenes import block, finger, pad, scene

FRICTION = Group("friction")
TEXTURE = Group("texture")
MOTION = Group("motion")
STEPS = Group("large steps")
GROUPS = (FRICTION, TEXTURE, MOTION, STEPS)


def _ratio(result: Result, row: int) -> float:
    return float(result.tangential_force[row] / result.normal_force[row])


def _reversals(log: Log, mu: float, ridges: bool) -> Verdict:
    """Two reversals, each leg long enough to slip everywhere."""
    legs = (4.0 + 2.0 * mu) * np.array([1.0, -1.5, 1.5])
    slides = [Slide(leg, steps=20) for leg in legs]
    result = log.simulate(scene(pad(ridges), Flat(friction=mu), Press(indentation=0.3, steps=3), *slides))
    ratios = [_ratio(result, row) for row in (22, 42, 62)]
    off = max(abs(r - s * mu) for r, s in zip(ratios, (1.0, -1.0, 1.0), strict=True))
    return off < 1e-6, f"F_t/F_n at the end of the legs {', '.join(f'{r:+.6f}' for r in ratios)}"


for _mu in (0.0, 0.3, 1.0, 2.0):
    _full = "full slip at the end of every leg: F_t = +mu, -mu, +mu F_n"
    FRICTION.case(f"reversals mu {_mu:g}", _full, _mu == 0.3)(partial(_reversals, mu=_mu, ridges=False))
FRICTION.case("ridges that fold", "mu = 1.5 drags ridges over and back: F_t = +mu, -mu, +mu F_n")(
    partial(_reversals, mu=1.5, ridges=True)
)


def _jump(log: Log, table: list[list[float]]) -> Verdict:
    """Coulomb's law with the coefficient of each node's accepted x, in every step."""
    slid = scene(pad(), Flat(friction=table), Press(force=0.05, steps=5), Slide(4.0, steps=40))
    asked, worst = replace(slid, output=Output()), 0.0
    result = log.simulate(asked)
    for frame in result.frames:
        mu = asked.ground.friction_coefficient(result.mesh.points[:, 0] + frame.displacement[:, 0])
        worst = max(worst, float((np.abs(frame.shear_traction) - mu * frame.contact_pressure).max()))
    end = _ratio(result, -1)
    good = worst < 1e-9 and abs(end - table[-1][1]) < 1e-6
    return good, f"cone exceeded by at most {worst:.0e} MPa, F_t/F_n = {end:.7f} behind the jump"


for _name, _table in {
    "up": [[1.0, 0.2], [1.0, 1.0]],
    "down": [[1.0, 1.0], [1.0, 0.2]],
    "steep": [[0.4, 0.2], [0.41, 0.7]],
}.items():
    FRICTION.case(
        f"jump {_name}", "Coulomb's law at every node's own place, mu F_n of the far side at the end"
    )(partial(_jump, table=_table))


@FRICTION.case("stop and go", "two rests change nothing without time: forces of the uninterrupted slide")
def _stop_and_go(log: Log) -> Verdict:
    flat, press, rest = Flat(friction=0.5), Press(indentation=0.3, steps=3), Press(indentation=0.3, steps=2)
    parts: list[Motion] = [Slide(1.0, steps=5), rest, Slide(1.0, steps=5), rest, Slide(1.0, steps=5)]
    stopping = log.simulate(scene(pad(), flat, press, *parts))
    through = log.simulate(scene(pad(), flat, press, Slide(3.0, steps=15)))
    error = abs(float(stopping.tangential_force[-1] / through.tangential_force[-1]) - 1.0)
    idle = float(np.abs(np.diff(stopping.tangential_force[7:10])).max() / stopping.tangential_force[7])
    return max(error, idle) < 1e-7, f"F_t changes by {idle:.0e} at rest, at the end it is {error:.0e} off"


@FRICTION.case("20 mm", "full slip lasts: F_t = 0.3 F_n and the same F_n from 6 to 20 mm")
def _far(log: Log) -> Verdict:
    motion = Press(force=0.1, steps=5), Slide(20.0, steps=80)
    result = log.simulate(scene(pad(True), Flat(friction=0.3), *motion))
    later = result.position > 6.0
    off = float(np.abs(result.tangential_force[later] / result.normal_force[later] - 0.3).max())
    spread = float(np.ptp(result.normal_force[later]) / result.normal_force[-1])
    return off < 1e-6 and spread < 1e-6, f"F_t/F_n within {off:.0e}, F_n within {spread:.0e} from 6 to 20 mm"


def _textured(surface: Any, ridges: bool, dynamics: str, distance: float = 2.0, steps: int = 100) -> Scene:
    """0.5 mm deep, slid at 20 mm/s with a relaxation time of 1 ms."""
    motion = Press(indentation=0.3, steps=5), Slide(distance, steps=steps, speed=20.0)
    return scene(pad(ridges, viscosity=1e-3), surface, *motion, solver=Solver(dynamics=dynamics))


def _slides_over(log: Log, asked: Scene, mu: float, finer: Scene | None = None) -> Verdict:
    """Mean friction at least mu (slopes only dissipate), no node below the surface, energy not gained. With a
    `finer` scene, of more steps: what is gained is an error of the works, which falls with the step.
    """
    result = log.simulate(asked)
    later = result.position > 0.5 * result.position[-1]
    mean = float(result.tangential_force[later].mean() / result.normal_force[later].mean())
    deepest = float(result.min_gap.min())
    gained = _gained(result)
    good = mean > 0.98 * mu and deepest > -1e-6
    said = f"mean F_t/F_n {mean:.3f} with mu {mu:g}, deepest gap {deepest:.0e} mm"
    said = f"{said}, energy {'gained' if gained > 0.0 else 'lost'} {abs(gained):.1%}"
    if finer is None:
        return good and gained < 0.02, said
    left = _gained(log.simulate(finer))
    return good and left < 0.9 * gained, f"{said}, {left:.1%} in {finer.total_steps} steps"


def _gained(result: Result) -> float:
    """Energy that was not given, over the largest work: an error of the quadrature of the works."""
    kept = result.stored_energy + result.friction_dissipation + result.viscous_dissipation
    return float((kept + result.kinetic_energy - result.external_work).max() / result.external_work.max())


def grating(pitch: float = 1.0, height: float = 0.1, wall: float = 0.02) -> Profile:
    """Rectangular grooves with steep walls, sampled at their corners."""
    start = np.arange(-12.0, 24.0, pitch)
    corners = np.array([0.0, 0.5 * pitch, 0.5 * pitch + wall, pitch - wall])
    return Profile(
        (start[:, None] + corners).ravel(), np.tile([0.0, 0.0, -height, -height], len(start)), friction=0.2
    )


def rough(rms: float = 0.005, spacing: float = 0.05) -> Profile:
    """Heights of a random walk that is pulled back to zero, sampled at `spacing` (mm)."""
    x = np.arange(-12.0, 24.0, spacing)
    noise = np.random.default_rng(11).normal(size=len(x))
    height = np.zeros(len(x))
    for i in range(1, len(x)):
        height[i] = 0.8 * height[i - 1] + noise[i]
    return Profile(x, rms * (height - height.mean()) / height.std(), friction=0.2)


def wave(length: float, amplitude: float, mu: float = 0.2) -> Sinusoid:
    """A sine of that wavelength and amplitude (mm)."""
    return Sinusoid(terms=[[amplitude, 2.0 * np.pi / length, 0.0]], friction=mu)


_OVER = "passes: mean F_t/F_n at least mu, no penetration, no energy gained"


def _add(
    name: str, asked: Scene, finer: Scene | None = None, physics: str = _OVER, quick: bool = False
) -> None:
    mu = float(np.max(asked.surface.friction))  # type: ignore[attr-defined]
    TEXTURE.case(name, physics, quick)(partial(_slides_over, asked=asked, mu=mu, finer=finer))


def _over_walls(name: str, ridges: bool, dynamics: str) -> None:
    """A grating in steps as long as its walls are wide, and in a quarter of that."""
    asked, finer = (_textured(grating(), ridges, dynamics, 1.0, steps) for steps in (50, 200))
    _add(name, asked, finer, _WALLS)


#: walls as wide as a step: works by the trapezoidal rule are coarse there
_WALLS = _OVER + " but by works over walls of 0.1 mm within one step of 0.02 mm, less in shorter ones"
for _dynamics in ("viscous", "inertial"):
    _eq25, _pitch = Sinusoid(friction=0.1), wave(0.5, 0.03)
    _add(f"equation 25 {_dynamics}", _textured(_eq25, False, _dynamics))
    _add(f"equation 25 {_dynamics} ridged", _textured(_eq25, True, _dynamics))
    _add(f"wavelength of the ridges {_dynamics}", _textured(_pitch, True, _dynamics))
    _over_walls(f"sharp grating {_dynamics}", False, _dynamics)
_over_walls("sharp grating ridged", True, "viscous")
_add("sampled rough profile", _textured(rough(), False, "viscous"))
_add(
    "gentle wave quasi-static",
    scene(pad(), wave(4.0, 0.01), Press(indentation=0.3, steps=3), Slide(5.0, steps=25)),
    physics="no snap: passes without time, mean F_t/F_n at least mu, no energy gained",
    quick=True,
)


def _deep(log: Log, ridges: bool) -> Verdict:
    motion = Press(indentation=3.0, steps=15), Slide(3.0, steps=15)
    result = log.simulate(scene(pad(ridges), Flat(friction=0.3), *motion))
    stiffness = np.diff(result.normal_force[:15])
    least = float(result.frames[-1].J.min())
    good = bool((np.diff(stiffness) > 0.0).all()) and least > 0.0
    said = f"F_n {result.normal_force[14]:.3f} N/mm, stiffening all the way"
    return good, f"{said}; smallest cell J {least:.2f}"


for _name, _ridges in (("smooth", False), ("ridged", True)):
    MOTION.case(f"3 mm {_name}", "every further 0.2 mm costs more than the one before; cells stay valid")(
        partial(_deep, ridges=_ridges)
    )


def _first_touch(log: Log, voltage: float) -> Verdict:
    """From a hover of 0.3 mm and from touch: the same state at the same load."""
    options: dict[str, Any] = {"law": Kaczmarek(), "voltage": voltage} if voltage else {}
    display, press = Display(friction=0.0), Press(force=0.05, steps=5)
    asked = (scene(pad(), display, *first, press, **options) for first in ([Hover(0.3)], []))
    return alike(log, asked, "indentation normal_force stored_energy", 1e-6)


for _name, _voltage in (("", 0.0), (" 1000 V", 1000.0)):
    MOTION.case(
        f"first touch under force{_name}", "from 0.3 mm above to 0.05 N/mm: as from touch", not _voltage
    )(partial(_first_touch, voltage=_voltage))


@MOTION.case("loss of contact under force", "a load that vanishes: F_n follows it down to 1e-6 N/mm", True)
def _unload(log: Log) -> Verdict:
    loads = [Press(force=force, steps=3) for force in (0.05, 1e-4, 1e-6)]
    result = log.simulate(scene(pad(), Flat(friction=0.0), *loads, Press(indentation=-0.1, steps=2)))
    off = abs(float(result.normal_force[8]) - 1e-6)
    good = off < 2e-8 and abs(result.normal_force[-1]) < 1e-12 and result.min_gap[-1] > 0.0999
    return good, f"F_n within {off:.0e} N/mm of 1e-6, then open with {result.min_gap[-1]:.4f} mm"


@MOTION.case(
    "over an edge under force", "the surface ends in a cliff of 0.3 mm: the load is carried throughout"
)
def _cliff(log: Log) -> Verdict:
    cliff = Profile([-20.0, 3.0, 3.1, 30.0], [0.0, 0.0, -0.3, -0.3], friction=0.0)
    motion = Press(force=0.05, steps=5), Slide(8.0, steps=80, speed=20.0, hold="force")
    body = pad(viscosity=1e-3)
    result = log.simulate(scene(body, cliff, *motion, solver=Solver(dynamics="viscous")))
    fallen = float(result.indentation[-1] - result.indentation[4])
    off = float(np.abs(result.applied_force[4:] - 0.05).max())
    return abs(fallen - 0.3) < 0.02 and off < 1e-7, f"falls {fallen:.4f} mm, load within {off:.0e} N/mm"


@MOTION.case("full unloading", "pressed, slid and lifted: undeformed, all work went into friction")
def _unloading(log: Log) -> Verdict:
    motion = Press(indentation=1.0, steps=8), Slide(2.0, steps=8), Press(indentation=-0.1, steps=10)
    result = log.simulate(scene(pad(), Flat(friction=0.3), *motion))
    left = float(np.abs(result.frames[-1].displacement - [2.0, 0.1]).max())
    work = float(result.external_work[-1] / result.friction_dissipation[-1]) - 1.0
    good = left < 1e-9 and result.stored_energy[-1] < 1e-12 and abs(work) < 0.05
    return good, f"{left:.0e} mm and {result.stored_energy[-1]:.0e} N left, work {work:+.1%} of friction's"


def _at_once(log: Log, ridges: bool, mu: float, depth: float) -> Verdict:
    """To `depth` and 8 mm far, in steps ten times as large as usual; full slip forgets the path."""
    ends = []
    for press, slide in ((10, 40), (1, 4)):
        motion = Press(indentation=depth, steps=press), Slide(8.0, steps=slide)
        ends.append(log.simulate(scene(pad(ridges), Flat(friction=mu), *motion)))
    off = abs(float(ends[1].tangential_force[-1] / ends[0].tangential_force[-1]) - 1.0)
    full = abs(_ratio(ends[1], -1) - mu)
    return off < 1e-6 and full < 1e-6, f"F_t within {off:.0e} of the same in small steps"


for _ridges, _mu, _depth in ((False, 0.5, 1.5), (True, 0.5, 1.5), (False, 1.0, 0.5)):
    STEPS.case(
        f"press and slide mu {_mu:g}{' ridged' if _ridges else ''}",
        "the end of the path in small steps, cut where needed",
    )(partial(_at_once, ridges=_ridges, mu=_mu, depth=_depth))


def _pressed(body: Any, *motion: Motion) -> Scene:
    return scene(body, Flat(friction=0.0), *motion)


STEPS.case("3 mm in one step", "the force of thirty steps (no friction)")(
    lambda log: alike(
        log, [_pressed(pad(), Press(indentation=3.0, steps=n)) for n in (30, 1)], "normal_force", 1e-7
    )
)
STEPS.case("0.3 N/mm in one step", "the indentation of thirty steps (no friction)")(
    lambda log: alike(log, [_pressed(pad(), Press(force=0.3, steps=n)) for n in (30, 1)], "indentation", 1e-7)
)


@STEPS.case("touch from 1 mm above in one step", "the force of a press in ten steps (no friction)", True)
def _touch_at_once(log: Log) -> Verdict:
    body, ways = finger(block(8, 3, sag=0.4)), ([], [Hover(1.0)])
    asked = [_pressed(body, *way, Press(indentation=0.5, steps=1 if way else 10)) for way in ways]
    return alike(log, asked, "normal_force", 1e-7)


@STEPS.case(
    "texture ten times too fast",
    "viscous, 0.2 mm a step over equation (25): passes, cut where needed; works coarse, less in short ones",
)
def _coarse_texture(log: Log) -> Verdict:
    asked, finer = (_textured(Sinusoid(friction=0.1), False, "viscous", 4.0, steps) for steps in (20, 80))
    return _slides_over(log, asked, 0.1, finer)
