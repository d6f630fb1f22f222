"""What is made of derivatives: uncertainty, design, pictures, a command."""

import csv
from dataclasses import replace

import numpy as np
import pytest
from tools.builders import finger
from tools.meshes import block
from tools.refusals import refuses

import evfem as ev
from evfem.cli import main

SCENE = """
version = 1
[finger]
ridges = false
resolution = "coarse"
[surface]
kind = "flat"
friction = 0.3
[[motion]]
kind = "press"
indentation = 0.2
steps = 1
[[motion]]
kind = "slide"
distance = 2.0
steps = 2
"""


@pytest.fixture
def path(tmp_path):
    """A finger pressed, and slid to full slip."""
    (tmp_path / "scene.toml").write_text(SCENE)
    return tmp_path / "scene.toml"


def test_a_bare_name_is_told_its_table(path):
    for name in ("friction", "mu"):
        refuses(f'parameters: given "{name}"; allowed: surface.friction[?]', ev.sensitivities, path, name)
    refuses("allowed: materials[?]", ev.sensitivities, path, "finger.dermis.E")


@pytest.mark.parametrize("name", ["depth", "solver.tolerance", "output.every"])
def test_a_key_that_has_no_derivative_is_not_meant(path, name):
    refuses(f'parameters: given "{name}"; allowed: TABLE.KEY', ev.sensitivities, path, name)


def test_shares_that_are_rounding_are_told_as_0(path):
    """At constant indentation, once all slips, the forces do not depend on how far the pad slid; of a pad
    that is pressed alone the tangential force is 0 but for rounding (1e-15), and so are its own shares.
    """
    found = ev.sensitivities(path, "motion.1.distance", ["normal_force", "tangential_force"])
    assert "  motion.1.distance: normal_force 0, tangential_force 0" in str(found).splitlines()
    path.write_text(SCENE[: SCENE.rindex("[[motion]]")])
    pressed = ev.sensitivities(path, ["motion.0.indentation", "surface.friction"])
    _, first, second, last = str(pressed).splitlines()
    assert first.startswith("  motion.0.indentation: normal_force 1.")
    assert "tangential" not in first + second
    assert last == "  tangential_force: 0 at the end, which has no per cent"
    assert np.isnan(pressed.elasticity["tangential_force", "surface.friction"][-1])


def test_a_finger_that_hovers_is_told_by_its_attraction():
    """The attraction grows as the square of the voltage: 2 % for 1 %."""
    pad = ev.FingerPad(resolution="coarse", ridges=False)
    scene = ev.Scene(pad, ev.Display(), ev.Kaczmarek(), 100.0, ev.Hover(gap=0.3, steps=1))
    told = str(ev.sensitivities(scene, "electrostatics.voltage")).splitlines()
    assert told[1] == "  electrostatics.voltage: electrostatic_force 2"
    assert told[2] == "  normal_force and tangential_force: 0 at the end, which has no per cent"


def test_a_name_that_leads_nowhere_says_so():
    scene = ev.Scene(
        ev.FingerPad(resolution="coarse", ridges=False),
        ev.Profile([-9.0, 9.0], [0.0, 0.1]),
        motion=ev.Press(indentation=0.1, steps=1),
    )
    refuses("surface.height.20: missing; allowed: a number", ev.sensitivities, scene, "surface.height.20")


def test_uncertainty_is_the_root_of_the_sum_of_squares_and_is_checked(path):
    sd = {"finger.materials.hypodermis.E": 0.004, "surface.friction": 0.03}
    refuses("columns: given substeps, contact_width", ev.uncertainty, path, sd, ["substeps", "contact_width"])
    refuses("columns: given substeps", ev.uncertainty, path, sd, ["tangential_force", "substeps"])
    found = ev.uncertainty(path, sd, ["tangential_force", "position"])
    parts = [found.contribution["tangential_force", key] for key in sd]
    assert found.sd["tangential_force"] == pytest.approx(np.hypot(*parts))
    assert parts[1][-1] == pytest.approx(0.1 * found.result.tangential_force[-1], rel=0.02)
    assert set(found.sd) == {"tangential_force", "position"}
    assert "  position: " in repr(found)
    assert "not linear" not in repr(found)
    key, column, by_derivative, by_run = found.checked
    assert (key, column) == ("finger.materials.hypodermis.E", "tangential_force") or key == "surface.friction"
    assert by_run == pytest.approx(by_derivative, rel=0.05)
    assert f"+1 sd of {key} changes" in repr(found)
    drawn = ev.plotting.tornado(found, "tangential_force")
    words = {"finger.materials.hypodermis.E": "hypodermis E", "surface.friction": "friction"}
    assert [label.get_text() for label in drawn.get_yticklabels()][-1] == words[key]
    assert drawn.get_xlabel() == "tangential force for one sd (N/mm)"
    band = ev.plotting.forces(found.result, sd=found.sd).collections[0].get_paths()[0].vertices
    assert np.ptp(band[:, 1]) > found.result.tangential_force.max()
    with pytest.raises(ev.InputError, match="no column"):
        ev.plotting.tornado(found, "substeps")


def test_why_an_uncertainty_is_missing_is_said():
    """A finger that snaps down in its second step."""
    key, motion = "finger.materials.tissue.E", [ev.Hover(0.05, steps=1), ev.VoltageRamp(4000.0, steps=1)]
    snapping = ev.Scene(finger(block(8, 3, sag=0.4)), ev.Display(), ev.StrongTroxel(), 0.0, motion)
    found = ev.uncertainty(snapping, {key: 0.01}, ["normal_force"])
    assert np.isnan(found.sd["normal_force"][-1])
    reason = f"{key}: the finger snapped or was released in step 2"
    assert reason in repr(found)
    assert reason in repr(found.found)


def test_what_cannot_be_asked_is_said(path):
    cases = {
        "surface.elastic.E": r"parameters\.surface\.elastic\.E: missing",
        "surface.friction.0": r"parameters\.surface\.friction\.0: missing",
        (): "parameters: given no keys",
    }
    for keys, said in cases.items():
        with pytest.raises(ev.InputError, match=said):
            ev.sensitivities(path, keys)
    with pytest.raises(
        ev.InputError, match=r'columns: given "tangential", no column; allowed: tangential_force\?'
    ):
        ev.sensitivities(path, "surface.friction", "tangential")
    found = ev.sensitivities(path, "surface.friction", ["contact_width", "external_work"])
    assert "external_work" in repr(found)
    with pytest.raises(ev.InputError, match=r"allowed: found\[column, parameter\]"):
        found["external_work"]


def test_uncertainty_of_a_result_is_that_of_its_scene(path):
    sd, columns = {"surface.friction": 0.03}, ["tangential_force"]
    found = ev.uncertainty(ev.simulate(path), sd, columns)
    assert found.sd["tangential_force"] == pytest.approx(
        ev.uncertainty(path, sd, columns).sd["tangential_force"]
    )


@pytest.mark.parametrize(
    ("sd", "said"),
    [({}, "standard deviation"), ({"surface.friction": 0.0}, "larger than 0"), ({"surface.mu": 1.0}, "mu")],
)
def test_uncertainties_that_cannot_be_are_refused(path, sd, said):
    with pytest.raises(ev.InputError, match=said):
        ev.uncertainty(path, sd)


def test_a_design_finds_the_friction_of_a_force(path):
    """In full slip the tangential force is the coefficient times the normal force."""
    wanted = 0.008

    def missed(run):
        return float(1e6 * (run.tangential_force[-1] - wanted) ** 2)

    found = ev.design(path, missed, ["surface.friction"], {"surface.friction": (0.1, 0.9)})
    assert found.result.tangential_force[-1] == pytest.approx(wanted, rel=1e-5)
    assert found.parameters["surface.friction"] == pytest.approx(found.scene.surface.friction)
    assert found.objective < 1e-8
    assert found.runs < 12
    least = ev.design(path, "-tangential_force.last", "surface.friction", [(0.1, 0.35)])
    assert least.parameters["surface.friction"] == pytest.approx(0.35)
    assert least.gradient["surface.friction"] < 0.0


@pytest.mark.parametrize(
    ("objective", "bounds", "said"),
    [
        (3.0, [(0.1, 0.9)], "a function of a result"),
        ("tangential_force.sum", [(0.1, 0.9)], "COLUMN.STATISTIC"),
        ("tangential_force.last", [(0.4, 0.9)], "around 0.3"),
        ("tangential_force.last", [], "a pair"),
    ],
)
def test_designs_that_cannot_be_are_refused(path, objective, bounds, said):
    with pytest.raises(ev.InputError, match=said):
        ev.design(path, objective, ["surface.friction"], bounds)


def test_the_command_writes_a_table_and_a_picture(path, capsys):
    out = path.parent / "out"
    assert (
        main(["sensitivities", str(path), "--by", "surface.friction", "motion.1.distance", "--out", str(out)])
        == 0
    )
    with open(out / "sensitivities.csv", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["step"] for row in rows] == ["1", "2", "3"]
    pressed = ev.simulate(path).normal_force[-1]
    assert float(rows[-1]["tangential_force by surface.friction"]) == pytest.approx(pressed, rel=0.02)
    assert float(rows[0]["valid_to surface.friction"]) > 0.0
    assert (out / "sensitivities.png").stat().st_size > 5000
    assert "tangential_force" in capsys.readouterr().out
    assert main(["sensitivities", str(path), "--by", "surface.y", "--out", str(out)]) == 2


FILE = 'version = 1\nscene = "scene.toml"\nby = ["motion.0.indentation"]\ncolumns = ["applied_force"]\n'


def test_a_file_beside_the_scene_names_keys_and_columns(path, capsys):
    """Paths in it start beside it; what is no such file is refused with one sentence."""
    (path.parent / "asked.toml").write_text(FILE)
    out = path.parent / "out"
    assert main(["sensitivities", str(path.parent / "asked.toml"), "--out", str(out)]) == 0
    header = (out / "sensitivities.csv").read_text().splitlines()[0]
    assert header == "step,applied_force by motion.0.indentation,valid_to motion.0.indentation"
    assert (out / "sensitivities.png").exists()
    capsys.readouterr()
    for text, said in (
        (SCENE, "a scene file and --by KEY"),
        (FILE.replace("by", "wrt"), "by = [KEY"),
        (FILE.replace("columns", "column"), "columns"),
        (FILE + "\nby = 3", "TOML"),
    ):
        (path.parent / "asked.toml").write_text(text)
        assert main(["sensitivities", str(path.parent / "asked.toml"), "--out", str(out)]) == 2
        assert said in capsys.readouterr().err


def test_the_command_of_an_impedance_writes_a_table_and_a_picture(path, capsys):
    out = path.parent / "out"
    asked = ["impedance", str(path), "--axis", "tangential", "--out", str(out), "--frequencies"]
    assert main([*asked, "1", "50"]) == 0
    with open(out / "impedance.csv", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    found = ev.impedance(path, [1.0, 50.0], "tangential")
    assert [float(row["frequency (Hz)"]) for row in rows] == [1.0, 50.0]
    real = [float(row["stiffness real (N/mm per mm)"]) for row in rows]
    assert real == found.stiffness.real.tolist()
    assert (out / "impedance.png").stat().st_size > 5000
    assert "Impedance, tangential" in capsys.readouterr().out
    assert main([*asked, "-1"]) == 2


def test_the_command_of_an_electrical_impedance_writes_a_table_and_a_picture(path, capsys):
    """Without losses that of a capacitor: ten times the frequency has a tenth of it, by -90 degrees."""
    asked = ["electrical-impedance", str(path), "--out", str(path.parent / "out"), "--frequencies"]
    assert main([*asked, "100"]) == 2
    assert "scene: given no electrostatic law; allowed: a scene with a law" in capsys.readouterr().err
    law = '[electrostatics]\nlaw = "strong_troxel"\nvoltage = 50.0\ninsulator = "touchscreen"\n'
    path.write_text(SCENE.replace("[[motion]]", f"{law}roughness_gap = 0.003\n[[motion]]", 1))
    assert main([*asked, "100", "1000"]) == 0
    out, table = capsys.readouterr().out, path.parent / "out" / "electrical-impedance.csv"
    assert out.startswith("Electrical impedance: ")
    assert out.endswith(f"table in {table}\n")
    with open(table, encoding="utf-8") as file:
        low, high = csv.DictReader(file)
    assert float(low["impedance real (ohm mm)"]) == pytest.approx(0.0, abs=1e-6)
    least, most = (float(row["impedance imaginary (ohm mm)"]) for row in (low, high))
    assert least == pytest.approx(10.0 * most, rel=1e-12)
    assert most < 0.0
    assert table.with_suffix(".png").stat().st_size > 5000
    assert main([*asked, "-1"]) == 2


def test_a_folder_that_cannot_be_is_told_before_anything_is_computed(path, capsys, monkeypatch):
    monkeypatch.setattr("evfem.response.sensitivities.sensitivities", None)
    monkeypatch.setattr("evfem.response.impedance.impedance", None)
    monkeypatch.setattr("evfem.response.electrical.electrical_impedance", None)
    for asked in (
        ["impedance", "--frequencies", "1"],
        ["electrical-impedance", "--frequencies", "1"],
        ["sensitivities", "--by", "surface.friction"],
    ):
        assert main([asked[0], str(path), "--out", str(path / "out"), *asked[1:]]) == 4
        assert "cannot use" in capsys.readouterr().err


INSULATOR = ("electrostatics.insulator_thickness", "electrostatics.insulator_eps_r")


def hovering():
    pad = ev.FingerPad(ridges=False, resolution="coarse")
    return ev.Scene(pad, ev.Display(), ev.StrongTroxel(), 100.0, ev.Hover(gap=0.3, steps=1))


def test_parameters_that_err_together_cancel_or_add():
    """The law knows the insulator by d / eps_r alone: two relative errors of 5 % that are the same cancel,
    opposite ones add, and independent ones are their root.
    """
    scene, column = hovering(), "electrostatic_force"
    layer = scene.surface.insulator
    sd = {INSULATOR[0]: 0.05 * layer.thickness, INSULATOR[1]: 0.05 * layer.eps_r}
    found = {
        rho: ev.uncertainty(scene, sd, [column], correlation=[[1.0, rho], [rho, 1.0]]).sd[column][0]
        for rho in (-1.0, 0.0, 1.0)
    }
    assert found[0.0] == ev.uncertainty(scene, sd, [column]).sd[column][0] > 0.0
    assert found[1.0] < 1e-6 * found[0.0]
    assert found[-1.0] == pytest.approx(2.0**0.5 * found[0.0], rel=1e-8)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ([[1.0]], r"shape \(1, 1\).*symmetric matrix \(2, 2\)"),
        ([[1.0, np.nan], [np.nan, 1.0]], "given nan"),
        ([[1.0, 0.3], [0.2, 1.0]], "symmetric"),
        ([[2.0, 0.0], [0.0, 2.0]], "1 on its diagonal"),
        ([[1.0, 1.5], [1.5, 1.0]], "that some parameters can have"),
    ],
)
def test_a_matrix_that_is_no_correlation_is_refused(given, said):
    with pytest.raises(ev.InputError, match=f"correlation: .*{said}"):
        ev.uncertainty(hovering(), dict.fromkeys(INSULATOR, 0.01), ["electrostatic_force"], correlation=given)


def test_a_result_that_ended_early_is_not_run_further():
    """Its whole scene slides on until all slips, where the impedance is another one."""
    pad = ev.FingerPad(resolution="coarse", ridges=False)
    motion = [ev.Press(force=0.05, steps=1), ev.Slide(0.5, steps=4, hold="force")]
    asked = ev.Scene(pad, ev.Flat(friction=0.4), motion=motion)
    result = ev.simulate(asked, observers=[ev.StopWhen("tangential_force > 1e-4")])
    assert len(result.step) < asked.total_steps
    said = f"scene: given a result that ended after {len(result.step)} of 5 steps"
    for ask in (ev.impedance, ev.electrical_impedance):
        refuses(said, ask, result, [10.0])
    refuses(said, ev.sensitivities, result, "surface.friction")
    refuses(said, ev.uncertainty, result, {"surface.friction": 0.01})


def test_an_uncertainty_that_is_not_linear_says_so():
    """The voltage to the square: an sd of half of it adds 1.25 of what the derivative says."""
    pad = ev.FingerPad(ridges=False, resolution="coarse")
    scene = ev.Scene(pad, ev.Display(), ev.Kaczmarek(), 100.0, ev.Hover(gap=0.3, steps=1))
    found = ev.uncertainty(scene, {"electrostatics.voltage": 50.0}, ["electrostatic_force"])
    assert found.checked.by_run == pytest.approx(1.25 * found.checked.by_derivative, rel=0.01)
    assert "not linear over one sd" in repr(found)
    found = ev.uncertainty(scene, {"electrostatics.voltage": 30.0}, ["electrostatic_force"])
    assert "not linear" not in repr(found)


@pytest.fixture
def probed_pad():
    pad = ev.FingerPad(ridges=False, resolution="coarse")
    probed = ev.Output(probes={"m": ev.Probe(x=[0.0], at="epidermis")})
    return ev.Scene(pad, ev.Display(), ev.Kaczmarek(), 500.0, ev.Hover(gap=0.3, steps=1), output=probed)


@pytest.mark.parametrize(
    ("objective", "said"),
    [
        ("-contact_width.last", "a column that has derivatives"),
        (lambda run: run.contact_width[-1] + run.electrostatic_force[-1], "the objective has no derivative"),
        (lambda run: run.probes["m"].von_mises[-1, 0], "reads the probes"),
        (lambda run: run.frames[-1].contact_pressure.max(), "reads the frames"),
        (lambda run: None, "one that gives None; allowed: a number"),
        (lambda run: run.breakdown[-1], "the objective has no derivative"),
    ],
)
def test_an_objective_without_a_derivative_is_no_design(probed_pad, objective, said):
    """Its gradient was 0, and the start the best."""
    with pytest.raises(ev.InputError, match=said):
        ev.design(probed_pad, objective, ["electrostatics.voltage"], [(100.0, 1000.0)])


def test_a_gradient_of_what_has_no_derivative_is_none(probed_pad):
    found = ev.sensitivities(probed_pad, ["electrostatics.voltage"], ["electrostatic_force"])
    assert np.isnan(found.gradient(lambda run: run.min_gap[-1])["electrostatics.voltage"])
    force = found.gradient(lambda run: run.electrostatic_force[-1] / run.step[-1])
    assert force["electrostatics.voltage"] == pytest.approx(
        found.result.electrostatic_force[0] / 250.0, rel=1e-2
    )
    refuses('derivative: given "normal_force"', found.elasticity.__getitem__, "normal_force")


@pytest.mark.parametrize(
    ("keys", "bounds", "said"),
    [
        (["electrostatics.voltage"], [("0.1 kV", "1 kV")], "two numbers around 500"),
        (["electrostatics.voltage"], [(None, 1000.0)], "two numbers around 500"),
        (["electrostatics.voltage"], [(10.0, np.inf)], "two numbers around 500"),
        (["electrostatics.voltage"], {"electrostatics.voltage": (1.0, 1e3), "hand.mass": (1, 2)}, "bounds"),
        ([], [], "at least one dotted key"),
    ],
)
def test_bounds_that_are_none_are_refused(probed_pad, keys, bounds, said):
    with pytest.raises(ev.InputError, match=said):
        ev.design(probed_pad, "electrostatic_force.last", keys, bounds)


def test_a_design_comes_near_a_bound_of_zero_and_ends_where_no_scene_is(probed_pad):
    """The smallest attraction is without voltage; a Poisson's ratio above 0.5 ends the search, which keeps
    what it had.
    """
    low = ev.design(
        probed_pad, "electrostatic_force.last", ["electrostatics.voltage"], np.array([[0.0, 1e3]])
    )
    assert low.parameters["electrostatics.voltage"] == pytest.approx(0.1)
    key = "finger.materials.dermis.nu"
    pressed = replace(probed_pad, motion=[ev.Press(force=0.03, steps=1)])
    found = ev.design(pressed, "-electrostatic_force.last", [key], [(0.3, 0.7)])
    assert "ended early: nu: given 0.5" in found.told
    assert 0.3 < found.parameters[key] < 0.5
