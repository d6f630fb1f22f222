"""A law with a linear core: its work, slopes, lengths and potential against closed forms."""

import numpy as np
import pytest

import evfem as ev
from evfem.electrostatics.laws import Layers
from evfem.electrostatics.roughness import Cored

SCREEN = Layers.of(ev.Layer(0.38, 1650.0), ev.Layer(0.001, 3.9))
STEEPEST = 0.1 / 0.91 * 10.0 / 0.05004 / 6.0  # of the skin's modulus over the nodes' distance
GAPS = np.array([0.0, 1e-4, 1e-3, 5e-3, 0.02])


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


def test_without_need_the_law_is_the_law_to_the_last_digit():
    cored = Cored(ev.StrongTroxel(), 0.0, STEEPEST)
    for voltage in (0.0, 1.0):
        assert cored.line(voltage, SCREEN).end == 0.0
        for name in ("traction", "traction_derivative", "potential"):
            both = [getattr(one, name)(GAPS, voltage, SCREEN) for one in (cored, ev.StrongTroxel())]
            np.testing.assert_array_equal(*both)
