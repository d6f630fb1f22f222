"""Section 3.2.1: thickness of the stratum corneum from two perception thresholds.

Strong and Troxel: one finger feels 73 V through 0.5 mil and 110 V through 1.0 mil of an insulator with eps_r
= 4.5 alike. Equal tangential forces give the thickness of the stratum corneum (eps_r = 2000) by
Strong-Troxel's law, equation (21), or by Kaczmarek's, (23). Expected (the paper, and recomputed): 2.74
(2.746) um of d_sc / eps_sc, hence 5.48 (5.49) mm, and 76.2 (76.17) um; about 300 um is generally accepted.
"""

from functools import partial
from typing import Any

import numpy as np

from evfem import data
from evfem.electrostatics.forces import effective_thickness_from_thresholds, stratum_corneum_from_thresholds
from evfem.electrostatics.laws import Layer, Layers

from .common import LAWS, Series, Study
from .plots import COLOURS, LABELS, Figure, law_line, new_figure, note
from .printed import CUT, Printed

ACCEPTED_UM = 300.0  # palmar stratum corneum, section 3.2.1
MIL = 0.0254  # mm
PLACE = "section 3.2.1"
MISPRINT = (
    "(22) is misprinted: with d_i = d_i3, as the text has it, it gives twice the number printed beside it; "
    "with d_i = d_i2 it agrees with (21)"
)
PAPER = {
    "effective_thickness_um": Printed("2.74", "d_sc/eps_sc by (21)", "um", PLACE, CUT),
    "effective_thickness_mil": Printed("0.108", "the same", "mil", PLACE),
    "closed_form_22_with_d_i3_um": Printed("2.74", "d_sc/eps_sc by (22)", "um", PLACE, MISPRINT),
    "thickness_strong_troxel_mm": Printed(
        "5.48",
        "stratum corneum by (21)",
        "mm",
        PLACE,
        "2000 times the 2.74 um whose digits are cut off. The conclusion is not the only one: 2.6 um of air "
        "between rough faces and skin of 0.3 mm explain the same two thresholds",
    ),
    "thickness_kaczmarek_um": Printed("76.2", "stratum corneum by (23)", "um", PLACE),
}
ASSUMPTIONS = {
    "area, friction": "the same in both experiments",
    "closed form (22)": "with d_i = d_i3 it gives 5.49 um; with d_i = d_i2 it agrees with (21), solved here",
}


def main(quick: bool = False) -> Study:
    """Solve (21) and (23); draw how unequal the two forces are for any other thickness."""
    table = data.load("thresholds")
    voltages = table.value("U_2"), table.value("U_3")
    thin, thick = (Layer(table.value(d), table.value("eps_i")) for d in ("d_i2", "d_i3"))
    films = thin, thick
    eps_sc = table.value("eps_sc")
    reduced = effective_thickness_from_thresholds(voltages, films)
    found = {
        "strong_troxel": eps_sc * reduced,
        "kaczmarek": stratum_corneum_from_thresholds(voltages, films, eps_sc),
    }
    numbers = {
        "effective_thickness_um": 1e3 * reduced,
        "effective_thickness_mil": reduced / MIL,
        "thickness_strong_troxel_mm": found["strong_troxel"],
        "thickness_kaczmarek_um": 1e3 * found["kaczmarek"],
        "closed_form_22_with_d_i2_um": 1e3 * films[0].thickness / films[0].eps_r * _printed_factor(*voltages),
        "closed_form_22_with_d_i3_um": 1e3 * films[1].thickness / films[1].eps_r * _printed_factor(*voltages),
        **{f"verdict.{law}.ratio_to_accepted": 1e3 * d / ACCEPTED_UM for law, d in found.items()},
    }
    thickness = np.logspace(-2, 1, 61 if quick else 301)
    ratio = {law: _force_ratio(law, thickness, voltages, films, eps_sc) for law in LAWS}
    series = [Series(f"{law} force ratio", thickness, y, "1 over mm") for law, y in ratio.items()]
    parameters = {"voltages_V": voltages, "insulators_mm": [film.thickness for film in films]}
    parameters |= {"eps_i": table.value("eps_i"), "eps_sc": eps_sc}
    picture = partial(_draw, thickness, ratio, found)
    return Study("section321", numbers, PAPER, ASSUMPTIONS, series, picture, parameters)


def _printed_factor(lower: float, higher: float) -> float:
    return (2.0 * lower - higher) / (higher - lower)


def _force_ratio(law: str, thickness: Any, voltages: Any, films: Any, eps_sc: float) -> Any:
    """Force through the thinner insulator over that through the thicker one, each at its threshold."""
    thin, thick = (
        LAWS[law].traction(0.0, u, Layers.of(Layer(thickness, eps_sc), film))
        for u, film in zip(voltages, films, strict=True)
    )
    return thin / thick


def _draw(thickness: Any, ratio: dict[str, Any], found: dict[str, float]) -> Figure:
    figure = new_figure(3.4, 5.5)
    ax = figure.add_subplot()
    ax.axhline(1.0, color=COLOURS["neutral"], linewidth=0.8)
    accepted = 1e-3 * ACCEPTED_UM
    ax.axvline(accepted, color=COLOURS["neutral"], linewidth=0.8, linestyle="--")
    ax.text(1.1 * accepted, 0.62, "accepted\n(palmar)", fontsize="small", color=COLOURS["neutral"])
    for law, y in ratio.items():
        law_line(ax, law, thickness, y, label=LABELS[law])
        ax.plot(found[law], 1.0, "o", color=COLOURS[law])
        note(ax, f"{found[law]:.3g} mm", (found[law], 1.0), (-6, -14), ha="right")
    label = "thickness of the stratum corneum (mm)"
    ax.set(xscale="log", xlabel=label, ylabel="ratio of the forces at threshold")
    ax.legend(loc="upper right")
    return figure
