"""Mistakes in a user's parts, refused before a run with one sentence each."""

import math
from dataclasses import replace
from types import SimpleNamespace as Part

import numpy as np
import pytest
from tools.meshes import block
from tools.refusals import refuses

import evfem as ev
from evfem.errors import InputError
from evfem.planning.parts import check_components
from evfem.planning.plan import plan
from evfem.tensor import ddot, det, grad, inv, positive_part, transpose

SKIN = ev.Electrical(stratum_corneum_thickness=0.38)
PRESS, SLIDE = ev.Press(indentation=0.2, steps=2), ev.Slide(distance=1.0, steps=5)
FAST = [PRESS, ev.Slide(distance=1.0, steps=5, speed=20.0)]


def scene(material=None, *motion, **more):
    """A block of one material on a display."""
    law = material or ev.NeoHookean(E=0.1, nu=0.4)
    finger = ev.MeshedFinger(block(sag=0.3), {"tissue": law}, SKIN)
    return ev.Scene(finger, ev.Display(), motion=motion or PRESS, **more)


def on(surface, **more):
    return replace(scene(None, PRESS, SLIDE), surface=surface, **more)


#: scenes with a part of the user's
WITH = {
    "finger.materials.tissue": scene,
    "electrostatics.law": lambda part: scene(None, PRESS, SLIDE, law=part, voltage=300.0),
    "surface": on,
    "surface.friction_law": lambda part: scene(None, *FAST, friction_law=part),
    "electrostatics.roughness_gap": lambda part: scene(law=CHARGED, voltage=300.0, roughness_gap=part),
}
CHARGED, FILM = ev.Kaczmarek(), ev.Layer(0.09, 3.35)


def material(psi):
    return Part(psi=psi)


def by_stress(P):
    return Part(P=P)


def psi(F, mu=0.04, lmbda=0.1):
    """A neo-Hookean energy (MPa)."""
    J = det(F)
    return 0.5 * mu * (ddot(F, F) - 3.0 - 2.0 * np.log(J)) + 0.5 * lmbda * np.log(J) ** 2


def stress(F):
    """The stress of that energy (MPa)."""
    G = transpose(inv(F))
    return 0.04 * (F - G) + 0.1 * np.log(det(F)) * G


class SplitFluid(ev.NeoHookean):
    """A law in the split form whose stress is a pressure."""

    def split_stress(self, F, theta):
        return 0.0 * F, 0.1 * theta


class SplitShrinking(ev.NeoHookean):
    """Its lambda, 0.143 MPa, less 0.2: with its mu of 0.036 MPa that is negative."""

    def split_stress(self, F, theta):
        S, q = super().split_stress(F, theta)
        return S, q - 0.2 * theta


def fibres(stretched):
    """Fibres across the display that resist from a squared stretch of 1.05 on; beyond 2 % of strain alone."""
    return material(lambda F: psi(F) + 0.025 * stretched(F[0, 1] ** 2 + F[1, 1] ** 2 - 1.05) ** 2)


@ev.form
def prestressed(u, v, w):
    return 0.04 * ddot(grad(u), grad(v)) + (u.theta + 0.01) * v.theta


ANY = "allowed: a function that takes arrays"
LOST = "whose derivative is lost in a complex step; allowed: functions of numpy"
WEAK = "MPa at rest, against {}; allowed: positive ones"
MATERIALS = [
    (material(lambda F: psi(F) + 0.04 * np.log(det(F))), "a stress of 0.04 MPa at rest; allowed: no"),
    (by_stress(lambda F: stress(F) + 0.04 * F), "a stress of 0.04 MPa at rest; allowed: no stress at F = 1"),
    (prestressed, "a stress of 0.01 MPa at rest"),
    (material(lambda F: psi(F) + 0.1 * np.abs(np.log(det(F))) ** 2), f"psi(F) {LOST}"),
    (by_stress(lambda F: stress(F) * np.abs(det(F))), f"P(F) {LOST}"),
    (
        fibres(lambda e: 0.5 * (e + np.abs(e))),
        "psi(F) whose derivative is lost in a complex step at a strain of 9%",
    ),
    (fibres(lambda e: 0.5 * (e + e * np.sign(e))), "take complex numbers: no abs, sign, float or maximum"),
    (material(lambda F: psi(np.array(F, dtype=float))), f"psi(F) {LOST}"),
    (material(lambda F: psi(F) + 0.0 * np.floor(F[0, 0])), "psi(F) that raises TypeError on complex numbers"),
    (material(lambda F: math.log(np.linalg.det(F))), "psi(F) that raises LinAlgError"),
    (material(lambda F: float(np.sum(psi(F)))), "psi(F) of shape () for F of shape (3, 3, 2, 1); allowed"),
    (by_stress(lambda F: 0.04), "P(F) of shape () for F of shape (3, 3, 2, 1)"),
    (Part(P=stress, psi=lambda F: 1.0), "psi(F) of shape ()"),
    (material(lambda F: None), f"psi(F) that returns None; {ANY}"),
    (by_stress(lambda F: (stress(F), 0.04)), f"P(F) that returns a tuple and no array of numbers; {ANY}"),
    (by_stress(lambda F: F / 0.0 * np.log(det(F))), "P(F) that is infinite or no number"),
    (material(lambda F: 0.0 * det(F)), f"a stiffness of 0 {WEAK.format('shear')}"),
    (material(lambda F: -psi(F)), f"a stiffness of -0.04 {WEAK.format('shear')}"),
    (material(lambda F: psi(F, lmbda=-0.08)), f"a stiffness of -0.04 {WEAK.format('widening')}"),
    (material(lambda F: 0.05 * np.log(det(F)) ** 2), f"a stiffness of 0 {WEAK.format('shear')}"),
    (SplitShrinking(E=0.1, nu=0.4), f"a stiffness of -0.0214 {WEAK.format('widening')}"),
    (SplitFluid(E=0.1, nu=0.4), f"a stiffness of 0 {WEAK.format('shear')}"),
]


def law(traction, **more):
    return Part(traction=traction, **more)


def own(**changes):
    """A built-in law as one's own, with all that a law may have, some of it changed."""
    names = ("traction", "traction_derivative", "potential")
    return Part(**{name: getattr(CHARGED, name) for name in names} | changes)


def plates(gap, voltage, layers):
    return CHARGED.traction(gap, voltage, layers)


ATTRACTIVE = "allowed: positive values, which attract"
LAWS = [
    (law(lambda gap, voltage, layers: 1e6 * plates(gap, voltage, layers)), "parallel plates; allowed: a"),
    (law(lambda gap, voltage: 1e-9 * voltage**2 + 0.0 * gap), "traction(gap, voltage); allowed"),
    (law(lambda gap, voltage, layers: {}[voltage]), "traction(gap, voltage, layers) that raises KeyError"),
    (law(lambda gap, voltage, layers: 1e-9 * voltage**2), "traction of shape () at gaps of shape (3,)"),
    (law(lambda gap, voltage, layers: np.zeros(2)), "a traction of shape (2,) at gaps of shape (3,)"),
    (law(lambda gap, voltage, layers: (voltage / gap) ** 2), "traction(gap, voltage, layers) that is"),
    (law(lambda gap, voltage, layers: 1e-12 * voltage**2 * (gap + 0.1)), "a traction that grows from"),
    (law(lambda gap, voltage, layers: -plates(gap, voltage, layers)), ATTRACTIVE),
    (
        own(traction_derivative=lambda *at: 1.01 * CHARGED.traction_derivative(*at)),
        "a traction_derivative that is not the derivative of traction by the gap",
    ),
]


def surface(height, **more):
    return Part(height=height, friction=0.3, **more)


def waves(x):
    return 0.02 * np.sin(6.0 * x)


SURFACES = [
    (surface(lambda x: 0.02 * math.sin(6.0 * x)), "height(x) that raises TypeError: only"),
    (surface(lambda: 0.0), "given height(); allowed: height(x)"),
    (
        surface(lambda x: 0.0),
        "height(x) of shape () for arrays of shape (12,); allowed: an array of shape (12,)",
    ),
    (surface(lambda x: waves(x)[:, None]), "height(x) of shape (12, 1) for arrays of shape (12,)"),
    (surface(lambda x: None), f"height(x) that returns None; {ANY}"),
    (surface(lambda x: np.where(np.real(x) < 2.0, waves(x), np.nan)), "height(x) that is infinite or no"),
    (surface(waves, slope=lambda x: 0.06 * np.cos(6.0 * x)), "slope(x) that is not the derivative of"),
    (surface(waves, curvature=lambda x: None), "curvature(x) that returns None"),
    (surface(waves, slope=lambda x: 0.12), "slope(x) of shape () for arrays of shape (12,)"),
    (surface(lambda x: waves(np.abs(x)) + 0.0 * x), f"height(x) {LOST}"),
    (surface(waves, friction_coefficient=lambda x: 0.3 - np.real(x) ** 2), "a friction_coefficient(x) of -"),
    (surface(waves, friction_coefficient=lambda x: np.ones(3)), "friction_coefficient(x) of shape (3,) for"),
]


def friction(bound):
    return Part(bound=bound)


def rough(separation):
    return Part(separation=separation)


def apart(pressure):
    return 0.002 / (1.0 + pressure / 0.01)


NAMES = "bound(pressure, mu, speed, age)"
FRICTION = [
    (friction(lambda p, mu, v, t: mu * p), f"given bound(p, mu, v, t); allowed: {NAMES}"),
    (
        friction(lambda mu, pressure, speed, age: mu * pressure),
        f"bound(mu, pressure, speed, age); allowed: {NAMES}",
    ),
    (
        friction(lambda pressure, mu, speed, age: 1e6 * mu * pressure),
        "a bound of 3e+03 at a pressure of 0.01 MPa",
    ),
    (friction(lambda pressure, mu, speed, age: mu * pressure * (1.0 - speed / 10.0)), "a bound of -0.003"),
    (friction(lambda pressure, mu, speed, age: None), f"{NAMES} that returns None"),
    (
        friction(lambda pressure, mu, speed, age: np.zeros(2)),
        "bound(pressure, mu, speed, age) of shape (2,) for arrays of shape (6,)",
    ),
]
ROUGH = [
    (rough(lambda pressure: 0.001 * (pressure / 0.01) ** -0.3), "separation(pressure) that is infinite or"),
    (
        rough(lambda pressure: 1e3 * apart(pressure)),
        "a separation of 2 mm; allowed: lengths in mm from 0 to 1",
    ),
    (
        rough(lambda pressure: 0.002 - pressure),
        "a separation of -0.008 mm; allowed: lengths in mm from 0 to 1",
    ),
    (rough(lambda pressure: None), "separation(pressure) that returns None"),
    (rough(lambda pressure: 0.002 if pressure > 0.0 else 0.0), "separation(pressure) that raises ValueError"),
    (rough(lambda pressure: np.zeros(2)), "separation(pressure) of shape (2,) for arrays of shape (3,)"),
    (rough(lambda: 0.002), "given separation(); allowed: separation(pressure)"),
]
WRONG = dict(zip(WITH, (MATERIALS, LAWS, SURFACES, FRICTION, ROUGH), strict=True))


@pytest.mark.parametrize(
    ("key", "part", "words"), [(key, *row) for key, rows in WRONG.items() for row in rows]
)
def test_a_part_that_no_run_could_use_is_refused_with_one_sentence(key, part, words):
    for find in (plan, ev.simulate):
        caught = refuses("allowed", find, WITH[key](part))
        assert str(caught).startswith(f"{key}: given ")
        assert words in str(caught)


class Mine:
    def psi(self, F):
        return psi(F)


class Static:
    """A class that needs no object."""

    psi = staticmethod(psi)


class OwnNeoHookean(ev.NeoHookean):
    """A law in the split form, of one's own."""


class OwnLinear(ev.LinearElastic):
    """A law in the split form of small strain, of one's own."""


@pytest.mark.parametrize("kind", [Mine, ev.NeoHookean])
def test_a_class_where_an_object_is_meant_is_refused(kind):
    words = rf"finger\.materials\.tissue: given the class {kind.__name__}; allowed: an object of it"
    refuses(words, plan, scene(kind))


def fibres(F):
    """Fibres that only pull: their stress has a kink at rest, where no derivative is compared."""
    stretch = positive_part(ddot(F[:, :1], F[:, :1]) - 1.0)
    return psi(F) + 0.01 * stretch**2


STIFF = [
    *(Mine(), Static, by_stress(stress), material(fibres)),
    *(law(E=0.1, nu=nu) for law in (OwnNeoHookean, OwnLinear) for nu in (0.0, 0.4, 0.4999)),
]


@pytest.mark.parametrize("law", STIFF)
def test_a_material_without_mistakes_is_taken(law):
    assert plan(scene(law)).warnings == ()


def test_a_term_may_be_what_makes_a_region_stiff():
    @ev.form
    def stiff(u, v, w):
        return 0.04 * ddot(grad(u), grad(v))

    free = material(lambda F: 0.0 * det(F))
    assert plan(scene(free).with_term(stiff, on=ev.Region("tissue"))).warnings == ()


def one_value(gap, voltage, layers):
    return 1e-9 * voltage**2


def constant(gap, voltage, layers):
    return (np.cos(9.0 * gap) ** 2 + np.sin(9.0 * gap) ** 2) * 1e-9 * voltage**2  # but for rounding


def signed(gap, voltage, layers):
    return 4e-6 * voltage / (1.0 + gap)


def positive(gap, voltage, layers):
    """Nothing asks a law for what it does without a voltage."""
    assert voltage > 0.0
    return plates(gap, voltage, layers)


CONSTANT = law(
    constant,
    traction_derivative=lambda gap, voltage, layers: 0.0,
    potential=lambda gap, voltage, layers: gap * constant(gap, voltage, layers),
)
TURNED = own(potential=lambda *at: -CHARGED.potential(*at))
TAKEN = [
    (own(traction=positive), {"voltage": ev.VoltageProfile([0.0, 1.0], [0.0, 300.0])}),
    (law(one_value), {"voltage": 0.0}),  # nothing asks for it
    (CONSTANT, {"voltage": 300.0}),
    (CONSTANT, {"voltage": 300.0, "direction": "normal"}),
    (own(), {"voltage": -300.0}),
    (own(), {"voltage": 300.0, "direction": "normal"}),
    (own(), {"voltage": 300.0, "drive": ev.Drive(frequency=100.0, waveform="square")}),
    (TURNED, {"voltage": 300.0}),  # nothing asks for the potential
    (law(signed), {"voltage": 300.0}),
]


@pytest.mark.parametrize(("law", "more"), TAKEN)
def test_a_force_law_without_mistakes_is_taken(law, more):
    assert plan(scene(law=law, **more)).warnings == ()


def test_along_the_normal_a_potential_is_compared_with_the_traction():
    with pytest.raises(InputError, match="a traction that is not the derivative of potential by the gap"):
        plan(scene(law=TURNED, voltage=300.0, direction="normal"))


NEGATIVE = {
    "number": ((), {"voltage": -200.0}),
    "ramp": ((ev.VoltageRamp(-200.0),), {"voltage": 300.0}),
    "signal": ((ev.Wait(0.1),), {"voltage": ev.Sine(10.0, 200.0)}),
    "profile": ((SLIDE,), {"voltage": ev.VoltageProfile([0.0, 1.0], [300.0, -200.0])}),
}


@pytest.mark.parametrize("name", NEGATIVE)
def test_a_law_is_tried_at_negative_voltages_where_a_scene_has_them(name):
    motion, more = NEGATIVE[name]
    with pytest.raises(InputError, match=rf"MPa( at -\d+(\.\d+)? V)?; {ATTRACTIVE}"):
        plan(scene(None, PRESS, *motion, law=law(signed), **more))


#: ramps of a table, with their slope: neither has a derivative at the kinks
X = np.linspace(-4.0, 6.0, 101)
KINKS = surface(
    lambda x: np.interp(np.real(x), X, waves(X)),
    slope=lambda x: np.interp(np.real(x), X, np.gradient(waves(X), X)),
)
#: level but for the rounding of single precision, high up
SINGLE = surface(
    lambda x: (1.0 + 1e-7 * np.sin(40.0 * np.real(x))).astype(np.float32),
    slope=lambda x: np.zeros(np.shape(x)),
)


class OwnGrating(ev.Grating):
    """A built-in surface of one's own, level nearly everywhere."""


GRATING = OwnGrating(period=1.0, groove_depth=0.05, groove_width=0.4)
LISTED, ONE = surface(lambda x: list(waves(x))), surface(waves, friction_coefficient=lambda x: 0.3)


@pytest.mark.parametrize("surface", [surface(waves), KINKS, ONE, LISTED, SINGLE, GRATING])
def test_a_surface_without_mistakes_is_taken(surface):
    check_components(on(surface), 2)


def test_a_surface_is_tried_along_the_way_alone():
    """It may end where the pad does not come to."""

    def short(x):
        assert np.real(x).min() >= -2.0
        assert np.real(x).max() <= 3.0
        return waves(x)

    check_components(on(surface(short)), 2)
    refuses("AssertionError", check_components, replace(on(surface(short)), motion=[PRESS, SLIDE, SLIDE]), 2)


def test_a_law_of_friction_behind_a_decorator_is_taken():
    check_components(
        scene(None, *FAST, friction_law=friction(lambda pressure, *args, **kwargs: 0.001 + 0.0 * pressure)), 2
    )


def test_a_roughness_without_mistakes_is_taken():
    for separation in (apart, lambda pressure: 0.001):
        rows = {"law": CHARGED, "voltage": 300.0, "roughness_gap": rough(separation)}
        assert plan(scene(**rows)).warnings == ()
    with pytest.raises(InputError, match=r"given 4\.0; allowed: a length in mm from 0 to 1, a table"):
        scene(law=CHARGED, voltage=300.0, roughness_gap=4.0)
    with pytest.raises(InputError, match="given the class Apart; allowed: an object of it"):
        scene(law=CHARGED, voltage=300.0, roughness_gap=type("Apart", (), {"separation": apart}))
