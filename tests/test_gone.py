"""What 0.2 had and 0.3 has not, for one release: a sentence that says what to use instead."""

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
