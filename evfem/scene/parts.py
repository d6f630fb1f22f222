"""Mistakes in a user's parts of a scene, found before it is solved.

`check_parts` evaluates a user's laws once, near rest and at three gaps, and raises InputError for
what no run could use. Built-in parts are not evaluated.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np

from evfem.electrostatics.laws import StrongTroxel
from evfem.errors import InputError
from evfem.scene.driven import largest_voltage, layers_of
from evfem.scene.scene import Scene
from evfem.tensor import STEP, Array, complex_step, difference
from evfem.tissue.forms import Form
from evfem.tissue.splitlaw import SplitLaw, split

#: strain at which a user's material is evaluated beside rest, and the step of differences there
STRAIN, STRAIN_STEP = 0.02, 1e-3
#: some displacement gradient in the plane: stretch, shear and rotation
DIRECTION = np.array([[1.0, 0.4, 0.0], [-0.2, 0.6, 0.0], [0.0, 0.0, 0.0]])
#: stress at rest over stiffness, and relative error of a derivative by complex step, at most
REST, DERIVATIVE = 1e-6, 1e-4
#: gaps (mm) at which a user's force law is evaluated, and attraction over that of rigid plates, at most
GAPS, STRONGEST = np.array([0.0, 0.1, 1.0]), 1e4
#: a voltage (V) that is a mistake whatever the field
HIGHEST_VOLTAGE = 5e5


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
    key, layers = "electrostatics.law", layers_of(scene)
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
