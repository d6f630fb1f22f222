"""What a fit leaves unexplained."""

from __future__ import annotations

from itertools import cycle
from typing import TYPE_CHECKING

import numpy as np

from evfem.calibration.result import FitResult
from evfem.plotting.colours import CURVES
from evfem.plotting.figures import axes_or_new
from evfem.plotting.labels import column_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: bars end where residuals of the given sd rarely reach
TWO = 2.0


def residuals(fit: FitResult, ax: Axes | None = None) -> Axes:
    """Computed minus measured for each measured value of a fit, in the order of the data.

    In standard deviations where the data have them, with a band of two on either side; else in
    percent of the root mean square of the measurement. A good fit scatters about zero without a
    pattern.
    """
    from matplotlib.ticker import MaxNLocator

    ax = axes_or_new(ax)
    in_sd = bool(fit.provenance.get("sd"))
    values = fit.residuals * (1.0 if in_sd else 100.0)
    number = np.arange(1, len(values) + 1)
    kinds = [name.split(" at ")[0].split(",")[0].split(".")[0] for name in fit.names]
    if in_sd:
        ax.axhspan(-TWO, TWO, color="0.92", label="two standard deviations")
    ax.axhline(0.0, color="0.4", linewidth=0.8)
    for kind, colour in zip(dict.fromkeys(kinds), cycle(CURVES), strict=False):
        own = np.array([one == kind for one in kinds])
        ax.vlines(number[own], 0.0, values[own], color=colour, linewidth=1.2)
        ax.plot(number[own], values[own], "o", color=colour, label=column_text(kind))
    ax.set(xlabel="measured value", xlim=(0.4, len(values) + 0.6))
    ax.set_ylabel(f"computed - measured ({'sd' if in_sd else '% of root mean square'})")
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    ax.grid(axis="y", alpha=0.3)
    ax.legend()
    return ax
