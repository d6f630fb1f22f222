"""A user's weak form over a named region or boundary, as a term of the internal forces.

What the form uses of u and v (gradients, the volume measure) is found in a trial at random
displacements, and so is whether it has a potential: then the derivative of its fluxes is
symmetric. The derivative is exact, by complex step, but the solver's matrix is symmetric: of a
form without potential it gets the symmetric part, while the residual is complete. The answer is
the same, in a few iterations more. What no run could use is refused there: an integrand that is not
linear in v, not finite at rest, or whose derivative is lost in a complex step.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.errors import InputError, describe_value
from evfem.mesh import faces
from evfem.mesh.mesh import Mesh
from evfem.tensor import Array, complex_step, difference, inv
from evfem.tissue.assembly import Points, UserIntegral, points_of
from evfem.tissue.forms import Field, Integrand, Parts, fluxes
from evfem.tissue.space import Space, jacobians, quadrature, shape_functions

#: cells or facets that a form is tried on, and the sizes of the trial's random displacements and gradients
#: from the first to the last
PLACES, SIZES = 16, (0.02, 0.4)
#: relative error of an integrand's linearity in v, and of its derivative by complex step, at most; the step
#: of differences
LINEAR, DERIVATIVE, DIFFERENCE = 1e-9, 1e-4, 1e-5


def make_term(space: Space, form: Integrand, on: str, boundary: bool, law: Any = None) -> UserIntegral:
    """A form over a region, or the outer edges (faces) of a boundary, called `on`; `law` of the region."""
    parts = tried(space.mesh, form, on, boundary, law).parts
    points = facet_points(space, on) if boundary else points_of(space, space.mesh.cells_of(on))
    return UserIntegral(form, points, parts, SimpleNamespace(x=points.x, n=points.normal, law=law))


# -- trial


@dataclass(frozen=True)
class Trial:
    """What a form uses, and whether it has a potential, as far as random displacements show."""

    parts: Parts
    has_potential: bool


class _Watched(Field):
    """A field that notes in `used` which parts are asked for."""

    used: set[str]

    @property
    def grad(self) -> Array:
        """The gradient."""
        self.used.add("grad")
        return super().grad

    @property
    def theta(self) -> Array:
        """The volume measure."""
        self.used.add("theta")
        return super().theta


def tried(mesh: Mesh, form: Integrand, on: str, boundary: bool, law: Any = None) -> Trial:
    """Try a form at a few places of a region or boundary; raises `InputError` where no run could use it."""
    x, n = _facet_places(mesh, on) if boundary else _cell_places(mesh, on)
    w = SimpleNamespace(x=x, n=n, law=law)
    all_parts = Parts(len(x), value=True, grad=True, theta=not boundary)
    size = np.linspace(*SIZES, x.shape[1])[:, None]
    state, *tests = size * np.random.default_rng(1).uniform(-1.0, 1.0, (3, all_parts.size, *x.shape[1:]))
    used: set[str] = set()

    def integrand(stacked: Array, test: Array) -> Array:
        u, v = (_watched(all_parts.field(one), boundary, used) for one in (stacked, test))
        return _value(form, form(u, v, w), x.shape[1:])

    try:
        with np.errstate(all="ignore"):
            _check_linear(form, *(integrand(state, test) for test in (*tests, tests[0] + tests[1])))
            integrand(np.zeros_like(state), tests[0])
            parts = Parts(len(x), value=True, grad="grad" in used, theta="theta" in used)
            D = _derivative(form, parts, state[: parts.size], w)
    except InputError:
        raise
    except Exception as error:  # whatever a user's code raises
        problem = f"an integrand that raises {type(error).__name__}: {error}"
        raise _refused(form, problem, "functions of numpy and evfem.tensor of u, v and w") from error
    skew = np.abs(D - np.swapaxes(D, 0, 1)).max()
    return Trial(parts, bool(skew <= 1e-12 * np.abs(D).max()))


def _refused(form: Integrand, problem: str, allowed: str) -> InputError:
    return InputError(f"form {getattr(form, 'name', '')}".strip(), problem, allowed)


def _value(form: Integrand, value: Any, shape: tuple[int, ...]) -> Array:
    """The integrand at every point, finite; one that is the same everywhere may be a number."""
    found = np.asarray(value, dtype=object if value is None else None)
    if value is None or found.shape not in ((), shape):
        problem = "no integrand" if value is None else f"an integrand of shape {found.shape}"
        raise _refused(form, problem, f"a number for every point, here of shape {shape}")
    if not np.isfinite(found).all():
        raise _refused(form, "an integrand that is infinite or no number", "finite values, at rest too")
    return np.broadcast_to(found, shape)


def _check_linear(form: Integrand, first: Array, second: Array, both: Array) -> None:
    """Whether the integrand at the sum of two test functions is the sum of those at each."""
    if np.abs(both - first - second).max() > LINEAR * max(np.abs(array).max() for array in (first, second)):
        problem = "an integrand that is not linear in v"
        raise _refused(form, problem, "one that is 0 for v = 0 and twice as large for 2 v")


def _derivative(form: Integrand, parts: Parts, state: Array, w: Any) -> Array:
    """The derivative of the fluxes (K, K, C, Q) by complex step, which is that of differences."""
    D = complex_step(lambda x: fluxes(form, parts, x, w), state, rank=1)
    near = difference(lambda x: fluxes(form, parts, x, w), state, DIFFERENCE, rank=1)
    if not np.abs(D - near).max() <= DERIVATIVE * max(np.abs(near).max(), np.abs(D).max()):
        allowed = (
            "functions of numpy and evfem.tensor that take complex numbers: no abs, sign, float or maximum"
        )
        raise _refused(form, "an integrand whose derivative is lost in a complex step", allowed)
    return D


def _watched(field: Field, boundary: bool, used: set[str]) -> _Watched:
    copy = _Watched(field, field.grad, None if boundary else field.theta)
    copy.used = used
    return copy


def _cell_places(mesh: Mesh, name: str) -> tuple[Floats, None]:
    """Centres (dim, C, 1) of a few cells of a region."""
    if name not in mesh.region_names:
        raise InputError(
            "region",
            describe_value(name),
            f"one of the mesh's regions: {', '.join(sorted(mesh.region_names))}",
        )
    centres = mesh.points[_few(mesh.cells[mesh.cells_of(name)])].mean(axis=1)
    return centres.T[..., None], None


def _facet_places(mesh: Mesh, name: str) -> tuple[Floats, Floats]:
    """Middles and outward normals (dim, C, 1) of a few outer edges or faces of a boundary."""
    cells, sides = sides_of(mesh, name)
    corner = mesh.points[_few(mesh.cell_sides[cells, sides])]
    if mesh.dim == 3:
        normal = np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1]).T
    else:
        tangent = corner[:, 1] - corner[:, 0]
        normal = np.stack([tangent[:, 1], -tangent[:, 0]])
    normal = normal / np.linalg.norm(normal, axis=0)
    return corner[:, : 2 * mesh.dim - 2].mean(axis=1).T[..., None], normal[..., None]


def _few(rows: Ints) -> Ints:
    """At most `PLACES` of the rows, spread evenly."""
    return rows[:: -(-len(rows) // PLACES)]


# -- facets


def sides_of(mesh: Mesh, name: str) -> tuple[Ints, Ints]:
    """Cells (K,) and their sides (K,) of a boundary's outer edges (faces); `InputError` without any."""
    if name not in mesh.node_sets:
        allowed = f"one of the mesh's boundaries: {', '.join(sorted(mesh.node_sets))}"
        raise InputError("boundary", describe_value(name), allowed)
    cells, sides = np.nonzero(mesh.in_set(name))
    if not len(cells):
        facet = "face" if mesh.dim == 3 else "edge"
        raise InputError("boundary", describe_value(name), f"a boundary with at least one outer {facet}")
    return cells, sides


def facet_points(space: Space, name: str, rule: tuple[Floats, Floats] | None = None) -> Points:
    """Quadrature points on the outer edges (in space: faces) of a boundary; a `rule` gives places
    (Q, dim - 1) in [0, 1] along an edge with their weights (Q,) instead of the element's own.
    """
    mesh, dim = space.mesh, space.dim
    places, W = rule or quadrature(space.element, facet=True)
    cells, sides = sides_of(mesh, name)
    on_side, by_side = faces.shape_functions(2 * dim - 2, 2.0 * places - 1.0)
    corners = 0.5 * (faces.node_places(mesh.cells.shape[1], dim)[mesh.local_sides[:, : 2 * dim - 2]] + 1.0)
    both = [shape_functions(mesh.kind, on_side @ corner) for corner in corners]
    value, slope = (np.stack(array)[sides] for array in zip(*both, strict=True))
    jacobian = jacobians(mesh, cells, slope)
    ways = 2.0 * np.einsum("qma,kmj->kqja", by_side, corners)[sides]
    tangents = np.einsum("ijkq,kqja->aikq", jacobian, ways)
    normal = (
        np.cross(tangents[0], tangents[1], axis=0)
        if dim == 3
        else np.stack([tangents[0, 1], -tangents[0, 0]])
    )
    area = np.linalg.norm(normal, axis=0)
    nodes = mesh.cells[cells]
    x = np.einsum("kqn,knc->ckq", value, mesh.points[nodes])
    gradient = slope @ inv(jacobian).transpose(2, 3, 0, 1)
    return Points(cells, nodes, value, gradient, area * W, x, normal=normal / area)
