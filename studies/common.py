"""What the studies share: writing a study down, runs side by side, laws and measurements."""

import json
import platform
import subprocess
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any, TypeVar

import numpy as np

import evfem as ev
from evfem import data
from evfem.circuit.encoding import AreaLaw
from evfem.common.arrays import Floats
from evfem.common.notices import LOG
from evfem.common.pools import processes
from evfem.common.storage import disk, replacing, write_text
from evfem.common.tables import csv_text
from evfem.finger.layers import TABLE_2
from evfem.simulation.provenance import origin

from .printed import Printed, numbers_of

Argument, Answer = TypeVar("Argument"), TypeVar("Answer")
LAWS: dict[str, Any] = {"strong_troxel": ev.StrongTroxel(), "kaczmarek": ev.Kaczmarek()}
#: hover cases of the measurements: voltage in V, air gap in mm
CASES = {"HVHD": (2000.0, 0.50), "HVLD": (2000.0, 0.25), "LVLD": (1414.0, 0.25)}
QUICK = "--quick: coarser and shorter than the study"
#: when the study that runs was begun
BEGIN: ContextVar[float | None] = ContextVar("BEGIN", default=None)


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

    `paper` has what the paper prints, by the keys of `numbers`. `tables` by their titles are lists of
    lines of Markdown. Both are kept among the assumptions. `files` writes what else it leaves in a folder.
    """

    name: str
    numbers: dict[str, float]
    paper: dict[str, Printed]
    assumptions: dict[str, Any]
    series: list[Series]
    draw: Callable[[], Any]
    parameters: dict[str, Any] = field(default_factory=dict)
    tables: dict[str, list[str]] = field(default_factory=dict)
    files: Callable[[Path], None] | None = None

    def finish(self, out: Path | None, quick: bool = False) -> dict[str, Any]:
        """The study's dictionary; with `out` also NAME.json, NAME.csv, NAME.png and, where there are
        tables, NAME.md in that folder.

        The picture of a `quick` study says so.
        """
        printed = {key: one.described() for key, one in self.paper.items()}
        said = {"tables": self.tables, "printed": printed}
        made = {"eps_0_F_per_m": ev.eps_0, "quick": quick, "parameters": self.parameters}
        made |= {"seconds": since_begin(), "commit": commit(), "processor": processor()}
        result = {
            "study": self.name,
            "numbers": {key: float(value) for key, value in self.numbers.items()},
            "paper": numbers_of(self.paper),
            "assumptions": self.assumptions | {key: value for key, value in said.items() if value},
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
                _say_quick(figure)
            with replacing(folder / f"{self.name}.png") as temporary:
                figure.savefig(temporary, format="png", dpi=160)
            if self.files is not None:
                self.files(folder)
        return result

    def _page(self) -> str:
        """The tables with date and versions, as Markdown."""
        made = origin()
        versions = ", ".join(f"{name} {number}" for name, number in made["versions"].items())
        blocks = [f"# {self.name}", f"{made['date']}; {versions}; one thread; CPU seconds."]
        for title, lines in self.tables.items():
            blocks += [f"## {title}", "\n".join(lines)]
        return "\n\n".join(blocks) + "\n"


def _say_quick(figure: Any) -> None:
    """A line of its own at the head of a figure: what it shows is coarser and shorter."""
    line = 0.18 / figure.get_figheight()
    figure.get_layout_engine().set(rect=(0.0, 0.0, 1.0, 1.0 - line))
    look = {"ha": "right", "va": "top", "fontsize": "x-small", "color": "#555555"}
    figure.text(0.99, 1.0 - 0.2 * line, QUICK, **look)


def commit() -> str | None:
    """The commit of the checkout that runs, with `-dirty` where files differ; None outside of one."""
    words = ["git", "-C", str(Path(__file__).parent), "describe", "--always", "--dirty", "--abbrev=8"]
    try:
        return subprocess.run(words, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return None


def processor() -> str:
    """Name of the processor, or its kind where the system does not say more."""
    with suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.machine()


def since_begin() -> float | None:
    """Seconds since `studies.run` began the study; None if something else has called it."""
    begun = BEGIN.get()
    return None if begun is None else round(time.perf_counter() - begun, 2)


def make_folder(out: str | Path) -> Path:
    """`out` as an existing folder; StorageError where the disk refuses."""
    folder = Path(out)
    with disk(f"create the folder {folder}"):
        folder.mkdir(parents=True, exist_ok=True)
    return folder


@contextmanager
def ready(out: Path | None) -> Iterator[None]:
    """Inside, `out` is a folder that can be written to, which is known before hours are computed; removed if
    made for this and left empty. StorageError where the disk refuses.
    """
    if out is None:
        yield
        return
    made = not out.exists()
    folder = make_folder(out)
    try:
        with disk(f"write into {folder}"), TemporaryFile(dir=folder):
            pass
        yield
    finally:
        if made:
            with suppress(OSError):  # it is not empty
                folder.rmdir()


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
        with suppress(ev.InputError), processes(workers) as pool:
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


def by_participant(name: str, values: Any, unit: str = "mN") -> Series:
    """A value for each of the first participants."""
    return Series(name, participants()["participant"][: len(values)], values, f"{unit} over participant")


def table2_layers(stratum_corneum: Any = None, insulator: Any = None) -> ev.Layers:
    """Table 2's stack, with other thicknesses in mm."""
    table = data.load("table2")
    skin = ev.Layer(
        table.value("d_sc") if stratum_corneum is None else stratum_corneum, table.value("eps_sc")
    )
    return ev.Layers.of(skin, ev.Layer(insulator or table.value("d_i"), table.value("eps_i")))


def area_law(name: str) -> AreaLaw:
    """Contact area in mm2 over the load in N: "gross" and "ridge" of Adams, or what a law needs."""
    laws = data.load("area_laws")
    return AreaLaw(laws.value(name, "k"), laws.value(name, "m"))


def tissue(factor: float = 1.0, **moduli: float) -> dict[str, ev.NeoHookean]:
    """Table 2's soft layers with all moduli times a factor, and some replaced (MPa)."""
    soft = {name: own for name, own in TABLE_2.items() if name != "nail"}
    return {name: ev.NeoHookean(E=factor * moduli.get(name, E), nu=nu) for name, (E, nu) in soft.items()}


def paper_display(friction: float) -> ev.Display:
    """The display of Table 2."""
    table = data.load("table2")
    return ev.Display(insulator=ev.Layer(table.value("d_i"), table.value("eps_i")), friction=friction)


def median_interval(values: Floats) -> tuple[float, float, float]:
    """Confidence interval of the median: low, high, and the confidence it has.

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
