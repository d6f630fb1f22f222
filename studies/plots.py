"""How the studies draw: colours of the laws, panels with letters, boxes of measurements, axes."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.plotting.figures import WIDTH, new_figure

from .common import median_interval, participants

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
else:  # a study that draws nothing does not load it
    Axes = Figure = Any

LABELS = {"strong_troxel": "Strong-Troxel", "kaczmarek": "Kaczmarek"}
#: told apart with any colour vision (Okabe and Ito, 2008)
COLOURS = {
    "strong_troxel": "#E69F00",
    "kaczmarek": "#0072B2",
    "measured": "#B04A85",
    "fe": "#009E73",
    "neutral": "#555555",
}
#: of the first curves of a panel
FIRST = [COLOURS[name] for name in ("kaczmarek", "strong_troxel", "fe", "measured")]


def panels(height: float, columns: int, width: float = WIDTH, rows: int = 1, **grid: Any) -> Any:
    """A figure and the axes of its panels, row by row, with their letters; keywords of `subplots`."""
    figure = new_figure(height, width)
    axes = figure.subplots(rows, columns, squeeze=False, **grid).ravel()
    for ax, letter in zip(axes, "abcdefghijkl", strict=False):
        panel_letter(ax, letter)
    return figure, axes


def draw_box(ax: Axes, at: float, values: Floats, width: float, colour: str, hatch: str = "") -> None:
    """Box (quartiles), whiskers (extremes), median, its interval as a bar, and the points."""
    low, high, _ = median_interval(values)
    look = {"whis": (0, 100), "showcaps": True, "patch_artist": True, "manage_ticks": False}
    box = ax.boxplot([values], positions=[at], widths=[width], **look)
    for part in ("boxes", "whiskers", "caps", "medians"):
        for artist in box[part]:
            artist.set(color=colour, linewidth=1.1)
    box["boxes"][0].set(facecolor=colour, alpha=0.30, hatch=hatch)
    box["medians"][0].set(linewidth=2.2)
    ax.plot([at, at], [low, high], color=colour, linewidth=3.0, alpha=0.75, solid_capstyle="butt")
    spread = np.linspace(-0.3, 0.3, len(values)) * width
    ax.plot(at + spread, values, ".", color=colour, markersize=3.0, alpha=0.8)


def measured_boxes(ax: Axes, at: Mapping[str, float], width: float) -> None:
    """The measured forces (mN) of the cases as boxes at the given abscissae."""
    for case, place in at.items():
        draw_box(ax, place, participants()[case], width, COLOURS["measured"])


def not_shown(figure: Figure, what: str) -> None:
    """A line at the foot of the figure on measured points that the paper plots but does not print."""
    figure.supxlabel(
        f"{what}: only plotted in the paper, not shown", fontsize="x-small", color=COLOURS["neutral"]
    )


def panel_letter(ax: Axes, letter: str) -> None:
    """The letter of a panel, in its upper left corner outside the axes."""
    ax.set_title(f"[{letter}]", loc="left", fontsize="medium")


def law_line(ax: Axes, law: str, x: Floats, y: Floats, **style: Any) -> Any:
    """A curve in the law's colour; further keywords of `Axes.plot`."""
    return ax.plot(x, y, color=COLOURS[law], **style)[0]


def note(ax: Axes, text: str, at: tuple[float, float], offset: tuple[float, float], **style: Any) -> None:
    """Small words `offset` points beside a point."""
    ax.annotate(text, at, offset, textcoords="offset points", **{"fontsize": "small"} | style)


def plain_ticks(ax: Axes) -> None:
    """Logarithmic axes with numbers as they are spoken, over a light grid."""
    from matplotlib.ticker import LogLocator, NullFormatter

    for axis in (ax.xaxis, ax.yaxis):
        low, high = axis.get_view_interval()
        few = high < 100.0 * low
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)) if few else LogLocator(numticks=7))
        axis.set_major_formatter("{x:,g}" if high > 1e3 else "{x:g}")
        axis.set_minor_formatter(NullFormatter())  # its labels would overlap where the axis is short
    ax.tick_params(labelsize="small")
    ax.grid(which="major", color="#E5E5E5", linewidth=0.6)
    ax.set_axisbelow(True)
    ax.spines[["top", "right"]].set_visible(False)
