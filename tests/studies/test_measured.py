"""Measurements of others beside predictions: the page has the numbers of the file, and the file those of the
study. Nothing here asks whether prediction and measurement agree.
"""

import json
import re
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

import evfem as ev
from evfem import data
from evfem.studies import common, frequency
from evfem.studies.fingertip import force_on
from evfem.studies.measured import hovering, moving, pressed, touching
from evfem.studies.measured.study import LEFT_OUT, words
from evfem.studies.measured.table import Experiment, Row, numbers_of
from evfem.surface.skin import make_skin

DOCS = Path(__file__).parents[2] / "docs"
KEPT = json.loads((DOCS / "results/measured.json").read_text(encoding="utf-8"))
PAGE = (DOCS / "measurements.md").read_text(encoding="utf-8")
NUMBERS, SAID = KEPT["numbers"], KEPT["assumptions"]["experiments"]
ROWS = [row["name"] for one in SAID for row in one["rows"]]
SIGNS = [row["name"] for one in SAID for row in one["signs"]]
WORDS = [
    value for room in (hovering, touching, pressed, moving) for value in vars(room).values()
    if isinstance(value, Experiment)
]  # fmt: skip
#: those that take no finite elements
QUICK = (touching.meyer, touching.clutch, touching.sliding, touching.leaking)
EPS_0 = 8.8541878e-12


def test_the_page_has_every_row_of_the_file_and_no_other():
    table = dict(re.findall(r"^\| `([\w.]+)` \|(.+)\|$", PAGE, re.M))
    assert sorted(table) == sorted([*ROWS, *SIGNS])
    for name in ROWS:
        predicted, measured, ratio = (cell.split()[0].strip(",") for cell in table[name].split("|"))
        assert float(predicted) == pytest.approx(NUMBERS[f"{name}.predicted"], rel=6e-3)
        assert float(measured) == pytest.approx(NUMBERS[f"{name}.measured"], rel=6e-3)
        assert float(ratio) == pytest.approx(NUMBERS[f"{name}.ratio"], rel=6e-3, abs=6e-3)


def test_every_ratio_is_predicted_over_measured():
    for name in ROWS:
        of = {key: NUMBERS[f"{name}.{key}"] for key in ("predicted", "measured", "ratio", "predicted_error")}
        assert of["ratio"] == pytest.approx(of["predicted"] / of["measured"], rel=1e-12)
        assert 0.0 <= of["predicted_error"] < 3.0 * of["predicted"]
    for name in ROWS:
        if f"{name}.measured_low" in NUMBERS:
            assert NUMBERS[f"{name}.measured_low"] < NUMBERS[f"{name}.measured"]
            assert NUMBERS[f"{name}.measured"] < NUMBERS[f"{name}.measured_high"]
    row = Row("a.b", "", "N", predicted=3.0, error=0.1, measured=2.0, low=1.0, high=4.0)
    other = Experiment(*10 * [""], rows=(row,))
    assert numbers_of([other]) == pytest.approx(
        {"a.b.predicted": 3.0, "a.b.predicted_error": 0.3, "a.b.measured": 2.0, "a.b.ratio": 1.5,
         "a.b.measured_low": 1.0, "a.b.measured_high": 4.0}
    )  # fmt: skip


def test_every_publication_says_all_and_is_in_the_bibliography():
    """Only the paper itself has no doi: it is a manuscript."""
    bibliography = (DOCS / "bibliography.md").read_text(encoding="utf-8")
    assert len(WORDS) == len(SAID)
    assert [one.source for one in WORDS if not one.doi] == ["The paper, Table 1: eleven fingers"]
    for one in WORDS:
        assert one.doi in bibliography
        empty = [each.name for each in fields(one) if getattr(one, each.name) == "" and each.name != "doi"]
        assert empty == []
        assert one.told().items() >= {"fitted": one.fitted, "sceptic": one.sceptic}.items()
    assert {doi for who in LEFT_OUT for doi in re.findall(r"10\.[\w./-]+\w", who)} <= set(
        re.findall(r"10\.[\w./-]+\w", bibliography)
    )


def test_the_words_of_the_file_are_todays():
    """`evfem study measured --out FOLDER` and `python docs/measured.py FOLDER` write it anew."""
    kept = {one["title"]: one for one in SAID}
    for one in WORDS:
        told = one.told()
        own = kept[one.title]
        assert {key: value for key, value in told.items() if isinstance(value, str)}.items() <= own.items()


@pytest.mark.parametrize("room", QUICK, ids=lambda room: room.__name__)
def test_the_kept_numbers_are_those_of_today(room):
    for key, value in numbers_of([room()]).items():
        assert value == pytest.approx(NUMBERS[key], rel=1e-9), key


def test_the_kept_thresholds_are_those_of_today_over_the_kept_area():
    for key, value in numbers_of([touching.thresholds([NUMBERS["gross_area.0.5N.predicted"]])]).items():
        if not key.endswith("error"):
            assert value == pytest.approx(NUMBERS[key], rel=1e-9), key


def test_thresholds_by_hand():
    """Equal force with both films gives s = (s3 73 - s2 110)/(110 - 73); 0.11 F = eps0 A U^2/(2 (s + s_i)^2)
    with Adams' area gives U.
    """
    s2, s3 = 12.7 / 4.5, 25.4 / 4.5  # um
    gap = (s3 * 73.0 - s2 * 110.0) / (110.0 - 73.0)
    assert gap == pytest.approx(2.7459, abs=1e-4)
    area = 107.626 * 0.5**0.52 * 1e-6
    for film, s in (("half_mil", s2), ("one_mil", s3)):
        volt = 1e-6 * (gap + s) * np.sqrt(2.0 * 0.11 * 0.5 / (EPS_0 * area))
        assert NUMBERS[f"threshold.{film}.predicted"] == pytest.approx(volt, rel=1e-6)
        own = NUMBERS["gross_area.0.5N.predicted"] * 1e-6
        assert NUMBERS[f"threshold_by_fingertip.{film}.predicted"] == pytest.approx(
            volt * np.sqrt(area / own), rel=1e-3
        )


def test_hovering_fingers_are_those_of_the_closed_forms():
    """Tilted, columns over the turned ellipsoid against those at the nodes of a mesh (4 % off where cells are
    wide); untilted, by another quadrature (polar, 0.1 %).
    """
    finger = ev.Fingertip(resolution="medium", ridges="none", posture=30.0, length=26.05)
    skin = make_skin(mesh := finger.mesh())
    flat = {"strong_troxel": (2.446, 5.093, 2.546), "kaczmarek": (1.673, 2.848, 1.423)}
    for law, forces in flat.items():
        for (case, (voltage, gap)), force in zip(common.CASES.items(), forces, strict=True):
            assert NUMBERS[f"hover_flat.{law}.{case}.predicted"] == pytest.approx(force, rel=1e-3)
            nodal = force_on(finger, mesh, skin, common.LAWS[law], voltage, gap)
            assert NUMBERS[f"hover_30deg.{law}.{case}.predicted"] == pytest.approx(nodal, rel=0.04)


def test_the_impedance_by_hand():
    """Gap over layers in series at 1 kHz with Gabriel's dry skin, 2.62 um beside 1 um / 3.9 and 0.3 mm."""
    w = 2.0 * np.pi * 1e3
    skin = 4.0 + 32.0 / (1.0 + 7.234e-12j * w) + 1100.0 / (1.0 + (32.481e-9j * w) ** 0.8)
    skin += 2e-4 / (1j * w * EPS_0)
    layers = 1e-3 / 3.9 + 0.3 / skin
    gap = touching.series_gap() - 0.2 / 1650.0
    air = 1.0 + 1e-8 / (1j * w * EPS_0)
    by_hand = abs((gap / air + layers) / layers)
    assert NUMBERS["sliding_impedance.predicted"] == pytest.approx(by_hand, rel=1e-3)


def test_the_powers_of_the_clutch_are_fits_to_its_published_capacities():
    table = data.load("others")
    for name, values in frequency.CLUTCH.items():
        power = np.polyfit(np.log(frequency.VOLTS), np.log(values), 1)[0]
        assert table.value(f"clutch_{name.replace(' ', '')}") == pytest.approx(power, abs=0.011)


def test_measured_medians_are_those_of_table_1():
    for case, median in {"HVHD": 1.85, "HVLD": 2.73, "LVLD": 1.37}.items():
        assert NUMBERS[f"hover_30deg.kaczmarek.{case}.measured"] == median
    fall = data.load("table1")["LVLD"] / data.load("table1")["HVLD"]
    assert NUMBERS["hover_voltage.measured"] == pytest.approx(sorted(fall)[5], rel=1e-12)
    assert np.sum(fall < 0.5) == 9


@pytest.mark.slow
def test_the_quick_study_has_the_rows_of_the_file(numbers_of):
    """But for those that it leaves out: loads, modes, tissue that stiffens."""
    quick = numbers_of("measured")
    left = {key for key in NUMBERS if key not in quick}
    flatter = {"gross_area_flatter", "load_index_flatter"}
    assert {key.split(".")[0] for key in left} == flatter | {
        "gross_area",
        "modes_below_250Hz",
        "area_in_slip",
    }
    assert set(quick) <= set(NUMBERS)
    for key in ("hover_30deg.kaczmarek.HVLD.predicted", "gross_area.0.5N.predicted"):
        assert quick[key] == pytest.approx(NUMBERS[key], rel=0.1)
    areas = [NUMBERS[f"gross_area.{load:g}N.predicted"] for load in pressed.LOADS]
    assert areas == sorted(areas)


def test_the_picture_has_words_for_its_rows():
    """Without the law, which is a colour; a load of 0.1 N keeps its point."""
    names = {
        "hover_30deg.strong_troxel.HVHD": ("strong_troxel", "hover 30deg, HVHD"),
        "gross_area.0.1N": ("", "gross area, 0.1N"),
        "meyer.kaczmarek": ("kaczmarek", "meyer"),
    }
    for name, (law, shown) in names.items():
        assert words(Row(name, "", "", 1.0, 0.1, 1.0, law=law)) == shown
