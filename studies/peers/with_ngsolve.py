"""The press-and-slide benchmark with NGSolve: `python3 with_ngsolve.py PROBLEM.npz`.

Elements of the mesh's own order, whose basis is hierarchical: `Nodes` translates. Newton's method on the
linearised forms, factorised by PARDISO, Cholesky where the tangent is symmetric (scene A). Contact is that of
`with_fenicsx`. Needs the wheels `ngsolve` and `mkl` only; NGSolve finds PARDISO in the latter.
"""

from importlib.metadata import version
from typing import Any

import netgen.meshing as netgen
import ngsolve as ng
import numpy as np
from apart import PENALTY, SMALLEST_FORCE, PenaltyContact, Problem, followed, main, newton

#: a cell's nodes in NGSolve's order, and where they are in the unit square
ORDER = {1: [0, 1, 2, 3], 2: [0, 1, 2, 3, 4, 6, 7, 5, 8]}
PLACES = [(0, 0), (1, 0), (1, 1), (0, 1), (0.5, 0), (0.5, 1), (0, 0.5), (1, 0.5), (0.5, 0.5)]
#: points and weights of the rule whose points are an edge's nodes
LOBATTO = {1: ([(0,), (1,)], [1 / 2, 1 / 2]), 2: ([(0,), (0.5,), (1,)], [1 / 6, 2 / 3, 1 / 6])}
STATE = ("sticking", "sliding", "reference")  # of friction, at the nodes


class Nodes:
    """Values at the nodes (..., N) and NGSolve's unknowns (..., N) of a field, and back, cell by cell."""

    def __init__(self, problem: Problem, space: Any) -> None:
        self.cells = problem.cells[:, ORDER[problem.order]]
        self.unknowns = np.array([space.GetDofNrs(cell) for cell in space.mesh.Elements()])
        element = space.GetFE(ng.ElementId(0))
        self.shapes = np.array([element.CalcShape(*place, 0) for place in PLACES[: self.cells.shape[1]]])
        self.inverse = np.linalg.inv(self.shapes)
        self.first = np.zeros(self.cells.shape, dtype=bool)  # each unknown in one of its cells
        self.first.flat[np.unique(self.unknowns, return_index=True)[1]] = True

    def unknowns_of(self, values: Any) -> Any:
        """The unknowns of values at the nodes."""
        found = np.zeros_like(values)
        found[..., self.unknowns] = values[..., self.cells] @ self.inverse.T
        return found

    def values(self, unknowns: Any) -> Any:
        """The values at the nodes of unknowns."""
        found = np.zeros_like(unknowns)
        found[..., self.cells] = unknowns[..., self.unknowns] @ self.shapes.T
        return found

    def forces(self, residual: Any) -> Any:
        """What acts at the nodes (N,), of what acts on the unknowns (N,)."""
        shares = np.where(self.first, residual[self.unknowns], 0.0) @ self.inverse
        return np.bincount(self.cells.ravel(), shares.ravel(), len(residual))


class Peer:
    """A scene in the objects of NGSolve."""

    def __init__(self, problem: Problem) -> None:
        self.problem, self.mesh = problem, make_mesh(problem)
        scalars = ng.H1(self.mesh, order=problem.order)
        self.vectors = ng.VectorH1(self.mesh, order=problem.order, dirichlet="bone")
        self.u, self.moved, self.residual, self.bent = (ng.GridFunction(self.vectors) for _ in range(4))
        self.pad, self.nodes = problem.free_pad, Nodes(problem, scalars)
        self._bend()
        self.contact = PenaltyContact(problem.points[self.pad, 0], problem.plane, problem.friction)
        self.outline = ng.ds("pad", intrules={ng.SEGM: ng.IntegrationRule(*LOBATTO[problem.order])})
        self.fields = {name: ng.GridFunction(scalars) for name in ("stiffness", *STATE)}
        share = ng.LinearForm(scalars.TestFunction() * self.outline).Assemble()
        self.set("stiffness", PENALTY / self.nodes.forces(array(share))[self.pad])
        self._make_form()

    def _bend(self) -> None:
        """Put the nodes of quadratic cells where the problem has them."""
        bent = self.nodes.unknowns_of(self.problem.points.T)
        bent[:, : self.mesh.nv] = 0.0
        array(self.bent)[:] = bent.ravel()
        if self.problem.order > 1:
            self.mesh.SetDeformation(self.bent)

    def _make_form(self) -> None:
        symmetric = not (self.problem.friction or self.problem.pull)
        u, test = self.vectors.TnT()
        self.form = ng.BilinearForm(self.vectors, symmetric_storage=symmetric)
        self.form += self._solid(u, test) + self._touch(u, test) * self.outline
        if self.problem.pull:
            self.form += self.pull(u, ng.Grad(u).Trace()) * test[1] * self.outline
        self.form.AssembleLinearization(self.u.vec)
        self.solver = self.form.mat.Inverse(self.vectors.FreeDofs(), "pardisospd" if symmetric else "pardiso")

    def _solid(self, u: Any, test: Any) -> Any:
        mu, lmbda = (ng.GridFunction(ng.L2(self.mesh, order=0)) for _ in range(2))
        array(mu)[:], array(lmbda)[:] = self.problem.mu, self.problem.lmbda
        F = ng.Id(2) + ng.Grad(u)
        cofactor = ng.Inv(F).trans
        P = mu * (F - cofactor) + lmbda * ng.log(ng.Det(F)) * cofactor
        return ng.InnerProduct(P, ng.Grad(test)).Compile() * ng.dx  # 2 x 2 or 3 x 3 points

    def _touch(self, u: Any, test: Any) -> Any:
        depth = self.problem.plane - ng.y - u[1]
        pressure = self.fields["stiffness"] * ng.IfPos(depth, depth, 0.0)
        form = -pressure * test[1]
        if self.problem.friction:
            spring = self.fields["stiffness"] * (ng.x + u[0] - self.fields["reference"])
            slides = self.problem.friction * pressure
            form += (self.fields["sticking"] * spring + self.fields["sliding"] * slides) * test[0]
        return form

    def pull(self, u: Any, gradient: Any) -> Any:
        """The attraction of a length of the undeformed outline."""
        near, far = self.problem.layers
        height = ng.y + u[1] - self.problem.plane
        gap, normal = ng.IfPos(height, height, 0.0), ng.specialcf.normal(2)
        width = gradient[0, 1] * normal[0] - (1 + gradient[0, 0]) * normal[1]
        return self.problem.pull / ((gap + near) * (gap + far)) * ng.IfPos(width, width, 0.0)

    def set(self, name: str, values: Any) -> None:
        """Give a field its values at the free nodes of the outline."""
        whole = np.bincount(self.pad, values, len(self.problem.points))
        array(self.fields[name])[:] = self.nodes.unknowns_of(whole)

    def assemble_residual(self) -> float:
        """Residual at the current state; the largest free one over the largest force on the bone."""
        u = self.nodes.values(array(self.u).reshape(2, -1))
        self.contact.update(*(self.problem.points.T + u)[:, self.pad])
        if self.problem.friction:
            for name in STATE:
                self.set(name, getattr(self.contact, name))
        self.form.Apply(self.u.vec, self.residual.vec)
        forces = np.stack([self.nodes.forces(part) for part in array(self.residual).reshape(2, -1)])
        bone = np.abs(forces[:, self.problem.bone].sum(axis=1)).max()
        forces[:, self.problem.bone] = 0.0
        return float(np.abs(forces).max() / max(bone, SMALLEST_FORCE))

    def correct(self, first: bool) -> None:
        """A step of Newton's method; the first also moves the bone."""
        self.form.AssembleLinearization(self.u.vec)
        self.solver.Update()
        if first:
            self.residual.vec.data += self.form.mat * self.moved.vec
            self.u.vec.data += self.moved.vec
        self.u.vec.data -= self.solver * self.residual.vec

    def move(self, position: float, indentation: float) -> int:
        """Move the bone and find the equilibrium; the number of iterations."""
        self.moved.Set(ng.CF((position, -indentation)) - self.u, definedon=self.mesh.Boundaries("bone"))
        self.assemble_residual()
        return newton(self.assemble_residual, self.correct, self.contact, self.problem.tolerance)

    @property
    def forces(self) -> list[float]:
        """Normal, tangential and electrostatic force in N/mm."""
        pull = self.pull(self.u, ng.Grad(self.u)) * self.outline
        return [*self.contact.forces, float(ng.Integrate(pull, self.mesh) if self.problem.pull else 0.0)]


def array(field: Any) -> Any:
    """The unknowns of a field or a linear form."""
    return field.vec.FV().NumPy()


def make_mesh(problem: Problem) -> Any:
    """The mesh of the corners, with `pad` and `bone` as its boundaries."""
    mesh = netgen.Mesh(dim=2)
    corners, cells = np.unique(problem.cells[:, :4], return_inverse=True)
    cells = cells.reshape(-1, 4).astype(np.int32)
    mesh.AddPoints(np.column_stack([problem.points[corners], np.zeros(len(corners))]))
    mesh.Add(netgen.FaceDescriptor(domin=1, bc=1))
    mesh.AddElements(dim=2, index=1, data=cells, base=0)
    sides = np.stack([cells, np.roll(cells, -1, axis=1)], axis=-1).reshape(-1, 2)
    sides, count = np.unique(np.sort(sides, axis=1), axis=0, return_counts=True)
    for number, name in enumerate(("pad", "bone")):
        its = (count == 1) & np.isin(corners[sides], getattr(problem, name)).all(axis=1)
        mesh.AddElements(dim=1, index=number + 1, data=sides[its], base=0)
        mesh.SetBCName(number, name)
    return ng.Mesh(mesh)


if __name__ == "__main__":
    main(lambda problem: followed(Peer(problem)), {"ngsolve": ng.__version__, "mkl": version("mkl")})
