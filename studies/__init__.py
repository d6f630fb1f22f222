"""Studies: a module per figure of the paper or question, each with `main(quick, out) -> dict`."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from evfem.errors import InputError, quoted

#: every study, in the order in which "all" runs them; it leaves out `APART`
NAMED = """
section321 laws fringe fingertip fingerprint fig05 fig06 fig07 fig08 fig09 fig10 fig11 fig12 fig13
participants uncertainty frequency hypotheses friction_spectrum stick_slip relaxation impedance
stability work_precision peers campaign
"""
NAMES = tuple(NAMED.split())
#: studies that "all" leaves out: one needs packages of others, one takes hours
APART = ("peers", "campaign")
#: studies that have a folder of their own, and the module in it that runs them
MODULES = {
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
                raise InputError(key, quoted(value), f"a whole number, at least {least}")


def run(
    name: str, quick: bool = False, out: Path | None = None, sample: Sample | None = None
) -> dict[str, Any]:
    """Run the study `name`; with `out`, write NAME.json, NAME.csv and NAME.png into that folder.

    `sample` is for `campaign` alone. Returns the dictionary with study, numbers, paper,
    assumptions and provenance.
    """
    if name not in NAMES:
        raise InputError("study", quoted(name), ", ".join(NAMES))
    if sample is not None and name != "campaign":
        raise InputError(
            "study", f"scenes, seed, workers or limit for {name}", "these options with campaign alone"
        )
    main = import_module(f".{MODULES.get(name, name)}", __package__).main
    return main(quick=quick, out=out) if sample is None else main(quick=quick, out=out, sample=sample)
