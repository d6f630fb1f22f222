"""A run ends when a column has come so far, and says why."""

from types import SimpleNamespace

import pytest
from tools.builders import finger
from tools.meshes import block

import evfem as ev

MOTION = [ev.Press(indentation=0.3, steps=3), ev.Slide(0.6, steps=6)]


def run(*observers):
    scene = ev.Scene(finger(block()), ev.Display(friction=0.3), motion=MOTION)
    return ev.simulate(scene, observers=observers)


@pytest.fixture(scope="module")
def whole():
    return run()


@pytest.mark.parametrize(
    ("condition", "column", "reached"),
    [
        ("normal_force > {}", "normal_force", lambda value, end: value > end),
        ("tangential_force>={}", "tangential_force", lambda value, end: value >= end),
        (" position  >= {}", "position", lambda value, end: value >= end),
    ],
)
def test_a_run_ends_after_the_first_step_of_which_a_comparison_is_true(whole, condition, column, reached):
    end = float(whole[column][6])
    first = next(i for i, value in enumerate(whole[column]) if reached(value, end))
    text = condition.format(repr(end))
    found = run(ev.StopWhen(text))
    assert len(found.step) == first + 1 < len(whole.step)
    assert found.rows[-1]["normal_force"] == whole.rows[first]["normal_force"]
    assert found.provenance["stopped"] == f"{' '.join(text.split())} in step {first + 1}"


@pytest.mark.parametrize(
    ("condition", "value", "true"),
    [
        ("indentation < 1", 0.9, True),
        ("indentation < 1", 1.0, False),
        ("indentation <= 1", 1.0, True),
        ("indentation == 1e0", 1.0, True),
        ("indentation == 1", 1.1, False),
        ("indentation > -1", -1.0, False),
        ("indentation >= -1", -1.0, True),
        ("indentation >= 1", float("nan"), False),
    ],
)
def test_every_sign(condition, value, true):
    row, stop = {"step": 4, "motion_index": 0, "indentation": value}, ev.StopWhen(condition)
    if not true:
        assert stop.step(row) is None
        return
    with pytest.raises(ev.StopRun, match="in step 4"):
        stop.step(row)


def test_in_one_motion_alone_and_by_a_function(whole):
    """In the slide the normal force is there from its first step on."""
    end = float(whole.normal_force[0])
    assert len(run(ev.StopWhen(f"normal_force >= {end!r}")).step) == 1
    assert len(run(ev.StopWhen(f"normal_force >= {end!r}", motion=1)).step) == 4
    found = run(ev.StopWhen(lambda row: row["motion"] == "slide" and row["position"] > 0.25))
    assert found.position[-1] == pytest.approx(0.3)
    assert found.provenance["stopped"] == "a condition is met in step 6"


def test_columns_of_rooms_that_a_scene_has_not_are_those_of_its_result(whole):
    """Without an attraction friction is felt as it is, and the attraction is 0."""
    assert len(run(ev.StopWhen("adhesive_force > 0")).step) == len(whole.step)
    end = float(whole.apparent_friction[5])
    assert len(run(ev.StopWhen(f"apparent_friction >= {end!r}")).step) == 6


@pytest.mark.parametrize(
    ("condition", "said"),
    [
        ("mu > 0.2", 'condition: given "mu", no column; allowed: friction?'),
        ("motion == 1", 'given "motion", no column'),
        ("normal_force", "a comparison of a column with a number"),
        ("normal_force > heavy", "a comparison of a column with a number"),
        ("normal_force > 1 or 2", "a comparison of a column with a number"),
        ("__import__('os') > 1", "a comparison of a column with a number"),
        (3.0, "given 3.0; allowed: a comparison"),
    ],
)
def test_what_is_no_condition_is_refused(condition, said):
    with pytest.raises(ev.InputError) as refused:
        ev.StopWhen(condition)
    assert said in str(refused.value)


ROWS = {2: {"step": 1, "motion_index": 0}, 3: {"step": 1, "motion_index": 0, "position_z": 0.0}}
ROWS[3]["contact_width"] = float("nan")


@pytest.mark.parametrize(
    ("name", "dimension", "instead"),
    [
        ("contact_area", 2, "contact_width"),
        ("real_contact_area", 2, "real_contact_width"),
        ("position_z", 2, "position"),
        ("tangential_force_z", 2, "tangential_force"),
        ("contact_width", 3, "contact_area"),
        ("real_contact_width", 3, "real_contact_area"),
    ],
)
def test_a_column_of_the_other_dimension_is_refused(name, dimension, instead):
    """As the run begins, and by the row of a step, the first of which was a KeyError, or nan for ever."""
    where = {2: "plane", 3: "space"}[dimension]
    for event, told in (("started", SimpleNamespace(dim=dimension)), ("step", ROWS[dimension])):
        with pytest.raises(ev.InputError) as refused:
            getattr(ev.StopWhen(f"{name} > 0.1"), event)(told)
        assert str(refused.value) == (
            f'condition: given "{name}", no column of a finger in {"the " * (dimension == 2)}{where}; '
            f"allowed: {instead}? (docs/notation)"
        )
    other = SimpleNamespace(dim=5 - dimension)
    assert ev.StopWhen(f"{name} > 0.1").started(other) is None


def test_a_run_with_a_column_of_the_other_dimension_ends_before_its_first_step():
    seen = []
    with pytest.raises(ev.InputError, match=r"contact_area.*no column of a finger in the plane"):
        run(SimpleNamespace(step=lambda row, *_: seen.append(row)), ev.StopWhen("contact_area > 3"))
    assert seen == []
    with pytest.raises(ev.InputError, match=r"contact_area.*no column of a finger in the plane"):
        run(ev.StopWhen(lambda row: row["contact_area"] > 3.0))
    mine = {}
    with pytest.raises(KeyError, match="mine"):
        run(ev.StopWhen(lambda row: mine["mine"]))


def test_a_motion_is_a_whole_number():
    with pytest.raises(ev.InputError, match="motion: given -1"):
        ev.StopWhen("step > 1", motion=-1)
    assert repr(ev.StopWhen("step >  1", motion=0)) == "StopWhen('step > 1', motion=0)"


def test_a_column_without_a_value_in_any_step_is_said_at_the_end():
    scene = ev.Scene(finger(block()), ev.Display(), motion=[ev.Hover(0.1, steps=2)])
    with pytest.warns(UserWarning, match="friction was empty in every step"):
        ev.simulate(scene, observers=[ev.StopWhen("friction > 0.3")])
    pressed = ev.Scene(
        finger(block()), ev.Display(), motion=[ev.Hover(0.1), ev.Press(indentation=0.05, steps=1)]
    )
    with pytest.warns(UserWarning, match="friction was empty in every step"):
        ev.simulate(pressed, observers=[ev.StopWhen("friction > 0.3", motion=0)])
    ev.simulate(pressed, observers=[ev.StopWhen("friction > 3"), ev.StopWhen("friction > 3", motion=2)])
    assert len(ev.simulate(scene, observers=[ev.StopWhen("indentation > 0.3")]).step) == 2
