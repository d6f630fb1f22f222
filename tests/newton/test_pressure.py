"""Equilibria of nearly incompressible bodies: how many iterations they take, that they are those of
the displacements alone, and what a linear step solves.
"""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

import evfem as ev
from evfem import meshes
from evfem.mesh.file import read
from evfem.simulation.run import simulate
from evfem.studies.stability.scenes import benchmark, layered
from evfem.tissue import splitlaw

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


@pytest.mark.parametrize(("element", "nu"), [(element, nu) for element in NEARLY for nu in NEARLY[element]])
@pytest.mark.filterwarnings("ignore:.*q1 cells lock")
def test_a_press_takes_few_iterations_however_little_the_volume_changes(element, nu):
    """Four steps of 0.25 mm: at most 15 iterations each and no parts (measured 4 to 9). Of the
    displacements alone they took 760 to 900 in all at nu = 0.49999.
    """
    result = pressed(element, nu)
    assert result.newton_iterations.max() <= 15
    assert (result.substeps == 1).all()


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


@pytest.mark.filterwarnings("ignore:where skin touches 3000 V")
def test_a_step_without_an_equilibrium_says_why():
    """The tangent there needs the pressure, which is not kept between steps."""
    pad = ev.FingerPad(resolution="coarse", ridges=False, materials={"dermis": ev.NeoHookean(0.08, 0.4999)})
    once = ev.Solver(strategy=ev.Strategy(relaxation=False, smallest_part=0.1))
    motion, display = [ev.Hover(0.05), ev.VoltageRamp(3000.0, steps=1)], ev.Display(insulator=ev.TOUCHSCREEN)
    with pytest.raises(ev.NotConverged, match=r"step 2 did not converge .* behind a barrier"):
        simulate(ev.Scene(pad, display, ev.StrongTroxel(), 100.0, motion, solver=once, breakdown="off"))
