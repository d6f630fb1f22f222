"""From a run to the arrays of its checkpoint and back, so that a resumed run repeats what it would
have done.

Beside the state a run carries over from step to step: the contact candidates, the substep that
worked last, the works so far with the forces that they go on from, and a factorisation made some
steps ago. Of the last one the checkpoint keeps where it was made; a resumed run makes it there
again, and the iterations that follow are the same to the last bit (with one thread, on the same
machine and backend).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import numpy as np

from evfem.errors import InputError
from evfem.simulation.history import SUMS
from evfem.simulation.ledger import Ledger
from evfem.simulation.model import Model
from evfem.simulation.result import Saved
from evfem.simulation.works import Books
from evfem.solver.state import NO_PRESSURE, Reusable, State, TangentPoint

#: statuses of a pad node are 0 to this
LAST_STATUS = 3
#: arrays whose size a run that has just been set up does not know
OF_ANY_SIZE = ("candidates", "factor_pressure")


def state_arrays(state: State) -> dict[str, Any]:
    """Every part of a state, by name."""
    return {spec.name: np.asarray(getattr(state, spec.name)) for spec in fields(State)}


def reusable_arrays(state: State, carried: Reusable) -> dict[str, Any]:
    """What a solver takes with it to the next step; of the same shapes with and without a
    factorisation.
    """
    at, nowhere = carried.tangent_point, np.zeros_like(state.u)
    return {
        "candidates": carried.candidates,
        "factorised": np.array(at is not None),
        "factor_u": nowhere if at is None else at.u,
        "factor_begin": nowhere if at is None else at.begin,
        "factor_voltage": np.array(0.0 if at is None else at.voltage),
        "factor_duration": np.array(0.0 if at is None else at.duration),
        "factor_frozen": np.array(False if at is None else at.frozen),
        "factor_touching": np.zeros(state.status.size, dtype=bool) if at is None else at.touching,
        "factor_status": np.zeros_like(state.status) if at is None else at.status,
        "factor_pressure": NO_PRESSURE if at is None else at.pressure,
        "duration": np.array(carried.duration),
    }


def reusable_of(arrays: Mapping[str, np.ndarray]) -> Reusable:
    """What the solver had taken with it, from the arrays of a checkpoint."""
    at = None
    if arrays["factorised"]:
        at = TangentPoint(
            u=arrays["factor_u"],
            voltage=float(arrays["factor_voltage"]),
            touching=arrays["factor_touching"],
            frozen=bool(arrays["factor_frozen"]),
            begin=arrays["factor_begin"],
            duration=float(arrays["factor_duration"]),
            status=arrays["factor_status"].astype(np.int64),
            pressure=arrays["factor_pressure"],
        )
    return Reusable(arrays["candidates"].astype(np.int64), at, float(arrays["duration"]))


def ledger_arrays(ledger: Ledger, state: State) -> dict[str, Any]:
    """The works so far, and what is known of the last accepted state."""
    end = ledger.end or Books.nothing(state.u.shape)
    return {
        "sums": np.array([ledger.sums[name] for name in SUMS]),
        "internal_forces": end.forces,
        "given_forces": end.given,
        "energies": np.array([end.stored, end.springs, end.kinetic]),
    }


def ledger_of(model: Model, arrays: Mapping[str, np.ndarray]) -> Ledger:
    """The ledger from the arrays of a checkpoint."""
    sums = dict(zip(SUMS, arrays["sums"].tolist(), strict=True))
    end = Books(arrays["internal_forces"], arrays["given_forces"], *arrays["energies"].tolist())
    return Ledger(model, sums, end)


def usable(saved: Saved, fresh: Mapping[str, Any], most_rows: int) -> dict[str, np.ndarray]:
    """The arrays of a checkpoint, if they fit the `fresh` ones of a run of `most_rows` steps that
    has just been set up.

    Raises InputError for what is missing, of another shape or kind, not finite, or out of range.
    """
    if len(saved.rows) > most_rows:
        allowed = f"at most the {most_rows} steps of the scene"
        raise InputError("checkpoint", f"{len(saved.rows)} steps", allowed)
    for name, expected in fresh.items():
        given, fits = saved.arrays.get(name), np.asarray(expected)
        if given is None or given.dtype.kind != fits.dtype.kind:
            raise _unusable(name)
        if given.ndim != fits.ndim or (name not in OF_ANY_SIZE and given.shape != fits.shape):
            raise _unusable(name)
        if not np.isfinite(given).all():
            raise _unusable(name)
    arrays = {name: saved.arrays[name] for name in fresh}
    pad = arrays["status"].size
    for name, most in (("candidates", pad - 1), ("status", LAST_STATUS), ("factor_status", LAST_STATUS)):
        if arrays[name].size and not 0 <= arrays[name].min() <= arrays[name].max() <= most:
            raise _unusable(name)
    if (np.diff(arrays["candidates"]) <= 0).any():
        raise _unusable("candidates")
    if not 0.0 < arrays["substep"] <= 1.0:
        raise _unusable("substep")
    return arrays


def _unusable(name: str) -> InputError:
    return InputError("checkpoint", f"no usable {name}", "a checkpoint of the same scene and version")


def state_of(arrays: Mapping[str, np.ndarray]) -> State:
    """The state in the arrays of a checkpoint."""
    parts: dict[str, Any] = {spec.name: arrays[spec.name] for spec in fields(State)}
    return State(**parts | {"voltage": float(arrays["voltage"])})
