"""An impedance is drawn as magnitude and phase, with units."""

import numpy as np
import pytest

from evfem.errors import InputError
from evfem.plotting import impedance
from evfem.response.impedance import Impedance


def made(unit="N/mm"):
    return Impedance(np.array([1.0, 10.0, 100.0]), np.array([1.0, 1.0 + 1.0j, -2.0]), "normal", unit)


def test_magnitude_and_phase():
    upper, lower = impedance({"one": made(), "other": made()})
    np.testing.assert_allclose(upper.get_lines()[0].get_ydata(), [1.0, np.sqrt(2.0), 2.0])
    np.testing.assert_allclose(lower.get_lines()[1].get_ydata(), [0.0, 45.0, 180.0])
    assert upper.get_ylabel() == "magnitude (N/mm)"
    assert lower.get_xlabel() == "frequency (Hz)"
    assert lower.get_legend() is None
    assert len(impedance(made())) == 2


@pytest.mark.parametrize("found", [{}, {"one": made(), "other": made("N/mm per mm")}])
def test_what_cannot_be_drawn_together_is_refused(found):
    with pytest.raises(InputError, match="found: given"):
        impedance(found)
