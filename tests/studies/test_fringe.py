"""The study of what the column law misses."""

import numpy as np
import pytest
from evfem.studies import fringe


@pytest.fixture
def numbers(numbers_of):
    return numbers_of("fringe")


@pytest.mark.slow
def test_ridges_over_the_film_as_computed_elsewhere(numbers):
    """-4.2 % at 0.25 mm and -11.4 % in contact, by boundary integrals; always between the bounds."""
    assert numbers["ridge.t7.film.0.25mm.columns_percent"] == pytest.approx(-4.2, abs=0.1)
    assert numbers["ridge.t7.film.0mm.columns_percent"] == pytest.approx(-11.4, abs=0.2)
    assert abs(numbers["ridge.t7.touchscreen.0mm.columns_percent"]) < 0.1
    for key, value in numbers.items():
        assert not (key.endswith("low_percent") and value > 1e-3), key
        assert not (key.endswith("high_percent") and value < -1e-3), key


@pytest.mark.slow
def test_a_field_spreads_in_the_skin_from_smooth_contacts(numbers):
    assert numbers["spreading.smooth"] > 1.5
    assert 1.0 < numbers["spreading.5um"] < numbers["spreading.1um"] < 1.25


@pytest.mark.slow
@pytest.mark.parametrize(("faces", "expected"), [("smooth", 1.95), ("1um", 1.22), ("5um", 1.05)])
def test_a_layer_that_fills_the_ridges_spreads_as_computed_elsewhere(numbers, faces, expected):
    """Walls of another slope: within 4 %."""
    assert numbers[f"spreading.filled.{faces}"] == pytest.approx(expected, rel=0.04)


@pytest.mark.slow
def test_ridged_fingers_gain_more_than_smooth_ones(numbers):
    for case in ("HVHD", "HVLD", "LVLD", "pressed"):
        ridged, smooth = (numbers[f"finger.{name}.{case}.full_over_local"] for name in ("ridged", "smooth"))
        assert ridged > smooth > 1.0, case


@pytest.mark.slow
def test_electrodes_that_end(numbers):
    assert numbers["edge.normal_in_the_middle_over_whole"] == pytest.approx(0.5, abs=0.02)
    assert 0.0 < numbers["edge.largest_x_over_whole"] < 0.2
    for pitch in ("4", "1"):
        grounded, floating = (
            numbers[f"stripes.{pitch}mm.{way}_over_whole"] for way in ("grounded", "floating")
        )
        assert floating == pytest.approx(grounded, rel=0.1)
        assert grounded < 1.0


def test_both_ridges_have_the_height_of_the_fingers():
    for shape in ("t7", "sinus"):
        x, height = fringe.ridge(shape, 101)
        assert np.ptp(height) == pytest.approx(0.15)
        assert height[50] == 0.0
        assert x[-1] == 0.5


@pytest.mark.slow
def test_the_share_of_the_air_rises(numbers):
    """More at ridged fingers than at smooth ones, and more by the full field than by columns."""
    share = {
        (name, kind): numbers[f"finger.{name}.pressed.{kind}_air_share"]
        for name in ("ridged", "smooth")
        for kind in ("local", "full")
    }
    assert 0.0 < share["smooth", "local"] < share["smooth", "full"] < share["ridged", "full"] < 1.0
    assert share["ridged", "local"] < share["ridged", "full"]


@pytest.mark.slow
def test_participants_remain_twice_as_strong_as_measured(numbers):
    """Ridges and fringes together change (8a) by a few per cent."""
    for case in ("HVHD", "HVLD", "LVLD"):
        assert numbers[f"participants.gain_median.{case}"] == pytest.approx(1.0, abs=0.1)
        law, full = (numbers[f"participants.{key}_median_mN.{case}"] for key in ("law", "full"))
        assert full == pytest.approx(law, rel=0.1)
