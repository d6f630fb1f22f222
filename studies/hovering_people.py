"""Shared by Fig. 5 and `laws`: each participant's computed force beside his or her measured one."""

from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.electrostatics.forces import EllipsoidalPad, pad_force

from .common import CASES, LAWS, participants, table2_layers

INCLINATION = np.radians(30.0)  # of the finger against the plate, section 2.2


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


def comparison(forces: dict[tuple[str, str], Floats]) -> dict[str, float]:
    """By law and case: ratio of medians, median ratio, rank correlation with its p value, spread."""
    from scipy.stats import spearmanr

    found: dict[str, Any] = {}
    for (law, case), computed in forces.items():
        measured = participants()[case]
        rank = spearmanr(computed, measured)
        found[f"verdict.{law}.median_over_measured.{case}"] = np.median(computed) / np.median(measured)
        found[f"verdict.{law}.participant_ratio_median.{case}"] = np.median(computed / measured)
        found[f"verdict.{law}.rank_correlation.{case}"] = rank.statistic
        found[f"verdict.{law}.rank_correlation_p.{case}"] = rank.pvalue
        spread = np.std(computed, ddof=1) / np.mean(computed)
        found[f"verdict.{law}.spread_over_measured.{case}"] = spread / (
            np.std(measured, ddof=1) / np.mean(measured)
        )
    return found
