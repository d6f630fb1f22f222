"""From a run to the arrays of its checkpoint and back, so that a resumed run repeats what it would have done.

Beside the state a run carries over from step to step: the contact candidates, the substep that worked last,
the works so far with the forces that they go on from, and a factorisation made some steps ago. Of the last
one the checkpoint keeps where it was made; a resumed run makes it there again, and the iterations that follow
are the same to the last bit (with one thread, on the same machine and backend).

What grows with the run, its rows and what probes found, is in a file beside that of the state, to which each
step adds a line. The line is written first; the file of the state, replaced after it, says how many bytes of
the other count, and their checksum. So a kill between the two, or within a line, loses nothing.
"""

from __future__ import annotations

import json
import math
import os
import zlib
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np

import evfem
from evfem.common.checks import set_frozen, to_python
from evfem.common.storage import GrowingText, disk, load_arrays, packed, save_arrays, unpacked
from evfem.errors import InputError
from evfem.newton.state import Beginning, Reusable, State, TangentPoint
from evfem.simulation.history import COLUMNS, NEEDED, columns_of
from evfem.simulation.ledger import EnergyAccount
from evfem.simulation.model import Model
from evfem.simulation.result import Row, Saved
from evfem.simulation.works import EnergyState
from evfem.terms.tractions import pull_off_of

CHECKPOINT_FORMAT = "evfem-checkpoint-10"
ANOTHER = "a run of another scene"
#: statuses of a pad node are 0 to this
LAST_STATUS = 3
#: name of what was found at the points of all probes after each step (S, P, K)
PROBES = "probes"
#: arrays of the state that a factorised step began with, beside its memory
BEGUN = ("u", "contact_force", "status", "voltage")
#: arrays whose size a run that has just been set up does not know
OF_ANY_SIZE = ("candidates", "factor_memory.pressure", "came_off", PROBES)


def state_arrays(state: State) -> dict[str, Any]:
    """All fields of a state, by name."""
    return {name: np.asarray(value) for name, value in state.parts.items()}


def reusable_arrays(state: State, carried: Reusable) -> dict[str, Any]:
    """Data of the solver for the next step; of the same shapes with and without a factorisation."""
    nowhere = TangentPoint(state, state.touching, Beginning.of(state), 0.0)
    at = carried.tangent_point or nowhere
    found = {"candidates": carried.candidates, "factorised": at is not nowhere}
    found["inaccurate"] = carried.inaccurate
    found |= {f"factor_{name}": value for name, value in state_arrays(at.state).items()}
    found |= {"touched": at.touched, "factor_seconds": at.duration}
    found |= {f"begun_{name}": getattr(at.begin, name) for name in BEGUN}
    found |= {f"begun_memory.{name}": kept for name, kept in at.begin.memory.items()}
    return {name: np.asarray(value) for name, value in found.items()}


def reusable_of(arrays: Mapping[str, np.ndarray]) -> Reusable:
    """The reusable data of the solver, from the arrays of a checkpoint."""
    at = None
    if arrays["factorised"]:
        parts = {name.removeprefix("factor_"): part for name, part in arrays.items()}
        made = state_of({name: part for name, part in parts.items() if f"factor_{name}" in arrays})
        own = "begun_memory."
        kept = {name.removeprefix(own): part for name, part in arrays.items() if name.startswith(own)}
        u, force, status, voltage = (arrays[f"begun_{name}"] for name in BEGUN)
        begin = Beginning(u, force, status, float(voltage), kept)
        at = TangentPoint(made, arrays["touched"], begin, float(arrays["factor_seconds"]))
    return Reusable(arrays["candidates"].astype(np.int64), at, bool(arrays["inaccurate"]))


def account_arrays(ledger: EnergyAccount, state: State) -> dict[str, Any]:
    """The works so far, and what is known of the last accepted state."""
    end = ledger.end or EnergyState.nothing(state.u.shape)
    return {
        "sums": np.array(list(ledger.sums.values())),
        "internal_forces": end.forces,
        "given_forces": end.user_forces,
        "lift": ledger.pull_off.lift,
        "came_off": ledger.pull_off.came_off,
        "energies": np.array(end.energies),
    }


def account_of(model: Model, arrays: Mapping[str, np.ndarray]) -> EnergyAccount:
    """The ledger from the arrays of a checkpoint."""
    sums = dict(zip(EnergyAccount(model).sums, arrays["sums"].tolist(), strict=True))
    end = EnergyState(arrays["internal_forces"], arrays["given_forces"], *arrays["energies"].tolist())
    pull_off = pull_off_of(model.attraction)
    pull_off.lift, pull_off.came_off = arrays["lift"], arrays["came_off"]
    return EnergyAccount(model, sums, end, pull_off)


def usable(
    saved: Saved, fresh: Mapping[str, Any], most_rows: int, columns: Sequence[str]
) -> dict[str, np.ndarray]:
    """The arrays of a checkpoint, if they fit the `fresh` ones of a run of `most_rows` steps
    with these `columns` that has just been set up.

    Raises InputError for what is missing, of another shape or kind, not finite, or out of range.
    """
    if len(saved.rows) > most_rows:
        allowed = f"at most the {most_rows} steps of the scene"
        raise InputError("checkpoint", f"{len(saved.rows)} steps", allowed)
    if saved.rows and set(saved.rows[0]) != set(columns):
        raise _unusable("rows")
    for name, expected in fresh.items():
        array, fits = saved.arrays.get(name), np.asarray(expected)
        if array is None or array.dtype.kind != fits.dtype.kind:
            raise _unusable(name)
        if array.ndim != fits.ndim or (name not in OF_ANY_SIZE and array.shape != fits.shape):
            raise _unusable(name)
        if name == PROBES:  # a form in the plane leaves the stress out of it open: nan
            if array.shape != (len(saved.rows), *fits.shape[1:]):
                raise _unusable(name)
        elif not np.isfinite(array).all():
            raise _unusable(name)
    arrays = {name: saved.arrays[name] for name in fresh}
    pad = arrays["status"].size
    for name, most in (
        ("candidates", pad - 1),
        ("status", LAST_STATUS),
        ("factor_status", LAST_STATUS),
        ("begun_status", LAST_STATUS),
    ):
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
    own: dict[str, Any] = {spec.name: arrays[spec.name] for spec in fields(State) if spec.name in arrays}
    state = State(**own | {"voltage": float(arrays["voltage"])})
    return state.with_parts({name: part for name, part in arrays.items() if name.startswith("memory.")})


@dataclass(frozen=True)
class Checkpoint:
    """The state after the last converged step of a run, from which the run can go on, in the file `path`, and
    its `rows` in another.

    The same object adds to what it has written of the rows.
    """

    path: Path
    _grown: GrowingText = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        set_frozen(self, _grown=GrowingText(rows_of(self.path)))

    def write(self, scene_digest: str, arrays: Mapping[str, np.ndarray], rows: Sequence[Row]) -> None:
        """Store the state in one step; the file before stays as it is if the disk refuses (StorageError)."""
        self.add_rows(arrays, rows)
        header = {"format": np.array(CHECKPOINT_FORMAT), "scene": np.array(scene_digest)}
        header["version"] = np.array(evfem.__version__)
        header["rows"] = np.array([len(rows), self._grown.size, self._grown.check])
        state = {name: np.asarray(array) for name, array in arrays.items()}
        state.pop(PROBES, None)
        save_arrays(self.path, header | packed(state))

    def add_rows(self, arrays: Mapping[str, np.ndarray], rows: Sequence[Row]) -> None:
        """Store rows and what probes found; those stored by this object stay what they were. They count from
        the next `write` on.
        """
        found = arrays.get(PROBES, np.zeros((len(rows), 0)))

        def line(k: int) -> str:
            row = {name: to_python(value) for name, value in rows[k].items()}
            return json.dumps([row, found[k].tolist()]) + "\n"

        self._grown.write("", len(rows), line)

    def read(self, scene_digest: str) -> Saved:
        """The state of the same scene. InputError for another scene's, another version's, a damaged file."""
        allowed = "a checkpoint of the same scene and version"
        arrays = load_arrays(self.path, "checkpoint", CHECKPOINT_FORMAT)
        try:
            owner, version = str(arrays["scene"]), str(arrays["version"])
            rows, probes = _lines(self._grown.path, *(int(one) for one in arrays["rows"]))
            state = unpacked(arrays) | ({PROBES: np.array(probes)} if any(probes) else {})
            odd = sorted({*COLUMNS} - {*rows[0]}) if rows and not columns_of(rows[0]) else []
            if owner == scene_digest and not odd:
                _check_rows(rows)
        except (KeyError, ValueError, TypeError, AttributeError, IndexError, RecursionError) as error:
            raise InputError("checkpoint", f"{self.path}, damaged: {error}", allowed) from error
        if version != evfem.__version__:
            found = f"{self.path}, written by evfem {version[:40]!r}, not by {evfem.__version__!r}"
            raise InputError("checkpoint", found, f"a checkpoint of evfem {evfem.__version__}")
        if owner != scene_digest:
            raise InputError(
                "checkpoint", f"{self.path}, {ANOTHER}", "the scene of that run, or another folder"
            )
        if odd:
            found = f"{self.path}, of another version: without the columns {', '.join(odd)}"
            raise InputError("checkpoint", found, allowed)
        return Saved(state, rows)


def rows_of(path: Path) -> Path:
    """The file with the rows of the checkpoint `path`.

    >>> rows_of(Path("checkpoint.npz")).name
    '.checkpoint.rows'
    """
    return path.with_name(f".{path.stem}.rows")


def _lines(path: Path, number: int, size: int, check: int) -> tuple[list[dict[str, Any]], list[Any]]:
    """The rows in the first `size` bytes of a file, and what probes found; ValueError where that is not what
    a checkpoint counted.
    """
    with disk(f"read {path}"), suppress(FileNotFoundError), path.open("rb") as file:
        whole = os.fstat(file.fileno()).st_size >= size >= 0
        data = file.read(size) if whole else b""
        if whole and zlib.crc32(data) == check:
            lines = [json.loads(line) for line in data.splitlines()]
            if len(lines) == number:
                return [line[0] for line in lines], [line[1] for line in lines]
    raise ValueError(f"the rows in {path.name}")


def _check_rows(rows: Any) -> None:
    """Whether these are the rows of a history, from the first step on."""
    if not isinstance(rows, list) or not rows:
        raise ValueError("no rows")
    for step, row in enumerate(rows, 1):
        if not columns_of(row) or set(row) != set(rows[0]):
            raise ValueError(f"columns of row {step}")
        numbers = [value for name, value in row.items() if name != "motion"]
        if row["step"] != step or not isinstance(row["motion"], str):
            raise ValueError(f"row {step}")
        if not all(type(value) in (int, float) for value in numbers):
            raise ValueError(f"row {step}")
        if not all(math.isfinite(row[name]) for name in NEEDED if name != "motion"):
            raise ValueError(f"row {step}")
