"""Where skin is clamped at a free surface its compression has no limit as the mesh is refined."""

import numpy as np
import pytest

import evfem as ev
from evfem.meshes.benchmark import benchmark_mesh
from evfem.studies.peers import problem
from evfem.studies.precision.scenes import benchmark_finger
from evfem.surface.pad import make_pad

#: levels of the benchmark's meshes -> node distance (mm) at the rim, and the length that is left of it, on
#: the page about limits
LEFT = {0: (0.17, 0.77), 1: (0.08, 0.73), 2: (0.03, 0.68)}


@pytest.mark.parametrize("level", [0, 1, pytest.param(2, marks=pytest.mark.slow)])
def test_the_outline_at_the_clamped_rim_of_the_benchmark_gets_shorter_with_the_mesh(level):
    """Without friction, 1.5 mm deep: what is lost grows with the power -0.19 of the node distance."""
    mesh = benchmark_mesh(level, 2)
    display = ev.Display(problem.INSULATOR, friction=0.0, y=problem.PLANE)
    result = ev.simulate(
        ev.Scene(benchmark_finger(mesh), display, motion=[ev.Press(indentation=1.5, steps=15)])
    )
    pad = make_pad(result.mesh)
    points = result.mesh.points[pad.nodes]
    moved = points + result.frames[-1].displacement[pad.nodes]
    edge = pad.segments[np.argmin(points[pad.segments].mean(axis=1)[:, 0])]
    before, after = (float(np.linalg.norm(np.diff(each[edge], axis=0))) for each in (points, moved))
    assert (before, after / before) == pytest.approx(LEFT[level], abs=0.005)
    first, lost = LEFT[0][0], 1.0 - LEFT[0][1]
    assert 1.0 - after / before == pytest.approx(lost * (before / first) ** -0.19, rel=0.03)
