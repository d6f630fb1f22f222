"""Sweeps run: the numbers of single runs, failures in the table, kills, resuming, processes and Dask."""

import csv
import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import tomli_w
from tools.commands import contents
from tools.meshes import block
from tools.refusals import refuses
from tools.workers import work_or_die

import evfem as ev
from evfem import cli
from evfem.common import pools
from evfem.common.storage import alone_in
from evfem.errors import InputError
from evfem.mesh import file as meshfile
from evfem.scene import file as scenefile
from evfem.sweeps import file as sweepfile
from evfem.sweeps import folder as sweepfolder
from evfem.sweeps import table as sweeptable
from evfem.sweeps.run import compute
from evfem.sweeps.table import table_units, units_of

SWEEP = """
version = 1
outputs = ["normal_force.last", "normal_force.mean", "tangential_force.min.1", "indentation.min"]
[scene.finger]
mesh = "block.vtu"
[scene.finger.materials.tissue]
law = "neo_hookean"
E = 0.1
nu = 0.4
[scene.surface]
kind = "flat"
[[scene.motion]]
kind = "press"
indentation = 0.2
steps = 2
[[scene.motion]]
kind = "slide"
distance = 0.2
steps = 2
[grid]
surface.friction = [0.2, 0.4, -1.0]
motion.0.indentation = [0.1, 0.2]
"""


@pytest.fixture
def plan(tmp_path):
    """Six points on a block of 45 nodes, two of them with a friction that cannot be."""
    meshfile.write(block(), tmp_path / "block.vtu")
    (tmp_path / "many.toml").write_text(SWEEP)
    return tmp_path / "many.toml"


def table(folder):
    with (folder / "sweep.csv").open(newline="") as lines:
        rows = list(csv.DictReader(lines))
    return [{name.split(" (")[0]: value for name, value in row.items()} for row in rows]


def test_the_table_has_the_numbers_of_single_runs(plan):
    result = ev.sweep(plan, workers=1)
    assert result.columns[:3] == ("point", "surface.friction", "motion.0.indentation")
    assert [row["status"] for row in result.rows] == ["done"] * 4 + ["refused"] * 2
    for point in sweepfile.load(plan).points()[:4]:
        run = ev.simulate(scenefile.loads(point.text, plan.parent))
        row = result.rows[point.index]
        assert row["normal_force.last"] == run.normal_force[-1]
        way = np.concatenate([run.indentation[:2], run.indentation[1] + run.position[2:]])
        area = way[0] * run.normal_force[0] + np.trapezoid(run.normal_force, way)
        assert row["normal_force.mean"] == pytest.approx(area / way[-1], rel=1e-14)
        assert row["tangential_force.min.1"] == run.tangential_force[2:].min()
        assert row["indentation.min"] == run.indentation.min()
    assert result.rows[4]["message"].startswith("surface.friction: given -1.0; allowed: a number")
    assert np.isnan(result["normal_force.last"][4:]).all()
    assert result["status"][-1] == "refused"
    refuses('column: given "force"', lambda: result["force"])
    assert repr(result) == "SweepResult(6 points: 4 done, 2 refused)"


def test_the_folder_has_table_parquet_and_provenance(plan, tmp_path):
    from pyarrow import parquet

    result = ev.sweep(plan, tmp_path / "out", workers=1)
    rows = table(tmp_path / "out")
    assert [float(row["normal_force.last"]) for row in rows[:4]] == result["normal_force.last"][:4].tolist()
    assert rows[5]["normal_force.last"] == ""
    read = parquet.read_table(tmp_path / "out" / "sweep.parquet")
    assert read.column_names == list(result.columns)
    assert read["normal_force.last"].to_pylist() == [row["normal_force.last"] for row in result.rows]
    assert read["message"].to_pylist() == [row["message"] for row in result.rows]
    made = json.loads((tmp_path / "out" / "sweep.json").read_text())
    assert made["points"] == {"requested": 6, "done": 4, "refused": 2, "not_converged": 0, "failed": 0}
    assert made["scene"]["tables"]["finger"]["materials"]["tissue"]["E"] == 0.1
    assert made["means"] == {"normal_force.mean": ["path"]}
    assert made["grid"] == {"surface.friction": [0.2, 0.4, -1.0], "motion.0.indentation": [0.1, 0.2]}
    assert made["versions"]["evfem"] == ev.__version__
    assert made["complete"]
    result.to_csv(tmp_path / "again.csv")
    assert (tmp_path / "again.csv").read_bytes() == (tmp_path / "out" / "sweep.csv").read_bytes()
    assert result.table()["status"].tolist() == result["status"]


def test_samples_are_in_the_provenance(plan, tmp_path):
    samples = (
        "[samples]\ncount = 2\nseed = 9\n[samples.parameters]\nsurface.friction = {uniform = [0.1, 0.2]}"
    )
    plan.write_text(SWEEP.replace("surface.friction = [0.2, 0.4, -1.0]", "") + samples)
    result = ev.sweep(plan, tmp_path / "out", workers=1)
    made = json.loads((tmp_path / "out" / "sweep.json").read_text())["samples"]
    assert made["of"] == {"surface.friction": "Uniform(low=0.1, high=0.2)"}
    assert (made["seed"], made["count"], made["method"]) == (9, 2, "latin_hypercube")
    drawn = sweepfile.load(plan).samples.draw()["surface.friction"]
    np.testing.assert_array_equal(result["surface.friction"], np.tile(drawn, 2))


def test_a_finished_point_is_never_computed_again(plan, tmp_path, monkeypatch):
    out, computed = tmp_path / "out", []
    ev.sweep(plan, out, workers=1)
    before = table(out)
    evaluate = ev.sweep.__globals__["evaluate"]
    monkeypatch.setitem(
        ev.sweep.__globals__, "evaluate", lambda job: computed.append(job[0]) or evaluate(job)
    )
    again = ev.sweep(plan, out, workers=1)
    assert computed == []
    assert again.provenance["reused"] == 4
    assert table(out) == before
    # one point lost, one damaged, one of another format, and one that is new
    lost, damaged, foreign, kept = sorted((out / "points").iterdir())
    lost.unlink()
    damaged.write_text(damaged.read_text()[:-9])
    foreign.write_text(foreign.read_text().replace("point-3", "point-2"))
    stamp = kept.stat().st_mtime_ns
    plan.write_text(SWEEP.replace("[0.1, 0.2]\n", "[0.05, 0.1, 0.2]\n"))
    third = ev.sweep(plan, out, workers=1)  # it grew, so that nothing of it belongs to another
    assert len(computed) == 3 + 2
    assert kept.stat().st_mtime_ns == stamp
    for row in before[:4]:
        same = [r for r in third.rows if str(r["surface.friction"]) == row["surface.friction"]]
        same = [r for r in same if str(r["motion.0.indentation"]) == row["motion.0.indentation"]]
        assert [str(r["normal_force.last"]) for r in same] == [row["normal_force.last"]]
    # with other outputs every point is another
    plan.write_text(SWEEP.replace('"indentation.min"', '"indentation.max"'))
    fourth = ev.sweep(plan, out, workers=1, resume=True)
    assert fourth.provenance["reused"] == 0
    np.testing.assert_allclose(fourth["indentation.max"][:4], [0.1, 0.2] * 2, rtol=1e-12)
    # and so with another mesh
    meshfile.write(block(height=1.9), tmp_path / "block.vtu")
    assert ev.sweep(plan, out, workers=1, resume=True).provenance["reused"] == 0


def test_points_of_another_sweep_are_kept_unless_told_otherwise(plan, tmp_path, capsys):
    out = tmp_path / "out"
    ev.sweep(plan, out, workers=1)
    before = contents(out)
    plan.write_text(SWEEP.replace("[0.1, 0.2]\n", "[0.1, 0.15]\n"))
    assert cli.main(["sweep", str(plan), "--out", str(out), "--workers", "1"]) == 2
    assert capsys.readouterr().err == (
        f"evfem: --out: given {out}, with 2 points of another sweep; "
        "allowed: another folder, --resume to keep them, --overwrite to remove them\n"
    )
    assert contents(out) == before
    now = ev.__version__
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ev, "__version__", "9.9.9")
        refuses(rf"points of evfem '{re.escape(now)}', not of '9\.9\.9';", ev.sweep, plan, out, workers=1)
    refuses("resume and overwrite", ev.sweep, plan, out, workers=1, resume=True, overwrite=True)
    # told to keep them, the folder has both, and the one started last goes on by itself
    assert ev.sweep(plan, out, workers=1, resume=True).provenance["reused"] == 2
    assert len(list((out / "points").iterdir())) == 6
    assert ev.sweep(plan, out, workers=1).provenance["reused"] == 4
    assert "is complete" not in capsys.readouterr().err
    assert cli.main(["sweep", str(plan), "--out", str(out), "--workers", "1"]) == 3
    assert f"evfem: the sweep in {out} is complete, nothing is left to compute" in capsys.readouterr().err
    # told to remove them, it begins anew
    assert ev.sweep(plan, out, workers=1, overwrite=True).provenance["reused"] == 0
    assert len(list((out / "points").iterdir())) == 4


def test_equal_points_are_computed_once(plan, monkeypatch):
    computed, evaluate = [], ev.sweep.__globals__["evaluate"]
    monkeypatch.setitem(
        ev.sweep.__globals__, "evaluate", lambda job: computed.append(job[0]) or evaluate(job)
    )
    plan.write_text(SWEEP.replace("[0.2, 0.4, -1.0]", "[0.2, 0.2]"))
    result = ev.sweep(plan, workers=1)
    assert len(computed) == 2
    assert result.rows[0]["normal_force.last"] == result.rows[2]["normal_force.last"]


def test_remarks_say_which_point_its_parameters_and_what_to_do(plan, tmp_path, monkeypatch, capsys):
    run = ev.sweep.__globals__["simulate"]

    def failing(scene):
        if scene.surface.friction == 0.2:
            raise ev.NotConverged(3, [1.0], "try smaller steps")
        return run(scene)

    monkeypatch.setitem(ev.sweep.__globals__, "simulate", failing)
    assert cli.main(["sweep", str(plan), "--out", str(tmp_path / "out"), "--workers", "1"]) == 3
    told = [one for one in capsys.readouterr().err.splitlines() if "point 0" in one or "more" in one]
    assert told == [
        "evfem: point 0 (surface.friction = 0.2, motion.0.indentation = 0.1 mm): step 3 did not converge "
        "(last residuals: 1.0e+00); try smaller steps; the scene with these values, run alone (evfem run), "
        "keeps the steps before",
        "evfem: 1 more without a result: column `message` of the table",
    ]
    found = sweeptable.read(tmp_path / "out")
    assert [len(found.remarks(most)) for most in (1, 4)] == [2, 4]


def test_a_slide_that_ends_before_all_slips_is_told_in_its_row(plan):
    """A block of 0.1 MPa with friction of 40 sticks throughout a slide of 0.02 mm, with 0.01 it slips."""
    text = SWEEP.replace("[0.2, 0.4, -1.0]", "[40.0, 0.01]").replace("distance = 0.2", "distance = 0.02")
    plan.write_text(text.replace("tangential_force.min.1", "tangential_force.last.1"))
    result = ev.sweep(plan, workers=1)
    stuck = (
        "100 % of the contact still sticks at the end of motion 1, so its friction is not that of sliding; "
    )
    assert result["message"] == [f"{stuck}a longer distance slides"] * 2 + [""] * 2
    assert result["status"] == ["done"] * 4
    which = "point 0 (surface.friction = 40.0, motion.0.indentation = 0.1 mm)"
    assert result.remarks()[0] == f"{which}: {result['message'][0]}"
    plan.write_text(text)  # the least friction of a slide is at its beginning
    assert ev.sweep(plan, workers=1)["message"] == [""] * 4


def test_points_that_fail_are_rows_with_their_message(plan, tmp_path, monkeypatch):
    def failing(scene):
        friction = scene.surface.friction
        if friction == 0.2:
            raise ev.NotConverged(3, [1.0, 0.5], "try smaller steps")
        raise ZeroDivisionError("by nothing")

    monkeypatch.setitem(ev.sweep.__globals__, "simulate", failing)
    result = ev.sweep(plan, tmp_path / "out", workers=1)
    assert result["status"] == ["not_converged"] * 2 + ["failed"] * 2 + ["refused"] * 2
    assert result.rows[0]["message"].startswith("step 3 did not converge")
    assert result.rows[2]["message"] == "ZeroDivisionError: by nothing"
    # what failed for an unknown reason is tried again, what did not converge is not
    monkeypatch.undo()
    again = ev.sweep(plan, tmp_path / "out", workers=1)
    assert again["status"] == ["not_converged"] * 2 + ["done"] * 2 + ["refused"] * 2


def test_a_sweep_without_a_valid_point_writes_nothing(plan, tmp_path):
    plan.write_text(SWEEP.replace("surface.friction = [0.2, 0.4, -1.0]", "surface.fricton = [0.2]"))
    with pytest.raises(InputError, match=r"^surface\.fricton: given an unknown key; allowed: friction\?"):
        ev.sweep(plan, tmp_path / "out", workers=1)
    plan.write_text(SWEEP.replace("[0.2, 0.4, -1.0]", "[-1.0, -2.0]"))
    sentence = r"^surface\.friction: given -1\.0; allowed: a number .* \(no point of the sweep is valid\)$"
    refuses(sentence, ev.sweep, plan, tmp_path / "out", workers=1)
    assert not (tmp_path / "out").exists()


def test_files_of_others_are_never_touched(plan, tmp_path):
    out = tmp_path / "out"
    (out / "points").mkdir(parents=True)
    refuses("points was not written by a sweep", ev.sweep, plan, out, workers=1)
    (out / "points").rmdir()
    ev.sweep(plan, out, workers=1)
    for name in ("mine.csv", "points/mine.json", f"points/.{64 * 'a'}.json.123.tmp"):
        (out / name).write_text("mine")
    plan.write_text(SWEEP.replace("[0.1, 0.2]\n", "[0.15]\n"))
    ev.sweep(plan, out, workers=1, overwrite=True)
    assert {p.name for p in out.iterdir()} == {
        ".evfem-sweep", "mine.csv", "points", "sweep.csv", "sweep.json", "sweep.parquet"
    }  # fmt: skip
    assert len(list((out / "points").iterdir())) == 3  # two points of the new sweep, and mine


@pytest.mark.parametrize("more", [{}, {"overwrite": True}, {"resume": True}])
@pytest.mark.parametrize("name", ["sweep.parquet", f"points/{64 * 'a'}.json"])
def test_a_file_of_others_that_a_sweep_never_wrote_stops_it(plan, tmp_path, monkeypatch, name, more):
    out = tmp_path / "out"
    monkeypatch.setattr(sweepfolder, "find_spec", lambda package: None)  # no pyarrow
    ev.sweep(plan, out, workers=1)
    monkeypatch.undo()
    (out / name).write_text("mine")
    before = contents(out)
    with pytest.raises(InputError, match=rf"where {Path(name).name} was not written by a sweep; allowed"):
        ev.sweep(plan, out, workers=1, **more)
    assert contents(out) == before


def test_a_process_that_dies_costs_its_own_point_alone(tmp_path):
    words = {"a": "1", "b": "die", "c": "333", "d": "4444", "e": "55555", "f": "666666"}
    jobs = {key: (str(tmp_path / "died"), word) for key, word in words.items()}
    kept = {}
    with pools.open_pool(2, None) as pool:
        compute(work_or_die, jobs, pool, kept.__setitem__)
    assert {key: answer.outputs.get("length") for key, answer in kept.items()} == {
        "a": 1.0, "b": None, "c": 3.0, "d": 4.0, "e": 5.0, "f": 6.0
    }  # fmt: skip
    assert (kept["b"].status, kept["b"].message[:16]) == ("failed", "its process died")


def test_a_script_without_guard_is_told_so(tmp_path):
    script = (
        "from evfem.common import pools\nwith pools.open_pool(2, None) as pool: list(pool(abs, {0: 1}))\n"
    )
    (tmp_path / "script.py").write_text(script)
    done = subprocess.run([sys.executable, "script.py"], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 1
    assert done.stderr.count("Traceback") == 1  # nothing of the processes
    assert "workers: given 2, and no process can start; allowed: workers=1, or the call below" in (
        done.stderr.replace("\n", " ")
    )


LONG = SWEEP.replace("[0.1, 0.2]\n", f"{[round(0.1 + 0.002 * i, 6) for i in range(12)]}\n")


def started(plan, out, *options):
    words = [sys.executable, "-m", "evfem.cli", "sweep", str(plan), "--out", str(out), *options]
    return subprocess.Popen(words, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


def until(true, seconds=60.0):
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end
        time.sleep(0.02)


def children(pid):
    """Processes whose parent is `pid`."""
    found = []
    for name in os.listdir("/proc"):
        if name.isdecimal():
            try:
                with open(f"/proc/{name}/stat") as file:
                    fields = file.read().rsplit(")", 1)[1].split()
            except OSError:
                continue
            if int(fields[1]) == pid and fields[0] != "Z":
                found.append(int(name))
    return found


@pytest.mark.parametrize("number", [signal.SIGKILL, pytest.param(signal.SIGINT, marks=pytest.mark.slow)])
def test_a_killed_sweep_leaves_whole_points_and_goes_on(plan, tmp_path, number):
    plan.write_text(LONG)
    out = tmp_path / "out"
    run = started(plan, out, "--workers", "2")
    until(lambda: (out / "points").is_dir() and len(list((out / "points").glob("[!.]*"))) >= 3)
    workers = children(run.pid)
    os.kill(run.pid, number)
    message = run.communicate(timeout=60)[1]
    assert run.returncode == (130 if number == signal.SIGINT else -signal.SIGKILL), message
    assert workers
    until(lambda: not any(os.path.exists(f"/proc/{pid}/fd/0") for pid in workers))  # no orphans
    kept = {p.name: p.stat().st_mtime_ns for p in (out / "points").glob("[!.]*")}
    assert 3 <= len(kept) < 24
    for name in kept:
        assert sweepfolder.SweepFolder(out).read(name.removesuffix(".json")).status == "done"
    if number == signal.SIGINT:
        assert f"interrupted; finished points are in {out}, the same command goes on there" in message
        assert len(table(out)) == len(kept) + 12
    assert cli.main(["sweep", str(plan), "--out", str(out), "--workers", "1"]) == 3
    assert len(table(out)) == 36
    now = {p.name: p.stat().st_mtime_ns for p in (out / "points").iterdir()}
    assert len(now) == 24
    assert {name: now[name] for name in kept} == kept


@pytest.mark.parametrize(
    "more", [{"outputs": "none"}, {"outputs": {"a": 1.0}, "over": ["b"]}, {"message": "\ud800"}]
)
def test_a_point_that_no_table_can_hold_is_damaged(tmp_path, more):
    folder = sweepfolder.SweepFolder(tmp_path)
    (tmp_path / "points").mkdir()
    told = {"format": sweepfolder.FORMAT, "status": "done", "seconds": 1.0, "message": "", "outputs": {}}
    for changed, known in (({}, True), (more, False)):
        (tmp_path / "points" / "a.json").write_text(json.dumps(told | changed))
        assert (folder.read("a") is not None) == known


@pytest.mark.parametrize("options", [("--workers", "2"), ("--workers", "1", "--scheduler", "local")])
def test_ctrl_c_while_processes_start_is_one_line(plan, tmp_path, options):
    """A terminal sends it to all of them, and Python says where each was."""
    words = [sys.executable, "-m", "evfem.cli", "sweep", str(plan), "--out", str(tmp_path / "out"), *options]
    with subprocess.Popen(words, stderr=subprocess.PIPE, text=True, start_new_session=True) as run:
        until(lambda: len(children(run.pid)) >= 2)  # one beside multiprocessing's tracker
        time.sleep(0.1)  # it imports
        os.killpg(run.pid, signal.SIGINT)
        message = run.communicate(timeout=60)[1]
    told = f"interrupted; finished points are in {tmp_path / 'out'}, the same command goes on there"
    assert [line for line in message.splitlines() if "valid scene" not in line] == [f"evfem: {told}"]


def test_a_folder_in_which_a_sweep_is_at_work_is_refused(plan, tmp_path, capsys):
    out = tmp_path / "out"
    with alone_in(out):
        for more in ((), ("--resume",), ("--overwrite",)):
            assert cli.main(["sweep", str(plan), "--out", str(out), "--workers", "1", *more]) == 4
            assert capsys.readouterr().err == f"evfem: cannot use {out}: another run is at work in it\n"


def test_a_dask_cluster_gives_the_same_numbers(plan):
    from distributed import LocalCluster

    alone = ev.sweep(plan, workers=1)
    with LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address="127.0.0.1:0", protocol="tcp"
    ) as cluster:
        beside = ev.sweep(plan, scheduler=cluster.scheduler_address)
    started_for_it = ev.sweep(plan, scheduler="local", workers=1)
    for other in (beside, started_for_it):
        for name in alone.columns[:-2]:
            np.testing.assert_array_equal(other[name], alone[name])


CLUSTER = """from distributed import LocalCluster
with LocalCluster(n_workers=1, processes=False, dashboard_address="127.0.0.1:0", protocol="tcp") as cluster:
    print(cluster.scheduler_address, flush=True)
    input()
"""


def test_a_cluster_that_goes_away_is_one_line(plan, tmp_path):
    """Dask's client logs where it was."""
    plan.write_text(LONG)
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
    with subprocess.Popen([sys.executable, "-c", CLUSTER], **pipes, text=True) as cluster:
        run = started(plan, tmp_path / "out", "--scheduler", cluster.stdout.readline().strip())
        until(lambda: any((tmp_path / "out" / "points").glob("[!.]*")))
        cluster.kill()
        message = run.communicate(timeout=60)[1]
    told = f"evfem: {plan}: scheduler: given a cluster that went away; allowed: resume on another"
    lines = [line for line in message.splitlines() if " of " not in line]
    assert (run.returncode, lines) == (2, [told])


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"workers": 0}, "workers: given 0"),
        ({"workers": 2, "scheduler": "tcp://127.0.0.1:1"}, "allowed: no workers beside the address"),
        ({"scheduler": "nowhere"}, "allowed: the address of a running Dask scheduler"),
    ],
)
def test_pools_that_cannot_be(plan, tmp_path, options, sentence):
    refuses(sentence, ev.sweep, plan, tmp_path / "out", **options)


def test_outputs_are_over_the_depth_of_the_scenes(plan):
    outputs = '["normal_force.last", "contact_area.max", "peak_contact_pressure.last"]'
    text = SWEEP.replace('"block.vtu"', '"block.vtu"\ndepth = 10.0').replace(", -1.0]", "]")
    old = SWEEP.splitlines()[2]
    plan.write_text(text.replace(old, f"outputs = {outputs}"))
    result = ev.sweep(plan, workers=1)
    run = ev.simulate(scenefile.loads(sweepfile.load(plan).points()[0].text, plan.parent))
    row = result.rows[0]
    assert row["normal_force.last"] == run.total.normal_force[-1] == 10.0 * run.normal_force[-1]
    assert row["contact_area.max"] == run.contact_area.max() == 10.0 * run.contact_width.max()
    assert row["peak_contact_pressure.last"] == run.peak_contact_pressure[-1]
    assert list(result.units.values()) == ["mm", "N", "mm2", "MPa"]
    assert result.provenance["units"]["energy"] == "mJ"


def test_a_column_has_one_unit():
    hover = {"version": 1, "surface": {"kind": "flat"}, "motion": [{"kind": "hover", "gap": 0.5}]}
    kinds = {"finger.kind": ["pad", "fingertip"]}
    with pytest.raises(InputError, match=r"finger\.depth: given normal_force\.last in N and N/mm"):
        ev.sweep(ev.Sweep(hover, grid=kinds, outputs=["normal_force.last"]), workers=1)
    with pytest.raises(InputError, match=r'given "contact_area\.last" of a finger without it'):
        ev.sweep(ev.Sweep(hover, grid={"motion.0.gap": [0.1]}, outputs=["contact_area.last"]), workers=1)
    force = {**hover, "finger": {"kind": "fingertip"}, "motion": [{"kind": "press", "force": 0.5}]}
    spatial = units_of(scenefile.loads(tomli_w.dumps(force)))
    units = table_units(["contact_area.last"], ["motion.0.force"], [spatial])
    assert units == {"contact_area.last": "mm2", "motion.0.force": "N"}


def test_the_command_says_what_became_of_the_points(plan, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["sweep", str(plan), "--workers", "1"]) == 3
    shown = capsys.readouterr()
    assert shown.out == (
        "6 points: 4 done, 2 refused; table in many-out/sweep.csv\nnormal_force.mean: the mean over path\n"
    )
    lines = shown.err.splitlines()
    assert lines[0] == "evfem: 2 of 6 points are no valid scene"
    assert lines[1:-2] == ["point 3 of 6", "point 4 of 6", "point 5 of 6", "point 6 of 6"]
    assert lines[-1].startswith(
        "evfem: point 5 (surface.friction = -1.0, motion.0.indentation = 0.2 mm): surf"
    )
    plan.write_text(SWEEP.replace(", -1.0]", "]"))
    assert cli.main(["sweep", str(plan), "--workers", "1", "--resume"]) == 0
    assert capsys.readouterr().out.startswith("4 points: 4 done; table in many-out/sweep.csv\n")
    assert cli.main(["sweep", "missing.toml"]) == 2


def test_a_scene_alone_is_no_sweep():
    with pytest.raises(InputError, match=r"^sweep: given a Scene; allowed: Sweep\(scene, grid="):
        ev.sweep(ev.default_scene(), {"surface.friction": [0.1, 0.2]})
