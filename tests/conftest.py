"""What is collected, and which tests run the solver."""

from importlib.util import find_spec
from pathlib import Path

import pytest

#: rooms whose tests get the mark `solver`; files elsewhere say it themselves
SOLVER = {"contact", "newton", "response", "simulation", "solver", "tissue"}
#: compiled loops are built with a C compiler
collect_ignore = [] if find_spec("evfem.tissue.kernels.loops") else ["tissue/kernels"]


@pytest.hookimpl(tryfirst=True)  # before pytest selects by marks
def pytest_collection_modifyitems(items):
    for item in items:
        if item.path.relative_to(Path(__file__).parent).parts[0] in SOLVER:
            item.add_marker(pytest.mark.solver)
