"""What was tried to make evfem faster: prediction, measurement, kept or dropped.

Measured once each, on 2026-11-21 during development, in CPU time on a loaded machine: only ratios mean
anything, and the study does not repeat them.
"""

from __future__ import annotations

from dataclasses import dataclass

MEASURED = "measured on 2026-11-21 during development, CPU time on a loaded machine; only ratios count"


@dataclass(frozen=True)
class Idea:
    """An idea, what was expected of it, what was measured, and whether it was kept.

    `before`, `after` in the same `unit`: what was measured of it first.
    """

    name: str
    prediction: str
    measurement: str
    kept: bool
    before: float | None = None
    after: float | None = None
    unit: str = ""


IDEAS = (
    Idea(
        "cells in blocks of 16 lanes",
        "4 times faster loops",
        "L2 linear: forces 10.7 to 2.9 ms, tangent 24 to 9 ms, energy 18 to 2.4 ms",
        True,
        10.7,
        2.9,
        "ms",
    ),
    Idea(
        "steps begin along the last step's displacements",
        "fewer iterations in full slip",
        "full slip: 1 to 0-1 iterations per step; L2 B: 46 to 37 factorisations",
        True,
        46.0,
        37.0,
        "factorisations",
    ),
    Idea(
        "Anderson mixing within a step, depth 3",
        "fewer iterations with an old factorisation",
        "iterations -5 %, L2 B: 37 to 30 factorisations",
        True,
        37.0,
        30.0,
        "factorisations",
    ),
    Idea(
        "factorisation renewed later (patience 5 to 8)",
        "fewer factorisations",
        "L2 A: 5.06 to 4.50 s; L2 B: 11.3 to 10.2 s",
        True,
        11.3,
        10.2,
        "s",
    ),
    Idea(
        "half again as many candidates as needed",
        "fewer analyses of the matrix",
        "L2 A: 6 to 3 analyses",
        True,
        6.0,
        3.0,
        "analyses",
    ),
    Idea(
        "Cholesky instead of LU for the compliance",
        "a third of the time",
        "336 unknowns: 13 to 5.5 ms",
        True,
        13.0,
        5.5,
        "ms",
    ),
    Idea(
        "faint changes of tributary lengths left to the iterations",
        "a symmetric compliance",
        "Table 2's finger at 1000 V, 110 steps: 17.7 to 13.6 s, 159 to 118 iterations",
        True,
        17.7,
        13.6,
        "s",
    ),
    Idea(
        "extrapolation of second order",
        "a better guess",
        "L2 B: 209 to 242 iterations, 22 to 19 factorisations: nodes come and go in every step",
        False,
        209.0,
        242.0,
        "iterations",
    ),
    Idea(
        "secants of earlier steps in the mixing",
        "the first iterations of a step gain",
        "L2 B: 209 to 235 (depth 3) and 266 (depth 10) iterations",
        False,
        209.0,
        235.0,
        "iterations",
    ),
    Idea(
        "factorisation in float32",
        "half the time",
        "83 to 67 ms, and the Schur complement is off by 7e-4",
        False,
        83.0,
        67.0,
        "ms",
    ),
    Idea(
        "other orderings in PARDISO",
        "less fill",
        "none better than METIS",
        False,
    ),
)


def numbers() -> dict[str, float]:
    """Ratios after over before, where both were measured."""
    found = {}
    for idea in IDEAS:
        if idea.before and idea.after:
            name = idea.name.split(" (")[0].replace(" ", "_").replace(",", "").replace("'", "")
            found[f"ideas.{name}.after_over_before"] = idea.after / idea.before
    return found


def table() -> list[str]:
    """The ideas as lines of a Markdown table."""
    lines = ["| idea | prediction | measurement | |", "|---|---|---|---|"]
    for idea in IDEAS:
        verdict = "kept" if idea.kept else "dropped"
        lines.append(f"| {idea.name} | {idea.prediction} | {idea.measurement} | {verdict} |")
    return lines
