"""Figures: where a picture is drawn, its colours and curves, and how it shows itself.

Colours are told apart with any colour vision, and maps stay in order without colour: lines have the
colours of Okabe and Ito (2008), fields viridis; a stress or strain with a sign has a map from purple over
white to orange, with white at zero (ColorBrewer, safe for colour-blind readers).

A figure is made without pyplot, so that nothing stays open and no global state changes. Where pyplot has been
imported and can show figures, it knows the figure, as it knows one of its own: `plt.show()` shows it, a
notebook shows it below its cell. Elsewhere the last line of a notebook's cell shows it; never both.
"""

from __future__ import annotations

import io
import sys
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from itertools import cycle, pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.errors import InputError, describe_value

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BLACK, ORANGE, SKY, GREEN = "#000000", "#E69F00", "#56B4E9", "#009E73"
BLUE, VERMILION, PURPLE, YELLOW = "#0072B2", "#D55E00", "#CC79A7", "#F0E442"
#: one after the other, for curves that have no colour of their own, with styles that differ in print
CURVES = (BLUE, VERMILION, GREEN, ORANGE, PURPLE, SKY, BLACK)
STYLES = ("-", "--", "-.", ":")
#: one for each round of the colours
MARKERS = "os^Dv<>P"
REGIONS = (SKY, ORANGE, BLUE, GREEN, VERMILION, PURPLE, YELLOW)
#: contact statuses 0, 1, 2
STATUS = {"open": "#B8B8B8", "stick": BLUE, "slip": VERMILION}
ONE_SIGN, BOTH_SIGNS = "viridis", "PuOr_r"
#: what is not coloured by a field: tissue, surface, lines between regions
TISSUE, GROUND, EDGE = "#EFEBE7", "#D0D0D0", "0.25"
#: backends of pyplot that can only write files; what pyplot then knew would stay open for ever
FILES_ONLY = {"agg", "cairo", "pdf", "pgf", "ps", "svg", "template"}
WIDTH, HEIGHT = 7.0, 4.5  # of a figure, in inches
SLENDER = 25.0  # height of a colour bar over its width
WIDER, SMALLEST = 1.1, 6.0  # a title over its axes, at most; its letters in points, at least
MANY = 6  # entries of a legend with large letters
#: triangles of smooth colours in a picture, and parts of a side of one, at most
PARTS, FINEST = 40_000, 6
#: x, y and look of a curve
Line = tuple[Any, Any, Mapping[str, Any]]


class Panels(tuple["Axes", ...]):
    """Axes of several panels, from the top, and their `figure`; a notebook shows them as its picture."""

    @property
    def figure(self) -> Figure:
        """The figure that the panels are in."""
        return whole_figure(self[0])

    def _repr_png_(self) -> bytes | None:
        return _png(self.figure)


def new_figure(height: float = HEIGHT, width: float = WIDTH) -> Figure:
    """An empty figure of so many inches whose parts keep clear of each other."""
    size = (width, height)
    pyplot = sys.modules.get("matplotlib.pyplot")
    if pyplot is not None and pyplot.get_backend().lower() not in FILES_ONLY:
        return pyplot.figure(figsize=size, layout="constrained")
    from matplotlib.figure import Figure

    return Figure(figsize=size, layout="constrained")


def axes_or_new(ax: Axes | None, height: float = HEIGHT) -> Axes:
    """The given axes, or those of a new figure, which show themselves in a notebook."""
    if ax is not None:
        return ax
    figure = new_figure(height)
    ax = figure.add_subplot()
    ax._repr_png_ = partial(_png, figure)  # type: ignore[attr-defined]
    return ax


def new_panels(rows: int, height: float, columns: int = 1) -> Panels:
    """Panels, `height` inches in all: rows share their abscissa, columns their ordinate."""
    figure = new_figure(height, max(WIDTH, 2.6 * columns))
    axes = figure.subplots(rows, columns, sharex=rows > 1, sharey=columns > 1, squeeze=False)
    return Panels(axes.ravel())


def panels_or_new(given: Axes | Sequence[Axes] | None, rows: int, height: float) -> Panels:
    """The given axes, one or a sequence of them, or those of a new figure; InputError for another number."""
    if given is None:
        return new_panels(rows, height)
    panels = Panels(np.ravel(np.array(given, dtype=object)).tolist())
    if len(panels) != rows:
        raise InputError("ax", f"{len(panels)} axes", f"{rows}, one for each kind of quantity")
    return panels


def styled(named: Mapping[Any, Any]) -> Iterator[tuple[Any, dict[str, Any]]]:
    """What stands behind each name, and the look of its curve: label, colour and style."""
    for (name, what), colour, style in zip(named.items(), cycle(CURVES), cycle(STYLES), strict=False):
        yield what, {"label": name, "color": colour, "linestyle": style}


def probe_looks(named: Mapping[str, Any]) -> Iterator[tuple[str, Any, list[dict[str, Any]]]]:
    """Name, probe and looks of its points: colours are the probes', styles their points'. Where these begin
    again, other markers tell the curves apart; a probe's first marker is that of its points in pictures.
    """
    rounds = 1 + (len(named) - 1) // len(CURVES)
    for number, (name, probe) in enumerate(named.items()):
        again, colour = divmod(number, len(CURVES))
        looks = [
            {
                "color": CURVES[colour],
                "linestyle": STYLES[point % len(STYLES)],
                "marker": MARKERS[(again + rounds * (point // len(STYLES))) % len(MARKERS)],
                "markevery": 0.1,
                "markersize": 4.5,
            }
            for point in range(len(probe.position))
        ]
        yield name, probe, looks


def add_legend(ax: Axes) -> Axes:
    """The axes with a legend: where it hides no curve, else at their right if the figure makes room there."""
    drawn = [line for line in ax.get_lines() if not str(line.get_label()).startswith("_")]
    options: dict[str, Any] = {"fontsize": "small" if len(drawn) > MANY else None}
    legend, figure = ax.legend(**options), whole_figure(ax)
    if figure.get_layout_engine() is None:
        return ax
    legend.set_in_layout(False)  # it may be higher than the figure
    figure.draw_without_rendering()
    box, panel = legend.get_window_extent(), ax.get_window_extent()
    paths: list[Any] = [line.get_transform().transform_path(line.get_path()) for line in drawn]
    hidden = any(path.intersects_bbox(box, filled=False) for path in paths if len(path.vertices))
    if hidden or box.height > panel.height:
        columns = int(np.ceil(box.height / panel.height))
        place = {"loc": "upper left", "bbox_to_anchor": (1.01, 1.0), "borderaxespad": 0.0, "ncols": columns}
        if figure.axes == [ax]:  # the panel keeps its width
            figure.set_figwidth(figure.get_figwidth() + columns * box.width / figure.dpi)
        legend = ax.legend(**options, **place)
    legend.set_in_layout(True)
    return ax


def add_title(ax: Axes, text: str, size: str = "medium") -> Axes:
    """The axes with a title hardly wider than they are: broken after commas, then in smaller letters."""
    figure, words = whole_figure(ax), text.split(", ")
    title = ax.set_title(text, fontsize=size)
    for lines in range(1, len(words) + 1):
        ends = [round(len(words) * line / lines) for line in range(lines + 1)]
        title.set_text(",\n".join(", ".join(words[a:b]) for a, b in pairwise(ends)))
        figure.draw_without_rendering()
        room = WIDER * ax.get_window_extent().width / title.get_window_extent().width
        if room >= 1.0:
            return ax
    title.set_fontsize(max(SMALLEST, room * float(title.get_fontsize())))
    return ax


def check_log(log: str, **values: Any) -> None:
    """Raises InputError unless `log` is "", "x", "y" or "xy", and the values along these axes are above 0."""
    if log not in ("", "x", "y", "xy"):
        raise InputError("log", describe_value(log), '"", "x", "y" or "xy"')
    for axis in log:
        if not np.all(np.asarray(values[axis]) > 0.0):
            raise InputError("log", describe_value(log), f"numbers above 0 along {axis}")


def curves(ax: Axes | None, lines: Sequence[Line], xlabel: str, ylabel: str, *, legend: bool = True) -> Axes:
    """Lines of x, y and look on a grid; few points are marked. Several have a `legend` if it is wanted."""
    ax = axes_or_new(ax)
    for x, y, look in lines:
        ax.plot(x, y, **{"marker": "o" if len(x) < 3 else None, **look})
    ax.set(xlabel=xlabel, ylabel=ylabel)
    ax.grid(alpha=0.3)
    return add_legend(ax) if legend and len(lines) > 1 else ax


def shaded(ax: Axes, points: Floats, triangles: Ints, values: Floats) -> Any:
    """Colours of values at points (P, 2) that are linear in each triangle (T, 3). The shading of a triangle
    is linear between the colours of its corners, which is another colour: large ones are drawn in parts.
    """
    from matplotlib.tri import Triangulation

    n = int(np.clip(np.sqrt(PARTS / len(triangles)), 1, FINEST))
    i, j = np.array([(i, j) for i in range(n + 1) for j in range(n + 1 - i)]).T
    number = {bar_axes: k for k, bar_axes in enumerate(zip(i.tolist(), j.tolist(), strict=True))}
    up = [[(a, b), (a + 1, b), (a, b + 1)] for a, b in number if a + b < n]
    down = [[(a + 1, b), (a + 1, b + 1), (a, b + 1)] for a, b in number if a + b < n - 1]
    parts = np.array([[number[bar_axes] for bar_axes in part] for part in up + down])
    corners = np.column_stack([points, values])[triangles]
    x, y, value = np.einsum("mk,tkc->ctm", np.column_stack([n - i - j, j, i]) / n, corners).reshape(3, -1)
    own = parts + i.size * np.arange(len(triangles))[:, None, None]
    return ax.tripcolor(Triangulation(x, y, own.reshape(-1, 3)), value, shading="gouraud")


def contour_of_contact(ax: Axes, points: Floats, triangles: Ints, touching: Any) -> None:
    """A line halfway between nodes at points (P, 2) of triangles (T, 3) that are `touching` (P,) and those
    that are not; nothing where all are, or none.
    """
    from matplotlib.tri import Triangulation

    inside = np.asarray(touching, dtype=float)
    if len(triangles) and np.ptp(inside[triangles]):
        where = Triangulation(points[:, 0], points[:, 1], triangles)
        lines = ax.tricontour(where, inside, levels=[0.5], colors=BLACK, linewidths=0.8)
        lines.set_label("contour of contact")


def whole_figure(ax: Axes) -> Figure:
    """The figure of axes, the outermost one where it has parts."""
    return ax.figure.figure


def _png(figure: Figure) -> bytes | None:
    """The picture for a notebook; None while pyplot holds the figure and shows it itself."""
    pyplot = sys.modules.get("matplotlib.pyplot")
    manager = figure.canvas.manager
    if pyplot is not None and manager is not None and pyplot.fignum_exists(manager.num):
        return None
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=figure.dpi)
    return buffer.getvalue()


class Beside:
    """Keeps a colour bar as high as the axes beside it, also in true proportions."""

    def __init__(self, ax: Axes) -> None:
        self.ax = ax

    def __call__(self, bar: Any, renderer: Any) -> Any:
        """Where the bar is: the right neighbour of the axes, in fractions of the figure."""
        from matplotlib.transforms import Bbox

        figure, box = whole_figure(self.ax), self.ax.get_position()
        across = figure.get_figheight() / figure.get_figwidth() * box.height / SLENDER
        return Bbox.from_bounds(box.x1 + 0.012, box.y0, across, box.height)


def add_colorbar(mapped: Any, ax: Axes, label: str, extend: str = "neither") -> Any:
    """A colour bar at the right of the axes, as high as they are."""
    from matplotlib.colorbar import make_axes

    bar_axes, options = make_axes(ax, pad=0.02, fraction=0.05, aspect=SLENDER, anchor=(0.0, 0.5))
    bar_axes.set_axes_locator(Beside(ax))
    bar = ax.figure.colorbar(mapped, cax=bar_axes, label=label, extend=extend, **options)
    bar.ax.ticklabel_format(axis="y", scilimits=(-3, 4))
    return bar
