"""Shared by Figs 9 and 10: attraction of a hovering finger over voltage and distance."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from .common import CASES, LAWS, Series, participants
from .plots import COLOURS, LABELS, Figure, law_line, measured_boxes, panels

#: force in N of (law, parameter, gap in mm, voltage in V), vectorised over gap and voltage
Force = Callable[[str, float, Any, Any], Any]
VOLTAGE_AT = {"LVLD": 1414.0, "HVLD": 2000.0}  # boxes of panel a, at 0.25 mm
GAP_AT = {"HVLD": 0.25, "HVHD": 0.50}  # boxes of panel b, at 2000 V


def case_numbers(force: Force, parameters: Mapping[str, float]) -> dict[str, float]:
    """`LAW.mN.PARAMETER.CASE` for both laws, all parameters (key -> value) and the three cases."""
    return {
        f"{law}.mN.{key}.{case}": 1e3 * force(law, value, gap, voltage)
        for law in LAWS
        for key, value in parameters.items()
        for case, (voltage, gap) in CASES.items()
    }


def verdict(numbers: Mapping[str, float], key: str) -> dict[str, float]:
    """Computed over measured median by case, and the trends of laws and measurement, at `key`."""
    median = {case: float(np.median(participants()[case])) for case in CASES}
    found = {
        "verdict.measured.HVLD_over_LVLD": median["HVLD"] / median["LVLD"],
        "verdict.measured.HVLD_over_HVHD": median["HVLD"] / median["HVHD"],
    }
    for law in LAWS:
        force = {case: numbers[f"{law}.mN.{key}.{case}"] for case in CASES}
        found |= {f"verdict.{law}.over_median.{case}": force[case] / median[case] for case in CASES}
        found |= {f"verdict.{law}.HVLD_over_LVLD": force["HVLD"] / force["LVLD"]}
        found |= {f"verdict.{law}.HVLD_over_HVHD": force["HVLD"] / force["HVHD"]}
    return found


def curves(force: Force, parameters: Mapping[str, float], quick: bool) -> list[Series]:
    """mN over the voltage at 0.25 mm and over the distance at 2000 V, by law and parameter."""
    voltage = np.linspace(1000.0, 2500.0, 16 if quick else 61)
    gap = np.linspace(0.0, 0.75, 16 if quick else 151)
    found = []
    for law in LAWS:
        for key, value in parameters.items():
            over_voltage, over_gap = force(law, value, 0.25, voltage), force(law, value, gap, 2000.0)
            found.append(Series(f"{law} {key} over voltage", voltage, 1e3 * over_voltage, "mN over V"))
            found.append(Series(f"{law} {key} over distance", gap, 1e3 * over_gap, "mN over mm"))
    return found


def draw(
    series: list[Series], parameters: Mapping[str, float], names: Mapping[str, str], top: float
) -> Figure:
    """Panel a over voltage, b over distance; curves of later parameters are thicker."""
    from matplotlib.lines import Line2D

    figure, axes = panels(3.9, 2, sharey=True)
    named = {one.name: one for one in series}
    widths = dict(zip(parameters, np.linspace(0.7, 2.6, len(parameters)), strict=True))
    for ax, over in zip(axes, ("voltage", "distance"), strict=True):
        for law in LAWS:
            for key, width in widths.items():
                one = named[f"{law} {key} over {over}"]
                law_line(ax, law, one.x, one.y, linewidth=width)
    measured_boxes(axes[0], VOLTAGE_AT, 90.0)
    measured_boxes(axes[1], GAP_AT, 0.045)
    axes[0].set(xlabel="effective voltage (V), gap 0.25 mm", ylabel="$F_e$ (mN)", ylim=(0.0, top))
    axes[1].set(xlabel="gap (mm), voltage 2000 V")
    handles = [Line2D([], [], color=COLOURS[law], label=LABELS[law]) for law in LAWS]
    handles.append(Line2D([], [], color=COLOURS["measured"], marker="s", linestyle="", label="measured"))
    handles += [Line2D([], [], color="k", linewidth=widths[key], label=names[key]) for key in parameters]
    figure.legend(handles=handles, loc="outside lower center", ncols=4, fontsize="small", frameon=False)
    return figure
