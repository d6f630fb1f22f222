"""The search for the voltage of a given charge."""

import pytest

from evfem.solver.voltage import VoltageSearch


def searched(needed, start=0.0, most=40):
    """The voltages that a search tries where the pad under the voltage u needs `needed(u)`."""
    search, tried = VoltageSearch(start, 1e-8), []
    while len(tried) < most:
        tried.append(search.voltage)
        if search.settles(needed(search.voltage)):
            return tried, "settled"
        if search.jumps:
            return tried, "jumps"
    return tried, "goes on"


@pytest.mark.parametrize(("stiffness", "root"), [(0.3, 100.0 / 1.3), (1.0, 50.0), (4.0, 20.0), (-0.5, 200.0)])
def test_a_voltage_is_found_where_a_charge_takes_it(stiffness, root):
    """Substitution alone settles only for slopes below one in size."""
    tried, end = searched(lambda voltage: 100.0 - stiffness * voltage)
    assert end == "settled"
    assert tried[-1] == pytest.approx(root, rel=1e-8)
    assert len(tried) < 12


def test_a_bend_is_searched_between_what_was_too_low_and_too_high():
    """The secant alone goes round over it for ever."""
    tried, end = searched(lambda voltage: min(112.0, 112.0 - 20.0 * (voltage - 70.0)), start=56.0)
    assert end == "settled"
    assert tried[-1] == pytest.approx(72.0, rel=1e-8)


def test_a_pad_that_snaps_between_two_voltages_ends_the_search():
    """Below 72.7 V the charge takes more, above it less: no voltage in between settles."""
    tried, end = searched(lambda voltage: 120.0 - voltage / 2.0 if voltage < 72.7 else 20.0)
    assert end == "jumps"
    assert tried[-1] == pytest.approx(72.7, rel=2e-3)
    assert len(tried) < 25
