"""How hard steps are tried: the numbers behind globalisation and adaptive parts, all in one place.

A step is one equilibrium from one accepted state to the next. It is tried whole first. Where it fails, it is
cut into parts: half as long after each failure, longer again after easy ones. What makes the iterations of
one part hold is not a choice: contact is solved exactly in each of them, cells cannot collapse, an attraction
that the body cannot hold is followed in small moves or snaps, and under a force the bone moves by limited
strides. Ill-posed scenes (sliding over texture, brittle snap-through) need physics instead: `dynamics`
"viscous" or "inertial" with a speed.
"""

from __future__ import annotations

from dataclasses import dataclass

from evfem.common.checks import count, real, set_frozen


@dataclass(frozen=True)
class Strategy:
    """The defaults need no tuning in any scene of `evfem study stability`.

    `iterations`: most of one part; `patience`: renew the factorisation when more iterations than this would
    be left with the old one; `smallest_part`: of a requested step, before it counts as not converged;
    `easy`: a part with so few iterations lets the next one grow by the factor `growth`; `reach`: a part
    begins at most so many times the last one's displacements ahead (0: at the last state).

    >>> Strategy().iterations, Strategy(growth=2.0).growth
    (40, 2.0)
    >>> Strategy(smallest_part=2.0)
    Traceback (most recent call last):
    evfem.errors.InputError: smallest_part: given 2.0; allowed: a share of a step, above 0, at most 1
    """

    iterations: int = 40
    patience: float = 8.0
    smallest_part: float = 1.0 / 1024.0
    easy: int = 8
    growth: float = 1.25
    reach: float = 1.5

    def __post_init__(self) -> None:
        part, waits = "a share of a step, above 0, at most 1", "a number of iterations, not negative"
        set_frozen(
            self,
            iterations=count("iterations", self.iterations, 10_000),
            patience=real("patience", self.patience, waits, lambda n: n >= 0),
            smallest_part=real("smallest_part", self.smallest_part, part, lambda s: 0.0 < s <= 1.0),
            easy=count("easy", self.easy, 10_000),
            growth=real("growth", self.growth, "a factor from 1 to 10", lambda f: 1.0 <= f <= 10.0),
            reach=real("reach", self.reach, "a factor from 0 to 10", lambda f: 0.0 <= f <= 10.0),
        )
