"""The press-and-slide benchmark with FElupe: its solids and its Newton method, and a contact written for it.

Fully integrated Q1 or Q2 elements on the nodes of `benchmark_mesh`; nodal penalty contact with Coulomb
friction by return mapping; PARDISO by pypardiso, symmetric in scene A. FElupe 11.3 has a rigid plane with
friction of its own: as fast in scene A, but in scene B on L1 its Newton iterations jump between two states,
as plain return mapping does and `Plane` does not. Whoever imports this module needs FElupe.
"""

from dataclasses import dataclass, field
from typing import Any

import felupe as fem
import numpy as np
import scipy.sparse as sparse
from pypardiso import PyPardisoSolver

from evfem.common.arrays import Floats, Ints
from evfem.electrostatics.laws import Kaczmarek
from evfem.mesh.mesh import Mesh
from evfem.surface.pad import make_pad
from evfem.surface.surfaces import Flat
from evfem.terms.attraction import Attraction

from .apart import MOST_ITERATIONS, PENALTY, SMALLEST_FORCE, PenaltyContact
from .problem import FRICTION, GIVEN, LAYERS, MATERIALS, PLANE, VOLTAGE, Way, path, scene_mesh

POSITIVE, GENERAL = 2, 11  # kinds of matrix in PARDISO: symmetric positive definite, unsymmetric


@dataclass
class LinearSolver:
    """PARDISO in the form that FElupe calls."""

    symmetric: bool
    pardiso: Any = field(init=False)

    def __post_init__(self) -> None:
        self.pardiso = PyPardisoSolver(mtype=POSITIVE if self.symmetric else GENERAL)

    def __call__(self, A: Any, b: Floats) -> Floats:
        matrix = sparse.csr_matrix(sparse.triu(A) if self.symmetric else A)
        matrix.sort_indices()
        self.pardiso.factorize(matrix)
        solution: Floats = self.pardiso.solve(matrix, np.ascontiguousarray(b))
        return solution


class Plane:
    """The rigid plane under a set of nodes, as an item of FElupe's Newton method."""

    def __init__(self, field: Any, nodes: Ints, friction: float) -> None:
        self.field, self.nodes = field, nodes
        self.start = field[0].region.mesh.points[nodes]
        self.shape = field[0].values.shape
        self.state = PenaltyContact(self.start[:, 0], PLANE, friction)
        self.results = fem.mechanics.Results()
        self.assemble = fem.mechanics.Assemble(vector=self.vector, matrix=self.matrix)

    def vector(self, field: Any, **_: Any) -> Any:
        """What the plane adds to the residual."""
        self.state.update(*(self.start + field[0].values[self.nodes]).T)
        residual = np.zeros(self.shape)
        residual[self.nodes] = np.column_stack([self.state.dragged, -self.state.pressed])
        return sparse.csr_matrix(residual.reshape(-1, 1))

    def matrix(self, **_: Any) -> Any:
        """The derivative of what `vector` computed last."""
        touching, along = PENALTY * self.state.touching, PENALTY * self.state.sticking
        across = -self.state.friction * self.state.sliding * touching
        x, y = 2 * self.nodes, 2 * self.nodes + 1
        rows, columns = np.concatenate([x, x, y]), np.concatenate([x, y, y])
        size = int(np.prod(self.shape))
        return sparse.csr_matrix((np.concatenate([along, across, touching]), (rows, columns)), (size, size))


class Pull:
    """The electrostatic attraction of the outline, by evfem's nodal forces, as an item of FElupe."""

    def __init__(self, field: Any, mesh: Mesh, voltage: float) -> None:
        self.field, self.voltage = field, voltage
        pad = make_pad(mesh)
        self.nodes, self.start = pad.nodes, mesh.points[pad.nodes]
        self.law = Attraction(Kaczmarek(), LAYERS, pad, Flat(y=PLANE))
        self.size = mesh.points.size
        self.dofs = np.column_stack([2 * pad.nodes, 2 * pad.nodes + 1]).ravel()
        self.results = fem.mechanics.Results()
        self.assemble = fem.mechanics.Assemble(vector=self.vector, matrix=self.matrix)

    def vector(self, field: Any, **_: Any) -> Any:
        """What the attraction adds to the residual."""
        self.position = self.start + field[0].values[self.nodes]
        self.forces = self.law.forces(self.law.state(self.position, self.voltage, True))
        residual = np.zeros(self.size)
        residual[self.dofs] = -self.forces.ravel()
        return sparse.csr_matrix(residual.reshape(-1, 1))

    def matrix(self, **_: Any) -> Any:
        """The derivative of what `vector` computed last."""
        local = self.law.stiffness(self.law.state(self.position, self.voltage, True))
        places = (self.dofs[local.row], self.dofs[local.column])
        return sparse.csr_matrix((-local.value, places), (self.size, self.size))


class Peer:
    """One scene in FElupe's objects."""

    def __init__(self, scene: str, element: str, level: int, tolerance: float) -> None:
        self.tolerance = tolerance
        mesh = scene_mesh(element, level)
        self.bone = mesh.node_sets["bone"]
        displacement = plane_strain(mesh.points, mesh.cells)
        self.field = fem.FieldContainer([displacement])
        self.contact = Plane(self.field, np.setdiff1d(mesh.node_sets["pad"], self.bone), FRICTION[scene])
        self.items = [self.contact]
        for name, law in MATERIALS.items():
            cells = mesh.cells[mesh.cells_of(name)]
            part = fem.FieldContainer([plane_strain(mesh.points, cells)])
            self.items.append(fem.SolidBody(fem.NeoHookeCompressible(mu=law.mu, lmbda=law.lmbda), part))
        self.pull = Pull(self.field, mesh, VOLTAGE[scene]) if VOLTAGE[scene] else None
        if self.pull:
            self.items.append(self.pull)
        self.held = [fem.Boundary(displacement, mask=_mask(mesh.points, self.bone, axis)) for axis in (0, 1)]
        self.bounds = dict(enumerate(self.held))
        self.dof0, self.dof1 = fem.dof.partition(self.field, self.bounds)
        self.solver = LinearSolver(symmetric=scene == "A")

    @property
    def forces(self) -> list[float]:
        """Normal, tangential and electrostatic force in N/mm."""
        pull = -self.pull.forces[:, 1].sum() if self.pull else 0.0
        return [*self.contact.state.forces, float(pull)]

    def step(self, position: float, indentation: float) -> int:
        """Move the bone and find the equilibrium; the number of iterations."""
        for boundary, value in zip(self.held, (position, -indentation), strict=True):
            boundary.update(value)
        known = fem.dof.apply(self.field, self.bounds, self.dof0)
        how = {"check": self.check, "tol": self.tolerance, "maxiter": MOST_ITERATIONS, "verbose": 0}
        free = {"dof0": self.dof0, "dof1": self.dof1, "ext0": known, "solver": self.solver}
        result = fem.newtonraphson(x0=self.field, items=self.items, **free, **how)
        self.contact.state.keep()
        return int(result.iterations)

    def check(self, dx: Floats, f: Floats, ftol: float, **_: Any) -> tuple[float, float, bool]:
        """Whether an iteration has converged: largest free residual over the largest force on the bone."""
        bone = f.reshape(-1, 2)[self.bone].sum(axis=0)
        residual = np.abs(f[self.dof1]).max() / max(np.abs(bone).max(), SMALLEST_FORCE)
        done = bool(residual <= ftol and not self.contact.state.turning.any())
        return float(np.linalg.norm(dx)), float(residual), done


def plane_strain(points: Floats, cells: Ints) -> Any:
    """FElupe's displacement field on linear (2 x 2 points) or quadratic quads (3 x 3)."""
    region = fem.RegionQuad if cells.shape[1] == 4 else fem.RegionBiQuadraticQuad
    return fem.FieldPlaneStrain(region(fem.Mesh(points, cells, "quad")), dim=2)


def _mask(points: Floats, nodes: Ints, axis: int) -> Any:
    mask = np.zeros(points.shape, dtype=bool)
    mask[nodes, axis] = True
    return mask


def solve(scene: str, element: str, level: int, way: Way = GIVEN) -> dict[str, Any]:
    """Normal, tangential and electrostatic force (N/mm) after every step, and the iterations."""
    peer = Peer(scene, element, level, way.tolerance)
    history, iterations = [], 0
    for position, indentation in path(scene, way):
        iterations += peer.step(position, indentation)
        history.append(peer.forces)
    return {"history": history, "iterations": iterations, "factorisations": iterations}
