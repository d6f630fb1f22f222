"""Which parameters a number of a run depends on, and how stiff a finger is at a frequency."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from evfem.errors import InputError
from evfem.plotting.figures import BLUE, VERMILION, Panels, axes_or_new, curves, new_panels, styled
from evfem.plotting.labels import key_texts
from evfem.response.electrical import ElectricalImpedance
from evfem.response.impedance import Impedance

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: height in inches of a bar, and of what is beside the bars
BAR, REST = 0.32, 1.1


def tornado(found: Any, column: str = "tangential_force", step: int = -1, ax: Axes | None = None) -> Axes:
    """Bars of how much of a column each parameter makes at a step, the longest one on top.

    Parameters
    ----------
    found
        What `evfem.sensitivities` found: relative derivatives; or `evfem.uncertainty`: the change for one
        standard deviation.
    column
        A column of the history.
    step
        Number of the step from 0; -1: the last one.
    ax
        Axes to draw in; None: new ones.

    Returns
    -------
    Axes
        The axes of the bars.

    Raises
    ------
    InputError
        A column or a step without derivatives.
    """
    effects, label = found.effects(column, step)
    known = {key: value for key, value in effects.items() if np.isfinite(value)}
    if not known:
        raise InputError("column", f"{column}, which has no derivative at that step", "one that has")
    order = sorted(known, key=lambda key: abs(known[key]))
    ax = axes_or_new(ax, REST + BAR * len(order))
    colours = [BLUE if known[key] >= 0.0 else VERMILION for key in order]
    bars = ax.barh(range(len(order)), [known[key] for key in order], color=colours)
    ax.bar_label(bars, fmt="%.2g", padding=3, fontsize="small")
    ax.margins(x=0.2)
    ax.set_yticks(range(len(order)), key_texts(order))
    ax.axvline(0.0, color="black", linewidth=0.8)
    ax.set_xlabel(label.replace("_", " "))
    ax.grid(alpha=0.3, axis="x")
    return ax


def impedance(
    found: Impedance | ElectricalImpedance | Mapping[str, Impedance] | Mapping[str, ElectricalImpedance],
) -> Panels:
    """Magnitude and phase over the frequency of a stiffness (`evfem.impedance`) or of an electrical one
    (`evfem.electrical_impedance`), of one finger or of several by their names.

    The phase is positive where the force is ahead of the displacement, or the voltage ahead of the current.

    Raises
    ------
    InputError
        Nothing to draw, or stiffnesses of different units.
    """
    single = isinstance(found, Impedance | ElectricalImpedance)
    named: dict[str, Any] = {"": found} if single else dict(found)  # type: ignore[arg-type]
    units = {one.unit for one in named.values()}
    if len(units) != 1:
        given = "no impedance" if not units else "impedances in " + " and ".join(sorted(units))
        raise InputError("found", given, "one impedance, or {name: impedance, ...} of one unit")
    upper, lower = new_panels(2, 6.0)
    sizes, phases = [], []
    for one, look in styled(named):
        values = one.impedance if isinstance(one, ElectricalImpedance) else one.stiffness
        sizes.append((one.frequency, np.abs(values), look))
        phases.append((one.frequency, np.degrees(np.angle(values)), look))
    curves(upper, sizes, "", f"magnitude ({units.pop()})")
    curves(lower, phases, "frequency (Hz)", "phase (degrees)", legend=False)
    upper.set(xscale="log", yscale="log")
    degrees = np.concatenate([y for _, y, _ in phases])
    if np.ptp(degrees) > 60.0:
        lower.set_yticks(np.arange(-180, 181, 45))
    lower.set_ylim(max(-185.0, degrees.min() - 10.0), min(185.0, degrees.max() + 10.0))
    return Panels((upper, lower))
