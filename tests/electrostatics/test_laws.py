"""Force laws: the printed formulas, their limits, the potential behind them, and what they refuse."""

import numpy as np
import pytest
from scipy.constants import epsilon_0 as codata
from tools.commands import printed
from tools.refusals import refuses

import evfem as ev
from evfem.electrostatics.laws import Kaczmarek, Layer, Layers, StrongTroxel, eps_0, traction_derivative
from evfem.electrostatics.roughness import Cored

LAWS = [StrongTroxel(), Kaczmarek(), StrongTroxel(gap_eps_r=2.5), Kaczmarek(gap_eps_r=2.5)]
TABLE_2 = Layers.of(Layer(0.38, 1650.0), Layer(0.09, 3.35))
GAPS = np.array([0.0, 1e-6, 1e-3, 0.25, 0.5, 10.0])


def equation(law, gap, voltage, skin, film):
    """Equations (6) and (7) per area, written as they are printed."""
    ea = law.gap_eps_r
    series = skin.thickness / skin.eps_r + gap / ea + film.thickness / film.eps_r
    if isinstance(law, StrongTroxel):
        return eps_0 * voltage**2 / (2 * ea * series**2)
    return eps_0 * voltage**2 / (2 * series * (skin.thickness + gap + film.thickness))


def test_the_electric_constant_is_codatas():
    """Adjustments of CODATA (2018 in older versions of scipy, 2022) differ by 7e-10."""
    assert eps_0 == pytest.approx(codata, rel=1e-9)


@pytest.mark.parametrize("law", LAWS)
def test_traction_is_the_printed_equation(law):
    skin, film = Layer(0.38, 1650.0), Layer(0.09, 3.35)
    expected = equation(law, GAPS, 1414.0, skin, film)
    np.testing.assert_allclose(law.traction(GAPS, 1414.0, TABLE_2), expected, rtol=1e-14)


def test_potential_is_smooth_where_thickness_meets_reduced_thickness():
    # series and logarithm meet at D - s = 1e-3 (g + s); ln(1 + r) / r in 40 decimal digits
    reference = {
        1e-12: 0.9999999999995,
        1e-3: 0.9995003330835332,
        1e-2: 0.9950330853168083,
        -0.5: 1.3862943611198906,
    }
    for ratio, expected in reference.items():
        layers = Layers(1.0, 1.0 + ratio)
        value = Kaczmarek().potential(0.0, 1.0, layers) / (-0.5 * eps_0)
        assert value == pytest.approx(expected, rel=1e-14, abs=0)
    same = Layers(0.3, 0.3)
    assert Kaczmarek().potential(0.1, 50.0, same) == pytest.approx(
        StrongTroxel().potential(0.1, 50.0, same), rel=1e-15
    )


def test_law_without_complex_numbers_is_differenced():
    class Blunt:
        def traction(self, gap, voltage, layers):
            return StrongTroxel().traction(np.abs(gap), voltage, layers)

    gap = np.array([0.1, 0.3])
    expected = StrongTroxel().traction_derivative(gap, 500.0, TABLE_2)
    np.testing.assert_allclose(traction_derivative(Blunt(), gap, 500.0, TABLE_2), expected, rtol=1e-7)

    class Constant:
        def traction(self, gap, voltage, layers):
            return 2e-3

    assert traction_derivative(Constant(), 0.1, 500.0, TABLE_2) == 0.0


def test_impossible_input_is_refused_with_a_sentence():
    refuses(r"layer thickness: given -0\.1", Layer, -0.1, 3.0)
    refuses("permittivity of at least 1", Layer, 0.1, 0.0)
    refuses("finite length", Layer, np.array([0.1, np.nan]), 3.0)
    refuses("finite length", Layer, "thin", 3.0)
    for law in LAWS:
        refuses("pressure would be infinite", law.traction, 0.0, 100.0, Layers.of())
        refuses("pressure would be infinite", law.traction, np.array([0.1, -0.1]), 100.0, TABLE_2)
    refuses("gap_eps_r", StrongTroxel, gap_eps_r=0.5)


def test_importing_the_formulas_stays_light():
    heavy = ("skfem", "matplotlib", "scipy", "meshio")
    code = (
        "import sys, evfem.electrostatics.forces, evfem.circuit.encoding, evfem.data; "
        f"print([m for m in {heavy!r} if m in sys.modules])"
    )
    assert printed(code) == "[]"


LOSSES = [0.3, -0.3, 1e-3, 1e-9, 7.0, np.array([0.0, 1e-6, 0.1, 0.0, 2.0, 30.0])]


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("loss", LOSSES)
def test_attraction_with_losses_is_the_derivative_of_its_potential(law, loss):
    step = 1e-30
    for reduced, thickness in ((0.0271, 0.47), (0.3, 0.3), (0.3, 0.3 + 1e-9), (0.3, 0.2), (1e-4, 2.0)):
        layers = Layers(reduced, thickness, loss)
        slope = law.potential(GAPS + 1j * step, 700.0, layers).imag / step
        # near the surface a large loss leaves a potential that hardly depends on the gap
        rounding = 1e-14 * np.abs(law.potential(GAPS, 700.0, layers)) / (GAPS + reduced)
        wrong = np.abs(slope - law.traction(GAPS, 700.0, layers))
        assert (wrong <= 2e-12 * np.abs(slope) + rounding).all()
        steep = law.traction(GAPS + 1j * step, 700.0, layers).imag / step
        own = law.traction_derivative(GAPS, 700.0, layers)
        np.testing.assert_allclose(own, steep, rtol=1e-12, atol=1e-12 * np.abs(steep).max())
        assert (law.potential(GAPS, 700.0, layers) < 0.0).all()


def test_gap_that_conducts_and_is_filled():
    """With the permittivity e of the gap, E = U / (g + (e + sigma / (i w eps_0)) s*)."""
    film, sigma, f, e = Layer(0.001, 3.9), 1e-7, 50.0, 2.5
    leak = sigma / (2j * np.pi * f * eps_0)
    field = 100.0 / abs(0.002 + (e + leak) * 0.001 / 3.9)
    layers = Layers.of(film, frequency=f, gap_conductivity=sigma, gap_eps_r=e)
    pressure = StrongTroxel(gap_eps_r=e).traction(0.002, 100.0, layers)
    assert pressure == pytest.approx(0.5 * e * eps_0 * field**2, rel=1e-13)


SCREEN = Layers.of(ev.Layer(0.38, 1650.0), ev.Layer(0.001, 3.9))


STEEPEST = 0.1 / 0.91 * 10.0 / 0.05004 / 6.0  # of the skin's modulus over the nodes' distance


NEAR = np.array([0.0, 1e-4, 1e-3, 5e-3, 0.02])


class Own:
    """A law without a potential."""

    def traction(self, gap, voltage, layers):
        return ev.StrongTroxel().traction(gap, voltage, layers)


def test_strong_and_troxels_core_has_its_closed_form():
    """S = sqrt(2 W s / m'), h* = S - s, p'(0) = W (2 S - s) / S^2, with m' the steepest slope."""
    s, work = SCREEN.reduced, 0.5 * ev.eps_0 * 100.0**2 / SCREEN.reduced
    S = np.sqrt(2.0 * work / STEEPEST)
    for law in (ev.StrongTroxel(), Own()):
        line = Cored(law, 0.0, STEEPEST).line(100.0, SCREEN)
        assert line.end == pytest.approx(S - s, rel=1e-9)
        assert line.end == pytest.approx(6.563e-3, rel=1e-4)
        assert line.closed == pytest.approx(work * (2.0 * S - s) / S**2, rel=1e-9)
        assert line.slope == pytest.approx(STEEPEST, rel=1e-9)


@pytest.mark.parametrize("law", [ev.StrongTroxel(), ev.Kaczmarek()], ids=["strong_troxel", "kaczmarek"])
@pytest.mark.parametrize("closed", [0.0, 0.002])
def test_the_work_is_the_laws_and_nothing_is_steeper(law, closed):
    voltage = 2000.0
    cored = Cored(law, closed, 0.5)
    end = float(cored.line(voltage, SCREEN).end)
    assert end > closed + 1e-4
    gap = np.linspace(closed, 1.5 * end, 200_001)
    works = [np.trapezoid(one.traction(gap, voltage, SCREEN), gap) for one in (cored, law)]
    assert works[0] == pytest.approx(works[1], rel=2e-4)  # the law's own needs a fine rule
    for one in (cored.traction, cored.potential):
        np.testing.assert_allclose(
            one(1.5 * end, voltage, SCREEN), getattr(law, one.__name__)(1.5 * end, voltage, SCREEN)
        )
    ends = [float(one.potential(closed, voltage, SCREEN)) for one in (cored, law)]
    assert ends[0] == pytest.approx(ends[1], rel=1e-12)
    assert -cored.traction_derivative(gap, voltage, SCREEN).min() <= 0.5 * (1.0 + 1e-9)


def test_derivatives_are_those_of_potential_and_traction_also_between_pressed_rough_faces():
    cored = Cored(ev.StrongTroxel(), 0.002, STEEPEST)
    gap, step = np.array([0.0005, 0.0015, 0.0025, 0.004, 0.03]), 1e-8
    for rate, of in ((cored.traction, cored.potential), (cored.traction_derivative, cored.traction)):
        found = (of(gap + step, 1000.0, SCREEN) - of(gap - step, 1000.0, SCREEN)) / (2.0 * step)
        np.testing.assert_allclose(rate(gap, 1000.0, SCREEN), found, rtol=1e-5)
    shallow, deep = (cored.potential(0.002 + way, 1000.0, SCREEN) for way in (1e-9, -1e-9))
    assert deep == pytest.approx(shallow, rel=1e-5)


def test_without_need_the_law_is_the_law_to_the_last_digit():
    cored = Cored(ev.StrongTroxel(), 0.0, STEEPEST)
    for voltage in (0.0, 1.0):
        assert cored.line(voltage, SCREEN).end == 0.0
        for name in ("traction", "traction_derivative", "potential"):
            both = [getattr(one, name)(NEAR, voltage, SCREEN) for one in (cored, ev.StrongTroxel())]
            np.testing.assert_array_equal(*both)
