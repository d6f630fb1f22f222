"""The examples in the docstrings of every installed module run and print what they say."""

import doctest
import importlib
import pkgutil

import numpy as np
import pytest

import evfem

#: the studies run on their own, and the compiled loops cannot be imported without evfem[fast]
LEFT_OUT = {
    "evfem.studies",
    "evfem.tissue.kernels.lanes",
    "evfem.tissue.kernels.elastic",
    "evfem.tissue.kernels.viscous",
}
MODULES = sorted(
    m.name
    for m in pkgutil.walk_packages(evfem.__path__, "evfem.")
    if not any(m.name.startswith(n) for n in LEFT_OUT)
)
FLAGS = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS


@pytest.mark.parametrize("name", MODULES)
def test_examples_of_module(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with np.printoptions(legacy=False):
        failed, _ = doctest.testmod(importlib.import_module(name), optionflags=FLAGS)
    assert failed == 0


def test_examples_are_collected():
    finder = doctest.DocTestFinder()
    examples = sum(len(t.examples) for name in MODULES for t in finder.find(importlib.import_module(name)))
    assert examples >= 10
