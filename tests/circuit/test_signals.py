"""Voltage profiles: interpolation with jumps, effective value, amplifier limit, files."""

from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from tools.refusals import refuses

from evfem.circuit.signals import (
    Amplifier,
    FollowForce,
    VoltageProfile,
    carrier_amplitude,
    mean_squares,
    waves_in,
)

JUMP = VoltageProfile([0.0, 2.0, 2.0, 4.0], [10.0, 10.0, 100.0, 50.0])


def test_linear_between_constant_beyond_later_row_at_a_jump():
    assert JUMP(np.array([-9.0, 1.0, 2.0, 3.0, 9.0])).tolist() == [10.0, 10.0, 100.0, 75.0, 50.0]
    assert JUMP([2.0 - 1e-9, np.nextafter(2.0, 0.0)]).tolist() == [10.0, 100.0]  # at the jump to rounding
    force = FollowForce(JUMP.position, JUMP.voltage)
    assert force([2.0 - 1e-9, np.nextafter(2.0, 0.0)]).tolist() == [10.0, 100.0]
    assert [one.size for one in JUMP.jumps(3.0, np.nextafter(2.0, 0.0))] == [0, 0, 0]
    assert VoltageProfile([1.0, 1.0], [5.0, 7.0])(np.array([0.9, 1.0, 1.1])).tolist() == [5.0, 7.0, 7.0]
    assert type(JUMP(1.0)) is float


def test_rms_is_exact_for_pieces():
    # ramp 0..U over its length: U / sqrt(3); the jump splits the integral: (2 * 10^2 + 2 * 5833.333) / 4
    assert VoltageProfile([0.0, 3.0], [0.0, 6.0]).rms(0.0, 3.0) == pytest.approx(
        6.0 / np.sqrt(3.0), rel=1e-15
    )
    assert JUMP.rms(0.0, 4.0) ** 2 == pytest.approx(
        (2 * 100 + 2 * (100**2 + 100 * 50 + 50**2) / 3) / 4, rel=1e-14
    )
    assert JUMP.rms(0.0, 2.0) == 10.0  # the jump at the end does not count
    assert JUMP.rms(2.0, 4.0) ** 2 == pytest.approx((100**2 + 100 * 50 + 50**2) / 3, rel=1e-14)
    assert JUMP.rms(-5.0, -1.0) == 10.0
    dense = JUMP(np.linspace(0.5, 3.7, 2_000_001))
    assert JUMP.rms(0.5, 3.7) == pytest.approx(np.sqrt(np.mean(dense**2)), rel=2e-6)


def test_mean_squares_are_those_of_rms_between_any_edges():
    edges = np.linspace(-0.7, 5.1, 30)
    found = mean_squares(JUMP, edges)
    expected = [JUMP.rms(a, b) ** 2 for a, b in pairwise(edges)]
    np.testing.assert_allclose(found, expected, rtol=1e-12)
    narrow = mean_squares(JUMP, np.array([1.0, 1.0, 3.0, 3.0, 3.0]))  # too narrow for their floats
    np.testing.assert_allclose(narrow[[0, 2, 3]], [100.0, 75.0**2, 75.0**2], rtol=1e-12)
    assert narrow[1] == pytest.approx(JUMP.rms(1.0, 3.0) ** 2, rel=1e-12)


X = np.linspace(0.0, 10.0, 4001)


@pytest.mark.parametrize(
    ("rows", "waves"),
    [
        ((X, 50.0 + 9.0 * np.cos(np.pi * X)), [2.0] * 9),
        ((np.repeat([0, 1, 2, 3, 4], 2)[1:-1], [0, 0, 80, 80, -80, -80, 0, 0]), [2.0, 2.0]),
        (([0.0, 1.1, 1.1, 1.3, 1.3, 5.0], [0.0, 0.0, 80.0, 80.0, 0.0, 0.0]), [0.4]),
        ((np.repeat([0, 4, 4.1, 8, 8.1, 9], 2)[1:-1], [0, 0, 80, 80, 0, 0, 80, 80, 0, 0]), [0.4, 4.0, 0.4]),
        ((X, 9.0 * np.abs(np.sin(np.pi * X))), [1.0] * 19),  # crests of 2/3 and troughs of 1/3
        (([0.0, 1.0, 1.0, 2.0, 3.0], [0.0, 0.0, 80.0, 80.0, 90.0]), []),  # jump and ramp
        ((X, np.where(X < 5.0, 0.0, 98.0) + 1.9 * np.sin(2.0 * np.pi * X / 0.1)), []),  # ripples of 4 %
        (([0.0, 1.0, 1.0, 1.0, 2.0], [0.0, 0.0, 80.0, 0.0, 0.0]), []),  # a row that never holds
        (([1.0], [5.0]), []),
        (([1.0, 2.0], [0.0, 0.0]), []),
    ],
)
def test_waves_are_two_widths_of_their_crests_and_troughs(rows, waves):
    found = waves_in(VoltageProfile(*rows))
    assert found.tolist() == pytest.approx(waves, rel=1e-2)


def test_amplifier_cuts_exactly_at_its_limit():
    wave = VoltageProfile([0.0, 4.0, 8.0], [0.0, 400.0, -400.0])
    cut = Amplifier(voltage_max=100.0).limit(wave)
    x = np.linspace(-1.0, 9.0, 1001)
    np.testing.assert_allclose(cut(x), np.clip(wave(x), -100.0, 100.0), atol=1e-10)
    assert np.array_equal(Amplifier(1000.0).limit(JUMP).voltage, JUMP.voltage)


def test_slope_and_carrier():
    assert VoltageProfile([0.0, 2.0, 3.0], [0.0, 10.0, 40.0]).steepest() == 30.0
    assert JUMP.steepest() == np.inf
    assert VoltageProfile([0.0], [5.0]).steepest() == 0.0
    time = np.arange(10_000) / 10_000
    wave = carrier_amplitude(140.0) * np.sin(2 * np.pi * 7 * time)
    assert np.sqrt(np.mean(wave**2)) == pytest.approx(140.0, rel=1e-12)


def test_file_keeps_every_bit(tmp_path):
    profile = VoltageProfile([0.0, 0.1, 0.1], [1.0 / 3.0, 1776.73, 1e-300])
    profile.to_csv(tmp_path / "voltage.csv")
    back = VoltageProfile.from_csv(tmp_path / "voltage.csv")
    assert back.position.tolist() == profile.position.tolist()
    assert back.voltage.tolist() == profile.voltage.tolist()


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("x,u\n0,1\n", "header position,voltage"),
        ("", "starts with"),
        ("position,voltage\n0,1,2\n", "2 finite numbers on each line"),
        ("position,voltage\n0,1\n1,high\n", "line 3: .*2 finite numbers on each line"),
        ("position,voltage\n", "starts with .position,voltage"),
        ("position,voltage\n1,0\n0,0\n", "never fall"),
        ("position,voltage\n0,nan\n", "2 finite numbers"),
    ],
)
def test_bad_files_are_refused_with_a_sentence(tmp_path, text, says):
    (tmp_path / "voltage.csv").write_text(text)
    refuses(says, VoltageProfile.from_csv, tmp_path / "voltage.csv")


def test_missing_file_and_bad_arrays_are_refused(tmp_path):
    refuses("voltage_file", VoltageProfile.from_csv, tmp_path / "none.csv")
    refuses("equally many", VoltageProfile, [0.0, 1.0], [1.0])
    refuses("two positions", JUMP.rms, 1.0, 1.0)
    refuses("voltage_max", Amplifier, 0.0)


def test_amplifier_follows_no_faster_than_its_slew():
    # 100 V/mm: the wish rises by 300 in 1 mm and stays; caught up with after 3 mm
    rise = VoltageProfile([0.0, 1.0, 8.0], [0.0, 300.0, 300.0])
    slow = Amplifier(1000.0, slew=2000.0).limit(rise, speed=20.0)
    np.testing.assert_allclose(
        slow([0.5, 1.0, 2.5, 3.0, 5.0]), [50.0, 100.0, 250.0, 300.0, 300.0], rtol=1e-14
    )
    # a fall that begins before it has caught up: 250 at 2.5 mm is met by 400 - 50 (x - 1) ... at x = 3
    fall = VoltageProfile([0.0, 1.0, 9.0], [0.0, 400.0, 0.0])
    slow = Amplifier(1000.0, slew=2000.0).limit(fall, speed=20.0)
    np.testing.assert_allclose(slow([1.0, 3.0, 5.0, 9.0]), [100.0, 300.0, 200.0, 0.0], rtol=1e-14, atol=1e-12)
    # never steeper, and where it departs from the wish it goes towards it at full speed
    random = np.random.default_rng(3)
    wish = VoltageProfile(np.sort(random.uniform(0.0, 5.0, 40)), random.uniform(0.0, 900.0, 40))
    slow = Amplifier(800.0, slew=3000.0).limit(wish, speed=2.0)
    assert slow.steepest() == pytest.approx(1500.0, rel=1e-9)
    x = np.linspace(wish.position[0], wish.position[-1], 20_001)
    behind = np.clip(wish(x), 0.0, 800.0) - slow(x)
    towards = np.gradient(slow(x), x) * np.sign(behind)
    lags = np.abs(behind) > 2.0
    assert np.mean(np.isclose(towards[lags], 1500.0, rtol=1e-6)) > 0.99
    assert np.max(np.abs(Amplifier(1e4, slew=1e9).limit(wish, speed=1.0)(x) - wish(x))) < 1e-9


def test_a_jump_is_climbed_and_a_slew_needs_a_speed():
    slow = Amplifier(1000.0, slew=90.0).limit(JUMP, speed=1.0)
    # from 10 V at the jump at 2 mm with 90 V/mm towards 100 - 25 (x - 2): met after 90 / 115 mm
    meets = 2.0 + 90.0 / 115.0
    np.testing.assert_allclose(slow([2.0, 2.5, meets, 4.0]), [10.0, 55.0, 10.0 + 90.0 * (meets - 2.0), 50.0])
    refuses("needed with a slew", Amplifier(1000.0, slew=90.0).limit, JUMP)
    refuses("slew", Amplifier, 1000.0, slew=0.0)


@pytest.mark.parametrize(
    ("rows", "x", "volts"),
    [
        # 50 V/mm: 0 V at 1 mm, where the wish jumps to 100 V for ever; 100 V at 3 mm
        (([0.0, 1.0, 1.0], [0.0, 0.0, 100.0]), [1.0, 2.0, 3.0, 5.0], [0.0, 50.0, 100.0, 100.0]),
        # 25 V at the last row, 100 V 1.5 mm behind it
        (([0.0, 1.0, 1.5], [0.0, 0.0, 100.0]), [1.0, 1.5, 3.0, 9.0], [0.0, 25.0, 100.0, 100.0]),
        # falling, through 0
        (([0.0, 1.0, 1.0], [50.0, 50.0, -50.0]), [1.0, 2.0, 3.0, 5.0], [50.0, 0.0, -50.0, -50.0]),
        (([0.0, 1.0, 1.0], [-20.0, -20.0, -120.0]), [1.0, 2.0, 3.0, 5.0], [-20.0, -70.0, -120.0, -120.0]),
        # constant before its first row, a jump there, and no other row
        (([1.0, 1.0], [0.0, 100.0]), [0.0, 1.0, 2.0, 3.0, 4.0], [0.0, 0.0, 50.0, 100.0, 100.0]),
        (([1.0, 1.0, 2.0], [0.0, 100.0, 100.0]), [0.0, 1.0, 2.0, 3.0, 4.0], [0.0, 0.0, 50.0, 100.0, 100.0]),
        (([0.0], [70.0]), [-1.0, 0.0, 1.0], [70.0, 70.0, 70.0]),
    ],
)
def test_a_profile_that_lags_behind_its_last_row_goes_on_to_its_last_voltage(rows, x, volts):
    slow = Amplifier(200.0, slew=500.0).limit(VoltageProfile(*rows), speed=10.0)
    np.testing.assert_allclose(slow(x), volts, rtol=1e-14, atol=1e-12)
    assert slow.steepest() <= 50.0 * (1.0 + 1e-12)


def test_a_profile_that_has_caught_up_ends_at_its_last_row():
    """Caught up with to rounding it has no steep row more, and positions stay within those of a profile."""
    random = np.random.default_rng(5)
    for _ in range(200):
        x, rate = np.cumsum(random.uniform(0.01, 1.0, 3)), random.uniform(10.0, 500.0)
        wish = VoltageProfile([x[0], x[0], x[1], x[2]], [0.0, *[rate * (x[1] - x[0])] * 3])
        slow = Amplifier(1e4, slew=rate).limit(wish, speed=1.0)
        assert slow.steepest() <= rate * (1.0 + 1e-9)
        assert slow.position[-1] == pytest.approx(x[2], rel=1e-12)
        met = Amplifier(1e4, slew=rate).limit(VoltageProfile(wish.position[:3], wish.voltage[:3]), speed=1.0)
        assert met.steepest() <= rate * (1.0 + 1e-9)
        assert met.voltage[-1] == pytest.approx(wish.voltage[-1], rel=1e-11)
    far = Amplifier(200.0, slew=1e-4).limit(VoltageProfile([0.0, 1.0, 1.0], [0.0, 0.0, 100.0]), speed=10.0)
    assert far.position[-1] == 1e6  # the largest position, where 1e-5 V/mm have made 10 V
    assert far.voltage[-1] == pytest.approx(10.0, rel=1e-5)


FINGER = SimpleNamespace(
    frequency=np.array([1e3, 1e4]), impedance=np.array([-2e5j, 1e4 - 2e4j]), unit="ohm"
)  # as of `ev.electrical_impedance`


def test_current_and_slew_rate_limit_an_alternating_voltage_by_its_load():
    """By hand: 1 mA through |10 - 20i| kohm are 22.4 V; a sine of 30 V rises by 2 pi f 30 sqrt(2)."""
    wish = VoltageProfile([0.0, 10.0], [0.0, 100.0])
    current = Amplifier(80.0, largest_current=1e-3, load=FINGER)
    assert current.limit(wish).voltage.max() == pytest.approx(1e-3 * 1e4 * 5**0.5, rel=1e-12)
    rate = 2.0 * np.pi * 1e4 * 30.0 * 2**0.5
    both = Amplifier(80.0, largest_current=1e-2, slew_rate=rate, load=FINGER)
    assert both.limit(wish).voltage.max() == pytest.approx(30.0, rel=1e-12)
    assert [one.stops(wish) for one in (current, both, Amplifier(80.0), Amplifier(200.0))] == [
        "largest_current",
        "slew_rate",
        "voltage_max",
        "",
    ]


def test_a_current_without_a_load_is_refused():
    refuses("load: missing", Amplifier(80.0, largest_current=1e-3).limit, JUMP)
    plane = SimpleNamespace(unit="ohm mm")
    refuses("load: given SimpleNamespace, not in ohm", Amplifier, 80.0, slew_rate=1e5, load=plane)
    refuses("largest_current: given 0", Amplifier, 80.0, largest_current=0.0, load=FINGER)
