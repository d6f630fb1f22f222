"""Fig. 7: attraction of touching skin over the permittivities of stratum corneum and insulator.

Meyer et al.: 100 mm2, d_sc = 0.200 mm, d_i = 0.001 mm, 140 V effective; eps_sc 1e3 to 1e4, eps_i 1
to 10. The paper reads 0.05-0.35 N off (5) and 10-600 N off (3), against 0.05-0.35 N measured;
recomputed (5) spans 0.036-0.360 N and (3) 6.0-602 N.
"""

from functools import partial
from typing import Any

import numpy as np

from evfem import data
from evfem.electrostatics.forces import plate_force
from evfem.electrostatics.laws import Layer, Layers

from .common import LAWS, Series, Study
from .plots import COLOURS, LABELS, Figure, law_line, new_figure, not_shown, note, panel_letter
from .printed import Printed

PLACE = "section 3.2.2"
READ = "a round number read off the logarithmic plot"
SAME = (
    "0.05 to 0.35 N is what Meyer et al. measured; the ends of (5) over the plotted permittivities are these"
)
PAPER = {
    "kaczmarek.min_N": Printed("0.05", "least force by (5)", "N", PLACE, SAME),
    "kaczmarek.max_N": Printed("0.35", "largest force by (5)", "N", PLACE, SAME),
    "strong_troxel.min_N": Printed("10", "least force by (3)", "N", PLACE, READ),
    "strong_troxel.max_N": Printed("600", "largest force by (3)", "N", PLACE, READ),
}
ASSUMPTIONS = {
    "contact area": "100 mm2, as the paper assumes",
    "voltage": "140 V is the effective voltage across skin and insulator",
    "measured range": "0.05-0.35 N as the paper quotes Meyer et al.; the points are only plotted there",
}
LINES = (1.0, 3.0, 10.0)  # eps_i of the drawn curves


def main(quick: bool = False) -> Study:
    """Evaluate both laws on the plotted rectangle of permittivities."""
    meyer = data.load("meyer")
    points = 11 if quick else 41
    eps_sc = np.geomspace(meyer.value("eps_sc_min"), meyer.value("eps_sc_max"), points)
    eps_i = np.geomspace(meyer.value("eps_i_min"), meyer.value("eps_i_max"), points)
    force = {law: _force(law, eps_sc, eps_i[:, None], meyer) for law in LAWS}
    lines = {(law, e): _force(law, eps_sc, e, meyer) for law in LAWS for e in LINES}
    low, high = meyer.value("F_e_min"), meyer.value("F_e_max")
    numbers: dict[str, float] = {}
    for law, values in force.items():
        numbers |= {f"{law}.min_N": values.min(), f"{law}.max_N": values.max()}
        numbers |= {f"verdict.{law}.lowest_over_highest_measured": values.min() / high}
        numbers |= {f"verdict.{law}.share_in_measured_range": np.mean((values >= low) & (values <= high))}
    series = [Series(f"{law} eps_i={e:g}", eps_sc, y, "N over eps_sc") for (law, e), y in lines.items()]
    given = {key: meyer.value(key) for key in ("A", "d_sc", "d_i", "U")}
    picture = partial(_draw, eps_sc, eps_i, force, lines, (low, high))
    return Study("fig07", numbers, PAPER, ASSUMPTIONS, series, picture, given)


def _force(law: str, eps_sc: Any, eps_i: Any, meyer: data.Table) -> Any:
    layers = Layers.of(Layer(meyer.value("d_sc"), eps_sc), Layer(meyer.value("d_i"), eps_i))
    return plate_force(LAWS[law], meyer.value("A"), 0.0, meyer.value("U"), layers)


def _draw(
    eps_sc: Any, eps_i: Any, force: dict[str, Any], lines: dict[Any, Any], band: tuple[float, float]
) -> Figure:
    figure = new_figure(3.6)
    _draw_surfaces(figure, eps_sc, eps_i, force)
    ax = figure.add_subplot(1, 2, 2)
    ax.axhspan(*band, color=COLOURS["measured"], alpha=0.3, linewidth=0)
    ax.text(1.05e3, 1.15 * band[1], "measured range", fontsize="small", color=COLOURS["measured"])
    for (law, e), y in lines.items():
        law_line(ax, law, eps_sc, y, linewidth={1.0: 1.0, 3.0: 1.6, 10.0: 2.4}[e])
        name = f"{LABELS[law]}, " if e == LINES[-1] else ""
        label = f"{name}$\\varepsilon^i$ = {e:g}"
        note(ax, label, (eps_sc[-1], y[-1]), (-4, 4), ha="right", color=COLOURS[law])
    ax.set(xscale="log", yscale="log", xlabel="$\\varepsilon^{sc}$", ylabel="$F_e$ (N)", ylim=(1e-2, 2e3))
    ax.margins(x=0.0)
    panel_letter(ax, "b")
    not_shown(figure, "Measured points of Meyer et al.")
    return figure


def _draw_surfaces(figure: Figure, eps_sc: Any, eps_i: Any, force: dict[str, Any]) -> None:
    """The paper's view: one surface per law over both permittivities, all axes logarithmic."""
    ax = figure.add_subplot(1, 2, 1, projection="3d")
    x, y = np.meshgrid(np.log10(eps_sc), np.log10(eps_i))
    for law, values in force.items():
        ax.plot_surface(x, y, np.log10(values), color=COLOURS[law], alpha=0.75, linewidth=0)
    ax.set_xticks([3, 3.5, 4], ["10³", "", "10⁴"])
    ax.set_yticks([0, 0.5, 1], ["1", "", "10"])
    ax.set_zticks([-1, 0, 1, 2], ["0.1", "1", "10", "100"])
    ax.set(xlabel="$\\varepsilon^{sc}$", ylabel="$\\varepsilon^i$")
    ax.view_init(elev=18, azim=-50)
    ax.set_box_aspect(None, zoom=0.9)
    ax.set_title("[a]   $F_e$ (N)", loc="left", fontsize="medium", y=0.95)
    # older matplotlib lays three-dimensional axes out by where the last drawing put their ticks
    figure.set_layout_engine("none")
    figure.draw_without_rendering()
    figure.set_layout_engine("constrained")
