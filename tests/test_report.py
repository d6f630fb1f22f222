"""The table of forces fits the terminal and shows the end of every motion."""

import pytest

from evfem.simulation.history import chosen, table
from evfem.simulation.result import COLUMNS


def rows(*counts):
    """That many rows of one motion after another."""
    numbers = [(k, i) for k, count in enumerate(counts) for i in range(count)]
    return [{"step": n + 1, "motion_index": k, "motion": "slide"} for n, (k, _) in enumerate(numbers)]


def test_the_table_fits_80_columns_with_long_numbers():
    row = dict.fromkeys(COLUMNS, -12.345678) | {"motion": "voltage", "motion_index": 0, "voltage": -10000.0}
    lines = table([row | {"step": n} for n in range(1, 2001)]).splitlines()
    assert max(map(len, lines)) <= 80
    assert len(lines) == 14
    assert lines[-1].split() == ["2000", "voltage", "-12.346", "-12.346", "-10000"] + ["-12.34568"] * 4


def test_columns_never_touch_and_zero_has_no_sign():
    for value in (-1e9, -123456.789, 1e300, -0.0, -1e-9, -1e-300):
        row = dict.fromkeys(COLUMNS, value) | {"step": 12345, "motion": "voltage", "motion_index": 0}
        *_, line = table([row]).splitlines()
        numbers = line.split()[2:]
        assert len(numbers) == 7
        for text in numbers:
            assert float(text) == pytest.approx(value, rel=0.06, abs=0.6 if abs(value) < 1.0 else 0.0)
            assert value < -0.5 or not text.startswith("-")


def test_the_last_row_of_each_motion_is_shown():
    for counts in ((10, 100), (1,), (1, 1, 1), (3, 50, 2, 7)):
        ends = {sum(counts[: k + 1]) - 1 for k in range(len(counts))}
        picked = chosen(rows(*counts), 12)
        assert ends <= set(picked)
        assert picked == sorted(set(picked))
        assert len(picked) <= 12
    assert chosen([], 12) == []
