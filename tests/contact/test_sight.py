"""Which places of an outline have a column, and how a step that goes to and fro keeps its choice."""

import numpy as np
import pytest

from evfem.contact.sight import RETURNS, STEEP, WORN, Sight, in_sight


def wall(slope):
    """Four places, with a wall of this slope between the second and the third."""
    return np.array([[0.0, 0.0], [1.0, 0.0], [1.1, 0.1 * slope], [2.0, 0.1 * slope + 0.1]])


GENTLE, STEEPER = wall(0.9 * STEEP), wall(1.1 * STEEP)


@pytest.mark.parametrize(
    ("slope", "seen"), [(0.0, [0, 1, 2, 3]), (0.99 * STEEP, [0, 1, 2, 3]), (1.01 * STEEP, [0, 1, 3])]
)
def test_the_higher_end_of_a_steep_wall_has_no_column(slope, seen):
    assert in_sight(wall(slope)).tolist() == seen
    mirrored = wall(slope)[::-1] * [-1.0, 1.0]
    assert in_sight(mirrored).tolist() == sorted(3 - k for k in seen)


def test_a_choice_that_comes_back_again_and_again_is_kept():
    sight, kept = Sight(), []
    for places in (GENTLE, STEEPER) * 2:
        kept.append(sight.watch(places))
        assert sight.of(places).tolist() == in_sight(places).tolist()
    assert kept == [False, False, False, True]
    assert RETURNS == 2
    assert sight.of(GENTLE).tolist() == sight.of(STEEPER).tolist() == [0, 1, 3]
    assert not sight.watch(GENTLE)  # it is kept already
    sight.begin()
    assert sight.of(GENTLE).tolist() == [0, 1, 2, 3]
    assert not sight.watch(STEEPER)


def test_a_choice_that_stays_or_goes_on_is_free():
    sight = Sight()
    for places in [GENTLE] * 5 + [STEEPER] * 5 + [wall(0.0)] * 5:
        assert not sight.watch(places)
    assert sight.kept is None


def test_a_kept_choice_is_left_where_its_columns_become_too_steep():
    sight = Sight()
    for places in (STEEPER, GENTLE) * 2:
        sight.watch(places)
    assert sight.of(wall(0.99 * WORN * STEEP)).tolist() == [0, 1, 2, 3]
    assert sight.of(wall(1.01 * WORN * STEEP)).tolist() == [0, 1, 3]
    turned = GENTLE[[0, 2, 1, 3]]
    assert sight.of(turned).tolist() == in_sight(turned).tolist()
