"""Studies: a module per figure of the paper or numerical question, each with `main(quick, out) -> dict`."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

from evfem.errors import InputError

#: every study, in the order in which "all" runs them; it leaves `peers` out
NAMES = (
    "section321",
    "laws",
    "fig05",
    "fig06",
    "fig07",
    "fig08",
    "fig09",
    "fig10",
    "fig11",
    "fig12",
    "fig13",
    "participants",
    "uncertainty",
    "stability",
    "work_precision",
    "peers",
)
#: studies that have a folder of their own, and the module in it that runs them
MODULES = {"stability": "stability.study", "work_precision": "precision.study", "peers": "peers.study"}


def run(name: str, quick: bool = False, out: Path | None = None) -> dict[str, Any]:
    """Run the study `name`; with `out`, write NAME.json, NAME.csv and NAME.png into that folder.

    Returns the dictionary with study, numbers, paper, assumptions and provenance.
    """
    if name not in NAMES:
        raise InputError("study", name, ", ".join(NAMES))
    return import_module(f".{MODULES.get(name, name)}", __package__).main(quick=quick, out=out)
