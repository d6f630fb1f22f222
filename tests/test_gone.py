"""What 0.2 had and 0.3 has not, for one release: a sentence that says what to use instead."""

import re
from importlib import import_module
from pathlib import Path

import pytest

import evfem as ev

#: modules of 0.2 whose name a folder has now
PACKAGES_NOW = ("contact", "electrostatics", "mesh", "newton", "plotting", "scene")


@pytest.mark.parametrize("name", ["reduce", "FastModel"])
def test_the_fast_model_says_what_to_use_instead(name):
    with pytest.raises(AttributeError, match=rf"^{name}: the fast model is gone since 0.3; .*`ev.simulate`"):
        getattr(ev, name)
    assert name not in dir(ev)


def test_half_of_a_finger_says_that_the_whole_is_computed():
    told = "symmetry: given {}; allowed: nothing: gone since 0.3, the whole finger is computed"
    with pytest.raises(ev.InputError) as caught:
        ev.scenefile.loads(f"{ev.scenefile.dump(ev.default_scene())}[solver]\nsymmetry = true\n")
    assert str(caught.value) == "solver." + told.format("true")
    with pytest.raises(ev.InputError) as caught:
        ev.Solver(symmetry=True)
    assert str(caught.value) == told.format("True")


def moved():
    """Rows of the changelog's tables of modules: an old name and where its code is now."""
    changes = (Path(__file__).parents[1] / "CHANGELOG.md").read_text(encoding="utf-8")
    for olds, news in re.findall(r"^ *\| `(evfem\.\S+)` \| (.*) \|$", changes, re.MULTILINE):
        places = [spread(place) for place in re.findall(r"`(\S+?)`", news)]
        for number, old in enumerate(spread(olds)):
            yield old, [place[number % len(place)] for place in places]


def spread(name):
    """`a.{b,c}` as two names."""
    start, _, rest = name.partition("{")
    words, _, end = rest.partition("}")
    return [f"{start}{word}{end}" for word in words.split(",")]


def test_a_module_that_moved_says_where_it_is():
    rows = [(old, new) for old, new in moved() if old.removeprefix("evfem.") not in PACKAGES_NOW]
    assert len(rows) > 100
    for old, new in rows:
        with pytest.raises(ModuleNotFoundError, match=rf"^{old} has moved in 0.3; .*: (.*)$") as caught:
            import_module(old)
        places = str(caught.value).partition(": ")[2].split(" and ")
        assert places == (new or ["none"])
        assert all(import_module(place).__name__ == place for place in new)


def test_a_module_that_never_was_is_not_found_as_ever():
    with pytest.raises(ModuleNotFoundError, match=r"^No module named 'evfem.planing'$"):
        import_module("evfem.planing")
