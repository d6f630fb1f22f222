"""The command line as users meet it: in a process of its own, by exit status, messages and files."""

import csv
import errno
import io
import json
import signal
import subprocess
import sys
import time
from contextlib import suppress
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest
from tools.commands import called, contents, printed, process_of, run_process
from tools.fakes import PRESS_AND_SLIDE, SQUARE_SCENE
from tools.meshes import square_mesh

import evfem
from evfem import cli, studies
from evfem.mesh import file as meshfile
from evfem.runfolder import RunFolder
from evfem.simulation.result import COLUMNS
from evfem.studies.campaign import study
from evfem.templates import TEMPLATES

SCENE = f"{SQUARE_SCENE}[output]\nevery = 2\n{PRESS_AND_SLIDE}"
MANY_STEPS = SCENE.replace("steps = 3", "steps = 30").replace("every = 2", "every = 1")
RESULTS = [".checkpoint.rows", "checkpoint.npz", "fields.pvd", "forces.png", "history.csv", "summary.json"]


def history(folder):
    with open(folder / "history.csv", newline="") as file:
        return list(csv.DictReader(file))


def indexed_files(folder):
    root = ElementTree.parse(folder / "fields.pvd").getroot()
    return [entry.attrib["file"] for entry in root.iter("DataSet")]


def files(folder):
    return sorted(path.name for path in folder.iterdir())


def furnished(folder, scene=SCENE):
    """A folder with a mesh and a scene."""
    meshfile.write(square_mesh("quad9"), folder / "square.vtu")
    (folder / "square.toml").write_text(scene)
    return folder


@pytest.fixture
def place(tmp_path):
    return furnished(tmp_path)


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """The scene after `evfem run`, with what it printed."""
    folder = furnished(tmp_path_factory.mktemp("finished"))
    return folder, *run_process(folder, "run", "square.toml")


def test_a_run_leaves_all_its_files_and_a_table(finished):
    folder, status, out, err = finished
    assert (status, "Traceback" in err) == (0, False)
    results = folder / "square-out"
    series = [f"fields_{n:05d}.vtu" for n in (2, 4, 5)]  # every second step, and the last
    assert files(results) == sorted([".evfem-files", *RESULTS, *series])
    assert indexed_files(results) == series
    rows = history(results)
    assert [row["step"] for row in rows] == ["1", "2", "3", "4", "5"]
    assert tuple(rows[0]) == (*COLUMNS, "friction", "stick_share", "slip_share")
    assert [row["motion"] for row in rows] == ["press"] * 2 + ["slide"] * 3
    assert float(rows[1]["indentation"]) == 0.2
    assert float(rows[4]["position"]) == 0.5
    assert (results / "forces.png").read_bytes()[:4] == b"\x89PNG"
    assert all(len(line) <= 80 for line in out.splitlines())
    assert out.splitlines()[-1].startswith("5 of 5 steps in")
    assert "step 5 of 5" in err


def test_a_table_says_how_many_steps_it_leaves_out_and_where_they_are(place, finished):
    assert "left out" not in finished[2]
    (place / "square.toml").write_text(SCENE.replace("steps = 3", "steps = 20"))
    status, out, _ = called(place, "run", "square.toml", "--no-fields", "--no-plots")
    *table, left, last = out.splitlines()
    assert (status, len(table)) == (0, 2 + 2 + 6)
    assert left == "14 of 22 steps are left out here; all are in square-out/history.csv"
    assert last.startswith("22 of 22 steps in")
    assert len(history(place / "square-out")) == 22


def test_over_a_depth_a_run_is_told_in_newtons(place):
    text = SCENE.replace("[finger]", "[finger]\ndepth = 8.0")
    (place / "square.toml").write_text(text)
    status, out, _ = called(place, "run", "square.toml", "--no-fields", "--no-plots")
    assert status == 0
    force, lines = float(history(place / "square-out")[-1]["normal_force"]), out.splitlines()
    assert lines[1].split()[-4:] == ["N"] * 4
    (end,) = (line.split() for line in lines if line.split()[:2] == ["5", "slide"])
    assert float(end[6]) == pytest.approx(8.0 * force, abs=5e-6)


def test_over_a_depth_a_warning_per_mm_of_it_says_so(place):
    law = (
        '[electrostatics]\nlaw = "kaczmarek"\ninsulator_thickness = 0.1\ninsulator_eps_r = 3.0\n'
        'voltage = {kind = "follow_force", position = [0, 1], tangential_force = [9, 9]'
        ", largest_voltage = 9}\n"
    )
    skin = "[finger.electrical]\nstratum_corneum_thickness = 0.3\n"
    text = SCENE.replace("[finger]", "[finger]\ndepth = 8.0").replace("[surface]", f"{skin}{law}[surface]")
    (place / "square.toml").write_text(text)
    _, out, _ = called(place, "run", "square.toml", "--no-fields", "--no-plots")
    *_, missed, unit, _ = out.splitlines()
    assert missed.startswith("warning: step")
    assert "N/mm" in missed
    assert unit == "warning: these warnings are per mm of depth: 0.01 N/mm are 0.08 N over the depth of 8 mm"


def test_a_load_that_drifts_is_told_after_the_run(place):
    (place / "square.toml").write_text(SCENE.replace("friction = 0.2", "friction = 1.2"))
    _, out, _ = called(place, "run", "square.toml", "--no-fields", "--no-plots")
    force = [float(row["applied_force"]) for row in history(place / "square-out")]
    drift = max(abs(f / force[1] - 1.0) for f in force[2:])
    assert drift > 0.05
    assert (
        f'the load drifted by {drift:.1%} at a held indentation; hold = "force" keeps it' in out.splitlines()
    )


def test_another_scene_replaces_results_only_when_told_and_leaves_other_files_alone(place):
    assert called(place, "run", "square.toml", "--out", "here")[0] == 0
    (place / "here" / "notes.txt").write_text("mine")
    (place / "here" / "fields.vtu").write_text("mine too")
    before = contents(place / "here")
    shorter = SCENE.replace("steps = 3", "steps = 1")
    (place / "square.toml").write_text(shorter)
    words = ("run", "square.toml", "--out", "here", "--no-fields", "--no-plots")
    status, out, err = called(place, *words)
    assert (status, out) == (2, "")
    assert err == (
        "evfem: --out: given here, a run of another scene; "
        "allowed: another folder, or --overwrite to replace it\n"
    )
    assert contents(place / "here") == before
    assert called(place, *words, "--overwrite")[0] == 0
    kept = [".checkpoint.rows", ".evfem-files", "checkpoint.npz", "fields.vtu", "history.csv"]
    kept += ["notes.txt", "summary.json"]
    assert files(place / "here") == kept
    assert (place / "here" / "notes.txt").read_text() == "mine"
    assert len(history(place / "here")) == 3


def test_a_finished_result_is_kept_and_said_to_be_complete(finished):
    folder = finished[0]
    before = contents(folder / "square-out")
    for more in ((), ("--resume",), ("--no-fields",)):
        status, out, err = called(folder, "run", "square.toml", *more)
        assert (status, err) == (0, "evfem: the run in square-out is complete, nothing is left to compute\n")
        assert out == finished[2]
        assert contents(folder / "square-out") == before


BARE = ("run", "square.toml", "--no-fields", "--no-plots")


@pytest.mark.parametrize("other", [False, True])
def test_files_that_a_user_puts_beside_a_run_without_them_are_never_removed(place, other):
    assert called(place, *BARE)[0] == 0
    mine = {"forces.png": b"mine", "fields.pvd": b"mine too"}
    for name, data in mine.items():
        (place / "square-out" / name).write_bytes(data)
    before = contents(place / "square-out")
    if other:
        (place / "square.toml").write_text(SCENE.replace("steps = 3", "steps = 1"))
    for more in (("--overwrite",), ("--overwrite", "--no-fields", "--no-plots"), ()):
        status, out, err = called(place, "run", "square.toml", *more)
        assert (status, out) == (2, "")
        assert err == (
            "evfem: --out: given square-out, where fields.pvd was not written by evfem; "
            "allowed: another folder, for files of others are never touched\n"
        )
        assert contents(place / "square-out") == before


def test_what_a_finished_run_lacks_is_written_from_its_checkpoint_or_said(place):
    assert called(place, *BARE)[0] == 0
    results, whole = place / "square-out", "evfem: the run in square-out is complete"
    lacking = ", but it was without fields; --overwrite computes them\n"
    before = contents(results)
    status, out, err = called(place, "run", "square.toml")
    assert (status, err) == (0, f"{whole}, forces.png is written from its checkpoint{lacking}")
    assert out.splitlines()[-1].startswith("5 of 5 steps in")
    assert (results / "forces.png").read_bytes()[:4] == b"\x89PNG"
    assert called(place, "run", "square.toml")[2] == whole + lacking
    assert called(place, *BARE)[2] == f"{whole}, nothing is left to compute\n"
    for name in ("history.csv", "summary.json"):
        (results / name).unlink()
    told = f"{whole}, history.csv and summary.json are written from its checkpoint\n"
    assert called(place, *BARE, "--resume")[::2] == (0, told)
    assert (results / "history.csv").read_bytes() == before["history.csv"]
    now, then = json.loads((results / "summary.json").read_text()), json.loads(before["summary.json"])
    assert now.pop("provenance")["parameters"] == then.pop("provenance")["parameters"]
    assert now == then
    assert called(place, "run", "square.toml", "--overwrite", "--no-plots")[0] == 0
    assert files(results) == sorted(
        {".evfem-files", *RESULTS, *(f"fields_{n:05d}.vtu" for n in (2, 4, 5))} - {"forces.png"}
    )
    (results / "fields_00004.vtu").unlink()
    lacking = ", but it was without the fields in fields_00004.vtu; --overwrite computes them\n"
    assert called(place, "run", "square.toml", "--no-plots")[2] == whole + lacking


def test_a_run_killed_between_its_last_checkpoint_and_its_end_is_completed(place):
    """History and index are a row behind then, and there is no summary."""
    assert called(place, "run", "square.toml", "--no-plots")[0] == 0
    results = place / "square-out"
    before, index = contents(results), (results / "fields.pvd").read_text()
    (results / "summary.json").unlink()
    (results / "history.csv").write_bytes(b"".join(before["history.csv"].splitlines(True)[:-1]))
    (results / "fields.pvd").write_text(
        "".join(line for line in index.splitlines(True) if "00005" not in line)
    )
    (results / ".summary.json.77.tmp").write_text("half")
    told = "evfem: the run in square-out is complete, summary.json is written from its checkpoint\n"
    assert called(place, "run", "square.toml", "--no-plots")[::2] == (0, told)
    now = contents(results)
    assert all(
        now[name] == data for name, data in before.items() if name not in ("summary.json", ".evfem-files")
    )
    assert set(now) == set(before)


def test_a_run_whose_folder_is_in_use_ends_with_a_sentence_and_touches_nothing(place):
    """The first one computes on, is killed, and leaves no lock behind."""
    (place / "square.toml").write_text(MANY_STEPS.replace("steps = 30", "steps = 3000"))
    words, environment = process_of("run", "square.toml", "--no-plots", "--no-fields")
    rows = place / "square-out" / "history.csv"
    with subprocess.Popen(words, cwd=place, env=environment, stderr=subprocess.DEVNULL) as first:
        while first.poll() is None and not (rows.exists() and len(rows.read_bytes().splitlines()) > 3):
            time.sleep(0.002)
        for more in ((), ("--resume",), ("--overwrite",)):
            status, out, err = run_process(place, "run", "square.toml", *more)
            assert (status, out) == (4, "")
            assert err == "evfem: cannot use square-out: another run is at work in it\n"
        assert first.poll() is None
        first.kill()
    done = len(history(place / "square-out"))
    before = contents(place / "square-out")
    status, out, err = called(place, "run", "square.toml")
    assert (status, out) == (2, "")
    # the checkpoint is written first: a kill may leave the history a row behind it
    told = [f"where {n} of 3002 steps of this scene are done; allowed: --resume" for n in (done, done + 1)]
    assert any(sentence in err for sentence in told)
    assert contents(place / "square-out") == before
    assert not [name for name in before if "lock" in name]
    (place / "square.toml").write_text(SCENE)
    assert called(place, "run", "square.toml", "--overwrite", "--no-plots")[0] == 0
    assert len(history(place / "square-out")) == 5


@pytest.mark.parametrize("name", ["history.csv", "fields_00002.vtu", "checkpoint.npz"])
def test_a_file_of_others_in_the_way_stops_the_run_before_it_starts(place, name):
    (place / "here").mkdir()
    (place / "here" / name).write_text("mine")
    status, out, err = called(place, "run", "square.toml", "--out", "here")
    assert (status, out) == (2, "")
    assert err.count("\n") == 1
    assert name in err
    assert files(place / "here") == [name]
    assert (place / "here" / name).read_text() == "mine"


@pytest.mark.parametrize("name", TEMPLATES)
def test_each_template_runs(tmp_path, name):
    """A new folder, three commands: a scene, its plan, its results; a second time nothing is lost."""
    written = {"mesh": ["mesh.toml", "pad.vtu"]}.get(name, [f"{name}.toml"])
    status, out, err = called(tmp_path, "init", "--template", name)
    assert (status, err) == (0, "")
    assert out == f"{', '.join(written)} written; evfem run {name}.toml runs it\n"
    assert files(tmp_path) == written
    assert called(tmp_path, "plan", f"{name}.toml")[0] == 0
    status, out, err = called(tmp_path, "run", f"{name}.toml", "--no-fields", "--no-plots")
    assert (status, "warning" in err) == (0, False)
    rows = history(tmp_path / f"{name}-out")
    assert f"{len(rows)} of {len(rows)} steps" in out
    before = contents(tmp_path)
    status, out, err = called(tmp_path, "init", "--template", name)
    assert (status, out) == (2, "")
    assert err == (f"evfem: FILE: given {name}.toml, which exists; allowed: a file that is not there yet\n")
    assert contents(tmp_path) == before


def test_the_schemas_are_printed_as_json(tmp_path):
    for more, title in (((), "evfem scene"), (("scene",), "evfem scene"), (("sweep",), "evfem sweep")):
        status, out, err = called(tmp_path, "schema", *more)
        assert (status, err) == (0, "")
        assert json.loads(out)["title"] == title
        assert called(tmp_path, "schema", *more, "--out", "s.json") == (0, "s.json\n", "")
        assert (tmp_path / "s.json").read_text() == out


def test_the_bare_command_shows_its_help(place, capsys):
    status, out, err = called(place)
    assert (status, err) == (0, "")
    assert called(place, "--help")[1] == out
    assert out.startswith("usage: evfem")


def test_the_package_is_the_command(place):
    words, environment = process_of("plan", "square.toml")
    words[1:3] = ["-m", "evfem"]
    done = subprocess.run(words, cwd=place, env=environment, capture_output=True, text=True, timeout=300)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == called(place, "plan", "square.toml")[1]


def test_a_sweep_is_no_scene_and_a_scene_no_sweep(place):
    (place / "sweep.toml").write_text("version = 1\nscene = 'square.toml'\n[grid]\nfinger.depth = [1.0]\n")
    sentence = "{}: given {}, a {}; allowed: a {}; evfem {} {} runs this one"
    for command in (("run",), ("plan",), ("mesh", "--out", "m.vtu")):
        told = sentence.format("scene", "sweep.toml", "sweep", "scene", "sweep", "sweep.toml")
        assert called(place, *command, "sweep.toml") == (2, "", f"evfem: {told}\n")
    told = sentence.format("sweep", "square.toml", "scene", "sweep", "run", "square.toml")
    assert called(place, "sweep", "square.toml") == (2, "", f"evfem: {told}\n")
    (place / "neither.toml").write_text("version = 1\n[fingre]\n")
    assert "fingre" in called(place, "run", "neither.toml")[2]
    assert files(place) == ["neither.toml", "square.toml", "square.vtu", "sweep.toml"]


class Full(io.StringIO):
    """A full disk under the output, which says so once."""

    told = False

    def flush(self):
        if not self.told:
            self.told = True
            raise OSError(errno.ENOSPC, "No space left on device")


def test_output_that_cannot_be_written_is_said_so(place, monkeypatch, capsys):
    monkeypatch.chdir(place)
    monkeypatch.setattr(sys, "stdout", Full())
    monkeypatch.setattr(cli, "_silence", lambda: None)
    assert cli.main(["plan", "square.toml"]) == 4
    assert capsys.readouterr().err == "evfem: cannot write the output: No space left on device\n"


def test_another_failure_of_the_system_is_not_taken_for_one_of_the_output(monkeypatch, capsys):
    def fail(given):
        raise OSError(errno.EADDRINUSE, "Address already in use")

    monkeypatch.setattr(cli, "_plan", fail)
    assert cli.main(["plan"]) == 4
    assert capsys.readouterr().err == f"evfem: [Errno {errno.EADDRINUSE}] Address already in use\n"


BAD_SCENES = {
    "unknown key": ("friction = 0.2", "frictoin = 0.2", "surface.frictoin"),
    "no TOML": ("version = 1", "version = ", "scene"),
    "missing mesh": ("square.vtu", "none.vtu", "finger.mesh"),
    "mesh that is none": ("square.vtu", "square.toml", "finger.mesh"),
    "voltage without skin": ("[output]", "[electrostatics]\nlaw = 'kaczmarek'\nvoltage = 1\n"
                             "insulator_thickness = 0.1\ninsulator_eps_r = 3\n[output]", "finger"),
    "below the finger": ("friction = 0.2", "friction = 0.2\ny = 1.0", "surface.y"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD_SCENES)
def test_bad_input_is_one_sentence_and_writes_nothing(place, case):
    old, new, key = BAD_SCENES[case]
    assert old in SCENE
    (place / "square.toml").write_text(SCENE.replace(old, new))
    before = files(place)
    status, out, err = called(place, "run", "square.toml")
    assert (status, out) == (2, "")
    assert err.removeprefix("evfem: ").removeprefix("square.toml: ").startswith(key)
    assert err.count("square.toml") == 1  # in one case it is the mesh that is named
    assert err.count("\n") == 1
    assert files(place) == before


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["fly"], "invalid choice"),
        (["run", "none.toml"], "No such file"),
        (["run", "--fast"], "unrecognized"),
        (["run", "--output", "x"], "evfem run: unrecognized arguments: --output; did you mean --out? (see"),
        (["texture", "estimate", "weave", "--speed", "fast"], "given 'fast'; allowed: a number (see evfem t"),
        (["studio", "--port", "8.5"], "--port: given '8.5'; allowed: a whole number (see"),
        (["run", "--resume"], "--resume"),
        (["run", "square.toml", "--resume", "--overwrite"], "not allowed with"),
        (["mesh"], "--out"),
        (["mesh", "square.toml", "--out", "m.stl"], "--out"),
        (["plan", "none.toml"], "No such file"),
        (["study"], "NAME"),
        (["init", "--template", "dislpay"], "did you mean display?"),
    ],
)
def test_wrong_arguments_are_one_sentence_and_write_nothing(place, arguments, words):
    before = files(place)
    status, out, err = called(place, *arguments)
    assert (status, out) == (2, "")
    assert words in err
    assert err.count("\n") == 1
    assert files(place) == before


def test_a_step_that_does_not_converge_keeps_what_went_before(place):
    crush = SCENE.replace("distance = 0.5\nsteps = 3", "distance = 0.5\nsteps = 2")
    crush += "[[motion]]\nkind = 'press'\nindentation = 1.99\nsteps = 1\n"
    (place / "square.toml").write_text(crush)
    status, out, err = called(place, "run", "square.toml")
    assert status == 3
    message = err.splitlines()[-1]
    assert message.startswith("evfem: square.toml: step 5 did not converge (last residuals: ")
    assert "try" in message
    assert "Traceback" not in err
    assert len(history(place / "square-out")) == 4
    assert indexed_files(place / "square-out") == ["fields_00002.vtu", "fields_00004.vtu"]
    summary = json.loads((place / "square-out" / "summary.json").read_text())
    assert (summary["complete"], summary["steps"], summary["requested_steps"]) == (False, 4, 5)
    assert "4 of 5 steps" in out


def test_a_folder_that_cannot_be_made_is_exit_status_4(place):
    (place / "file").write_text("not a folder")
    status, out, err = called(place, "run", "square.toml", "--out", "file/results")
    assert (status, out) == (4, "")
    assert err.count("\n") == 1  # before anything is computed
    assert "file/results" in err.splitlines()[-1]
    assert "Traceback" not in err


def interrupted(place, number):
    """Start the long scene, send a signal after some steps; returns exit status and standard error."""
    (place / "square.toml").write_text(MANY_STEPS)
    words, environment = process_of("run", "square.toml")
    with subprocess.Popen(words, cwd=place, env=environment, stderr=subprocess.PIPE, text=True) as process:
        rows = place / "square-out" / "history.csv"
        while process.poll() is None and not (rows.exists() and len(rows.read_bytes().splitlines()) > 5):
            time.sleep(0.002)
        process.send_signal(number)
        err = process.stderr.read()
    return process.returncode, err


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory):
    """The history of the long scene."""
    folder = furnished(tmp_path_factory.mktemp("uninterrupted"), MANY_STEPS)
    assert called(folder, "run", "square.toml", "--no-fields", "--no-plots")[0] == 0
    return history(folder / "square-out")


@pytest.mark.parametrize("number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.slow)])
def test_an_interrupted_run_keeps_what_has_converged_and_goes_on_to_the_same_end(
    place, uninterrupted, number
):
    status, err = interrupted(place, number)
    results = place / "square-out"
    assert status == 130
    assert "Traceback" not in err
    assert "--resume" in err.splitlines()[-1]
    rows = history(results)
    done = len(rows)
    assert 5 <= done < 32
    assert [int(row["step"]) for row in rows] == list(range(1, done + 1))
    assert len(indexed_files(results)) == done
    assert all((results / name).exists() for name in indexed_files(results))
    assert json.loads((results / "summary.json").read_text())["complete"] is False
    assert not [name for name in files(results) if name.endswith(".tmp")]

    status, _, err = run_process(place, "run", "square.toml", "--resume")
    assert (status, "Traceback" in err) == (0, False)
    assert history(results)[:done] == rows
    assert indexed_files(results) == [f"fields_{n:05d}.vtu" for n in range(1, 33)]
    for resumed, row in zip(history(results), uninterrupted, strict=True):
        for name in ("position", "normal_force", "tangential_force", "friction_dissipation", "stored_energy"):
            assert float(resumed[name]) == pytest.approx(float(row[name]), rel=1e-6, abs=1e-9)


def test_an_interruption_while_the_options_are_made_is_one_line(place, monkeypatch):
    """`evfem texture` loads its laws for that, half a second."""

    def interrupted(arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr(cli, "parser", interrupted)
    assert called(place, "texture", "list") == (130, "", "evfem: interrupted\n")


def test_an_interruption_that_is_dropped_ends_the_run_with_the_step(place, monkeypatch):
    """As Python drops what is raised in a `__del__`."""
    step = RunFolder.step

    def dropping(self, row, frame, checkpoint):
        if row["step"] == 3:
            with suppress(KeyboardInterrupt):
                signal.raise_signal(signal.SIGINT)
        step(self, row, frame, checkpoint)

    monkeypatch.setattr(RunFolder, "step", dropping)
    before = signal.getsignal(signal.SIGTERM)
    status, _, err = called(place, "run", "square.toml")
    assert signal.getsignal(signal.SIGTERM) is before
    assert status == 130
    assert "3 steps are in" in err
    assert len(history(place / "square-out")) == 3


@pytest.mark.parametrize(("element", "kind"), [("q2p1", "quad9"), ("q1", "quad")])
@pytest.mark.parametrize("ending", [".vtu", ".msh"])
def test_mesh_writes_the_mesh_the_scene_computes_on(tmp_path, element, kind, ending):
    text = f"version = 1\n[finger]\nresolution = 'coarse'\n[solver]\nelement = '{element}'\n"
    text += "[surface]\nkind = 'flat'\n[[motion]]\nkind = 'press'\nforce = 0.1\n"
    (tmp_path / "scene.toml").write_text(text)
    status, out, _ = called(tmp_path, "mesh", "scene.toml", "--out", f"finger{ending}")
    assert status == 0
    mesh = meshfile.read(tmp_path / f"finger{ending}")
    assert mesh.kind == kind
    assert set(mesh.region_names) == {"stratum_corneum", "epidermis", "dermis", "hypodermis", "nail"}
    assert {"pad", "bone", "nail"} <= set(mesh.node_sets)
    assert f"{len(mesh.points)} nodes" in out


def test_a_study_writes_its_numbers_series_and_picture_where_it_is_told(tmp_path):
    status, out, err = run_process(tmp_path, "study", "section321", "--quick", "--out", "here")
    assert (status, err) == (0, "study section321: a few seconds\n")
    assert files(tmp_path / "here") == ["section321.csv", "section321.json", "section321.png"]
    assert "76.2 um      here 76.17     as printed" in out
    assert out.splitlines()[-1] == "here/section321.json"
    written = json.loads((tmp_path / "here" / "section321.json").read_text())
    assert written["study"] == "section321"
    assert set(written) == {"study", "numbers", "paper", "assumptions", "provenance"}
    assert (tmp_path / "here" / "section321.csv").read_text().startswith("series,x,y,unit\n")


def test_all_means_every_study_but_those_that_stand_apart(monkeypatch, tmp_path):
    ran = []
    monkeypatch.setattr(studies, "NAMES", ("laws", "peers", "fig05", "campaign"))
    monkeypatch.setattr(studies, "run", lambda *words: ran.append(words) or {"assumptions": {}})
    assert cli.main(["study", "fig05", "all", "--out", str(tmp_path)]) == 0
    assert ran == [("fig05", False, tmp_path, None), ("laws", False, tmp_path, None)]


def test_scenes_of_a_campaign_are_chosen_by_options_that_others_refuse(monkeypatch, tmp_path):
    ran, found = [], SimpleNamespace(finish=lambda out, quick: {"assumptions": {}})
    monkeypatch.setattr(study, "main", lambda quick, out, sample: ran.append(sample) or found)
    assert cli.main(["study", "campaign", "--scenes", "7", "--seed", "3", "--out", str(tmp_path)]) == 0
    assert ran == [studies.Sample(scenes=7, seed=3)]
    for words in (["laws", "--seed", "3"], ["campaign", "--scenes", "0"], ["campaign", "--seed", "-1"]):
        status, _, err = called(tmp_path, "study", *words)
        assert status == 2
        assert "allowed:" in err


def test_version_and_help_are_quick_to_load_and_print():
    heavy = "{'numpy', 'scipy', 'matplotlib', 'skfem'}"
    for words in (["--version"], ["--help"], ["run", "--help"]):
        code = f"from evfem.cli import main\nstatus = main({words})\n"
        code += f"print(sorted({heavy} & set(sys.modules)))\nsys.exit(status)"
        assert printed(code).splitlines()[-1] == "[]"
    assert run_process(".", "--version")[1] == f"evfem {evfem.__version__}\n"


@pytest.mark.parametrize(
    ("words", "change", "meant"),
    [
        (["plan", "scen.toml"], "", "scene.toml?"),
        (["plan", "scene.toml"], '[finger]\nresolution = "corse"\n', "coarse? (coarse | "),
        (["study", "section321", "fig5"], "", "fig05? (section321"),
        (["texture", "show", "weav"], "", "weave? ("),
    ],
)
def test_what_may_have_been_meant_comes_first(tmp_path, words, change, meant):
    press = 'version = 1\n[surface]\nkind = "flat"\n[[motion]]\nkind = "press"\nindentation = 0.1\n'
    (tmp_path / "scene.toml").write_text(press + change)
    status, out, err = called(tmp_path, *words)
    assert (status, out) == (2, "")
    assert f"allowed: {meant}" in err


def test_numbers_of_numpy_are_shown_as_numbers():
    with pytest.raises(evfem.errors.InputError, match=r"given 400\.0; allowed: 12 to 24 mm"):
        evfem.FingerPad(width=np.float64(400.0))
