"""Why is Strong-Troxel's law above the measured forces? Three hypotheses, and what size each needs.

The law of rigid layers gives 1.4 to 1.9 times the forces of Table 1 on hovering fingers. For each
of the eleven participants and each of the three cases this study asks how large one single cause
would have to be to bring the law down to the measurement, by (8a) with (24) over the rectangle:

- **lift**: the finger is not at ground but at a potential, so that the voltage across the layers is
  smaller by it;
- **charge**: charge of the electrode's sign, opposite to the finger's, has crept onto the insulator's
  face and shields the field, V = U - s_i r / eps_0;
- **distance**: the finger is farther away than was set, by roughness or otherwise.

The answer is a size and its spread, and what speaks for or against it. One cause of one size should
hold in all three cases. Nothing is claimed: other causes (losses, fringe fields, the estimate of
the pads' sizes) were not asked.
"""

import numpy as np

from evfem import data
from evfem.common.arrays import Floats
from evfem.electrostatics.forces import pad_force
from evfem.electrostatics.laws import StrongTroxel, eps_0

from .common import CASES, Study, by_participant, participants, table2_layers
from .hovering_people import participant_forces, participant_pads
from .plots import COLOURS, Figure, draw_box, note, panels

#: field (V/mm) at which air breaks down over millimetres, and with it the charge on a face in the open
BREAKDOWN = 3000.0
#: roughness of a fingertip between its ridges, an assumed upper end (mm)
ROUGHNESS = 0.03
LARGEST_DISTANCE, HALVINGS = 5.0, 60
UNITS = {"lift": "V", "charge": "uC/m2", "distance": "mm"}
ASSUMPTIONS = {
    "forces": "(8a) with (24) over the rectangle, layers of Table 2, as in Fig. 5",
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
    needed = {name: np.array(values) for name, values in _needed().items()}
    numbers = _numbers(needed)
    series = [
        by_participant(f"{what} {case}", values[i], UNITS[what])
        for what, values in needed.items()
        for i, case in enumerate(CASES)
    ]
    return Study("hypotheses", numbers, {}, ASSUMPTIONS, series, lambda: _draw(needed))


def _needed() -> dict[str, list[Floats]]:
    """What each hypothesis needs, by case, for the eleven participants."""
    film = data.load("table2")
    reduced = film.value("d_i") / film.value("eps_i")
    computed = participant_forces()
    found: dict[str, list[Floats]] = {name: [] for name in UNITS}
    for case, (voltage, gap) in CASES.items():
        measured = participants()[case]
        lift = voltage * (1.0 - np.sqrt(measured / computed["strong_troxel", case]))
        found["lift"].append(lift)
        found["charge"].append(1e9 * eps_0 * lift / reduced)
        found["distance"].append(_farther(voltage, gap, measured))
    return found


def _farther(voltage: float, gap: float, measured: Floats) -> Floats:
    """Additional gap (mm) at which the law gives the measured forces (mN); negative: nearer."""
    pads, layers = participant_pads(), table2_layers()
    low, high = np.full(measured.shape, -0.9 * gap), np.full(measured.shape, LARGEST_DISTANCE)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        stronger = 1e3 * pad_force(StrongTroxel(), pads, gap + middle, voltage, layers) > measured
        low, high = np.where(stronger, middle, low), np.where(stronger, high, middle)
    return 0.5 * (low + high)


def _numbers(needed: dict[str, Floats]) -> dict[str, float]:
    """Medians and quartiles by case, how far one size holds in all cases, and sizes to compare with."""
    numbers = {}
    for what, values in needed.items():
        for i, case in enumerate(CASES):
            low, middle, high = np.quantile(values[i], (0.25, 0.5, 0.75))
            for name, value in (("median", middle), ("lower_quartile", low), ("upper_quartile", high)):
                numbers[f"{what}.{name}_{UNITS[what].replace('/', '_per_')}.{case}"] = value
        medians = np.median(values, axis=1)
        numbers[f"{what}.largest_over_smallest_median"] = medians.max() / medians.min()
    shares = [np.median(needed["lift"][i]) / voltage for i, (voltage, _) in enumerate(CASES.values())]
    numbers |= {f"lift.share_of_voltage.{case}": s for case, s in zip(CASES, shares, strict=True)}
    numbers["lift.largest_over_smallest_share"] = max(shares) / min(shares)
    breakdown = 1e6 * eps_0 * 1e3 * BREAKDOWN
    numbers["charge.of_breakdown_uC_per_m2"] = breakdown
    numbers["charge.median_over_breakdown"] = np.median(needed["charge"]) / breakdown
    numbers["distance.median_over_roughness"] = np.median(needed["distance"]) / ROUGHNESS
    return numbers


def _draw(needed: dict[str, Floats]) -> Figure:
    figure, axes = panels(3.2, 3)
    limits = {
        "charge": (1e6 * eps_0 * 1e3 * BREAKDOWN, "breakdown of air"),
        "distance": (ROUGHNESS, "roughness"),
    }
    look = {"color": COLOURS["measured"]}
    for ax, (what, values) in zip(axes, needed.items(), strict=True):
        ax.axhline(0.0, color=COLOURS["neutral"], linewidth=0.6)
        for place, each in enumerate(values):
            draw_box(ax, place, each, 0.6, COLOURS["strong_troxel"])
        if what in limits:
            limit, said = limits[what]
            ax.axhline(limit, linestyle="--", **look)
            note(ax, said, (2.4, limit), (0, 3), ha="right", fontsize="x-small", **look)
        ax.set_xticks(range(len(CASES)), list(CASES))
        ax.set(ylabel=f"{what} needed ({UNITS[what]})", xlim=(-0.6, 2.6))
    return figure
