"""The examples in the docstrings of every installed module run and print what they say."""

import doctest
import importlib
import inspect
import pkgutil
import re

import numpy as np

import evfem

#: the studies run on their own, and the compiled loops have no source in Python
LEFT_OUT = (
    "evfem.studies",
    *(f"evfem.tissue.kernels.{name}" for name in ("cholesky", "contact", "loops", "solids")),
)
FLAGS = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS


def modules():
    names = [found.name for found in pkgutil.walk_packages(evfem.__path__, "evfem.")]
    for name in ["evfem", *names]:
        if not name.startswith(LEFT_OUT):
            yield importlib.import_module(name)


def test_every_example_is_found_runs_and_prints_what_it_says(tmp_path, monkeypatch):
    """`>>>` that doctest does not find (in a nested function, say) would be an example that nobody runs."""
    monkeypatch.chdir(tmp_path)
    wrong, unseen, examples = [], [], 0
    for module in modules():
        with np.printoptions(legacy=False):
            failed, attempted = doctest.testmod(module, optionflags=FLAGS)
        written = len(re.findall(r"^ *>>> ", inspect.getsource(module), re.MULTILINE))
        wrong += [module.__name__] * (failed > 0)
        unseen += [f"{module.__name__}: {attempted} of {written}"] * (attempted != written)
        examples += attempted
    assert not wrong
    assert not unseen
    assert examples >= 180
