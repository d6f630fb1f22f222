"""The notebooks, run as scripts in a folder of their own: what they find, and what they leave behind."""

import json
import re
import runpy
import sys
from pathlib import Path

import numpy as np
import pytest

from evfem.studies.hovering_people import participant_forces

NOTEBOOKS = Path(__file__).parents[2] / "studies" / "notebooks"
NAMES = (
    "compare_participants",
    "compare_two_presses",
    "design_a_voltage_signal",
    "explore_a_scene",
    "lecture",
)


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """name -> what the notebook leaves in its namespace, and its folder; each is run once."""
    found = {}

    def run(name):
        if name not in found:
            folder = tmp_path_factory.mktemp(name)
            with pytest.MonkeyPatch.context() as patch:
                patch.chdir(folder)
                patch.setenv("MPLBACKEND", "Agg")
                patch.setitem(sys.modules, "ipywidgets", None)  # as where it is not installed
                found[name] = runpy.run_path(str(NOTEBOOKS / f"{name}.py")), folder
        return found[name]

    return run


@pytest.mark.parametrize("name", NAMES)
def test_a_notebook_is_cells_with_a_title_and_no_output(name):
    text = (NOTEBOOKS / f"{name}.py").read_text(encoding="utf-8")
    cells = re.split(r"^# %%", text, flags=re.M)
    assert "format_name: percent" in cells[0]
    assert cells[1].startswith(" [markdown]\n# # ")
    assert len(cells) > 8
    assert f"`{name}.py`" in (NOTEBOOKS / "README.md").read_text(encoding="utf-8")


def test_all_notebooks_are_here_as_text():
    assert sorted(p.stem for p in NOTEBOOKS.glob("*.py")) == sorted(NAMES)
    assert not list(NOTEBOOKS.glob("*.ipynb"))


def test_the_explored_scene_balances(ran):
    found, _ = ran("explore_a_scene")
    result = found["result"]
    assert np.abs(found["balance"]).max() < 1e-8 * result.normal_force.max()
    assert result.tangential_force[-1] == pytest.approx(0.3 * result.normal_force[-1], rel=1e-6)
    assert found["controls"] is None
    more = found["slide"](voltage=2000.0, distance=0.2)
    assert more.electrostatic_force[2] > 3.5 * result.electrostatic_force[2]  # about U^2, and the pad follows


def test_the_designed_signal_does_what_was_wished(ran):
    found, folder = ran("design_a_voltage_signal")
    closed, exact = (found["comparisons"][name] for name in ("closed form", "exact"))
    assert closed.pearson > 0.99
    assert exact.relative_l2 < 0.5 * closed.relative_l2
    # in full slip there is a voltage for every wish
    slipping = exact.position > max(found["real"].full_slip, 1.0)
    assert np.abs(exact.error[slipping]).max() < 1e-8
    assert found["felt"].friction[-1] == pytest.approx(0.6, rel=1e-6)
    assert found["rounding"] <= 0.5 * 2500.0 / 32767 * (1 + 1e-9)
    assert sorted(path.name for path in folder.iterdir()) == ["signal.csv", "signal.hjif", "signal.wav"]
    assert json.loads((folder / "signal.hjif").read_text())["perceptions"]


def test_the_lecture_ends_in_full_slip_under_the_voltage(ran):
    """Coulomb: friction is 0.3 times load and attraction; all figures have the same scales."""
    found, folder = ran("lecture")
    last = found["result"].rows[-1]
    wanted = 0.3 * (0.05 + last["electrostatic_force"])
    assert last["tangential_force"] == pytest.approx(wanted, rel=1e-6)
    assert found["coefficient"] > 0.32
    limits = {tuple((*ax.get_xlim(), *ax.get_ylim()) for ax in one.axes) for one in found["figures"]}
    assert len(limits) == 1
    assert not list(folder.iterdir())


def test_the_compared_participants_are_those_of_fig_5(ran):
    """Fig. 5's closed forms (HVLD), and what ridges and deformation may change."""
    found, folder = ran("compare_participants")
    chosen, forces = found["chosen"], participant_forces()
    for name in ("kaczmarek", "strong_troxel"):
        assert found["closed"][name] == pytest.approx(forces[name, "HVLD"], rel=1e-9)
        change = found["computed"][name] / found["closed"][name][chosen] - 1.0
        assert -0.07 < change.min() <= change.max() < 0.0
    assert not list(folder.iterdir())


def test_the_neuron_of_two_presses_is_the_published_one(ran):
    """Roots of its equations by an event solver: interval under 30 kPa, spikes of a ramp to 20 kPa."""
    found, folder = ran("compare_two_presses")
    assert found["interval"] == pytest.approx(242.38032041, abs=0.1)
    ramp = found["ramp"]
    assert ((ramp <= 100.0).sum(), (ramp > 100.0).sum()) == (3, 23)
    assert (ramp[0], ramp[-1]) == (pytest.approx(51.103350, abs=0.05), pytest.approx(1921.137820, abs=0.1))
    steep = found["spikes"](np.array([0.0, 20.0, 2020.0]), np.array([0.0, 40.0, 40.0]))
    assert ((steep <= 20.0).sum(), (steep > 20.0).sum()) == (2, 59)
    assert (steep[0], steep[-1]) == (pytest.approx(12.197205, abs=0.05), pytest.approx(1963.067494, abs=0.2))
    fast, slow = (np.diff(found["fired"][name]).min() for name in ("in 50 ms", "in 500 ms"))
    assert fast < slow
    assert found["stimulus"]["trace"].shape[0] == len(found["stimulus"]["location"])
    assert not list(folder.iterdir())
