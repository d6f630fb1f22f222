"""Tractions along the pad."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from evfem.plotting.colours import BLUE, GREEN, VERMILION
from evfem.plotting.fields import frame_of
from evfem.plotting.figures import axes_or_new
from evfem.plotting.finger import check_plane, told
from evfem.simulation.result import Result

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LINES = {
    "contact_pressure": (BLUE, "-"),
    "shear_traction": (VERMILION, "-"),
    "electrostatic_traction": (GREEN, "--"),
}


def contact_pressure(result: Result, frame: int = -1, ax: Axes | None = None) -> Axes:
    """Contact pressure, shear and electrostatic traction (MPa) of the pad over its current x (mm).

    Shear and attraction are left out where they are 0 throughout.
    """
    check_plane(result.mesh)
    shown = frame_of(result, frame)
    ax = axes_or_new(ax)
    pad = np.flatnonzero(np.isfinite(shown.gap))
    x = result.mesh.points[pad, 0] + shown.displacement[pad, 0]
    pad, x = pad[np.argsort(x)], np.sort(x)
    for name, (colour, style) in LINES.items():
        values = getattr(shown, name)[pad]
        if name == "contact_pressure" or np.any(values != 0.0):
            ax.plot(x, values, style, color=colour, label=name.replace("_", " "), linewidth=1.2)
    touching = x[shown.contact_status[pad] > 0]
    if len(touching):
        margin = 0.25 * (touching[-1] - touching[0]) + 0.2
        ax.set_xlim(touching[0] - margin, touching[-1] + margin)
    ax.set_xlabel("x (mm)")
    ax.set_ylabel("traction (MPa)")
    ax.set_title(told(result, shown), fontsize="medium")
    ax.grid(alpha=0.3)
    low, high = ax.get_ylim()
    ax.set_ylim(low, high + 0.35 * (high - low))  # the legend stands above the peaks of the ridges
    ax.legend(loc="upper left")
    return ax
