"""A campaign as it runs: processes that take the next scene, with a limit of its CPU time.

On disk stand, after every scene, `campaign/ends.csv` with a row per scene, and in
`campaign/failures/` each scene that ended badly as it was drawn, complete in itself.
"""

import signal
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path

from evfem.common import notices
from evfem.common.pools import Died, processes
from evfem.common.storage import write_text
from evfem.common.tables import csv_text

from ..common import make_folder
from ..stability.case import warm_up
from .drawing import draw
from .ending import Ending, judge
from .tables import put_mesh, text_of

Key = tuple[int, int]
COLUMNS = [spec.name for spec in fields(Ending)]


def run(keys: Sequence[Key], folder: Path | None, workers: int, limit_s: float) -> list[Ending]:
    """Judge the scenes, each with at most `limit_s` CPU seconds; what is done is in `folder`."""
    ends: dict[Key, Ending] = {}
    with processes(workers) as pool, notices.bar(len(keys), "scene", 0, notices.drawable()) as bar:
        for key, found in pool(judged, {key: (key, limit_s) for key in keys}):
            ending = _lost(found, limit_s) if isinstance(found, Exception) else found
            requested = sum(motion["steps"] for motion in draw(*key)["motion"])
            ends[key] = replace(ending, requested=requested)
            if folder is not None:
                keep(folder, ends, key)
            bar.update(1)
            if not notices.drawable():
                notices.milestone("scene", len(ends), len(keys))
    return [ends[key] for key in keys]


def judged(task: tuple[Key, float]) -> Ending:
    """How a scene ends; beyond so many CPU seconds, which do not depend on what else the machine
    does, this process does.
    """
    key, limit_s = task
    warm_up()
    signal.setitimer(signal.ITIMER_PROF, limit_s)
    try:
        return judge(draw(*key))
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)


def _lost(error: Exception, limit_s: float) -> Ending:
    """The end of a scene whose process has none for it: it came to its limit, or died."""
    if not isinstance(error, Died):
        raise error
    if error.status == -signal.SIGPROF:
        said = f"not at its end after {limit_s:g} CPU seconds"
        return Ending("timeout", said, "timeout", cpu_s=limit_s)
    return Ending("error", f"the process died with status {error.status}", "process died")


def keep(folder: Path, ends: Mapping[Key, Ending], last: Key) -> None:
    """The table of ends so far, and the last scene if it failed, headed by how it ended."""
    rows = [[*key, *(getattr(end, name) for name in COLUMNS)] for key, end in sorted(ends.items())]
    write_text(make_folder(folder) / "ends.csv", csv_text([["seed", "scene", *COLUMNS], *rows]))
    ending, (seed, number) = ends[last], last
    file = make_folder(folder / "failures") / f"seed{seed}-scene{number:04d}.toml"
    file.unlink(missing_ok=True)
    if not ending.good:
        said = textwrap.wrap(f"seed {seed}, scene {number}: {ending.outcome}; {ending.said}", 96)
        put_mesh(draw(*last), file.parent)
        write_text(file, "".join(f"# {line}\n" for line in said) + text_of(draw(*last)))
