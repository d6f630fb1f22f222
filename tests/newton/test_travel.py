"""How far the bone goes in one linear step."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from evfem.contact.signorini import ContactNotSolved
from evfem.newton.travel import Travel


@dataclass
class Hovering:
    """A linear step of a body that hovers, whose bone lacks so many N/mm, and more the lower it is."""

    lacks: float
    bone: np.ndarray
    unknowns: tuple = (SimpleNamespace(axis=1),)

    def lacking(self, found, travel):
        return self.lacks + 0.1 * travel

    def solve(self):
        if self.unknowns:
            raise AssertionError("the bone's travel shall be given")
        if np.isnan(self.lacks):
            raise ContactNotSolved("attracted too hard there")
        return


@pytest.mark.parametrize(("pushed", "way"), [(-1.0, -0.001), (1.0, 0.6), (np.nan, 0.6)])
def test_a_body_that_hovers_is_thrown_off_only_where_the_attraction_wins(pushed, way):
    """Newton's way is 0.001 mm down, and the bone lacks the rounding of a force upwards. Once the tissue
    has come to rest it is pushed down: the way is right. Or up, by 1 N/mm: the way leads to where the
    attraction holds that, and the body flies, twice its gap. So it does where its contact has no solution.
    """
    still = SimpleNamespace(status=np.zeros(2), extra=np.array([-0.001]))
    state = SimpleNamespace(bone=np.zeros(2), reaction=np.zeros(2))
    height = SimpleNamespace(free=True, missing=lambda y, reaction: 1e-12)
    interface = SimpleNamespace(surface_at=lambda state: SimpleNamespace(gap=np.array([0.3, 5.0])))
    step, target = Hovering(pushed, np.zeros(2)), SimpleNamespace(height=height)
    found, bone = Travel(interface, lambda step: still, 1.0).limited(step, still, state, target)
    assert bone.tolist() == [0.0, way]
    assert found is still
