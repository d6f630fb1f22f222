"""How far the bone goes where no travel settles its force."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from evfem.contact.signorini import ContactNotSolved
from evfem.solver.travel import Travel


@dataclass
class Hovering:
    """A linear step of a body that hovers, whose bone lacks so many N/mm, and more the lower it is."""

    lacks: float
    bone: np.ndarray
    unknowns: tuple = (SimpleNamespace(axis=1),)

    def lacking(self, found, travel):
        return self.lacks + 0.1 * travel


@pytest.mark.parametrize(
    ("gap", "lacks", "touches", "way"),
    [(0.3, -1.0, False, -0.3), (2.0, -1.0, False, -0.25), (0.3, 1.0, False, 0.0), (0.3, -1.0, True, 0.0)],
)
def test_a_body_that_hovers_falls_as_far_as_contact_can_be_solved(gap, lacks, touches, way):
    """Twice its gap or the longest way of 1 mm, halved until a problem below 0.4 mm has a solution. What
    is pulled up, or touches, does not fall.
    """

    def solve(step):
        if step.bone[1] < -0.4:
            raise ContactNotSolved("attracted too hard there")
        return SimpleNamespace(status=np.array([touches, False]))

    interface = SimpleNamespace(surface_at=lambda state: SimpleNamespace(gap=np.array([gap, 5.0])))
    found, bone = Travel(interface, solve, 1.0).searched(Hovering(lacks, np.zeros(2)), None)
    assert bone.tolist() == [0.0, way]
    assert not found.status[1]
