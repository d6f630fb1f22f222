"""The heart knows fewer and fewer capabilities by name: limits that only fall.

A test fails above a limit, and where the code is so much better that the limit should be lowered.
"""

import re
from dataclasses import fields

import pytest
from tools.threading_count import CAPABILITIES, CHECKOUT, HEART, count, units_of

from evfem.newton.state import State

#: conditionals of the heart (newton, solver, contact, simulation) that know an optional capability
CONDITIONALS = 84
#: files of the heart that know one, beside its own ones and `simulation/model`
FILES = {
    "hand": 3,
    "elastic surface": 3,
    "adhesion": 2,
    "charges, drive, leakage": 3,
    "viscosity, inertia, branches": 3,
    "roughness": 0,
}
#: lines of heart and `response` that ask whether one of `ASKED` is None
NONES = 0
#: fields of `State`
FIELDS = 9
#: how far below its limit a count of lines may be, and one of files or fields
SLACK, SLACK_FILES = 10, 2

ASKED = re.compile(r"(hand|foundation|dynamics|attraction|adhesive|charging|law) is (not )?None")


@pytest.fixture(scope="module")
def counted():
    return count()


def hold(name, found, limit, slack):
    """A count is at most its limit, and at most `slack` below it."""
    assert found <= limit, f"{name}: {found}, {found - limit} above the limit"
    assert found >= limit - slack, f"{name}: {found}, lower the limit from {limit}"


def test_conditionals_of_the_heart_that_know_a_capability(counted):
    found, every = counted.conditionals(HEART)
    hold(f"CONDITIONALS (of {every})", found, CONDITIONALS, SLACK)


@pytest.mark.parametrize("name", FILES)
def test_files_of_the_heart_that_know_a_capability(counted, name):
    found = counted.heart_files(name)
    hold(f"FILES[{name!r}] {sorted(found)}", len(found), FILES[name], SLACK_FILES)


@pytest.mark.parametrize("capability", CAPABILITIES, ids=lambda capability: capability.name)
def test_no_pattern_and_no_file_is_of_names_that_are_gone(counted, capability):
    """A capability that was renamed would be counted as gone, and one that moved as everywhere."""
    assert counted.rows[capability.name].files
    assert set(capability.own) <= {unit.file for unit in counted.units}


def test_questions_for_none():
    folders = (*HEART, "response")
    files = [path for folder in folders for path in (CHECKOUT / "evfem" / folder).rglob("*.py")]
    lines = [line for path in files for line in path.read_text("utf-8").splitlines()]
    hold("NONES", sum(bool(ASKED.search(line)) for line in lines), NONES, SLACK)


def test_fields_of_the_state():
    hold("FIELDS", len(fields(State)), FIELDS, SLACK_FILES)


EXAMPLE = '''
"""A hand in a docstring."""
class Drive:
    def step(self, target):
        """Not here: hand."""
        mine = target.hand
        if mine is None or self.free:
            return [one for one in self.all if mine]
        return isinstance(target, Plain) and self.adhesive > 0
'''


def test_what_counts():
    """By hand: the local name that is None and its truth know the hand, the boolean knows the adhesion; an
    isinstance in a boolean, and `free` in a test, are not counted for themselves.
    """
    module, step = sorted(units_of("newton/example", EXAMPLE), key=lambda unit: unit.is_function)
    hand, adhesion = (next(one for one in CAPABILITIES if one.name == name) for name in ("hand", "adhesion"))
    assert len(step.conditionals) == 3
    assert step.knowing(hand) == ["mine is None or self.free", "mine"]
    assert step.knowing(adhesion) == ["isinstance(target, Plain) and self.adhesive > 0"]
    assert step.mentions(hand)
    assert step.mentions(adhesion)
    assert not module.conditionals
    assert not module.mentions(hand)
