"""Voltage profiles: interpolation with jumps, effective value, amplifier limit, files."""

import numpy as np
import pytest

from evfem.errors import InputError
from evfem.signals import Amplifier, VoltageProfile, applied_voltage, carrier_amplitude

JUMP = VoltageProfile([0.0, 2.0, 2.0, 4.0], [10.0, 10.0, 100.0, 50.0])


def test_linear_between_constant_beyond_later_row_at_a_jump():
    assert JUMP(np.array([-9.0, 1.0, 2.0, 3.0, 9.0])).tolist() == [10.0, 10.0, 100.0, 75.0, 50.0]
    assert JUMP(np.nextafter(2.0, 0.0)) == 10.0
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


def test_amplifier_cuts_exactly_at_its_limit():
    wave = VoltageProfile([0.0, 4.0, 8.0], [0.0, 400.0, -400.0])
    cut = Amplifier(voltage_max=100.0).limit(wave)
    x = np.linspace(-1.0, 9.0, 1001)
    np.testing.assert_allclose(cut(x), np.clip(wave(x), -100.0, 100.0), atol=1e-10)
    assert np.array_equal(Amplifier(1000.0).limit(JUMP).voltage, JUMP.voltage)


def test_slope_carrier_and_rule_of_two():
    assert VoltageProfile([0.0, 2.0, 3.0], [0.0, 10.0, 40.0]).steepest() == 30.0
    assert JUMP.steepest() == np.inf
    assert VoltageProfile([0.0], [5.0]).steepest() == 0.0
    time = np.arange(10_000) / 10_000
    wave = carrier_amplitude(140.0) * np.sin(2 * np.pi * 7 * time)
    assert np.sqrt(np.mean(wave**2)) == pytest.approx(140.0, rel=1e-12)
    assert applied_voltage(140.0) == 280.0


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
        ("position,voltage\n0,high\n", "2 finite numbers on each line"),
        ("position,voltage\n", "at least one"),
        ("position,voltage\n1,0\n0,0\n", "never fall"),
        ("position,voltage\n0,nan\n", "2 finite numbers"),
    ],
)
def test_bad_files_are_refused_with_a_sentence(tmp_path, text, says):
    (tmp_path / "voltage.csv").write_text(text)
    with pytest.raises(InputError, match=says):
        VoltageProfile.from_csv(tmp_path / "voltage.csv")


def test_missing_file_and_bad_arrays_are_refused(tmp_path):
    with pytest.raises(InputError, match="voltage_file"):
        VoltageProfile.from_csv(tmp_path / "none.csv")
    with pytest.raises(InputError, match="equally many"):
        VoltageProfile([0.0, 1.0], [1.0])
    with pytest.raises(InputError, match="two positions"):
        JUMP.rms(1.0, 1.0)
    with pytest.raises(InputError, match="voltage_max"):
        Amplifier(0.0)
