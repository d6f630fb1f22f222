"""What an earlier release had and this one has not: a sentence that says what to use instead."""

import csv
import re
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import pytest

import evfem as ev


@pytest.mark.parametrize("name", ["reduce", "FastModel"])
def test_the_fast_model_says_what_to_use_instead(name):
    with pytest.raises(AttributeError, match=rf"^{name}: the fast model is gone since 0.3; .*`ev.simulate`"):
        getattr(ev, name)
    assert name not in dir(ev)


@pytest.mark.parametrize("name", sorted(ev._GONE))
def test_a_name_that_is_gone_says_what_to_use_instead(name):
    with pytest.raises(AttributeError, match=rf"^{name}: .*since 0\.\d") as caught:
        getattr(ev, name)
    assert name not in ev.__all__
    sentence = str(caught.value)
    with pytest.raises(ImportError, match=f"^{re.escape(sentence)}$"):
        exec(f"from evfem import {name}")
    for place in re.findall(r"`((?:ev|evfem)\.[\w.]+)`", sentence):
        assert resolved(place) is not None


def resolved(dotted):
    """What a dotted name is, from the package on."""
    value, _, rest = ev, *dotted.partition(".")[1:]
    for part in rest.split("."):
        inner = hasattr(value, part)
        value = getattr(value, part) if inner else import_module(f"{value.__name__}.{part}")
    return value


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("mul", "mul: since 0.4 it is `ev.tensor.mul`"),
        ("Loop", "Loop: since 0.4 it is `evfem.simulation.loop.Loop`, what `ev.loop` returns"),
    ],
)
def test_the_sentence_of_a_name_that_has_moved(name, sentence):
    assert not hasattr(ev, name)
    with pytest.raises(AttributeError, match=f"^{re.escape(sentence)}$"):
        getattr(ev, name)


def test_a_module_of_others_with_such_a_name_is_no_business_of_ours():
    with pytest.raises(ModuleNotFoundError, match=r"^No module named 'mul'$"):
        import_module("mul")


def test_half_of_a_finger_says_that_the_whole_is_computed():
    told = "symmetry: given {}; allowed: nothing: gone since 0.3, the whole finger is computed"
    with pytest.raises(ev.InputError) as caught:
        ev.scenefile.loads(f"{ev.scenefile.dump(ev.default_scene())}[solver]\nsymmetry = true\n")
    assert str(caught.value) == "solver." + told.format("true")
    with pytest.raises(ev.InputError) as caught:
        ev.Solver(symmetry=True)
    assert str(caught.value) == told.format("True")


@pytest.mark.parametrize("coupling", ["staggered", "staggered_once"])
def test_the_staggered_coupling_says_that_it_was_removed(coupling):
    told = (
        f'electrostatics.coupling: given "{coupling}"; allowed: nothing: the staggered coupling was removed '
        "in 0.4.0 (the equilibria of staggered are those of monolithic); leave the key out"
    )
    scene = ev.default_scene()
    with pytest.raises(ev.InputError) as caught:
        ev.scenefile.loads(with_coupling(scene, coupling))
    assert str(caught.value) == told
    with pytest.raises(ev.InputError) as caught:
        ev.Scene(scene.finger, scene.surface, motion=scene.motion, coupling=coupling)
    assert str(caught.value) == told


def test_the_monolithic_coupling_of_old_files_has_no_effect():
    scene = ev.default_scene()
    read = ev.scenefile.loads(with_coupling(scene, "monolithic"))
    assert (read, read.digest()) == (scene, scene.digest())
    assert replace(read, coupling="monolithic") == scene
    assert "coupling" not in ev.scenefile.dump(read)


def with_coupling(scene, coupling):
    return ev.scenefile.dump(scene).replace("[electrostatics]", f'[electrostatics]\ncoupling = "{coupling}"')


def moved():
    """Modules of 0.2 or later, and where their code is now: `evfem/data/moved.csv`."""
    with (Path(ev.__file__).parent / "data" / "moved.csv").open(encoding="utf-8") as file:
        return [(row["was"], row["is"].split(" and ")) for row in csv.DictReader(file)]  # "none": nowhere


def test_a_module_that_moved_says_where_it_is():
    assert len(moved()) > 100
    for old, new in moved():
        with pytest.raises(ModuleNotFoundError, match=rf"^{old} has moved since 0.2; .*: (.*)$") as caught:
            import_module(old)
        places = str(caught.value).partition(": ")[2].split(" and ")
        assert places == new
        assert all(place == "none" or import_module(place).__name__ == place for place in new)


def test_a_module_that_never_was_is_not_found_as_ever():
    with pytest.raises(ModuleNotFoundError, match=r"^No module named 'evfem.planing'$"):
        import_module("evfem.planing")
