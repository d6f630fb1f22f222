"""Small meshes and a plain Newton solver for tests of the tissue: nothing here knows contact or steps."""

from itertools import product

import numpy as np
import scipy.sparse as sparse
import skfem
from scipy.sparse.linalg import spsolve
from scipy.spatial import cKDTree
from skfem.io.meshio import from_meshio

from evfem.mesh.mesh import Mesh, raised
from evfem.tissue.pattern import Pattern
from evfem.tissue.space import ELEMENTS, make_space
from tools.meshes import between

#: element -> cells before they are raised to the element's order
CELLS = {"q1": "quad", "q1_fbar": "quad", "q2": "quad", "q2p1": "quad", "p2": "triangle"}
SHAPES = {"quad": skfem.ElementQuad1, "quad9": skfem.ElementQuad2, "triangle6": skfem.ElementTriP2}


def bend(x, y):
    """A warp that curves every edge."""
    return x + 0.06 * np.sin(2.0 * y + x), y + 0.08 * np.sin(2.5 * x)


def wavy(points, size=0.08, phase=0.0):
    """A smooth displacement field, far from affine."""
    x, y = points.T
    return size * np.column_stack([np.sin(2 * x + y + phase) + y * y, np.cos(3 * x - y) + x * y])


def columns_of(forces, u, step=1e-5):
    """The matrix of central differences of `forces` (N, dim) by every component of u (N, dim)."""
    steps = step * np.eye(u.size).reshape(u.size, *u.shape)
    return np.column_stack([(forces(u + s) - forces(u - s)).ravel() / (2.0 * step) for s in steps])


def box(*divisions):
    """Cells (E, 2^dim) of a grid in the plane or in space, and the places (N, dim) of its nodes."""
    sizes = np.array(divisions) + 1
    places, corners = (np.array(list(product(*map(range, ends)))) for ends in (sizes, [2] * sizes.size))
    first = places[(places < divisions).all(axis=1)]
    return np.ravel_multi_index((first[:, None] + corners).T, sizes).T, places


def rectangle(element, divisions, size=(1.0, 1.0), warp=None, jitter=0.0, split=None):
    """The space of `element` on [0, w] x [0, h] in nx x ny cells.

    `jitter` moves inner corners at random by that share of a cell and keeps edges straight; `warp` maps all
    nodes, mid-nodes too, so that edges become curves; `split(x, y)` at the centre of a cell is True in region
    `upper`, the rest is `lower`. Node sets: left, right, bottom, top and outline.
    """
    nx, ny = divisions
    base = between(*np.meshgrid(np.linspace(0, size[0], nx + 1), np.linspace(0, size[1], ny + 1)))
    points, sets = base.points, base.node_sets
    cells = base.cells if CELLS[element] == "quad" else _halves(base.cells, nx)
    sets = sets | {"outline": np.unique(np.concatenate(list(sets.values())))}
    inner = np.setdiff1d(np.arange(len(points)), sets["outline"])
    shift = np.random.default_rng(5).uniform(-jitter, jitter, (len(inner), 2))
    points[inner] += shift * [size[0] / nx, size[1] / ny]
    centre = points[cells].mean(axis=1)
    region = np.zeros(len(cells), dtype=int) if split is None else split(*centre.T).astype(int)
    names = {"lower": 0, "upper": 1} if split is not None else {"lower": 0}
    mesh = Mesh(points, cells, CELLS[element], region, names, {k: np.sort(v) for k, v in sets.items()})
    if ELEMENTS[element][0] in ("quad9", "triangle6"):
        mesh = raised(mesh)
    if warp is not None:
        x, y = warp(*mesh.points.T)
        mesh = Mesh(
            np.column_stack([x, y]), mesh.cells, mesh.kind, mesh.region, mesh.region_names, mesh.node_sets
        )
    return make_space(mesh, element)


def _halves(quads, nx):
    """Two triangles of each quadrilateral, the diagonal alternating like a chess board."""
    i = np.arange(len(quads))
    odd = (i % nx + i // nx) % 2 == 1
    turned = np.where(odd[:, None], np.roll(quads, -1, axis=1), quads)
    return np.stack([turned[:, [0, 1, 2]], turned[:, [0, 2, 3]]], axis=1).reshape(-1, 3)


def quarter_ring(inner, outer):
    """Warp of the unit square to a quarter of a ring: x along the radius, y along the angle."""

    def warp(x, y):
        r, angle = inner + (outer - inner) * x, 0.5 * np.pi * y
        return r * np.cos(angle), r * np.sin(angle)

    return warp


def assembled(space, cells, numbers=None):
    """Cell matrices, of all cells or those with these `numbers`, as one sparse matrix, unknowns
    (node, component).
    """
    nodes = space.nodes if numbers is None else space.nodes[numbers]
    unknown = (2 * nodes[:, :, None] + [0, 1]).reshape(len(nodes), -1)
    rows = np.broadcast_to(unknown[:, :, None], cells.shape)
    columns = np.broadcast_to(unknown[:, None, :], cells.shape)
    return sparse.csr_matrix((cells.ravel(), (rows.ravel(), columns.ravel())), shape=(2 * space.size,) * 2)


def tangent_of(space, u, *terms):
    """Tangent of the terms as one sparse matrix, unknowns (node, component)."""
    pattern = Pattern(space.nodes, space.dim)
    data = pattern.zeros()
    for term in terms:
        term.add_tangent(u, pattern, data)
    return pattern.full(pattern.finish(data))


def mixed_tangent_of(tissue, u, q):
    """The same of a tissue under a pressure q (E, Q) of the iterations."""
    pattern = Pattern(tissue.space.nodes, tissue.space.dim)
    data = pattern.zeros()
    tissue.add_tangent(u, pattern, data, q)
    return pattern.full(pattern.finish(data))


def solve(tissue, u, free, load=0.0, iterations=14):
    """Equilibrium f_int(u) = load of the `free` unknowns (N, dim) by Newton from u; all else stays."""
    u, free = u.copy(), free.ravel()
    for _ in range(iterations):
        K = tangent_of(tissue.space, u, *getattr(tissue, "terms", [tissue]))[free][:, free]
        step = np.zeros(u.size)
        step[free] = spsolve(K.tocsc(), (load - tissue.forces(u)).ravel()[free])
        length = 1.0
        while not tissue.smallest_J(u + length * step.reshape(u.shape)) > 0.05:
            length *= 0.5
        u += length * step.reshape(u.shape)
        size = np.abs(step).max()
        if size <= max(1e-11 * np.abs(u).max(), 1e-14):
            return u
    raise AssertionError(f"no equilibrium, last correction {size:g}")


def fine_points(space, intorder=8):
    """Points (2, E, Q), weights, values (n, E, Q) and gradients (n, 2, E, Q) of the shape
    functions, and the nodes (E, n), all taken from scikit-fem on its own mesh: an oracle for the
    space, of higher order."""
    mesh = space.mesh
    basis = skfem.Basis(grid_of(mesh), SHAPES[mesh.kind](), intorder=intorder)
    value = np.stack([np.broadcast_to(basis.basis[a][0], basis.dx.shape) for a in range(basis.Nbfun)])
    grad = np.stack(
        [np.broadcast_to(basis.basis[a][0].grad, (2, *basis.dx.shape)) for a in range(basis.Nbfun)]
    )
    _, node = cKDTree(mesh.points).query(basis.doflocs.T)
    return np.asarray(basis.global_coordinates()), basis.dx, value, grad, node[basis.element_dofs].T


def grid_of(mesh):
    """The scikit-fem mesh with the same nodes, built by scikit-fem's reader of VTK cells."""
    import meshio

    kind = {"quad": "quad", "quad9": "quad9", "triangle6": "triangle6"}[mesh.kind]
    return from_meshio(meshio.Mesh(mesh.points, [(kind, mesh.cells)]))


def l2_error(space, u, exact):
    """L2 norm of u_h - u over the reference, with `exact(X, Y)` -> (2, ...)."""
    x, dx, value, _, nodes = fine_points(space)
    difference = np.einsum("aeq,eai->ieq", value, u[nodes]) - exact(*x)
    return float(np.sqrt(np.sum(difference**2 * dx)))


def order(errors, ratio=2.0):
    """Order of convergence between the last two errors, sizes in `ratio`."""
    return float(np.log(errors[-2] / errors[-1]) / np.log(ratio))
