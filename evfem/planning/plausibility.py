"""Warnings about valid but implausible input.

`implausible` gives one sentence each: wrong units, fields beyond the breakdown of insulators, slides
that never touch. Unusable user-defined components are found by `evfem.planning.parts`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from evfem.circuit.signals import FollowForce
from evfem.common.checks import Values
from evfem.electrostatics.localgaps import roughness_below
from evfem.electrostatics.roughness import roughness_of
from evfem.electrostatics.timesignals import ChargeControl
from evfem.finger.fingerpad import MeshedFinger
from evfem.finger.layers import TABLE_2
from evfem.mesh.mesh import Mesh
from evfem.planning.attracted import PRESSED, broken_down, touching
from evfem.planning.resolution import path_depth
from evfem.protocols import ForceLaw, RoughnessLaw, TimeSignal
from evfem.scene.motion import Wait
from evfem.scene.scene import Scene
from evfem.surface.surfaces import Profile
from evfem.tissue.laws import NeoHookean
from evfem.tissue.space import ELEMENTS
from evfem.tissue.splitlaw import nearly_incompressible, split

#: shear modulus over that of Table 2 in a `FingerPad`, of what is hard when it is dry and of what is always
#: soft, and in a mesh (MPa) of its softest material and of the others, at most: kPa make a factor of 1000
TIMES_TABLE_2, TIMES_SOFT, SOFTEST, SOFTEST_SHEET, HARD = 1e4, 300.0, 10.0, 1e3, 2e4
DRIES = ("stratum_corneum", "nail")
#: height (mm) of a mesh below which it is a sheet and no finger
THIN = 1.0
#: size across (mm) of a mesh, at least, and of an insulator, at most; speed of a slide (mm/s), at
#: least, and rms slope of a profile, at most
SMALLEST, THICKEST_INSULATOR, SLOWEST, STEEPEST = 1.95, 0.95, 0.2, 5.0
#: stiffness against a change of volume over that in shear, of tissue in which elements lock: nu = 0.499995
LOCKED = 1e5
#: length (mm) of a sampled profile, at least, where it has more points than a step or a bump needs
SHORTEST, FEW = 0.15, 20
#: length (mm) of a profile's end that a finger there touches, and the variation of height in it, as a
#: fraction of the profile's height, above which the profile does not end level
BESIDE, ROUGH_END = 1.0, 0.1
#: travel of the bone over the width of the finger, and thickness of the stratum corneum (mm), at least
LEAST_TRAVEL, THINNEST_SKIN = 1e-3, 5e-3
#: load over the whole finger, relative to its softest shear modulus, at most; 2 N over 10 mm are 1
HEAVIEST = 20.0
#: depth of a plane finger (mm), at least; relaxation time of Kelvin-Voigt tissue (s), at most; frequency (Hz)
#: of a drive by its mean, at least, below which whole fingers shake along
THINNEST, SLOWEST_TISSUE, SLOWEST_DRIVE = 1.0, 1.0, 20.0
#: spacing (mm) of the positions at which a profile's height is sampled
WAY_STEP = 0.02


def implausible(scene: Scene, mesh: Mesh, moduli: Mapping[str, float]) -> tuple[str, ...]:
    """One sentence per valid but implausible input of a scene; `moduli` are the shear moduli (MPa) of
    the materials.
    """
    return (
        *_hard(scene, mesh, moduli),
        *_small(scene),
        *_large(scene, mesh, min(moduli.values())),
        *_other_units(scene, mesh),
        *_profile(scene, mesh),
        *_slow(scene),
        *_at_rest(scene),
        *_relaxed_before(scene),
        *_weakening(scene),
        *_out_of_reach(scene),
        *_breakdown(scene),
        *_unbearable(scene),
        *_hovering(scene, mesh),
    )


def locking(element: str, materials: Mapping[str, Any], dim: int) -> Iterator[str]:
    """A sentence for a nearly incompressible material in an element that locks."""
    if ELEMENTS[element][2] != "point":
        return
    locked = [name for name, law in materials.items() if nearly_incompressible(split(law, dim), dim, LOCKED)]
    if locked:
        cells = "p2 triangles lock" if element == "p2" else f"{element} cells lock"
        other = "quadrilaterals with q2p1" if element == "p2" else "q2p1 or q1_fbar"
        yield f"{' and '.join(locked)} is almost incompressible, and {cells}: use {other}"


def _hard(scene: Scene, mesh: Mesh, moduli: Mapping[str, float]) -> Iterator[str]:
    softest = min(moduli, key=lambda name: moduli[name])
    for name, modulus in moduli.items():
        thin = float(np.ptp(mesh.points[:, 1])) < THIN
        most = HARD if name != softest else SOFTEST_SHEET if thin else SOFTEST
        if name in TABLE_2 and not isinstance(scene.finger, MeshedFinger):
            times = TIMES_TABLE_2 if name in DRIES else TIMES_SOFT
            most = times * NeoHookean(*TABLE_2[name]).mu
        if modulus > most:
            much = f"the shear modulus of {name}, {modulus:.3g} MPa, is beyond that of any tissue"
            yield f"{much}: moduli are in MPa, not in Pa or kPa"


def _small(scene: Scene) -> Iterator[str]:
    skin = getattr(scene.finger.electrical, "stratum_corneum_thickness", None)
    if skin is not None and skin < THINNEST_SKIN:
        yield f"a stratum corneum of {skin:g} mm is thinner than any: lengths are in mm, not in m"
    if scene.depth is not None and scene.depth < THINNEST:
        yield f"a depth of {scene.depth:g} mm is less than that of any finger: lengths are in mm, not in m"
    travel = max(abs(length or 0.0) for c in scene.courses for length in (c.distance, c.indentation, c.gap))
    width = getattr(scene.finger, "width", None)
    # a mesh may have most of a half space beside a small contact
    if width is not None and 0.0 < travel < LEAST_TRAVEL * width:
        yield f"a finger of {width:g} mm is moved by {travel:g} mm at most: lengths are in mm, not in m"


def _other_units(scene: Scene, mesh: Mesh) -> Iterator[str]:
    """Lengths and speeds that look like cm, um or m/s."""
    size = float(np.ptp(mesh.points[:, :2], axis=0).max())
    if size < SMALLEST:
        yield f"the mesh is {size:.3g} mm across, less than any finger: lengths are in mm, not in cm"
    insulator = scene.electrics.insulator if scene.law is not None else None
    if insulator is not None and np.max(insulator.thickness) > THICKEST_INSULATOR:
        thick = (
            f"an insulator of {float(np.max(insulator.thickness)):g} mm is thicker than that of any display"
        )
        yield f"{thick}: lengths are in mm, 1 um is 0.001"
    for i, course in enumerate(scene.courses):
        if course.distance and course.speed is not None and course.speed <= SLOWEST:
            slow = f"motion {i} slides at {course.speed:g} mm/s, slower than any finger explores"
            yield f"{slow}: speeds are in mm/s, not in m/s"


def _profile(scene: Scene, mesh: Mesh) -> Iterator[str]:
    """A sampled profile in other units, or one that ends below the finger while it is still rough."""
    if not isinstance(scene.ground, Profile):
        return
    x, height = scene.ground.x, scene.ground.samples
    if (length := float(np.ptp(x))) < SHORTEST and x.size > FEW:
        yield f"the profile is {length:.3g} mm long: lengths are in mm, not in m"
    if (rms := float(np.sqrt(np.sum(np.diff(height) ** 2 / np.diff(x)) / length))) > STEEPEST:
        yield f"the profile has an rms slope of {rms:.3g}: positions and heights are both in mm"
    middle = np.cumsum([0.0, *(course.distance or 0.0 for course in scene.courses)])
    for end, reach in ((x[0], middle.min()), (x[-1], middle.max())):
        beside = height[np.abs(x - end) < BESIDE]
        over = (end - reach) * np.sign(end - np.mean(x)) < BESIDE
        if mesh.dim == 2 and over and np.ptp(beside) > ROUGH_END * np.ptp(height):
            yield (
                f"the profile ends at x = {end:.4g} mm below the finger, whose middle is over x = "
                f"{middle.min():.4g} to {middle.max():.4g} mm: beyond its ends it is level, so shift its rows"
            )


def _at_rest(scene: Scene) -> Iterator[str]:
    """Maxwell branches and viscosity in a scene with time, but without viscous or inertial dynamics."""
    if scene.solver.timed or not any(motion.takes_time for motion in scene.motion):
        return
    givers = (scene.finger, *scene.finger.materials.values())
    for name, does in {"relaxation": "its branches do", "viscosity": "its viscosity does"}.items():
        if any(getattr(one, name, None) for one in givers):
            yield f'tissue relaxes with dynamics = "viscous" or "inertial" alone: here {does} nothing'


def _relaxed_before(scene: Scene) -> Iterator[str]:
    """A first motion with time that waits, for Maxwell branches that are relaxed already."""
    timed = next((i for i, motion in enumerate(scene.motion) if motion.takes_time), 0)
    givers = (scene.finger, *scene.finger.materials.values())
    relaxes = scene.solver.timed and any(getattr(one, "relaxation", None) for one in givers)
    relaxes = relaxes and not isinstance(scene.voltage, TimeSignal)
    if timed and relaxes and isinstance(scene.motion[timed], Wait):
        yield (
            f"motion {timed} waits after motions without a speed, which end relaxed: the branches of the "
            "tissue relax after a press with a speed"
        )


def _slow(scene: Scene) -> Iterator[str]:
    """Relaxation times in ms and frequencies in kHz."""
    of = {"finger": scene.finger, **scene.finger.materials}
    times = {name: getattr(one, "viscosity", None) or 0.0 for name, one in of.items()}
    slowest = max(times, key=lambda name: times[name])
    if times[slowest] > SLOWEST_TISSUE:
        slow = f"a viscosity of {times[slowest]:g} s of the {slowest} is slower than any tissue"
        yield f"{slow}: relaxation times are in s, not in ms"
    at = scene.electrics.frequency
    if scene.drive is not None and not scene.drive.resolved and at is not None and at < SLOWEST_DRIVE:
        slow = f"a drive of {at:g} Hz shakes the finger, which its mean over the cycle leaves out"
        yield f'{slow}: frequencies are in Hz, not in kHz; or drive = "resolved"'


def _weakening(scene: Scene) -> Iterator[str]:
    """Friction that falls with the speed where nothing has mass, which has several solutions then."""
    if jumps(scene):
        yield (
            f"friction falls with the speed, and {scene.solver.dynamics} dynamics has no mass that a jump "
            "would move: where it sticks and slips is by chance; dynamics = inertial resolves it"
        )


def _out_of_reach(scene: Scene) -> Iterator[str]:
    """Attractions that are exactly 0: beyond the reach of adhesion, or of touching nodes alone in the air."""
    apart, law = _pressed(roughness_of(scene.roughness_gap)), scene.adhesion
    if law is not None and not np.any(law.traction(apart)):
        yield (
            f"{type(law).__name__} has no traction at {apart:g} mm, which rough faces keep where they touch: "
            "there is no adhesion at all; see its reach (film) and roughness_gap"
        )
    touches = any(course.presses or course.distance for course in scene.courses)
    if scene.electrics.acts and not scene.air_layer and not touches:
        yield "air_layer = false, and no motion presses: nothing touches, and nothing is attracted"


def _large(scene: Scene, mesh: Mesh, modulus: float) -> Iterator[str]:
    """Presses down to the bone, or with a force over the finger that is many times its `modulus` (MPa)."""
    bone, pad = (float(mesh.points[mesh.node_sets[name], 1].min()) for name in ("bone", "pad"))
    sides, unit = (mesh.points[:, ::2], "N") if mesh.dim == 3 else (mesh.points[:, :1], "N/mm")
    size = float(np.prod(np.ptp(sides, axis=0)))
    units = "forces are in N" if mesh.dim == 3 else "forces are in N/mm, a load in N over the depth in mm"
    for i, course in enumerate(scene.courses):
        depth, force = course.indentation or 0.0, course.force or 0.0
        if depth >= bone - pad > 0.0:
            yield f"motion {i} presses {depth:g} mm deep, but the bone is {bone - pad:.2g} mm above the skin"
        if force > HEAVIEST * modulus * size:
            much = f"{force / size:.3g} MPa over the whole finger"
            yield f"motion {i} presses with {force:g} {unit}, {much}: {units}"


def _breakdown(scene: Scene) -> Iterator[str]:
    """A field across a solid layer where the skin touches: U / |eps_r (g + s)|, s the sum of d / eps_r and g
    what rough faces keep.
    """
    found = isinstance(scene.voltage, (FollowForce, ChargeControl))
    if scene.law is None or found or any(course.gap is not None for course in scene.courses):
        return
    seen = scene.electrics
    solids = {"stratum corneum": seen.skin} | seen.films
    apart = _pressed(roughness_below(*seen.attraction, scene.roughness_gap))
    fields = {name: (layer, seen.field_in(layer, apart)) for name, layer in solids.items()}
    yield from broken_down(seen.crest * seen.largest_voltage, fields)


def touching_traction(scene: Scene, law: ForceLaw | None = None) -> float | None:
    """Attraction (MPa) of touching skin at the largest voltage by the closed form of the scene's law, or of
    another, as far as that is known: not under a charge, or a friction force that sets the voltage. Rough
    faces are as far apart as under `PRESSED`.
    """
    if not _known(scene):
        return None
    own, layers = scene.electrics.attraction
    law = law or own
    apart = _pressed(roughness_below(law, layers, scene.roughness_gap))
    return float(np.max(law.traction(apart, scene.electrics.largest_voltage, layers)))


def _known(scene: Scene) -> bool:
    """Whether a voltage attracts that is known before the run."""
    return scene.electrics.acts and not isinstance(scene.voltage, (FollowForce, ChargeControl))


def _pressed(rough: RoughnessLaw | None) -> Values:
    """How far apart (mm) rough faces are under `PRESSED`, 0 for smooth ones."""
    return 0.0 if rough is None else rough.separation(PRESSED)


def _unbearable(scene: Scene) -> Iterator[str]:
    """Where a fingertip is pressed: doubts about the attraction of touching skin."""
    pressed = any((course.depth or 0.0) > 0.0 for course in scene.courses)
    if pressed and _known(scene) and not isinstance(scene.finger, MeshedFinger):
        law, layers = scene.electrics.attraction
        apart = _pressed(roughness_below(law, layers, scene.roughness_gap))
        yield from touching(law, layers, scene.electrics.largest_voltage, apart)


def weakens(scene: Scene) -> bool:
    """Whether friction falls with the speed somewhere up to ten times the fastest motion's."""
    law, fastest = scene.friction_law, max(course.speed or 0.0 for course in scene.courses)
    if not (scene.has_friction and getattr(law, "timed", False)):
        return False
    speed = fastest * np.concatenate([[0.0], np.logspace(-4.0, 1.0, 101)])
    pressure, friction, age = (np.full(speed.size, value) for value in (PRESSED, 0.5, 1.0))
    bound = np.asarray(law.bound(pressure, friction, speed, age))
    return bool((np.diff(bound) < -1e-9 * np.abs(bound).max()).any())


def jumps(scene: Scene) -> bool:
    """Whether friction falls with the speed, and neither tissue nor hand has the mass that follows a jump."""
    massless = not scene.solver.inertial and not getattr(scene.hand, "mass", 0.0)
    return massless and weakens(scene)


def _hovering(scene: Scene, mesh: Mesh) -> Iterator[str]:
    """Slides after the last press that do not touch; earlier ones may be approaches."""
    presses = [i for i, course in enumerate(scene.courses) if (course.depth or 0.0) > 0.0]
    first, indentation = (presses[-1] + 1, math.inf) if presses else (0, 0.0)
    for i, course in enumerate(scene.courses[first:], first):
        if course.depth is not None:
            indentation = course.depth
        elif course.distance and _stays_up(scene, mesh, -indentation):
            above = f"{-indentation:g} mm above first touch" if indentation else "at first touch"
            yield f"motion {i}, a slide {above}, never touches: press before it"


def _stays_up(scene: Scene, mesh: Mesh, gap: float) -> bool:
    """Whether a pad `gap` (mm) off the first touch surely stays up: nothing attracts or loads it."""
    if gap < 0.0 or scene.electrics.acts or scene.forms:
        return False
    surface: Any = scene.ground
    if not surface.is_flat:
        gap -= path_depth(scene, mesh, WAY_STEP)
        return gap > 0.0
    return True
