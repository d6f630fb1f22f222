"""Shared by the studies of hovering fingers: each participant's computed force beside the measured one.

The fingers were held at 30 degrees (section 2.2). The paper takes an untilted ellipsoid with a shortened
axis, c cos 30 degrees, over a rectangle; `participant_forces` does so. `tilted_forces` counts the columns
below the whole ellipsoid, turned: its lowest point lies nearer to the tip, where it is rounder, and the force
is smaller.
"""

from functools import cache
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.electrostatics.forces import EllipsoidalPad, outline_force, pad_force

from .common import CASES, LAWS, participants, table2_layers

POSTURE = 30.0  # degrees of the finger against the plate, section 2.2
INCLINATION = np.radians(POSTURE)


def participant_pads() -> EllipsoidalPad:
    """The eleven ellipsoids: full axes a_i, b_i and, projected, c_i cos 30 degrees, in mm."""
    table = participants()
    return EllipsoidalPad(table["a"], table["b"], table["c"] * np.cos(INCLINATION))


def participant_forces() -> dict[tuple[str, str], Floats]:
    """(law, case) -> eleven forces in mN by (8a) or (8b) with (24), Table 2's layers."""
    pads, layers = participant_pads(), table2_layers()
    return {
        (law, case): 1e3 * pad_force(force_law, pads, gap, voltage, layers)
        for law, force_law in LAWS.items()
        for case, (voltage, gap) in CASES.items()
    }


@cache
def tilted_forces(outline: float = 2.0) -> dict[tuple[str, str], Floats]:
    """(law, case) -> eleven forces in mN by columns below bodies of exponent `outline`, held at 30 degrees,
    full axes a_i, b_i, c_i.
    """
    table, layers = participants(), table2_layers()
    axes = tuple(table[name][:, None] for name in "abc")
    voltage, gap = np.transpose([*CASES.values()])
    found = {}
    for law, force_law in LAWS.items():
        forces = outline_force(force_law, *axes, gap, voltage, layers, outline, POSTURE)
        found |= {(law, case): 1e3 * forces[:, i] for i, case in enumerate(CASES)}
    return found


def falls() -> dict[str, float]:
    """Measured force over that of HVLD: mean over the participants, its standard error, and how many are
    below .5, which a law that grows with the square of the voltage has at 1414 V.
    """
    found: dict[str, float] = {}
    for case in ("LVLD", "HVHD"):
        ratio = participants()[case] / participants()["HVLD"]
        key = f"measured.{case}_over_HVLD"
        error = np.std(ratio, ddof=1) / np.sqrt(len(ratio))
        found |= {f"{key}.mean": np.mean(ratio), f"{key}.standard_error": error}
        found[f"{key}.below_half"] = int(np.sum(ratio < 0.5))
    return found


def comparison(forces: dict[tuple[str, str], Floats], how: str = "") -> dict[str, float]:
    """By law and case: ratio of medians, median ratio, rank correlation with its p value, Pearson's, spread;
    `how` comes before the law's name ("tilted.").
    """
    from scipy.stats import spearmanr

    found: dict[str, Any] = {}
    for (law, case), computed in forces.items():
        measured = participants()[case]
        rank = spearmanr(computed, measured)
        spread, own = (np.std(one, ddof=1) / np.mean(one) for one in (computed, measured))
        one = {
            "median_over_measured": np.median(computed) / np.median(measured),
            "participant_ratio_median": np.median(computed / measured),
            "rank_correlation": rank.statistic,
            "rank_correlation_p": rank.pvalue,
            "pearson": np.corrcoef(computed, measured)[0, 1],
            "spread_over_measured": spread / own,
        }
        found |= {f"verdict.{how}{law}.{name}.{case}": value for name, value in one.items()}
    return found
