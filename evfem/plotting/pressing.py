"""What an experiment measures of presses and slides: force over indentation, contact area over
load, friction over what changes, and the voltage that makes it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from evfem.errors import InputError
from evfem.plotting.curves import ZERO, Results, along, checked_over, finish, named, styled, units_of
from evfem.plotting.figures import Panels, axes_or_new, new_panels
from evfem.plotting.labels import axis_label, column_label, values_of
from evfem.simulation.result import Result

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def force_indentation(results: Results, ax: Axes | None = None) -> Axes:
    """Applied force over indentation, of the presses of one result or of several by their names."""
    found = named(results)
    presses = {name: _presses(result) for name, result in found.items()}
    ax = axes_or_new(ax)
    for (name, result), colour, style in styled(found):
        x, y = (values_of(result, column)[presses[name]] for column in ("indentation", "applied_force"))
        ax.plot(x, y, style, color=colour, label=name, marker=".")
    _label(ax, "indentation", "applied_force", found)
    return ax


def contact_area(results: Results, ax: Axes | None = None) -> Axes:
    """Contact width (in total: area) over the applied force of the presses: from edge to edge, and
    of all that touches.
    """
    found = named(results)
    presses = {name: _presses(result) for name, result in found.items()}
    ax = axes_or_new(ax)
    for (name, result), colour, _ in styled(found):
        rows = presses[name]
        load = values_of(result, "applied_force")[rows]
        width = "contact_area" if result.mesh.dim == 3 else "contact_width"
        for column, text, style in ((width, "edge to edge", "-"), (f"real_{width}", "touching", "--")):
            label = f"{name}, {text}" if name else text
            ax.plot(load, values_of(result, column)[rows], style, color=colour, label=label, marker=".")
    _label(ax, "applied_force", width, found)
    ax.legend()
    return ax


def friction(results: Results, over: str | None = None, ax: Axes | None = None) -> Axes:
    """Apparent friction coefficient, tangential over normal force on the bone, over `over`
    (`forces`).

    Steps without a load on the bone are left out.
    """
    found = named(results)
    first = next(iter(found.values()))
    over = checked_over(over, first)
    ax = axes_or_new(ax)
    for (name, result), colour, style in styled(found):
        load = along(result, "applied_force", over)
        rows = load > ZERO * float(np.abs(load).max(initial=0.0))
        ratio = along(result, "applied_tangential_force", over)[rows] / load[rows]
        ax.plot(along(result, over, over)[rows], ratio, style, color=colour, label=name)
    finish(ax, first, over, "apparent friction coefficient")
    _legend(ax, found)
    return ax


def signal(results: Results, over: str | None = None) -> Panels:
    """Voltage above, friction force on the bone below, over `over` (see `forces`)."""
    found = named(results)
    first = next(iter(found.values()))
    over = checked_over(over, first)
    panels = new_panels(2, 4.8)
    for (name, result), colour, style in styled(found):
        x = along(result, over, over)
        for ax, column in zip(panels, ("voltage", "applied_tangential_force"), strict=True):
            ax.plot(x, along(result, column, over), style, color=colour, label=name)
    labels = "voltage (V)", f"friction force ({first.units['tangential_force']})"
    for ax, label in zip(panels, labels, strict=True):
        finish(ax, first, over, label)
    panels[0].set_xlabel("")
    _legend(panels[1], found)
    return panels


def _presses(result: Result) -> np.ndarray:
    rows = np.flatnonzero(result.motion == "press")
    if not rows.size:
        raise InputError("results", f"a run of {', '.join(sorted(set(result.motion)))}", "a run with a press")
    return rows


def _label(ax: Axes, over: str, name: str, found: dict[str, Result]) -> None:
    units = units_of(found)
    ax.set(xlabel=column_label(over, units), ylabel=axis_label(name, units))
    ax.grid(alpha=0.3)
    _legend(ax, found)


def _legend(ax: Axes, found: dict[str, Result]) -> None:
    """One curve needs no name."""
    if len(found) > 1:
        ax.legend()
