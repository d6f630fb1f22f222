"""The paper's tables: complete, with units and source, and the statistics the paper prints of them."""

import numpy as np
import pytest
from tools.refusals import refuses

from evfem import data


@pytest.mark.parametrize("name", data.NAMES)
def test_every_table_says_where_it_comes_from_and_in_which_units(name):
    table = data.load(name)
    assert "accepted manuscript" in table.source or "doi" in table.columns
    assert table.title
    numeric = [column for column, values in table.columns.items() if isinstance(values, np.ndarray)]
    assert numeric
    assert table.units or "unit" in table.columns


def test_participants_reproduce_the_printed_statistics():
    table = data.load("table1")
    assert len(table["participant"]) == 11
    # notes: means 1.81 / 2.95 / 1.31(7), medians 1.85 / 2.73 / 1.37, deviations 0.547 / 1.07 / 0.558 mN
    cases = ("HVHD", "HVLD", "LVLD")
    assert [round(float(np.mean(table[c])), 3) for c in cases] == [1.805, 2.946, 1.317]
    assert [float(np.median(table[c])) for c in cases] == [1.85, 2.73, 1.37]
    assert [float(f"{np.std(table[c], ddof=1):.3g}") for c in cases] == [0.547, 1.07, 0.558]
    means = [float(np.mean(table[axis])) for axis in "abc"]
    assert [round(mean, 2) for mean in means] == [16.68, 12.79, 26.05]
    assert round(means[2] * np.cos(np.radians(30.0)), 2) == 22.56


def test_unknown_names_list_what_exists():
    refuses("table1, table2", data.load, "table3")
    refuses("E_sc", data.load("table2").value, "E_bone")
    refuses("HVHD", lambda: data.load("table1")["LVHD"])
