"""Fits: synthetic measurements recovered, closed forms, bounds, folders, processes, refused input."""

import json
import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from tools.meshes import block
from tools.refusals import refuses
from tools.workers import die_once

import evfem as ev
from evfem.calibration import runs
from evfem.calibration.result import load
from evfem.errors import InputError
from evfem.mesh import file as meshfile
from evfem.scene import file as scenefile
from evfem.sweeps.folder import Answer

E, MU = "finger.materials.tissue.E", "surface.friction"
BOUNDS = {E: (0.02, 0.5), MU: (0.05, 1.0)}
SCENE = """
version = 1
[finger]
mesh = "block.vtu"
[finger.materials.tissue]
law = "neo_hookean"
E = 0.1
nu = 0.4
[finger.electrical]
stratum_corneum_thickness = 0.38
[surface]
kind = "flat"
friction = 0.3
[[motion]]
kind = "press"
indentation = 0.2
steps = 3
[[motion]]
kind = "slide"
distance = 0.5
steps = 3
hold = "force"
"""
PRESS = SCENE[: SCENE.index('[[motion]]\nkind = "slide"')]
HOVER = SCENE[: SCENE.index("[[motion]]")] + (
    '[electrostatics]\nlaw = "strong_troxel"\nvoltage = 100.0\ninsulator_thickness = 0.1\n'
    'insulator_eps_r = 3.0\n[[motion]]\nkind = "hover"\ngap = 0.2\n'
)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    """A block of 45 nodes, pressed and slid."""
    folder = tmp_path_factory.mktemp("fit")
    meshfile.write(block(), folder / "block.vtu")
    (folder / "hover.toml").write_text(HOVER)
    (folder / "press.toml").write_text(PRESS)
    (folder / "scene.toml").write_text(SCENE)
    return folder / "scene.toml"


@pytest.fixture(scope="module")
def hover(path):
    return path.with_name("hover.toml")


@pytest.fixture(scope="module")
def press(path):
    """Without the slide, for what one number shows."""
    return path.with_name("press.toml")


@pytest.fixture(scope="module")
def exact(path):
    return ev.fit(path, measured(path), BOUNDS, workers=1)


@pytest.fixture(scope="module")
def noisy(path):
    return ev.fit(path, measured(path, noise=0.01), BOUNDS, workers=1)


@cache
def true(path, friction):
    """The scene with E 0.07, run."""
    text = SCENE.replace("E = 0.1", "E = 0.07").replace("friction = 0.3", f"friction = {friction}")
    return ev.simulate(scenefile.loads(text, path.parent))


def measured(path, noise=0.0, friction=0.4, **sd):
    """Force over indentation and friction over position of the scene with E 0.07; noise as a part
    of their root mean squares.
    """
    run, random = true(path, friction), np.random.default_rng(1)
    force, slid = (
        y + noise * np.sqrt(np.mean(y**2)) * random.normal(size=3)
        for y in (run.normal_force[:3], run.tangential_force[3:])
    )
    return [
        ev.MeasuredCurve("normal_force", "indentation", run.indentation[:3], force, motion=0, **sd),
        ev.MeasuredCurve("tangential_force", "position", run.position[3:], slid, motion=1, **sd),
    ]


def test_a_synthetic_finger_is_recovered(exact):
    found = exact
    assert found[E] == pytest.approx(0.07, rel=1e-4)
    assert found[MU] == pytest.approx(0.4, rel=1e-4)
    assert found.warnings == ()
    assert found.rms < 1e-5
    fitted = ev.simulate(found.scene)
    np.testing.assert_allclose(found.predicted[:3], fitted.normal_force[:3], rtol=1e-9)
    np.testing.assert_allclose(found.predicted[3:], fitted.tangential_force[3:], rtol=1e-9)


def test_the_best_run_has_the_fields_and_probes_that_the_scene_asks_for(press, tmp_path):
    """The runs of a fit have none."""
    asked = "[output]\nevery = 2\n[output.probes]\nown = [[0.5, 0.5]]\n"
    file = press.with_name("asks.toml")
    file.write_text(PRESS + asked)
    found = ev.fit(file, measured(press, noise=0.0)[0], {E: BOUNDS[E]}, workers=1)
    found.save(tmp_path / "fit.json")
    for one in (found, ev.load(tmp_path / "fit.json")):
        best = ev.simulate(one.scene)
        assert [frame.step for frame in best.frames] == [2, 3]
        assert best.probes["own"].J.shape == (3, 1)
        np.testing.assert_allclose(found.predicted, best.normal_force, rtol=1e-9)


def test_with_noise_it_is_recovered_within_its_interval(noisy):
    found = noisy
    assert found[E] == pytest.approx(0.07, rel=0.01)
    assert found[MU] == pytest.approx(0.4, rel=0.01)
    assert found.rms == pytest.approx(0.01 * np.sqrt(4 / 6), rel=0.7)
    for key, true in ((E, 0.07), (MU, 0.4)):
        low, high = found.intervals()[key]
        assert low < true < high
        assert high / low < 1.1
        wider = found.intervals(0.99)[key]
        assert wider[0] < low < high < wider[1]


def test_friction_under_a_held_load_is_a_ratio_of_sums(path):
    """In full slip T = mu N with N given: mu = sum T / (n N), its error s / (N sqrt(n))."""
    path = path.with_name("load.toml")
    path.write_text(SCENE.replace("indentation = 0.2", "force = 0.02"))
    force = np.array([0.0082, 0.0079, 0.0076])
    curve = ev.MeasuredCurve("tangential_force", "position", [0.3, 0.4, 0.5], force, motion=1)
    found = ev.fit(path, curve, {MU: (0.1, 1.0)}, workers=1)
    assert found[MU] == pytest.approx(force.mean() / 0.02, rel=1e-4)
    spread = np.std(force, ddof=1) / np.sqrt(3) / 0.02
    # the error is that of a logarithm
    assert found.errors[0] == pytest.approx(spread / found[MU], rel=1e-3)
    reach = 4.302652729911275 * found.errors[0]  # Student's 0.975 with two degrees of freedom
    low, high = found.intervals()[MU]
    assert (low, high) == pytest.approx((found[MU] * np.exp(-reach), found[MU] * np.exp(reach)), rel=1e-9)


def test_hovering_forces_give_the_insulator(hover):
    """Strong and Troxel's law on a rigid outline knows the layers by their reduced thickness alone."""
    settings = {"electrostatics.voltage": [100.0, 100.0, 50.0], "motion.0.gap": [0.1, 0.2, 0.1]}
    other = HOVER.replace("insulator_eps_r = 3.0", "insulator_eps_r = 4.5")
    forces = []
    for voltage, gap in zip(*settings.values(), strict=True):
        text = other.replace("voltage = 100.0", f"voltage = {voltage}").replace("gap = 0.2", f"gap = {gap}")
        forces.append(ev.simulate(scenefile.loads(text, hover.parent)).electrostatic_force[-1])
    values = ev.MeasuredValues("electrostatic_force.last", forces, settings)
    found = ev.fit(hover, values, {"electrostatics.insulator_eps_r": (1.0, 10.0)}, workers=1)
    assert found["electrostatics.insulator_eps_r"] == pytest.approx(4.5, rel=1e-3)
    both = {"electrostatics.insulator_eps_r": (1.0, 10.0), "electrostatics.insulator_thickness": (0.01, 1.0)}
    found = ev.fit(hover, values, both, workers=1)
    (warning,) = found.warnings
    assert warning.startswith("the data do not tell electrostatics.insulator_eps_r and ")
    reduced = found["electrostatics.insulator_thickness"] / found["electrostatics.insulator_eps_r"]
    assert reduced == pytest.approx(0.1 / 4.5, rel=1e-3)
    assert "not determined" in repr(found)


def test_offsets_and_factors_act_on_what_the_data_set(hover):
    """Gaps that are 0.05 mm larger than they were set, voltages that are a fifth smaller."""
    settings = {"electrostatics.voltage": [100.0, 100.0, 50.0, 80.0], "motion.0.gap": [0.1, 0.3, 0.1, 0.2]}
    forces = []
    for voltage, gap in zip(*settings.values(), strict=True):
        text = HOVER.replace("voltage = 100.0", f"voltage = {0.8 * voltage}").replace(
            "gap = 0.2", f"gap = {gap + 0.05}"
        )
        forces.append(ev.simulate(scenefile.loads(text, hover.parent)).electrostatic_force[-1])
    free = {
        "motion.0.gap": ev.Parameter(-0.1, 0.2, apply="offset"),
        "electrostatics.voltage": ev.Parameter(0.5, 2.0, apply="factor"),
    }
    found = ev.fit(hover, ev.MeasuredValues("electrostatic_force.last", forces, settings), free, workers=1)
    assert found["motion.0.gap"] == pytest.approx(0.05, rel=1e-3)
    assert found["electrostatics.voltage"] == pytest.approx(0.8, rel=1e-3)
    assert "motion.0.gap = 0.05 as offset (0.05 to 0.05 with 95 % confidence)" in repr(found)


def test_a_parameter_at_its_bound_is_said(press):
    found = ev.fit(press, measured(press, friction=0.3)[0], {E: (0.02, 0.06)}, workers=1)
    assert found[E] == pytest.approx(0.06, rel=1e-3)
    assert f"{E} is at its bound 0.06: its interval says nothing beyond it" in found.warnings


def test_residuals_beyond_their_sd_are_said(press):
    found = ev.fit(press, measured(press, noise=0.1, sd=1e-5)[0], {E: BOUNDS[E]}, workers=1)
    (warning,) = found.warnings
    assert warning.endswith("times the measured sd: the scene does not explain the data")
    assert f"residuals are {found.rms * np.sqrt(3 / 2):.2g} times" in warning
    assert "rms residual" in repr(found).splitlines()[0]
    assert repr(found).splitlines()[0].endswith(" sd")
    again = ev.fit(press, measured(press, noise=0.01, sd=2e-4)[0], {E: BOUNDS[E]}, workers=1)
    assert again.warnings == ()


def test_a_result_is_written_and_read_back(noisy, tmp_path):
    found = noisy
    found.save(tmp_path / "fit.json")
    read = ev.load(tmp_path / "fit.json")
    assert repr(read) == repr(found)
    assert list(read.table()["lowest"]) == list(found.table()["lowest"])
    assert read.scene.digest() == found.scene.digest()
    np.testing.assert_array_equal(read.residuals, found.residuals)
    assert list(found.table()["parameter"]) == [E, MU]
    assert list(found.table()["value"]) == [found[E], found[MU]]
    assert found.provenance["versions"]["evfem"] == ev.__version__
    refuses('parameter: given "nu"', lambda: found["nu"])


@pytest.mark.parametrize("text", ["", "{}", '{"format": "evfem-fit-1"}', "[1]", "{"])
def test_a_damaged_result_is_refused(tmp_path, text):
    (tmp_path / "fit.json").write_text(text)
    refuses(r"fit: given .*, damaged or of another kind", load, tmp_path / "fit.json")


def test_an_interrupted_fit_goes_on_where_it_was(path, exact, tmp_path, monkeypatch):
    """Stopped after five runs, it computes the others alone, and finds the same."""
    data, out, work = measured(path), tmp_path / "out", runs.work
    whole = exact
    count = whole.provenance["runs"]
    seen = []

    def interrupted(job):
        if len(seen) == 5:
            raise KeyboardInterrupt
        seen.append(job)
        return work(job)

    monkeypatch.setattr(runs, "work", interrupted)
    with pytest.raises(KeyboardInterrupt):
        ev.fit(path, data, BOUNDS, out=out, workers=1)
    monkeypatch.setattr(runs, "work", work)
    found = ev.fit(path, data, BOUNDS, out=out, workers=1)
    assert found.provenance["runs"] == count - 5
    assert found.values == whole.values
    assert load(out / "fit.json").values == whole.values
    assert json.loads((out / "sweep.json").read_text())["digest"]
    with pytest.raises(InputError, match=r"out: given .*; allowed: another folder, or that of the same fit"):
        ev.fit(path, data, {E: (0.02, 0.4)}, out=out, workers=1)


def test_a_broken_pool_is_opened_again(press, tmp_path, monkeypatch):
    monkeypatch.setattr(runs, "work", die_once)
    monkeypatch.setenv("DIE_ONCE", str(tmp_path / "died"))
    found = ev.fit(press, measured(press, friction=0.3)[0], {E: (0.02, 0.5)}, workers=2)
    assert (tmp_path / "died").exists()
    assert found[E] == pytest.approx(0.07, rel=0.01)


def test_progress_is_a_line_for_each_step(press, capsys):
    ev.fit(press, measured(press)[0], {E: BOUNDS[E]}, workers=1, progress=True)
    lines = capsys.readouterr().err.splitlines()
    assert lines[0].startswith(f"evfem: fit: {E} 0.1: rms residual 0.")
    assert lines[0].endswith(", 1 runs so far")
    assert 2 < len(lines) < 12
    assert lines[1].split(":")[2] != lines[0].split(":")[2]  # the start once


def test_a_trial_that_is_not_solved_is_stepped_back_from(press, monkeypatch):
    """Above a modulus of 0.09 nothing converges, and nothing has derivatives: a fit that starts there makes
    its first differences on the other side.
    """
    work, failed = runs.work, []

    def fragile(job):
        modulus = scenefile.loads(job[0], job[1]).finger.materials["tissue"].E
        if modulus > 0.09001:
            failed.append(modulus)
            return Answer("not_converged", 0.0, "step 1 did not converge", {})
        return work((*job[:3], (), True))

    monkeypatch.setattr(runs, "work", fragile)
    found = ev.fit(
        press, measured(press, friction=0.3)[0], {E: ev.Parameter(0.02, 0.5, start=0.09)}, workers=1
    )
    assert found[E] == pytest.approx(0.07, rel=1e-3)
    assert failed
    monkeypatch.setattr(runs, "work", lambda job: Answer("not_converged", 0.0, "none", {}))
    with pytest.raises(InputError, match="cannot be run at the start: none"):
        ev.fit(press, measured(press, friction=0.3)[0], {E: (0.02, 0.5)}, workers=1)


def test_outputs_that_are_counted_are_said(press, monkeypatch):
    """Forces in whole multiples of half a per cent of .01 N/mm: ten steps of a difference cross some."""
    work = runs.work

    def counted(job):
        answer = work((*job[:3], (), True))
        outputs = {name: 5e-5 * round(value / 5e-5) for name, value in answer.outputs.items()}
        return Answer(answer.status, answer.seconds, answer.message, outputs)

    monkeypatch.setattr(runs, "work", counted)
    found = ev.fit(
        press, measured(press, friction=0.3)[0], {E: ev.Parameter(0.02, 0.5, start=0.09)}, workers=1
    )
    assert [text for text in found.warnings if text.startswith(f"what is compared is not smooth in {E}")]


@pytest.mark.parametrize(
    ("free", "sentence"),
    [
        ({}, "parameters: given {}; allowed: {key: "),
        ({"E": (0.1, 0.2)}, r"parameters\.E: .*TABLE\.KEY"),
        ({E: 0.1}, f"parameters.{E}: given 0.1"),
        ({E: (0.2, 0.1)}, "parameters.high: given 0.1; allowed: a number above 0.2"),
        ({E: ev.Parameter(-0.1, 0.1)}, "finger.materials.tissue.E: given"),
        ({MU: (0.1, 200.0)}, rf"^parameters\.{MU}: given the bound 200; allowed: a number from 0 to 100"),
        (
            {MU: ev.Parameter(0.5, 400.0, 1.0, "factor")},
            rf"^parameters\.{MU}: given the bound 400, at which it is 120\.0; allowed: a number from 0",
        ),
        ({"surface.colour": (0.1, 0.2)}, "surface.colour: given an unknown key"),
        ({"motion.5.steps": (1, 2)}, "motion.5: given no such entry"),
        ({"surface.y": ev.Parameter(0.5, 2.0, apply="factor")}, "surface.y: given no number there"),
        ({"surface.kind": ev.Parameter(0.5, 2.0, apply="factor")}, "surface.kind: given .*flat"),
        (dict.fromkeys((E, MU, "finger.materials.tissue.nu"), (0.1, 0.4)), "given 3 for 3 parameters"),
    ],
)
def test_parameters_that_cannot_be_are_refused_before_any_run(path, free, sentence, monkeypatch):
    monkeypatch.setattr(runs, "work", None)
    data = ev.MeasuredCurve("normal_force", "indentation", [0.05, 0.1, 0.2], [0.1, 0.2, 0.3], motion=0)
    refuses(sentence, ev.fit, path, data, free, workers=1)


@pytest.mark.parametrize(
    ("key", "low", "sentence"),
    [
        (
            "finger.width",
            12,
            "12, with which finger.nail_width is refused (given 11.0); allowed: at most 9.6",
        ),
        ("finger.ridge_height", 0.01, "0.01; allowed: 0.02 to 0.4 mm"),
        ("motion.0.force", -0.1, "-0.1; allowed: a force in N/mm"),
    ],
)
def test_a_bound_that_a_scene_cannot_have_is_one_sentence(key, low, sentence):
    scene = ev.Scene(ev.FingerPad(), ev.Display(), motion=ev.Press(force=0.05))
    data = ev.MeasuredCurve("normal_force", "indentation", [0.1, 0.2], [0.1, 0.2])
    start = {"finger.width": 16.0, "finger.ridge_height": 0.1, "motion.0.force": 0.1}[key]
    bounds = {key: ev.Parameter(low, 1.5 * start, start)}
    error = refuses(re.escape(f"parameters.{key}: given the bound {sentence}"), ev.fit, scene, data, bounds)
    assert str(error).count("allowed:") == 1


def test_data_that_do_not_fit_the_scene_are_refused(path):
    curve = ev.MeasuredCurve("normal_force", "indentation", [0.1, 0.2], [0.1, 0.2], motion=2)
    with pytest.raises(InputError, match=r"data\.motion: given 2; allowed: motions from 0 to 1"):
        ev.fit(path, curve, {E: (0.1, 0.2)}, workers=1)
    with pytest.raises(InputError, match='outputs: given "normal_force"'):
        ev.fit(path, ev.MeasuredValues("normal_force", [1, 2], {MU: [0.1, 0.2]}), {E: (0.1, 0.2)}, workers=1)
    refuses("data: given 3; allowed: MeasuredCurve", ev.fit, path, [3], {E: (0.1, 0.2)}, workers=1)
    known = replace(curve, motion=0, sd=1e-4)
    refuses(
        "data.sd: given one for some measurements and none for others",
        ev.fit, path, [known, replace(curve, motion=0)], {E: (0.1, 0.2)}, workers=1,
    )  # fmt: skip
    values = ev.MeasuredValues("normal_force.last", [0.1, 0.2], {MU: [0.1, 0.2]})
    with pytest.raises(InputError, match=rf"parameters\.{MU}: given a key that the data set"):
        ev.fit(path, values, {MU: (0.1, 0.2)}, workers=1)
    beyond = ev.MeasuredCurve("normal_force", "indentation", [0.1, 0.3], [0.1, 0.2], motion=0)
    sentence = r"^scene: given one that cannot be run at the start: data\.at: given .*0\.3"
    error = refuses(sentence, ev.fit, path, beyond, {E: (0.1, 0.2)}, workers=1)
    assert str(error).count("allowed:") == 1


def test_the_uncertainty_of_a_run_from_a_fit_is_that_of_the_fitted_curves(noisy):
    """The covariance of fitted values is s^2 times a projection of rank P: the sum of their variances, in
    those of the data, is P s^2, with s^2 = r.r / (N - P) (Seber and Wild, section 2.1).
    """
    sure = ev.uncertainty(noisy.scene, noisy.sd, correlation=noisy.correlation)
    sd = np.concatenate([sure.sd["normal_force"][:3], sure.sd["tangential_force"][3:]])
    variance = noisy.residuals @ noisy.residuals / (6 - 2)
    assert np.sum((sd / noisy.scale) ** 2) == pytest.approx(2.0 * variance, rel=1e-4)
    # the parameters are correlated, and independent ones would err otherwise
    alone = ev.uncertainty(noisy.scene, noisy.sd, ["normal_force", "tangential_force"])
    apart = np.concatenate([alone.sd["normal_force"][:3], alone.sd["tangential_force"][3:]])
    assert abs(noisy.correlation[0, 1]) > 0.1
    assert np.sum((apart / noisy.scale) ** 2) != pytest.approx(2.0 * variance, rel=0.02)


def test_standard_deviations_are_of_the_numbers_of_the_scene(noisy, hover):
    """Half an interval over Student's quantile, for small ones; of a factor those of what it multiplies."""
    from scipy.stats import t

    for key, (low, high) in noisy.intervals(0.5).items():
        assert noisy.sd[key] == pytest.approx(0.5 * (high - low) / t.ppf(0.75, 4), rel=1e-3)
    sd = np.array([*noisy.sd.values()])
    np.testing.assert_allclose(np.diag(noisy.covariance), sd**2)
    gap, case = "motion.0.gap", {"electrostatics.voltage": [90.0, 100.0, 120.0]}
    run = [
        ev.simulate(ev.load(hover)).electrostatic_force[-1] * (v / 100.0) ** 2 for v in (90.0, 100.0, 120.0)
    ]
    data = ev.MeasuredValues("electrostatic_force.last", np.array(run) * [1.01, 0.98, 1.0], case)
    ways = {
        "value": ev.Parameter(0.1, 0.4),
        "factor": ev.Parameter(0.5, 2.0, apply="factor"),
        "offset": ev.Parameter(-0.1, 0.1, apply="offset"),
    }
    found = {way: ev.fit(hover, data, {gap: one}, workers=1) for way, one in ways.items()}
    assert found["factor"][gap] == pytest.approx(found["value"][gap] / 0.2, rel=1e-5)
    for way in ("factor", "offset"):
        assert found[way].sd[gap] == pytest.approx(found["value"].sd[gap], rel=1e-4)


def test_what_is_not_determined_has_no_standard_deviation(path):
    """Without a voltage the horny layer changes nothing that was measured."""
    layer = "finger.electrical.stratum_corneum_thickness"
    found = ev.fit(path, measured(path)[0], {E: BOUNDS[E], layer: (0.2, 0.5)}, workers=1)
    assert found.sd[layer] == np.inf
    assert np.isfinite(found.sd[E])
    with pytest.raises(InputError, match=rf"sd\.{layer}: given inf"):
        ev.uncertainty(found.scene, found.sd, correlation=found.correlation)


def test_a_curve_of_another_shape_is_told_by_the_pattern_of_its_residuals(path, press):
    """Twelve points that grow with the power 1.5 of what the scene does, and others with errors
    alone, or a shape that is a ten thousandth off.
    """
    text = PRESS.replace("steps = 3", "steps = 12")
    run = ev.simulate(scenefile.loads(text, press.parent))
    (press.parent / "twelve.toml").write_text(text)
    force, random = run.normal_force, np.random.default_rng(5)
    largest = float(force.max())
    curved = largest * (force / largest) ** 1.5
    errs = force + 0.03 * largest * random.normal(size=12)
    found = {}
    slightly = force * (1.0 + 2e-4 * (force / largest - 0.5))
    for name, values in {"curved": curved, "errs": errs, "slightly": slightly}.items():
        curve = ev.MeasuredCurve("normal_force", "indentation", run.indentation, values)
        found[name] = ev.fit(press.parent / "twelve.toml", curve, {E: BOUNDS[E]}, workers=1).warnings
    (said,) = found["curved"]
    assert said.startswith("the 12 residuals of normal_force over indentation have 2 runs of one sign")
    assert found["errs"] == found["slightly"] == ()


RASH = """
[electrostatics]
law = "strong_troxel"
insulator = "film"
[electrostatics.signal]
kind = "sine"
frequency = 50.0
amplitude = 100.0
[[motion]]
kind = "wait"
duration = 0.06
steps = 10
"""


def test_only_the_scenes_at_the_start_of_a_fit_warn(path, recwarn):
    """3.33 steps in a period are warned of; once a run, and once a fit of many."""
    scene = path.with_name("rash.toml")
    scene.write_text(PRESS + RASH)
    pressed = ev.simulate(scene)
    told = [str(one.message) for one in recwarn.list]
    assert any("3.33 steps in a period" in one for one in told)
    recwarn.clear()
    at, force = pressed.indentation[:2], 1.5 * pressed.normal_force[:2]  # of 0 V, and so of E
    curve = ev.MeasuredCurve("normal_force", "indentation", at, force, motion=0)
    found = ev.fit(scene, curve, {E: (0.02, 0.5)}, workers=1)
    assert found[E] == pytest.approx(0.15, rel=1e-4)
    assert [str(one.message) for one in recwarn.list] == told
