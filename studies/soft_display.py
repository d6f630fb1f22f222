"""A soft display: the paper's finger on layers of three moduli and three thicknesses, and on the rigid one.

The finger is pressed with 0.05 N/mm at 1000 V over the film of Table 2, which rides on the layer, and slid
under that load. Kaczmarek's law, friction 0.3.

Expected: contact widens as the surface gives way, most where it is softer than the tissue, so that the
attraction grows; a thin layer of an incompressible gel yields less than its modulus says, as it cannot flow
aside. Friction hardly changes, as it is the coefficient times load and attraction.
"""

from typing import Any

import evfem as ev

from .common import Series, Study
from .plots import FIRST, Figure, panels

MODULI, THICKNESSES, NU = (0.1, 0.3, 1.0), (0.5, 2.0, 8.0), 0.48
LOAD, VOLTAGE, FRICTION = 0.05, 1000.0, 0.3
MEASURES = {
    "contact_width": "contact width (mm)",
    "surface_sink": "sinking (mm)",
    "electrostatic_force": "attraction (N/mm)",
    "tangential_force": "friction (N/mm)",
}
ASSUMPTIONS = {
    "surface": "linear, nu 0.48, bonded to a rigid base; the insulator bends with it and keeps its thickness",
    "finger": "without ridges, coarse, plane strain, 0.05 N/mm",
}


def pressed(elastic: Any) -> ev.Result:
    """Pressed, and slid until all of it slips."""
    finger = ev.FingerPad(ridges=False, resolution="coarse")
    display = ev.Display(friction=FRICTION, elastic=elastic)
    motion = [ev.Press(force=LOAD, steps=3), ev.Slide(distance=3.0, steps=4, hold="force")]
    output = ev.Output(every=100)
    return ev.simulate(ev.Scene(finger, display, ev.Kaczmarek(), VOLTAGE, motion, output=output))


def measured(result: ev.Result) -> dict[str, float]:
    """Width, sinking and attraction after the press, friction after the slide."""
    return {name: float(result[name][-1 if name == "tangential_force" else 2]) for name in MEASURES}


def main(quick: bool = False) -> Study:
    """The measures over the modulus, one curve for each thickness."""
    moduli, thicknesses = (MODULI[1:2], THICKNESSES[1:2]) if quick else (MODULI, THICKNESSES)
    rigid = measured(pressed(None))
    numbers = {f"rigid.{name}": value for name, value in rigid.items()}
    series = []
    for thickness in thicknesses:
        found = [measured(pressed(ev.ElasticLayer(E, NU, thickness))) for E in moduli]
        for E, one in zip(moduli, found, strict=True):
            numbers |= {f"E_{E:g}MPa.h_{thickness:g}mm.{name}": value for name, value in one.items()}
        for name, label in MEASURES.items():
            unit = label.split("(")[1].rstrip(")")
            series.append(Series(f"{name}.h_{thickness:g}mm", moduli, [one[name] for one in found], unit))
    parameters = {"moduli_MPa": moduli, "thicknesses_mm": thicknesses, "load_N_per_mm": LOAD}
    return Study("soft_display", numbers, {}, ASSUMPTIONS, series, lambda: draw(series, rigid), parameters)


def draw(series: list[Series], rigid: dict[str, float]) -> Figure:
    """A panel for each measure."""
    figure, axes = panels(4.6, 2, rows=2)
    for ax, (name, label) in zip(axes, MEASURES.items(), strict=True):
        curves = [one for one in series if one.name.startswith(name)]
        for one, colour in zip(curves, FIRST, strict=False):
            thickness = one.name.split("h_")[1].removesuffix("mm")
            ax.plot(one.x, one.y, "o-", color=colour, lw=1.2, ms=4, label=f"{thickness} mm thick")
        ax.axhline(rigid[name], color="black", ls="--", lw=0.8, label="rigid")
        ax.set(xlabel="modulus of the surface (MPa)", ylabel=label, xscale="log")
        ax.margins(y=0.1)
    axes[0].legend(fontsize=7)
    return figure
