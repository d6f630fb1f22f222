"""Derivatives of drawn scenes are those of differences of their runs (`tests/tools/derivatives.py`)."""

import pytest
from tools.derivatives import rows_of


@pytest.mark.parametrize(
    "number", [4, 10, *(pytest.param(number, marks=pytest.mark.slow) for number in (5, 62))]
)
def test_derivatives_of_a_drawn_scene_are_those_of_differences(number):
    rows = rows_of(43, number)
    assert [row["found"] for row in rows] == ["agrees"] * 3
