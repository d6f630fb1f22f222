"""What the package tells a person who waits: lines, progress bars, and a status that goes when it
is done.

Lines and details are records of the logger `evfem`, so that a caller may show them in another way:
INFO is worth a line, DEBUG only counts ("step 3 of 60"). Nothing is coloured. Everything goes to
standard error.
"""

from __future__ import annotations

import logging
import os
import shutil
import sys
import textwrap
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Event, Thread
from typing import Any, TextIO

LOG = logging.getLogger("evfem")
#: seconds before a status shows, and between its changes
PATIENCE, EVERY = 1.0, 0.5


def wrapped(text: str, stream: TextIO) -> str:
    """`text` broken between words where `stream` is a terminal, as it is elsewhere: files keep
    their lines.

    >>> import io
    >>> wrapped("one sentence " * 20, io.StringIO()).count(chr(10))
    0
    """
    if not stream.isatty():
        return text
    columns = max(shutil.get_terminal_size().columns, 40)
    return textwrap.fill(
        text, columns - 1, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False
    )


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


class _Lines(logging.Handler):
    """Notices as lines."""

    def emit(self, record: logging.LogRecord) -> None:
        tell(record.getMessage())


@contextmanager
def listening(handler: logging.Handler, level: int) -> Iterator[None]:
    """Inside, `handler` gets the package's notices from `level` on."""
    before = LOG.level
    handler.setLevel(level)
    LOG.addHandler(handler)
    LOG.setLevel(min(level, before) if before else level)
    try:
        yield
    finally:
        LOG.removeHandler(handler)
        LOG.setLevel(before)


@contextmanager
def shown(wanted: bool = True) -> Iterator[None]:
    """Inside, notices are lines on standard error; once, however often this is nested."""
    if not wanted or any(isinstance(handler, _Lines) for handler in LOG.handlers):
        yield
        return
    with listening(_Lines(), logging.INFO):
        yield


class _NoBar:
    """What is done with a bar, and nothing to see."""

    leave = False

    def __enter__(self) -> _NoBar:
        return self

    def __exit__(self, *reason: object) -> None:
        return

    def update(self, steps: int = 1) -> None:
        """Steps are done."""

    def set_postfix_str(self, text: str, refresh: bool = True) -> None:
        """Something to say behind the bar."""

    def close(self) -> None:
        """No more to come."""


def bar(total: int, unit: str, done: int = 0, wanted: bool = True) -> Any:
    """A progress bar (tqdm) with the time that is left, in a notebook a widget; one that is not
    `wanted` draws nothing, and does not load what would draw it.
    """
    if not wanted:
        return _NoBar()
    from tqdm.auto import tqdm

    form = "{percentage:3.0f}%|{bar}| {n_fmt}/{total_fmt} [{elapsed}, {remaining} left, {rate_fmt}{postfix}]"
    return tqdm(total=total, initial=done, unit=unit, ncols=_columns(), bar_format=form)


def milestone(unit: str, done: int, total: int) -> None:
    """A line for every tenth of the work, where a bar has no place."""
    if done * 10 // total > (done - 1) * 10 // total:
        print(f"{unit} {done} of {total}", file=sys.stderr, flush=True)


def drawable() -> bool:
    """Whether standard error is a place for a bar: a terminal or a notebook."""
    return sys.stderr.isatty() or "ipykernel" in sys.modules


def _columns() -> int | None:
    """None leaves the width to tqdm, which draws nothing in a terminal that says it is 0 columns
    wide.
    """
    try:
        known = os.get_terminal_size(sys.stderr.fileno()).columns > 0
    except (OSError, ValueError, AttributeError):  # no terminal
        return None
    return None if known else shutil.get_terminal_size().columns


class _Newest(logging.Handler):
    """Remembers the newest notice."""

    text = ""

    def emit(self, record: logging.LogRecord) -> None:
        self.text = record.getMessage()


@contextmanager
def status(label: str) -> Iterator[None]:
    """Inside, a terminal shows `label`, the seconds so far and the newest detail, after a second
    of waiting.

    Elsewhere nothing is shown.
    """
    if not sys.stderr.isatty():
        yield
        return
    newest, over = _Newest(), Event()
    ticker = Thread(target=_tick, args=(label, newest, over), daemon=True)
    with listening(newest, logging.DEBUG):
        ticker.start()
        try:
            yield
        finally:
            over.set()
            ticker.join()


def _tick(label: str, newest: _Newest, over: Event) -> None:
    from tqdm import tqdm

    if over.wait(PATIENCE):
        return
    form = "{desc} [{elapsed}]{postfix}"
    with tqdm(desc=label, bar_format=form, leave=False, ncols=_columns(), file=sys.stderr) as line:
        line.start_t -= PATIENCE
        while True:
            line.set_postfix_str(newest.text)
            if over.wait(EVERY):
                return
