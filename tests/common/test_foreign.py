"""Tables of Excel and MATLAB: read as the same numbers in a csv file are.

scipy 1.17 writes and reads version 5 of MATLAB's format, and refuses 7.3; openpyxl 3.1 takes the extent in
the head of a sheet for true (its page "Optimised modes"), which LabVIEW and others leave at A1.
"""

import re
import zipfile

import numpy as np
import pytest
from scipy.io import savemat
from tools.commands import printed
from tools.refusals import refuses

import evfem as ev
from evfem.common.foreign import cells_of
from evfem.textures.importers import importer_of

TRAVEL, LOAD = np.array([0.0, 100.0, 200.0, 0.1 + 0.2]), np.array([0.0, 12.0, 31.5, 1e-3])
COLUMNS = {"indentation": "travel", "normal_force": "load"}


def curve(path, **more):
    found = ev.MeasuredCurve.from_csv(path, columns=COLUMNS, branch="loading", **more)
    return found.at.tolist(), found.values.tolist()


@pytest.fixture
def right(tmp_path):
    """The numbers of the same table as csv."""
    rows = "".join(
        f"{travel!r},{load!r}\n" for travel, load in zip(TRAVEL.tolist(), LOAD.tolist(), strict=True)
    )
    (tmp_path / "right.csv").write_text(f"travel_um,load_mN\n{rows}")
    found = curve(tmp_path / "right.csv")
    assert found[0] == pytest.approx([0.0, 0.1, 0.2])
    return found


@pytest.mark.parametrize(
    "content",
    [
        {"load_mN": LOAD, "travel_um": TRAVEL, "rate": 1000.0, "who": "me", "pair": np.array([1.0, 2.0])},
        {"load_mN": LOAD[:, None], "travel_um": TRAVEL[None]},
        {"test": {"travel_um": TRAVEL, "load_mN": LOAD, "inner": {"time": np.arange(4.0)}}},
        {
            "data": np.column_stack([TRAVEL, LOAD]),
            "colheaders": np.array(["travel [um]", "load [mN]"], dtype=object),
        },
    ],
)
def test_a_file_of_matlab_has_vectors_a_struct_or_a_matrix(tmp_path, right, content):
    savemat(tmp_path / "a.mat", content)
    assert curve(tmp_path / "a.mat") == right


def test_a_matrix_without_names_has_numbers_for_them(tmp_path, right):
    savemat(tmp_path / "a.mat", {"data": np.column_stack([TRAVEL / 1e3, LOAD / 1e3])})
    found = ev.MeasuredCurve.from_csv(
        tmp_path / "a.mat", columns={"indentation": 1, "normal_force": 2}, branch="loading"
    )
    assert found.at.tolist() == right[0]
    assert found.values.tolist() == pytest.approx(right[1], rel=1e-15)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (
            {"who": "me"},
            "a.mat with 0 vectors and 0 matrices; allowed: vectors of one length, .*table2struct",
        ),
        ({"a": np.eye(3), "b": np.eye(3)}, "a.mat with 0 vectors and 2 matrices"),
        (
            {"one": {"indentation": [0.1, 0.2], "force": [1.0, 2.0]}, "two": {"force": [3.0, 4.0]}},
            "a.mat with two variables force; allowed: one struct",
        ),
        (b"MATLAB 7.3 MAT-file".ljust(124) + b"\0\2IM" + bytes(500), "a.mat, of version 7.3; allowed: save"),
        (b"nothing", "a.mat .damaged or of another kind"),
    ],
)
def test_what_is_no_table_of_matlab_is_refused(tmp_path, content, said):
    if isinstance(content, bytes):
        (tmp_path / "a.mat").write_bytes(content)
    else:
        savemat(tmp_path / "a.mat", content)
    refuses(said, curve, tmp_path / "a.mat")


def test_tables_of_matlab_are_read_wherever_csv_is(tmp_path):
    place = tmp_path / "a.mat"
    savemat(place, {"voltage_kV": [0.0, 1.0, 4.0], "time_ms": [0.0, 1.0, 2.0], "rate": 1000.0})
    assert ev.load(place).voltage.tolist() == [0.0, 1000.0, 4000.0]
    savemat(place, {"voltage": [0.0, 1.0], "position": [0.0, 2.0], "more": [1.0, 1.0]})
    assert ev.load(place)(1.0) == 0.5
    savemat(place, {"height_um": [0.0, 5.0], "x": [0.0, 2.0]})
    assert ev.Profile.from_csv(place).samples.tolist() == [0.0, 0.005]
    savemat(place, {"frequency_kHz": [1.0, 2.0], "eps_r": [9.0, 8.0], "conductivity": [0.1, 0.2]})
    drive = ev.Drive(frequency=1000.0, skin=str(place))
    assert np.real(drive.skin.permittivity(1000.0)) == pytest.approx(9.0)
    savemat(place, {"z": np.zeros(9), "x": np.arange(9.0)})
    assert importer_of(place)[0] == "csv"
    savemat(place, {"acceleration": np.zeros(20), "time": np.arange(20.0)})
    assert importer_of(place)[0] == "recording"


def test_a_csv_file_loads_no_reader_of_others(tmp_path):
    (tmp_path / "ramp.csv").write_text("position,voltage\n0,0\n1,9\n")
    code = f"import evfem as ev\nprint(ev.load({str(tmp_path / 'ramp.csv')!r})(1.0))\n"
    assert printed(f"{code}print({{'scipy.io', 'openpyxl'}} & sys.modules.keys())") == "9.0\nset()"
    refuses("a.xlsx .No such file", cells_of, tmp_path / "a.xlsx", "data", "a table")


@pytest.mark.others
def test_a_workbook_is_read_as_excel_shows_it(tmp_path, right):
    import openpyxl

    book = openpyxl.Workbook()
    sheet = book.active
    for row in (["Test 1"], [], [None, "Travel\n[um]", None, "Load\t(mN)", "Remark"]):
        sheet.append(row)
    for travel, load in zip(TRAVEL.tolist(), LOAD.tolist(), strict=True):
        sheet.append([None, travel, None, load, None])
    book.create_sheet("notes").append(["no numbers"])
    book.save(tmp_path / "a.xlsx")
    assert curve(tmp_path / "a.xlsx") == right
    with zipfile.ZipFile(tmp_path / "a.xlsx") as old, zipfile.ZipFile(tmp_path / "b.xlsx", "w") as new:
        for name in old.namelist():
            short = re.sub(rb'(<dimension ref=)"[^"]*"', rb'\1"A1"', old.read(name))
            new.writestr(name, short.replace(b"<v>12</v>", b"<f>6*2</f><v>12</v>"))  # as Excel stores it
    assert curve(tmp_path / "b.xlsx") == right
    lettered = {"indentation": 2, "normal_force": 4}  # B and D
    found = ev.MeasuredCurve.from_csv(tmp_path / "a.xlsx", columns=lettered, branch="loading")
    assert found.values.tolist() == right[1]
    book.create_sheet("more").append([1, 2])
    book.save(tmp_path / "a.xlsx")
    refuses(r"a.xlsx with 2 sheets with numbers \(Sheet, more\)", curve, tmp_path / "a.xlsx")
    book = openpyxl.Workbook()
    book.active.append(["=1+1", "=2+2"])  # no program has computed them
    book.save(tmp_path / "a.xlsx")
    refuses("a.xlsx with no numbers; .*formulas with the values", curve, tmp_path / "a.xlsx")


@pytest.mark.others
def test_values_of_runs_and_a_german_table_in_a_workbook(tmp_path):
    import openpyxl

    book = openpyxl.Workbook()
    for row in (["motion.0.gap [um]", "electrostatic_force.last"], [250, "0,00041"], [500, "0,0002"]):
        book.active.append(row)
    book.active.append([None, 1])
    book.save(tmp_path / "a.xlsx")
    gap = "data.motion.0.gap: given .* in um; allowed: a number in each row"
    refuses(gap, ev.MeasuredValues.from_csv, tmp_path / "a.xlsx")
    sheet = book.active
    sheet.delete_rows(4)
    sheet["B2"], sheet["B3"] = 4.1e-4, 2e-4
    book.save(tmp_path / "a.xlsx")
    found = ev.MeasuredValues.from_csv(tmp_path / "a.xlsx")
    assert found.where == {"motion.0.gap": [0.25, 0.5]}
    assert found.values.tolist() == [4.1e-4, 2e-4]
    sheet["A1"], sheet["B1"], sheet["B2"], sheet["B3"] = (
        "indentation [um]",
        "normal_force",
        "1.000,5",
        "2.000",
    )
    book.save(tmp_path / "a.xlsx")
    assert ev.MeasuredCurve.from_csv(tmp_path / "a.xlsx").values.tolist() == [1000.5, 2000.0]
