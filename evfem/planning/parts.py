"""Mistakes in a user's parts of a scene, found before it is solved.

`check_parts` evaluates a user's laws once, near rest and at three gaps, and what contact asks of
them (`evfem.planning.partchecks`), and raises InputError for what no run could use. Built-in parts
are not evaluated.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from inspect import getattr_static, isfunction
from typing import Any

import numpy as np

from evfem.electrostatics.laws import StrongTroxel
from evfem.electrostatics.signals import FollowForce, VoltageProfile
from evfem.errors import InputError
from evfem.planning.partchecks import (
    check_arguments,
    check_friction_law,
    check_roughness,
    check_shape,
    check_surface,
    evaluated,
)
from evfem.protocols import RoughnessLaw, TimeSignal
from evfem.scene.scene import Scene
from evfem.tensor import STEP, Array, complex_step, det, difference, inv, trace, transpose
from evfem.tissue.forms import Form
from evfem.tissue.splitlaw import SplitLaw, split

#: strain at which a user's material is evaluated beside rest, and the step of differences there
STRAIN, STRAIN_STEP = 0.02, 1e-3
#: some displacement gradient in the plane: stretch, shear and rotation
DIRECTION = np.array([[1.0, 0.4, 0.0], [-0.2, 0.6, 0.0], [0.0, 0.0, 0.0]])
#: stress at rest over stiffness, and relative error of a derivative by complex step, at most
REST, DERIVATIVE = 1e-6, 1e-4
#: stiffness at rest over the largest one that counts as none: rounding
NO_STIFFNESS = 1e-11
#: shear and widening in the plane, (3, 3, 2, 2): which of them, and either way
WAYS = np.zeros((3, 3, 2, 2))
WAYS[0, 1, 0] = WAYS[0, 0, 1] = WAYS[1, 1, 1] = 1.0, -1.0
#: gaps (mm) at which a user's force law is evaluated, and attraction over that of rigid plates, at most
GAPS, STRONGEST = np.array([0.0, 0.1, 1.0]), 1e4
#: step (mm) of differences by the gap, far below the thinnest insulator, and median relative error of a
#: derivative at the gaps, at most: tables have kinks
GAP_STEP, BY_GAP = 1e-5, 1e-3
#: change per mm over the value that counts as none
NO_RATE = 1e-6
#: moments of a voltage over time, and places of one over the way, at which its sign is looked at
MOMENTS = 100
#: a voltage (V) that is a mistake whatever the field
HIGHEST_VOLTAGE = 5e5


def check_parts(scene: Scene, dim: int) -> None:
    """InputError for a user's part that no run in `dim` dimensions can use, or a voltage out of reason."""
    with_terms = {term.on.name for term in scene.forms}
    for name, law in scene.finger.materials.items():
        key = f"finger.materials.{name}"
        if isinstance(law, Form) or _is_own(law):
            _check_material(key, law, dim)
        # a form may depend on the place, and a term may be what makes a region stiff
        if _is_own(law) and name not in with_terms:
            _check_stiffness(key, law, dim)
    if _is_own(scene.surface):
        check_surface(scene)
    if _is_own(scene.friction_law):
        check_friction_law(scene)
    if isinstance(scene.roughness_gap, RoughnessLaw) and _is_own(scene.roughness_gap):
        check_roughness(scene.roughness_gap)
    voltage = scene.electrics.largest_voltage
    if voltage > HIGHEST_VOLTAGE:
        raise InputError("electrostatics.voltage", voltage, f"a voltage in V up to {HIGHEST_VOLTAGE:g}")
    if scene.law is not None and _is_own(scene.law):
        _check_force_law(scene, scene.law, voltage)


def _is_own(part: Any) -> bool:
    """Whether a part is the user's own."""
    return not type(part).__module__.startswith("evfem.")


def _check_material(key: str, law: Any, dim: int) -> None:
    methods = {name: getattr(law, name) for name in ("P", "psi") if hasattr(law, name)}
    # static methods need no object
    if isinstance(law, type) and any(isfunction(getattr_static(law, name)) for name in methods):
        raise InputError(key, f"the class {law.__name__}", "an object of it")
    if isinstance(law, (Form, SplitLaw)):
        form = split(law, dim)
        try:
            at = np.eye(dim)[..., None, None]
            rest = evaluated(key, "its stress", lambda F: _split_stress(form, F), at)
        except InputError:
            if isinstance(law, Form):  # what a form must not use is said where it is integrated
                return
            raise
        _check_rest(key, rest, form.shear_modulus)
        return
    F = np.eye(3)[..., None, None] + DIRECTION[..., None, None] * np.array([[0.0], [STRAIN]])
    for name, method in methods.items():
        shape = evaluated(key, f"{name}(F)", method, F).shape
        expected = F.shape if name == "P" else F.shape[2:]
        if shape != expected:
            given = f"{name}(F) of shape {shape} for F of shape {F.shape}"
            raise InputError(key, given, f"an array of shape {expected}, with a value for every point")
    name, method = next(iter(methods.items()), ("", law))  # P where there are both
    if not name:
        split(law, dim)  # says what a material is
    _check_complex(key, f"{name}(F)", method, F[..., 1:, :])
    P = np.asarray(method(F)) if name == "P" else complex_step(method, F, rank=2)
    _check_rest(key, P[..., 0, 0], float(np.abs(P[..., 1, 0] - P[..., 0, 0]).max()) / STRAIN)


def _check_stiffness(key: str, law: Any, dim: int) -> None:
    """Whether a user's material resists shear and widening at rest."""
    F = np.eye(3)[..., None, None] + STRAIN_STEP * WAYS
    if isinstance(law, SplitLaw):
        P = evaluated(key, "its stress", lambda F: _split_stress(law, F), F[:dim, :dim])
    elif hasattr(law, "P"):
        P = np.asarray(law.P(F))
    else:
        P = evaluated(key, "psi(F)", lambda F: complex_step(law.psi, F, rank=2), F)
    rate = (P[..., 0] - P[..., 1]) / (2.0 * STRAIN_STEP)
    found = {"shear": float(rate[0, 1, 0]), "widening": 0.25 * float(rate[0, 0, 1] + rate[1, 1, 1])}
    for against, stiffness in found.items():
        if not stiffness > NO_STIFFNESS * max(map(abs, found.values())):
            given = f"a stiffness of {stiffness:.3g} MPa at rest, against {against}"
            raise InputError(key, given, "positive ones")


def _split_stress(law: SplitLaw, F: Array) -> Array:
    """First Piola-Kirchhoff stress of a law in the split form whose volume change is that of F."""
    if law.volume_measure == "trace":
        S, q = law.split_stress(F, trace(F) - len(F))
        return S + q * np.eye(len(F))[..., None, None]
    S, q = law.split_stress(F, np.log(det(F)))
    return S + q * transpose(inv(F))


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


def _check_force_law(scene: Scene, law: Any, voltage: float) -> None:
    """Whether a user's traction is one up to the largest voltage of the scene (V), and below none."""
    key = "electrostatics.law"
    check_arguments(key, law.traction, ("traction", "gap", "voltage", "layers"))
    skin = np.full(GAPS.shape, scene.electrics.skin.thickness)
    seen, layers = scene.electrics.of_skin(skin).attraction
    at = voltage or 1.0
    what = "traction(gap, voltage, layers)"
    found = evaluated(key, what, lambda gap: seen.traction(gap, at, layers), GAPS)
    if found.shape != GAPS.shape and (voltage > 0.0 or found.shape != ()):  # without any it is not asked
        given = f"a traction of shape {found.shape} at gaps of shape {GAPS.shape}"
        raise InputError(key, given, "a value for every gap")
    _check_traction(key, np.broadcast_to(found, GAPS.shape), StrongTroxel().traction(GAPS, at, layers))
    if voltage == 0.0 or (scene.drive is not None and scene.drive.resolved):  # charges give another voltage
        return
    lowest = _lowest(scene)
    _check_negative(key, lambda gap: seen.traction(gap, lowest, layers), lowest)
    _check_rates(key, scene, lambda name: lambda gap: getattr(seen, name)(gap, voltage, layers))


def _check_traction(key: str, traction: Array, rigid: Any) -> None:
    """Whether a user's traction attracts, does not grow with the gap, and is in MPa, by `rigid` plates."""
    if (traction < 0.0).any():
        raise InputError(key, f"a traction of {traction.min():.3g} MPa", "positive values, which attract")
    if (np.diff(traction) > 0.0).all():
        given = f"a traction that grows from {traction[0]:.3g} MPa in contact to {traction[-1]:.3g} at 1 mm"
        raise InputError(key, given, "an attraction that falls with the gap")
    over = float(np.median(traction / rigid))
    if over > STRONGEST:
        given = f"{over:.1e} times the attraction of parallel plates"
        raise InputError(key, given, "a traction in MPa, not in Pa, of gaps in mm")


def _check_negative(key: str, traction: Callable[[Array], Any], voltage: float) -> None:
    """Whether a user's law attracts at the lowest voltage (V) of a scene, too."""
    if voltage >= 0.0:
        return
    found = evaluated(key, f"a traction at {voltage:g} V", traction, GAPS)
    if (found < 0.0).any():
        given = f"a traction of {found.min():.3g} MPa at {voltage:g} V"
        raise InputError(key, given, "positive values, which attract")


def _lowest(scene: Scene) -> float:
    """Lowest voltage (V) of a scene, as far as some moments and places tell."""
    own: Any = scene.electrics.voltage
    if isinstance(own, FollowForce):
        own = 0.0
    elif isinstance(own, VoltageProfile):
        own = own(np.linspace(*scene.reach, MOMENTS))
    elif isinstance(own, TimeSignal):
        seconds = sum(course.seconds() for course in scene.courses)
        own = [own(time) for time in np.linspace(0.0, seconds, MOMENTS).tolist()]
    return float(min([np.min(own), *scene.electrics.ramps]))


def _check_rates(key: str, scene: Scene, method: Callable[[str], Callable[[Array], Any]]) -> None:
    """Whether what a user gives as derivative by the gap is one; `method` finds the law's by name."""
    gaps = GAPS + 5.0 * GAP_STEP  # none is negative in a difference
    for rate, of in _rates(scene):
        found = evaluated(key, f"{rate}(gap, voltage, layers)", method(rate), gaps)
        check_shape(key, f"{rate}(gap, voltage, layers)", found, gaps, one=True)
        values = evaluated(key, f"{of}(gap, voltage, layers)", method(of), gaps)
        check_shape(key, f"{of}(gap, voltage, layers)", values, gaps, one=rate == "traction_derivative")
        near = difference(method(of), gaps, GAP_STEP)
        error = np.abs(found - near) / (np.abs(near) + NO_RATE * np.abs(values) + np.finfo(float).tiny)
        if float(np.median(error)) > BY_GAP:
            given = f"a {rate} that is not the derivative of {of} by the gap"
            raise InputError(key, given, "two that agree, in mm and MPa")


def _rates(scene: Scene) -> Iterator[tuple[str, str]]:
    """Methods of a user's law that a run takes for derivatives by the gap, and of what."""
    if getattr(scene.law, "traction_derivative", None) is not None:
        yield "traction_derivative", "traction"
    if scene.direction == "normal":  # a potential is asked for nowhere else
        yield "traction", "potential"
