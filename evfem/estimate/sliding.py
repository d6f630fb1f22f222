r"""Sliding over a texture without the tissue: contact of a pad that yields linearly.

The nodes of a `PressedPad` stand at ``x_j = X + x_j0 + q_xj``, ``y_j = Y + y_j0 + q_yj`` for a bone
at (X, Y). All of its contact slips, so that a pressing force l_j >= 0 comes with friction,

.. math:: f_j = l_j \frac{(-h'_j - \mu,\; 1 - \mu h'_j)}{\sqrt{1 + h_j'^2}},

the slope and the height h those at x_j. Kelvin-Voigt tissue lags: with backward Euler over a step
of dt and the relaxation time tau,

.. math:: q + \frac{\tau}{dt}\,(q - q_0) = \mathrm{base} + C f .

At every step the gaps y_j - h(x_j) >= 0, complementary to l_j, and sum f_yj = load are solved by an
active set, with slopes renewed and heights linearised at the last q until q rests, which
Anderson's acceleration of depth one brings about sooner. The apparent friction is - sum f_xj / load.

Only the shear modulus of the tissue is viscous. A half-plane's compliance is
(lambda + 2 mu) / (2 mu (lambda + mu)), and its relative change with mu is `LAG` times that of 1/mu:
tau is as much smaller than the tissue's own relaxation time. What else the tissue does, as it
deforms far from what it does on a flat surface, stands in the database (`correction`).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.estimate.parametric import VISCOSITY
from evfem.estimate.pressed import PressedPad
from evfem.finger.layers import TABLE_2

#: mm that nodes may still move when a step is solved, and beyond which it is given up; iterations
AT_REST, LOST, MOST_ITERATIONS = 1e-5, 5.0, 40
#: Poisson's ratio of the outermost tissue, and what of its viscosity delays a contact
NU = TABLE_2["stratum_corneum"].nu
LAG = 1.0 - NU * (1.0 - 2.0 * NU) / (1.0 - NU)
#: steps before the first position that is asked for, in which the pad settles
RUN_IN = 12


def slid(pad: PressedPad, ground: Any, friction: float, positions: Floats, speed: float) -> Floats:
    """The friction (n,) at even positions (n,) of the bone (mm) and a speed (mm/s), NaN where not found;
    `ground` has `height` (mm) and `slope` at x (mm).
    """
    step = float(positions[1] - positions[0])
    lag = LAG * VISCOSITY * speed / step
    positions = np.concatenate([positions[0] - step * np.arange(RUN_IN, 0, -1), positions])
    n = pad.x.size
    late = 1.0 / (1.0 + lag)
    compliance = late * pad.compliance
    moved = before = pad.base + pad.compliance @ pad.force
    touching = pad.force[:n] > 0.0
    found = np.full(positions.size, np.nan)
    flat, first = moved, touching
    for k, position in enumerate(positions.tolist()):
        start = late * (pad.base + lag * moved)
        moved, before = 2.0 * moved - before, moved
        pushed, rest = moved, np.zeros(2 * n)
        for turn in range(MOST_ITERATIONS):
            x = position + pad.x + moved[n:]
            height, slope = ground.height(x), ground.slope(x)
            size = np.sqrt(1.0 + slope * slope)
            ways = np.concatenate([1.0 - friction * slope, -slope - friction]) / np.tile(size, 2)
            gap = pad.y - height + slope * moved[n:]
            balance = gap + start[:n] - slope * start[n:]
            force, bone = _balance(compliance, balance, slope, ways, touching, pad.load)
            was, given_before, rest_before = touching, pushed, rest
            pushed = start + compliance @ force
            rest = pushed - moved
            open_gap = gap + pushed[:n] - slope * pushed[n:] + bone
            touching = np.where(was, force[:n] > 0.0, open_gap < 0.0)
            same = np.array_equal(touching, was)
            if same and np.abs(rest).max() < AT_REST:
                found[k] = -float(force[n:].sum()) / pad.load
                break
            if not (touching.any() and np.abs(rest).max() < LOST):
                break
            change = rest - rest_before
            relaxation = float(rest @ change) / float(change @ change) if same and turn else 0.0
            moved = pushed - relaxation * (pushed - given_before)
        moved = pushed
        if np.isnan(found[k]):
            moved, before, touching = flat, flat, first
    return found[RUN_IN:]


def _balance(
    compliance: Floats, gap: Floats, slope: Floats, ways: Floats, touching: Any, load: float
) -> tuple[Floats, float]:
    """Forces (2 n,) along `ways` on touching nodes, and the bone's height: gaps close under the load."""
    n = gap.size
    on = np.flatnonzero(touching)
    m = on.size
    system = np.zeros((m + 1, m + 1))
    yields = compliance[:, np.concatenate([on, n + on])]
    yields = yields[:, :m] * ways[on] + yields[:, m:] * ways[n + on]
    system[:m, :m] = yields[on] - slope[on, None] * yields[n + on]
    system[:m, m], system[m, :m] = 1.0, ways[on]
    solved = np.linalg.solve(system, np.append(-gap[on], load))
    force = np.zeros(2 * n)
    force[on], force[n + on] = ways[on] * solved[:m], ways[n + on] * solved[:m]
    return force, float(solved[m])
