"""Equilibria of nearly incompressible bodies: how many iterations they take, that they are those of
the displacements alone, and what a linear step solves.
"""

from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from evfem.studies.stability.scenes import benchmark, layered
from tools.builders import finger
from tools.grids import mixed_tangent_of, rectangle
from tools.meshes import block

import evfem as ev
from evfem import meshes
from evfem.mesh.file import read
from evfem.newton.pressure import Pressure
from evfem.simulation.checkpoint import reusable_of
from evfem.simulation.result import Saved
from evfem.simulation.run import Run, simulate
from evfem.tissue import splitlaw
from evfem.tissue.weakform import Tissue

pytestmark = pytest.mark.solver
#: element -> Poisson's ratios at which it is no stiffer by locking than its own iterations can bear
NEARLY = {
    "q1": (0.4999, 0.49999, 0.4999999),
    "q1_fbar": (0.4999, 0.49999, 0.4999999),
    "q2": (0.4999, 0.49999),
    "q2p1": (0.4999, 0.49999, 0.4999999),
    "p2": (0.4999, 0.49999),
}


@cache
def triangles():
    return read(Path(str(meshes.__file__)).parent / "benchmark-L0-triangles.msh")


def pressed(element, nu, indentation=1.0, steps=4):
    """The benchmark's half finger, its tissue nearly incompressible, on a flat display."""
    body = benchmark(tissue=(0.05, nu))
    if element == "p2":
        body = layered(triangles(), tissue=(0.05, nu), skin=(1.0, 0.30))
    surface, motion = ev.Flat(friction=0.0, y=-6.395), [ev.Press(indentation=indentation, steps=steps)]
    return simulate(ev.Scene(body, surface, motion=motion, solver=ev.Solver(element=element)))


def without_pressure(monkeypatch):
    """Iterations of the displacements alone."""
    monkeypatch.setattr(splitlaw, "INCOMPRESSIBLE", np.inf)


# -- iterations
# ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("element", "nu"), [(element, nu) for element in NEARLY for nu in NEARLY[element]])
@pytest.mark.filterwarnings("ignore:.*q1 cells lock")
def test_a_press_takes_few_iterations_however_little_the_volume_changes(element, nu):
    """Four steps of 0.25 mm: at most 15 iterations each and no parts (measured 4 to 9). Of the
    displacements alone they took 760 to 900 in all at nu = 0.49999.
    """
    result = pressed(element, nu)
    assert result.newton_iterations.max() <= 15
    assert (result.substeps == 1).all()


# -- the same equilibria
# ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("element", ["q1_fbar", "q2p1", "p2"])
def test_the_equilibria_are_those_of_the_displacements_alone(element, monkeypatch):
    """Without friction no path is remembered, so parts of steps do not matter. nu = 0.4999."""
    mixed = pressed(element, 0.4999, 0.5, 2)
    without_pressure(monkeypatch)
    plain = pressed(element, 0.4999, 0.5, 2)
    assert plain.newton_iterations.sum() > 2 * mixed.newton_iterations.sum()
    for column in ("normal_force", "stored_energy", "contact_width"):
        np.testing.assert_allclose(getattr(mixed, column), getattr(plain, column), rtol=1e-8, err_msg=column)
    difference = mixed.frames[-1].displacement - plain.frames[-1].displacement
    assert np.abs(difference).max() < 1e-8


# -- one linear step
# -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("element", ["q1_fbar", "q2", "q2p1", "p2"])
def test_a_linear_step_solves_both_equations(element):
    """Displacements and pressures of all points as one dense system, linearised elsewhere than the
    iterate: the condensed step and the next pressure are its solution.
    """
    space = rectangle(element, (2, 2), jitter=0.2)
    tissue = Tissue(space, {"lower": ev.NeoHookean(E=0.3, nu=0.4999)})
    rng = np.random.default_rng(8)
    u0, u = (0.05 * rng.normal(size=(space.size, 2)) / space.size for _ in range(2))
    q0, q = (rng.normal(size=space.weight.shape) for _ in range(2))
    free = np.ones_like(u, dtype=bool)
    free[space.mesh.node_sets["bottom"]] = False
    free, units = free.ravel(), np.eye(u.size)
    through = np.array([tissue.pressure_forces(u0, e.reshape(q.shape)).ravel() for e in np.eye(q.size)]).T
    change = np.array([tissue.pressure_change(u0, e.reshape(u.shape)).ravel() for e in units]).T
    K = mixed_tangent_of(tissue, u0, q0).toarray()
    misfit = tissue.pressure(u) - q
    mixed_forces = tissue.forces(u) - tissue.pressure_forces(u, misfit)
    system = np.block(
        [[(K - through @ change)[np.ix_(free, free)], through[free]], [-change[:, free], np.eye(q.size)]]
    )
    both = np.linalg.solve(system, np.concatenate([-mixed_forces.ravel()[free], misfit.ravel()]))

    pressure = Pressure(tissue, SimpleNamespace(reusable=SimpleNamespace(state=SimpleNamespace(u=u0))))
    state = SimpleNamespace(u=u, pressure=q)
    np.testing.assert_allclose(pressure.misfit(state), misfit)
    forces = (tissue.forces(u) + pressure.further_forces(state, misfit)).ravel()
    du = np.zeros(u.size)
    du[free] = np.linalg.solve(K[np.ix_(free, free)], -forces[free])
    np.testing.assert_allclose(du[free], both[: free.sum()], atol=1e-8 * np.abs(du).max())
    after = pressure.after(state, misfit, du.reshape(u.shape), 1.0)
    np.testing.assert_allclose((after - q).ravel(), both[free.sum() :], atol=1e-8 * np.abs(after).max())
    half = pressure.after(state, misfit, du.reshape(u.shape), 0.5)
    np.testing.assert_allclose(half, 0.5 * (q + after), atol=1e-12 * np.abs(after).max())


# -- checkpoints
# -----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def interrupted():
    """A scene with friction, its rows, and the checkpoint after its second step."""
    kept, rows = {}, []

    class Observer:
        def step(self, row, frame, checkpoint):
            rows.append(row)
            kept[row["step"]] = {name: np.copy(array) for name, array in checkpoint().items()}

    motion = ev.Press(indentation=0.3, steps=2), ev.Slide(0.3, steps=3)
    scene = ev.Scene(finger(block(8, 3, sag=0.4), nu=0.49999), ev.Flat(friction=0.3), motion=motion)
    simulate(scene, observers=[Observer()])
    return scene, rows, kept


def test_a_resumed_run_has_the_factorisation_that_was_made_under_a_pressure(interrupted):
    scene, rows, kept = interrupted
    pressure = kept[2]["factor_pressure"]
    assert np.abs(pressure).max() > 1e-3
    run = Run(scene, Saved(kept[2], rows[:2]))
    np.testing.assert_array_equal(run.checkpoint()["factor_pressure"], pressure)
    assert reusable_of(kept[2]).tangent_point.state.pressure.shape == pressure.shape
    resumed = simulate(scene, resume=Saved(kept[2], rows[:2]))
    assert resumed.newton_iterations.tolist() == [row["newton_iterations"] for row in rows]
    np.testing.assert_allclose(
        resumed.tangential_force, [row["tangential_force"] for row in rows], rtol=1e-12
    )
