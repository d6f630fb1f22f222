"""Spectra of columns of the history."""

from __future__ import annotations

from typing import TYPE_CHECKING

from evfem.plotting.curves import Results, named, styled, units_of
from evfem.plotting.figures import axes_or_new
from evfem.plotting.labels import column_label
from evfem.simulation import spectrum as spectra

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FEW = 100  # so many frequencies are lines from 0, more are a curve
THICK = 4.0  # points; a line in front of another is thinner


def spectrum(
    results: Results,
    column: str = "tangential_force",
    ax: Axes | None = None,
    *,
    start: float | None = None,
    stop: float | None = None,
    window: str = "none",
) -> Axes:
    """Amplitudes of a column over the frequency (Hz), of one result or of several by their names.

    They are those of `ev.spectrum`, which says what `start`, `stop` and `window` are; the mean, at
    0 Hz, is left out.
    """
    found = named(results)
    drawn = {
        name: spectra.spectrum(result, column, start=start, stop=stop, window=window)
        for name, result in found.items()
    }
    ax = axes_or_new(ax)
    for number, ((name, (frequency, amplitude)), colour, style) in enumerate(styled(drawn)):
        f, a = frequency[1:], amplitude[1:]
        if len(f) <= FEW:
            ax.vlines(f, 0.0, a, colors=colour, linewidth=THICK / (1.0 + number))
            ax.plot(
                f, a, linestyle="none", marker="oxs^v"[number % 5], color=colour, label=name, markersize=4
            )
        else:
            ax.plot(f, a, style, color=colour, label=name, linewidth=1.0)
    ax.set(xlabel="frequency (Hz)", ylabel=f"amplitude of {column_label(column, units_of(found))}")
    ax.grid(alpha=0.3)
    if len(found) > 1:
        ax.legend()
    return ax
