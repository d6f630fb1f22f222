"""Fig. 5: electrostatic force on a hovering finger, measured, by both closed forms, and by finite elements.

Cases HVHD (2000 V, 0.50 mm), HVLD (2000 V, 0.25 mm), LVLD (1414 V, 0.25 mm). Measured: Table 1, with means
1.81, 2.95, 1.31 mN, medians 1.85, 2.73, 1.37 mN, standard deviations 0.547, 1.07, 0.558 mN. Closed forms:
(8a), (8b) with (24) for each participant's own ellipsoid, full axes a_i, b_i, c_i cos 30 degrees, over the
rectangle. Beside them the columns below the whole ellipsoid, turned by the 30 degrees at which the fingers
were held (`tilted`), also of flatter outlines. Finite elements: Table 2's cross-section, deformable, in plane
strain, times 8 and 10 mm of width out of the plane. Expected: untilted Kaczmarek's law within about 10 % of
the medians, Strong-Troxel's 1.4 to 1.9 times above; tilted .6 to .7 and .9 to 1.25; a smooth rigid outline
gives 0.1976, 0.4036, 0.2017 mN/mm, and letting it deform adds 0.4 to 1.6 %.
"""

from functools import cache, partial
from typing import Any

import numpy as np

import evfem as ev
from evfem import data

from .common import CASES, Series, Study, by_participant, median_interval, paper_display, participants
from .hovering_people import comparison, falls, participant_forces, tilted_forces
from .plots import COLOURS, LABELS, Figure, draw_box, new_figure
from .printed import CUT, Printed

MEASURED = {
    "mean": ("mean", ("1.81", "2.95", "1.31")),
    "median": ("median", ("1.85", "2.73", "1.37")),
    "sd": ("standard deviation", ("0.547", "1.07", "0.558")),
}
PAPER = {
    f"measured.{name}_mN.{case}": Printed(digits, f"measured {what}, {case}", "mN", "section 3.1", CUT)
    for name, (what, values) in MEASURED.items()
    for case, digits in zip(CASES, values, strict=True)
}
WIDTH_WHY = (
    "no single width meets the medians at both gaps: a cross-section is curved in one direction alone, and "
    "its force falls faster with the gap than that of an ellipsoid, which falls faster than the measured "
    "one. The measured force at 1414 V over that at 2000 V is 0.44 in the mean, which no law that goes with "
    "the square of the voltage has"
)
PAPER |= {
    f"verdict.fe.mm_of_width_for_median.{case}": Printed(
        "8 to 10", f"width that gives the median, {case}", "mm", "section 3.2.4", WIDTH_WHY
    )
    for case in CASES
}
OUTLINES = (2.25, 2.5, 3.0)  # exponents of flatter pads
WIDTHS = (8, 10)  # mm out of the plane
MODELS = {"fe": ("finite elements, ridges", True), "fe_smooth": ("finite elements, smooth", False)}
ASSUMPTIONS = {
    "tilted": "full axes a_i, b_i, c_i, turned by 30 deg; every column below the whole ellipsoid",
    "voltages": "HV = 2000 V, LV = 1414 V (Table 1's footnotes print 2500 V for HV)",
    "participants": "full axes a_i, b_i, c_i cos 30 deg; rectangle of the half axes; layers of Table 2",
    "finite elements": "plane strain, N/mm times 8 and 10 mm out of the plane; Kaczmarek's law; bone held",
    "mesh": "medium; the fine one gives up to 0.15 % more with ridges, 0.01 % without",
    "boxes": "quartiles; whiskers: extremes; thick bar: 93.5 % confidence interval of the median (n = 11)",
}


def main(quick: bool = False) -> Study:
    """Statistics of the measurements, forces of both laws and by finite elements, verdict."""
    forces, tilted = participant_forces(), tilted_forces()
    elements = {
        (model, case): hover_force(ridges, gap, voltage, "coarse" if quick else "medium")
        for model, (_, ridges) in MODELS.items()
        for case, (voltage, gap) in CASES.items()
    }
    numbers = _measured_numbers() | falls() | _law_numbers(forces) | _law_numbers(tilted, "tilted.")
    for (model, case), force in elements.items():
        numbers |= {f"{model}.kaczmarek.{case}_mN_at_{width}mm": 1e3 * force * width for width in WIDTHS}
        numbers |= {
            f"verdict.{model}.mm_of_width_for_median.{case}": 1e-3 * np.median(participants()[case]) / force
        }
    numbers |= comparison(forces) | comparison(tilted, "tilted.")
    for outline in OUTLINES:
        for (law, case), values in tilted_forces(outline).items():
            ratio = np.median(values) / np.median(participants()[case])
            numbers[f"verdict.tilted.outline_{outline:g}.{law}.median_over_measured.{case}"] = ratio
    series, picture = _series(forces, tilted, elements), partial(_draw, forces, tilted, elements)
    return Study("fig05", numbers, PAPER, ASSUMPTIONS, series, picture)


@cache
def hover_force(ridges: bool, gap: float, voltage: float, resolution: str = "medium") -> float:
    """Attraction in N/mm of Table 2's deformable finger `gap` mm above the display, Kaczmarek's law."""
    finger = ev.FingerPad(ridges=ridges, resolution=resolution)
    display, motion = paper_display(data.load("table2").value("mu")), (ev.Hover(gap=gap),)
    scene = ev.Scene(finger, display, ev.Kaczmarek(), voltage, motion)
    return float(ev.simulate(scene).electrostatic_force[-1])


def _measured_numbers() -> dict[str, float]:
    found: dict[str, Any] = {}
    for case in CASES:
        values = participants()[case]
        low, high, confidence = median_interval(values)
        found |= {
            f"measured.mean_mN.{case}": np.mean(values),
            f"measured.median_mN.{case}": np.median(values),
            f"measured.sd_mN.{case}": np.std(values, ddof=1),
            f"measured.median_low_mN.{case}": low,
            f"measured.median_high_mN.{case}": high,
            "measured.median_confidence": confidence,
        }
    return found


def _law_numbers(forces: dict[Any, Any], how: str = "") -> dict[str, float]:
    found: dict[str, Any] = {}
    for (law, case), values in forces.items():
        found[f"{how}{law}.median_mN.{case}"] = np.median(values)
        names = participants()["participant"]
        found |= {f"{how}{law}.{name}.{case}_mN": force for name, force in zip(names, values, strict=True)}
    return found


def _series(forces: dict[Any, Any], tilted: dict[Any, Any], elements: dict[Any, float]) -> list[Series]:
    series = [by_participant(f"measured {case}", participants()[case]) for case in CASES]
    series += [by_participant(f"{law} {case}", values) for (law, case), values in forces.items()]
    series += [by_participant(f"tilted {law} {case}", values) for (law, case), values in tilted.items()]
    widths = np.array(WIDTHS, dtype=float)
    for (model, case), force in elements.items():
        y = 1e3 * force * widths
        series.append(Series(f"{model} kaczmarek {case}", widths, y, "mN over mm of width"))
    return series


def _draw(forces: dict[Any, Any], tilted: dict[Any, Any], elements: dict[Any, float]) -> Figure:
    from matplotlib.patches import Patch

    figure = new_figure(4.2)
    ax = figure.add_subplot()
    bars = {"fe": (0.34, COLOURS["fe"]), "fe_smooth": (0.43, "white")}
    for place, case in enumerate(CASES):
        draw_box(ax, place - 0.40, participants()[case], 0.11, COLOURS["measured"])
        for law, at in (("kaczmarek", -0.27), ("strong_troxel", 0.01)):
            draw_box(ax, place + at, forces[law, case], 0.11, COLOURS[law])
            draw_box(ax, place + at + 0.13, tilted[law, case], 0.11, COLOURS[law], hatch="////")
        for model, (at, face) in bars.items():
            low, high = (1e3 * elements[model, case] * width for width in WIDTHS)
            look = {"color": face, "edgecolor": COLOURS["fe"], "linewidth": 1.3}
            ax.bar(place + at, high - low, 0.07, low, **look)
    labels = [f"{case}\n{voltage:g} V, {gap:.2f} mm" for case, (voltage, gap) in CASES.items()]
    ax.set_xticks(range(len(CASES)), labels)
    ax.set(ylabel="electrostatic force (mN)", ylim=(0, None), xlim=(-0.5, 2.5))
    named = {"measured": "measured"}
    named |= {law: f"{LABELS[law]} ({how})" for law, how in (("kaczmarek", "8b"), ("strong_troxel", "8a"))}
    handles = [Patch(facecolor=COLOURS[key], alpha=0.5, label=label) for key, label in named.items()]
    handles.append(Patch(facecolor="white", edgecolor="0.4", hatch="////", label="the same, held at 30°"))
    for model, (_, face) in bars.items():
        label = f"{MODELS[model][0]}, width 8-10 mm"
        handles.append(Patch(facecolor=face, edgecolor=COLOURS["fe"], label=label))
    ax.legend(handles=handles, fontsize="small", loc="upper right", ncols=1)
    return figure
