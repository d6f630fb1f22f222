r"""Errors of outputs of a run, as shares, by their sources: from runs that differ in one of them.

**Mesh.** With node spacings :math:`h_1 > h_2 > h_3` of up to three meshes and an error :math:`C h^p`, the
order p follows from the ratio of both differences of an output q (Richardson), within 0.5 and 2; with two
meshes it is the lowest. Each pair then says of the scene's own mesh

.. math:: |q - q_\infty| = |q_i - q_{i+1}|\,\frac{h^p}{h_i^p - h_{i+1}^p} ,

and the larger one is stated, for two meshes may agree by chance. h is the number of the pad's
nodes to the power of -1 over the dimension of the pad. Of three meshes it is stated 1.25 times, the factor of
safety of Celik et al., J. Fluids Eng. 130 (2008) 078001 (doi:10.1115/1.2960953).

**Steps.** Twice as many halve an error of first order: it is twice the difference where the path, or a mean,
minimum or maximum over the rows, matters, and the difference elsewhere. **Tolerance**: the difference from
a run to a hundredth of it. **Path**: the largest difference among other solvers and ways to the same end.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.tables import aligned
from evfem.errors import InputError
from evfem.mesh.mesh import Mesh
from evfem.planning.resolution import path_dependence
from evfem.scene.scene import Scene
from evfem.simulation.result import Result
from evfem.sweeps.file import check_output
from evfem.sweeps.run import output

#: what is compared at the end of a run: forces, and the extent of the contact in the plane and in space
FORCES = ("applied_force", "normal_force", "tangential_force", "electrostatic_force")
EXTENT = {2: "contact_width", 3: "contact_area"}
#: sources of error: variants of a run are of one of them
MESH, STEPS, TOLERANCE, PATH = SOURCES = ("mesh", "steps", "tolerance", "path")
#: resolutions of one family from coarse to fine, and that to which another one is next
LEVELS, NEXT_TO = ("coarse", "medium", "fine"), {"paper": "medium"}
#: orders of convergence that are believed
ORDERS = np.linspace(0.5, 2.0, 151)
#: factor of safety of an extrapolation from three meshes
SAFETY = 1.25
#: a force below this share of the largest one has its error relative to that share
LEAST = 1e-3


@dataclass(frozen=True)
class Accuracy:
    """An output of a run, its `value`, and its errors by source, as shares of it (of a force at least of 1e-3
    of the largest force); `mesh` is NaN where the finger has one mesh alone, any where a run had no end.
    """

    output: str
    value: float
    mesh: float
    steps: float
    tolerance: float
    path: float

    @property
    def known(self) -> bool:
        """Whether every source is known."""
        return bool(np.isfinite([getattr(self, source) for source in SOURCES]).all())

    @property
    def sum(self) -> float:
        """All that is known."""
        return float(np.nansum([getattr(self, source) for source in SOURCES]))


def asked(outputs: Sequence[str] | str | None, scene: Scene, dim: int) -> tuple[str, ...]:
    """Names of outputs; without any the forces and the extent of the contact.

    Raises InputError for others than a sweep takes, and columns.
    """
    given = [outputs] if isinstance(outputs, str) else outputs
    names = (*FORCES, EXTENT[dim]) if given is None else tuple(given)
    if not names:
        raise InputError(
            "outputs", "no names", "columns, or COLUMN.STATISTIC[.MOTION]; without the key the forces"
        )
    for name in names:
        check_output(in_full(name), len(scene.motion))
    return names


def in_full(name: str) -> str:
    """COLUMN.STATISTIC of an output; a column alone is asked for at the end.

    >>> in_full("normal_force"), in_full("normal_force.max.0")
    ('normal_force.last', 'normal_force.max.0')
    """
    return f"{name}.last" if isinstance(name, str) and "." not in name else name


def accuracies(
    names: Iterable[str], own: Result, others: Mapping[str, Sequence[Result | None]], scene: Scene
) -> list[Accuracy]:
    """The accuracy of each output of `own`, from the results of variants by their source; None has no end."""
    return [_accuracy(name, own, others, scene) for name in names]


def _accuracy(
    name: str, own: Result, others: Mapping[str, Sequence[Result | None]], scene: Scene
) -> Accuracy:
    value, scale = _value(own, name), _scale(own, name)
    off = {
        source: float(np.max([abs(_value(one, name) - value) for one in others.get(source, ())] or [np.nan]))
        for source in (STEPS, TOLERANCE, PATH)
    }
    off[STEPS] *= 2.0 if path_dependence(scene) or in_full(name).split(".")[1] != "last" else 1.0
    meshes = sorted((own, *filter(None, others.get(MESH, ()))), key=lambda one: -spacing(one.mesh))
    values = np.array([_value(one, name) for one in meshes])
    off[MESH] = mesh_error(np.array([spacing(one.mesh) for one in meshes]), values, meshes.index(own))
    return Accuracy(name, value, **{source: error / scale for source, error in off.items()})


def mesh_error(spacings: Floats, values: Floats, own: int) -> float:
    """The error of the value on mesh number `own`, of up to three meshes from coarse to fine; NaN of one.

    >>> h = 0.5 ** np.arange(3.0)
    >>> [round(mesh_error(h, 1.0 + 0.1 * h**p, 1), 6) for p in (0.5, 1.0, 2.0)]
    [0.088388, 0.0625, 0.03125]
    >>> round(mesh_error(h[:2], 1.0 + 0.1 * h[:2] ** 0.5, 0), 6)
    0.1
    """
    if len(values) < 2:
        return float("nan")
    differences = np.abs(np.diff(values))
    order, factor = ORDERS[0], 1.0
    if len(values) > 2:
        order, factor = observed_order(spacings, differences), SAFETY
    return factor * float((differences * spacings[own] ** order / -np.diff(spacings**order)).max())


def observed_order(spacings: Floats, differences: Floats) -> float:
    """The order, 0.5 to 2, whose differences between three meshes are to each other as these (2,)."""
    powers = spacings[:, None] ** ORDERS
    first, second = powers[0] - powers[1], powers[1] - powers[2]
    off = np.abs(differences[0] * second - differences[1] * first) / np.hypot(first, second)
    return float(ORDERS[np.argmin(off)])


def spacing(mesh: Mesh) -> float:
    """A relative measure of the distance of the pad's nodes."""
    return float(len(mesh.node_sets["pad"])) ** (-1.0 / (mesh.dim - 1))


def _value(result: Result | None, name: str) -> float:
    found = None if result is None else output(result, in_full(name))
    return np.nan if found is None else found


def _scale(own: Result, name: str) -> float:
    """What errors of an output are relative to."""
    size = abs(_value(own, name))
    if name.split(".")[0].removesuffix("_x").removesuffix("_z").endswith("_force"):
        size = max(size, least_force(own))
    return size or 1.0


def least_force(own: Result) -> float:
    """The force that errors of smaller ones are relative to: 1e-3 of the largest one of the whole run."""
    return LEAST * max(float(np.abs(getattr(own, name)).max()) for name in FORCES)


def accuracy_rows(found: Sequence[Accuracy]) -> list[list[str]]:
    """Heads, and a row per output: its value, errors by source, and their sum."""
    lines = [["output", "value", *SOURCES, "sum"]]
    for one in found:
        errors = [getattr(one, source) for source in SOURCES]
        shown = [f"{100.0 * error:.2g} %" if np.isfinite(error) else "not known" for error in errors]
        total = f"{'' if one.known else '> '}{100.0 * one.sum:.2g} %"
        lines.append([one.output, f"{one.value:.6g}", *shown, total])
    return lines


def accuracy_table(found: Sequence[Accuracy]) -> str:
    """The same as text."""
    return aligned(accuracy_rows(found))
