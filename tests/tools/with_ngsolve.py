"""Grooves over a film by NGSolve (`pip install ngsolve`), for `electrostatics/test_curves.py`.

Half a period between planes of symmetry, an unstructured mesh of triangles of order 6, halved
twelve times towards the outline's corners; the force is the difference quotient of the capacitance
over the gap, of the fourth order.
"""

import ngsolve as ng
from netgen.geom2d import SplineGeometry

THICKNESS, EPS_R, GAP, STEP = 0.09, 3.35, 0.05, 1e-3
#: outlines of half a period of 0.5 mm above the gap, from the middle of the groove to that of the land
OUTLINES = {
    "upright": [(0.25, 0.2), (0.15, 0.2), (0.15, 0.0), (0.0, 0.0)],
    "leaning": [(0.25, 0.2), (0.2, 0.2), (0.1, 0.0), (0.0, 0.0)],
}


def mesh_of(outline, order, levels):
    """Triangles in film and air, small at the corners of the outline."""
    geometry = SplineGeometry()
    below = [(0.0, -THICKNESS), (0.25, -THICKNESS), (0.25, 0.0)]
    number = [geometry.AppendPoint(*point) for point in [*below, *outline, (0.0, 0.0)]]
    last = len(number) - 1
    kinds = {0: ("plate", 2), 1: ("side", 2), 2: ("side", 1), last - 1: ("side", 1), last: ("side", 2)}
    for k in range(len(number)):
        name, domain = kinds.get(k, ("body", 1))
        ends = ["line", number[k], number[(k + 1) % len(number)]]
        geometry.Append(ends, bc=name, leftdomain=domain, rightdomain=0)
    geometry.Append(["line", number[last], number[2]], bc="face", leftdomain=1, rightdomain=2)
    mesh = ng.Mesh(geometry.GenerateMesh(maxh=0.05))
    for _ in range(levels):
        for element in mesh.Elements(ng.VOL):
            points = [mesh[vertex].point for vertex in element.vertices]
            near = any(abs(x - a) + abs(y - b) < 1e-9 for x, y in points for a, b in outline[1:-1])
            mesh.SetRefinementFlag(element, near)
        mesh.Refine()
    return mesh


def capacitance(outline, gap, order=6, levels=12):
    """C / eps_0 of a whole period."""
    mesh = mesh_of([(x, gap + y) for x, y in outline], order, levels)
    space = ng.H1(mesh, order=order, dirichlet="plate|body")
    u, v = space.TnT()
    eps = ng.CoefficientFunction([1.0, EPS_R])
    matrix = ng.BilinearForm(eps * ng.grad(u) * ng.grad(v) * ng.dx).Assemble().mat
    phi = ng.GridFunction(space)
    phi.Set(ng.CoefficientFunction(1.0), definedon=mesh.Boundaries("plate"))
    load = phi.vec.CreateVector()
    load.data = -matrix * phi.vec
    phi.vec.data += matrix.Inverse(space.FreeDofs(), inverse="sparsecholesky") * load
    return 2.0 * ng.Integrate(eps * ng.grad(phi) * ng.grad(phi) * ng.dx, mesh)


if __name__ == "__main__":
    print("ngsolve", ng.__version__)
    for name, outline in OUTLINES.items():
        for order, levels in ((5, 10), (6, 12)):
            near, far = (
                capacitance(outline, GAP + k * STEP, order, levels)
                - capacitance(outline, GAP - k * STEP, order, levels)
                for k in (1, 2)
            )
            force = -(8.0 * near - far) / (24.0 * STEP)
            print(name, order, f"{capacitance(outline, GAP, order, levels):.8f} {force:.7f}")
