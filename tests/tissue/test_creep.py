"""Creep of an uneven block beside another package."""

import numpy as np
import pytest
from tools.meshes import block

import evfem as ev

SMALL = 1e-5


def test_creep_under_a_constant_load_is_that_of_felupe():
    """Recorded with FElupe 11.3.0 by `tools/creep_with_felupe.py`: stiffness of the first step, and the way
    after 5, 10 and 20 steps; strains of 5e-6 are the difference.
    """
    law = ev.NeoHookean(E=0.034, nu=0.4, relaxation=((1.5, 0.05),))
    finger = ev.MeshedFinger(block(6, 4, 4.0, 2.0), {"tissue": law})
    solver = ev.Solver(dynamics="viscous", element="q1", tolerance=1e-10)
    motion = [ev.Press(indentation=SMALL, speed=SMALL / 0.01, steps=1), ev.Wait(0.19, steps=19, hold="force")]
    found = ev.simulate(ev.Scene(finger, ev.Flat(friction=50.0, y=0.0), motion=motion, solver=solver))
    assert found.applied_force[0] / SMALL == pytest.approx(0.176323403, rel=2e-5)
    way = found.indentation[[4, 9, 19]] / found.indentation[0]
    np.testing.assert_allclose(way, [1.20019778, 1.35664543, 1.51021575], rtol=1e-5)
