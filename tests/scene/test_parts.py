"""Mistakes in a user's parts, refused before a run with one sentence each."""

import math
import time
from dataclasses import replace

import numpy as np
import pytest
from tools.meshes import block

import evfem as ev
from evfem.errors import InputError
from evfem.scene.parts import check_parts
from evfem.scene.plan import plan, scene_mesh
from evfem.scene.sense import doubts

SKIN = ev.Electrical(stratum_corneum_thickness=0.38)
PRESS, SLIDE = ev.Press(indentation=0.2, steps=2), ev.Slide(distance=1.0, steps=5)


def scene(material=None, *motion, **more):
    """A block of one material on a display."""
    law = material or ev.NeoHookean(E=0.1, nu=0.4)
    finger = ev.MeshedFinger(block(sag=0.3), {"tissue": law}, SKIN)
    return ev.Scene(finger, ev.Display(), motion=motion or PRESS, **more)


# -- materials -------------------------------------------------------------------------------------------


class Mine:
    """A neo-Hookean law with a mistake in each method of a class below."""

    mu, lmbda = 0.04, 0.1

    def psi(self, F):
        J = ev.det(F)
        return 0.5 * self.mu * (ev.ddot(F, F) - 3.0 - 2.0 * np.log(J)) + 0.5 * self.lmbda * np.log(J) ** 2


class ByStress:
    def P(self, F):
        G = ev.transpose(ev.inv(F))
        return 0.04 * (F - G) + 0.1 * np.log(ev.det(F)) * G


class Stressed(Mine):
    def psi(self, F):
        return 0.5 * self.mu * (ev.ddot(F, F) - 3.0) + 0.5 * self.lmbda * np.log(ev.det(F)) ** 2


class StressedByStress:
    def P(self, F):
        return 0.04 * F + 0.1 * np.log(ev.det(F)) * ev.transpose(ev.inv(F))


class Absolute(Mine):
    def psi(self, F):
        return super().psi(F) + 0.1 * np.abs(np.log(ev.det(F))) ** 2


class AbsoluteStress(ByStress):
    def P(self, F):
        return super().P(F) * np.abs(ev.det(F))


class Real(Mine):
    def psi(self, F):
        return super().psi(np.array(F, dtype=float))


class RefusesComplex(Mine):
    def psi(self, F):
        if np.iscomplexobj(F):
            raise TypeError("real numbers alone")
        return super().psi(F)


class OnePoint(Mine):
    def psi(self, F):
        return math.log(np.linalg.det(F))


class Float(Mine):
    def psi(self, F):
        return float(np.sum(super().psi(F)))


class FloatStress:
    def P(self, F):
        return 0.04


class FloatBesideStress(ByStress):
    def psi(self, F):
        return 1.0


class Infinite:
    def P(self, F):
        return F / 0.0 * np.log(ev.det(F))


class Nothing(Mine):
    def psi(self, F):
        super().psi(F)


class Two(ByStress):
    def P(self, F):
        return super().P(F), 0.04


class Free:
    def psi(self, F):
        return 0.0 * ev.det(F)


class Negative(Mine):
    def psi(self, F):
        return -super().psi(F)


class Shrinking(Mine):
    """lambda + mu, the stiffness in the plane, is negative."""

    lmbda = -0.08


class Fluid:
    def psi(self, F):
        return 0.05 * np.log(ev.det(F)) ** 2


class SplitFluid(ev.NeoHookean):
    """A law in the split form whose stress is a pressure."""

    def split_stress(self, F, theta):
        return 0.0 * F, 0.1 * theta


class SplitShrinking(ev.NeoHookean):
    """Its lambda, 0.143 MPa, less 0.2: with its mu of 0.036 MPa that is negative."""

    def split_stress(self, F, theta):
        S, q = super().split_stress(F, theta)
        return S, q - 0.2 * theta


@ev.form
def prestressed(u, v, w):
    return 0.04 * ev.ddot(ev.grad(u), ev.grad(v)) + (u.theta + 0.01) * v.theta


MATERIALS = {
    Stressed: "a stress of 0.04 MPa at rest; allowed: no stress at F = 1",
    StressedByStress: "a stress of 0.04 MPa at rest; allowed: no stress at F = 1",
    Absolute: "psi(F) whose derivative is lost in a complex step; allowed: functions of numpy",
    AbsoluteStress: "P(F) whose derivative is lost in a complex step",
    Real: "psi(F) whose derivative is lost in a complex step",
    RefusesComplex: "psi(F) that raises TypeError on complex numbers: real numbers alone",
    OnePoint: "psi(F) that raises LinAlgError",
    Float: "psi(F) of shape () for F of shape (3, 3, 2, 1); allowed: an array of shape (2, 1)",
    FloatStress: "P(F) of shape () for F of shape (3, 3, 2, 1)",
    FloatBesideStress: "psi(F) of shape ()",
    Nothing: "psi(F) that returns None; allowed: a function that takes arrays",
    Two: "P(F) that returns a tuple and no array of numbers; allowed: a function that takes arrays",
    Free: "a stiffness of 0 MPa at rest, against shear; allowed: positive ones",
    Negative: "a stiffness of -0.04 MPa at rest, against shear; allowed: positive ones",
    Shrinking: "a stiffness of -0.04 MPa at rest, against widening; allowed: positive ones",
    Fluid: "a stiffness of 0 MPa at rest, against shear; allowed: positive ones",
    SplitShrinking: "a stiffness of -0.0214 MPa at rest, against widening; allowed: positive ones",
    SplitFluid: "a stiffness of 0 MPa at rest, against shear; allowed: positive ones",
    Infinite: "P(F) that is infinite or no number",
}


@pytest.mark.parametrize("kind", MATERIALS)
def test_a_material_that_no_run_could_use_is_refused_with_one_sentence(kind):
    for find in (plan, ev.simulate):
        with pytest.raises(InputError) as caught:
            find(scene(kind(E=0.1, nu=0.4) if issubclass(kind, ev.NeoHookean) else kind()))
        assert str(caught.value).startswith("finger.materials.tissue: given ")
        assert MATERIALS[kind] in str(caught.value)


def test_a_form_with_stress_at_rest_is_refused():
    with pytest.raises(InputError, match=r"a stress of 0\.01 MPa at rest"):
        plan(scene(prestressed))


@pytest.mark.parametrize("kind", [Mine, ByStress, ev.NeoHookean])
def test_a_class_where_an_object_is_meant_is_refused(kind):
    words = rf"finger\.materials\.tissue: given the class {kind.__name__}; allowed: an object of it"
    with pytest.raises(InputError, match=words):
        plan(scene(kind))


class OwnNeoHookean(ev.NeoHookean):
    """A law in the split form, of one's own."""


class OwnLinear(ev.LinearElastic):
    """A law in the split form of small strain, of one's own."""


class Static:
    """A class that needs no object."""

    @staticmethod
    def psi(F):
        return Mine().psi(F)


STIFF = [
    Mine(),
    ByStress(),
    Static,
    *(law(E=0.1, nu=nu) for law in (OwnNeoHookean, OwnLinear) for nu in (0.0, 0.4, 0.4999)),
]


@pytest.mark.parametrize("law", STIFF)
def test_a_material_without_mistakes_is_taken(law):
    assert plan(scene(law)).warnings == ()


def test_a_term_may_be_what_makes_a_region_stiff():
    @ev.form
    def stiff(u, v, w):
        return 0.04 * ev.ddot(ev.grad(u), ev.grad(v))

    assert plan(scene(Free()).with_term(stiff, on=ev.Region("tissue"))).warnings == ()


def test_a_material_of_two_slopes_is_taken():
    """Fibres that only pull: their stress has a kink at rest, where no derivative is compared."""

    class Fibres(Mine):
        def psi(self, F):
            stretch = ev.tensor.positive_part(ev.ddot(F[:, :1], F[:, :1]) - 1.0)
            return super().psi(F) + 0.01 * stretch**2

    assert plan(scene(Fibres())).warnings == ()


# -- force laws ------------------------------------------------------------------------------------------


class InPascal:
    def traction(self, gap, voltage, layers):
        return 1e6 * ev.Kaczmarek().traction(gap, voltage, layers)


class WithoutLayers:
    def traction(self, gap, voltage):
        return 1e-9 * voltage**2 + 0.0 * gap


class BareGap:
    def traction(self, gap, voltage, layers):
        return 0.5 * ev.eps_0 * (voltage / gap) ** 2


class Growing:
    def traction(self, gap, voltage, layers):
        return 1e-12 * voltage**2 * (gap + layers.reduced)


class Pushing:
    def traction(self, gap, voltage, layers):
        return -ev.Kaczmarek().traction(gap, voltage, layers)


class TwoValues:
    def traction(self, gap, voltage, layers):
        return np.zeros(2)


class NoTable:
    def traction(self, gap, voltage, layers):
        return {}[voltage]


class OneValue:
    def traction(self, gap, voltage, layers):
        return 1e-9 * voltage**2


class OwnKaczmarek:
    """A built-in law as one's own, with all that a law may have."""

    law = ev.Kaczmarek()

    def traction(self, gap, voltage, layers):
        return self.law.traction(gap, voltage, layers)

    def traction_derivative(self, gap, voltage, layers):
        return self.law.traction_derivative(gap, voltage, layers)

    def potential(self, gap, voltage, layers):
        return self.law.potential(gap, voltage, layers)


class Steep(OwnKaczmarek):
    def traction_derivative(self, gap, voltage, layers):
        return 1.01 * super().traction_derivative(gap, voltage, layers)


class SteepPotential(OwnKaczmarek):
    def potential(self, gap, voltage, layers):
        return -super().potential(gap, voltage, layers)


class Signed:
    def traction(self, gap, voltage, layers):
        return 4e-6 * voltage / (1.0 + gap)


MORE = {
    SteepPotential: {"direction": "normal"},
    Signed: {"voltage": ev.VoltageProfile([0.0, 1.0], [300.0, -200.0])},
}

LAWS = {
    InPascal: "times the attraction of parallel plates; allowed: a traction in MPa, not in Pa",
    WithoutLayers: "given traction(gap, voltage); allowed: traction(gap, voltage, layers)",
    NoTable: "traction(gap, voltage, layers) that raises KeyError",
    OneValue: "a traction of shape () at gaps of shape (3,); allowed: a value for every gap",
    Steep: "a traction_derivative that is not the derivative of traction by the gap",
    SteepPotential: "a traction that is not the derivative of potential by the gap",
    Signed: "a traction of -0.0008 MPa at -200 V; allowed: positive values, which attract",
    BareGap: "traction(gap, voltage, layers) that is infinite or no number",
    Growing: "a traction that grows from",
    Pushing: "allowed: positive values, which attract",
    TwoValues: "a traction of shape (2,) at gaps of shape (3,)",
}


@pytest.mark.parametrize("kind", LAWS)
def test_a_force_law_that_no_run_could_use_is_refused_with_one_sentence(kind):
    for find in (plan, ev.simulate):
        with pytest.raises(InputError) as caught:
            find(scene(None, PRESS, SLIDE, law=kind(), **({"voltage": 300.0} | MORE.get(kind, {}))))
        assert str(caught.value).startswith("electrostatics.law: given ")
        assert LAWS[kind] in str(caught.value)


class Constant(OneValue):
    def traction(self, gap, voltage, layers):
        one = np.cos(9.0 * gap) ** 2 + np.sin(9.0 * gap) ** 2  # but for rounding
        return one * super().traction(gap, voltage, layers)

    def traction_derivative(self, gap, voltage, layers):
        return 0.0

    def potential(self, gap, voltage, layers):
        return gap * self.traction(gap, voltage, layers)


class Positive(OwnKaczmarek):
    """Nothing asks a law for what it does without a voltage."""

    def traction(self, gap, voltage, layers):
        assert voltage > 0.0
        return super().traction(gap, voltage, layers)


TAKEN = [
    (Positive(), {"voltage": ev.VoltageProfile([0.0, 1.0], [0.0, 300.0])}),
    (OneValue(), {"voltage": 0.0}),  # nothing asks for it
    (Constant(), {"voltage": 300.0}),
    (Constant(), {"voltage": 300.0, "direction": "normal"}),
    (OwnKaczmarek(), {"voltage": -300.0}),
    (OwnKaczmarek(), {"voltage": 300.0, "direction": "normal"}),
    (OwnKaczmarek(), {"voltage": 300.0, "drive": ev.Drive(frequency=100.0, waveform="square")}),
    (SteepPotential(), {"voltage": 300.0}),  # nothing asks for the potential
    (Signed(), {"voltage": 300.0}),
]


@pytest.mark.parametrize(("law", "more"), TAKEN)
def test_a_force_law_without_mistakes_is_taken(law, more):
    assert plan(scene(law=law, **more)).warnings == ()


NEGATIVE = {
    "number": ((), {"voltage": -200.0}),
    "ramp": ((ev.VoltageRamp(-200.0),), {"voltage": 300.0}),
    "signal": ((ev.Wait(0.1),), {"voltage": ev.Sine(10.0, 200.0)}),
}


@pytest.mark.parametrize("name", NEGATIVE)
def test_a_law_is_tried_at_negative_voltages_where_a_scene_has_them(name):
    motion, more = NEGATIVE[name]
    with pytest.raises(
        InputError, match=r"MPa( at -\d+(\.\d+)? V)?; allowed: positive values, which attract"
    ):
        plan(scene(None, PRESS, *motion, law=Signed(), **more))


def test_a_million_volts_are_refused():
    for more in ({"voltage": 1e6}, {"voltage": ev.VoltageProfile([0.0, 1.0], [0.0, -1e6])}):
        with pytest.raises(
            InputError, match=r"electrostatics\.voltage: given 1000000\.0; allowed: a voltage"
        ):
            plan(scene(law=ev.Kaczmarek(), **more))
    with pytest.raises(InputError, match="allowed: a voltage"):
        plan(scene(None, PRESS, ev.VoltageRamp(1e6), law=ev.Kaczmarek()))


# -- surfaces --------------------------------------------------------------------------------------------


class Waves:
    friction = 0.3

    def height(self, x):
        return 0.02 * np.sin(6.0 * x)


class Insulated(Waves):
    insulator = ev.Layer(0.09, 3.35)


class ByMath(Waves):
    def height(self, x):
        return 0.02 * math.sin(6.0 * x)


class WithoutX(Waves):
    def height(self):
        return 0.0


class Level(Waves):
    def height(self, x):
        return 0.0


class Column(Waves):
    def height(self, x):
        return super().height(x)[:, None]


class Nowhere(Waves):
    def height(self, x):
        return None


class Ends(Waves):
    def height(self, x):
        return np.where(np.real(x) < 2.0, super().height(x), np.nan)


class HalfSlope(Waves):
    def slope(self, x):
        return 0.06 * np.cos(6.0 * x)


class NoCurvature(Waves):
    def curvature(self, x):
        return None


class OneSlope(Waves):
    def slope(self, x):
        return 0.12


class LostSlope(Waves):
    def height(self, x):
        return super().height(np.abs(x)) + 0.0 * x


class Slippery(Waves):
    def friction_coefficient(self, x):
        return 0.3 - 0.3 * np.real(x) ** 2


class RowsOfFriction(Waves):
    def friction_coefficient(self, x):
        return np.full(3, 0.3)


SURFACES = {
    ByMath: "height(x) that raises TypeError: only",
    WithoutX: "given height(); allowed: height(x)",
    Level: "height(x) of shape () for arrays of shape (12,); allowed: an array of shape (12,)",
    Column: "height(x) of shape (12, 1) for arrays of shape (12,)",
    Nowhere: "height(x) that returns None; allowed: a function that takes arrays",
    Ends: "height(x) that is infinite or no number",
    HalfSlope: "slope(x) that is not the derivative of height(x); allowed: its derivative, or no slope",
    NoCurvature: "curvature(x) that returns None",
    OneSlope: "slope(x) of shape () for arrays of shape (12,)",
    LostSlope: "height(x) whose derivative is lost in a complex step; allowed: functions of numpy",
    Slippery: "a friction_coefficient(x) of -",
    RowsOfFriction: "friction_coefficient(x) of shape (3,) for arrays of shape (12,)",
}


def on(surface, **more):
    return replace(scene(None, PRESS, SLIDE), surface=surface, **more)


@pytest.mark.parametrize("kind", SURFACES)
def test_a_surface_that_no_run_could_use_is_refused_with_one_sentence(kind):
    for find in (plan, ev.simulate):
        with pytest.raises(InputError) as caught:
            find(on(kind()))
        assert str(caught.value).startswith("surface: given ")
        assert SURFACES[kind] in str(caught.value)


class Kinks(Waves):
    """Ramps of a table, with their slope: neither has a derivative at the kinks."""

    x = np.linspace(-4.0, 6.0, 101)

    def height(self, x):
        return np.interp(np.real(x), self.x, Waves.height(self, self.x))

    def slope(self, x):
        return np.interp(np.real(x), self.x, np.gradient(Waves.height(self, self.x), self.x))


class OneCoefficient(Waves):
    def friction_coefficient(self, x):
        return 0.3


class Listed(Waves):
    def height(self, x):
        return list(super().height(x))


class Single(Waves):
    """Level but for the rounding of single precision, high up."""

    def height(self, x):
        return (1.0 + 1e-7 * np.sin(40.0 * np.real(x))).astype(np.float32)

    def slope(self, x):
        return np.zeros(np.shape(x))


class OwnGrating(ev.Grating):
    """A built-in surface of one's own, level nearly everywhere."""


GRATING = OwnGrating(period=1.0, groove_depth=0.05, groove_width=0.4)


@pytest.mark.parametrize("surface", [Waves(), Kinks(), OneCoefficient(), Listed(), Single(), GRATING])
def test_a_surface_without_mistakes_is_taken(surface):
    check_parts(on(surface))


def test_a_surface_is_tried_along_the_way_alone():
    """It may end where the pad does not come to."""

    class Short(Waves):
        def height(self, x):
            assert np.real(x).min() >= -2.0
            assert np.real(x).max() <= 3.0
            return super().height(x)

    check_parts(on(Short()))
    with pytest.raises(InputError, match="AssertionError"):
        check_parts(replace(on(Short()), motion=[PRESS, SLIDE, SLIDE]))


# -- friction and roughness ------------------------------------------------------------------------------


class OtherNames:
    def bound(self, p, mu, v, t):
        return mu * p


class OtherOrder:
    def bound(self, mu, pressure, speed, age):
        return mu * pressure


class BoundInPascal:
    def bound(self, pressure, mu, speed, age):
        return 1e6 * mu * pressure


class NegativeWhenFast:
    def bound(self, pressure, mu, speed, age):
        return mu * pressure * (1.0 - speed / 10.0)


class NoBound:
    def bound(self, pressure, mu, speed, age):
        mu * pressure


class OneRow:
    def bound(self, pressure, mu, speed, age):
        return np.zeros(2)


BOUNDS = {
    OtherNames: "given bound(p, mu, v, t); allowed: bound(pressure, mu, speed, age)",
    OtherOrder: "given bound(mu, pressure, speed, age); allowed: bound(pressure, mu, speed, age)",
    BoundInPascal: "a bound of 3e+03 at a pressure of 0.01 MPa; allowed: a bound in MPa",
    NegativeWhenFast: "a bound of -0.003 MPa; allowed: values that are not negative",
    NoBound: "bound(pressure, mu, speed, age) that returns None",
    OneRow: "a bound of shape (2,) for arrays of shape (6,)",
}
FAST = [PRESS, ev.Slide(distance=1.0, steps=5, speed=20.0)]


@pytest.mark.parametrize("kind", BOUNDS)
def test_a_law_of_friction_that_no_run_could_use_is_refused_with_one_sentence(kind):
    for find in (plan, ev.simulate):
        with pytest.raises(InputError) as caught:
            find(scene(None, *FAST, friction_law=kind()))
        assert str(caught.value).startswith("surface.friction_law: given ")
        assert BOUNDS[kind] in str(caught.value)


class Fixed:
    def bound(self, pressure, mu, speed, age):
        return 1e-3


class Decorated(Fixed):
    def bound(self, pressure, *args, **kwargs):
        return super().bound(pressure, *args, **kwargs) + 0.0 * pressure


def test_a_law_of_friction_behind_a_decorator_is_taken():
    check_parts(scene(None, *FAST, friction_law=Decorated()))


def test_one_bound_for_all_nodes_is_taken():
    result = ev.simulate(scene(None, *FAST, friction_law=Fixed()))
    width = result.contact_width[-1]
    assert result.tangential_force[-1] == pytest.approx(1e-3 * width, rel=0.1)


class Apart:
    def separation(self, pressure):
        return 0.002 / (1.0 + pressure / 0.01)


class Diverging:
    def separation(self, pressure):
        return 0.001 * (pressure / 0.01) ** -0.3


class InMicrometres(Apart):
    def separation(self, pressure):
        return 1e3 * super().separation(pressure)


class Through(Apart):
    def separation(self, pressure):
        return 0.002 - pressure


class Forgotten(Apart):
    def separation(self, pressure):
        super().separation(pressure)


class Raising(Apart):
    def separation(self, pressure):
        return 0.002 if pressure > 0.0 else 0.004


class TwoLengths(Apart):
    def separation(self, pressure):
        return np.zeros(2)


class WithoutPressure(Apart):
    def separation(self):
        return 0.002


ROUGH = {
    Diverging: "separation(pressure) that is infinite or no number",
    InMicrometres: "a separation of 2 mm; allowed: lengths in mm from 0 to 1",
    Through: "a separation of -0.008 mm; allowed: lengths in mm from 0 to 1",
    Forgotten: "separation(pressure) that returns None",
    Raising: "separation(pressure) that raises ValueError",
    TwoLengths: "separation(pressure) of shape (2,) for arrays of shape (3,)",
    WithoutPressure: "given separation(); allowed: separation(pressure)",
}


@pytest.mark.parametrize("kind", ROUGH)
def test_a_roughness_that_no_run_could_use_is_refused_with_one_sentence(kind):
    for find in (plan, ev.simulate):
        with pytest.raises(InputError) as caught:
            find(scene(law=ev.Kaczmarek(), voltage=300.0, roughness_gap=kind()))
        assert str(caught.value).startswith("electrostatics.roughness_gap: given ")
        assert ROUGH[kind] in str(caught.value)


def test_a_roughness_without_mistakes_is_taken():
    class Same:
        def separation(self, pressure):
            return 0.001

    for rough in (Apart(), Same()):
        assert plan(scene(law=ev.Kaczmarek(), voltage=300.0, roughness_gap=rough)).warnings == ()
    with pytest.raises(InputError, match=r"given 4\.0; allowed: a length in mm from 0 to 1, a table"):
        scene(law=ev.Kaczmarek(), voltage=300.0, roughness_gap=4.0)
    with pytest.raises(InputError, match="given the class Apart; allowed: an object of it"):
        scene(law=ev.Kaczmarek(), voltage=300.0, roughness_gap=Apart)


def test_looking_takes_next_to_no_time():
    own = {"law": OwnKaczmarek(), "friction_law": Fixed(), "roughness_gap": Apart()}
    surface = Insulated()
    asked = replace(scene(Mine(), PRESS, SLIDE, voltage=300.0, **own), surface=surface)
    mesh, _ = scene_mesh(asked)
    moduli = {"tissue": 0.04}
    best = math.inf
    for _ in range(5):
        begin = time.perf_counter()
        check_parts(asked)
        doubts(asked, mesh, moduli)
        best = min(best, time.perf_counter() - begin)
    assert best < 5e-3
