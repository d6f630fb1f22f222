"""Small bodies and scenes that several tests share, and what their results say."""

import numpy as np

import evfem as ev
from evfem.simulation.checkpoint import Checkpoint
from evfem.simulation.result import Saved
from evfem.studies.stability.case import out_of_balance as balance
from evfem.studies.stability.scenes import INSULATOR, SKIN, block, finger
from evfem.studies.stability.scenes import benchmark as benchmark_finger
from evfem.studies.stability.scenes import pad as coarse_pad

__all__ = ("INSULATOR", "SKIN", "balance", "benchmark_finger", "coarse_pad", "finger", "small_finger")


def small_finger(columns=20, rows=4):
    """A block of 6 x 3 mm, round below, for what holds of every body: 369 nodes in quadratic cells, a ninth
    of the coarse finger. Of 40 columns, its nodes are 0.075 mm apart.
    """
    return finger(block(columns, rows, 6.0, 3.0, 0.6), E=0.05)


def benchmark_scene(kind, level, element=None, steps=15):
    """Scene A, B or C of the benchmark: press to 1.5 mm; friction 0.3 and a slide of 3 mm; 1000 V."""
    motion = [ev.Press(indentation=1.5, steps=steps)]
    if kind == "B":
        motion.append(ev.Slide(distance=3.0, steps=2 * steps))
    surface = ev.Display(friction=0.3 if kind == "B" else 0.0, y=-6.395, insulator=INSULATOR)
    law, voltage = (ev.Kaczmarek(), 1000.0) if kind == "C" else (None, 0.0)
    solver, output = ev.Solver(element=element), ev.Output(every=1000)
    return ev.Scene(benchmark_finger(level), surface, law, voltage, motion, solver=solver, output=output)


def left_over(result):
    """The largest work or energy that no column has, relative to the largest of its row (at least 1e-12)."""
    given = [result.external_work, result.electrostatic_work, result.adhesive_work]
    kept = [result.stored_energy, result.kinetic_energy, result.friction_dissipation]
    kept += [result.viscous_dissipation, result.integrator_dissipation, result.snap_dissipation]
    left = np.abs(np.sum(given, axis=0) - np.sum(kept, axis=0))
    return (left / np.maximum(np.abs(given + kept).max(axis=0), 1e-12)).max()


def unbalanced(result):
    """Sum of the forces on a finger at rest, x, y, z (3, steps)."""
    pulled = result.electrostatic_force + result.adhesive_force
    y = result.normal_force - pulled - result.applied_force
    x, z = (
        getattr(result, f"applied_tangential_force_{axis}")
        - getattr(result, f"tangential_force_{axis}")
        + getattr(result, f"electrostatic_force_{axis}")
        + getattr(result, f"adhesive_force_{axis}")
        for axis in "xz"
    )
    return np.array([x, y, z])


def watched(scene):
    """The result of a scene, and copies of what a checkpoint has after every step."""
    kept = []

    class Keeper:
        def step(self, row, frame, checkpoint):
            kept.append({name: np.copy(array) for name, array in checkpoint().items()})

    return ev.simulate(scene, observers=[Keeper()]), kept


def resumed(scene, *after, folder=None):
    """The result of a scene, and those of runs that go on from its checkpoints after steps, by way of a file
    where a folder is given.
    """
    whole, kept = watched(scene)
    found = [whole]
    for step in after:
        saved = Saved(kept[step - 1], whole.rows[:step])
        if folder is not None:
            file = Checkpoint(folder / "checkpoint.npz")
            file.write(scene.digest(), saved.arrays, saved.rows)
            saved = file.read(scene.digest())
        found.append(ev.simulate(scene, resume=saved))
    return found


def pad_state(result, k=-1):
    """Of frame k along the pad: x relative to the bone, current tributary lengths, fields by name.

    The nodes of a quadratic edge carry 1/6, 4/6, 1/6 of its length.
    """
    frame, pad = result.frames[k], result.mesh.node_sets["pad"]
    pad = pad[np.argsort(result.mesh.points[pad, 0])]
    x = result.mesh.points[pad, 0] + frame.displacement[pad, 0] - frame.position
    length = np.zeros(len(pad))
    edge = x[2::2] - x[:-2:2]
    length[1::2] += edge * 4.0 / 6.0
    length[:-2:2] += edge / 6.0
    length[2::2] += edge / 6.0
    names = ("contact_pressure", "shear_traction", "contact_status", "gap")
    return x, length, {name: getattr(frame, name)[pad] for name in names}
