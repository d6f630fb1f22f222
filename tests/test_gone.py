"""What 0.2 had and 0.3 has not, for one release: a sentence that says what to use instead."""

import pytest

import evfem as ev


@pytest.mark.parametrize("name", ["reduce", "FastModel"])
def test_the_fast_model_says_what_to_use_instead(name):
    with pytest.raises(AttributeError, match=rf"^{name}: the fast model is gone since 0.3; .*`ev.simulate`"):
        getattr(ev, name)
    assert name not in dir(ev)
