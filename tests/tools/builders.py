"""Small bodies and scenes that several tests share."""

import numpy as np
from evfem.studies.benchmark import benchmark_mesh
from evfem.studies.stability.scenes import INSULATOR, SKIN, block, finger

from evfem.contact.surfaces import Display
from evfem.electrostatics.laws import Kaczmarek
from evfem.finger.fingerpad import MeshedFinger
from evfem.scene.motion import Press, Slide
from evfem.scene.scene import Output, Scene, Solver
from evfem.tissue.laws import NeoHookean

__all__ = ["INSULATOR", "SKIN", "balance", "benchmark_finger", "benchmark_scene", "block", "finger"]

BENCHMARK_LAWS = {"tissue": NeoHookean(E=0.05, nu=0.48), "skin": NeoHookean(E=1.0, nu=0.30)}


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
