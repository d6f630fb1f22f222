"""Results as data sets of xarray: names, units and every number."""

import sys

import numpy as np
import pytest
from tools.fakes import fake_result

from evfem.errors import InputError
from evfem.simulation.result import CELL_FIELDS, POINT_FIELDS


@pytest.mark.xarray
def test_a_data_set_has_every_column_and_field_with_its_unit():
    result = fake_result()
    found = result.to_xarray()
    assert {name for name in result.columns if name != "step"} <= set(found.data_vars)
    for name in result.columns[1:]:
        np.testing.assert_array_equal(found[name], result[name])
        assert found[name].dims == ("step",)
        assert found[name].attrs["units"] == result.units[name]
    assert found.step.values.tolist() == result.step.tolist()
    last = found.sel(frame=result.frames[-1].step)
    for name in (*POINT_FIELDS, *CELL_FIELDS, "displacement"):
        found_as = f"{name}_of_nodes" if name in result.columns else name
        np.testing.assert_array_equal(last[found_as], getattr(result.frames[-1], name))
    np.testing.assert_array_equal(last.displacement.sel(axis="y"), result.frames[-1].displacement[:, 1])
    np.testing.assert_array_equal(last.cauchy_stress.sel(stress="xy"), result.frames[-1].cauchy_stress[:, 3])
    assert (found.gap.attrs["units"], found.contact_pressure.attrs["units"]) == ("mm", "MPa")
    np.testing.assert_array_equal(found.y, result.mesh.points[:, 1])


def test_without_xarray_a_sentence_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(InputError, match=r"no xarray; allowed: pip install 'evfem\[xarray\]', or table\(\)"):
        fake_result().to_xarray()
