"""Equilibria of nearly incompressible bodies: how many iterations they take, that they are those of
the displacements alone, and what a linear step solves.
"""

from dataclasses import fields, replace
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
from evfem.errors import InputError
from evfem.finger.fingerpad import MeshedFinger
from evfem.mesh.file import read
from evfem.simulation.checkpoint import reusable_of
from evfem.simulation.model import make_model
from evfem.simulation.result import Saved
from evfem.simulation.run import Run, simulate
from evfem.solver.pressure import Pressure
from evfem.solver.state import NO_PRESSURE
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


@pytest.mark.parametrize("nu", [0.4999, 0.4999999])
@pytest.mark.parametrize(
    "law",
    [
        lambda mu, nu: ev.materials.Yeoh(c1=0.5 * mu, c2=0.05 * mu, nu=nu),
        lambda mu, nu: ev.materials.Ogden(mu=[1.1 * mu, -0.1 * mu], alpha=[2.0, -2.0], nu=nu),
        lambda mu, nu: Swelling(mu, nu),
    ],
    ids=["yeoh", "ogden", "user"],
)
def test_so_it_does_with_every_law_that_knows_its_volume(law, nu):
    mesh, skin = block(12, 4, sag=0.4), ev.NeoHookean(E=0.3, nu=0.3)
    mesh = replace(mesh, region=(mesh.points[mesh.cells, 1].mean(axis=1) < 0.5).astype(int))
    body = MeshedFinger(
        replace(mesh, region_names={"tissue": 0, "skin": 1}), {"tissue": law(0.02, nu), "skin": skin}
    )
    motion = ev.Press(indentation=0.4, steps=2), ev.Slide(distance=0.3, steps=2)
    result = simulate(ev.Scene(body, ev.Flat(friction=0.3), motion=motion))
    assert result.newton_iterations.max() <= 15
    assert (result.substeps == 1).all()


class Swelling:
    """A user's law: W = mu/2 (J^(-2/3) tr C - 3) + K/2 (J - 1)^2, by its stress."""

    def __init__(self, mu, nu):
        self.mu, self.bulk = mu, 2.0 * mu * (1.0 + nu) / (3.0 * (1.0 - 2.0 * nu))

    def P(self, F):
        J, G = ev.det(F), ev.transpose(ev.inv(F))
        isochoric = self.mu * J ** (-2.0 / 3.0) * (F - ev.tensor.ddot(F, F) / 3.0 * G)
        return isochoric + self.bulk * (J - 1.0) * J * G


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


@pytest.mark.parametrize("dynamics", ["viscous", "inertial"])
def test_and_with_time_friction_and_voltage(dynamics, monkeypatch):
    """nu = 0.499, so that the displacements alone need no parts of steps either."""
    body = finger(block(12, 4, sag=0.4), nu=0.499, viscosity=5e-3)
    motion = ev.Press(indentation=0.2, steps=4, speed=20.0), ev.Slide(0.2, steps=4, speed=20.0)
    surface = ev.Display(friction=0.3, insulator=ev.Layer(0.09, 3.35))
    scene = ev.Scene(body, surface, ev.Kaczmarek(), 1000.0, motion, solver=ev.Solver(dynamics=dynamics))
    mixed = simulate(scene)
    without_pressure(monkeypatch)
    plain = simulate(scene)
    assert (plain.substeps == 1).all()
    columns = ("normal_force", "tangential_force", "electrostatic_force", "viscous_dissipation")
    for column in columns:
        ours, theirs = getattr(mixed, column), getattr(plain, column)
        np.testing.assert_allclose(ours, theirs, rtol=1e-7, atol=1e-12, err_msg=column)
    assert mixed.newton_iterations.tolist() != plain.newton_iterations.tolist()


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

    pressure = Pressure(tissue, SimpleNamespace(reusable=SimpleNamespace(u=u0)))
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


def test_a_new_tangent_leaves_no_further_forces_and_compressible_tissue_no_pressure():
    space = rectangle("q2p1", (2, 2))
    u = np.zeros((space.size, 2))
    state = SimpleNamespace(u=u, pressure=np.ones_like(space.weight))
    stiff = Tissue(space, {"lower": ev.NeoHookean(E=0.3, nu=0.4999)})
    for at in (None, SimpleNamespace(u=u)):
        pressure = Pressure(stiff, SimpleNamespace(reusable=at))
        assert pressure.further_forces(state, pressure.misfit(state)) is None
    soft = Pressure(Tissue(space, {"lower": ev.NeoHookean(E=0.3, nu=0.49)}), SimpleNamespace(reusable=None))
    assert soft.begin(u) is NO_PRESSURE
    assert soft.misfit(state) is NO_PRESSURE
    assert pressure.begin(u).shape == space.weight.shape


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
    assert reusable_of(kept[2]).tangent_point.pressure.shape == pressure.shape
    resumed = simulate(scene, resume=Saved(kept[2], rows[:2]))
    assert resumed.newton_iterations.tolist() == [row["newton_iterations"] for row in rows]
    np.testing.assert_allclose(
        resumed.tangential_force, [row["tangential_force"] for row in rows], rtol=1e-12
    )


def test_a_checkpoint_with_another_pressure_is_refused(interrupted):
    scene, rows, kept = interrupted
    for shape in ((0, 0), (24, 8)):
        damaged = kept[2] | {"factor_pressure": np.zeros(shape)}
        with pytest.raises(InputError, match="factor_pressure"):
            Run(scene, Saved(damaged, rows[:2]))


def test_an_accepted_state_has_no_pressure_of_its_own(interrupted):
    """It is that of the laws there; every field of a rest state is the same for every body."""
    scene, _, kept = interrupted
    model = make_model(scene)
    rest = model.equilibrium.rest(model.bone(0.0, 0.0), 0.0)
    assert rest.pressure.shape == kept[2]["pressure"].shape == (0, 0)
    assert {spec.name for spec in fields(rest)} <= set(kept[2])
