"""`evfem run -v`: every step is told and kept with its time, and so is what ended the run."""

import logging
import re
from contextlib import ExitStack
from datetime import datetime, timedelta
from types import SimpleNamespace

import pytest
from tools.commands import called
from tools.fakes import PRESS_AND_SLIDE, SQUARE_SCENE, fake_row
from tools.meshes import square_mesh

from evfem.common import notices
from evfem.mesh import file as meshfile
from evfem.reporting.log import Steps, logged
from evfem.runfolder import result_in
from evfem.scene.file import load
from evfem.simulation.run import simulate

SCENE = f"{SQUARE_SCENE}{PRESS_AND_SLIDE}"
LINE = re.compile(r"(\d{4}-\d\d-\d\d \d\d:\d\d:\d\d),\d{3}  (.*)")


@pytest.fixture
def place(tmp_path):
    meshfile.write(square_mesh("quad9"), tmp_path / "square.vtu")
    (tmp_path / "square.toml").write_text(SCENE)
    return tmp_path


def log_of(folder):
    """(time, text) of each line."""
    lines = (folder / "steps.log").read_text(encoding="utf-8").splitlines()
    found = [LINE.fullmatch(line).groups() for line in lines]
    return [(datetime.fromisoformat(time), text) for time, text in found]


def test_every_step_is_told_and_kept_with_its_time(place):
    before = datetime.now()
    status, out, err = called(place, "run", "square.toml", "-v")
    assert status == 0
    times, texts = zip(*log_of(place / "square-out"), strict=True)
    assert len(texts) == 6
    assert texts[0] == "run of square: 25 nodes, 4 cells, 5 steps"
    result = result_in(place / "square-out")
    for k in range(5):
        force = f"normal {result.normal_force[k]:.4g} N/mm"
        assert texts[k + 1].startswith(f"step {k + 1} of 5, {result.motion[k]}: position ")
        assert force in texts[k + 1]
        assert f"{result.newton_iterations[k]} iterations" in texts[k + 1]
    assert all(f"evfem: {text}" in err for text in texts)
    assert sorted(times) == list(times)
    assert timedelta(seconds=-1) < times[0] - before < timedelta(minutes=2)
    assert "step 1 of 5, press" not in out


def test_without_it_there_is_no_log(place):
    status, _, err = called(place, "run", "square.toml")
    assert status == 0
    assert "normal" not in err
    assert not (place / "square-out" / "steps.log").exists()


def test_a_log_goes_on_and_is_never_removed(place):
    assert called(place, "run", "square.toml", "-v")[0] == 0
    assert called(place, "run", "square.toml", "-v", "--overwrite")[0] == 0
    texts = [text for _, text in log_of(place / "square-out")]
    assert texts.count("run of square: 25 nodes, 4 cells, 5 steps") == 2
    assert called(place, "run", "square.toml", "--overwrite")[0] == 0
    assert [text for _, text in log_of(place / "square-out")] == texts


def test_what_ends_a_run_early_is_a_line(place):
    """A step that one iteration does not solve."""
    hard = SCENE + "[solver.strategy]\niterations = 1\nsmallest_part = 0.5\n"
    (place / "hard.toml").write_text(hard)
    status, _, err = called(place, "run", "hard.toml", "-v")
    assert status == 3, err
    assert re.match(r"ended: step \d did not converge", log_of(place / "hard-out")[-1][1])


def test_a_scene_that_is_refused_leaves_nothing(place):
    (place / "wrong.toml").write_text(SCENE.replace("square.vtu", "other.vtu"))
    before = sorted(path.name for path in place.iterdir())
    assert called(place, "run", "wrong.toml", "-v")[0] == 2
    assert sorted(path.name for path in place.iterdir()) == before


def test_a_folder_of_another_scene_gets_no_log(place):
    assert called(place, "run", "square.toml")[0] == 0
    (place / "square.toml").write_text(SCENE.replace("0.2", "0.1"))
    assert called(place, "run", "square.toml", "-v")[0] == 2
    assert not (place / "square-out" / "steps.log").exists()


def test_warnings_of_the_result_are_lines_and_a_fingertip_has_newtons(tmp_path):
    with logged(tmp_path, wanted=True) as (steps,):
        assert isinstance(steps, Steps)
        steps.total = 1
        steps.step(fake_row(1) | {"contact_area": 1.0, "normal_force": 0.25}, None, None)
        steps.finished(SimpleNamespace(warnings=["the skin passed through"]))
    (_, first), (_, last) = log_of(tmp_path)
    assert "normal 0.25 N," in first
    assert last == "warning: the skin passed through"


def test_a_disk_that_refuses_the_log_does_not_cost_the_run(tmp_path):
    (tmp_path / "steps.log").mkdir()
    with logged(tmp_path, wanted=True) as (steps,):
        steps.finished(SimpleNamespace(warnings=["lost"]))


def test_how_far_a_step_is_gets_a_line_only_where_none_was_for_a_while(place, monkeypatch):
    assert called(place, "run", "square.toml", "-v", "--out", "quick")[0] == 0
    assert not any("of the step" in text for _, text in log_of(place / "quick"))
    monkeypatch.setattr("evfem.reporting.log.SILENCE", 0.0)
    _, _, err = called(place, "run", "square.toml", "-v", "--out", "slow")
    within = re.compile(r"([\d.]+) % of the step, iteration (\d+), residual \d\.\de-\d\d")
    texts = [text for _, text in log_of(place / "slow")]
    found = [within.fullmatch(text) for text in texts]
    result = result_in(place / "slow")
    # each substep has one balance more than it has iterations
    assert sum(one is not None for one in found) == (result.newton_iterations + result.substeps).sum()
    assert found[1].groups() == ("0", "1")
    assert all(f"evfem: {text}" in err for text in texts)


def test_a_bar_shows_how_far_the_step_is_and_the_log_of_the_caller_nothing(place, monkeypatch):
    shown, heard = [], []

    class Caller(logging.Handler):
        def emit(self, record):
            heard.append(record.getMessage())

    class Bar(ExitStack):
        leave = False
        update = staticmethod(lambda *told: None)

        def set_postfix_str(self, text):
            shown.append(text)

    monkeypatch.setattr(notices, "GLANCE", 0.0)
    monkeypatch.setattr(notices, "bar", lambda *told: Bar())
    with notices.listening(Caller(), logging.DEBUG, logging.getLogger()):
        simulate(load(place / "square.toml"), progress=True)
    assert shown[0].startswith("0 % of the step, iteration 1, residual ")
    assert not any("iteration" in text for text in heard)
