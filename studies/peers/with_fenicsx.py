"""The press-and-slide benchmark with FEniCSx (DOLFINx 0.11): `python3 with_fenicsx.py PROBLEM.npz`.

Lagrange elements of the mesh's own order; Newton's method on PETSc's matrices, factorised by MUMPS, Cholesky
where the tangent is symmetric (scene A). Contact is a penalty in the form language, integrated with the
Gauss-Lobatto rule whose points are the nodes; which way a node slides is kept beside the form, because plain
return mapping jumps between two states. Needs the wheel `dolfinx-solver-real` only.
"""

from typing import Any

import dolfinx_solver  # noqa: F401 - loads the wheel's MPI, without which the others cannot be imported

# isort: split
import basix.ufl
import dolfinx
import numpy as np
import ufl
from apart import PENALTY, SMALLEST_FORCE, PenaltyContact, Problem, cpu_seconds, followed, main, newton
from dolfinx import fem
from dolfinx.fem import petsc
from mpi4py import MPI
from petsc4py import PETSc

PORD = 4  # the fastest of MUMPS' orderings here
COMPILER = {"cffi_extra_compile_args": ["-O3", "-march=native", "-g0"]}


class Peer:
    """A scene in the objects of FEniCSx."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.mesh = make_mesh(problem)
        vectors = fem.functionspace(self.mesh, ("Lagrange", problem.order, (2,)))
        scalars = fem.functionspace(self.mesh, ("Lagrange", problem.order))
        self.u = fem.Function(vectors)
        self.contact = PenaltyContact(problem.points[problem.free_pad, 0], problem.plane, problem.friction)
        self.pad = dofs_of(vectors, problem.free_pad)
        self.scalar_pad = dofs_of(scalars, problem.free_pad)
        self.stiffness, self.reference, self.sliding = (fem.Function(scalars) for _ in range(3))
        self._hold(vectors)
        self._make_forms(vectors, scalars)
        self._make_solver()

    def _hold(self, vectors: Any) -> None:
        self.bone = dofs_of(vectors, self.problem.bone)
        self.moved = fem.Constant(self.mesh, PETSc.ScalarType((0.0, 0.0)))
        self.held = [fem.dirichletbc(self.moved, self.bone.astype(np.int32), vectors)]
        self.is_free = np.ones((len(self.problem.points), 2), dtype=bool)
        self.is_free[self.bone] = False

    def _make_forms(self, vectors: Any, scalars: Any) -> None:
        test, trial = ufl.TestFunction(vectors), ufl.TrialFunction(vectors)
        points = 2 * self.problem.order - 1
        rule = {"quadrature_rule": "GLL", "quadrature_degree": points}
        ds = ufl.Measure("ds", self.mesh, subdomain_data=pad_facets(self.mesh, self.problem), metadata=rule)(
            1
        )
        start = cpu_seconds()
        share = fem.form(ufl.TestFunction(scalars) * ds, jit_options=COMPILER)
        residual = self._solid(test) + self._touch(test, ds)
        if self.problem.pull:
            residual += self._attract(test, ds)
        self.residual = fem.form(residual, jit_options=COMPILER)
        self.tangent = fem.form(ufl.derivative(residual, self.u, trial), jit_options=COMPILER)
        self.form_cpu_s = cpu_seconds() - start
        of_node = fem.assemble_vector(share).array[self.scalar_pad]
        self.stiffness.x.array[self.scalar_pad] = PENALTY / of_node

    def _solid(self, test: Any) -> Any:
        constants = fem.functionspace(self.mesh, ("DG", 0))
        mu, lmbda = fem.Function(constants), fem.Function(constants)
        original = self.mesh.topology.original_cell_index
        mu.x.array[:], lmbda.x.array[:] = self.problem.mu[original], self.problem.lmbda[original]
        F = ufl.Identity(2) + ufl.grad(self.u)
        cofactor = ufl.inv(F).T
        P = mu * (F - cofactor) + lmbda * ufl.ln(ufl.det(F)) * cofactor
        return ufl.inner(P, ufl.grad(test)) * ufl.dx(
            metadata={"quadrature_degree": 2 * self.problem.order + 1}
        )

    def _touch(self, test: Any, ds: Any) -> Any:
        place = ufl.SpatialCoordinate(self.mesh) + self.u
        pressure = self.stiffness * ufl.max_value(self.problem.plane - place[1], 0.0)
        form = -pressure * test[1] * ds
        if self.problem.friction:
            spring = ufl.conditional(
                ufl.gt(pressure, 0.0), self.stiffness * (place[0] - self.reference), 0.0 * place[0]
            )
            slides = self.sliding * self.problem.friction * pressure
            form += ufl.conditional(ufl.eq(self.sliding, 0.0), spring, slides) * test[0] * ds
        return form

    def _attract(self, test: Any, ds: Any) -> Any:
        near, far = self.problem.layers
        gap = ufl.max_value(ufl.SpatialCoordinate(self.mesh)[1] + self.u[1] - self.problem.plane, 0.0)
        normal = ufl.FacetNormal(self.mesh)
        along = ufl.as_vector([-normal[1], normal[0]])
        width = ufl.max_value(along[0] + ufl.dot(ufl.grad(self.u[0]), along), 0.0)
        pull = self.problem.pull / ((gap + near) * (gap + far)) * width
        self.pull = fem.form(pull * ds, jit_options=COMPILER)
        return pull * test[1] * ds

    def _make_solver(self) -> None:
        symmetric = not (self.problem.friction or self.problem.pull)
        self.A, self.b = petsc.create_matrix(self.tangent), petsc.create_vector(self.u.function_space)
        self.A.setOption(PETSc.Mat.Option.SPD, symmetric)
        self.step = self.b.duplicate()
        self.solver = PETSc.KSP().create(MPI.COMM_SELF)
        self.solver.setOperators(self.A)
        self.solver.setType("preonly")
        self.solver.getPC().setType("cholesky" if symmetric else "lu")
        self.solver.getPC().setFactorSolverType("mumps")
        PETSc.Options()["mat_mumps_icntl_7"] = PORD

    def assemble_residual(self) -> float:
        """Residual at the current state; the largest free one over the largest force on the bone."""
        position = self.problem.points[self.problem.free_pad] + self.u.x.array.reshape(-1, 2)[self.pad]
        self.contact.update(*position.T)
        self.reference.x.array[self.scalar_pad] = self.contact.reference
        self.sliding.x.array[self.scalar_pad] = self.contact.sliding
        with self.b.localForm() as local:
            local.set(0.0)
        petsc.assemble_vector(self.b, self.residual)
        forces = self.b.array.reshape(-1, 2)
        bone = np.abs(forces[self.bone].sum(axis=0)).max()
        return float(np.abs(forces[self.is_free]).max() / max(bone, SMALLEST_FORCE))

    def correct(self, first: bool) -> None:
        """A step of Newton's method; the first also moves the bone."""
        self.A.zeroEntries()
        petsc.assemble_matrix(self.A, self.tangent, self.held)
        self.A.assemble()
        if first:
            petsc.apply_lifting(self.b, [self.tangent], [self.held], [self.u.x.petsc_vec], -1.0)
        petsc.set_bc(self.b, self.held, self.u.x.petsc_vec, -1.0)
        self.solver.solve(self.b, self.step)
        self.u.x.petsc_vec.axpy(-1.0, self.step)

    def move(self, position: float, indentation: float) -> int:
        """Move the bone and find the equilibrium; the number of iterations."""
        self.moved.value[:] = position, -indentation
        self.assemble_residual()
        return newton(self.assemble_residual, self.correct, self.contact, self.problem.tolerance)

    @property
    def forces(self) -> list[float]:
        """Normal, tangential and electrostatic force in N/mm."""
        pull = float(fem.assemble_scalar(self.pull)) if self.problem.pull else 0.0
        return [*self.contact.forces, pull]


def make_mesh(problem: Problem) -> Any:
    """The mesh, cells in the order of nodes that DOLFINx uses."""
    element = basix.ufl.element("Lagrange", "quadrilateral", problem.order, shape=(2,))
    order = dolfinx.cpp.io.perm_vtk(dolfinx.mesh.CellType.quadrilateral, problem.cells.shape[1])
    cells = np.ascontiguousarray(problem.cells[:, order])
    return dolfinx.mesh.create_mesh(MPI.COMM_SELF, cells, element, problem.points)


def dofs_of(space: Any, nodes: Any) -> Any:
    """The (blocked) unknowns of a space at nodes of the problem's mesh."""
    geometry = space.mesh.geometry
    dof = np.empty(len(geometry.x), dtype=np.int64)
    of_cells = geometry.dofmaps[0]
    dof[np.asarray(geometry.input_global_indices)[of_cells]] = space.dofmap.list
    return dof[nodes]


def pad_facets(mesh: Any, problem: Problem) -> Any:
    """The facets of the outline, marked 1."""
    points = problem.points[problem.pad] @ (1.0, 1j)
    facets = dolfinx.mesh.locate_entities_boundary(mesh, 1, lambda x: np.isin(x[0] + 1j * x[1], points))
    facets = np.sort(facets)
    return dolfinx.mesh.meshtags(mesh, 1, facets, np.ones(len(facets), dtype=np.int32))


def solve(problem: Problem) -> dict[str, Any]:
    """Forces (N/mm) after every step, the iterations they took, CPU seconds of getting the forms."""
    peer = Peer(problem)
    return followed(peer) | {"form_cpu_s": peer.form_cpu_s}


if __name__ == "__main__":
    petsc_version = ".".join(map(str, PETSc.Sys.getVersion()))
    main(solve, {"dolfinx": dolfinx.__version__, "PETSc": petsc_version})
