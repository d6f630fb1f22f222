r"""Which equilibria of a full run a fast model remembers, and their compliances
(`evfem.fast.memory`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.contact.edge import outline_nodes
from evfem.contact.signorini import OPEN
from evfem.errors import InputError
from evfem.fast.memory import CondensedPad, Kept, sums
from evfem.simulation.model import Model
from evfem.solver.condensation import make_condensation
from evfem.solver.state import State


@dataclass(frozen=True, eq=False)
class Memory:
    """What a fast model remembers: the condensed pad, and the displacements (S, N, 2) of all nodes
    relative to the bone (mm), from where the full model starts its checks.
    """

    pad: CondensedPad
    whole: Floats


def remember(model: Model, states: Sequence[State], kinds: Sequence[str], press: int, slide: int) -> Memory:
    """From the `states` of a run, the undeformed one first, reached by motions of these `kinds`:
    `press` equilibria of the press and up to `slide` more for each direction of sliding. Raises
    InputError for a run without contact.
    """
    pad, points = model.pad, model.mesh.points[model.pad.nodes]
    force = [model.equilibrium.contact_forces(state) + state.attraction for state in states]
    # the undeformed pad is an equilibrium without forces
    force[0] = np.zeros_like(force[0])
    order = np.searchsorted(pad.nodes, outline_nodes(model.mesh))
    order = order[pad.free[order]]
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points[order], axis=0).T))])
    touched = np.flatnonzero(np.any([state.status[order] != OPEN for state in states], axis=0))
    if not touched.size:
        raise InputError("motion", "a run without contact", "a scene whose press reaches the surface")
    kept = Kept.along(order, arc, touched, pad.nodes.size)
    pressed, slid = chosen(np.array([sums(f) for f in force]), kinds, press, slide)
    used = list(dict.fromkeys([*pressed, *slid]))
    condensed = CondensedPad(
        kept,
        np.stack([states[i].u[pad.nodes] - states[i].bone for i in used]),
        np.stack([force[i] for i in used]),
        _compliances(model, kept, [states[i] for i in used]),
        np.array([used.index(i) for i in pressed]),
        np.array([used.index(i) for i in slid]),
    )
    return Memory(condensed, np.stack([states[i].u - states[i].bone for i in used]))


def chosen(totals: Floats, kinds: Sequence[str], press: int, slide: int) -> tuple[list[int], list[int]]:
    """Numbers of the states to keep: along growing N from rest to the end of the press, and along
    growing T with the end of the press among them.
    """
    first = kinds.index("slide")
    N, T = totals.T
    corner = first - 1
    pressed = [0]
    for level in np.linspace(0.0, N[corner], press + 1)[1:-1]:
        k = int(np.argmin(np.abs(N[:first] - level)))
        if N[pressed[-1]] < N[k] < N[corner]:
            pressed.append(k)
    sliding = np.arange(corner, len(kinds))
    slid = [corner]
    for end in (T[sliding].min(), T[sliding].max()):
        for level in np.linspace(T[corner], end, slide + 1)[1:]:
            k = int(sliding[np.argmin(np.abs(T[sliding] - level))])
            apart = np.abs(T[slid] - T[k]).min()
            if apart > 0.25 * abs(end - T[corner]) / slide and apart > 1e-6 * np.abs(totals).max():
                slid.append(k)
    return [*pressed, corner], sorted(slid, key=lambda k: float(T[k]))


def _compliances(model: Model, kept: Kept, states: Sequence[State]) -> Floats:
    """Condensed compliance of the kept nodes at each state, the bone held."""
    unknowns = model.body.unknowns[model.pad.nodes[kept.nodes]]
    order = np.concatenate([unknowns[:, 1], unknowns[:, 0], model.body.bone])
    factor = make_condensation(model.body.pattern, order, model.scene.solver.threads)
    found = np.empty((len(states), 2 * kept.size, 2 * kept.size))
    for compliance, state in zip(found, states, strict=True):
        factor.factorise(model.body.tangent(state.u))
        inverse = np.linalg.inv(factor.schur[:-2, :-2])
        compliance[:] = 0.5 * (inverse + inverse.T)
    return found


def check_shapes(memory: Memory) -> None:
    """Whether the arrays of a file fit together; raises ValueError."""
    pad, whole = memory.pad, memory.whole
    kept, count = pad.kept, len(pad.force)
    nodes = kept.low.size
    shapes = {
        "moved": (count, nodes, 2),
        "force": (count, nodes, 2),
        "compliance": (count, 2 * kept.size, 2 * kept.size),
    }
    for name, shape in shapes.items():
        array = getattr(pad, name)
        if array.shape != shape or array.dtype.kind != "f" or not np.isfinite(array).all():
            raise ValueError(name)
    if whole.ndim != 3 or whole.shape[::2] != (count, 2) or whole.dtype.kind != "f":
        raise ValueError("whole")
    for name, most in (("press", count), ("slide", count)):
        _check_numbers(name, getattr(pad, name), most)
    for name, most in (("near", nodes), ("knots", nodes), ("low", kept.size), ("high", kept.size)):
        _check_numbers(name, getattr(kept, name), most)
    if not kept.low.shape == kept.high.shape == kept.share.shape == kept.hold.shape == (nodes,):
        raise ValueError("nodes")


def _check_numbers(name: str, numbers: Ints, most: int) -> None:
    if numbers.ndim != 1 or numbers.dtype.kind not in "iu":
        raise ValueError(name)
    if numbers.size and not 0 <= numbers.min() <= numbers.max() < most:
        raise ValueError(name)
