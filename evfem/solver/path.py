r"""Time (load) step error by step doubling, where the result depends on the path: with friction and time.

Friction is counted from the last accepted state and viscosity is integrated by backward Euler, so a step of
length h has the local error :math:`c h^2`: one substep from a to b ends at another state than two halves, and
their difference :math:`c h^2 - 2 c (h/2)^2 = c h^2 / 2` is the error of the two halves, which are accepted.
With inertia, of second order in time, that overestimates the error. The largest admissible substep is
:math:`\sqrt{e_{allowed} / e}` times as long. Iterations of the one substep begin at the end of the two, so
that the estimate costs little. Substeps end where what is prescribed turns: a pulse between their ends is
seen neither by one nor by two. The first substep of a scene is short: from the undeformed state, one substep
and two halves agree where every node slips in both, and neither has the nodes that stick with finer steps.

The error is that of the forces on the bone, relative to the largest, and of the bone's translation, relative
to its largest component. Errors of earlier substeps fade where all nodes slip.

Source: Hairer, Norsett & Wanner, Solving Ordinary Differential Equations I, 2nd ed., section II.4.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from evfem.common.constants import PATH_CHANGE, PATH_FIRST, PATH_SAFETY, SMALLEST_FORCE
from evfem.newton.control import Target
from evfem.newton.state import State
from evfem.newton.strategy import Strategy

#: from the fraction of a step that is done (0 to 1) and the next one to the target there
Path = Callable[[float, float], Target]
#: the equilibrium at a target from a state, its iterations begun at another one
Solve = Callable[[State, Target, State | None], State]
#: substeps that were solved one after the other: their targets and ends
Solved = list[tuple[Target, State]]


class Whole:
    """A substep is one equilibrium; its length follows how many iterations that takes."""

    #: whether errors of substeps are measured
    measures: ClassVar[bool] = False

    def first(self, substep: float) -> float:
        """The first substep of a run, as a fraction of its step."""
        return substep

    def solve(
        self, solve: Solve, state: State, path: Path, span: tuple[float, float]
    ) -> tuple[Solved, float]:
        """The equilibria of a substep over the `span` of a step, and their error."""
        target = path(*span)
        return [(target, solve(state, target, None))], 0.0

    def shorter_length(self, error: float, length: float, strategy: Strategy) -> float | None:
        """A shorter length to be tried instead of one with this error, None if that is accepted."""
        return None

    def next_substep(
        self, substep: float, length: float, error: float, easy: bool, strategy: Strategy
    ) -> float:
        """The next substep after one of this length and error; `easy`: it took few iterations."""
        return min(1.0, strategy.growth * substep) if easy else substep

    def spans(self, calls: list[tuple[float, float]]) -> list[tuple[float, float]]:
        """Spans of the equilibria accepted last, of all that were computed."""
        return calls[-1:]

    @property
    def told(self) -> dict[str, float]:
        """Entries of the provenance of a run."""
        return {}


@dataclass
class Halves(Whole):
    """A substep is two halves whose end differs from that of one whole by at most `allowed`; the `largest`
    difference so far.
    """

    allowed: float
    largest: float = 0.0
    measures = True

    def first(self, substep: float) -> float:
        return PATH_FIRST

    def solve(
        self, solve: Solve, state: State, path: Path, span: tuple[float, float]
    ) -> tuple[Solved, float]:
        whole, middle = path(*span), 0.5 * (span[0] + span[1])
        first, second = path(span[0], middle), path(middle, span[1])
        half = solve(state, first, None)
        end = solve(half, second, None)
        return [(first, half), (second, end)], relative_difference(solve(state, whole, end), end)

    def shorter_length(self, error: float, length: float, strategy: Strategy) -> float | None:
        if error <= self.allowed or length <= strategy.smallest_part + 1e-12:
            self.largest = max(self.largest, error)
            return None
        return max(length_factor(error / self.allowed) * length, strategy.smallest_part)

    def next_substep(
        self, substep: float, length: float, error: float, easy: bool, strategy: Strategy
    ) -> float:
        """One that was shortened to hit the end of a step does not shorten the next."""
        cut = length < (1.0 - 1e-9) * substep
        wanted = max(length_factor(error / self.allowed) * length, strategy.smallest_part)
        return min(1.0, max(wanted, substep) if cut else wanted)

    def spans(self, calls: list[tuple[float, float]]) -> list[tuple[float, float]]:
        return calls[-2:]

    @property
    def told(self) -> dict[str, float]:
        return {"path_error": self.largest}


def relative_difference(once: State, twice: State) -> float:
    """Relative difference between the ends of one substep and of its two halves."""
    forces = np.abs(once.reaction - twice.reaction).max()
    positions = np.abs(once.bone - twice.bone).max()
    moved = np.abs(twice.bone).max()
    relative = forces / max(np.abs(twice.reaction).max(), SMALLEST_FORCE)
    return float(max(relative, positions / moved if positions > 0.0 else 0.0))


def length_factor(error: float) -> float:
    """Length of the next substep relative to one whose error is this fraction of the allowed one.

    >>> length_factor(0.0), round(length_factor(1.0), 3), length_factor(1e6)
    (4.0, 0.9, 0.25)
    """
    if error <= PATH_SAFETY**2 / PATH_CHANGE**2:
        return PATH_CHANGE
    return max(PATH_SAFETY / float(np.sqrt(error)), 1.0 / PATH_CHANGE)
