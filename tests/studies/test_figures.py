"""The studies in their quick versions: one physical number each, and the files they leave behind."""

import csv
import json
import tomllib
from pathlib import Path

import numpy as np
import pytest

import evfem as ev
from evfem import data, studies
from evfem.electrostatics.laws import Layer, Layers
from evfem.errors import InputError, StorageError
from evfem.reference import cylinder_force
from evfem.studies import common, fingertip, fringe, hovering_people, laws, plots
from evfem.surface.skin import make_skin

CASES = ("HVHD", "HVLD", "LVLD")
QUICK = ["section321", "laws", "fig03", "fig05", "fig06", "fig07", "fig08", "fig09", "fig10"]
QUICK += ["frequency", "hypotheses"]
SLOW = ["fig11", "fig12", "fig13", "participants", "uncertainty", "stability", "work_precision", "fringe"]
SLOW += ["fingertip", "fingerprint", "friction_spectrum", "stick_slip", "relaxation", "impedance"]
SLOW += ["sensitivities", "soft_display", "moisture", "bandwidth", "measured"]


@pytest.mark.filterwarnings("ignore:motion . has steps of")
@pytest.mark.parametrize("name", [*QUICK, *(pytest.param(name, marks=pytest.mark.slow) for name in SLOW)])
def test_study_leaves_numbers_curves_and_picture(name, study):
    result, folder = study(name)
    tables = result["assumptions"].get("tables", {})
    ends = ("csv", "json", "md", "png") if tables else ("csv", "json", "png")
    assert sorted(p.name for p in folder.glob(f"{name}.*")) == [f"{name}.{end}" for end in ends]
    assert json.loads((folder / f"{name}.json").read_text()) == json.loads(json.dumps(result))
    assert list(result) == ["study", "numbers", "paper", "assumptions", "provenance"]
    assert set(result["paper"]) <= set(result["numbers"])
    numbers = {key: value for key, value in result["numbers"].items() if "onset" not in key}  # may not come
    assert all(type(value) is float and np.isfinite(value) for value in numbers.values())
    with (folder / f"{name}.csv").open(newline="") as file:
        rows = list(csv.reader(file))
    assert rows[0] == ["series", "x", "y", "unit"]
    assert all(len(row) == 4 for row in rows)
    assert (folder / f"{name}.png").read_bytes().startswith(b"\x89PNG")
    for lines in tables.values():
        assert len({line.count("|") for line in lines}) == 1
        assert "\n".join(lines) in (folder / f"{name}.md").read_text()


def test_fig05_participants_by_an_independent_integral(numbers_of):
    # equation (8b) or (8a) with (24) for one participant, in plain x and y on a fine midpoint grid in angles
    numbers = numbers_of("fig05")
    a, b, c = 18.20 / 2, 15.00 / 2, 28.40 / 2 * np.cos(np.pi / 6)  # participant ix
    t = (np.arange(1500) + 0.5) / 1500 * np.pi / 2
    gap = 0.25 + 2 * b - b * np.cos(t)[:, None] - b * np.cos(t)
    reduced = 0.38 / 1650 + gap + 0.09 / 3.35
    weight = 4 * a * c * np.cos(t)[:, None] * np.cos(t) * (np.pi / 3000) ** 2
    pull = 8.8541878e-12 * 1414.0**2 / 2 * weight / reduced
    assert numbers["strong_troxel.ix.LVLD_mN"] == pytest.approx(1e3 * np.sum(pull / reduced), rel=1e-6)
    assert numbers["kaczmarek.ix.LVLD_mN"] == pytest.approx(1e3 * np.sum(pull / (0.47 + gap)), rel=1e-6)
    medians = [numbers[f"measured.median_mN.{case}"] for case in CASES]
    assert medians == [1.85, 2.73, 1.37]
    # design notes: rigid smooth outline 0.19761 / 0.40356 / 0.20172 mN/mm, deformation adds 0.4 / 1.6 / 0.8 %
    for case, rigid, added in zip(CASES, (0.19761, 0.40356, 0.20172), (0.004, 0.016, 0.008), strict=True):
        per_mm = numbers[f"fe_smooth.kaczmarek.{case}_mN_at_10mm"] / 10.0
        assert per_mm / rigid - 1.0 == pytest.approx(added, abs=2e-3)
        assert numbers[f"fe.kaczmarek.{case}_mN_at_8mm"] < 8.0 * per_mm  # grooves are farther away


def test_laws_says_what_theory_and_measurement_say(numbers_of):
    numbers = numbers_of("laws")
    assert numbers["verdict.strong_troxel.over_electrostatics"] == pytest.approx(1.0, abs=0.03)
    assert numbers["verdict.kaczmarek.over_electrostatics"] == pytest.approx(0.46, abs=0.01)
    assert numbers["verdict.kaczmarek.median_over_measured.mean"] == pytest.approx(1.0, abs=0.1)
    assert numbers["verdict.strong_troxel.median_over_measured.mean"] > 1.5
    assert round(numbers["contact_pressure_kPa.strong_troxel"], 1) == 24.1


def test_field_of_the_cylinder_over_a_slab():
    # a slab of air only moves the electrode away; a slab of huge permittivity is an electrode itself
    for gap in (0.05, 0.25, 1.0):
        air = laws.cylinder_over_slab(gap, Layer(0.1, 1.0), 8.34, 2000.0)
        assert air == pytest.approx(cylinder_force(gap + 0.1, 8.34, 2000.0), rel=1e-8, abs=0)
    metal = laws.cylinder_over_slab(0.25, Layer(0.1, 1e7), 8.34, 2000.0)
    assert metal == pytest.approx(cylinder_force(0.25, 8.34, 2000.0), rel=1e-5, abs=0)


def test_interval_of_the_median():
    low, high, confidence = common.median_interval(np.arange(11.0))
    # P(third < median < ninth) = 1 - 2 (1 + 11 + 55) / 2^11
    assert (low, high) == (2.0, 8.0)
    assert confidence == pytest.approx(1.0 - 134.0 / 2048.0, rel=1e-14)


@pytest.mark.parametrize("quick", [True, False])
def test_the_picture_of_a_quick_study_says_so_beside_everything_else(quick, tmp_path):
    figure = plots.new_figure(3.0, 4.0)
    figure.add_subplot().set(xlabel="x", ylabel="y")
    plots.panel_letter(figure.axes[0], "a")
    plots.not_shown(figure, "measured points")
    common.Study("one", {}, {}, {}, [], lambda: figure).finish(tmp_path, quick)
    notes = [text for text in figure.texts if text.get_text() == common.QUICK]
    assert len(notes) == int(quick)
    others = [*figure.axes, *(text for text in figure.texts if text not in notes)]
    for note in notes:
        box = note.get_window_extent()
        assert max(part.get_tightbbox().y1 for part in others) < box.y0 < box.y1 <= figure.bbox.y1
        assert 0 <= box.x0 < box.x1 <= figure.bbox.x1


def test_unknown_study_and_unusable_folder(tmp_path):
    with pytest.raises(InputError, match="section321"):
        studies.run("fig99")
    (tmp_path / "file").write_text("")
    with pytest.raises(StorageError, match="folder"):
        studies.run("section321", quick=True, out=tmp_path / "file" / "inside")
    assert data.load("table1").units["c"] == "mm"


def test_every_folder_of_studies_is_packed_into_the_wheel():
    top = next(folder for folder in Path(__file__).parents if (folder / "pyproject.toml").exists())
    packed = tomllib.loads((top / "pyproject.toml").read_text())["tool"]["setuptools"]["packages"]
    folders = (path.parent.relative_to(top) for path in (top / "studies").rglob("__init__.py"))
    assert {f"evfem.{'.'.join(folder.parts)}" for folder in folders} == {
        name for name in packed if name.startswith("evfem.studies")
    }


def test_frequency_has_the_printed_pressures_and_the_ratio_of_the_waveforms(numbers_of):
    """14022.5 and 10.4123 Pa at 1 Hz, 9540.57 Pa at 100 kHz; a square wave fluctuates 13 times as much as
    a sine at 15 Hz, and as much at about 190 Hz; the clutch's losses do not depend on the voltage.
    """
    numbers = numbers_of("frequency")
    assert numbers["mean_Pa.leak_0.1_Hz"] == pytest.approx(14022.5, abs=0.05)
    assert numbers["mean_Pa.gabriel_dry.1_Hz"] == pytest.approx(10.4123, abs=5e-5)
    assert numbers["mean_Pa.gabriel_dry.100000_Hz"] == pytest.approx(9540.57, abs=5e-3)
    assert numbers["model.vardar.square_over_sine.15_Hz"] == pytest.approx(13.0, abs=0.5)
    assert numbers["square_over_sine.equal_at_Hz"] == pytest.approx(190.0, rel=0.03)
    assert numbers["model.nakamura.largest_over_first"] > 1.2
    assert numbers["model.aliabbasi.gap_conductivity_S_per_m"] == pytest.approx(6.815e-8, abs=5e-12)
    assert numbers["published.rauf.fast_over_slow_most"] < 0.655


def test_hypotheses_bring_the_law_down_to_the_measured_median(numbers_of):
    """The lifts by case, back in the law: medians of measured over computed force are (1 - share)^2."""
    numbers = numbers_of("hypotheses")
    forces = hovering_people.participant_forces()
    for case, volts in zip(CASES, (2000.0, 2000.0, 1414.0), strict=True):
        share = numbers[f"lift.median_V.{case}"] / volts
        ratio = np.median(common.participants()[case] / forces["strong_troxel", case])
        assert (1.0 - share) ** 2 == pytest.approx(ratio, rel=1e-9)
        # behind 0.09 mm / 3.35 the charge that makes up for a lift of 1 V
        charge = numbers[f"charge.median_uC_per_m2.{case}"] / numbers[f"lift.median_V.{case}"]
        assert charge == pytest.approx(8.8541878e-12 * 3.35 / 9e-5 * 1e6, rel=1e-6)
        assert 0.05 < numbers[f"distance.median_mm.{case}"] < 0.5


def test_both_ridges_have_the_height_of_the_fingers():
    for shape in ("t7", "sinus"):
        x, height = fringe.ridge(shape, 101)
        assert np.ptp(height) == pytest.approx(0.15)
        assert height[50] == 0.0
        assert x[-1] == 0.5


def test_a_smooth_rigid_pad_has_the_force_of_its_ellipsoid():
    """Kaczmarek's pressure over the ellipse of the lower half, by Gauss's rule in polar coordinates:
    within 0.1 %. The stratum corneum is as thick as below the lowest point.
    """
    finger = ev.Fingertip.participant("ii", "coarse", ridges=False)
    a, b, c = 0.5 * finger.width, 0.5 * finger.height, 0.5 * finger.length
    x, w = np.polynomial.legendre.leggauss(400)
    radius, weight = 0.5 * (1.0 + x), 0.5 * w  # sin of the polar angle
    layers = Layers.of(Layer(0.38, 1650.0), ev.FILM)
    for voltage, gap in ((2000.0, 0.5), (2000.0, 0.25)):
        pressure = ev.Kaczmarek().traction(gap + b * (1.0 - np.sqrt(1.0 - radius**2)), voltage, layers)
        exact = 1e3 * 2.0 * np.pi * a * c * float(weight @ (radius * pressure))
        mesh = finger.mesh()
        own = fingertip.force_on(finger, mesh, make_skin(mesh), ev.Kaczmarek(), voltage, gap)
        assert own == pytest.approx(exact, rel=1e-3)
