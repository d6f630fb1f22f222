"""The campaign: scenes nobody chose end in equilibria, and nothing that is broken passes its checks."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest

from evfem import studies
from evfem.common.pools import open_pool, processes
from evfem.electrostatics.breakdown import MODES
from evfem.electrostatics.dielectrics import SKINS
from evfem.electrostatics.laws import INSULATORS
from evfem.electrostatics.roughness import DISTRIBUTIONS
from evfem.electrostatics.timesignals import ChargeControl
from evfem.errors import NotConverged
from evfem.scene.format import SIGNALS, SURFACES
from evfem.scene.motion import MOTIONS
from evfem.scene.schema import sections
from evfem.simulation.run import simulate
from evfem.studies.campaign import bodies, drawing, ending, invariants, run, study, tables
from evfem.tissue.laws import LAWS
from evfem.tissue.space import elements_on

Ending = ending.Ending


@pytest.fixture(scope="module")
def drawn():
    return [drawing.draw(5, number) for number in range(400)]


def test_drawn_scenes_stay_within_the_stated_ranges(drawn):
    for one in drawn[:50]:
        if "electrostatics" not in one:
            continue
        scene = tables.scene_of(one)
        thickness = float(scene.ground.insulator.thickness)
        if not isinstance(scene.voltage, ChargeControl):  # whose voltage is what comes out
            assert scene.electrics.largest_voltage <= min(3000.0, 60e3 * thickness) * (1.0 + 1e-5)
        assert 1e-3 <= thickness <= 0.5
    for one in drawn:
        friction = one["surface"]["friction"]
        friction = np.array(
            friction["friction"] if isinstance(friction, dict) else np.atleast_2d(friction)[:, -1]
        )
        assert friction.min() >= 0.0
        assert friction.max() <= 1.5


def test_every_choice_of_a_scene_file_is_drawn(drawn):
    def seen(name, key):
        return {one.get(name, {}).get(key) for one in drawn}

    assert seen("surface", "kind") == set(SURFACES)
    assert seen("solver", "element") == {None, *elements_on(3), *elements_on(4)}
    for name, key, choices in (
        ("solver", "dynamics", ("viscous", "inertial")),
        ("solver", "contact", ("penalty",)),
        ("electrostatics", "law", ("strong_troxel", "kaczmarek")),
        ("electrostatics", "waveform", ("sine", "square")),
        ("electrostatics", "skin", SKINS),
        ("electrostatics", "insulator", INSULATORS),
        ("electrostatics", "breakdown", MODES),
        ("finger", "mesh", bodies.MESHES),
    ):
        assert seen(name, key) == {None, *choices}, key
    rough = [one["electrostatics"].get("roughness_gap") for one in drawn if "electrostatics" in one]
    spread = {one.get("distribution") for one in rough if isinstance(one, dict)}
    assert spread == {None, *DISTRIBUTIONS}
    signals = [one["electrostatics"].get("signal", {}) for one in drawn if "electrostatics" in one]
    assert {signal.get("kind") for signal in signals} == {None, *SIGNALS}
    materials = [law for one in drawn for law in one["finger"].get("materials", {}).values()]
    assert {law.get("law") for law in materials} == {None, *LAWS}
    motions = [motion for one in drawn for motion in one["motion"]]
    assert {motion["kind"] for motion in motions} == set(MOTIONS)
    assert {motion.get("hold") for motion in motions} == {None, "force"}


#: what a drawn scene never says, and why
NEVER = {
    "surface.file": "`with_files` writes it from points",
    "electrostatics.voltage_file": "`with_files` writes it from a profile",
    "electrostatics.signal.file": "samples stand in the table",
    "electrostatics.signal.full_scale": "of a .wav alone",
    "electrostatics.electrodes": "a map of one's own",
    "electrostatics.coupling": "without effect",
    "electrostatics.insulator_strength": "no number of a run depends on it",
    "electrostatics.grounded": "false has no balance of the source to be checked by",
    "solver.core": "off gives results that depend on the steps, a length changes what is asked for",
    "solver.strategy.hold": "another first rate leads to the same end, or `evfem check` says so",
    "solver.strategy.relaxation": "switched off it leaves scenes without an end",
} | dict.fromkeys(("finger.ridge_pixel", "finger.ridge_dark", "finger.ridge_scan"), "of a print alone")
#: keys that the generator leaves to other tests
LATER = ("friction_law", "depth", "relaxation", "bulk_relaxation", "spacing", "probes", "boundaries")
APART = (
    "finger.materials",
    "finger.boundaries",
    "surface.friction_law",
    "electrostatics.roughness",
    "output.probes",
)


def keys_of_a_scene_file():
    """Every key of every table but those of materials, friction laws and roughness."""
    for one in sections():
        if not one.name.startswith(APART):
            yield from (f"{one.name}.{key.name}".lstrip(".") for key in one.keys if key.name not in LATER)


def keys_in(table, prefix=""):
    for key, value in table.items():
        yield prefix + key
        for one in value if isinstance(value, list) else [value]:
            if isinstance(one, dict) and key != "materials":
                yield from keys_in(one, f"{prefix}{key}.")


def test_every_key_of_a_scene_file_is_drawn(drawn):
    said = {key for one in drawn for key in keys_in(one)}
    assert set(keys_of_a_scene_file()) - said - set(NEVER) == set()
    assert said & set(NEVER) == set()


def test_a_scene_depends_on_its_seed_and_number_alone():
    assert drawing.draw(1, 7) == drawing.draw(1, 7)
    assert drawing.draw(1, 7) != drawing.draw(1, 8)
    assert drawing.draw(1, 7) != drawing.draw(2, 7)


def test_files_beside_a_scene_say_the_same(drawn, tmp_path):
    one = next(t for t in drawn if "points" in t["surface"])
    loaded = tables.loads(tables.text_of(tables.with_files(one, tmp_path)), tmp_path)
    assert (tmp_path / "profile.csv").exists()
    assert loaded.digest() == tables.scene_of(one).digest()


SCENE = {
    "version": 1,
    "finger": {"resolution": "coarse", "ridges": False},
    "surface": {"kind": "flat", "friction": 0.4},
    "electrostatics": {"law": "kaczmarek", "voltage": 800.0, "insulator": "film"},
    "solver": {"element": "q1"},
    "motion": [
        {"kind": "press", "indentation": 0.6, "steps": 2},
        {"kind": "slide", "distance": 2.0, "steps": 4},
        {"kind": "voltage", "voltage": 0.0, "steps": 1},
    ],
}


@pytest.fixture(scope="module")
def correct():
    scene = tables.scene_of(SCENE)
    result = simulate(scene)
    assert invariants.broken(scene, result) == []
    return scene, result


def _column(name, change):
    def corrupt(result):
        values = np.array(getattr(result, name), dtype=float)
        values[3] = change(values[3])
        return replace(result, **{name: values})

    return corrupt


def _field(name, change, row=3):
    def corrupt(result):
        frames, field = list(result.frames), np.array(getattr(result.frames[row], name))
        frames[row] = replace(frames[row], **{name: change(field, frames[row])})
        return replace(result, frames=frames)

    return corrupt


def _one_open_node_pushed(pressure, frame):
    node = np.flatnonzero((frame.contact_status == 0) & (frame.gap > 0.0))[0]
    pressure[node] = 1e-6
    return pressure


CORRUPTED = {
    "finite": _column("stored_energy", lambda v: np.nan),
    "balance": _column("applied_force", lambda v: v * 1.00001),
    "cone": _column("tangential_force", lambda v: v * 1.5),
    "held": _column("indentation", lambda v: v + 1e-4),
    "penetration": _column("min_gap", lambda v: -1e-5),
    "signs": _column("electrostatic_force", lambda v: -v),
    "friction_dissipation falls": _column("friction_dissipation", lambda v: 0.0),
    "viscous_dissipation falls": _column("viscous_dissipation", lambda v: 1e-3),
    "snap_dissipation falls": _column("snap_dissipation", lambda v: v + 1e-3),
    "books": _column("external_work", lambda v: 1.0001 * v),
    "pull": _field("contact_pressure", lambda p, f: p - 1e-4 * p.max()),
    "nodal cone": _field("shear_traction", lambda s, f: 1.001 * s),
    "open nodes": _field("contact_pressure", _one_open_node_pushed),
    "volume": _field("J", lambda J, f: np.where(J.min() == J, -0.1, J)),
}


@pytest.mark.parametrize("name", CORRUPTED)
def test_an_invariant_sees_what_breaks_it(correct, name):
    scene, result = correct
    found = invariants.broken(scene, CORRUPTED[name](result))
    assert name in [one.name for one in found]
    assert next(one.step for one in found if one.name == name) in (4, 5)


@pytest.mark.parametrize("name", [name for name in invariants.NEEDS if name != "apparent_friction"])
def test_friction_may_be_missing_where_nothing_presses_alone(correct, name):
    scene, result = correct
    lost = replace(
        result, in_rooms=result.in_rooms | {name: np.where(result.step == 4, np.nan, result[name])}
    )
    assert [(one.name, one.step) for one in invariants.broken(scene, lost)] == [("finite", 4)]
    lifted = replace(lost, normal_force=np.where(result.step == 4, 0.0, result.normal_force))
    assert "finite" not in [one.name for one in invariants.broken(scene, lifted)]


def test_a_target_that_is_missed_and_attraction_without_voltage_are_seen(correct):
    scene, result = correct
    deeper = replace(result, indentation=result.indentation + 1e-3)
    assert "targets" in [one.name for one in invariants.broken(scene, deeper)]
    assert result.voltage[-1] == result.electrostatic_force[-1] == 0.0
    pulled = replace(result, electrostatic_force=result.electrostatic_force + 1e-12)
    assert "no attraction" in [one.name for one in invariants.broken(scene, pulled)]


def test_a_node_held_at_a_jump_of_friction_breaks_nothing():
    rough = SCENE | {"surface": {"kind": "flat", "friction": [[1.5, 0.2], [1.5, 0.9]]}}
    scene = tables.scene_of(rough)
    result = simulate(scene)
    frame = result.frames[4]
    x = result.mesh.points[:, 0] + frame.displacement[:, 0]
    assert ((np.abs(x - 1.5) < invariants.NEAR) & (frame.contact_status == 1)).any()
    assert invariants.broken(scene, result) == []


TIP = {
    "version": 1,
    "finger": {"kind": "fingertip", "resolution": "coarse", "ridges": "none"},
    "surface": {"kind": "flat", "friction": 0.1},
    "solver": {},
    "motion": [
        {"kind": "press", "indentation": 0.3, "steps": 1},
        {"kind": "slide", "distance": 0.6, "steps": 1, "angle": 30.0},
    ],
}


@pytest.fixture(scope="module")
def solid():
    scene = tables.scene_of(TIP)
    return scene, simulate(scene)


def test_one_scene_in_ten_has_a_finger_in_three_dimensions(drawn):
    solids = [one for one in drawn if one["finger"].get("kind") == "fingertip"]
    assert 0.05 * len(drawn) < len(solids) < 0.15 * len(drawn)
    assert {one["finger"]["resolution"] for one in solids} == {"coarse"}
    slides = [motion for one in solids for motion in one["motion"] if motion["kind"] == "slide"]
    assert len({motion["angle"] for motion in slides}) > 5


def test_a_result_in_three_dimensions_has_the_same_invariants(solid):
    scene, result = solid
    assert invariants.broken(scene, result) == []
    names = ("tangential_force_z", "applied_tangential_force_z")
    more = replace(result, in_space=result.in_space | {name: 2.0 * result[name] for name in names})
    assert [one.name for one in invariants.broken(scene, more)] == ["cone"]
    wide = result.in_space | {"real_contact_area": 1.01 * result["contact_area"]}
    assert [one.name for one in invariants.broken(scene, replace(result, in_space=wide))] == ["signs"]


def ended(monkeypatch, raised):
    def stops(scene):
        raise raised

    monkeypatch.setattr(ending, "simulate", stops)
    return ending.judge(SCENE)


def test_classes_of_ends(monkeypatch):
    assert ended(monkeypatch, NotConverged(2, [1.0], "contact: 3 of 40 nodes keep changing; x")).kind == (
        "contact: N of N nodes keep changing"
    )
    assert ended(monkeypatch, NotConverged(2, [1.0], "no equilibrium in 40 iterations")).outcome == (
        "not_converged"
    )
    explained = NotConverged(2, [1.0], "there is no equilibrium: the attraction exceeds ...")
    assert ended(monkeypatch, explained).outcome == "explained"
    found = ended(monkeypatch, ZeroDivisionError("by\nzero"))
    assert (found.outcome, found.said, found.good) == ("error", "ZeroDivisionError: by zero", False)
    assert ending.judge(SCENE | {"version": 2}).outcome == "refused"


def test_rows_before_a_failure_are_checked_too(monkeypatch, correct):
    bad = CORRUPTED["balance"](correct[1])
    found = ended(monkeypatch, NotConverged(7, [1.0], "the residual grows", bad))
    assert (found.outcome, found.kind, found.steps) == ("invariants_broken", "balance", 7)


@pytest.fixture
def fake(monkeypatch):
    """Judges in this process and in no time: every fifth scene fails."""

    def judged(task):
        (_, number), _ = task
        outcome = "equilibrium" if number % 5 else "not_converged"
        return Ending(outcome, "said", "why", 8, 4, 6000, 20, 8, 0, 0.5 + (number == 1) * 49.5, 0.1)

    monkeypatch.setattr(run, "processes", lambda workers: open_pool(1, None))
    monkeypatch.setattr(run, "judged", judged)


def test_a_campaign_leaves_numbers_table_failures_and_picture(fake, tmp_path):
    result = studies.run("campaign", out=tmp_path, sample=studies.Sample(scenes=10, workers=2))
    numbers = result["numbers"]
    assert (numbers["scenes"], numbers["equilibrium"], numbers["not_converged"]) == (10.0, 8.0, 2.0)
    assert numbers["explained"] == numbers["invariants_broken"] == 0.0
    assert numbers["slowest_over_median"] == pytest.approx(100.0)
    assert sorted(p.name for p in tmp_path.iterdir() if p.is_file()) == [
        f"campaign.{end}" for end in ("csv", "json", "png")
    ]
    assert json.loads((tmp_path / "campaign.json").read_text())["numbers"] == numbers
    with open(tmp_path / "campaign" / "ends.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["scene"] for row in rows] == [str(n) for n in range(10)]
    drawn = [tables.scene_of(drawing.draw(0, n)).total_steps for n in range(10)]
    assert [int(row["requested"]) for row in rows] == drawn
    names = sorted(p.name for p in (tmp_path / "campaign" / "failures").glob("*.toml"))
    assert names == ["seed0-scene0000.toml", "seed0-scene0005.toml"]
    failure = tmp_path / "campaign" / "failures" / "seed0-scene0005.toml"
    assert failure.read_text().startswith("# seed 0, scene 5: not_converged; said\n")
    again = tables.loads(failure.read_text(), failure.parent)
    assert again.digest() == tables.scene_of(drawing.draw(0, 5)).digest()


def test_what_is_done_is_kept_when_a_campaign_is_interrupted(fake, tmp_path, monkeypatch):
    def judged(task):
        if task[0] == (0, 3):
            raise KeyboardInterrupt
        return Ending("equilibrium", cpu_s=0.1)

    monkeypatch.setattr(run, "judged", judged)
    with pytest.raises(KeyboardInterrupt):
        studies.run("campaign", out=tmp_path, sample=studies.Sample(scenes=6, workers=1))
    rows = (tmp_path / "campaign" / "ends.csv").read_text().splitlines()
    assert [row.split(",")[1] for row in rows[1:]] == ["0", "1", "2"]


def test_slowness_compares_with_scenes_of_the_same_size():
    small = [Ending("equilibrium", requested=4, cpu_s=1.0)] * 30
    large = [Ending("equilibrium", requested=400, cpu_s=100.0)] * 30
    assert study.slowness([*small, *large]).max() == 1.0


def test_a_process_ends_at_its_limit_and_another_takes_its_place():
    with processes(1) as pool:
        found = dict(pool(run.judged, {limit: ((0, FEW[0]), limit) for limit in (0.05, 60.0)}))
    assert run._lost(found[0.05], 0.05).outcome == "timeout"
    assert found[60.0].outcome == "equilibrium"


#: the normal suite's scenes, none of which takes more than a few seconds
FEW = (3, 4, 5, 6, 7, 10, 11, 15, 16, 17)
#: ends or not by the rounding of one dense solve in thousands of iterations: the study counts such scenes
BY_ROUNDING = 20
#: every third of the others
REST = sorted({*range(40)} - {*FEW, BY_ROUNDING})[::3]


@pytest.mark.parametrize("number", [*FEW, *(pytest.param(one, marks=pytest.mark.slow) for one in REST)])
def test_a_scene_nobody_chose_ends_in_equilibria(number):
    found = ending.judge(drawing.draw(0, number))
    assert found.good, f"scene {number} of seed 0: {found.outcome}; {found.said}"
