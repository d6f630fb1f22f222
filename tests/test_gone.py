"""What 0.2 had and 0.3 has not, for one release: a sentence that says what to use instead."""

import csv
from importlib import import_module
from pathlib import Path

import pytest

import evfem as ev


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
    """Modules of 0.2, or of the way to 0.3, and where their code is now: `evfem/data/moved.csv`."""
    with (Path(ev.__file__).parent / "data" / "moved.csv").open(encoding="utf-8") as file:
        return [(row["was"], row["is"].split(" and ")) for row in csv.DictReader(file)]  # "none": nowhere


def test_a_module_that_moved_says_where_it_is():
    assert len(moved()) > 100
    for old, new in moved():
        with pytest.raises(ModuleNotFoundError, match=rf"^{old} has moved in 0.3; .*: (.*)$") as caught:
            import_module(old)
        places = str(caught.value).partition(": ")[2].split(" and ")
        assert places == new
        assert all(place == "none" or import_module(place).__name__ == place for place in new)


def test_a_module_that_never_was_is_not_found_as_ever():
    with pytest.raises(ModuleNotFoundError, match=r"^No module named 'evfem.planing'$"):
        import_module("evfem.planing")
