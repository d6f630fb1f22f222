"""The picture of a fit's residuals: their values, signs, units and names."""

from pathlib import Path

import numpy as np
import pytest

from evfem import plotting
from evfem.calibration.parameters import Parameter
from evfem.calibration.result import FitResult


def fitted(with_sd):
    """Three forces and two widths, computed 1, -2, 3, -4 and 5 sd beside what was measured."""
    measured, scale = np.array([10.0, 20.0, 30.0, 4.0, 5.0]), np.array([2.0, 2.0, 2.0, 0.5, 0.5])
    names = [f"normal_force at indentation {x}" for x in (0.1, 0.2, 0.3)]
    names += [f"contact_width.last, motion.0.gap {x}" for x in (0.1, 0.2)]
    return FitResult(
        parameters={"surface.friction": Parameter(0.1, 1.0)},
        values={"surface.friction": 0.3},
        unknowns=np.zeros(1),
        errors=np.ones(1),
        correlation=np.eye(1),
        singular_values=np.ones(1),
        names=names,
        measured=measured,
        predicted=measured + scale * np.array([1.0, -2.0, 3.0, -4.0, 5.0]),
        scale=scale,
        warnings=(),
        tables={},
        paths=Path(),
        provenance={"sd": with_sd},
    )


@pytest.mark.parametrize(("with_sd", "factor", "unit"), [(True, 1.0, "sd"), (False, 100.0, "%")])
def test_residuals_are_computed_minus_measured_over_their_scale(with_sd, factor, unit):
    ax = plotting.residuals(fitted(with_sd))
    drawn = {line.get_label(): line.get_xydata() for line in ax.lines if line.get_marker() == "o"}
    assert list(drawn) == ["normal force", "contact width"]
    np.testing.assert_allclose(drawn["normal force"], [[1, factor], [2, -2 * factor], [3, 3 * factor]])
    np.testing.assert_allclose(drawn["contact width"], [[4, -4 * factor], [5, 5 * factor]])
    assert f"({unit}" in ax.get_ylabel()
    bands = [patch for patch in ax.patches if patch.get_label() == "two standard deviations"]
    assert len(bands) == with_sd
