"""What the package tells a person who waits: lines, progress bars, and a status that goes when it is done.

Lines and details are records of the logger `evfem`, so that a caller may show them in another way: INFO is
worth a line, DEBUG only counts ("step 3 of 60"). What happens within a step goes to `evfem.within`, which
hands nothing on. Nothing is coloured. Everything goes to standard error.
"""

from __future__ import annotations

import logging
import shutil
import sys
import textwrap
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, nullcontext
from typing import Any, TextIO

from evfem.errors import InputError, StopRun, describe_value

LOG = logging.getLogger("evfem")
#: iterations of one step
WITHIN = logging.getLogger("evfem.within")
WITHIN.propagate = False
#: seconds after which a bar shows another of these
GLANCE = 0.5


def wrapped(text: str, stream: TextIO) -> str:
    """`text` broken between words where `stream` is a terminal; files keep their lines."""
    if not stream.isatty():
        return text
    columns = max(shutil.get_terminal_size().columns, 40)
    whole: Any = {"break_long_words": False, "break_on_hyphens": False}
    return textwrap.fill(text, columns - 1, subsequent_indent="  ", **whole)


def warn(text: str) -> None:
    """A warning that points at the user's line: the innermost one outside the package."""
    frame, level = sys._getframe(), 1
    while frame.f_back is not None and frame.f_globals.get("__name__", "").split(".")[0] == "evfem":
        frame, level = frame.f_back, level + 1
    warnings.warn(text, stacklevel=level)


def tell(text: str) -> None:
    """A line on standard error, above a bar that is being drawn."""
    from tqdm import tqdm

    tqdm.write(wrapped(f"evfem: {text}", sys.stderr), file=sys.stderr)


class _Told(logging.Handler):
    def __init__(self, tell: Callable[[str], None]) -> None:
        super().__init__()
        self.tell = tell

    def emit(self, record: logging.LogRecord) -> None:
        self.tell(record.getMessage())


class Seldom(_Told):
    """Tells only what comes `seconds` after the time `last`, that of what it told last."""

    def __init__(self, tell: Callable[[str], None], seconds: float) -> None:
        super().__init__(tell)
        self.seconds, self.last = seconds, time.time()

    def emit(self, record: logging.LogRecord) -> None:
        if record.created - self.last >= self.seconds:
            self.last = record.created
            super().emit(record)


@contextmanager
def listening(handler: logging.Handler, level: int, log: logging.Logger = LOG) -> Iterator[None]:
    """Inside, `handler` gets the notices of `log` from `level` on."""
    before = log.level
    handler.setLevel(level)
    log.addHandler(handler)
    log.setLevel(min(level, before) if before else level)
    try:
        yield
    finally:
        log.removeHandler(handler)
        log.setLevel(before)


@contextmanager
def shown(wanted: bool = True) -> Iterator[None]:
    """Inside, notices are lines on standard error; once, however often this is nested."""
    again = any(getattr(handler, "tell", None) is tell for handler in LOG.handlers)
    with listening(_Told(tell), logging.INFO) if wanted and not again else nullcontext():
        yield


class _NoBar(ExitStack):
    """A progress bar that shows nothing."""

    leave = False
    update = set_postfix_str = staticmethod(lambda *told, **how: None)


def bar(total: int, unit: str, done: int = 0, wanted: bool = True) -> Any:
    """A progress bar (tqdm) with the time left, in a notebook a widget; without tqdm if not `wanted`."""
    if not wanted:
        return _NoBar()
    from tqdm.auto import tqdm

    form = "{percentage:3.0f}%|{bar}| {n_fmt}/{total_fmt} [{elapsed}, {remaining} left, {rate_fmt}{postfix}]"
    # tqdm draws nothing in a terminal that says it is 0 columns wide; a notebook would take them for pixels
    columns = None if "ipykernel" in sys.modules else shutil.get_terminal_size().columns
    return tqdm(total=total, initial=done, unit=unit, ncols=columns, bar_format=form)


@contextmanager
def told_on(bar: Any) -> Iterator[None]:
    """Inside, a bar that is shown has beside it how far the step is."""
    if isinstance(bar, _NoBar):
        yield
        return
    with listening(Seldom(bar.set_postfix_str, GLANCE), logging.DEBUG, WITHIN):
        yield


def milestone(unit: str, done: int, total: int) -> None:
    """A line for every tenth of the work, where a bar has no place."""
    if done * 10 // total > (done - 1) * 10 // total:
        print(f"{unit} {done} of {total}", file=sys.stderr, flush=True)


def drawable() -> bool:
    """Whether standard error is a place for a bar: a terminal or a notebook."""
    return sys.stderr.isatty() or "ipykernel" in sys.modules


@contextmanager
def status(label: str) -> Iterator[None]:
    """Inside, a terminal shows `label` and the newest detail. Elsewhere nothing is shown."""
    if not sys.stderr.isatty():
        yield
        return
    from tqdm import tqdm

    columns = shutil.get_terminal_size().columns
    line = tqdm(desc=label, bar_format="{desc}{postfix}", leave=False, ncols=columns)

    def newest(text: str) -> None:
        line.set_postfix_str(text, refresh=False)
        line.update()

    with line, listening(_Told(newest), logging.DEBUG):
        yield


def check_observers(observers: Sequence[object]) -> None:
    """Raise InputError for an object that would be told of nothing."""
    allowed = (
        "an object with started(mesh, scene, total_steps), step(row, frame, checkpoint), finished(result)"
    )
    if not isinstance(observers, Iterable):
        raise InputError("observers", describe_value(observers), f"a list of observers, each {allowed}")
    for i, observer in enumerate(observers):
        if not any(hasattr(observer, event) for event in ("started", "step", "finished")):
            raise InputError(f"observers[{i}]", describe_value(observer), allowed)


def tell_observers(observers: Sequence[object], event: str, *arguments: Any) -> list[str]:
    """Tell every observer; the reasons of those who want the run to end."""
    reasons = []
    for observer in observers:
        try:
            getattr(observer, event, lambda *_: None)(*arguments)
        except StopRun as stop:
            if event != "step":
                raise
            reasons.append(str(stop) or type(observer).__name__)
    return reasons
