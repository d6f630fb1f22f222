"""What the studies share: writing a study down, runs side by side, laws, measurements, drawing."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from evfem import data
from evfem.common.arrays import Floats
from evfem.common.notices import LOG
from evfem.common.pools import processes
from evfem.common.storage import disk, replacing, write_text
from evfem.common.tables import csv_text
from evfem.electrostatics.laws import Kaczmarek, Layer, Layers, StrongTroxel, eps_0
from evfem.errors import InputError
from evfem.plotting.figures import WIDTH, new_figure
from evfem.simulation.provenance import origin

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
else:  # a study that draws nothing does not load it
    Axes = Figure = Any

Argument, Answer = TypeVar("Argument"), TypeVar("Answer")
LAWS: dict[str, StrongTroxel | Kaczmarek] = {"strong_troxel": StrongTroxel(), "kaczmarek": Kaczmarek()}
LABELS = {"strong_troxel": "Strong-Troxel", "kaczmarek": "Kaczmarek"}
#: told apart with any colour vision (Okabe and Ito, 2008)
COLOURS = {
    "strong_troxel": "#E69F00",
    "kaczmarek": "#0072B2",
    "measured": "#B04A85",
    "fe": "#009E73",
    "neutral": "#555555",
}
#: hover cases of the measurements: voltage in V, air gap in mm
CASES = {"HVHD": (2000.0, 0.50), "HVLD": (2000.0, 0.25), "LVLD": (1414.0, 0.25)}
QUICK = "--quick: coarser and shorter than the study"


@dataclass(frozen=True)
class Series:
    """One plotted curve or set of points, as it goes into the csv; `unit` is that of y."""

    name: str
    x: Any
    y: Any
    unit: str


@dataclass(frozen=True)
class Study:
    """A finished study: numbers, what the paper prints for them, assumptions, curves, how to draw it.

    `tables` by their titles are lists of lines of Markdown, kept among the assumptions.
    """

    name: str
    numbers: dict[str, float]
    paper: dict[str, float]
    assumptions: dict[str, Any]
    series: list[Series]
    draw: Callable[[], Figure]
    parameters: dict[str, Any] = field(default_factory=dict)
    tables: dict[str, list[str]] = field(default_factory=dict)

    def finish(self, out: Path | None, quick: bool = False) -> dict[str, Any]:
        """The study's dictionary; with `out` also NAME.json, NAME.csv, NAME.png and, where there are
        tables, NAME.md in that folder.

        The picture of a `quick` study says so.
        """
        said = {"tables": self.tables} if self.tables else {}
        made = {"eps_0_F_per_m": eps_0, "quick": quick, "parameters": self.parameters}
        result = {
            "study": self.name,
            "numbers": {key: float(value) for key, value in self.numbers.items()},
            "paper": self.paper,
            "assumptions": self.assumptions | said,
            "provenance": origin() | made,
        }
        if out is not None:
            folder = make_folder(out)
            write_text(folder / f"{self.name}.json", json.dumps(result, indent=1) + "\n")
            write_text(folder / f"{self.name}.csv", series_text(self.series))
            if self.tables:
                write_text(folder / f"{self.name}.md", self._page())
            figure = self.draw()
            if quick:
                say_quick(figure)
            with replacing(folder / f"{self.name}.png") as temporary:
                figure.savefig(temporary, format="png", dpi=160)
        return result

    def _page(self) -> str:
        """The tables with date and versions, as Markdown."""
        made = origin()
        versions = ", ".join(f"{name} {number}" for name, number in made["versions"].items())
        blocks = [f"# {self.name}", f"{made['date']}; {versions}; one thread; CPU seconds."]
        for title, lines in self.tables.items():
            blocks += [f"## {title}", "\n".join(lines)]
        return "\n\n".join(blocks) + "\n"


def make_folder(out: str | Path) -> Path:
    """`out` as an existing folder; StorageError where the disk refuses."""
    folder = Path(out)
    with disk(f"create the folder {folder}"):
        folder.mkdir(parents=True, exist_ok=True)
    return folder


def series_text(series: Iterable[Series]) -> str:
    """Every point of every series as a line ``series,x,y,unit``."""
    rows: list[list[Any]] = [["series", "x", "y", "unit"]]
    for one in series:
        points = zip(_plain(one.x), _plain(one.y), strict=True)
        rows += [[one.name, x, y, one.unit] for x, y in points]
    return csv_text(rows)


def _plain(values: Any) -> list[float] | list[str]:
    array = np.atleast_1d(values)
    return (array if array.dtype.kind == "U" else array.astype(float)).tolist()


def markdown(head: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """A table as lines of Markdown."""
    return [f"| {' | '.join(row)} |" for row in (head, ["---"] * len(head), *rows)]


def side_by_side(
    function: Callable[[Argument], Answer], arguments: Sequence[Argument], workers: int = 2
) -> list[Answer]:
    """`function`, of a module, of each argument, in their order, by so many processes.

    With one worker, and where processes cannot start (a script that runs a study outside
    ``if __name__ == "__main__"``), everything happens in this process.
    """
    answers: dict[int, Any] = {}
    if workers > 1 and len(arguments) > 1:
        with suppress(InputError), processes(workers) as pool:
            for place, answer in pool(function, dict(enumerate(arguments))):
                if isinstance(answer, Exception):
                    raise answer
                answers[place] = answer
                LOG.debug("case %d of %d", len(answers), len(arguments))
    return [answers[i] if i in answers else function(one) for i, one in enumerate(arguments)]


def alone(function: Callable[[Argument], Answer], argument: Argument) -> Answer:
    """The answer of a function, of a module, in a process of its own: for memory, clocks and imports."""
    with processes(1) as pool:
        ((_, answer),) = pool(function, {0: argument})
    if isinstance(answer, Exception):
        raise answer
    return answer  # type: ignore[no-any-return]


@cache
def participants() -> data.Table:
    """Table 1."""
    return data.load("table1")


def table2_layers(stratum_corneum: Any = None) -> Layers:
    """Table 2's stack; `stratum_corneum` in mm replaces the thickness of the stratum corneum."""
    table = data.load("table2")
    thickness = table.value("d_sc") if stratum_corneum is None else stratum_corneum
    skin = Layer(thickness, table.value("eps_sc"))
    return Layers.of(skin, Layer(table.value("d_i"), table.value("eps_i")))


def panels(height: float, columns: int, width: float = WIDTH, rows: int = 1, **grid: Any) -> Any:
    """A figure and the axes of its panels, row by row, with their letters; keywords of `subplots`."""
    figure = new_figure(height, width)
    axes = figure.subplots(rows, columns, squeeze=False, **grid).ravel()
    for ax, letter in zip(axes, "abcdefghijkl", strict=False):
        panel_letter(ax, letter)
    return figure, axes


def median_interval(values: Floats) -> tuple[float, float, float]:
    """Confidence interval of the median from order statistics: low, high, and the confidence it
    has.

    The narrowest symmetric pair of order statistics with at least 90 %: for eleven values the
    third and ninth, 93.5 %. It assumes nothing about the distribution.
    """
    from math import comb

    ordered = np.sort(values)
    n = len(ordered)
    for rank in range(n // 2, -1, -1):
        confidence = 1.0 - 2.0 * sum(comb(n, i) for i in range(rank + 1)) / 2.0**n
        if confidence >= 0.90:
            return float(ordered[rank]), float(ordered[n - 1 - rank]), confidence
    return float(ordered[0]), float(ordered[-1]), 1.0 - 2.0 ** (1 - n)


def draw_box(ax: Axes, at: float, values: Floats, width: float, colour: str) -> None:
    """Box (quartiles), whiskers (extremes), median, its confidence interval as a bar, and the
    points.
    """
    low, high, _ = median_interval(values)
    box = ax.boxplot(
        [values],
        positions=[at],
        widths=[width],
        whis=(0, 100),
        showcaps=True,
        patch_artist=True,
        manage_ticks=False,
    )
    for part in ("boxes", "whiskers", "caps", "medians"):
        for artist in box[part]:
            artist.set(color=colour, linewidth=1.1)
    box["boxes"][0].set(facecolor=colour, alpha=0.30)
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


def say_quick(figure: Figure) -> None:
    """A line of its own at the head of a figure from `new_figure`: what it shows is coarser and
    shorter.
    """
    line = 0.18 / figure.get_figheight()
    figure.get_layout_engine().set(rect=(0.0, 0.0, 1.0, 1.0 - line))
    figure.text(
        0.99, 1.0 - 0.2 * line, QUICK, ha="right", va="top", fontsize="x-small", color=COLOURS["neutral"]
    )


def panel_letter(ax: Axes, letter: str) -> None:
    """The letter of a panel, in its upper left corner outside the axes."""
    ax.set_title(f"[{letter}]", loc="left", fontsize="medium")


def law_line(ax: Axes, law: str, x: Floats, y: Floats, **style: Any) -> Any:
    """A curve in the law's colour; further keywords of `Axes.plot`."""
    return ax.plot(x, y, color=COLOURS[law], **style)[0]


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
