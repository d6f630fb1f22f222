"""Studies: a module per figure of the paper or question, each with `main(quick) -> Study`."""

import csv
import time
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from evfem.errors import InputError, describe_value

#: every study, in the order in which "all" runs them; it leaves out `APART`
NAMED = """
section321 laws fringe fingertip fingerprint fig03 fig05 fig06 fig07 fig08 fig09 fig10 fig11 fig12 fig13
participants uncertainty frequency hypotheses friction_spectrum stick_slip bandwidth relaxation impedance
sensitivities soft_display moisture measured stability work_precision peers campaign
"""
NAMES = tuple(NAMED.split())
#: studies that "all" leaves out: one needs packages of others, one takes hours
APART = ("peers", "campaign")
#: studies that have a folder of their own, and the module in it that runs them
MODULES = {
    "measured": "measured.study",
    "stability": "stability.study",
    "work_precision": "precision.study",
    "peers": "peers.study",
    "campaign": "campaign.study",
}


@dataclass(frozen=True)
class Sample:
    """What a study that draws scenes draws: how many (None: its own number), of which seed, in how
    many processes (None: one for each core), and the CPU seconds after which a scene is given up.
    """

    scenes: int | None = None
    seed: int = 0
    workers: int | None = None
    limit: int = 60

    def __post_init__(self) -> None:
        for key, least in (("scenes", 1), ("seed", 0), ("workers", 1), ("limit", 1)):
            value = getattr(self, key)
            if value is not None and value < least:
                raise InputError(key, describe_value(value), f"a whole number, at least {least}")


def run(
    name: str, quick: bool = False, out: Path | None = None, sample: Sample | None = None
) -> dict[str, Any]:
    """Run the study `name`; with `out`, write NAME.json, NAME.csv and NAME.png into that folder.

    `sample` is for `campaign` alone. Returns the dictionary with study, numbers, paper,
    assumptions and provenance.
    """
    if name not in NAMES:
        raise InputError("study", describe_value(name), ", ".join(NAMES))
    if sample is not None and name != "campaign":
        raise InputError(
            "study", f"scenes, seed, workers or limit for {name}", "these options with campaign alone"
        )
    from .common import BEGIN, ready

    more = {"out": out, "sample": sample or Sample()} if name == "campaign" else {}
    token = BEGIN.set(time.perf_counter())
    try:
        with ready(out):
            return module(name).main(quick, **more).finish(out, quick)  # type: ignore[no-any-return]
    finally:
        BEGIN.reset(token)


def module(name: str) -> Any:
    """The module that runs a study."""
    return import_module(f".{MODULES.get(name, name)}", __package__)


def beside_the_paper(result: Mapping[str, Any]) -> str:
    """A line for each number that the paper prints, beside the study's, and why they differ."""
    from .printed import rows_of, told

    rows = rows_of(result)
    return f"{told(rows)}\n" if rows else ""


def report(folder: Path) -> list[Path]:
    """Write paper.md and paper.html from the studies' files in the folder."""
    from .paper import write

    return write(folder)


def title(name: str) -> str:
    """What a study is about: the first sentence of its module."""
    return " ".join((module(name).__doc__ or name).split("\n\n")[0].split()).removesuffix(".")


def expected(name: str, quick: bool = False) -> str:
    """How long a study takes, in words; how long it took is in seconds.csv.

    >>> expected("fig09")
    'a few seconds'
    """
    with (Path(__file__).parent / "seconds.csv").open(newline="", encoding="utf-8") as file:
        took = {row["study"]: row["quick" if quick else "whole"] for row in csv.DictReader(file)}
    if not took.get(name):
        return "not measured how long"
    seconds = float(took[name])
    return (
        "a few seconds"
        if seconds < 10.0
        else f"about {seconds:.0f} s"
        if seconds < 100.0
        else minutes(seconds)
    )


def minutes(seconds: float) -> str:
    """A time of minutes or hours in words."""
    return f"about {seconds / 60.0:.0f} min" if seconds < 5400.0 else f"about {seconds / 3600.0:.0f} h"
