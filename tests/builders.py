"""Small bodies and scenes that several tests share."""

import numpy as np
from evfem.studies.benchmark import benchmark_mesh

from evfem.electrostatics import Kaczmarek, Layer
from evfem.fingerpad import Electrical, MeshedFinger
from evfem.materials import NeoHookean
from evfem.mesh import Mesh
from evfem.scene import Output, Press, Scene, Slide, Solver
from evfem.surfaces import Display

BENCHMARK_LAWS = {"tissue": NeoHookean(E=0.05, nu=0.48), "skin": NeoHookean(E=1.0, nu=0.30)}
SKIN = Electrical(stratum_corneum_thickness=0.38, stratum_corneum_eps_r=1650.0)
INSULATOR = Layer(thickness=0.09, eps_r=3.35)


def grid(x, y):
    """Quads on points x, y of shape (rows, columns), both growing; `pad` the first row, `bone` the last."""
    rows, columns = x.shape
    node = np.arange(rows * columns).reshape(rows, columns)
    corners = [node[:-1, :-1], node[:-1, 1:], node[1:, 1:], node[1:, :-1]]
    cells = np.stack([c.ravel() for c in corners], axis=1)
    sets = {"pad": node[0].copy(), "bone": node[-1].copy()}
    points = np.column_stack([x.ravel(), y.ravel()])
    return Mesh(points, cells, "quad", np.zeros(len(cells), dtype=int), {"tissue": 0}, sets)


def block(columns=8, rows=4, width=4.0, height=2.0, sag=0.0):
    """A block with its lower side at y = 0 in the middle and `sag` mm higher at both ends."""
    x, t = np.meshgrid(np.linspace(-width / 2, width / 2, columns + 1), np.linspace(0.0, 1.0, rows + 1))
    low = sag * (2.0 * x / width) ** 2
    return grid(x, low + t * (height - low))


def finger(mesh, E=0.1, nu=0.4, viscosity=0.0):
    """A body of one neo-Hookean material."""
    return MeshedFinger(mesh, {"tissue": NeoHookean(E=E, nu=nu)}, SKIN, viscosity)


def benchmark_finger(level=0):
    """The finger of the press-and-slide benchmark."""
    return MeshedFinger(benchmark_mesh(level), BENCHMARK_LAWS, SKIN)


def benchmark_scene(kind, level, element=None, steps=15):
    """Scene A, B or C of the benchmark: press to 1.5 mm; friction 0.3 and a slide of 3 mm; 1000 V."""
    motion = [Press(indentation=1.5, steps=steps)]
    if kind == "B":
        motion.append(Slide(distance=3.0, steps=2 * steps))
    surface = Display(friction=0.3 if kind == "B" else 0.0, y=-6.395, insulator=INSULATOR)
    law, voltage = (Kaczmarek(), 1000.0) if kind == "C" else (None, 0.0)
    solver, output = Solver(element=element), Output(every=1000)
    return Scene(benchmark_finger(level), surface, law, voltage, motion, solver=solver, output=output)


def balance(result):
    """Out-of-balance force of every row (rows, 2) relative to its largest force (at least 1e-6 N/mm)."""
    x = [result.applied_tangential_force, -result.tangential_force, result.electrostatic_force_x]
    y = [-result.applied_force, result.normal_force, -result.electrostatic_force]
    forces = np.array([x, y])
    return np.abs(forces.sum(axis=1) / np.maximum(np.abs(forces).max(axis=(0, 1)), 1e-6)).T
