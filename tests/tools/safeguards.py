"""Safeguards of the solver (`evfem.solver`), each with what switches it off in this process.

`same_ends.py record OUT.csv --without NAME` runs drawn scenes so. Those whose ends, parts or
iterations do not change have no need of it.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from evfem.common import constants
from evfem.contact import solve
from evfem.contact.follower import Candidates
from evfem.newton import equilibrium
from evfem.newton.anderson import Anderson
from evfem.newton.factorised import FactorisedBody
from evfem.newton.interface import FrictionJumps, Interface
from evfem.newton.travel import Travel
from evfem.solver import stepping
from evfem.terms import traction
from evfem.terms.slipping import OscillatingNodes


class Forgetful(set[bytes]):
    """A set that knows nothing of what was added."""

    def __contains__(self, one: object) -> bool:
        return False


def of_scene(scene: Any, **changed: Any) -> Any:
    """The scene with another strategy."""
    return replace(scene, solver=replace(scene.solver, strategy=replace(scene.solver.strategy, **changed)))


def _patched(owner: Any, **changed: Any) -> Callable[[], None]:
    def patch() -> None:
        for name, value in changed.items():
            setattr(owner, name, value)

    return patch


def _without_slope() -> None:
    whole = Interface.candidates

    def candidates(self: Interface, *given: Any) -> Candidates:
        known = whole(self, *given)
        return replace(known, friction_slope=0.0 * known.friction_slope)

    Interface.candidates = candidates  # type: ignore[method-assign]


def _without_follower() -> None:
    whole = Candidates.follower_rate
    Candidates.follower_rate = lambda self, own: 0.0 * whole(self, own)  # type: ignore[method-assign]


def _without_limit_of_travel() -> None:
    constants.LARGEST_BONE_INCREMENT = 1e9
    Travel._pulled_against_force = lambda self, step, travel: False  # type: ignore[method-assign]


def _without_the_worst_node() -> None:
    solve.set = Forgetful  # type: ignore[attr-defined]


#: name -> what switches it off, before a scene is simulated
SAFEGUARDS: dict[str, Callable[[], None]] = {
    "slope": _without_slope,
    "follower": _without_follower,
    "softening": _patched(solve, _feedback=lambda *given: 0.0),
    "gain": _patched(traction, limited_gain=lambda gain: gain),
    "brackets": _patched(OscillatingNodes, watch=lambda *given: None),
    "pins": _patched(FrictionJumps, _pin=lambda *given: None),
    "coarser": _patched(stepping, COARSER=1.0),
    "travel": _without_limit_of_travel,
    "worst": _without_the_worst_node,
    "damped": _patched(solve, _damped_status_change=lambda before, after: after),
    "stuck": _patched(equilibrium, stuck=lambda history: False),
    "combined": _patched(Anderson, next_iterate=lambda self, before, after: after),
    "volume": _patched(constants, SMALLEST_J=-float("inf")),
    "stability": _patched(FactorisedBody, leaves=lambda *given: None),
    "barrier": _patched(stepping.Stepper, _crosses_barrier=lambda *given: False),
    "fold": _patched(Interface, fold=lambda *given: None),
    "rounds": _patched(constants, CANDIDATE_ROUNDS=0),
}
#: name -> the strategy without it
STRATEGIES: dict[str, dict[str, Any]] = {
    "kept": {"patience": 0.0},
    "predicted": {"reach": 0.0},
    "release": {"relaxation": False},
}
