"""Checkpoints: what does not fit is refused by its name."""

from dataclasses import replace

import numpy as np
import pytest

from evfem.errors import InputError
from evfem.newton.state import Reusable, State, TangentPoint
from evfem.simulation.checkpoint import reusable_arrays, state_arrays, usable
from evfem.simulation.result import Saved

N, P = 6, 4
RANDOM = np.random.default_rng(1)


def numbers(*shape):
    return RANDOM.normal(size=shape)


STATE = State(
    u=numbers(N, 2),
    contact_force=numbers(P, 2),
    status=np.array([0, 1, 2, 3]),
    bone=numbers(2),
    voltage=123.0,
    attraction=numbers(P, 2),
    reaction=numbers(2),
    velocity=numbers(N, 2),
    last_increment=numbers(N, 2),
)
TOUCHED, STATUS = np.array([True, False, True, True]), np.array([2, 0, 1, 3])
MADE = replace(STATE, u=numbers(N, 2), status=STATUS)
POINT = TangentPoint(MADE, TOUCHED, True, numbers(N, 2), 0.25, STATE.inner, STATE.past)
CARRIED = Reusable(np.array([0, 2, 3]), POINT, 0.75)


def arrays():
    kept = {**state_arrays(STATE), **reusable_arrays(STATE, CARRIED), "substep": np.array(0.5)}
    return {name: np.copy(array) for name, array in kept.items()}


DAMAGED = {
    "missing": ("reaction", None),
    "another shape": ("u", np.zeros((N + 1, 2))),
    "another kind": ("status", np.zeros(P)),
    "not finite": ("bone", np.array([0.0, np.nan])),
    "no such status": ("status", np.array([0, 1, 2, 4])),
    "a candidate beyond the pad": ("candidates", np.array([0, 2, P])),
    "a negative candidate": ("candidates", np.array([-1, 2])),
    "candidates in disorder": ("candidates", np.array([2, 0, 3])),
    "a candidate twice": ("candidates", np.array([0, 2, 2])),
    "no substep": ("substep", np.array(0.0)),
    "too long a substep": ("substep", np.array(1.5)),
}


@pytest.mark.parametrize("how", DAMAGED)
def test_what_does_not_fit_is_refused_by_its_name(how):
    assert usable(Saved(arrays(), []), arrays(), 5).keys() == arrays().keys()
    name, value = DAMAGED[how]
    damaged = arrays()
    if value is None:
        del damaged[name]
    else:
        damaged[name] = value
    with pytest.raises(InputError, match=f"no usable {name}"):
        usable(Saved(damaged, []), arrays(), 5)


def test_more_rows_than_the_scene_has_steps_are_refused():
    with pytest.raises(InputError, match="6 steps"):
        usable(Saved(arrays(), [{}] * 6), arrays(), 5)
