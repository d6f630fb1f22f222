"""What is prescribed in a step: known parts, missing forces, unknowns, bounds of the voltage."""

from types import SimpleNamespace

import numpy as np
import pytest

from evfem.contact.condensed import LinearContactStep, StepSolution
from evfem.newton.control import FollowFriction
from evfem.newton.search import VoltageProblem


class Friction:
    """A pad whose friction force is 2 N/mm plus 3 N/mm for each kV^2: contact problems of one number."""

    def __init__(self, squared):
        self.squared, self.residuals = squared, []

    def drive(self):
        push = np.array([3.0])
        return VoltageProblem(self.squared, self.solve, lambda: (np.array([7.0]), push))

    def solve(self, step):
        self.residuals.append(step.residual.copy())
        present = 2.0 + 3.0 * self.squared
        extra = [(unknown.force - present) / unknown.push[0] for unknown in step.unknowns]
        empty = np.zeros(0)
        return StepSolution(empty, np.zeros((0, 2)), empty.astype(int), np.array(extra), 1, False)


def follow(wish, squared, largest=2000.0, before=1000.0):
    """The control after one iteration at `squared` kV^2, what it changed, and contact problems it posed."""
    control, friction = FollowFriction(wish, largest), Friction(squared)
    control.begin(SimpleNamespace(voltage=before), None)
    step = LinearContactStep(None, None, np.zeros(1), np.zeros(2))
    return control, control.solve(step, friction.drive()), friction.residuals


@pytest.mark.parametrize(("wish", "squared"), [(1.0, 0.0), (20.0, 4.0)], ids=["below", "above"])
def test_at_a_bound_the_voltage_stays_there_and_contact_is_solved_again(wish, squared):
    """Bounds 0 and 2000 V, 4 kV^2; the change of the attraction then is a known force."""
    control, found, posed = follow(wish, 1.0)
    assert not control.free
    assert 1.0 + found.change == pytest.approx(squared)
    assert posed[1].tolist() == pytest.approx([3.0 * (squared - 1.0)])
    assert control.missing(np.array([6.0, 0.0])) == 0.0
    # and from then on it is given
    step = LinearContactStep(None, None, np.zeros(1), np.zeros(2))
    assert control.solve(step, Friction(squared).drive()).change == 0.0


@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize(
    ("wish", "tolerated", "corrected"), [(1.0, 3.0, 0.5), (20.0, 19.0, 21.0)], ids=["at zero", "at limit"]
)
def test_a_bound_is_left_only_where_the_voltage_could_help(way, wish, tolerated, corrected):
    """At 0 V more friction than wished for cannot be helped, less can; at the limit the other way round."""
    for force, accepted in ((tolerated, True), (corrected, False)):
        control, _, _ = follow(wish, 1.0)
        control.force = way * control.force
        assert control.accepts(np.array([way]), np.array([way * force, 0.0]), 1e-6) == accepted
        assert control.free == (not accepted)
