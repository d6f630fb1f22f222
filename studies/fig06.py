"""Fig. 6: friction with and without voltage, and the contact area that each law needs to explain it.

Meyer et al.: 140 V, mu = 0.3, attraction 0.25 +- 0.01 N. The paper fits A = k F_n^m: k = 125.359 with
Kaczmarek's law (16a), 0.446 with Strong-Troxel's (16b), m = 0.489, for d_sc = 0.1 mm and d_i = 0.001 mm.
Expected: the two k differ by the ratio of contact pressures, about 281; 0.25 N is reached at F_n = 0.69 N.
"""

from functools import partial
from typing import Any

import numpy as np

from evfem import data
from evfem.circuit.encoding import AreaLaw, Encoding, fit_area_to_friction

from .common import LAWS, Series, Study, area_law, table2_layers
from .plots import COLOURS, LABELS, Figure, law_line, not_shown, panels
from .printed import Printed

PAPER = {
    "kaczmarek.area_mm2_at_1N": Printed("125.359", "k of (16a), taken from the paper", "mm2", "caption"),
    "strong_troxel.area_mm2_at_1N": Printed("0.446", "k of (16b), from that of (16a)", "mm2", "caption"),
    "strong_troxel.exponent": Printed("0.489", "m of (16b), from that of (16a)", "", "caption"),
    "gross.area_mm2_at_1N": Printed("107.626", "Adams' gross area, taken from the paper", "mm2", "caption"),
    "ridge.area_mm2_at_1N": Printed("63.000", "Adams' ridge area, taken from the paper", "mm2", "caption"),
}
ASSUMPTIONS = {
    "measured points": "Meyer et al., Adams: only plotted in the paper; neither shown nor fitted again",
    "k and m of (16a)": "the paper's fit; k of (16b) follows from it by the ratio of the contact pressures",
    "layers": "d_sc = 0.1 mm, d_i = 0.001 mm, permittivities of Table 2",
}
ADAMS = {"gross": ("Adams, gross", "--"), "ridge": ("Adams, ridges", ":")}


def main(quick: bool = False) -> Study:
    """Friction by (16a) and (16b), the areas behind it, and Adams' area laws."""
    meyer = data.load("meyer")
    areas = {name: area_law(name) for name in data.load("area_laws")["law"]}
    layers = table2_layers(meyer.value("d_sc_max_force"), meyer.value("d_i"))
    voltage, friction = meyer.value("U"), meyer.value("mu")
    force = np.linspace(0.02, 1.2, 31 if quick else 119)
    display = {law: Encoding(LAWS[law], layers, areas[law], friction) for law in LAWS}
    k_ratio = LAWS["strong_troxel"].traction(0.0, 1.0, layers) / LAWS["kaczmarek"].traction(0.0, 1.0, layers)
    tangential = {law: display[law].tangential_force(force, voltage) for law in LAWS}
    refit = fit_area_to_friction(force, tangential["kaczmarek"], voltage, display["strong_troxel"])
    numbers = {
        "k_ratio": k_ratio,
        "normal_force_at_0.25N_N": _force_for(display["kaczmarek"], meyer.value("F_e"), voltage),
        "kaczmarek.area_mm2_at_1N": areas["kaczmarek"](1.0),
        "strong_troxel.area_mm2_at_1N": refit.k,
        "strong_troxel.exponent": refit.m,
        "gross.area_mm2_at_1N": areas["gross"](1.0),
        "ridge.area_mm2_at_1N": areas["ridge"](1.0),
        "paper_k_ratio": areas["kaczmarek"].k / areas["strong_troxel"].k,
    }
    for law, area in (("kaczmarek", areas["kaczmarek"]), ("strong_troxel", AreaLaw(refit.k, refit.m))):
        for name in ADAMS:
            ratio = area(force[force >= 0.1]) / areas[name](force[force >= 0.1])
            numbers |= {f"verdict.{law}.area_over_{name}": np.exp(np.mean(np.log(ratio)))}
    series = [Series("friction voltage off", force, friction * force, "N over N")]
    series += [Series(f"friction {law}", force, y, "N over N") for law, y in tangential.items()]
    series += [Series(f"area {name}", force, area(force), "mm2 over N") for name, area in areas.items()]
    parameters = {"U_V": voltage, "mu": friction, "d_sc_mm": 0.1, "d_i_mm": 0.001}
    picture = partial(_draw, force, friction, tangential, areas)
    return Study("fig06", numbers, PAPER, ASSUMPTIONS, series, picture, parameters)


def _force_for(display: Encoding, attraction: float, voltage: float) -> float:
    """Normal force in N at which the attraction is reached: (k F^m p = F_e) solved for F."""
    pressure = display.law.traction(0.0, voltage, display.layers)
    return float((attraction / (display.area.k * pressure)) ** (1.0 / display.area.m))


def _draw(force: Any, friction: float, tangential: dict[str, Any], areas: dict[str, AreaLaw]) -> Figure:
    figure, (left, right) = panels(3.4, 2)
    left.plot(force, friction * force, color=COLOURS["fe"], label=f"off: $F_t$ = {friction:g} $F_n$")
    styles = {"strong_troxel": (4.5, "on: (16b) Strong-Troxel"), "kaczmarek": (1.5, "on: (16a) Kaczmarek")}
    for law, (width, label) in styles.items():
        law_line(left, law, force, tangential[law], linewidth=width, label=label)
    left.set(xlabel="normal force $F_n$ (N)", ylabel="friction $F_t$ (N)", xlim=(0, 1.2), ylim=(0, None))
    for law in LAWS:
        law_line(right, law, force, areas[law](force), label=f"needed by {LABELS[law]}")
    for (name, (label, style)), colour in zip(ADAMS.items(), ("neutral", "measured"), strict=True):
        right.plot(force, areas[name](force), style, color=COLOURS[colour], label=label)
    right.set(xlabel="normal force $F_n$ (N)", ylabel="contact area (mm²)", xlim=(0, 1.2), ylim=(-4, 220))
    left.legend(fontsize="small")
    right.legend(fontsize="small")
    not_shown(figure, "Measured points of Meyer et al. and of Adams")
    return figure
