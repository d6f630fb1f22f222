"""With PARDISO, and without anything compiled: the same converged numbers."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from tools.builders import finger
from tools.meshes import block

import evfem as ev

HERE = Path(__file__).parent
NAMES = ("applied_force", "normal_force", "tangential_force", "electrostatic_force")
NAMES += ("stored_energy", "min_gap")

COMPILED = [f"evfem.tissue.kernels.{name}" for name in ("loops", "contact", "cholesky")]
#: runs in a process of its own, in which they cannot be imported
WITHOUT = """
import json, sys
for name in ("pypardiso", *sys.argv[3:]):
    sys.modules[name] = None
sys.path[:0] = json.loads(sys.argv[1])
import test_backends
print(json.dumps(test_backends.numbers(sys.argv[2])))
"""


def numbers(element, threads=1):
    """Columns of a press and a slide under a voltage, and which solver found them."""
    motion = [ev.Press(indentation=0.2, steps=3), ev.Press(force=0.03, steps=2), ev.Slide(0.4, steps=4)]
    body, solver = finger(block(8, 3, sag=0.4)), ev.Solver(element=element, tolerance=1e-11, threads=threads)
    scene = ev.Scene(body, ev.Display(), ev.Kaczmarek(), 2000.0, motion, solver=solver)
    result = ev.simulate(scene)
    found = {name: getattr(result, name).tolist() for name in NAMES}
    return found | {"solver": result.provenance["solver"]}


def compare(others, here, backend, cell_loops):
    """The columns agree, though another solver found them."""
    assert (others["solver"]["backend"], others["solver"]["cell_loops"]) == (backend, cell_loops)
    assert here["solver"]["backend"] != backend
    for name in NAMES:
        np.testing.assert_allclose(others[name], here[name], rtol=1e-8, atol=1e-11)
    assert max(here["tangential_force"]) > 1e-3


@pytest.mark.pardiso
@pytest.mark.parametrize("element", ["q2p1", "q1_fbar"])
def test_the_same_numbers_by_pardiso(element):
    compare(numbers(element, threads=2), numbers(element), "Pardiso", "compiled")


@pytest.mark.parametrize("element", ["q2p1", "q1_fbar"])
@pytest.mark.slow
def test_the_same_numbers_without_what_is_compiled(element):
    command = [sys.executable, "-c", WITHOUT, json.dumps([str(HERE), *sys.path]), element, *COMPILED]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    compare(json.loads(done.stdout), numbers(element), "SuperLU", "numpy")
