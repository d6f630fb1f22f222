"""The studies of friction: a line where there are ridges, and the period of stick-slip."""

import pytest

pytestmark = pytest.mark.slow


def test_ridges_make_a_line_in_the_spectrum_of_friction(numbers_of):
    """v / pitch = 20 / 0.5 Hz; Scheibert et al. and Prevost et al. (2009) saw it, and none without ridges."""
    found = numbers_of("friction_spectrum")
    assert found["strongest_above_quarter_Hz.ridges.20_mm_s"] == found["verdict.line_Hz.20_mm_s"] == 40.0
    assert found["line_over_neighbours.ridges.20_mm_s"] > 3.0
    assert found["line_over_neighbours.smooth.20_mm_s"] < 1.5
    assert found["strongest_above_quarter_Hz.smooth.20_mm_s"] < 30.0


@pytest.mark.filterwarnings("ignore:motion . has steps of")
def test_stick_slip_has_the_period_of_the_equation_of_motion(numbers_of):
    """With few steps in a slip; the error is of first order in them."""
    found = numbers_of("stick_slip")
    assert abs(found["verdict.error_percent.1_mm_s"]) < 6.0
    assert 0.6 < found["verdict.rate"] < 1.2
    assert found["verdict.remainder_of_the_books.1_mm_s"] < 1e-8
    assert found["reference.falls_at_once.period_s.1_mm_s"] == pytest.approx(
        found["reference.period_s.1_mm_s"], rel=0.01
    )
