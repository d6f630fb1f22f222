"""The studies of tissue in time and of derivatives: what must hold whatever the shares."""

import pytest

pytestmark = pytest.mark.slow


def test_a_fast_press_needs_more_and_all_end_at_rest(numbers_of):
    found = numbers_of("relaxation")
    peaks = [found[f"peak_over_rest.{speed}_mm_s"] for speed in (2, 10, 50)]
    assert 1.2 < peaks[0] < peaks[1] < peaks[2] < 2.7
    for speed in (2, 10, 50):
        assert found[f"end_over_rest.{speed}_mm_s"] == pytest.approx(1.0, abs=0.01)
    assert found["creep.mm_at_10_s"] > 1.2
    assert all(0.2 < found[f"lost_in_stroke.{speed}_mm_s"] < 0.4 for speed in (1, 10, 100))


def test_the_contact_lies_ahead_of_a_cylinder_that_is_drawn(numbers_of):
    """Hunter's half-plane to within what the block's size and cells leave."""
    found = numbers_of("relaxation")
    for name, miss in (("half_width_mm", 0.06), ("middle_ahead_mm", 0.2), ("resistance", 0.2)):
        exact = found[f"half_plane.{name}.20_mm_s"]
        assert found[f"rolling.{name}.20_mm_s"] == pytest.approx(exact, rel=miss)
    assert found["rolling.peak_ahead_mm.20_mm_s"] > found["rolling.middle_ahead_mm.20_mm_s"]


def test_a_slow_impedance_is_the_slope_of_a_press(numbers_of):
    found = numbers_of("impedance")
    slope = found["slope_of_a_press.mN_per_mm2"]
    assert found["slow.mN_per_mm2"] == pytest.approx(slope, rel=1e-4)
    assert found["vanishes_Hz.tangential.0.6_mm.onset"] < found["vanishes_Hz.normal.0.6_mm.onset"]


def test_friction_decides_in_full_slip_alone_and_the_voltage_counts_twice(numbers_of):
    found = numbers_of("sensitivities")
    tangential = "tangential_force.surface.friction"
    assert found[f"full slip.{tangential}"] == pytest.approx(1.0, abs=0.1)
    assert abs(found[f"partial slip.{tangential}"]) < 0.1
    assert found["rest.electrostatic_force.electrostatics.voltage"] == pytest.approx(2.0, abs=0.05)
    names = [name for name in found if name.endswith("by_run")]
    assert len(names) == 4
    for name in names:
        assert found[name] == pytest.approx(found[name.removesuffix("run") + "derivative"], rel=0.2)
