r"""Exact derivatives of everything that a run reports, by any parameters of its scene.

Direct differentiation through the accepted parts. A part obeys R(w; z, p) = 0 (`evfem.response.parts`), with
its nodes' statuses fixed; the history h that it leaves to the next one (displacements, slips' origins,
velocities, viscous strains, branches, charges, drive of the hand) and the row of the history c are functions
of w, z, p. With :math:`' = d/dp`

.. math:: \frac{\partial R}{\partial w}\,w' = -\Bigl(\frac{\partial R}{\partial p}
          + \frac{\partial R}{\partial z}\,z'\Bigr), \qquad
          z' \leftarrow \frac{dh}{dp}, \qquad c' = \frac{dc}{dp} .

**Every partial derivative is a central difference of fourth order of the partial function alone**: of R, of
what a part leaves behind, of works and rows, by the run's own code, with no equilibrium solved
(`evfem.response.lines`). By the parameter, states fixed, over models of changed scenes
:math:`\epsilon = 10^{-3}` of the parameter apart (of Poisson's ratio of its distance to 1/2; of shapes so
that no node moves by more than 1/250 of the distance of pad nodes, and where attraction, friction or a
profile are asked, pad nodes by 5e-6 mm). Along the derivative of the states: of tissue, bone and gaps 4e-3
apart; of attraction and friction so far that no gap changes by more than 1/1000 of the length over which the
attraction does, or passes a kink of it, and that no node goes on by more than 1e-5 mm along a profile. For a
function that varies over a scale L of its argument the error is :math:`12 (\epsilon/L)^4`, about 1e-11, and
by rounding :math:`10^{-16}/\epsilon` of what is summed up: below 1e-9 of the forces with a nail 5000 times as
stiff as the tissue below, and below 1e-7 of them by the sizes of that finger, which move its nail. So every
law, form, surface and mesh is differentiated as it is, whether it knows complex numbers or not.

w' is found by refinement, :math:`w' \leftarrow w' - K^{-1} R'`, with K of `evfem.response.tangent`,
until R', the derivative of R along all of z', w' and p, is rounding. So K decides only how fast, and that of
the part before serves while no status changes. What does not converge is nan, and the reason is told.

The voltage U of a wished force, charge or gap obeys one more equation, l(w, z, U, p) = 0. As w' is linear in
U', two of them, for two U', give that with l' = 0: minus the quotient of l' at U' = 0 and of its growth with
U'. At a bound U' is that of the bound. A finger that sticks while its voltage is that at which it would slip
obeys another l = 0, with its unused friction (`evfem.newton.search`).

The derivative is that of the piece between changes of status. How far the piece reaches is `valid_to`: for
the margin m of a node (gap, contact force, shear force below the bound, slip), or of a voltage between its
bounds, :math:`|m / m'|`, the least of all nodes and parts of the step. The widths of contact, counts and
times have none.

Sources: C. A. Vidal, R. B. Haber, Comput. Methods Appl. Mech. Eng. (August 1993) 393-431 (direct
differentiation step by step, with the history); J. Korelc, P. Wriggers, doi:10.1007/978-3-030-33520-5_2
(of whole finite element runs).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from evfem.common import notices
from evfem.common.arrays import Floats, blas_limits
from evfem.common.storage import write_text
from evfem.common.tables import csv_text, frame
from evfem.contact.signorini import OPEN
from evfem.errors import InputError, describe_value, readable, unknown
from evfem.newton.condensation import Condensation, Singular, make_condensation
from evfem.newton.control import Target, Unsupported
from evfem.newton.state import State
from evfem.response.beside import Accepted, Beside
from evfem.response.lines import NEAR, SMOOTH, STEP, Line, differentiable, is_work, smooth_alone
from evfem.response.parameters import Parameter, parameter_of, scene_of
from evfem.response.parts import Equations
from evfem.response.tangent import Tangent
from evfem.scene.scene import Scene
from evfem.simulation.history import COLUMNS, ROOM_COLUMNS, no_column
from evfem.simulation.ledger import EnergyAccount
from evfem.simulation.result import Result
from evfem.simulation.run import Request, Run
from evfem.simulation.works import EnergyState

#: why columns have no derivative
COUNTED = "it counts, or is measured by, whole nodes, steps or seconds"
SNAPPED = "the finger snapped or was released in step {}: no derivative goes through that"
SOUGHT = "the voltage that is sought in step {} obeys no equation: its force jumps there, or ends"
LIFTED = "a finger without a load that is touched is not differentiated (step {})"
#: what is smaller than the largest of its kind by so much is a rounded 0; error of a relative derivative
ZERO, ERROR = 1e-9, 1e-7


class _Followed(EnergyAccount):
    """An account that tells of every substep: `told(old, new, account before)`, unless it snapped."""

    told: Callable[[State, State, tuple[dict[str, float], EnergyState | None]], None]
    snapped = False

    def add_substep(self, old: State, new: State) -> bool:
        before = self.snapshot()
        if (found := super().add_substep(old, new)) and before[1] is not None:
            self.snapped = True  # in a first part, whose loads are raised in full, it is none of stability
        self.told(old, new, before)
        return found


class _Differentiated:
    """A run that is followed, its parameters' lines, and the factorised matrix of the last part."""

    def __init__(self, scene: Scene, parameters: Mapping[str, Parameter], columns: Any) -> None:
        self.run = Run(scene, None)
        self.columns = _columns(self.run.model.column_names, columns)
        works = any(map(is_work, self.columns))
        self.ledger = self.run.ledger = _Followed(self.run.model)
        self.ledger.told = self._accepted
        self.centre = Beside.of(scene, None, 0.0)
        self.lines = [Line.of(scene, one, self.centre, self._lengths, works) for one in parameters.values()]
        for line in self.lines:
            self._check(line)
        self._calls: list[tuple[float, float]] = []
        self._taken = 0
        self._known: tuple[bytes, Callable[[Floats], Floats]] = (b"", np.zeros_like)
        self._factor: Condensation | None = None
        self.stopped = ""

    def _check(self, line: Line) -> None:
        """Refuse a parameter that changes which unknowns or laws there are."""
        models = [self.run.model, *(one.run.model for one in line.runs)]
        if len({(each.mesh.cells.tobytes(), each.closing.core is None) for each in models}) > 1:
            given = "a small change of it changes the cells of the mesh, or whether the attraction has a core"
            raise InputError(f"parameters.{line.name}", given, "a parameter that leaves both as they are")

    def _lengths(self, state: State) -> Floats:
        """How far (mm) gaps of the pad nodes (P,) may change for differences: inf where they are closed."""
        model, interface = self.run.model, self.run.model.equilibrium.interface
        gap, core = interface.surface_at(state).gap, model.closing.core
        found, pad = NEAR * np.abs(gap), model.equilibrium.pad_state(state)
        for part in model.attraction.parts:
            if part.acts(state.voltage):
                found = np.minimum(found, 2.0 * SMOOTH * part.varies_over(pad))
        if core is not None and state.voltage != 0.0:
            end = core.law.line(state.voltage, model.attraction.parts[0].layers).end
            found = np.minimum(found, NEAR * np.abs(gap - end))
        return np.where(state.status == OPEN, found, np.inf)

    def advance(self, request: Request) -> None:
        """One step of the run and of its derivatives."""

        def path(done: float, fraction: float) -> Target:
            self._calls, self._taken = [*self._calls[-2:], (done, fraction)], 0
            return request.path(done, fraction)

        self.centre.request = request
        for each in (one for line in self._followed for one in line.runs):
            each.request = next(each.requests)
        self._request, self._calls = request, []
        anew = self.run.model.equilibrium.set_anew(self.run.state, request.path(0.0, 1.0))
        for line in self._followed:
            line.forget(anew)
        self.run.advance(replace(request, path=path))
        if not self.stopped and self.run.rows[-1]["relaxations"]:
            self._stop(SNAPPED)
        for line in self.lines:
            if self.stopped or line.reason:
                line.rows.append({})
                line.valid_to.append(np.nan)
                continue
            assert self.ledger.end is not None
            line.ends(self.run.state, self.ledger.end, self.ledger.sums, self.run.rows[-1])
        self.centre.run.time += request.duration

    @property
    def _followed(self) -> list[Line]:
        """The parameters whose derivatives go on."""
        return [] if self.stopped else [line for line in self.lines if not line.reason]

    def _stop(self, reason: str) -> None:
        self.stopped = reason.format(self._request.step)

    def _span(self) -> tuple[float, float]:
        """Which part of the step was accepted: the last one tried, or its halves one after the other."""
        spans = self.run.stepper.parts.spans(self._calls)
        self._taken += 1
        return spans[self._taken - 1]

    def _accepted(self, old: State, new: State, before: tuple[dict[str, float], EnergyState | None]) -> None:
        """The run has accepted a part: its derivatives."""
        if not self._followed:
            return
        if self.ledger.snapped or self.run.model.body.drag_rate > 0.0:
            self._stop(SNAPPED)
            return
        span, pins = self._span(), self.run.model.equilibrium.interface.jumps
        here = Equations(self.run.model, old, self._request.path(*span).begun(old))
        if not (voltage := here.voltage_by(new)) or _lifted(here.target, new):
            self._stop(LIFTED if voltage else SOUGHT)
            return
        assert self.ledger.end is not None
        books, sums = (before[1], self.ledger.end), (before[0], self.ledger.sums)
        part = Accepted(old, here.held(new), here.margins(new), span, pins.place.copy(), books, sums, voltage)
        for line in self._followed:
            self._follow(line, part, here)

    def _follow(self, line: Line, part: Accepted, here: Equations) -> None:
        """One parameter, with the matrix at hand or, where that is not as good as exact, one of this part."""
        jumps, fresh = self.run.model.equilibrium.interface.jumps.steps, False
        if self._known[0] != part.new.status.tobytes():
            fresh = self._factorise(here, part.new)
        if not line.follow(part, self._known[1], jumps, patient=fresh) and not fresh:
            self._factorise(here, part.new)
            line.follow(part, self._known[1], jumps, patient=True)
        line.reason = line.reason.format(self._request.step)

    def _factorise(self, here: Equations, new: State) -> bool:
        """Factorise the matrix of a part; what is singular solves to nan."""
        model = self.run.model
        near = np.union1d(model.equilibrium.body.reusable().candidates, np.flatnonzero(new.status != OPEN))
        kept = np.concatenate([model.body.unknowns[model.pad.nodes[near]].ravel(), model.body.bone])
        if self._factor is None or not np.array_equal(kept, self._factor.kept):
            self._factor = make_condensation(model.body.pattern, kept, self.run.scene.solver.threads)
        try:
            self._factor.factorise(model.body.tangent(new.u))
            solve = Tangent(here, new, self._factor, kept).solve
        except Singular:
            solve = partial(np.full_like, fill_value=np.nan)
        self._known = (new.status.tobytes(), solve)
        return True


def _lifted(target: Target, new: State) -> bool:
    """Whether a finger without a load is touched."""
    return isinstance(target.height, Unsupported) and bool((new.status != OPEN).any())


@dataclass(frozen=True, eq=False)
class Sensitivities:
    """Derivatives of a run: `found[column, parameter]` (steps,), in the units of both.

    `result` is the run; `valid_to[parameter]` (steps,) how far the parameter may change until a node's
    status does in this step; `parameters` their values; `reasons` why something is nan, by column or
    parameter.
    """

    result: Result
    parameters: Mapping[str, float]
    columns: tuple[str, ...]
    values: Mapping[tuple[str, str], Floats]
    valid_to: Mapping[str, Floats]
    reasons: Mapping[str, str]

    def __getitem__(self, which: tuple[str, str]) -> Floats:
        """The derivative (steps,) of a column by a parameter."""
        if isinstance(which, str):
            raise InputError("derivative", describe_value(which), "found[column, parameter]")
        column, parameter = which
        if parameter not in self.parameters:
            raise unknown("parameter", str(parameter), tuple(self.parameters), readable(parameter))
        if column not in self.columns:
            raise no_column("column", column, self.columns)
        return self.values[column, parameter]

    @property
    def warnings(self) -> Sequence[str]:
        """The warnings of the run."""
        return self.result.warnings

    @property
    def elasticity(self) -> Elasticity:
        """Per cent of a column for 1 % of a parameter, d ln / d ln (steps,), by both; nan where the column
        is 0 but for rounding: 1e-9 of its largest value in the run, of a force of that of all forces.
        """
        return Elasticity(self)

    def moved(self, changes: Mapping[str, float]) -> Result:
        """The run as its derivatives say it is with parameters changed by so much; columns without stay."""
        columns: dict[str, Any] = {}
        for name in (one for one in self.columns if differentiable(one)):
            more = sum((change * self[name, key] for key, change in changes.items()), np.zeros(1))
            columns[name] = np.asarray(self.result[name]) + more
        own: dict[str, Any] = {name: value for name, value in columns.items() if name in COLUMNS}
        space = {name: columns.get(name, value) for name, value in self.result.in_space.items()}
        rooms = {name: columns.get(name, value) for name, value in self.result.in_rooms.items()}
        return replace(self.result, **own, in_space=space, in_rooms=rooms)

    def gradient(self, function: Callable[[Result], float]) -> dict[str, float]:
        """Derivatives by every parameter of a number that a smooth `function` makes of the columns of a run;
        nan where it reads one that has no derivative. InputError where it reads frames or probes.

        ``found.gradient(lambda run: run.tangential_force[-1])``
        """
        found = {}
        for key, value in self.parameters.items():
            way = STEP * (abs(value) or 1.0) / 10.0
            ends = (smooth_alone(self.moved({key: sign * way}), self.columns) for sign in (1.0, -1.0))
            more, less = (float(function(one)) for one in ends)
            found[key] = (more - less) / (2.0 * way)
        return found

    def effects(self, column: str, step: int = -1) -> tuple[dict[str, float], str]:
        """The relative derivatives of a column at a step, counted from 0, by parameter; and what they are."""
        values = {key: float(self.elasticity[column, key][step]) for key in self.parameters}
        return values, f"{column}: % for 1 % of the parameter"

    def to_csv(self, path: str | PathLike[str]) -> None:
        """Write the table and `valid_to`, a row for each step; whole or not at all."""
        smooth = [name for name in self.columns if differentiable(name)]
        columns: dict[str, Any] = {"step": [int(step) for step in self.result.step]}
        for key in self.parameters:
            columns |= {f"{name} by {key}": self[name, key].tolist() for name in smooth}
            columns[f"valid_to {key}"] = self.valid_to[key].tolist()
        write_text(Path(path), csv_text([list(columns), *zip(*columns.values(), strict=True)]))

    def table(self) -> Any:
        """A row for each step, a column `COLUMN by PARAMETER` for each pair: a `pandas.DataFrame`, without
        pandas a record array.
        """
        pairs = {f"{name} by {key}": self[name, key] for key in self.parameters for name in self.columns}
        return frame({"step": np.asarray(self.result.step), **pairs})

    @property
    def missing(self) -> tuple[str, ...]:
        """Parameters without a derivative at the end; `reasons` says why."""
        return tuple(key for key in self.parameters if key in self.reasons)

    def __repr__(self) -> str:
        """The parameters by the relative change of normal and tangential force at the end."""
        each = "% of a column for 1 % of a parameter, at the end:"
        lines = [f"Sensitivities of {len(self.result.step)} steps, {each}"]
        known = [name for name in self.columns if name not in self.reasons]
        names = [name for name in known if name in ("normal_force", "tangential_force")] or known
        zero = [name for name in names if self._is_zero(name)[-1]]
        if zero == names:
            names = [name for name in known if name == "electrostatic_force"] or names
        for key in self.parameters:
            if key in self.missing:
                lines.append(f"  {key}: {self.reasons[key]}")
                continue
            shares = {name: self.elasticity[name, key][-1] for name in names if name not in zero}
            told = [f"{name} {0.0 if abs(one) < ERROR else one:.4g}" for name, one in shares.items()]
            lines.append(f"  {key}: {', '.join(told) or 'none'}")
        if zero:
            lines.append(f"  {' and '.join(zero)}: 0 at the end, which has no per cent")
        return "\n".join(lines)

    def _is_zero(self, column: str) -> Any:
        """Where a column is 0 but for rounding, (steps,) of bool."""
        units, alike = self.result.units, [column]
        if units.get(column) == units["normal_force"]:
            alike += [name for name in self.result.columns if units.get(name) == units["normal_force"]]
        sizes = [np.abs(np.asarray(self.result[name], dtype=float)) for name in alike]
        return sizes[0] <= ZERO * np.nanmax(sizes, initial=0.0)


@dataclass(frozen=True)
class Elasticity:
    """Relative derivatives of `found`."""

    found: Sensitivities

    def __getitem__(self, which: tuple[str, str]) -> Floats:
        slope = self.found[which]
        value = np.asarray(self.found.result[which[0]], dtype=float)
        with np.errstate(divide="ignore", invalid="ignore"):
            share = slope * self.found.parameters[which[1]] / value
        return np.where(self.found._is_zero(which[0]), np.nan, share)


def sensitivities(
    scene: Scene | Result | str | PathLike[str],
    parameters: Any,
    columns: str | Sequence[str] | None = None,
    progress: bool = False,
) -> Sensitivities:
    """Derivatives of the history of a scene by its parameters, exact but for rounding.

    Parameters
    ----------
    scene
        A `Scene`, the path of a scene file, or a result, whose scene is run again. Its
        `tolerance` limits the digits: forces that are known to
        1e-8 have derivatives known to about as much.
    parameters
        A dotted key of the scene, a `ShapeChange`, or several of them.
    columns
        A column of the history, or several; None: all. Columns that count nodes, steps or seconds are nan.
    progress
        Show a progress bar.

    Returns
    -------
    Sensitivities
        One value a step for each column and parameter, with the run itself.

    Raises
    ------
    InputError
        A parameter that the scene does not have, that is 0, or that changes the mesh's cells.
    NotConverged
        A step has no solution.

    Examples
    --------
    >>> from evfem import Display, FingerPad, Hover, Kaczmarek
    >>> pad = FingerPad(ridges=False, resolution="coarse")
    >>> scene = Scene(pad, Display(), Kaczmarek(), 100.0, Hover(gap=0.3, steps=1))
    >>> found = sensitivities(scene, ["electrostatics.voltage"], ["electrostatic_force"])
    >>> round(float(found.elasticity["electrostatic_force", "electrostatics.voltage"][0]), 5)
    2.00005
    """
    scene = scene_of(scene)
    single = isinstance(parameters, str) or hasattr(parameters, "applied")
    given = [parameter_of(scene, each) for each in ([parameters] if single else parameters)]
    if not given:
        raise InputError("parameters", "no keys", "dotted keys of the scene, and ShapeChange objects")
    known = {one.name: one for one in given}
    with blas_limits(), notices.shown(progress):
        run = _Differentiated(scene, known, columns)
        bar = notices.bar(scene.total_steps, "step", 0, progress)
        try:
            for request in run.run.requests():
                run.advance(request)
                bar.update(1)
        finally:
            bar.close()
    return _gathered(run, known)


def _columns(names: Sequence[str], columns: str | Sequence[str] | None) -> tuple[str, ...]:
    """The columns asked for, of those with these names; one of a room that the scene has not is 0."""
    columns = [columns] if isinstance(columns, str) else columns
    numbers = tuple(name for name in names if name not in ("step", "motion_index", "motion"))
    for name in columns or ():
        if name not in (*numbers, *ROOM_COLUMNS):
            raise no_column("columns", name, numbers)
    return numbers if columns is None else tuple(columns)


def _gathered(run: _Differentiated, known: Mapping[str, Parameter]) -> Sensitivities:
    """What was found."""
    columns, there = run.columns, run.run.model.column_names
    reasons = {name: COUNTED for name in columns if not differentiable(name)}
    reasons |= {line.name: reason for line in run.lines if (reason := line.reason or run.stopped)}
    none = {name: 0.0 for name in columns if name not in there}
    values = {
        (name, line.name): np.array([(none | row if row else row).get(name, np.nan) for row in line.rows])
        for line in run.lines
        for name in columns
    }
    valid_to = {line.name: np.array(line.valid_to) for line in run.lines}
    return Sensitivities(
        run.run.result(), {key: one.value for key, one in known.items()}, columns, values, valid_to, reasons
    )
