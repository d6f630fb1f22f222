"""Mistakes in a user's parts, refused before a run with one sentence each."""

import math
import time

import numpy as np
import pytest
from tools.meshes import block

import evfem as ev
from evfem.errors import InputError
from evfem.scene.parts import check_parts
from evfem.scene.plan import plan, scene_mesh
from evfem.scene.sense import doubts

SKIN = ev.Electrical(stratum_corneum_thickness=0.38)
PRESS = ev.Press(indentation=0.2, steps=2)


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
    Infinite: "P(F) that is infinite or no number",
}


@pytest.mark.parametrize("kind", MATERIALS)
def test_a_material_that_no_run_could_use_is_refused_with_one_sentence(kind):
    for find in (plan, ev.simulate):
        with pytest.raises(InputError) as caught:
            find(scene(kind()))
        assert str(caught.value).startswith("finger.materials.tissue: given ")
        assert MATERIALS[kind] in str(caught.value)


def test_a_form_with_stress_at_rest_is_refused():
    with pytest.raises(InputError, match=r"a stress of 0\.01 MPa at rest"):
        plan(scene(prestressed))


@pytest.mark.parametrize("kind", [Mine, ByStress])
def test_a_material_without_mistakes_is_taken(kind):
    assert plan(scene(kind())).warnings == ()


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


LAWS = {
    InPascal: "times the attraction of parallel plates; allowed: a traction in MPa, not in Pa",
    WithoutLayers: "traction(gap, voltage, layers) that raises TypeError",
    BareGap: "traction(gap, voltage, layers) that is infinite or no number",
    Growing: "a traction that grows from",
    Pushing: "allowed: positive values, which attract",
    TwoValues: "a traction of shape (2,) at gaps of shape (3,)",
}


@pytest.mark.parametrize("kind", LAWS)
def test_a_force_law_that_no_run_could_use_is_refused_with_one_sentence(kind):
    for find in (plan, ev.simulate):
        with pytest.raises(InputError) as caught:
            find(scene(law=kind(), voltage=300.0))
        assert str(caught.value).startswith("electrostatics.law: given ")
        assert LAWS[kind] in str(caught.value)


def test_a_force_law_that_is_the_same_at_every_gap_is_taken():
    class Constant:
        def traction(self, gap, voltage, layers):
            return 1e-9 * voltage**2

    for voltage in (0.0, 300.0):
        assert plan(scene(law=Constant(), voltage=voltage)).warnings == ()


def test_a_million_volts_are_refused():
    for more in ({"voltage": 1e6}, {"voltage": ev.VoltageProfile([0.0, 1.0], [0.0, -1e6])}):
        with pytest.raises(
            InputError, match=r"electrostatics\.voltage: given 1000000\.0; allowed: a voltage"
        ):
            plan(scene(law=ev.Kaczmarek(), **more))
    with pytest.raises(InputError, match="allowed: a voltage"):
        plan(scene(None, PRESS, ev.VoltageRamp(1e6), law=ev.Kaczmarek()))


def test_looking_takes_next_to_no_time():
    asked = scene(Mine(), law=ev.Kaczmarek(), voltage=300.0)
    mesh, _ = scene_mesh(asked)
    moduli = {"tissue": 0.04}
    best = math.inf
    for _ in range(5):
        begin = time.perf_counter()
        check_parts(asked)
        doubts(asked, mesh, moduli)
        best = min(best, time.perf_counter() - begin)
    assert best < 5e-3
