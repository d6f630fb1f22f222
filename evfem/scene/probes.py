r"""Probes (`Output(probes=...)`): stress and strain at material points of the tissue after every step.

A point is specified in the undeformed mesh and moves with the tissue. It belongs to one cell: on a border
to that of the region with the lowest number, or of the layer at whose boundary it is requested. F is that of
the point; ln J in the law is :math:`\theta`, the element's own measure of volume extrapolated to the point
(`evfem.tissue.space`), so that pressures do not oscillate where nu is close to 1/2. The history variables of
Maxwell branches are known at the quadrature points: their second Piola-Kirchhoff stress and their energy are
extrapolated from there in the same way.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from types import SimpleNamespace
from typing import Annotated, Any

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.common.checks import Checked, Within, finite, number
from evfem.common.tables import csv_text, frame
from evfem.common.units import in_unit
from evfem.errors import ABSENT, InputError, Mistakes, describe_value
from evfem.mesh.faces import ON, crossings, inverted
from evfem.mesh.mesh import Mesh
from evfem.scene.keys import read
from evfem.tensor import det, identity
from evfem.tissue.space import shape_functions

#: points of all probes at most
MOST_POINTS = 10_000
SYMMETRIC = ("xx", "yy", "zz", "xy", "yz", "xz")
#: numbers of so many components in their tensor, or number
_SHAPED: Mapping[int, Any] = {
    1: 0,
    6: np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2]]),
    9: np.arange(9).reshape(3, 3),
}
_POINTS = "points [[x, y], ...] of the undeformed mesh in mm (in space [[x, y, z], ...]), or a Probe"
_INSIDE = "points of the undeformed tissue"


def _numbers(allowed: str) -> dict[str, Any]:
    def check(key: str, value: Any) -> tuple[float, ...]:
        entered = [value] if isinstance(value, str) else value
        if isinstance(entered, list | tuple):
            entered = [in_unit(key, one, "mm", allowed) for one in entered]
        found = np.atleast_1d(finite(key, entered, allowed))
        if found.ndim != 1 or not found.size or found.dtype.kind == "c":
            raise InputError(key, describe_value(value), allowed)
        return tuple(found.tolist())

    return {"allowed": allowed, "check": check, "unit": "mm"}


@dataclass(frozen=True)
class Probe(Checked):
    """Points of the tissue at some x (and z): at a `depth` below the undeformed outline, measured
    vertically, or `at` the lower boundary of a layer.

    >>> Probe(x=[0.0, 0.5], depth=0.85).x
    (0.0, 0.5)
    """

    x: Annotated[
        Sequence[float], _numbers("one or more numbers in mm"), {"type": list[float]}, "of the points"
    ]
    depth: Annotated[
        float | None,
        number("a depth in mm from 0 to 50; one of depth and at", Within(0.0, 50.0), "mm"),
        "below the undeformed outline",
    ] = None
    at: Annotated[
        str | None, {"allowed": "a region of the mesh, such as epidermis"}, "layer at whose lower boundary"
    ] = None
    z: Annotated[
        Sequence[float] | None,
        _numbers("as many numbers in mm as x"),
        {"type": list[float]},
        "of a Fingertip",
    ] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if (self.depth is None) == (self.at is None):
            raise InputError("depth", ABSENT if self.at is None else "beside at", "one of depth and at")
        if self.z is not None and len(self.z) != len(self.x):
            raise InputError("z", f"{len(self.z)} numbers", f"as many as x, {len(self.x)}")


Wanted = Mapping[str, Any]  # name -> Probe, or points


def checked(key: str, entry: Any) -> Wanted:
    """Probes by name, their points as tuples of tuples; tables of a scene file become a `Probe`."""
    if not isinstance(entry, Mapping):
        raise InputError(key, describe_value(entry), f"a table of names, each with {_POINTS}")
    mistakes, found = Mistakes(), dict[str, Any]()
    for name, one in entry.items():
        with mistakes.of_a_part():
            if not isinstance(name, str) or not re.fullmatch(r"\w[\w -]{0,59}", name):
                raise InputError(
                    key, describe_value(name), "names of up to 60 letters, digits, _, - and blanks"
                )
            found[name] = _checked_one(f"{key}.{name}", one)
    mistakes.report()
    if (total := sum(map(count, found.values()))) > MOST_POINTS:
        raise InputError(key, f"{total} points", f"at most {MOST_POINTS} points")
    return found


def _checked_one(key: str, entry: Any) -> Any:
    if isinstance(entry, Probe):
        return entry
    if isinstance(entry, Mapping):
        return read(Probe, entry, key)
    points = np.asarray(finite(key, entry, _POINTS))
    if points.ndim != 2 or not len(points) or points.shape[1] not in (2, 3) or points.dtype.kind == "c":
        raise InputError(key, describe_value(entry), _POINTS)
    return tuple(map(tuple, points.tolist()))


def count(one: Any) -> int:
    """Number of points of a probe."""
    return len(one.x if isinstance(one, Probe) else one)


#: quantity -> its components
QUANTITIES: Mapping[str, tuple[str, ...]] = {
    "position": tuple("xyz"),
    "displacement": tuple("xyz"),
    "deformation_gradient": tuple(a + b for a in "xyz" for b in "xyz"),
    "cauchy_stress": SYMMETRIC,
    "green_strain": SYMMETRIC,
    "principal_stretches": tuple("123"),
    **dict.fromkeys(("J", "pressure", "von_mises", "strain_energy_density", "branch_energy_density"), ("",)),
}
#: dimensions of a quantity in a data set, beside those of steps and points
_DIMENSIONS: Mapping[str, tuple[str, ...]] = {
    **dict.fromkeys(("position", "displacement"), ("axis",)),
    **dict.fromkeys(("deformation_gradient", "cauchy_stress", "green_strain"), ("row", "column")),
    "principal_stretches": ("principal",),
}
#: unit of a quantity that is not in MPa
UNITS: Mapping[str, str] = {
    **dict.fromkeys(("position", "displacement"), "mm"),
    **dict.fromkeys(("deformation_gradient", "green_strain", "principal_stretches", "J"), ""),
    **dict.fromkeys(("strain_energy_density", "branch_energy_density"), "N/mm2"),
}


@dataclass(frozen=True, eq=False)
class ProbeHistory:
    """Histories at P points over S steps; mm, MPa, and N/mm2 for the energy density.

    Tensors are three-dimensional, in the plane those of plane strain. `cauchy_stress`, `pressure` (a third
    of its negative trace) and `von_mises` are of the material's law with its branches, without its
    viscosity, and so is `strain_energy_density`, per undeformed volume; `branch_energy_density` is the
    contribution of the branches. `principal_stretches` begin with the largest; `J` is det F of the point.
    """

    position: Floats
    displacement: Floats
    deformation_gradient: Floats
    cauchy_stress: Floats
    green_strain: Floats
    principal_stretches: Floats
    J: Floats
    pressure: Floats
    von_mises: Floats
    strain_energy_density: Floats
    branch_energy_density: Floats

    def __repr__(self) -> str:
        """How many points and steps."""
        return f"ProbeHistory of {len(self.position)} points, {len(self.J)} steps"

    def component(self, name: str) -> Floats:
        """A number a step and point (steps, points), such as `cauchy_stress_yy` or `von_mises`."""
        dim = self.position.shape[1]
        if name not in (allowed := columns(dim)[dim:]):
            raise InputError("quantity", describe_value(name), " | ".join(allowed))
        quantity = next(one for one in QUANTITIES if name == one or name.startswith(f"{one}_"))
        at = tuple("xyz123".index(letter) % 3 for letter in name.removeprefix(quantity).strip("_"))
        return np.asarray(getattr(self, quantity)[(..., *at)])

    def table(self) -> Any:
        """A `pandas.DataFrame` (without pandas a numpy record array) with a row for each step, from 1, and
        point, from 0, in columns as those of `probes.csv`: `x`, `y`, `cauchy_stress_yy` and so on.
        """
        (steps, points), dim = self.J.shape, self.position.shape[1]
        found = {"step": np.repeat(np.arange(1, steps + 1), points), "point": np.tile(range(points), steps)}
        places = zip("xyz"[:dim], self.position.T, strict=True)
        found |= {axis: np.tile(place, steps) for axis, place in places}
        return frame(found | {name: self.component(name).ravel() for name in columns(dim)[dim:]})

    def variables(self, name: str) -> dict[str, tuple[tuple[str, ...], Floats, dict[str, str]]]:
        """Dimensions, values and attributes of each quantity in a data set where the probe has this name."""
        found = {}
        for quantity in QUANTITIES:
            values = getattr(self, quantity)
            steps = () if quantity == "position" else ("step",)
            dims = (*steps, f"{name}_point", *_DIMENSIONS.get(quantity, ()))
            words = {"units": UNITS.get(quantity, "MPa"), "long_name": quantity.replace("_", " ")}
            found[f"{name}_{quantity}"] = (dims, values, words)
        return found


def _components(dim: int) -> dict[str, tuple[str, ...]]:
    return {**QUANTITIES, **{name: QUANTITIES[name][:dim] for name in ("position", "displacement")}}


def columns(dim: int) -> tuple[str, ...]:
    """Names of the K numbers of a point in so many dimensions."""
    return tuple(f"{name}_{c}".rstrip("_") for name, several in _components(dim).items() for c in several)


def histories(wanted: Wanted, dim: int, values: Floats) -> dict[str, ProbeHistory]:
    """The history of each probe, from the numbers (S, P, K) of all points after each step."""
    sizes = {name: len(several) for name, several in _components(dim).items()}
    found, first = dict[str, ProbeHistory](), 0
    for name, one in wanted.items():
        own = values[:, first : first + count(one)]
        first += count(one)
        parts = np.split(own, np.cumsum([*sizes.values()])[:-1], axis=2)
        shaped = {
            quantity: values_of_one[..., _SHAPED.get(size, slice(None))]
            for (quantity, size), values_of_one in zip(sizes.items(), parts, strict=True)
        }
        location = shaped.pop("position")
        found[name] = ProbeHistory(
            location[0] if len(location) else np.full(location.shape[1:], np.nan), **shaped
        )
    return found


def csv_header(dim: int) -> str:
    """The first line of `probes.csv`."""
    return csv_text([["step", "time", "probe", "point", *columns(dim)]])


def csv_lines(wanted: Wanted, row: Mapping[str, Any], values: Floats) -> str:
    """The lines of one step, from the numbers (P, K) of its points; points count from 0."""
    names = [(name, i) for name, one in wanted.items() for i in range(count(one))]
    lines = zip(names, values.tolist(), strict=True)
    return csv_text([[int(row["step"]), float(row["time"]), *at, *numbers] for at, numbers in lines])


def read_csv(text: str, wanted: Wanted, dim: int, steps: int) -> dict[str, ProbeHistory]:
    """The histories in a `probes.csv` of so many steps. Raises ValueError for any other text."""
    head, *lines = text.splitlines()
    if head + "\n" != csv_header(dim):
        raise ValueError("no probes")
    numbers = np.array([line.split(",")[4:] for line in lines], dtype=float)
    return histories(wanted, dim, numbers.reshape(steps, sum(map(count, wanted.values())), -1))


class Probes:
    """The points of all probes in the cells of a body (`evfem.tissue.body.Body`) with its branches, if any.

    `points` (P, d) are their positions. Raises InputError for a point outside.
    """

    def __init__(self, wanted: Wanted, body: Any) -> None:
        self.wanted, tissue, branches = wanted, body.tissue, body.branches
        self.space, mesh = tissue.space, tissue.space.mesh
        positions, layers = [], []
        for name, one in wanted.items():
            points, layer = points_of(f"output.probes.{name}", one, mesh)
            positions.append(points)
            layers += [layer] * len(points)
        self.points = np.concatenate(positions)
        names = [name for name, one in wanted.items() for _ in range(count(one))]
        found = Cells(self.space)
        at = [found.at(*point) for point in zip(names, self.points, layers, strict=True)]
        cells, inner = np.array([cell for cell, _ in at]), np.array([xi for _, xi in at])
        self.nodes: Ints = self.space.nodes[cells]
        self.value, local = found.shape(inner)
        jacobian = np.einsum("pnc,pnk->pck", mesh.points[self.nodes], local)
        self.gradient: Floats = np.einsum("pnk,pkc->pnc", local, np.linalg.inv(jacobian))
        x = np.moveaxis(self.space.points[:, cells], 0, 2) - self.points[:, None]
        # linear in each cell, or constant: a polynomial through its quadrature points
        self.from_points = np.linalg.pinv(np.concatenate([np.ones_like(x[..., :1]), x], axis=2))[:, 0]
        self.sample, self.share = self._measure(cells)
        self.relaxing = None if branches is None else Relaxing(branches, cells, self.from_points)
        self.groups = [
            (self._law(law, own), own)
            for law, of in tissue.groups
            if (own := np.flatnonzero(np.isin(cells, of))).size
        ]

    def _measure(self, cells: Ints) -> tuple[Floats, Floats]:
        """Shape gradients (P, S, n, d) where ln J is sampled, and the weights (P, S) of samples in theta."""
        space, sampled = self.space, self.space.sampled
        if space.projection is None:
            return self.gradient[:, None], np.ones((len(cells), 1))
        gradients = (
            sampled.of_mesh[cells]
            if not hasattr(sampled, "inverse")
            else (sampled.reference @ sampled.inverse[cells])
        )
        return gradients, np.einsum("pq,pqs->ps", self.from_points, space.projection[cells])

    def _law(self, law: Any, own: Ints) -> Any:
        from evfem.tissue.splitlaw import FormLaw

        if not isinstance(law, FormLaw):
            return law
        return FormLaw(law.form, SimpleNamespace(x=self.points[own].T[..., None], n=None, law=None))

    @property
    def none(self) -> Floats:
        """The numbers (0, P, K) of no step."""
        return np.zeros((0, len(self.points), len(columns(self.space.dim))))

    def histories(self, several: Floats) -> dict[str, ProbeHistory]:
        """The history of each probe from the numbers (S, P, K) of several steps."""
        return histories(self.wanted, self.space.dim, several)

    def at(self, u: Floats, memory: Mapping[str, Floats]) -> Floats:
        """The numbers (P, K) of `columns` at displacements u (N, d) and the `memory` of a state."""
        from evfem.tissue.forms import Field, embed
        from evfem.tissue.weakform import cauchy_stress

        moved, dim = u[self.nodes], self.space.dim
        grad = np.einsum("pnc,pnd->cdp", moved, self.gradient)[..., None]
        sampled = np.einsum("pnc,psnd->cdps", moved, self.sample)
        F = grad + identity(dim, 2)
        whole = np.moveaxis(embed(F)[..., 0], -1, 0)
        stress, energy = np.zeros((len(moved), 6)), np.empty(len(moved))
        for law, own in self.groups:
            H = sampled[:, :, own]
            small = law.volume_measure == "trace"
            measured = np.trace(H) if small else np.log(det(H + identity(dim, 2)))
            theta = np.sum(self.share[own] * measured, axis=1, keepdims=True)
            sigma = cauchy_stress(law, Field(np.zeros(dim), grad[:, :, own], theta))[..., 0]
            stress[own, : len(sigma)] = sigma.T
            energy[own] = law.split_energy(F[:, :, own], theta)[:, 0]
        more = np.zeros(len(moved))
        if self.relaxing is not None:
            added, more = self.relaxing.at(u, memory["branches"], whole)
            stress, energy = stress + added, energy + more
        pressure = -stress[:, :3].mean(axis=1)
        deviator = stress + pressure[:, None] * [1, 1, 1, 0, 0, 0]
        strain = 0.5 * (np.swapaxes(whole, 1, 2) @ whole - np.eye(3))
        parts = [
            self.points,
            np.einsum("pn,pnc->pc", self.value, moved),
            whole.reshape(-1, 9),
            stress,
            strain[:, [0, 1, 2, 0, 1, 0], [0, 1, 2, 1, 2, 2]],
            np.linalg.svd(whole, compute_uv=False),
            np.linalg.det(whole),
            pressure,
            np.sqrt(1.5 * (deviator**2 @ [1, 1, 1, 2, 2, 2])),
            energy,
            more,
        ]
        return np.column_stack(parts)


class Relaxing:
    """Branch stresses and energies at P points in `cells` (P,); `weight` (P, Q) of the quadrature points."""

    def __init__(self, branches: Any, cells: Ints, weight: Floats) -> None:
        self.branches, self.index = branches.among(cells)
        own = self.branches.integral.points.cells
        self.rows = np.flatnonzero(np.isin(cells, own))
        self.column, self.share = np.searchsorted(own, cells[self.rows]), weight[self.rows]

    def at(self, u: Floats, inner: Floats, F: Floats) -> tuple[Floats, Floats]:
        """Cauchy stress (P, 6) in MPa and energy (P,) in N/mm2 at displacements u (N, d) and F (P, 3, 3)."""
        stress, energy = np.zeros((len(F), 6)), np.zeros(len(F))
        if not self.rows.size:
            return stress, energy
        S, q, stored = self.branches.overstress(u, inner[:, :, self.index])
        S, q, stored = (np.sum(x[..., self.column, :] * self.share, axis=-1) for x in (S, q, stored))
        F = F[self.rows]
        tau = F @ np.moveaxis(S, 2, 0) @ np.swapaxes(F, 1, 2)
        tau += (q - np.trace(tau, axis1=1, axis2=2) / 3.0)[:, None, None] * np.eye(3)
        sigma = tau / np.linalg.det(F)[:, None, None]
        stress[self.rows] = sigma[:, [0, 1, 2, 0, 1, 0], [0, 1, 2, 1, 2, 2]]
        energy[self.rows] = np.maximum(stored, 0.0)
        return stress, energy


class Cells:
    """Finds points in the cells of a space."""

    def __init__(self, space: Any) -> None:
        self.mesh, self.nodes = space.mesh, space.mesh.points[space.nodes]
        low, high = self.nodes.min(axis=1), self.nodes.max(axis=1)
        margin = 0.2 * (high - low)  # curved sides bulge
        self.low, self.high = low - margin, high + margin
        self.shape = partial(shape_functions, space.mesh.kind)

    def at(self, name: str, point: Floats, layer: str | None) -> tuple[int, Floats]:
        """The cell of a point, and its reference coordinates (d,)."""
        near = np.flatnonzero(((self.low <= point) & (point <= self.high)).all(axis=1))
        middle = np.full(point.shape, 1.0 / 3.0 if self.mesh.corners == 3 else 0.5)
        xi = inverted(self.shape, self.nodes[near], point, middle)
        beyond = np.maximum(-xi, xi - 1.0).max(axis=1, initial=0.0)
        if self.mesh.corners == 3:
            beyond = np.maximum(beyond, xi.sum(axis=1) - 1.0)
        holding = np.flatnonzero(beyond <= ON)
        if not holding.size:
            location = ", ".join(f"{x:.6g}" for x in point)
            raise InputError(f"output.probes.{name}", f"({location}), outside the tissue", _INSIDE)
        region = self.mesh.region[near[holding]]
        wanted = region != self.mesh.region_names.get(layer, -1) if layer else np.zeros(holding.size)
        best = holding[np.lexsort((region, wanted))[0]]
        return int(near[best]), xi[best]


def points_of(key: str, one: Any, mesh: Mesh) -> tuple[Floats, str | None]:
    """The points (P, d) of a probe, and the layer that they belong to where it says so."""
    if not isinstance(one, Probe):
        points = np.array(one)
        if points.shape[1] != mesh.dim:
            raise InputError(
                key, f"points with {points.shape[1]} coordinates", f"{mesh.dim} coordinates, in mm"
            )
        return points, None
    if (one.z is None) != (mesh.dim == 2):
        allowed = "no z in the plane" if mesh.dim == 2 else "x and z of a finger in three dimensions"
        raise InputError(f"{key}.z", ABSENT if one.z is None else "z of a plane finger", allowed)
    if one.at is not None and one.at not in mesh.region_names:
        raise InputError(f"{key}.at", describe_value(one.at), " | ".join(mesh.region_names))
    level = np.column_stack([one.x] if one.z is None else [one.x, one.z])
    heights = crossings(mesh, one.at, level)
    for location, found in zip(level, heights, strict=True):
        if len(found) < 2:
            told = ", ".join(f"{x:.6g}" for x in location)
            what = "no tissue" if one.at is None else f"no {one.at}"
            raise InputError(key, f"{'x' if one.z is None else 'x, z'} = {told}, with {what}", _INSIDE)
    y = np.array([found[0] + one.depth if one.at is None else found[1] for found in heights])
    return np.insert(level, 1, y, axis=1), one.at
