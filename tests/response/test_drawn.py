"""Derivatives of drawn scenes are those of differences of their runs (`tests/tools/derivatives.py`)."""

import pytest
from tools.derivatives import rows_of

#: seed and number of a scene; the last has a node whose pressure is 2 % below the kink of its law of friction
SCENES = [(43, 10), (26112702, 12)]
SLOW = [(43, 4), (43, 5)]


@pytest.mark.parametrize(
    ("seed", "number"), [*SCENES, *(pytest.param(*one, marks=pytest.mark.slow) for one in SLOW)]
)
def test_derivatives_of_a_drawn_scene_are_those_of_differences(seed, number):
    assert [row["found"] for row in rows_of(seed, number)] == ["agrees"] * 3
