"""The mean of a column: that of the integral over time or path, wherever the steps end."""

import math

import numpy as np
import pytest
from tools.meshes import block

import evfem as ev
from evfem.simulation.history import COLUMNS
from evfem.simulation.result import Result
from evfem.sweeps.means import mean
from evfem.sweeps.run import output

RATIO, SECONDS, LONG = 1.5, 0.4, 5.0


def made(**columns):
    """A result of rows in which nothing is but these columns."""
    count = len(next(iter(columns.values())))
    rows = [dict.fromkeys(COLUMNS, 0) | {"motion": "wait", "step": i + 1} for i in range(count)]
    for name, values in columns.items():
        for row, value in zip(rows, values, strict=True):
            row[name] = value
    return Result.from_rows(rows, [], block(), {})


def test_a_decay_in_growing_steps_has_its_mean_over_time():
    """Of exp(-t / T) from 0 to L it is (1 - exp(-L / T)) T / L; that of the rows is above 0.5."""
    time = np.append(0.0, np.geomspace(LONG / 1000.0, LONG, 200))
    result = made(time=time, applied_force=np.exp(-time / SECONDS))
    found, over = mean(result, "applied_force")
    assert (over, result.applied_force.mean() > 0.5) == ("time", True)
    assert found == pytest.approx(SECONDS / LONG * (1.0 - math.exp(-LONG / SECONDS)), rel=1e-3)


def test_without_time_it_is_over_the_path_and_without_path_over_the_steps():
    """Of s^2 over a path of 1 in uneven steps it is 1/3, there and back too."""
    way = np.linspace(0.0, 1.0, 400) ** 3
    back = np.concatenate([way, way[::-1]])
    for place in (way, back):
        found, over = mean(made(position=0.6 * place, indentation=0.8 * place, voltage=place**2), "voltage")
        assert (found, over) == (pytest.approx(1.0 / 3.0, rel=1e-4), "path")
    ramp = {"motion": ["voltage"] * 3, "indentation": [0.1, 0.2, 0.5], "normal_force": [1.0, 2.0, 6.0]}
    assert mean(made(**ramp), "normal_force") == (3.0, "steps")
    assert mean(made(position=[1.0, 1.1, 9.0], substeps=[1, 2, 6]), "substeps") == (3.0, "steps")


def test_rows_in_which_a_column_is_no_number_do_not_count():
    """A finger that hovers has no coefficient of friction."""
    result = made(time=[1.0, 2.0, 3.0, 4.0], motion_index=[0, 0, 1, 1], friction=[math.nan, 0.1, 0.3, 0.5])
    assert mean(result, "friction") == (pytest.approx(0.3), "time")
    assert [output(result, f"friction.{one}") for one in ("min", "max", "last")] == [0.1, 0.5, 0.5]
    alone = made(time=[1.0, 2.0], friction=[math.nan, math.nan])
    assert [output(alone, f"friction.{one}") for one in ("mean", "max", "last")] == [None] * 3


def test_a_motion_begins_where_the_last_one_ended():
    """Of a straight rise from 1 to 3 it is 2, though the row with 1 belongs to the press."""
    result = made(motion_index=[0, 1], time=[0.0, 1.0], normal_force=[1.0, 3.0])
    assert output(result, "normal_force.mean.1") == 2.0


def test_a_sweep_over_relaxing_tissue_has_the_mean_of_its_branch():
    """Pressed at once and held, the force is F (1 + r exp(-t / T)) of F at rest (both moduli relax)."""
    law = ev.NeoHookean(E=0.1, nu=0.4, relaxation=((RATIO, SECONDS),), bulk_relaxation=True)
    finger = ev.MeshedFinger(block(), {"tissue": law})
    motion = [ev.Press(indentation=1e-3, speed=1e3, steps=1), ev.Wait(LONG, steps=60, spacing="log")]
    scene = ev.Scene(finger, ev.Flat(), motion=motion, solver=ev.Solver(dynamics="viscous"))
    result = ev.simulate(scene)
    at_rest = result.normal_force[0] / (1.0 + RATIO)
    wanted = at_rest * (1.0 + RATIO * SECONDS / LONG * (1.0 - math.exp(-LONG / SECONDS)))
    assert output(result, "normal_force.mean.1") == pytest.approx(wanted, rel=5e-3)
    assert result.normal_force[1:].mean() > 1.5 * wanted


def test_the_mean_power_of_a_source_is_its_work_over_the_time():
    """Rows have means over steps here, and long ones count in full: 28 % more by the trapezoidal rule."""
    drive = ev.Drive(skin="gabriel_dry", gap_conductivity=1e-7, resolved=True)
    motion = [ev.Hover(gap=0.5), ev.Wait(1.0, steps=10, spacing="log")]
    display = ev.Display(insulator=ev.TOUCHSCREEN)
    pad = ev.FingerPad(resolution="coarse", ridges=False)
    result = ev.simulate(ev.Scene(pad, display, ev.StrongTroxel(), 100.0, motion, drive=drive))
    work = result.source_work[-1] - result.source_work[0]
    found, over = mean(result, "power", 1)
    assert over == "time"
    assert found == pytest.approx(1e-3 * work, rel=1e-9)
    square = np.average(result.current_rms[1:], weights=np.diff(result.time))
    assert mean(result, "current_rms", 1)[0] == pytest.approx(square, rel=1e-12)
