"""Whether a scene makes sense: mistakes in a user's parts, and what is hardly meant, before it is
solved.

`check_parts` evaluates a user's laws once, near rest and at three gaps, and raises InputError for
what no run could use. `doubts` says in a sentence each what may be meant, but hardly is: units,
fields that no insulator withstands, slides that never touch. Built-in laws are not evaluated.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from evfem.electrostatics.laws import Layers, StrongTroxel
from evfem.electrostatics.signals import FollowForce, VoltageProfile
from evfem.electrostatics.timesignals import ChargeControl
from evfem.errors import InputError
from evfem.finger.fingerpad import FingerPad
from evfem.finger.layers import TABLE_2
from evfem.mesh.mesh import Mesh
from evfem.protocols import TimeSignal
from evfem.scene.driven import applied, attracting, lossless, solids
from evfem.scene.motion import Hover, Press, Slide, VoltageRamp
from evfem.scene.resolution import way
from evfem.scene.scene import Scene
from evfem.tensor import STEP, Array, complex_step, difference
from evfem.tissue.forms import Form
from evfem.tissue.laws import NeoHookean
from evfem.tissue.splitlaw import SplitLaw, split

#: strain at which a user's material is evaluated beside rest, and the step of differences there
STRAIN, STRAIN_STEP = 0.02, 1e-3
#: some displacement gradient in the plane: stretch, shear and rotation
DIRECTION = np.array([[1.0, 0.4, 0.0], [-0.2, 0.6, 0.0], [0.0, 0.0, 0.0]])
#: stress at rest over stiffness, and relative error of a derivative by complex step, at most
REST, DERIVATIVE = 1e-6, 1e-4
#: gaps (mm) at which a user's force law is evaluated, and attraction over that of rigid plates, at most
GAPS, STRONGEST = np.array([0.0, 0.1, 1.0]), 1e4
#: thickness of the stratum corneum (mm) where only the mesh knows it
SKIN = 0.4
#: shear modulus over that of Table 2 in a `FingerPad`, and in a mesh (MPa) of its softest material and of
#: the others, at most
TIMES_TABLE_2, SOFTEST, HARD = 1e4, 1e3, 2e4
#: field (V/um) that breaks any solid down, and a voltage (V) that is a mistake whatever the field
BREAKDOWN, HIGHEST_VOLTAGE = 300.0, 5e5
#: travel of the bone over the width of the finger, and thickness of the stratum corneum (mm), at least
LEAST_TRAVEL, THINNEST_SKIN = 1e-3, 5e-3
#: change of the attraction by the deformation below which a hovering pad does not come down
STAYS_UP = 0.1
#: lengths (mm) that a motion may have, and distance of the places at which a profile's height is looked at
TRAVEL, WAY_STEP = ("indentation", "distance", "gap"), 0.02


# -- mistakes of a user's parts ------------------------------------------------------------------------------


def check_parts(scene: Scene) -> None:
    """Raise InputError for a material or force law that no run could use, and for a voltage out of
    all reason.
    """
    for name, law in scene.finger.materials.items():
        if isinstance(law, Form) or not type(law).__module__.startswith("evfem."):
            _check_material(f"finger.materials.{name}", law)
    if not type(scene.friction_law).__module__.startswith("evfem."):
        _check_friction_law(scene.friction_law)
    voltage = largest_voltage(scene)
    if voltage > HIGHEST_VOLTAGE:
        raise InputError("electrostatics.voltage", voltage, f"a voltage in V up to {HIGHEST_VOLTAGE:g}")
    if scene.law is not None and not type(scene.law).__module__.startswith("evfem."):
        _check_force_law(scene, scene.law, voltage or 1.0)


def _check_material(key: str, law: Any) -> None:
    if isinstance(law, (Form, SplitLaw)):
        form = split(law)
        try:
            at = np.eye(2)[..., None, None]
            rest = _evaluated(key, "its stress", lambda F: _whole_stress(form, F), at)
        except InputError:
            if isinstance(law, Form):  # what a form must not use is said where it is integrated
                return
            raise
        _check_rest(key, rest, form.shear_modulus)
        return
    F = np.eye(3)[..., None, None] + DIRECTION[..., None, None] * np.array([[0.0], [STRAIN]])
    methods = {name: getattr(law, name) for name in ("P", "psi") if hasattr(law, name)}
    for name, method in methods.items():
        shape = _evaluated(key, f"{name}(F)", method, F).shape
        expected = F.shape if name == "P" else F.shape[2:]
        if shape != expected:
            given = f"{name}(F) of shape {shape} for F of shape {F.shape}"
            raise InputError(key, given, f"an array of shape {expected}, with a value for every point")
    name, method = next(iter(methods.items()), ("", law))  # P where there are both
    if not name:
        split(law)  # says what a material is
    _check_complex(key, f"{name}(F)", method, F[..., 1:, :])
    P = np.asarray(method(F)) if name == "P" else complex_step(method, F, rank=2)
    _check_rest(key, P[..., 0, 0], float(np.abs(P[..., 1, 0] - P[..., 0, 0]).max()) / STRAIN)


def _whole_stress(law: SplitLaw, F: Array) -> Array:
    """S + q I of a law in the split form at rest."""
    S, q = law.split_stress(F, np.zeros(F.shape[2:]))
    return S + q * F


def _evaluated(key: str, what: str, function: Callable[[Array], Any], at: Array) -> Array:
    """The values of a user's function; InputError where it raises anything, or they are not
    finite.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            value = np.asarray(function(at))
            finite = bool(np.isfinite(value).all())
        except Exception as error:  # whatever a user's code raises
            given = f"{what} that raises {type(error).__name__}: {error}"
            raise InputError(
                key, given, "a function that takes arrays with a value for every point"
            ) from error
    if not finite:
        raise InputError(key, f"{what} that is infinite or no number", "finite values at rest and in contact")
    return value


def _check_complex(key: str, what: str, function: Callable[[Array], Any], F: Array) -> None:
    """Whether a complex step along `DIRECTION` gives the derivative that differences give."""
    along = DIRECTION[..., None, None]
    allowed = "functions of numpy and evfem.tensor that take complex numbers: no abs, float, math or maximum"
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            exact = np.imag(np.asarray(function(F + 1j * STEP * along))) / STEP
    except Exception as error:  # whatever a user's code raises
        given = f"{what} that raises {type(error).__name__} on complex numbers: {error}"
        raise InputError(key, given, allowed) from error
    near = difference(lambda t: np.asarray(function(F + t * along)), np.zeros(()), STRAIN_STEP)
    if not np.abs(exact - near).max() <= DERIVATIVE * np.abs(near).max():
        raise InputError(key, f"{what} whose derivative is lost in a complex step", allowed)


def _check_rest(key: str, stress: Array, stiffness: float) -> None:
    largest = float(np.abs(stress).max())
    if largest > REST * abs(stiffness):
        raise InputError(key, f"a stress of {largest:.3g} MPa at rest", "no stress at F = 1")


def _check_friction_law(law: Any) -> None:
    """Whether a user's bound is finite, not negative, and a value for every node."""
    key, what = "surface.friction_law", "bound(pressure, mu, speed, age)"
    p, zero = np.array([0.0, 1e-4, 0.01]), np.zeros(3)
    found = _evaluated(key, what, lambda pressure: law.bound(pressure, 0.3 + zero, zero, zero), p)
    if found.shape not in ((), p.shape):
        given = f"a bound of shape {found.shape} at pressures of shape {p.shape}"
        raise InputError(key, given, "a value for every node")
    if (found < 0.0).any():
        raise InputError(key, f"a bound of {found.min():.3g} MPa", "values that are not negative")


def _check_force_law(scene: Scene, law: Any, voltage: float) -> None:
    """Whether a user's traction is finite, attracts, does not grow with the gap, and is in MPa."""
    key, layers = "electrostatics.law", _layers(scene)
    what = "traction(gap, voltage, layers)"
    found = _evaluated(key, what, lambda gap: law.traction(gap, voltage, layers), GAPS)
    if found.shape not in ((), GAPS.shape):
        given = f"a traction of shape {found.shape} at gaps of shape {GAPS.shape}"
        raise InputError(key, given, "a value for every gap")
    traction = np.broadcast_to(found, GAPS.shape)
    if (traction < 0.0).any():
        raise InputError(key, f"a traction of {traction.min():.3g} MPa", "positive values, which attract")
    if (np.diff(traction) > 0.0).all():
        given = f"a traction that grows from {traction[0]:.3g} MPa in contact to {traction[-1]:.3g} at 1 mm"
        raise InputError(key, given, "an attraction that falls with the gap")
    rigid = StrongTroxel().traction(GAPS, voltage, layers)
    over = float(np.median(traction / rigid))
    if over > STRONGEST:
        given = f"{over:.1e} times the attraction of parallel plates"
        raise InputError(key, given, "a traction in MPa, not in Pa, of gaps in mm")


def _layers(scene: Scene) -> Layers:
    """The solid layers, with a usual stratum corneum where only the mesh knows its thickness."""
    return attracting(scene, *solids(scene, *skin_of(scene)))[1]


def skin_of(scene: Scene) -> tuple[float, float]:
    """Thickness (mm) and permittivity of the stratum corneum."""
    electrical = scene.finger.electrical
    thickness: Any = getattr(electrical, "stratum_corneum_thickness", None)
    if thickness is None:
        thickness = getattr(scene.finger, "stratum_corneum_thickness", SKIN)
    return float(thickness), float(getattr(electrical, "stratum_corneum_eps_r", 1650.0))


def largest_voltage(scene: Scene) -> float:
    """Largest magnitude of the voltage anywhere in the scene (V)."""
    own: Any = applied(scene)
    if isinstance(own, VoltageProfile):
        own = own.voltage
    elif isinstance(own, FollowForce):
        own = own.largest_voltage
    elif isinstance(own, TimeSignal):
        own = own.largest
    ramps = [abs(motion.voltage) for motion in scene.motion if isinstance(motion, VoltageRamp)]
    return float(max([np.abs(own).max(), *ramps]))


# -- what is hardly meant ------------------------------------------------------------------------------------


def doubts(scene: Scene, mesh: Mesh, moduli: Mapping[str, float]) -> tuple[str, ...]:
    """A sentence for everything in a scene that may be meant, but hardly is; `moduli` are the
    shear moduli (MPa) of the materials.
    """
    return (*_hard(scene, moduli), *_small(scene), *_breakdown(scene), *_hovering(scene, mesh))


def _hard(scene: Scene, moduli: Mapping[str, float]) -> Iterator[str]:
    softest = min(moduli, key=lambda name: moduli[name])
    for name, modulus in moduli.items():
        most = SOFTEST if name == softest else HARD
        if isinstance(scene.finger, FingerPad):
            most = TIMES_TABLE_2 * NeoHookean(*TABLE_2[name]).mu
        if modulus > most:
            much = f"the shear modulus of {name}, {modulus:.3g} MPa, is beyond that of any tissue"
            yield f"{much}: moduli are in MPa, not in Pa"


def _small(scene: Scene) -> Iterator[str]:
    finger = scene.finger
    skin = getattr(finger.electrical, "stratum_corneum_thickness", None)
    if skin is not None and skin < THINNEST_SKIN:
        yield f"a stratum corneum of {skin:g} mm is thinner than any: lengths are in mm, not in m"
    lengths = [abs(getattr(m, name) or 0.0) for m in scene.motion for name in TRAVEL if hasattr(m, name)]
    travel = max(lengths, default=0.0)
    if isinstance(finger, FingerPad) and 0.0 < travel < LEAST_TRAVEL * finger.width:
        width = f"{finger.width:g} mm"
        yield f"a finger of {width} is moved by {travel:g} mm at most: lengths are in mm, not in m"


def _breakdown(scene: Scene) -> Iterator[str]:
    """A field across a solid layer where the skin touches: U / (eps_r s), s the sum of d / eps_r."""
    if scene.law is None or isinstance(scene.voltage, (FollowForce, ChargeControl)):
        return
    voltage, layers = largest_voltage(scene), solids(scene, *skin_of(scene))
    reduced = float(np.min(_layers(scene).reduced))
    for name, layer in zip(("stratum corneum", "insulator"), layers, strict=True):
        field = 1e-3 * voltage / (float(np.min(lossless(scene, layer).eps_r)) * reduced)
        if field > BREAKDOWN and np.max(layer.thickness) > 0.0:
            yield (
                f"{voltage:g} V make a field of {field:.3g} V/um in the {name}, and any solid breaks down "
                f"above {BREAKDOWN:g} V/um: voltages are in V, thicknesses in mm"
            )


def _hovering(scene: Scene, mesh: Mesh) -> Iterator[str]:
    """Slides after the last press that do not touch: before it, the bone may be on its way."""
    presses = [i for i, m in enumerate(scene.motion) if isinstance(m, Press) and _target(m) > 0.0]
    first, indentation = (presses[-1] + 1, math.inf) if presses else (0, 0.0)
    for i, motion in enumerate(scene.motion[first:], first):
        if isinstance(motion, Hover):
            indentation = -motion.gap
        elif isinstance(motion, Press):
            indentation = _target(motion)
        elif isinstance(motion, Slide) and _stays_up(scene, mesh, -indentation):
            above = f"{-indentation:g} mm above first touch" if indentation else "at first touch"
            yield f"motion {i}, a slide {above}, never touches: press before it"


def _target(press: Press) -> float:
    """Indentation that a press ends at, as far as it is known: a force always touches."""
    return math.inf if press.indentation is None else press.indentation


def _stays_up(scene: Scene, mesh: Mesh, gap: float) -> bool:
    """Whether a pad whose undeformed outline is `gap` (mm) off the first touch does not come down."""
    if gap < 0.0:
        return False
    surface: Any = scene.ground
    if not surface.is_flat:
        gap -= float(np.ptp(surface.height(way(scene, mesh, WAY_STEP))))
        if gap <= 0.0:
            return False
    if scene.law is None or largest_voltage(scene) == 0.0:
        return True
    return gap > 0.0 and hover_share(scene, mesh, gap) < STAYS_UP


def hover_share(scene: Scene, mesh: Mesh, gap: float) -> float:
    """Upper estimate of the relative change of the attraction by the deformation of a hovering
    pad.

    The softest tissue under the largest traction, from pad to bone: deflection p h / E, times d(ln
    p)/dg, of the weaker of which the laws' bound is 1/(g + s) + 1/(g + D) with the traction of the
    smallest gap.
    """
    assert scene.law is not None
    layers = Layers.of(lossless(scene, scene.ground.insulator))
    traction = float(np.max(scene.law.traction(gap, largest_voltage(scene), layers)))
    softest = min(2.0 * split(law).shear_modulus for law in scene.finger.materials.values())
    depth = float(np.ptp(mesh.points[:, 1]))
    return traction * depth / softest * 2.0 / gap
