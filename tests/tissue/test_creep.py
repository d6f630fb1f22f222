"""Creep of an uneven block beside another package; branches with probes in a patch, in mirrored scenes and in
runs that go on.
"""

import numpy as np
import pytest
from tools.builders import resumed
from tools.grids import rectangle
from tools.meshes import block

import evfem as ev
from evfem.tissue.dynamics import make_dynamics

SMALL = 1e-5


def relaxing(motion, mesh=None, nu=0.4, **more):
    law = ev.NeoHookean(E=0.034, nu=nu, relaxation=((1.5, 0.05),))
    finger = ev.MeshedFinger(block(6, 4, 4.0, 2.0) if mesh is None else mesh, {"tissue": law})
    solver = ev.Solver(dynamics="viscous", element="q1", tolerance=1e-10)
    return ev.Scene(finger, ev.Flat(friction=50.0, y=0.0), motion=motion, solver=solver, **more)


def test_creep_under_a_constant_load_is_that_of_felupe():
    """Recorded with FElupe 11.3.0 by `tools/creep_with_felupe.py`: stiffness of the first step, and the way
    after 5, 10 and 20 steps; strains of 5e-6 are the difference.
    """
    press = ev.Press(indentation=SMALL, speed=SMALL / 0.01, steps=1)
    found = ev.simulate(relaxing([press, ev.Wait(0.19, steps=19, hold="force")]))
    assert found.applied_force[0] / SMALL == pytest.approx(0.176323403, rel=2e-5)
    way = found.indentation[[4, 9, 19]] / found.indentation[0]
    np.testing.assert_allclose(way, [1.20019778, 1.35664543, 1.51021575], rtol=1e-5)


PROBES = {"pair": [[-0.7, 0.6], [0.7, 0.6]]}
MIRRORED = [1, 0]


def there_and_back(way):
    press = ev.Press(indentation=0.1, speed=2.0, steps=2)
    motion = [press, ev.Slide(way, speed=10.0, steps=3), ev.Wait(0.1, steps=2)]
    return relaxing(motion, output=ev.Output(probes=PROBES))


@pytest.mark.filterwarnings("ignore:probes have")
def test_mirrored_scenes_are_equal_with_branches_and_probes():
    right, left = (ev.simulate(there_and_back(way)) for way in (0.2, -0.2))
    for name in ("applied_force", "stored_energy", "viscous_dissipation"):
        np.testing.assert_allclose(right[name], left[name], rtol=1e-7)
    np.testing.assert_allclose(right.tangential_force, -left.tangential_force, atol=1e-9)
    one, other = (found.probes["pair"] for found in (right, left))
    turned = np.diag([-1.0, 1.0, 1.0])
    same = turned @ other.cauchy_stress[:, MIRRORED] @ turned
    np.testing.assert_allclose(one.cauchy_stress, same, atol=1e-9)
    np.testing.assert_allclose(one.J, other.J[:, MIRRORED], rtol=1e-8)


@pytest.mark.filterwarnings("ignore:probes have")
def test_a_run_that_goes_on_has_the_same_branches_and_probes(tmp_path):
    whole, again = resumed(there_and_back(0.2), 4, tmp_path)
    for name in ("applied_force", "stored_energy", "viscous_dissipation"):
        np.testing.assert_allclose(again[name], whole[name], rtol=1e-13)
    for name in ("displacement", "cauchy_stress", "strain_energy_density"):
        found, expected = (getattr(one.probes["pair"], name) for one in (again, whole))
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-13 * np.abs(expected).max())


def test_a_patch_of_distorted_cells_stays_homogeneous_in_time():
    """Under a strain that is the same everywhere, inner nodes have no force while the tissue relaxes."""

    space = rectangle("q1", (3, 3), jitter=0.2)
    law = ev.NeoHookean(E=0.034, nu=0.4, relaxation=((1.5, 0.05), (0.4, 1.0)), bulk_relaxation=True)
    terms = make_dynamics(space, {"lower": law}, ev.FingerPad(), "viscous")
    inner, kept, u = np.setdiff1d(np.arange(space.size), space.mesh.node_sets["outline"]), terms.at_rest, 0.0
    before = np.zeros((space.size, 2))
    for amount in (0.1, 0.2, 0.2):
        u = space.mesh.points @ np.array([[0.5, 0.3], [1.0, -0.8]]) * amount
        terms.begin(before, np.zeros_like(u), 0.03, kept)
        forces = terms.forces(u)
        assert np.abs(forces[inner]).max() < 1e-14
        assert np.abs(forces).max() > 1e-4
        kept, before = terms.inner(u), u
