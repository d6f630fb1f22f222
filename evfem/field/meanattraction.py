r"""The mean pull of an alternating full field on the skin, in layers that conduct.

Under a sine of angular frequency w every layer has the complex permittivity
:math:`\varepsilon^* = \varepsilon' + \sigma / (i\omega\varepsilon_0)`
(`evfem.electrostatics.dielectrics`), and the effective complex potential solves

.. math:: \nabla\cdot(\varepsilon^* \nabla\varphi) = 0, \qquad
          \varphi = U \text{ on the electrode}, \quad \varphi = 0 \text{ in living tissue}.

The mean force is not the derivative of an energy: the loss in a cycle depends on the path. The
force is the stress in the gap's medium around the pad, whose mean over the cycle is (J. R. Melcher,
Continuum Electromechanics, MIT Press 1981, chapters 2 and 3)

.. math:: \bar T = \varepsilon_0 \varepsilon'\,\mathrm{Re}\,
          \big(E \otimes \bar E - \tfrac12 |E|^2 I\big), \qquad E = -\nabla\varphi .

In a homogeneous layer E has neither sources nor curls, so :math:`\nabla\cdot\bar T = 0` although it
conducts, and every surface around the pad gives one force. As a virtual work, without surface
values, it is for a velocity V that is 1 on the pad and 0 on the insulator

.. math:: F = -\int_\text{gap} \bar T : \nabla V .

A node's force is that of its shape function V. In the skin's layer V does not change with the
height, and with the same stress, of the layer's :math:`\varepsilon'`, the forces between skin and
tissue inside the pad are shared out: they cancel in the sum, whatever that stress is. Without
conduction this is the derivative of the energy (`evfem.field.columns`), and below a flat
pad the law of the complex length (`evfem.electrostatics.laws`). Along x the lines lean, as the
insulator stays where it is: with losses it has charges of its own, which are pulled too. Only the
two end lines are taken whole, as without losses: what is beyond them is not known.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from evfem.common.arrays import Floats
from evfem.electrostatics.laws import eps_0
from evfem.field.columncells import Potentials
from evfem.field.columns import Columns


@dataclass(frozen=True, eq=False)
class MeanPull:
    """Mean forces (L, 2) on the pad at the lines, N per mm at 1 V; potential `phi` (L, rows) at `y`."""

    forces: Floats
    phi: Floats
    y: Floats


def mean_pull(
    columns: Columns,
    x: Floats,
    levels: Floats,
    electrodes: Floats | None = None,
    floating: bool = False,
    near: Potentials | None = None,
) -> MeanPull:
    """Solve as `Columns.solve` does, for layers insulator, gap and, if there is one, skin, with
    complex permittivities.

    >>> plate = Columns((3.0, 1.0 - 2.0j), (np.array([0.0, 1.0]), np.array([0.0, 0.5, 1.0])))
    >>> found = mean_pull(plate, np.linspace(0.0, 1.0, 5), np.repeat([[-0.3], [0.0], [0.1]], 5, axis=1))
    >>> z = (1.0 - 2.0j) * 0.3 / 3.0
    >>> bool(np.isclose(found.forces[:, 1].sum(), -eps_0 / 2.0 / abs(0.1 + z) ** 2, rtol=1e-12))
    True
    """
    cells, strips = columns.cells(x, levels, electrodes)
    phi = cells.potential(strips, floating, near)
    found = cells.squares(phi)
    gap, skin = cells.layer == 1, cells.layer > 1
    fraction = np.where(gap, cells.share, np.where(skin, 1.0, 0.0))
    along = cells.by_x(found, fraction, np.where(gap, cells.rise, 0.0))
    along[[0, -1]] = cells.by_x(found, np.ones_like(fraction), np.zeros_like(cells.rise))[[0, -1]]
    up = cells.by_level(found)[2:].sum(axis=0)
    return MeanPull(0.5 * eps_0 * np.stack([along, up], axis=1), phi, cells.heights())
