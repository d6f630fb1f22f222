"""What is collected, and that it stays."""

import gc
from importlib.util import find_spec

import pytest

#: compiled loops are built with a C compiler
collect_ignore = [] if find_spec("evfem.tissue.kernels.loops") else ["tissue/kernels"]


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """Collected tests live to the end: they are not searched for garbage, again and again."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()
