"""The same answer: twice, in a mirror, other units, other numbers of nodes, other steps."""

import warnings
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from evfem.electrostatics.laws import Kaczmarek, Layer
from evfem.finger.fingerpad import Electrical, MeshedFinger
from evfem.mesh.mesh import Mesh
from evfem.scene.motion import Press, Slide, VoltageRamp
from evfem.scene.scene import Scene, Solver
from evfem.simulation.result import COLUMNS, Result
from evfem.surface.surfaces import Display, Flat, Sinusoid
from evfem.tissue.laws import NeoHookean

from .case import Group, Log, Verdict, alike
from .scenes import block, finger, mirrored, pad, renumbered, scaled, scene, shaken

SAME = Group("same answer")
GROUPS = (SAME,)

#: columns that change sign in a mirror
ODD = ("position", "tangential_force", "applied_tangential_force", "electrostatic_force_x")
FORCES = ("normal_force", "applied_force", "electrostatic_force", "tangential_force")
CHARGED: dict[str, Any] = {"law": Kaczmarek(), "voltage": 1000.0}


def _apart(one: Result, other: Result, names: Any, factor: float = 1.0) -> float:
    """Largest difference of columns over the largest value; `other` is multiplied by `factor`."""
    worst = 0.0
    for name in names:
        a, b = getattr(one, name), factor * getattr(other, name)
        scale = max(np.abs(one.normal_force).max(), 1e-12) if name in FORCES else max(np.abs(a).max(), 1e-12)
        worst = max(worst, float(np.abs(a - b).max() / scale))
    return worst


def _twice(log: Log, asked: Scene) -> Verdict:
    first, second = log.simulate(asked), log.simulate(asked)
    columns = [name for name in COLUMNS if name not in ("seconds", "motion")]
    same = all(np.array_equal(getattr(first, name), getattr(second, name)) for name in columns)
    for a, b in zip(first.frames, second.frames, strict=True):
        same &= np.array_equal(a.displacement, b.displacement)
    return same, f"all columns and displacements are {'equal' if same else 'not equal'} bit for bit"


_SLOW = Press(indentation=0.5, steps=4), Slide(2.0, steps=10)
_FAST = Press(indentation=0.3, steps=3), Slide(1.0, steps=25, speed=20.0)
_VISCOUS = Solver(dynamics="viscous")
for _name, _scene in {
    "friction and voltage": scene(pad(True), Display(friction=0.5), *_SLOW, **CHARGED),
    "viscous texture": scene(pad(viscosity=1e-3), Sinusoid(friction=0.1), *_FAST, solver=_VISCOUS),
}.items():
    SAME.case(f"twice {_name}", "bit for bit the same", _name == "friction and voltage")(
        partial(_twice, asked=_scene)
    )


def _mirror(log: Log, left: Scene, right: Scene) -> Verdict:
    one, other = log.simulate(left), log.simulate(right)
    even = ("normal_force", "applied_force", "electrostatic_force", "stored_energy", "external_work")
    worst = max(_apart(one, other, even), _apart(one, other, ODD, -1.0))
    return worst < 1e-7, f"forces, works and energies within {worst:.0e}"


def _both_ways(bodies: list[Any], surfaces: list[Any], *motion: Any, **options: Any) -> list[Scene]:
    """A scene and its mirror image; of one body or surface that is its own, there is but one."""
    press, slide = motion
    back = replace(slide, distance=-slide.distance)
    return [
        scene(bodies[0], surfaces[0], press, slide, **options),
        scene(bodies[-1], surfaces[-1], press, back, **options),
    ]


_LOPSIDED, _DISPLAY = shaken(block(16, 6, sag=0.4), 0.4), Display(friction=0.5)
_FACES = [finger(_LOPSIDED), finger(mirrored(_LOPSIDED))]
#: a wave and its mirror image: a sin(kx + p) and a sin(-kx + p)
_WAVES = [Sinusoid(terms=[[0.02, s * 6.0, 0.4], [0.01, s * 9.0, 1.0]], friction=0.2) for s in (1.0, -1.0)]
_DEEP = Press(indentation=0.5, steps=4), Slide(3.0, steps=15)
_HELD = Press(force=0.02, steps=4), Slide(2.0, steps=10, hold="force")
_LONG = Press(indentation=0.3, steps=4), Slide(1.0, steps=40, speed=20.0)
for _name, (_one, _other) in {
    "ridged finger on a display": _both_ways([pad(True)], [_DISPLAY], *_DEEP, **CHARGED),
    "lopsided mesh": _both_ways(_FACES, [_DISPLAY], *_HELD, **CHARGED),
    "viscous on a wave": _both_ways([pad(viscosity=1e-3)], _WAVES, *_LONG, solver=_VISCOUS),
}.items():
    SAME.case(f"mirror {_name}", "mirrored histories to 1e-7", _name == "lopsided mesh")(
        partial(_mirror, left=_one, right=_other)
    )


def _body(mesh: Mesh, length: float, stress: float) -> MeshedFinger:
    skin = Electrical(stratum_corneum_thickness=0.38 * length, stratum_corneum_eps_r=1650.0)
    return MeshedFinger(scaled(mesh, length), {"tissue": NeoHookean(E=0.1 * stress, nu=0.4)}, skin)


def _units(log: Log, length: float, stress: float) -> Verdict:
    """Forces go with length times stress, energies with length^2 stress, voltages with its root."""
    mesh, ends = block(12, 6, sag=0.4), []
    for a, b in ((1.0, 1.0), (length, stress)):
        display = Display(Layer(0.09 * a, 3.35), friction=0.5)
        voltage = 1000.0 * a * float(np.sqrt(b))
        motion = Press(force=0.02 * a * b, steps=4), VoltageRamp(voltage, 3, hold="force"), Slide(2.0 * a, 10)
        asked = scene(_body(mesh, a, b), display, *motion, law=Kaczmarek())
        with warnings.catch_warnings():
            # in mm, MPa and V it would be doubted
            warnings.filterwarnings("ignore", ".*: (voltages|lengths|moduli) are in ")
            ends.append(log.simulate(asked))
    worst = max(
        _apart(ends[0], ends[1], FORCES, 1.0 / (length * stress)),
        _apart(ends[0], ends[1], ("stored_energy", "external_work"), 1.0 / (length**2 * stress)),
        _apart(ends[0], ends[1], ("indentation", "contact_width"), 1.0 / length),
    )
    return worst < 1e-7, f"forces, widths and energies within {worst:.0e}"


for _length, _stress in ((10.0, 1.0), (0.3, 1.0), (1.0, 1e3), (1.0, 1e-3), (20.0, 100.0)):
    SAME.case(
        f"units lengths x {_length:g} stresses x {_stress:g}", "the scaled history to 1e-7", _length == 10.0
    )(partial(_units, length=_length, stress=_stress))


def _numbers(log: Log, mesh: Mesh) -> Verdict:
    motion = Press(force=0.02, steps=4), Slide(2.0, steps=10)
    asked = [scene(finger(m), Display(friction=0.5), *motion, **CHARGED) for m in (mesh, renumbered(mesh))]
    one, other = map(log.simulate, asked)
    worst = _apart(one, other, (*FORCES, "indentation", "stored_energy", "external_work", "contact_width"))
    return worst < 1e-7, f"forces, widths and energies within {worst:.0e}"


SAME.case("other numbers of nodes and cells", "the same history to 1e-7", True)(
    partial(_numbers, mesh=_LOPSIDED)
)


_ENDS = "normal_force applied_force stored_energy contact_width"


def _split(options: dict[str, Any]) -> list[Scene]:
    """Without friction the end does not know in how many steps it was reached."""
    ways = ((Press(indentation=1.0, steps=n), Slide(2.0, steps=n)) for n in (2, 5, 20))
    return [scene(pad(), Display(friction=0.0), *motion, **options) for motion in ways]


for _name, _options in {"": {}, " with voltage": CHARGED}.items():
    SAME.case(f"split steps{_name}", "no friction: the end in 2, 5 and 20 steps the same to 1e-7")(
        partial(alike, scenes=_split(_options), columns=_ENDS, allowed=1e-7)
    )


def _resting(steps: int) -> Scene:
    rest = Press(indentation=0.3, steps=steps)
    return scene(pad(), Flat(friction=0.5), Press(indentation=0.3, steps=4), Slide(0.5, steps=5), rest)


SAME.case("split rest under friction", "a step cut into ten without moving changes nothing")(
    partial(alike, scenes=(_resting(1), _resting(10)), columns="tangential_force", allowed=1e-7)
)
