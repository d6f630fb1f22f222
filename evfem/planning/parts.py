"""Checks of user-defined components of a scene before it is solved.

`check_components` evaluates user-defined laws once, near rest and at three gaps, a surface at a dozen
positions of the path and laws of contact at three pressures, and raises InputError for unusable ones.
Components of the package are not evaluated. `evaluated` and its like describe in a sentence what is wrong
with a function.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from functools import partial
from inspect import getattr_static, isfunction, signature
from typing import Any

import numpy as np

from evfem.circuit.signals import FollowForce, VoltageProfile
from evfem.common.arrays import Floats
from evfem.electrostatics.laws import StrongTroxel
from evfem.electrostatics.roughness import WIDEST
from evfem.errors import InputError
from evfem.protocols import RoughnessLaw, TimeSignal
from evfem.scene.scene import Scene
from evfem.tensor import STEP, Array, complex_step, det, difference, inv, trace, transpose
from evfem.tissue.forms import Form
from evfem.tissue.splitlaw import SplitLaw, split

#: requirement on a user's function
FUNCTION = "a function that takes arrays with a value for every point"
#: contact pressures (MPa) at which laws are evaluated, and the largest shear limit over the last one (no
#: surface has a larger coefficient)
PRESSURES, GREATEST = np.array([0.0, 1e-4, 0.01]), 100.0
#: friction coefficient at which laws are evaluated, and a negative one that counts as rounding
COEFFICIENT, ROUNDING = 0.3, 1e-9
#: positions on a surface as fractions of the path, where kinks of a profile are unlikely
PLACES = np.linspace(0.0371, 0.9643, 12)
#: steps (mm) of differences of a height, the largest slope that counts as none, and the median relative
#: error of a slope, at most: heights have kinks and noise
STEPS, LEVEL, SLOPE = (1e-4, 1e-2), 1e-4, 0.3
#: strain at which a user's material is evaluated beside rest, the step of differences, and the strains at
#: which its derivative is tried
STRAIN, STRAIN_STEP, STRAINS = 0.02, 1e-3, (0.02, 0.1, 0.3, 1.0, -0.1, -0.3)
#: some displacement gradient in the plane: stretch, shear and rotation
DIRECTION = np.array([[1.0, 0.4, 0.0], [-0.2, 0.6, 0.0], [0.0, 0.0, 0.0]])
#: and one that shortens where it stretches
ACROSS = np.array([[-0.5, 0.2, 0.0], [0.3, 0.9, 0.0], [0.0, 0.0, 0.0]])
#: stress at rest over stiffness, and relative error of a derivative by complex step, at most
REST, DERIVATIVE = 1e-6, 1e-4
#: stiffness at rest over the largest one that counts as none: rounding
NO_STIFFNESS = 1e-11
#: shear and widening in the plane, (3, 3, 2, 2): which of them, and with either sign
WAYS = np.zeros((3, 3, 2, 2))
WAYS[0, 1, 0] = WAYS[0, 0, 1] = WAYS[1, 1, 1] = 1.0, -1.0
#: what a function must be for its derivative by complex steps
COMPLEX_SAFE = "functions of numpy and evfem.tensor that take complex numbers: no abs, sign, float or maximum"
#: gaps (mm) at which a user's force law is evaluated, and attraction over that of rigid plates, at most
GAPS, STRONGEST = np.array([0.0, 0.1, 1.0]), 1e4
#: step (mm) of differences by the gap, far below the thinnest insulator, and median relative error of a
#: derivative at the gaps, at most: tables have kinks
GAP_STEP, BY_GAP = 1e-5, 1e-3
#: change per mm over the value that counts as none
NO_RATE = 1e-6
#: number of times, or of positions, at which the sign of a voltage is checked
MOMENTS = 100
#: a voltage (V) that is a mistake whatever the field
HIGHEST_VOLTAGE = 5e5


def check_components(scene: Scene, dim: int) -> None:
    """Raise InputError for a user-defined component that no run in `dim` dimensions can use, or an absurd
    voltage.
    """
    with_terms = {term.on.name for term in scene.forms}
    for name, law in scene.finger.materials.items():
        key = f"finger.materials.{name}"
        if isinstance(law, Form) or _is_own(law):
            _check_material(key, law, dim)
        # a form may depend on the position, and another term may make a region stiff
        if _is_own(law) and name not in with_terms:
            _check_stiffness(key, law, dim)
    if _is_own(scene.surface):
        check_surface(scene)
    friction = scene.friction_law
    if _is_own(friction) or _is_own(getattr(friction, "friction", friction)):  # what a memory follows
        check_friction_law(scene)
    if isinstance(scene.roughness_gap, RoughnessLaw) and _is_own(scene.roughness_gap):
        check_roughness(scene.roughness_gap)
    voltage = scene.electrics.largest_voltage
    if voltage > HIGHEST_VOLTAGE:
        raise InputError("electrostatics.voltage", voltage, f"a voltage in V up to {HIGHEST_VOLTAGE:g}")
    if scene.law is not None and _is_own(scene.law):
        _check_force_law(scene, scene.law, voltage)


def _is_own(component: Any) -> bool:
    return not type(component).__module__.startswith("evfem.")


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
            problem = f"{name}(F) of shape {shape} for F of shape {F.shape}"
            raise InputError(key, problem, f"an array of shape {expected}, with a value for every point")
    name, method = next(iter(methods.items()), ("", law))  # P where there are both
    if not name:
        split(law, dim, key)  # says what a material is
    tried = [np.eye(3) + strain * way for strain in STRAINS for way in (DIRECTION, ACROSS)]
    _check_complex(key, f"{name}(F)", method, np.stack(tried, axis=-1)[..., None])
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
            problem = f"a stiffness of {stiffness:.3g} MPa at rest, against {against}"
            raise InputError(key, problem, "positive ones")


def _split_stress(law: SplitLaw, F: Array) -> Array:
    """First Piola-Kirchhoff stress of a law in the split form whose volume change is that of F."""
    if law.volume_measure == "trace":
        S, q = law.split_stress(F, trace(F) - len(F))
        return S + q * np.eye(len(F))[..., None, None]
    S, q = law.split_stress(F, np.log(det(F)))
    return S + q * transpose(inv(F))


def _check_complex(key: str, what: str, function: Callable[[Array], Any], F: Array) -> None:
    """Whether complex steps along two directions give the derivatives that differences give, at F
    (3, 3, n, 1).
    """
    try:
        lost = lost_derivatives(function, F)
    except Exception as error:  # whatever a user's code raises
        problem = f"{what} that raises {type(error).__name__} on complex numbers: {error}"
        raise InputError(key, problem, COMPLEX_SAFE) from error
    if lost.any():
        strain = np.abs(F - np.eye(3)[..., None, None]).max(axis=(0, 1))[lost].min()
        where = "" if strain <= STRAIN else f" at a strain of {strain:.0%}"
        raise InputError(key, f"{what} whose derivative is lost in a complex step{where}", COMPLEX_SAFE)


def lost_derivatives(function: Callable[[Array], Any], F: Array) -> Array:
    """Places (n, 1) of F (3, 3, n, 1) where a complex step along `DIRECTION` or `ACROSS` does not give the
    derivative that differences give; those where these are not finite do not count.
    """
    lost = np.zeros(F.shape[2:], dtype=bool)
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        for way in (DIRECTION, ACROSS):
            along = way[..., None, None]
            exact = np.imag(np.asarray(function(F + 1j * STEP * along))) / STEP
            near = difference(lambda t, a=along: np.asarray(function(F + t * a)), np.zeros(()), STRAIN_STEP)
            off, size = (np.abs(one).reshape(-1, *lost.shape).max(axis=0) for one in (exact - near, near))
            lost |= np.isfinite(size) & ~(off <= DERIVATIVE * size)
    return lost


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
        problem = f"a traction of shape {found.shape} at gaps of shape {GAPS.shape}"
        raise InputError(key, problem, "a value for every gap")
    _check_traction(key, np.broadcast_to(found, GAPS.shape), StrongTroxel().traction(GAPS, at, layers))
    if voltage == 0.0 or scene.electrics.resolved:  # charges give another voltage
        return
    if (lowest := _lowest(scene)) < 0.0:
        what = f"a traction at {lowest:g} V"
        found = evaluated(key, what, lambda gap: seen.traction(gap, lowest, layers), GAPS)
        if (found < 0.0).any():
            problem = f"a traction of {found.min():.3g} MPa at {lowest:g} V"
            raise InputError(key, problem, "positive values, which attract")
    _check_rates(key, scene, lambda name: lambda gap: getattr(seen, name)(gap, voltage, layers))


def _check_traction(key: str, traction: Array, rigid: Any) -> None:
    """Whether a user's traction attracts, does not grow with the gap, and is in MPa, by `rigid` plates."""
    if (traction < 0.0).any():
        raise InputError(key, f"a traction of {traction.min():.3g} MPa", "positive values, which attract")
    if (np.diff(traction) > 0.0).all():
        problem = f"a traction that grows from {traction[0]:.3g} MPa in contact to {traction[-1]:.3g} at 1 mm"
        raise InputError(key, problem, "an attraction that falls with the gap")
    over = float(np.median(traction / rigid))
    if over > STRONGEST:
        problem = f"{over:.1e} times the attraction of parallel plates"
        raise InputError(key, problem, "a traction in MPa, not in Pa, of gaps in mm")


def _lowest(scene: Scene) -> float:
    """Lowest voltage (V) of a scene at sampled times or positions."""
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
    has = getattr(scene.law, "traction_derivative", None) is not None
    taken = [("traction_derivative", "traction")] if has else []
    if scene.direction == "normal":  # a potential is asked for nowhere else
        taken.append(("traction", "potential"))
    for rate, of in taken:
        found = shaped(key, f"{rate}(gap, voltage, layers)", method(rate), gaps, one=True)
        one = rate == "traction_derivative"
        values = shaped(key, f"{of}(gap, voltage, layers)", method(of), gaps, one=one)
        near = difference(method(of), gaps, GAP_STEP)
        error = np.abs(found - near) / (np.abs(near) + NO_RATE * np.abs(values) + np.finfo(float).tiny)
        if float(np.median(error)) > BY_GAP:
            problem = f"a {rate} that is not the derivative of {of} by the gap"
            raise InputError(key, problem, "two that agree, in mm and MPa")


def evaluated(key: str, what: str, function: Callable[[Array], Any], at: Array) -> Array:
    """The values of a user's function; InputError where it raises anything, or they are not finite
    numbers.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            problem = function(at)
        except Exception as error:  # whatever a user's code raises
            raise InputError(key, f"{what} that raises {type(error).__name__}: {error}", FUNCTION) from error
        if problem is None:
            raise InputError(key, f"{what} that returns None", FUNCTION)
        try:
            value = np.asarray(problem)
            finite = bool(np.isfinite(value).all())
        except (TypeError, ValueError) as error:  # ragged, or no numbers
            name = type(problem).__name__
            raise InputError(
                key, f"{what} that returns a {name} and no array of numbers", FUNCTION
            ) from error
    if not finite:
        raise InputError(key, f"{what} that is infinite or no number", "finite values at rest and in contact")
    return value


def check_arguments(key: str, method: Any, called: tuple[str, ...], *, by_name: bool = False) -> None:
    """Whether a user's method takes the arguments of `called`, those `by_name` under these names."""
    name, *arguments = called
    try:
        own = signature(method)
    except (TypeError, ValueError):  # nothing to call, or compiled
        return
    try:
        own.bind(*arguments)
        order = own.bind(**dict(zip(arguments, arguments, strict=True))).args if by_name else ()
    except TypeError:
        order = ("others",)
    if order != tuple(arguments)[: len(order)]:  # fewer where a decorator takes any
        raise InputError(key, f"{name}{own}", f"{name}({', '.join(arguments)})")


def shaped(key: str, what: str, function: Callable[[Array], Any], at: Array, *, one: bool = False) -> Array:
    """The same with a value for every point, or `one` for all."""
    found = evaluated(key, what, function, at)
    if found.shape != at.shape and not (one and found.shape == ()):
        problem = f"{what} of shape {found.shape} for arrays of shape {at.shape}"
        raise InputError(key, problem, f"an array of shape {at.shape}, with a value for every point")
    return found


def check_surface(scene: Scene) -> None:
    """Check that a user's surface is finite on the path, and that its slopes are those of its height."""
    key, own, x = "surface", scene.surface, _places(scene)
    for name in ("height", "slope", "curvature", "friction_coefficient"):
        method = getattr(own, name, None)
        if method is None:
            continue
        check_arguments(key, method, (name, "x"))
        found = shaped(key, f"{name}(x)", method, x, one=name == "friction_coefficient")
        if name == "friction_coefficient" and (found < -ROUNDING).any():
            raise InputError(key, f"a friction_coefficient(x) of {found.min():.3g}", "none that is negative")
    _check_slope(key, scene, x)


def _check_slope(key: str, scene: Scene, x: Floats) -> None:
    """Check the slope, user-supplied or derived, against finite differences of the height."""
    problem = getattr(scene.surface, "slope", None) is not None
    slope = evaluated(key, "slope(x)" if problem else "height(x)", scene.ground.slope, x)
    errors = []
    for step in STEPS:
        near = evaluated(key, "height(x)", partial(difference, scene.ground.height, step=step), x)
        size = np.maximum(np.abs(slope), np.abs(near))
        counts = size > max(LEVEL, LEVEL * size.max())
        errors.append(np.median(np.abs(slope - near)[counts] / size[counts]) if counts.any() else 0.0)
    if min(errors) <= SLOPE:
        return
    if problem:
        raise InputError(
            key, "slope(x) that is not the derivative of height(x)", "its derivative, or no slope"
        )
    allowed = "functions of numpy that take complex numbers, or a method slope(x) too"
    raise InputError(key, "height(x) whose derivative is lost in a complex step", allowed)


def _places(scene: Scene) -> Floats:
    """A dozen x (mm) that the pad comes to, all of a mesh that has none."""
    if (width := getattr(scene.finger, "width", None)) is not None:
        ends = np.array([-0.5, 0.5]) * width
    else:
        mesh = scene.finger.mesh(2)
        nodes = mesh.node_sets.get("pad", ())
        ends = mesh.points[nodes if len(nodes) else slice(None), 0]
    first, last = ends.min() + scene.reach[0], ends.max() + scene.reach[1]
    return np.asarray(first + PLACES * (last - first))


def check_friction_law(scene: Scene) -> None:
    """Whether a user's bound is finite, not negative, in MPa, one value a node, at rest and all speeds."""
    key, law, names = "surface.friction_law", scene.friction_law, ("pressure", "mu", "speed", "age")
    check_arguments(key, law.bound, ("bound", *names), by_name=True)
    speeds = np.array(sorted({0.0, *(course.speed or 0.0 for course in scene.courses)}))
    p, speed = np.tile(PRESSURES, speeds.size), np.repeat(speeds, PRESSURES.size)
    nodes = dict(zip(names[1:], (COEFFICIENT + 0.0 * p, speed, 0.0 * p), strict=True))
    what = f"bound({', '.join(names)})"
    bound = shaped(key, what, lambda at: law.bound(pressure=at, **nodes), p, one=True)
    if (bound < 0.0).any():
        raise InputError(key, f"a bound of {bound.min():.3g} MPa", "values that are not negative")
    most = float(np.broadcast_to(bound, p.shape)[p == PRESSURES[-1]].max())
    if most > GREATEST * PRESSURES[-1]:
        problem = f"a bound of {most:.3g} at a pressure of {PRESSURES[-1]:g} MPa"
        raise InputError(key, problem, "a bound in MPa")


def check_roughness(law: Any) -> None:
    """Whether a user's separation is a length in mm for every pressure."""
    key = "electrostatics.roughness_gap"
    check_arguments(key, law.separation, ("separation", "pressure"))
    apart = shaped(key, "separation(pressure)", law.separation, PRESSURES, one=True)
    for length in (float(apart.min()), float(apart.max())):
        if not 0.0 <= length <= WIDEST:
            problem = f"a separation of {length:.3g} mm"
            raise InputError(key, problem, f"lengths in mm from 0 to {WIDEST:g}")
