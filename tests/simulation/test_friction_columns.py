"""Friction of the whole contact, as it is and as a load feels it, and how much of it sticks and slips."""

import csv
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from tools.builders import resumed
from tools.fakes import fake_result

import evfem as ev
from evfem.simulation.history import Values, no_column

MU = 0.3
OWN = ("friction", "stick_share", "slip_share")
PAD = ev.FingerPad(ridges=False, resolution="coarse")
MOTION = [ev.Hover(gap=0.1, steps=1), ev.Press(force=0.05, steps=2), ev.Slide(2.0, steps=8)]


def scene(**given):
    fields = {"surface": ev.Display(friction=MU), "law": ev.Kaczmarek(), "voltage": 400.0, "motion": MOTION}
    return ev.Scene(PAD, **fields | given)


@pytest.fixture(scope="module")
def slid():
    return ev.simulate(scene())


def test_in_full_slip_friction_is_that_of_the_surface_and_a_load_feels_the_attraction_too(slid):
    """(12) of the paper with (1): F_t / F_n = mu (1 + F_e / F_n), F_n the applied load."""
    full = slid.slip_share == 1.0
    assert full[-3:].all()
    assert_allclose(slid.friction[full], MU, rtol=1e-7)
    pulled = slid.electrostatic_force[full] / slid.applied_force[full]
    assert pulled.min() > 1e-3
    assert_allclose(slid.apparent_friction[full], MU * (1.0 + pulled), rtol=1e-6)


def test_before_full_slip_friction_is_less_and_parts_of_the_contact_stick(slid):
    part = (slid.motion == "slide") & (slid.stick_share > 0.0)
    assert part.any()
    assert (slid.friction[part] < 0.999 * MU).all()
    assert_allclose(slid.stick_share[1:] + slid.slip_share[1:], 1.0, rtol=1e-12)


def test_shares_are_of_the_length_that_nodes_stand_for(slid):
    """By the frames: of a quadratic edge its middle stands for 4/6, its ends for 1/6 each."""
    pad = slid.mesh.node_sets["pad"]
    corner = np.isin(pad, slid.mesh.cells[:, :4])
    counted = []
    for frame, share in zip(slid.frames[1:], slid.stick_share[1:], strict=True):
        x = (slid.mesh.points + frame.displacement)[pad][:, 0]
        status = frame.contact_status[pad]
        near = np.argsort(x)[np.flatnonzero(np.sort(x) > x[status > 0].min() - 0.5)]
        near = near[x[near] < x[status > 0].max() + 0.5]
        near = near[int(not corner[near[0]]) :]  # from a corner on: corner, middle, corner
        assert corner[near[::2]].all()
        length = np.zeros(len(pad))
        for i in range(0, len(near) - 2, 2):
            length[near[i : i + 3]] += (x[near[i + 2]] - x[near[i]]) * np.array([1.0, 4.0, 1.0]) / 6.0
        touches = length[status > 0].sum()
        assert share == pytest.approx(length[status == 1].sum() / touches, abs=2e-3)
        counted.append(abs(share - (status == 1).sum() / (status > 0).sum()))
    assert max(counted) > 5e-3


def test_where_nothing_presses_there_is_no_friction_and_the_file_has_an_empty_cell(slid, tmp_path):
    assert slid.motion[0] == "hover"
    for name in (*OWN, "apparent_friction"):
        assert np.isnan(slid[name][0])
        assert np.isfinite(slid[name][1:]).all()
    slid.to_csv(tmp_path / "history.csv")
    first, second = list(csv.DictReader((tmp_path / "history.csv").read_text().splitlines()))[:2]
    assert [first[name] for name in OWN] == ["", "", ""]
    assert float(second["slip_share"]) == slid.slip_share[1]
    slid.save(tmp_path / "run.npz")
    back = ev.load(tmp_path / "run.npz")
    assert_array_equal(back.friction, slid.friction)
    assert back.columns == slid.columns
    assert slid.summary()["last"]["friction"] == slid.friction[-1]


def test_a_scene_pays_only_for_what_is_in_it(slid):
    """Without an attraction friction is felt as it is: no column of its own."""
    assert {*OWN, "apparent_friction"} <= {*slid.columns}
    plain = ev.simulate(scene(law=None, voltage=0.0))
    assert [name for name in plain.columns if name in (*OWN, "apparent_friction")] == [*OWN]
    assert_allclose(plain.apparent_friction, plain.friction, atol=1e-8)
    smooth = ev.simulate(scene(surface=ev.Display(friction=0.0)))
    assert not {*OWN, "apparent_friction"} & {*smooth.columns}


def test_results_without_the_columns_have_the_quotients_of_their_forces():
    """Of an older version, and of a surface without friction, whose texture resists too."""
    old = fake_result()
    assert "friction" not in old.columns
    assert_array_equal(old.friction, old.tangential_force / old.normal_force)
    assert old.rows[1]["friction"] == old["friction"][1]
    assert np.isnan(old.stick_share).all()
    open_ = replace(old, normal_force=np.zeros(len(old.step)))
    assert np.isnan(open_.friction).all()
    assert np.isnan(Values(normal_force=0.0, tangential_force=0.0)["friction"])


def test_friction_is_the_same_over_a_depth():
    run = ev.simulate(scene(motion=MOTION[:2], surface=ev.Display(friction=[[-1.0, 0.1], [1.0, 0.5]])))
    deep = replace(run, provenance={**run.provenance, "scene": {**run.provenance["scene"], "depth": 10.0}})
    for name in (*OWN, "apparent_friction"):
        assert_array_equal(deep.total[name], run[name])
        assert deep.total.units[name] == ""


def test_derivatives_of_friction_in_full_slip():
    """mu (1 + F_e / F_n) at a held load: 1 and 1 + F_e / F_n by mu, and of the voltage twice F_e's share."""
    motion = [ev.Press(force=0.05, steps=2), ev.Slide(3.0, steps=3, hold="force")]
    found = ev.sensitivities(scene(motion=motion), ["surface.friction", "electrostatics.voltage"])
    run = found.result
    pulled = run.electrostatic_force[-1] / run.applied_force[-1]
    assert run.slip_share[-1] == 1.0
    assert found["friction", "surface.friction"][-1] == pytest.approx(1.0, rel=1e-6)
    by_mu = found["apparent_friction", "surface.friction"][-1]
    change = found["electrostatic_force", "surface.friction"][-1] / run.applied_force[-1]
    assert by_mu == pytest.approx(1.0 + pulled + MU * change, rel=1e-6)
    by_volts = found["apparent_friction", "electrostatics.voltage"][-1]
    of_force = found["electrostatic_force", "electrostatics.voltage"][-1]
    assert by_volts == pytest.approx(MU * of_force / run.applied_force[-1], rel=1e-5)
    assert by_volts > 0.0
    assert "stick_share" in found.reasons
    assert "friction" not in found.reasons


def test_a_sweep_asks_for_friction():
    table = ev.sweep(
        ev.Sweep(
            scene(motion=[ev.Press(force=0.05, steps=2), ev.Slide(3.0, steps=3)]),
            {"surface.friction": [0.2, 0.4]},
            outputs=["friction.last", "apparent_friction.max", "slip_share.last"],
        ),
        workers=1,
    )
    assert_allclose(table["friction.last"], [0.2, 0.4], rtol=1e-6)
    assert (table["apparent_friction.max"] > table["friction.last"]).all()
    assert table["slip_share.last"].tolist() == [1.0, 1.0]
    with pytest.raises(ev.InputError, match=r'given "mu.last", no column; allowed: friction.last\? '):
        table["mu.last"]


@pytest.mark.parametrize(
    ("asked", "meant"),
    [
        ("mu", "friction"),
        ("friction_coefficient", "friction"),
        ("friction_force", "tangential_force"),
        ("pressure", "peak_contact_pressure"),
        ("area", "contact_width"),
        ("force", "applied_force"),
        ("Load", "applied_force"),
        ("stick", "stick_share"),
        ("slipping", "slip_share"),
    ],
)
def test_words_that_people_try_lead_to_the_column_that_they_mean(slid, asked, meant):
    with pytest.raises(ev.InputError, match=rf'given "{asked}", no column; allowed: {meant}\? '):
        slid[asked]


def test_friction_of_a_history_without_it_is_the_force():
    """Of columns among which there is none, as those of a fit's curve of an own room."""
    assert "tangential_force?" in str(no_column("column", "friction", ["position", "tangential_force"]))


def test_a_run_that_goes_on_has_the_friction_of_one_that_was_not_interrupted(tmp_path):
    """From the hovering step on, whose friction is an empty cell of the checkpoint's rows."""
    whole, again = resumed(scene(), 1, folder=tmp_path)
    for name in (*OWN, "apparent_friction"):
        assert_array_equal(again[name], whole[name])
