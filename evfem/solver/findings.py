"""How an iterate looks that is no equilibrium, in one line: what a person needs to see why a step failed."""

from __future__ import annotations

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.constants import NAMED
from evfem.contact.signorini import OPEN, STICK
from evfem.solver.state import Balance, State
from evfem.tissue.body import Body


def findings(body: Body, state: State, balance: Balance) -> str:
    """Largest out-of-balance forces and their current places, the contact, the smallest volume ratio."""
    nodal = np.linalg.norm(_free(body, balance.forces), axis=1)
    worst = np.argsort(nodal)[::-1][:NAMED]
    places = (body.space.mesh.points + state.u)[worst]
    unit = "N/mm" if state.bone.size == 2 else "N"
    at = [", ".join(f"{coordinate:.4g}" for coordinate in place) for place in places]
    forces = ", ".join(
        f"{nodal[node]:.1e} {unit} at ({where})" for node, where in zip(worst, at, strict=True)
    )
    opened, sticking = int((state.status == OPEN).sum()), int((state.status == STICK).sum())
    slipping = state.status.size - opened - sticking
    smallest = body.tissue.smallest_J(state.u)
    return (
        f"out of balance: {forces}; contact: {opened} nodes open, {sticking} stick, {slipping} slip; "
        f"smallest J of a cell: {smallest:.2g}"
    )


def _free(body: Body, reduced: Floats) -> Floats:
    """Nodal forces (N, 2), without those of the bone, which its motion balances."""
    kept = reduced.copy()
    kept[body.bone] = 0.0
    forces = body.expand(kept)
    return np.where(np.isnan(forces), np.inf, forces)
