"""The command in a terminal of 80 columns: a real pseudo-terminal, whose text is read as it arrives, and the
table of forces.
"""

import os
import pty
import re
import struct
import sys
import termios
from fcntl import ioctl
from subprocess import Popen

import pytest
from tools.fakes import SQUARE_SCENE
from tools.meshes import square_mesh

import evfem as ev
from evfem import cli, studies
from evfem.common import notices
from evfem.mesh import file as meshfile
from evfem.simulation.history import chosen, table
from evfem.simulation.result import COLUMNS

SCENE = f"""{SQUARE_SCENE}
[[motion]]
kind = "press"
indentation = 0.2
steps = 4
"""
SWEEP = """
version = 1
[scene.finger]
resolution = "coarse"
[scene.surface]
kind = "flat"
[[scene.motion]]
kind = "hover"
gap = 0.5
[grid]
motion.0.gap = [0.25, 0.5]
"""


@pytest.fixture
def place(tmp_path):
    meshfile.write(square_mesh("quad9"), tmp_path / "square.vtu")
    (tmp_path / "square.toml").write_text(SCENE)
    (tmp_path / "two.toml").write_text(SWEEP)
    return tmp_path


def terminal(folder, *words, columns=80, code="from evfem.cli import main; import sys; sys.exit(main())"):
    """(exit status, all that a terminal so wide received) of the command."""
    ours, theirs = pty.openpty()
    ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, columns, 0, 0))
    path = os.pathsep.join(p for p in sys.path if p)
    environment = os.environ | {"PYTHONPATH": path, "NO_COLOR": "1", "TERM": "xterm"}
    environment.pop("COLUMNS", None)
    arguments = [sys.executable, "-c", code, *map(str, words)]
    with Popen(arguments, cwd=folder, env=environment, stdin=theirs, stdout=theirs, stderr=theirs) as process:
        os.close(theirs)
        received = b""
        try:
            while chunk := os.read(ours, 65536):
                received += chunk
        except OSError:  # the other end has closed
            pass
        os.close(ours)
    return process.returncode, received.decode()


def lines(text):
    """What stood on each line, overwritten states included."""
    return [line.rstrip() for line in re.split(r"[\r\n]+|\x1b\[A", text) if line.strip()]


@pytest.mark.parametrize("columns", [80, 0])
def test_a_run_draws_a_bar_and_a_table_in_the_width_there_is(place, columns):
    """A terminal that says it has no columns, as one started by a program, gets 80."""
    status, text = terminal(place, "run", "square.toml", "--no-plots", "--no-fields", columns=columns)
    assert status == 0
    assert max(map(len, lines(text))) <= 80
    bars = [line for line in lines(text) if "step/s" in line or "s/step" in line]
    assert re.search(r"\| 0/4 \[00:0\d, \? left, +\?step/s\]", bars[0])
    assert re.search(r"\| 4/4 \[00:\d\d, 00:00 left, ", bars[-1])
    assert "100%|" in bars[-1]
    assert "█" in bars[-1]
    assert lines(text)[-1].startswith("4 of 4 steps in")


def test_a_refused_scene_leaves_one_wrapped_sentence_and_no_bar(place):
    (place / "square.toml").write_text(SCENE.replace("friction = 0.2", "friction = 0.2\ny = 1.0"))
    status, text = terminal(place, "run", "square.toml")
    assert status == 2
    last = text.rsplit("\x1b[K", 1)[-1].rsplit("\r" + " " * 60, 1)[-1]
    assert "evfem: square.toml: surface.y" in last
    shown = [line for line in lines(text) if "step" not in line]
    assert max(map(len, shown)) < 80
    assert len(shown) > 1
    assert all(line.startswith("  ") for line in shown[1:])


def test_several_mistakes_stand_on_lines_of_their_own_in_a_terminal(place):
    wrong = SCENE.replace("friction = 0.2", "friction = -0.2").replace("steps = 4", "steps = 0")
    (place / "square.toml").write_text(wrong)
    status, text = terminal(place, "run", "square.toml")
    assert status == 2
    assert [line for line in lines(text) if line.startswith("evfem: ")] == [
        "evfem: square.toml: 2 mistakes",
        "evfem: surface.friction: given -0.2; allowed: a number from 0 to 100, or a",
        "evfem: motion[0].steps: given 0; allowed: a whole number from 1 to 1000000",
    ]


@pytest.mark.parametrize("command", ["", "run", "init", "plan", "study", "sweep", "mesh", "signal", "schema"])
def test_help_fits(monkeypatch, capsys, command):
    monkeypatch.setenv("COLUMNS", "80")
    assert cli.main([*command.split(), "--help"]) == 0
    text = capsys.readouterr().out
    assert max(map(len, text.splitlines())) <= 80
    assert "evfem run" in text if not command else text.split("\n\n")[1].endswith(".")


@pytest.mark.parametrize(
    ("given", "words"),
    [("rnu", "did you mean run?"), ("stdy", "did you mean study?"), ("fly", "'schema') (see")],
)
def test_a_misspelt_command_is_guessed(capsys, given, words):
    assert cli.main([given]) == 2
    err = capsys.readouterr().err
    assert words in err
    assert err.count("\n") == 1


def test_a_plan_fits_wherever_it_is_printed():
    shown = str(ev.plan(ev.default_scene())).splitlines()
    assert max(map(len, shown)) < 80
    # what goes over stands below the reason, not below the name
    below = shown[shown.index(next(line for line in shown if "electrostatics" in line)) + 1]
    assert below.startswith(" " * 19 + "together")
    # hypodermis and nail of Table 2: E / (2 (1 + nu))
    assert f"shear moduli {0.034 / 2.96:.3g} to {17 / 2.6:.3g} MPa" in " ".join(shown)
    assert "every accepted step: residual below 1e-08 of the largest reaction" in shown[-1]


STATUS = """
import time
from evfem.common import notices
with notices.status("fig05"):
    time.sleep(0.2)  # details are shown ten times a second
    notices.LOG.debug("case %d of %d", 1, 3)
print("over")
"""


def test_a_status_shows_what_is_going_on_and_goes(place):
    assert lines(terminal(place, code=STATUS)[1]) == ["fig05", "fig05, case 1 of 3", "over"]


def test_notices_are_shown_once_and_the_logger_is_left_as_it_was(capsys):
    before = notices.LOG.level, list(notices.LOG.handlers)
    with notices.shown(), notices.shown():
        notices.LOG.info("one %s", "line")
        notices.LOG.debug("a detail")
    notices.LOG.info("unheard")
    with notices.shown(False):
        notices.LOG.info("unheard too")
    assert capsys.readouterr().err == "evfem: one line\n"
    assert (notices.LOG.level, notices.LOG.handlers) == before


def test_shells_can_complete(capsys):
    """What shtab reads: every path has its kind of completion, and the commands are there."""
    commands = cli.parser()._subparsers._group_actions[0].choices
    for name, command in commands.items():
        for action in command._actions:
            if "FILE" in str(action.metavar) or str(action.metavar).endswith(".toml"):
                assert action.complete == cli.FILES, (name, action.metavar)
            if action.metavar == "DIR":
                assert action.complete == cli.FOLDERS, (name, action.metavar)
    assert set(_action(commands["study"], "NAME").choices) == {*studies.NAMES, "all"}
    show = commands["texture"]._subparsers._group_actions[0].choices["show"]
    assert "wave-2mm" in set(_action(show, "NAME").choices)
    assert cli.main(["texture", "show", "wafe-2mm"]) == 2  # what is no name is refused with a sentence
    assert 'texture: given "wafe-2mm"; allowed: wave-2mm?' in capsys.readouterr().err


def _action(command, metavar):
    (found,) = (action for action in command._actions if action.metavar == metavar)
    return found


def rows(*counts):
    """That many rows of one motion after another."""
    numbers = [(k, i) for k, count in enumerate(counts) for i in range(count)]
    return [{"step": n + 1, "motion_index": k, "motion": "slide"} for n, (k, _) in enumerate(numbers)]


def test_the_table_fits_80_columns_with_long_numbers():
    row = dict.fromkeys(COLUMNS, -12.345678) | {"motion": "voltage", "motion_index": 0, "voltage": -10000.0}
    lines = table([row | {"step": n} for n in range(1, 2001)]).splitlines()
    assert max(map(len, lines)) <= 80
    assert len(lines) == 14
    assert lines[-1].split() == ["2000", "voltage", "-12.346", "-12.346", "-10000"] + ["-12.34568"] * 4


def test_columns_never_touch_and_zero_has_no_sign():
    for value in (-1e9, -123456.789, 1e300, -0.0, -1e-9, -1e-300):
        row = dict.fromkeys(COLUMNS, value) | {"step": 12345, "motion": "voltage", "motion_index": 0}
        *_, line = table([row]).splitlines()
        numbers = line.split()[2:]
        assert len(numbers) == 7
        for text in numbers:
            assert float(text) == pytest.approx(value, rel=0.06, abs=0.6 if abs(value) < 1.0 else 0.0)
            assert value < -0.5 or not text.startswith("-")


def test_the_last_row_of_each_motion_is_shown():
    for counts in ((10, 100), (1,), (1, 1, 1), (3, 50, 2, 7)):
        ends = {sum(counts[: k + 1]) - 1 for k in range(len(counts))}
        picked = chosen(rows(*counts), 12)
        assert ends <= set(picked)
        assert picked == sorted(set(picked))
        assert len(picked) <= 12
    assert chosen([], 12) == []
