"""What the quick studies of fringes, friction, tissue in time and whole fingertips find."""

import pytest

pytestmark = pytest.mark.slow


@pytest.fixture
def numbers(numbers_of):
    return numbers_of("fringe")


def test_ridges_over_the_film_as_computed_elsewhere(numbers):
    """-4.2 % at 0.25 mm and -11.4 % in contact, by boundary integrals; always between the bounds."""
    assert numbers["ridge.t7.film.0.25mm.columns_percent"] == pytest.approx(-4.2, abs=0.1)
    assert numbers["ridge.t7.film.0mm.columns_percent"] == pytest.approx(-11.4, abs=0.2)
    assert abs(numbers["ridge.t7.touchscreen.0mm.columns_percent"]) < 0.1
    for key, value in numbers.items():
        assert not (key.endswith("low_percent") and value > 1e-3), key
        assert not (key.endswith("high_percent") and value < -1e-3), key


def test_a_field_spreads_in_the_skin_from_smooth_contacts(numbers):
    assert numbers["spreading.smooth"] > 1.5
    assert 1.0 < numbers["spreading.5um"] < numbers["spreading.1um"] < 1.25


@pytest.mark.parametrize(("faces", "expected"), [("smooth", 1.95), ("1um", 1.22), ("5um", 1.05)])
def test_a_layer_that_fills_the_ridges_spreads_as_computed_elsewhere(numbers, faces, expected):
    """Walls of another slope: within 4 %."""
    assert numbers[f"spreading.filled.{faces}"] == pytest.approx(expected, rel=0.04)


def test_ridged_fingers_gain_more_than_smooth_ones(numbers):
    for case in ("HVHD", "HVLD", "LVLD", "pressed"):
        ridged, smooth = (numbers[f"finger.{name}.{case}.full_over_local"] for name in ("ridged", "smooth"))
        assert ridged > smooth > 1.0, case


def test_electrodes_that_end(numbers):
    assert numbers["edge.normal_in_the_middle_over_whole"] == pytest.approx(0.5, abs=0.02)
    assert 0.0 < numbers["edge.largest_x_over_whole"] < 0.2
    for pitch in ("4", "1"):
        grounded, floating = (
            numbers[f"stripes.{pitch}mm.{way}_over_whole"] for way in ("grounded", "floating")
        )
        assert floating == pytest.approx(grounded, rel=0.1)
        assert grounded < 1.0


def test_the_share_of_the_air_rises(numbers):
    """More at ridged fingers than at smooth ones, and more by the full field than by columns."""
    share = {
        (name, kind): numbers[f"finger.{name}.pressed.{kind}_air_share"]
        for name in ("ridged", "smooth")
        for kind in ("local", "full")
    }
    assert 0.0 < share["smooth", "local"] < share["smooth", "full"] < share["ridged", "full"] < 1.0
    assert share["ridged", "local"] < share["ridged", "full"]


def test_participants_remain_twice_as_strong_as_measured(numbers):
    """Ridges and fringes together change (8a) by a few per cent."""
    for case in ("HVHD", "HVLD", "LVLD"):
        assert numbers[f"participants.gain_median.{case}"] == pytest.approx(1.0, abs=0.1)
        law, full = (numbers[f"participants.{key}_median_mN.{case}"] for key in ("law", "full"))
        assert full == pytest.approx(law, rel=0.1)


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


def test_friction_follows_a_voltage_up_to_the_measured_cut_off(numbers_of):
    """13.8 Hz per mm/s (arXiv:2505.11162), to what 40 steps in a period leave; at rest nothing changes."""
    found = numbers_of("bandwidth")
    assert found["cutoff_Hz.20_mm_s"] == pytest.approx(276.0, rel=5e-3)
    assert found["verdict.largest_error_of_gain.20_mm_s"] < 2e-3
    assert found["verdict.largest_error_degrees.20_mm_s"] < 0.5
    assert abs(found["onset.change_at_rest.memory"]) < 1e-8
    for way in (5, 20):
        exact = found[f"reference.share_after_{way}_um"]
        assert found[f"onset.share_after_{way}_um.memory"] == pytest.approx(exact, abs=2e-3)
        assert found[f"onset.share_after_{way}_um.coulomb"] == pytest.approx(1.0, abs=1e-6)


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


def test_areas_and_widths_and_what_would_bring_them_to_adams(numbers_of):
    """The quick study: Adams' area is twice the pad's at 0.5 N, half the moduli give 1.4, and a
    cross-section needs a wider pad under more load; ridges and laws order the hovering forces.
    """
    numbers = numbers_of("fingertip")
    wanted = numbers["variant.wanted_over_unchanged"]
    assert 1.0 / numbers["verdict.smooth.gross_over_adams.0.5N"] == pytest.approx(wanted)
    assert 1.2 < numbers["variant.all moduli x 0.5.area_over_unchanged"] < wanted < 2.4
    assert 4.5 < numbers["width_mm.smooth.0.1N"] < numbers["width_mm.smooth.0.5N"] < 8.0
    for law in ("kaczmarek", "strong_troxel"):
        for case in ("HVHD", "HVLD", "LVLD"):
            smooth, ridged = (numbers[f"{kind}.{law}.median_mN.{case}"] for kind in ("smooth", "ridged"))
            assert 0.9 * smooth < ridged < smooth
            assert 0.92 < numbers[f"verdict.smooth.{law}.over_closed_form.{case}"] < 1.0


def test_parallel_ridges_yield_across_and_slide_in_the_end_with_the_coefficient(numbers_of):
    """The quick study: two directions of one pattern, beside a smooth pad."""
    numbers = numbers_of("fingerprint")
    x, z = (numbers[f"along.{way}.stiffness_N_per_mm"] for way in "xz")
    smooth_x, smooth_z = (numbers[f"smooth.{way}.stiffness_N_per_mm"] for way in "xz")
    assert x < smooth_x
    assert z / x > 1.02 * smooth_z / smooth_x
    for way in "xz":
        assert 0.8 < numbers[f"along.{way}.friction_at_the_end_over_full_slip"] < 1.0 + 1e-6
    assert 0.6 < numbers["verdict.along.attraction_over_smooth"] < 1.0
