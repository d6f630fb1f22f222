"""What a whole fingertip costs, one thread: CPU seconds and memory of a few jobs, and a smooth press
beside FElupe on the same nodes.

    python -m evfem.studies.peers.reach smooth ridged evfem felupe

prints a line for each job: `smooth` and `ridged` press the coarse pad to 1 N in eight steps under
1000 V, and slide it 3 mm in fifteen; `whorl` presses to 0.5 N and slides in two directions;
`evfem` and `felupe` press the coarse smooth pad of linear hexahedra 0.5 mm without friction in five
steps, evfem with exact contact and its hex8, FElupe with fully integrated hexahedra and the nodal
penalty of the plane comparison; both run twice, and the second time counts, without imports. Each job
belongs into a process of its own where memory counts.
"""

from __future__ import annotations

import resource
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np

import evfem as ev
from evfem.common.arrays import Floats, Ints
from evfem.finger.layers import LAYERS
from evfem.surface.skin import make_skin

from .apart import MOST_ITERATIONS, PENALTY, SMALLEST_FORCE
from .problem import TOLERANCE

DEPTHS = tuple(0.1 * (k + 1) for k in range(5))


def job(ridges: str, load: float, *slides: ev.Slide) -> Callable[[], float]:
    """Press under 1000 V and slide; the friction force at the end (N)."""

    def run() -> float:
        motion = [ev.Press(force=load, steps=8), *slides]
        finger = ev.Fingertip(ridges=ridges, resolution="coarse")
        scene = ev.Scene(finger, ev.Display(friction=0.3), ev.Kaczmarek(), 1000.0, motion)
        result = ev.simulate(scene)
        return float(np.hypot(result.tangential_force_x[-1], result.tangential_force_z[-1]))

    return run


def smooth_press() -> float:
    """Force (N) of the smooth pad 0.5 mm deep, by evfem."""
    finger = ev.Fingertip(ridges="none", resolution="coarse")
    motion = [ev.Press(indentation=DEPTHS[-1], steps=len(DEPTHS))]
    scene = ev.Scene(finger, ev.Flat(friction=0.0), motion=motion, solver=ev.Solver(element="hex8"))
    return float(ev.simulate(scene).normal_force[-1])


class Floor:
    """A rigid plane under nodes, without friction, as an item of FElupe's Newton method."""

    def __init__(self, field: Any, nodes: Ints, height: float) -> None:
        import felupe as fem

        self.field, self.nodes, self.height = field, nodes, height
        self.start = field[0].region.mesh.points[nodes, 1]
        self.shape = field[0].values.shape
        self.results = fem.mechanics.Results()
        self.assemble = fem.mechanics.Assemble(vector=self.vector, matrix=self.matrix)

    @property
    def pressed(self) -> Floats:
        """Forces (P,) on the nodes in N."""
        gap = self.start + self.field[0].values[self.nodes, 1] - self.height
        return np.asarray(PENALTY * np.maximum(-gap, 0.0))

    def vector(self, field: Any, **_: Any) -> Any:
        """What the plane adds to the residual."""
        import scipy.sparse as sparse

        residual = np.zeros(self.shape)
        residual[self.nodes, 1] = -self.pressed
        return sparse.csr_matrix(residual.reshape(-1, 1))

    def matrix(self, **_: Any) -> Any:
        """Its derivative."""
        import scipy.sparse as sparse

        y, size = 3 * self.nodes + 1, int(np.prod(self.shape))
        return sparse.csr_matrix((PENALTY * (self.pressed > 0.0), (y, y)), (size, size))


def felupe_press() -> float:
    """The same by FElupe."""
    import felupe as fem

    from evfem.solver.condensation import pardiso_library

    pardiso_library()  # says where the library is, which pypardiso may not find
    from .with_felupe import LinearSolver

    finger = ev.Fingertip(ridges="none", resolution="coarse")
    mesh = finger.mesh(1)
    bone, pad = mesh.node_sets["bone"], make_skin(mesh)
    whole = fem.Field(fem.RegionHexahedron(fem.Mesh(mesh.points, mesh.cells, "hexahedron")), dim=3)
    field = fem.FieldContainer([whole])
    floor = Floor(field, pad.nodes[pad.free], float(mesh.points[pad.nodes, 1].min()))
    items: list[Any] = [floor]
    for name in (layer.name for layer in LAYERS if layer.name in mesh.region_names):
        cells, law = mesh.cells[mesh.cells_of(name)], finger.materials[name]
        part = fem.Field(fem.RegionHexahedron(fem.Mesh(mesh.points, cells, "hexahedron")), dim=3)
        own: Any = law
        items.append(
            fem.SolidBody(fem.NeoHookeCompressible(mu=own.mu, lmbda=own.lmbda), fem.FieldContainer([part]))
        )
    held = []
    for axis in range(3):
        mask = np.zeros(mesh.points.shape, dtype=bool)
        mask[bone, axis] = True
        held.append(fem.Boundary(whole, mask=mask))
    bounds = dict(enumerate(held))
    dof0, dof1 = fem.dof.partition(field, bounds)

    def check(dx: Floats, f: Floats, ftol: float, **_: Any) -> tuple[float, float, bool]:
        force = np.abs(f.reshape(-1, 3)[bone].sum(axis=0)).max()
        residual = float(np.abs(f[dof1]).max() / max(force, SMALLEST_FORCE))
        return float(np.linalg.norm(dx)), residual, residual <= ftol

    for depth in DEPTHS:
        held[1].update(-depth)
        known = fem.dof.apply(field, bounds, dof0)
        fem.newtonraphson(
            x0=field, items=items, dof0=dof0, dof1=dof1, ext0=known, solver=LinearSolver(symmetric=True),
            check=check, tol=TOLERANCE, maxiter=MOST_ITERATIONS, verbose=0,
        )  # fmt: skip
    return float(floor.pressed.sum())


SLID = ev.Slide(3.0, steps=15, hold="force")
JOBS: dict[str, Callable[[], float]] = {
    "smooth": job("none", 1.0, SLID),
    "ridged": job("along", 1.0, SLID),
    "whorl": job(
        "whorl",
        0.5,
        ev.Slide(1.0, steps=5, hold="force"),
        ev.Slide(1.0, steps=5, hold="force", angle=90.0),
    ),
    "evfem": smooth_press,
    "felupe": felupe_press,
}
#: jobs that are compared with each other
COMPARED = ("evfem", "felupe")


def main(names: list[str]) -> None:
    """Run jobs and print what they took."""
    for name in names:
        if name in COMPARED:
            JOBS[name]()  # for its imports
        before = time.process_time()
        force = JOBS[name]()
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0**2
        print(
            f"{name}: {force:.6g} N, {time.process_time() - before:.1f} CPU s, peak {peak:.2f} GB", flush=True
        )


if __name__ == "__main__":
    main(sys.argv[1:])
