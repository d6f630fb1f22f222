r"""Forward sensitivities of a run with respect to one parameter: derivatives of states, energy balances and
rows, substep by substep.

dR/dp = 0 gives :math:`K\,dw/dp = -(\partial R/\partial p + \partial R/\partial z\,dz/dp)` at every accepted
substep (`evfem.response.parts`). Both partial derivatives are central differences of fourth order of what the
run itself evaluates: over the parameter at fixed state, by four perturbed models (`Beside`), and along the
derivative of the states at fixed parameter, in one more model of the scene (`Line`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.errors import InputError
from evfem.newton.state import State
from evfem.response.beside import Accepted, Beside, Jumps
from evfem.response.differences import SAMPLES, Change, added, changes, difference, moved
from evfem.response.parameters import Parameter
from evfem.response.parts import BOUND, GIVEN, WISH, ZERO, Equations
from evfem.scene.scene import Scene
from evfem.simulation.history import COLUMNS, UNITS
from evfem.simulation.model import Model
from evfem.simulation.result import Result
from evfem.simulation.works import EnergyState
from evfem.terms.friction import COEFFICIENTS

#: relative change of a parameter between samples
STEP = 1e-3
#: the outer samples lie within this fraction of the distance to a kink of the attraction or another status,
#: within this fraction of the length over which the attraction changes, and at least so far
NEAR, SMOOTH, LEAST = 0.5, 2e-3, 1e-4
#: relative change of contact forces between samples under a friction law, which may have a kink over the
#: pressure
PRESSED = 1e-4
#: largest shifts of nodes of the undeformed finger between samples, as a fraction of the distance of pad
#: nodes; in mm of pad nodes above an attraction or a profile, and of nodes along a profile
INSIDE, SHIFT, ALONG = 4e-3, 5e-6, 1e-5
#: largest change of the height of a surface with relief between samples (mm): edges and nodes near them pass
HIGHER = 1e-6
#: relative change of the slope of the height of first touch with one node, the factor of a smaller step with
#: several, and rounding of that height
ONE_NODE, NEARER, ROUNDED = 1e-4, 0.1, 1e-14
#: ratio of the step for smooth functions, and of one step to the next nearer one
FAR = 4.0
#: largest number of refinements; the expected relative change at convergence, that below which it is rounding
#: if it falls by less than the next factor, and that which is too large; the factor by which it must fall
#: with the matrix of another substep
MAX_REFINEMENTS, DONE, ROUNDING, NOISE, WRONG, SLOW = 30, 1e-13, 1e-7, 0.5, 1e-6, 0.01
#: the unknowns of a substep, and the fields of an elastic surface that follow from them
UNKNOWN, SURFACE_FIELDS = (
    ("u", "bone", "contact_force"),
    ("memory.surface_displacement", "memory.surface_gradient"),
)
#: fields of a state with the kinks of the attraction
NONSMOOTH_FIELDS = ("attraction", "memory.charges", "memory.forces.")
TIED = "several nodes touch the surface first, and which one is next depends on the sign of the change"
SWITCHED = "in step {} the electrode is connected on one side of the parameter, and no longer on the other"
LOST = "the linear equations of step {} were not solved"
#: endings of columns with units that are counts all the same: not differentiable
DISCRETE = ("contact_width", "contact_area", "mean_contact_pressure", "breakdown_x")
#: columns that a smooth function may read although they have no derivative
PLACES = ("step", "motion_index", "motion", "time")
#: columns without a unit that are smooth
SMOOTH_RATIOS = (*COEFFICIENTS,)
Lengths = Callable[[State], Floats]
Solve = Callable[[Floats], Floats]


def differentiable(column: str) -> bool:
    """Whether a column of the history is a smooth function of the parameters.

    >>> differentiable("normal_force"), differentiable("substeps"), differentiable("contact_width")
    (True, False, False)
    """
    unit = UNITS.get(column, "N")
    return column in SMOOTH_RATIOS or (unit not in ("", "s") and not column.endswith(DISCRETE))


def is_work(column: str) -> bool:
    """Whether a column is a work or an energy."""
    return column.endswith(("_work", "_energy", "_dissipation"))


def smooth_alone(result: Result, columns: Sequence[str]) -> Result:
    """A result with nan for all but the differentiable ones of these columns, and without its fields."""
    none = np.full(len(result.step), np.nan)
    known = {*PLACES, *filter(differentiable, columns)}
    own: dict[str, Any] = {name: none for name in COLUMNS if name not in known}
    space, rooms = (
        {name: value if name in known else none for name, value in some.items()}
        for some in (result.in_space, result.in_rooms)
    )
    fields: Any = {name: _Unread(name) for name in ("frames", "probes")}
    return replace(result, **own, **fields, in_space=space, in_rooms=rooms)


class _Unread:
    """What a smooth function may not read of a result."""

    def __init__(self, name: str) -> None:
        self._name = name

    def _refuse(self, *read: Any) -> Any:
        problem = f"one that reads the {self._name} of a result, which have no derivatives"
        raise InputError("function", problem, "a function of its columns")

    __getattr__ = __getitem__ = __iter__ = __len__ = __bool__ = _refuse


@dataclass
class Line:
    """Forward sensitivity of a `parameter`. `beside`: perturbed runs at the `SAMPLES` in steps of `step`;
    `wide`: the same with a wide stencil for smooth functions, where a shape may change by more; `centre`: a
    run of the scene itself, for samples along the states at most `longest` apart; the derivatives of state,
    energy balance and sums so far, and the results step by step. Energies are differentiated if it `works`.
    """

    parameter: Parameter
    step: float
    longest: float
    beside: list[Beside]
    wide: list[Beside]
    centre: Beside
    lengths: Lengths
    works: bool
    state: Change = field(default_factory=dict)
    books: Change = field(default_factory=dict)
    sums: dict[str, float] = field(default_factory=dict)
    rows: list[dict[str, float]] = field(default_factory=list)
    valid_to: list[float] = field(default_factory=list)
    reach: float = np.inf
    way: float = 0.0
    reason: str = ""

    @classmethod
    def of(cls, scene: Scene, parameter: Parameter, centre: Beside, lengths: Lengths, works: bool) -> Line:
        """At the beginning of a run; `lengths` says how far (mm) nodes of a state (P,) may move."""
        longest = STEP * parameter.size
        last = Beside.of(scene, parameter, SAMPLES[-1] * longest)
        inside, below = (max(1.0, share / SAMPLES[-1]) for share in _shifts(last, centre.run.model))
        step = longest / max(inside, below)
        beside = wide = _neighbours(scene, parameter, step, centre)
        if below > inside:
            wide = _neighbours(scene, parameter, longest / inside, centre)
        step = beside[-1].way / SAMPLES[-1]
        state = changes([one.run.state for one in beside], step)
        line = cls(parameter, step, longest, beside, wide, centre, lengths, works, state)
        line.reason = "" if _one_touches(beside, centre) else TIED
        return line

    @property
    def name(self) -> str:
        """Of the parameter."""
        return self.parameter.name

    @property
    def runs(self) -> list[Beside]:
        """All perturbed runs."""
        return self.beside if self.wide is self.beside else [*self.beside, *self.wide]

    def forget(self, anew: Iterable[str]) -> None:
        """What memories with these names are set to where a requested step begins has no derivative."""
        for name in {f"memory.{one}" for one in anew} & set(self.state):
            self.state[name] = 0.0 * self.state[name]

    # -- a substep

    def follow(self, substep: Accepted, solve: Solve, jumps: Jumps, patient: bool) -> bool:
        """Advance the derivatives to the end of a substep; not where `solve` is slow, unless `patient`."""
        self._come_nearer(substep)
        equations = [one.begin(substep, jumps, substep.old) for one in self.beside]
        if len({one.target.voltage.sought for one in equations}) > 1:
            self.reason = SWITCHED
            return True
        fixed = self._surface_by_parameter(substep, equations), *self._partial(substep, equations, jumps)
        rate = {
            GIVEN: lambda: float(difference([one.target.voltage.voltage for one in equations], self.step)),
            ZERO: lambda: 0.0,
        }.get(substep.voltage, lambda: float(self.state["voltage"]))()
        change = self._change(substep, solve, jumps, patient, fixed, rate)
        if change and substep.voltage in (WISH, BOUND):
            further = rate + (abs(substep.new.voltage) or 1.0) * STEP / self.longest
            other = self._change(substep, solve, jumps, patient, fixed, further)
            change = other and self._met(substep, equations, jumps, (change, other))
        if not change:
            self.reason = LOST if patient else ""
            return False
        self._accept(substep, equations, jumps, change)
        return True

    def _come_nearer(self, substep: Accepted) -> None:
        """Perturbed runs so near that no gap closes between them and no edge of a relief passes a node;
        smooth functions keep those so far.
        """
        interfaces = [one.run.model.equilibrium.interface for one in self.beside]
        gaps = [one.surface_at(substep.new).gap for one in interfaces]
        rate = np.maximum(np.abs(difference(gaps, self.step)), 1e-300)
        allowed = float((self.lengths(substep.new) / rate).min())
        if not self.centre.run.model.surface.is_flat:
            allowed = min(allowed, HIGHER / float(rate.max()))
        step = max(allowed / SAMPLES[-1], LEAST * self.longest)
        if step < self.step:
            self.step = self.longest * FAR ** np.floor(np.log(step / self.longest) / np.log(FAR))
            self.beside = [self._besides(one) for one in self.beside]

    def _besides(self, farther: Beside) -> Beside:
        """The same perturbed run with the parameter changed by less, at the present step."""
        centre = self.centre.run
        part = self.step * SAMPLES[-1] / self.beside[-1].way
        found = Beside.of(centre.scene, self.parameter, part * farther.way)
        found.run.time = centre.time + part * (farther.run.time - centre.time)
        less = found.way - farther.way
        for row, slopes in zip(farther.run.rows, self.rows, strict=True):
            found.run.rows.append({**row, **{name: row[name] + less * one for name, one in slopes.items()}})
        found.request = next(found.requests)
        return found

    def _met(
        self, substep: Accepted, equations: list[Equations], jumps: Jumps, ends: tuple[Change, Change]
    ) -> Change:
        """The derivative with which the equation of the voltage holds, from those with two of the voltage."""
        slips, new = substep.voltage == BOUND, substep.new
        fixed = difference([one.lacking(new, slips) for one in equations], self.step)
        ask: Any = lambda at, state: (at.lacking(state, slips),)  # noqa: E731
        lacks = [fixed + self._slopes(substep, jumps, one, self._way(substep, one), ask)[0] for one in ends]
        part = -lacks[0] / (lacks[1] - lacks[0])
        return {name: one + part * (ends[1][name] - one) for name, one in ends[0].items()}

    def _change(
        self, substep: Accepted, solve: Solve, jumps: Jumps, patient: bool, fixed: Any, voltage: float
    ) -> Change:
        """The derivative of a substep whose voltage has this one, from the partial ones by the parameter;
        nothing where it is not found.
        """
        kept = substep.new.parts
        change: Change = {
            name: np.zeros_like(kept[name]) for name in (*UNKNOWN, *SURFACE_FIELDS) if name in kept
        }
        change["voltage"] = voltage
        surface_displacement, by_parameter, reaction = fixed
        rate, before, rounds = 1.0, 1.0, 0
        while rounds < MAX_REFINEMENTS:
            rounds += 1
            settling = (
                self._update_surface(substep, jumps, change, surface_displacement)
                if surface_displacement
                else 0.0
            )
            more = solve(-by_parameter - self._along(substep, jumps, change)[0])
            self._add(change, more)
            relative = max(self._relative_change(more, change, substep.new), settling)
            rate, before = relative / before if rounds > 1 else 1.0, relative
            if relative * rate <= DONE or (relative <= ROUNDING and rate > NOISE):
                break
            if not np.isfinite(relative) or (rate > SLOW and rounds > 1 and not patient):
                break
        if before <= WRONG and (patient or rate <= SLOW or before <= ROUNDING):
            return change | {"reaction": reaction + self._along(substep, jumps, change)[1]}
        return {}

    def _partial(self, substep: Accepted, equations: list[Equations], jumps: Jumps) -> tuple[Floats, Floats]:
        """Derivatives (m,) of the equations and (dim,) of the reaction by the parameter at fixed state."""
        wide = equations
        if self.wide is not self.beside:
            wide = [one.begin(substep, jumps, substep.old) for one in self.wide]
        smooth, nonsmooth = (
            [one.smooth(substep.new) for one in wide],
            [one.nonsmooth(substep.new) for one in equations],
        )
        far = self.wide[-1].way / SAMPLES[-1]
        both = zip(zip(*smooth, strict=True), zip(*nonsmooth, strict=True), strict=True)
        equation, reaction = (difference(a, far) + difference(b, self.step) for a, b in both)
        return equation, reaction

    def _surface_by_parameter(self, substep: Accepted, equations: list[Equations]) -> list[Any]:
        """Derivatives of the surface displacement by the parameter at fixed state, none of a rigid one."""
        if not self.centre.run.model.equilibrium.interface.foundation.yields:
            return []
        found = zip(*(one.surface_displacement(substep.new) for one in equations), strict=True)
        return [difference(each, self.step) for each in found]

    def _update_surface(
        self, substep: Accepted, jumps: Jumps, change: Change, by_parameter: list[Any]
    ) -> float:
        """Update the derivative of the surface displacement; returns its relative change."""
        along = self._slopes(
            substep, jumps, change, self._way(substep, change), Equations.surface_displacement
        )
        before = change[SURFACE_FIELDS[0]]
        usual = STEP / self.longest * np.abs(substep.new.parts[SURFACE_FIELDS[0]]).max()
        change |= {name: by_parameter[i] + along[i] for i, name in enumerate(SURFACE_FIELDS)}
        largest = max(np.abs(change[SURFACE_FIELDS[0]]).max(), usual, 1e-300)
        return float(np.abs(change[SURFACE_FIELDS[0]] - before).max() / largest)

    def _add(self, change: Change, more: Floats) -> None:
        """Add a solution (m,) of the linear equations to a derivative."""
        body = self.centre.run.model.body
        parts = body.expand(more[: body.size]), more[body.bone], more[body.size :]
        for name, values in zip(UNKNOWN, parts, strict=True):
            change[name] = change[name] + values.reshape(change[name].shape)

    def _relative_change(self, more: Floats, change: Change, state: State) -> float:
        """The largest change of an unknown, relative to its largest derivative or value over parameter."""
        fractions, size = [], self.centre.run.model.body.size
        for name, rows in (("u", slice(0, size)), ("contact_force", slice(size, None))):
            usual = STEP / self.longest * np.abs(getattr(state, name)).max(initial=0.0)
            largest = max(np.abs(change[name]).max(initial=0.0), usual, 1e-300)
            fractions.append(np.abs(more[rows]).max(initial=0.0) / largest)
        return float(max(fractions))

    def _along(self, substep: Accepted, jumps: Jumps, change: Change) -> tuple[Floats, Floats]:
        """Derivatives (m,) of the equations and (dim,) of the reaction along the states."""
        near = self._slopes(substep, jumps, change, self._way(substep, change), Equations.nonsmooth)
        far = self._slopes(substep, jumps, change, FAR * self.longest, Equations.smooth)
        return near[0] + far[0], near[1] + far[1]

    def _slopes(self, substep: Accepted, jumps: Jumps, change: Change, way: float, ask: Any) -> list[Any]:
        """Derivatives of the arrays or states `ask(equations, state)` along the states, samples at `way`."""
        found = []
        for sample in SAMPLES:
            begun = self.centre.begin(substep, jumps, moved(substep.old, self.state, sample * way))
            found.append(ask(begun, moved(substep.new, change, sample * way)))
        return [changes(each, way) for each in zip(*found, strict=True)]

    def _way(self, substep: Accepted, change: Change, reach: float = np.inf) -> float:
        """Largest distance of samples along the states, within `reach` of the parameter."""
        model = self.centre.run.model
        slope = model.equilibrium.interface.surface_at(substep.new).slope
        moves = change["u"][model.pad.nodes]
        moves = moves + change.get(SURFACE_FIELDS[0], 0.0)
        rate = np.maximum(np.abs(moves[:, 1] - np.sum(slope * moves[:, ::2], axis=1)), 1e-300)
        nearest = min(float((self.lengths(substep.new) / rate).min()), NEAR * reach)
        if model.equilibrium.interface.bounds.nonsmooth:
            force, changed = substep.new.contact_force[:, 0], np.abs(change["contact_force"][:, 0])
            pressed = force / np.maximum(changed, 1e-300)
            nearest = min(nearest, PRESSED * float(pressed[force > 0.0].min(initial=np.inf)))
        if not model.surface.is_flat:
            nearest = min(nearest, ALONG / max(float(np.abs(moves[:, 0]).max()), 1e-300))
        return max(min(self.longest, nearest / max(SAMPLES)), LEAST * self.longest)

    def _accept(self, substep: Accepted, equations: list[Equations], jumps: Jumps, change: Change) -> None:
        """The derivatives at the end of a substep: accepted state, energies, range of its statuses."""
        step, way = self.step, self._way(substep, change)
        by_parameter = changes([one.accepted_state(substep.new) for one in equations], step)
        ask: Any = lambda at, new: (at.accepted_state(new), at.margins(new))  # noqa: E731
        with np.errstate(invalid="ignore"):  # of nodes that are infinitely far from another status
            near, margins = self._slopes(substep, jumps, change, way, ask)
            along = self._slopes(substep, jumps, change, FAR * self.longest, ask)[0]
            rate = margins + difference([one.margins(substep.new) for one in equations], step)
        along |= {name: value for name, value in near.items() if name.startswith(NONSMOOTH_FIELDS)}
        state = added(by_parameter, along) | change
        counts = np.isfinite(substep.margins) & np.isfinite(rate) & (rate != 0.0)
        reach = np.abs(substep.margins[counts] / rate[counts])
        nearest = float(reach.min(initial=np.inf))
        self.reach = min(self.reach, nearest)
        self.way = self._way(substep, change, nearest)
        if self.works:
            self._account(substep, jumps, state, self.way)
        self.state = state

    def _account(self, substep: Accepted, jumps: Jumps, state: Change, way: float) -> None:
        """The derivatives of the energy balance after the substep that ends with these of the state."""
        (begin, _), (sums, _) = substep.books, substep.sums
        fixed = [one.booked(substep.old, substep.new, begin, sums) for one in self.beside]
        along = []
        for sample in SAMPLES:
            offset = sample * way
            old = moved(substep.old, self.state, offset)
            self.centre.begin(substep, jumps, old)
            books = begin if begin is None else moved(begin, self.books, offset)
            along.append(self.centre.booked(old, moved(substep.new, state, offset), books, sums))
        self.books = added(
            changes([one.end for one in fixed], self.step), changes([one.end for one in along], way)
        )
        for name in sums:
            more = difference([one.sums[name] for one in fixed], self.step)
            more += difference([one.sums[name] for one in along], way)
            self.sums[name] = self.sums.get(name, 0.0) + float(more)

    # -- a step

    def ends(self, state: State, books: EnergyState, sums: dict[str, float], row: dict[str, Any]) -> None:
        """A step is done: the derivative of its row, and the range of the parameter with these statuses."""
        fixed = [one.row(state, books, sums) for one in self.beside]
        way, along = self.way, []
        for sample in SAMPLES:
            offset = sample * way
            of_sums = {name: value + offset * self.sums.get(name, 0.0) for name, value in sums.items()}
            here = moved(state, self.state, offset), moved(books, self.books, offset), of_sums
            along.append(self.centre.row(*here))
        names = [name for name in fixed[0] if differentiable(name) and (self.works or not is_work(name))]
        found = {}
        for name in names:
            by_parameter = difference([one[name] for one in fixed], self.step)
            found[name] = float(by_parameter + difference([one[name] for one in along], way))
        self.rows.append(found)
        self.valid_to.append(self.reach)
        self.reach = np.inf
        for one in self.runs:
            assert one.request is not None
            one.run.time += one.request.duration
            one.run.rows.append({**row, **{n: row[n] + one.way * value for n, value in found.items()}})


def _neighbours(scene: Scene, parameter: Parameter, step: float, centre: Beside) -> list[Beside]:
    """Perturbed runs at the samples, so near that all touch the surface first at one node, if possible."""
    found = [Beside.of(scene, parameter, sample * step) for sample in SAMPLES]
    if _one_touches(found, centre) or step < LEAST * STEP * parameter.size:
        return found
    return _neighbours(scene, parameter, NEARER * step, centre)


def _one_touches(runs: Sequence[Beside], centre: Beside) -> bool:
    """Whether the height of first touch is smooth over the samples: with several nodes it has a kink."""
    models = [one.run.model for one in (*runs[:2], centre, *runs[2:])]
    y = np.array([float(model.surface.y) + model.first_gap for model in models])
    odd, even = 0.5 * (y[::-1] - y)[:2] / (2.0, 1.0), (y[::-1] + y - 2.0 * y[2])[:2] / (4.0, 1.0)
    allowed = ONE_NODE * np.abs([odd, even]).max() + ROUNDED * abs(y[2])
    return bool(abs(odd[0] - odd[1]) <= allowed and abs(even[0] - even[1]) <= allowed)


def _shifts(one: Beside, model: Model) -> tuple[float, float]:
    """Largest shifts of nodes from those of `model`, relative to the admissible ones: of all nodes, and of
    those of the pad above an attraction or a profile; 0 for other meshes.
    """
    own, points = one.run.model.mesh.points, model.mesh.points
    if own.shape != points.shape:
        return 0.0, 0.0
    moves = np.abs(own - points).max(axis=1)
    plain = not model.attraction.parts and model.surface.is_flat
    below = 0.0 if plain else float(moves[model.pad.nodes].max()) / SHIFT
    return float(moves.max()) / (INSIDE * model.equilibrium.interface.length), below
