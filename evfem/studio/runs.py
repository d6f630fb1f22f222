"""A run of the model for the page, in a process of its own that ends when nobody listens any more.

The process sends a line per step, then the friction curve with a picture of the deformed pad, then a moving
picture; where the exact voltage is asked for, that voltage after the curve. Who asked reads them; when the
page is closed or the run is cancelled, the next line cannot be sent and the process is ended.
"""

from __future__ import annotations

import base64
import io
import os
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from multiprocessing.connection import Connection
from typing import Any

from evfem.common.pools import Worker
from evfem.common.storage import passing_folder
from evfem.errors import EvfemError, InputError
from evfem.protocols import Observer
from evfem.studio.state import State, parse

#: runs at the same time, seconds between two signs of life, pictures of the animation
MOST_RUNS, EVERY, PICTURES = 2, 0.2, 10
#: what the last line of a run has
LAST = frozenset({"animation", "exact", "error"})
_PLACES = threading.BoundedSemaphore(MOST_RUNS)


def run(text: str, exact: bool, send: Callable[[dict[str, Any]], None]) -> None:
    """Run the model for a state, and find the `exact` voltage; `send` lines until that raises OSError."""
    parse(text)
    if not _PLACES.acquire(blocking=False):
        allowed = f"{MOST_RUNS} at a time: wait until one has ended"
        raise InputError("run", f"one more beside {MOST_RUNS}", allowed)
    with ExitStack() as stack:
        stack.callback(_PLACES.release)
        worker = Worker(_work, text, exact)
        stack.callback(worker.end)
        ended = False  # signs of life may follow the last line while the process goes
        with suppress(EOFError):
            while True:
                line = worker.line.recv() if worker.line.poll(EVERY) else {"alive": True}
                ended = ended or not LAST.isdisjoint(line)
                send(line)
        if not ended:
            send({"error": "the run ended without a result; perhaps the memory was not enough"})


class _Steps:
    """Observer that tells how far the run is."""

    def __init__(self, send: Callable[[dict[str, Any]], None]) -> None:
        self.send = send

    def started(self, mesh: object, scene: object, total_steps: int) -> None:
        """The run begins."""
        self.total = total_steps
        self.send({"step": 0, "of": total_steps})

    def step(self, row: Any, frame: object, checkpoint: object) -> None:
        """A step has converged."""
        self.send({"step": int(row["step"]), "of": self.total})


def _work(line: Connection, text: str, exact: bool) -> None:
    os.environ["MPLBACKEND"] = "agg"
    try:
        for found in _found(parse(text), exact, _Steps(line.send)):
            line.send(found)
    except EvfemError as error:
        line.send({"error": str(error)})


def _found(state: State, exact: bool, observer: Observer) -> Iterator[dict[str, Any]]:
    from evfem.estimate.display import exact_voltage
    from evfem.estimate.rendering import record
    from evfem.estimate.touch import friction_of, from_texture, touch_scene

    steps = sum(one.steps for one in touch_scene(state.texture, state.touch).motion)
    every = 0 if exact else max(steps // PICTURES, 1)
    reference = record(touch_scene(state.texture, state.touch, every=every), (observer,))
    curve = friction_of(reference.result)
    yield {"curve": {"x": curve.x.round(6).tolist(), "friction": curve.friction.round(7).tolist()}}
    if exact:
        found = exact_voltage(reference, state.device)[0]
        digits = {"x": 6, "voltage": 4, "friction": 7}
        yield {"exact": {name: getattr(found, name).round(n).tolist() for name, n in digits.items()}}
    else:
        shown = from_texture(reference.result)
        yield {"picture": _picture(shown)}
        yield {"animation": _animation(shown)}


def _picture(result: Any) -> str:
    """The deformed pad near its contact as a PNG in base 64."""
    from evfem.plotting.finger import deformed

    figure: Any = deformed(result, near="contact").figure
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=110)
    return base64.b64encode(buffer.getvalue()).decode()


def _animation(result: Any) -> str:
    """The frames of the slide as a GIF in base 64."""
    from evfem.plotting.movie import animate

    with passing_folder() as folder:
        path = animate(result, folder / "slide.gif", near="contact", progress=False)
        return base64.b64encode(path.read_bytes()).decode()
