"""What is said of a failed step: which force wins and where, if no equilibrium is near, what to try."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from evfem.common.constants import CRITICAL, SOFTENED
from evfem.errors import InputError
from evfem.newton.control import Target
from evfem.newton.state import Folded, LiftedOff, State, StepFailed
from evfem.planning.plausibility import weakens
from evfem.scene.scene import Scene
from evfem.simulation.model import Model


def advice(scene: Scene, model: Model, failed: StepFailed) -> str:
    """Why the step failed, how its last iterate looked, and what to try, joined by semicolons."""
    lost = _lost(model, failed)
    parts = [lost or failed.reason, failed.findings, _try(scene, failed, bool(lost))]
    return "; ".join(part for part in parts if part)


def _lost(model: Model, failed: StepFailed) -> str:
    """The sentence on the equilibrium that was lost; empty where nothing shows that there is none."""
    if isinstance(failed, Folded) or failed.last is None:
        return ""
    if isinstance(failed, LiftedOff):
        return f"{failed.reason}; it was lost at {_place(model, failed.last[0])}"
    state, target = failed.last
    try:
        with np.errstate(invalid="ignore"):  # a law of one's own may have become infinite
            margin = model.equilibrium.stability_ratio(state, target)
    except StepFailed:  # the tangent there is singular
        return ""
    # a trial far from equilibrium may give way too: alone that shows nothing
    if margin is None or margin.ratio < (SOFTENED if failed.unstable else CRITICAL):
        return ""
    passing = model.body.dynamics is not None and target.duration > 0.0
    rest = "within a time step as short as this" if passing else "at rest"
    released = ", and released there it does not come to rest" if failed.released else ""
    return (
        f"there is no equilibrium {rest} near here: {margin.cause}, {margin.ratio:.3g} times as hard as its "
        f"tissue holds it at {_place(model, state)}, and harder beyond{released}"
    )


def unheld(model: Model, state: State, rows: Sequence[Mapping[str, float]]) -> str:
    """The sentence on an equilibrium at a given gap that its voltage alone does not hold; empty where it may.

    In three dimensions the last two `rows` tell: the voltage falls as the gap closes.
    """
    margin = model.equilibrium.stability_ratio(state, Target.held(state.bone, state.voltage))
    if margin is None and len(rows) > 1:
        ways = [rows[-1][name] - rows[-2][name] for name in ("voltage", "min_gap")]
        lost = abs(rows[-2]["voltage"]) > 0.0 and ways[0] * np.sign(state.voltage) * ways[1] > 0.0
    else:
        lost = margin is not None and margin.ratio > 1.0
    if not lost:
        return ""
    return (
        f"the gap of {rows[-1]['min_gap']:.4g} mm was given, and {state.voltage:.4g} V alone do not hold it: "
        "the equilibrium is not stable, and where the finger goes from there is by chance"
    )


def _place(model: Model, state: State) -> str:
    """Position of the bone, its load and the voltage."""
    position, indentation = state.bone[0] + 0.0, model.indentation(state.bone) + 0.0
    load, voltage = -state.reaction[1] + 0.0, state.voltage + 0.0
    return (
        f"position {position:.4g} mm, indentation {indentation:.4g} mm, {load:.3g} N/mm and {voltage:.4g} V"
    )


def _may_have_an_energy(scene: Scene) -> bool:
    """Whether its vertical attraction may also be along the normal, with an energy: not in every scene."""
    if not scene.electrics.acts or scene.direction != "vertical" or scene.field == "full":
        return False
    try:
        replace(scene, direction="normal")
    except InputError:
        return False
    return True


def _try(scene: Scene, failed: StepFailed, lost: bool) -> str:
    """Advice for a scene of its kind."""
    pulled = scene.electrics.acts
    finer = "less friction or a finer mesh" if scene.has_friction else "a finer mesh"
    if isinstance(failed, LiftedOff):
        return f"try {'more voltage, or ' if pulled else ''}hold = indentation"
    if isinstance(failed, Folded):
        return f"try {'less voltage, a thicker insulator, ' if pulled else ''}smaller steps, {finer}"
    if not scene.solver.inertial and weakens(scene):
        return "try dynamics = inertial: friction that falls with the speed lets go at once what has no mass"
    if scene.solver.timed:
        passing = failed.last is None or failed.last[1].duration > 0.0
        time = "a larger viscosity of the finger" if passing else "a motion with a speed"
        return f"try smaller steps, {time}, {finer}"
    if failed.released and _may_have_an_energy(scene):
        return (
            "try direction = normal, an attraction with an energy, or time: a speed, with dynamics = viscous"
        )
    if not lost:
        return f"try smaller steps, a larger viscosity with dynamics = viscous, {finer}"
    off = "" if scene.solver.strategy.relaxation else "relaxation of the strategy switched on, or "
    return f"try {off}motions that take time: a speed, with dynamics = viscous or inertial"
