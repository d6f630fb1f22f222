"""What is collected, and that it stays."""

import gc
from importlib.util import find_spec

import pytest

#: compiled loops are built with a C compiler
collect_ignore = [] if find_spec("evfem.tissue.kernels.loops") else ["tissue/kernels"]

# pytest takes numbers that are 1e-12 apart for equal: charges in C and capacitances in F would be all alike
type(pytest.approx(1.0)).DEFAULT_ABSOLUTE_TOLERANCE = 0.0


def pytest_addoption(parser):
    parser.addoption("--damaged", type=int, default=100, help="damaged files of each format in a slow test")
    parser.addoption("--kills", type=int, default=6, help="kills of each scene in a slow test")


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """Collected tests live to the end: they are not searched for garbage, again and again."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()
