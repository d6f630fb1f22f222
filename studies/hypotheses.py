"""Why is Strong-Troxel's law above the measured forces? Three hypotheses, and what size each needs.

The law of rigid layers gives 1.4 to 1.9 times the forces of Table 1 on hovering fingers, taken as the paper
takes them: untilted, with a shortened axis. For each of the eleven participants and each of the three cases
this study asks how large one single cause would have to be to bring the law down to the measurement, by (8a)
with (24) over the rectangle, and (`tilted`) for fingers held at 30 degrees as they were:

- **lift**: the finger is not at ground but at a potential, so that the voltage across the layers is
  smaller by it;
- **charge**: charge of the electrode's sign, opposite to the finger's, has crept onto the insulator's
  face and shields the field, V = U - s_i r / eps_0;
- **distance**: the finger is farther away than was set, by roughness or otherwise.

The answer is a size and its spread, and what speaks for or against it. One cause of one size should
hold in all three cases. Nothing is claimed: other causes (losses, fringe fields, the estimate of
the pads' sizes) were not asked. Expected: the posture takes most of the difference away, and what is
left has one sign at 0.25 mm and the other at 0.5 mm, so that none of the three explains it.
"""

from collections.abc import Callable

import numpy as np
from scipy.optimize import brentq

from evfem import data
from evfem.common.arrays import Floats
from evfem.electrostatics.forces import EllipsoidalPad, outline_force, pad_force
from evfem.electrostatics.laws import StrongTroxel, eps_0

from .common import CASES, Study, by_participant, participants, table2_layers
from .hovering_people import POSTURE, participant_forces, participant_pads, tilted_forces
from .plots import COLOURS, Figure, draw_box, note, panels

#: force in mN on a participant, by number from 0, gap in mm and voltage in V
Force = Callable[[int, float, float], float]
#: field (V/mm) at which air breaks down over millimetres, and with it the charge on a face in the open
BREAKDOWN = 3000.0
#: roughness of a fingertip between its ridges, an assumed upper end (mm)
ROUGHNESS = 0.03
LARGEST_DISTANCE = 5.0
UNITS = {"lift": "V", "charge": "uC/m2", "distance": "mm"}
ASSUMPTIONS = {
    "forces": "(8a) with (24) over the rectangle, layers of Table 2, as in Fig. 5; tilted: columns below the "
    "whole ellipsoid, turned by 30 degrees",
    "one cause": "each hypothesis alone brings the law to each participant's measured force",
    "lift": "plausible where the finger is not held at ground, as skin, body and chair are in series; a "
    "constant share of the voltage would be seen in all cases, and would have to be measured",
    "charge": "its field adds to that of the electrode; above the breakdown charge of a face in open air, "
    "eps_0 times 3 kV/mm, no charge stays on the face for long",
    "distance": "as an additional gap; the height of ridges is 0.15 mm, roughness between ridges is tens of "
    "micrometres at most",
    "claims": "none: sizes are given, and which of them could be",
}  # fmt: skip


def main(quick: bool = False) -> Study:
    """Required sizes by case and participant, their medians and spreads, and a figure."""
    untilted = _needed(participant_forces(), _untilted)
    tilted = _needed(tilted_forces(), _tilted)
    numbers = _numbers(untilted) | {f"tilted.{key}": value for key, value in _numbers(tilted).items()}
    series = [
        by_participant(f"{how}{what} {case}", values[i], UNITS[what])
        for how, needed in (("", untilted), ("tilted ", tilted))
        for what, values in needed.items()
        for i, case in enumerate(CASES)
    ]
    return Study("hypotheses", numbers, {}, ASSUMPTIONS, series, lambda: _draw(untilted, tilted))


def _needed(computed: dict[tuple[str, str], Floats], force: Force) -> dict[str, Floats]:
    """What each hypothesis needs: rows the cases, columns the eleven participants."""
    film = data.load("table2")
    reduced = film.value("d_i") / film.value("eps_i")
    found: dict[str, list[Floats]] = {name: [] for name in UNITS}
    for case, (voltage, gap) in CASES.items():
        measured = participants()[case]
        lift = voltage * (1.0 - np.sqrt(measured / computed["strong_troxel", case]))
        found["lift"].append(lift)
        found["charge"].append(1e9 * eps_0 * lift / reduced)
        found["distance"].append(_farther(force, voltage, gap, measured))
    return {name: np.array(values) for name, values in found.items()}


def _untilted(number: int, gap: float, voltage: float) -> float:
    pads = participant_pads()
    one = EllipsoidalPad(*(getattr(pads, key)[number] for key in ("width", "height", "length")))
    return float(1e3 * pad_force(StrongTroxel(), one, gap, voltage, table2_layers()))


def _tilted(number: int, gap: float, voltage: float) -> float:
    axes = (participants()[name][number] for name in "abc")
    return float(1e3 * outline_force(StrongTroxel(), *axes, gap, voltage, table2_layers(), tilt=POSTURE))


def _farther(force: Force, voltage: float, gap: float, measured: Floats) -> Floats:
    """Additional gap (mm) at which the law gives the measured forces (mN); negative: nearer."""

    def more(distance: float, number: int) -> float:
        return force(number, gap + distance, voltage) - float(measured[number])

    ends = (-0.9 * gap, LARGEST_DISTANCE)
    return np.array([brentq(more, *ends, args=(number,), xtol=1e-9) for number in range(len(measured))])


def _numbers(needed: dict[str, Floats]) -> dict[str, float]:
    """Medians and quartiles by case, how far one size holds in all cases, and sizes to compare with."""
    numbers = {}
    for what, values in needed.items():
        for i, case in enumerate(CASES):
            low, middle, high = np.quantile(values[i], (0.25, 0.5, 0.75))
            for name, value in (("median", middle), ("lower_quartile", low), ("upper_quartile", high)):
                numbers[f"{what}.{name}_{UNITS[what].replace('/', '_per_')}.{case}"] = value
        medians = np.median(values, axis=1)
        if medians.min() > 0.0:  # else the cases want opposite things
            numbers[f"{what}.largest_over_smallest_median"] = medians.max() / medians.min()
    shares = [np.median(needed["lift"][i]) / voltage for i, (voltage, _) in enumerate(CASES.values())]
    numbers |= {f"lift.share_of_voltage.{case}": s for case, s in zip(CASES, shares, strict=True)}
    if min(shares) > 0.0:
        numbers["lift.largest_over_smallest_share"] = max(shares) / min(shares)
    breakdown = 1e6 * eps_0 * 1e3 * BREAKDOWN
    numbers["charge.of_breakdown_uC_per_m2"] = breakdown
    numbers["charge.median_over_breakdown"] = np.median(needed["charge"]) / breakdown
    numbers["distance.median_over_roughness"] = np.median(needed["distance"]) / ROUGHNESS
    return numbers


def _draw(untilted: dict[str, Floats], tilted: dict[str, Floats]) -> Figure:
    figure, axes = panels(3.2, 3)
    limits = {
        "charge": (1e6 * eps_0 * 1e3 * BREAKDOWN, "breakdown of air"),
        "distance": (ROUGHNESS, "roughness"),
    }
    look = {"color": COLOURS["measured"]}
    for ax, what in zip(axes, UNITS, strict=True):
        ax.axhline(0.0, color=COLOURS["neutral"], linewidth=0.6)
        for place in range(len(CASES)):
            draw_box(ax, place - 0.2, untilted[what][place], 0.3, COLOURS["strong_troxel"])
            draw_box(ax, place + 0.2, tilted[what][place], 0.3, COLOURS["strong_troxel"], hatch="////")
        if what in limits:
            limit, said = limits[what]
            ax.axhline(limit, linestyle="--", **look)
            note(ax, said, (2.4, limit), (0, 3), ha="right", fontsize="x-small", **look)
        ax.set_xticks(range(len(CASES)), list(CASES))
        ax.set(ylabel=f"{what} needed ({UNITS[what]})", xlim=(-0.6, 2.6))
    top = axes[0].get_ylim()[1]
    axes[0].set_ylim(top=1.12 * top)
    note(axes[0], "hatched: held at 30°", (-0.5, top), (0, -2))
    return figure
