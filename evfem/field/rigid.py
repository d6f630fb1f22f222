"""The full field of a rigid grounded outline over an electrode: capacitance, force, fields.

The column law takes the field as vertical. Here Poisson's problem is solved in slab and air below
(and, where the outline ends, around) a rigid body; `evfem.field.poisson` has the problem
and the force, `evfem.field.fieldmesh` the mesh, `evfem.field.bounds` the bounds
between which the capacitance must be, `evfem.field.outlines` what an outline is.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.checks import Values, finite, real, to_python
from evfem.electrostatics.laws import Layer
from evfem.errors import EvfemError, InputError, describe_value
from evfem.field.bounds import capacitance_bounds
from evfem.field.curves import curved
from evfem.field.fieldmesh import make_mesh
from evfem.field.outlines import Outline
from evfem.field.poisson import Potential, Space

#: touching places keep this share of the slab's thickness / permittivity as a gap in series
SERIES_GAP = 1e-6
#: m per mm: eps_0 is in F/m, a capacitance here in F per mm of depth
PER_MM = 1e-3
#: share by which a discrete capacitance may miss its bounds where they meet
MARGIN = 1e-4


@dataclass(frozen=True)
class FieldSolution:
    """The field between a grounded body and an electrode, per mm of depth (of one period if periodic).

    `capacitance` in F/mm with its `bounds` for the exact outline; `force` in N/mm, towards the electrode;
    capacitance * voltage^2 / 2 is the energy in J/mm (1000 N). Fields are in V/mm, the electrode's upper face
    is at y = -`thickness` mm, the slab's at y = 0.
    """

    capacitance: float
    force: float
    bounds: tuple[float, float]
    voltage: float
    thickness: float
    solved: Potential = field(repr=False, compare=False)

    def potential(self, x: Values, y: Values) -> Values:
        """Potential in V at positions in slab or air (mm, arrays broadcast); InputError elsewhere.

        >>> plates = rigid_field([0.0, 1.0], [0.1, 0.1], voltage=100.0)
        >>> round(plates.potential(0.3, 0.025), 6)
        75.0
        """
        x, y = _places(x, y)
        return to_python(self.voltage * self.solved.values(x, y))

    def field(self, x: Values, y: Values) -> tuple[Values, Values]:
        """The two components of the field in V/mm at positions in slab or air (mm)."""
        x, y = _places(x, y)
        gradient = -self.voltage * self.solved.gradients(x, y)
        return to_python(gradient[0]), to_python(gradient[1])

    def surface_field(self, x: Values) -> Values:
        """Vertical field in V/mm in the air on the slab's upper face (without slab: on the electrode).

        >>> plates = rigid_field([0.0, 1.0], [0.1, 0.1], voltage=100.0)
        >>> round(plates.surface_field(0.3), 6)
        1000.0
        """
        x, y = _places(x, 0.0)
        return to_python(-self.voltage * self.solved.gradients(x, y)[1])

    def outline_field(self, x: Values) -> Values:
        """Field in V/mm in the air on the outline above `x`, its strength: the body is a conductor."""
        x, y = _places(x, np.inf)
        return to_python(abs(self.voltage) * np.hypot(*self.solved.gradients(x, y)))


def _places(x: Values, y: Values) -> tuple[Floats, Floats]:
    x = np.asarray(finite("x", x, "positions in mm"), dtype=float)
    return np.broadcast_arrays(x, np.asarray(y, dtype=float))  # type: ignore[return-value]


def rigid_field(x: Values, height: Values, *, slab: Layer | None = None, voltage: float = 1.0,
                periodic: bool = True) -> FieldSolution:  # fmt: skip
    """Solve for the field between a grounded outline and an electrode under `slab`.

    `x` and `height` (N,) in mm are points of the outline above the slab's upper face, from left to right.
    Points that turn by less than 15 degrees each, ever the same way, are taken as those of a curve
    (`evfem.field.curves`), the others are joined by straight lines. An `x` given twice is a vertical wall, as
    is a chord steeper than 20 between two corners, which then stands on its foot. With `periodic` the outline
    repeats from its last x on. Without, it ends in the air over an endless slab and electrode: as a thin
    sheet where it is flat, as a bar where it ends in walls, and as the lower half of a symmetric body where
    both ends rise steeply (see `evfem.field.outlines`). The force is the derivative of the discrete energy
    when the body is lifted. Touching places need a slab.

    The capacitance, always found from above, is compared with its bounds; EvfemError if it is
    not between them. InputError for arrays that are no outline.

    >>> deep = rigid_field([0.0, 0.3, 0.3, 0.5], [0.05, 0.05, 2.0, 2.0])
    >>> round(deep.capacitance / 8.8541878188e-15, 4)      # Carter's grooves: 8.20526894
    8.2053
    """
    if slab is not None and not isinstance(slab, Layer):
        raise InputError("slab", describe_value(slab), "None or a Layer(thickness, eps_r)")
    thickness, eps_r = (0.0, 1.0) if slab is None else _scalars(slab)
    voltage = real("voltage", voltage, "a voltage in V")
    outline = Outline.of(x, height, periodic)
    reduced = thickness / eps_r
    lowest = float(outline.height.min())
    if reduced == 0.0 and lowest == 0.0:
        raise InputError("height", 0.0, "heights in mm above zero, or a slab: the conductors would touch")
    above = curved(outline, reduced).lifted(SERIES_GAP * reduced)
    mesh = make_mesh(above, thickness, reduced)
    solved = Potential.of(Space(mesh, eps_r))
    low, high = capacitance_bounds(above, thickness, eps_r)
    capacitance = PER_MM * solved.capacitance
    bounds = (PER_MM * low, PER_MM * high)
    if not bounds[0] * (1.0 - MARGIN) <= capacitance <= bounds[1] * (1.0 + MARGIN):
        raise EvfemError(
            f"field: a capacitance of {capacitance:.6g} F/mm is not between its bounds {bounds[0]:.6g} and "
            f"{bounds[1]:.6g}; try an outline whose points are less unevenly spaced"
        )
    force = -(voltage**2) * solved.force
    return FieldSolution(capacitance, force, bounds, voltage, thickness, solved)


def _scalars(slab: Layer) -> tuple[float, float]:
    if np.ndim(slab.thickness) or np.ndim(slab.eps_r):
        raise InputError("slab", describe_value(slab), "a Layer of one thickness and one permittivity")
    return float(slab.thickness), float(slab.eps_r)
