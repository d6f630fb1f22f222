"""The press-and-slide benchmark with GetFEM 5.4: `python3 with_getfem.py PROBLEM.npz`.

Lagrange elements of the mesh's own order, every term in GetFEM's weak form language, Newton's
method on its tangent matrix, factorised by MUMPS. Contact is a penalty integrated with the
Gauss-Lobatto rule whose points are the nodes; which way a node slides is kept beside the terms,
because plain return mapping jumps between two states. Needs GetFEM and numpy only.
"""

from typing import Any

import getfem as gf
import numpy as np
from apart import PENALTY, SMALLEST_FORCE, PenaltyContact, Problem, followed, main, newton

BONE, PAD, FIRST_MATERIAL = 1, 2, 10
#: GetFEM's order of an element's nodes: row by row
ROWS = {1: [0, 1, 3, 2], 2: [0, 4, 1, 7, 8, 5, 3, 6, 2]}
F = "(Id(2)+Grad_u)"
SOLID = f"(mu*({F}-Inv({F})')+lambda*log(Det({F}))*Inv({F})'):Grad_Test_u"
PRESSURE = "stiffness*pos_part(plane-X(2)-u(2))"
TOUCH = f"-{PRESSURE}*Test_u(2)"
FRICTION = f"(stiffness*sticking*(X(1)+u(1)-reference)+friction*sliding*{PRESSURE})*Test_u(1)"
GAP = "pos_part(X(2)+u(2)-plane)"
WIDTH = f"pos_part({F}(1,1)*(-Normal(2))+{F}(1,2)*Normal(1))"
PULL = f"pull/(({GAP}+near)*({GAP}+far))*{WIDTH}"


class Peer:
    """A scene in the objects of GetFEM."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self._make_mesh()
        self.contact = PenaltyContact(problem.points[problem.free_pad, 0], problem.plane, problem.friction)
        self.model = gf.Model("real")
        self.model.add_fem_variable("u", self.vectors)
        self._add_solid()
        self._add_contact()
        if problem.pull:
            self._add_pull()
        self.model.add_initialized_data("moved", [0.0, 0.0])
        self.model.add_Dirichlet_condition_with_multipliers(self.inside, "u", self.vectors, BONE, "moved")
        self.free = self.dof[np.setdiff1d(np.arange(len(problem.points)), problem.bone)]
        self.unknowns = slice(*np.cumsum(self.model.interval_of_variable("u")))

    def _make_mesh(self) -> None:
        order, problem = self.problem.order, self.problem
        cells = problem.cells[:, ROWS[order]]
        self.mesh = gf.Mesh("empty", 2)
        corners = np.asfortranarray(problem.points[cells].transpose(2, 1, 0))
        numbers = self.mesh.add_convex(gf.GeoTrans(f"GT_QK(2,{order})"), corners)
        point_of = np.empty(len(problem.points), dtype=int)
        point_of[cells.ravel()] = self.mesh.pid_from_cvid(numbers)[0]
        for region, nodes in ((BONE, problem.bone), (PAD, problem.pad)):
            self.mesh.set_region(region, self.mesh.faces_from_pid(point_of[nodes]))
        self.lame = np.unique(np.stack([problem.mu, problem.lmbda]), axis=1).T
        for number, (mu, _) in enumerate(self.lame):
            region = np.stack([numbers[problem.mu == mu], np.full(np.sum(problem.mu == mu), -1)])
            self.mesh.set_region(FIRST_MATERIAL + number, region)
        self.vectors, self.scalars = gf.MeshFem(self.mesh, 2), gf.MeshFem(self.mesh, 1)
        for space in (self.vectors, self.scalars):
            space.set_fem(gf.Fem(f"FEM_QK(2,{order})"))
        self.dof = np.empty(len(problem.points), dtype=int)  # first unknown of a node is twice this
        self.dof[cells.ravel()] = self.scalars.basic_dof_from_cvid(numbers)[0]

    def _add_solid(self) -> None:
        rule = gf.Integ(f"IM_GAUSS_PARALLELEPIPED(2,{2 * self.problem.order + 1})")
        self.inside = gf.MeshIm(self.mesh, rule)
        for number, (mu, lmbda) in enumerate(self.lame):
            names = {"mu": f"mu{number}", "lambda": f"lambda{number}"}
            self.model.add_initialized_data(names["mu"], mu)
            self.model.add_initialized_data(names["lambda"], lmbda)
            term = SOLID.replace("mu", names["mu"]).replace("lambda", names["lambda"])
            self.model.add_nonlinear_term(self.inside, term, FIRST_MATERIAL + number, 1, 0)

    def _add_contact(self) -> None:
        nodal = f"IM_GAUSSLOBATTO1D({2 * self.problem.order - 1})"
        self.outline = gf.MeshIm(self.mesh, gf.Integ(f"IM_PRODUCT({nodal},{nodal})"))
        self.pad = self.dof[self.problem.free_pad]
        share = gf.asm_generic(
            self.outline, 1, "Test_s", PAD, "s", True, self.scalars, np.zeros(len(self.dof))
        )
        self.stiffness = np.zeros(len(self.dof))
        self.stiffness[self.pad] = PENALTY / np.ravel(share)[self.pad]
        for name in ("stiffness", "sticking", "sliding", "reference"):
            self.model.add_initialized_fem_data(name, self.scalars, self.stiffness)
        self.model.add_initialized_data("plane", self.problem.plane)
        self.model.add_nonlinear_term(self.outline, TOUCH, PAD, 1, 0)
        if self.problem.friction:
            self.model.add_initialized_data("friction", self.problem.friction)
            self.model.add_nonlinear_term(self.outline, FRICTION, PAD, 0, 0)

    def _add_pull(self) -> None:
        for name, value in zip(
            ("pull", "near", "far"), (self.problem.pull, *self.problem.layers), strict=True
        ):
            self.model.add_initialized_data(name, value)
        self.model.add_nonlinear_term(self.outline, f"{PULL}*Test_u(2)", PAD, 0, 0)

    def update_friction(self) -> None:
        """Contact at the current displacement, and its state where there is friction."""
        u = np.ravel(self.model.variable("u")).reshape(-1, 2)[self.pad]
        self.contact.update(*(self.problem.points[self.problem.free_pad] + u).T)
        if self.problem.friction:
            for name in ("sticking", "sliding", "reference"):
                values = np.zeros(len(self.dof))
                values[self.pad] = getattr(self.contact, name)
                self.model.set_variable(name, values)

    def residual(self) -> float:
        """The largest free residual over the largest force on the bone, which plane and field balance.

        GetFEM has assembled it at the current displacement; where there is friction, its state has changed.
        """
        self.update_friction()
        if self.problem.friction:
            self.model.assembly("build_rhs")
        residual = np.ravel(self.model.rhs())[self.unknowns].reshape(-1, 2)[self.free]
        normal, tangential, pull = self.forces
        bone = max(abs(normal - pull), abs(tangential), SMALLEST_FORCE)
        return float(np.abs(residual).max() / bone)

    def correct(self, first: bool) -> None:
        """A full step of Newton's method; GetFEM moves the bone with whichever comes first."""
        self.model.solve("max_iter", 1, "max_res", 1e-300, "lsearch", "simplest", "alpha max ratio", 1e300)

    def move(self, position: float, indentation: float) -> int:
        """Move the bone and find the equilibrium; the number of iterations."""
        self.model.set_variable("moved", [position, -indentation])
        self.update_friction()
        return newton(self.residual, self.correct, self.contact, self.problem.tolerance)

    @property
    def forces(self) -> list[float]:
        """Normal, tangential and electrostatic force in N/mm."""
        pull = 0.0
        if self.problem.pull:
            pull = float(np.ravel(gf.asm_generic(self.outline, 0, PULL, PAD, self.model))[0])
        return [*self.contact.forces, pull]


def solve(problem: Problem) -> dict[str, Any]:
    """Forces after every step (N/mm), and the iterations they took."""
    return followed(Peer(problem))


if __name__ == "__main__":
    gf.util_trace_level(0)
    gf.util_warning_level(0)
    main(solve, {"getfem": gf.getfem_env("version")})
