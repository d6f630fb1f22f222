"""The spectrum of a column: lines of known height, where they belong, and rows it cannot use."""

from dataclasses import replace

import numpy as np
import pytest
from tools.fakes import fake_result
from tools.refusals import refuses

import evfem as ev

TIMES = 0.01 * np.arange(1, 101)


def column(values, time=TIMES, motion=0):
    """A result whose tangential force has these values, at these times."""
    n = len(time)
    made = fake_result(steps=n)
    return replace(
        made,
        time=np.asarray(time, dtype=float),
        tangential_force=np.asarray(values, dtype=float),
        motion_index=np.full(n, motion) if np.isscalar(motion) else np.asarray(motion),
    )


def test_lines_stand_at_their_frequencies_with_their_amplitudes():
    values = -0.3 + 0.2 * np.sin(2 * np.pi * 5.0 * TIMES + 0.7) + 0.05 * np.cos(2 * np.pi * 50.0 * TIMES)
    frequency, amplitude = ev.spectrum(column(values), "tangential_force")
    np.testing.assert_allclose(frequency, np.arange(51), atol=1e-9)
    lines = np.zeros(51)
    lines[[0, 5, 50]] = 0.3, 0.2, 0.05
    np.testing.assert_allclose(amplitude, lines, atol=1e-12)


def test_a_window_keeps_a_line_of_no_whole_number_of_periods_to_its_neighbours():
    """5.5 periods: without a window a tenth of the line is still 3 lines away; Hann's falls with the
    cube, and its highest value is 8 / (3 pi) of the amplitude.
    """
    values = 1.0 + 0.2 * np.cos(2 * np.pi * 5.5 * TIMES)
    plain, hann = (
        ev.spectrum(column(values), "tangential_force", window=w).amplitude for w in ("none", "hann")
    )
    assert hann[0] == pytest.approx(1.0, rel=3e-3)
    assert hann[[5, 6]] == pytest.approx(2 * [0.2 * 8.0 / (3.0 * np.pi)], rel=0.02)
    assert plain[20] > 0.005
    assert hann[20] < 1e-4
    whole = ev.spectrum(
        column(1.0 + 0.2 * np.sin(2 * np.pi * 5.0 * TIMES)), "tangential_force", window="hann"
    )
    np.testing.assert_allclose(whole.amplitude[[0, 4, 5, 6]], [1.0, 0.1, 0.2, 0.1], rtol=1e-9)


def test_rows_of_the_last_motion_are_used_or_those_of_a_window_of_time():
    values = np.concatenate([np.full(40, 5.0), np.sin(2 * np.pi * 10.0 * TIMES[40:])])
    motion = [0] * 30 + [1] * 70
    made = column(values, motion=motion)
    assert ev.spectrum(made, "tangential_force").frequency.size == 36
    later = ev.spectrum(made, "tangential_force", start=0.4)
    np.testing.assert_allclose(later.amplitude[[0, 6]], [0.0, 1.0], atol=1e-12)  # 10 Hz over 0.6 s
    first = ev.spectrum(made, "tangential_force", start=0.0, stop=0.4)
    np.testing.assert_allclose(first.amplitude[:2], [5.0, 0.0], atol=1e-12)


def test_values_of_ones_own_have_the_spectrum_of_a_column():
    values = 3.0 + 2.0 * np.sin(2 * np.pi * 5.0 * TIMES)
    found = ev.spectrum(column(np.zeros(100), motion=[0] * 60 + [1] * 40), values)
    np.testing.assert_allclose(found.amplitude[:3], [3.0, 0.0, 2.0], atol=1e-12)  # 5 Hz over 0.4 s


@pytest.mark.parametrize(
    ("make", "options", "key"),
    [
        (lambda: column(TIMES), {"column": "tangent"}, "column"),
        (lambda: column(TIMES), {"column": "motion"}, "column"),
        (lambda: column(np.full(100, np.nan)), {}, "column"),
        (lambda: column(TIMES), {"column": np.zeros((100, 2))}, "column"),
        (lambda: column(TIMES), {"column": np.full(100, np.inf)}, "column"),
        (lambda: column(TIMES), {"column": ["a"] * 100}, "column"),
        (lambda: column(TIMES), {"window": "flat"}, "window"),
        (lambda: column(TIMES, np.zeros(100)), {}, "time"),
        (lambda: column(TIMES, TIMES**2), {}, "time"),
        (lambda: column(TIMES, TIMES + 0.001), {}, "time"),  # the first step is longer
        (lambda: column(TIMES), {"start": 0.995}, "start, stop"),
        (lambda: column(TIMES), {"start": 2.0}, "start, stop"),
        (lambda: column([], []), {}, "result"),
    ],
)
def test_rows_that_are_not_evenly_spaced_are_refused(make, options, key):
    assert refuses("allowed", ev.spectrum, make(), **{"column": "tangential_force"} | options).key == key
