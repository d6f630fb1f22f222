"""Fig. 11 in its quick version, and the shortcuts it takes: what replaces a run by a cheaper one."""

from dataclasses import replace

import numpy as np
import pytest

from evfem.scene.motion import Press, VoltageRamp
from evfem.simulation.run import simulate
from evfem.studies import pressing

PAD = pressing.Pad(resolution="coarse")

pytestmark = pytest.mark.slow


def curve(folder, name):
    lines = [line.split(",") for line in (folder / "fig11.csv").read_text().splitlines()]
    return np.array([float(y) for series, _, y, _ in lines[1:] if series == name])


def test_air_matters_more_with_ridges_and_less_under_load(study):
    # design notes, smooth pad whatever the mesh: 1.08, 0.30 and 0.195 at 0.01, 0.05 and 0.1 N/mm
    result, folder = study("fig11")
    smooth = curve(folder, "base without_ridges relative contribution")
    assert smooth == pytest.approx([1.08, 0.30, 0.195], rel=0.08)
    ridged = curve(folder, "base with_ridges relative contribution")
    assert np.all(ridged > 1.8 * smooth)
    assert np.all(np.diff(ridged) < 0.0)
    numbers = result["numbers"]
    for pad, ratio in (("with_ridges", ridged), ("without_ridges", smooth)):
        # a share of the total, so r / (1 + r)
        assert numbers[f"{pad}.air_share_at_0.05"] == pytest.approx(ratio[1] / (1.0 + ratio[1]))
        fitted = numbers[f"{pad}.alpha"] * np.array([0.01, 0.05, 0.1]) ** -numbers[f"{pad}.beta"]
        assert fitted == pytest.approx(ratio, rel=0.15)


def test_plate_of_panel_b_by_hand(study):
    # eps_0 U^2 / 2 / (0.38/1650 + 0.09/3.35) / 0.47 mm^2 times 107.626 mm^2 at 1 N, over 10 mm
    line = curve(study("fig11")[1], "(7) gross area")
    pressure = 8.8541878e-12 * 1e6 / 2.0 / (0.38 / 1650.0 + 0.09 / 3.35) / 0.47
    assert line[-1] == pytest.approx(10.7626 * pressure, rel=1e-6)


def test_runs_with_the_load_held_give_what_the_cheaper_runs_give():
    # (10) is evaluated on the state without voltage, (9b) with voltage from the start: without friction
    # both must be what a press, then a voltage with the load held, gives
    rest = pressing.Case(PAD, (0.03, 0.05))
    on = pressing.Case(PAD, (0.03, 0.05), voltage=1000.0)
    scene = on.scene(Press(force=0.05, steps=2), VoltageRamp(1000.0, steps=1, hold="force"), voltage=0.0)
    held = simulate(scene)
    assert held.applied_force[-1] == pytest.approx(0.05, rel=1e-9)
    pressed = pressing.run(on)
    assert pressed.force[-1] == pytest.approx(held.electrostatic_force[-1], rel=1e-6)
    assert pressed.total(1000.0, "kaczmarek") == pytest.approx(pressed.force, rel=1e-9)
    dry = simulate(replace(scene, air_layer=False))
    without = pressing.run(rest)
    nodal = without.contact_only(1000.0, "kaczmarek", nodal=True)
    assert nodal[-1] == pytest.approx(dry.electrostatic_force[-1], rel=1e-6)
    # every touching ridge loses part of an element at the interpolated edge; none gains as much
    touching = np.count_nonzero(np.diff(without.touching[-1].astype(int)) == 1)
    lost = nodal[-1] - without.contact_only(1000.0, "kaczmarek")[-1]
    assert abs(lost) < touching * 0.0417 * nodal[-1] / without.widths()[0][-1]
