"""`evfem run -v`: a line for every step, on standard error and with its time in a log in the run's folder,
and one of how far a step is where that takes long.

The log is appended to and never removed, so that it also has what happened before an interruption.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from evfem.common.notices import LOG, WITHIN, Seldom, listening, milestone, tell
from evfem.common.views import plus

NAME = "steps.log"
FORMAT = "%(asctime)s  %(message)s"
#: seconds without a line after which it is told how far a step is
SILENCE = 10.0


class Steps:
    """Observer that gives a notice of every step, after which `within` is silent for a while."""

    def __init__(self, within: Seldom) -> None:
        self.within = within

    def started(self, mesh: Any, scene: Any, total_steps: int) -> None:
        """Nodes, cells and steps."""
        self.total = total_steps
        size = f"{len(mesh.points)} nodes, {len(mesh.cells)} cells"
        LOG.info("run of %s: %s, %d steps", scene.name, size, total_steps)

    def step(self, row: Mapping[str, Any], frame: Any, checkpoint: Any) -> None:
        """Where the bone is, the forces, and what the step cost."""
        unit = "N" if "contact_area" in row else "N/mm"
        told = ", ".join(f"{name} {plus(row[column]):.4g} {one}" for name, column, one in _shown(unit))
        self.within.last = time.time()
        cost = f"{row['newton_iterations']} iterations, {row['substeps']} substeps, {row['seconds']:.2g} s"
        LOG.info("step %d of %d, %s: %s; %s", row["step"], self.total, row["motion"], told, cost)

    def finished(self, result: Any) -> None:
        """What is to doubt in the result."""
        for warning in result.warnings:
            LOG.info("warning: %s", warning)


class Milestones:
    """Observer that tells of progress without a terminal: a line for every tenth of the steps."""

    def started(self, mesh: Any, scene: Any, total_steps: int) -> None:
        """How many there will be."""
        self.total = total_steps

    def step(self, row: Mapping[str, Any], frame: Any, checkpoint: Any) -> None:
        """One is done."""
        milestone("step", row["step"], self.total)


def _shown(unit: str) -> tuple[tuple[str, str, str], ...]:
    return (
        ("position", "position", "mm"),
        ("indentation", "indentation", "mm"),
        ("normal", "normal_force", unit),
        ("tangential", "tangential_force", unit),
    )


class _File(logging.Handler):
    """Appends a line with its time for each notice; a disk that refuses it costs the line, not the run."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.path = path
        self.setFormatter(logging.Formatter(FORMAT))

    def emit(self, record: logging.LogRecord) -> None:
        with suppress(OSError), self.path.open("a", encoding="utf-8") as file:
            file.write(f"{self.format(record)}\n")

    def keep(self, text: str) -> None:
        """A line of its own."""
        self.emit(logging.makeLogRecord({"msg": "%s", "args": (text,)}))

    def tell(self, text: str) -> None:
        """The same, on standard error too."""
        self.keep(text)
        tell(text)


@contextmanager
def logged(folder: Path, wanted: bool) -> Iterator[Sequence[Any]]:
    """Inside, if it is wanted, notices also go to `steps.log` in a folder; gives the observers that make some
    of every step. What ends the run early is a line too.
    """
    if not wanted:
        yield ()
        return
    file = _File(folder / NAME)
    within = Seldom(file.tell, SILENCE)
    with listening(file, logging.INFO), listening(within, logging.DEBUG, WITHIN):
        try:
            yield (Steps(within),)
        except BaseException as error:
            if file.path.exists():  # else nothing was begun
                text = f"ended: {error or type(error).__name__}"
                file.keep(text)
            raise
