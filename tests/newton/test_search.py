"""The search for the voltage of a wished friction force: of pads whose force is a closed form."""

from types import SimpleNamespace

import numpy as np
import pytest

from evfem.newton.search import FAILURES, RISES, TRIALS, Search
from evfem.newton.state import StepFailed

#: friction, load and attraction (N/mm) by kV^2, and what sticking bears
MU, LOAD, PULL, STIFF = 0.4, 0.05, 0.002, np.inf
TOLERANCE = 1e-8


class Block:
    """Coulomb's block: it slips at mu (N + c s), or sticks below; `lost(s)` squared voltages fail."""

    def __init__(self, wish, bears=STIFF, lost=lambda squared: False, jump=0.0, power=1.0):
        self.wish, self.bears, self.lost, self.jump, self.asked = wish, bears, lost, jump, []
        self.power = power

    def at(self, voltage, start):
        squared = (voltage / 1000.0) ** 2
        self.asked.append(voltage)
        if self.lost(squared):
            raise StepFailed("lost", [])
        bound = MU * (LOAD + PULL * squared**self.power + (self.jump if squared > 9.0 else 0.0))
        return SimpleNamespace(voltage=voltage, bound=bound, force=min(bound, self.bears))

    def measure(self, state):
        return self.wish - state.force, state.bound - state.force, max(LOAD, state.force)

    def nearest(self, begin=0.0, most=10_000.0):
        return Search(self.at, self.measure, begin, most, TOLERANCE).nearest()


def slipping(wish):
    """The voltage (V) at which the block slips at a force."""
    return 1000.0 * np.sqrt((wish / MU - LOAD) / PULL)


@pytest.mark.parametrize("wish", [0.0201, 0.025, 0.035, 0.06, 0.0999])
@pytest.mark.parametrize("begin", [0.0, 500.0, 3000.0, 10_000.0])
def test_a_force_between_is_met_from_any_voltage(wish, begin):
    block = Block(wish)
    found = block.nearest(begin)
    assert found.force == pytest.approx(wish, rel=1e-7)
    assert found.voltage == pytest.approx(slipping(wish), rel=1e-5)
    assert len(block.asked) < 20


@pytest.mark.parametrize(("wish", "voltage"), [(0.019, 0.0), (0.2, 10_000.0)])
@pytest.mark.parametrize("begin", [0.0, 3000.0, 10_000.0])
def test_a_force_out_of_reach_has_the_nearest_bound(wish, voltage, begin):
    block = Block(wish)
    assert block.nearest(begin).voltage == voltage
    # no voltage is asked twice
    assert len(block.asked) == len(set(block.asked))


@pytest.mark.parametrize("power", [0.2, 4.0])
def test_a_force_that_bends_over_the_squared_voltage_is_met_in_few_equilibria(power):
    """Regula falsi without the halves of the Illinois rule keeps one end, and takes hundreds."""
    block = Block(0.0205, power=power)
    found = block.nearest(2900.0)
    assert found.voltage == pytest.approx(1000.0 * (0.00125 / PULL) ** (0.5 / power), rel=1e-4)
    assert len(block.asked) < 25


#: voltages (V) that 1000 times the root of their square in kV^2 is not
UNEVEN = (63.7, 127.9, 254.3, 500.1, 500.9)


@pytest.mark.parametrize("begin", UNEVEN)
def test_a_pad_that_sticks_keeps_its_voltage_to_the_last_digit(begin):
    assert Block(0.035, bears=0.015).nearest(begin).voltage == begin


@pytest.mark.parametrize("most", UNEVEN)
def test_the_largest_voltage_is_reached_to_the_last_digit(most):
    assert Block(0.035).nearest(0.0, most).voltage == most


def test_a_pad_that_comes_to_stick_has_the_voltage_at_which_it_would_slip_at_the_wish():
    """It slips without a voltage, and bears 0.03 N/mm when it sticks: no voltage makes more of it."""
    found = Block(0.035, bears=0.03).nearest()
    assert found.force == 0.03
    assert found.voltage == pytest.approx(slipping(0.035), rel=1e-5)


def test_without_equilibria_above_a_voltage_the_last_one_is_the_nearest():
    block = Block(0.035, lost=lambda squared: squared > 4.0)
    assert 0.95 * 2000.0 < block.nearest().voltage <= 2000.0
    assert len(block.asked) <= RISES


def test_without_an_equilibrium_at_the_last_voltage_there_is_none():
    with pytest.raises(StepFailed):
        Block(0.035, lost=lambda squared: True).nearest()


@pytest.mark.parametrize(("wish", "reached"), [(0.0275, 0.0272), (0.0315, 0.0322)])
def test_at_a_jump_of_the_force_the_nearer_side_is_taken(wish, reached):
    """At 3 kV the attraction grows by 0.0125 N/mm, so that 0.0272 N/mm are followed by 0.0322."""
    block = Block(wish, jump=0.0125)
    assert block.nearest().force == pytest.approx(reached, rel=1e-6)
    assert len(block.asked) <= RISES + TRIALS + 2
    assert FAILURES < RISES
