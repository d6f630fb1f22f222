"""The figure of `fingertip`: depth, areas, variants, widths and hovering forces."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from evfem.common.arrays import Floats

from .common import CASES, Series, area_law
from .plots import COLOURS, LABELS, Axes, Figure, draw_box, measured_boxes, panels

PADS = {"smooth": (COLOURS["kaczmarek"], "o"), "ridged": (COLOURS["fe"], "s")}
#: how curves are drawn that nearly coincide: the second one open and dashed
LINES: Mapping[str, Mapping[str, Any]] = {
    "smooth": {"markersize": 4},
    "ridged": {"markersize": 7, "markerfacecolor": "none", "linestyle": "--"},
}


def draw(
    series: Sequence[Series],
    changed: Mapping[str, Mapping[str, float]],
    forces: Mapping[tuple[str, str, str], Floats],
) -> Figure:
    """Panels: load over depth, areas over the load, variants, widths, hovering forces of two laws."""
    figure, axes = panels(6.4, 3, 9.5, rows=2)
    named = {one.name: one for one in series}
    _curves(axes[0], named, "", " depth_mm")
    axes[0].set(xlabel="depth (mm)", ylabel="load (N)", xlim=(0, None))
    _areas(axes[1], named)
    _variants(axes[2], changed, float(area_law("gross")(0.5)))
    _curves(axes[3], named, "width ", "")
    axes[3].set(xlabel="load (N)", ylabel="width of the cross-section (mm)")
    for ax, law in zip(axes[4:], ("kaczmarek", "strong_troxel"), strict=True):
        _hover(ax, law, forces)
    return figure


def _curves(ax: Axes, named: Mapping[str, Series], before: str, after: str) -> None:
    """The curve of each pad."""
    for pad, (colour, marker) in PADS.items():
        if one := named.get(f"{before}{pad}{after}"):
            x, y = (one.y, one.x) if after else (one.x, one.y)
            ax.plot(x, y, marker=marker, color=colour, label=pad, **LINES[pad])
    ax.set_ylim(bottom=0)
    ax.legend(fontsize="small")


def _areas(ax: Axes, named: Mapping[str, Series]) -> None:
    loads = np.geomspace(0.04, 1.2, 30)
    for name, style in (("gross", "--"), ("ridge", ":")):
        ax.loglog(loads, area_law(name)(loads), style, color=COLOURS["measured"], label=f"Adams, {name}")
    for pad, (colour, marker) in PADS.items():
        if f"{pad} gross_mm2" not in named:
            continue
        gross, error = named[f"{pad} gross_mm2"], named[f"{pad} uncertain_mm2"].y
        if pad == "smooth":
            ax.loglog(gross.x, gross.y, marker=marker, color=colour, markersize=4, label="smooth")
            continue
        ax.errorbar(gross.x, gross.y, error, marker=marker, color=colour, label="ridged, gross", **LINES[pad])
        real = named[f"{pad} real_mm2"]
        ax.loglog(real.x, real.y, ":", marker=marker, color=colour, markersize=4, label="ridged, ridges")
    ax.set(xlabel="load (N)", ylabel="contact area (mm²)")
    ax.legend(fontsize="x-small")


def _variants(ax: Axes, changed: Mapping[str, Mapping[str, float]], wanted: float) -> None:
    base = changed["smooth"]["area_mm2"]
    names = sorted((name for name in changed if name != "smooth"), key=lambda name: changed[name]["area_mm2"])
    change = [100.0 * (changed[name]["area_mm2"] / base - 1.0) for name in names]
    ax.barh(names, change, color=COLOURS["neutral"])
    ax.axvline(0.0, color="k", linewidth=0.8)
    ax.axvline(100.0 * (wanted / base - 1.0), color=COLOURS["measured"], linestyle="--")
    ax.tick_params(axis="y", labelsize="x-small")
    ax.set_xlabel("change of the area at 0.5 N (%);\ndashed: as Adams", fontsize="small")


def _hover(ax: Axes, law: str, forces: Mapping[tuple[str, str, str], Floats]) -> None:
    from matplotlib.patches import Patch

    places = dict(zip(CASES, range(len(CASES)), strict=True))
    measured_boxes(ax, {case: place - 0.33 for case, place in places.items()}, 0.18)
    boxes = ((-0.11, "smooth", COLOURS[law], ""), (0.11, "ridged", COLOURS["fe"], ""))
    for shift, kind, colour, hatch in (*boxes, (0.33, "held", COLOURS[law], "////")):
        for case, place in places.items():
            draw_box(ax, place + shift, forces[kind, law, case], 0.18, colour, hatch)
    ax.set_xticks(list(places.values()), list(places))
    ax.set(ylabel="force (mN)", ylim=(0, 1.45 * ax.get_ylim()[1]))
    ax.set_title(LABELS[law], fontsize="medium")
    kinds = (("measured", COLOURS["measured"]), ("smooth", COLOURS[law]), ("ridged", COLOURS["fe"]))
    handles = [Patch(color=colour, label=label) for label, colour in kinds]
    handles.append(
        Patch(facecolor="white", edgecolor=COLOURS[law], hatch="////", label="smooth, held at 30°")
    )
    ax.legend(handles=handles, fontsize="x-small", loc="upper right")
