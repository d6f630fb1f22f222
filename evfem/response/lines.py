"""One parameter on its way through a run: derivatives of states, books and rows, part by part.

Total derivatives are sums of two partial ones, each a central difference of fourth order of what the run
itself evaluates: by the parameter at fixed states, between four models of changed scenes (`Beside`), and
along the derivative of the states at a fixed scene, in one more model of the scene (`Line`).
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, is_dataclass, replace
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.newton.state import State
from evfem.response.parameters import Parameter
from evfem.response.parts import Equations
from evfem.scene.scene import Scene
from evfem.simulation.history import UNITS
from evfem.simulation.ledger import Ledger
from evfem.simulation.model import Model
from evfem.simulation.run import Request, Run
from evfem.simulation.works import Books
from evfem.surface.ways import Steps

#: share of a parameter between neighbours, their places in steps and the weights of the difference
STEP = 1e-3
PLACES, WEIGHTS = (-2, -1, 1, 2), np.array([1.0, -8.0, 8.0, -1.0]) / 12.0
#: the farthest place goes no further than this share of the way to a kink of the attraction or to another
#: status, than this share of the length over which the attraction changes, and at least so far
NEAR, SMOOTH, LEAST = 0.5, 2e-3, 1e-4
#: how far contact forces change between places, as a share of themselves, under a law of friction, which may
#: have a kink over the pressure
PRESSED = 1e-4
#: how far nodes of the undeformed finger move between places, as a share of the distance of pad nodes; in mm
#: pad nodes below which there is an attraction or a profile, and nodes along a profile
INSIDE, SHIFT, ALONG = 4e-3, 5e-6, 1e-5
#: relative change of the slope of the first touch that one node has, what a step falls by with several, and
#: rounding of that height
ONE_NODE, NEARER, ROUNDED = 1e-4, 0.1, 1e-14
#: how many times as far apart places are for what is smooth
FAR = 4.0
#: refinements at most; the relative change that is still to come when they are done, that from which on it is
#: rounding where it falls no more than by the next factor, and what is too much; the factor by which it must
#: fall with the matrix of another part
ROUNDS, DONE, ROUNDING, NOISE, WRONG, SLOW = 30, 1e-13, 1e-7, 0.5, 1e-6, 0.01
#: the unknowns of a part, and what follows from them where the surface is elastic
UNKNOWN, SUNK = ("u", "bone", "contact_force"), ("memory.surface_displacement", "memory.surface_gradient")
#: what of a state knows the kinks of the attraction
NEARBY = ("attraction", "memory.charges")
TIED = "several nodes touch the surface first, and which one is next depends on the sign of the change"
LOST = "the linear equations of step {} were not solved"
#: how columns with units end that are counted all the same
WHOLE = ("contact_width", "contact_area", "mean_contact_pressure")
#: derivatives of states and books, by their fields
Change = dict[str, Any]
Jumps = Sequence[Steps]
Lengths = Callable[[State], Floats]
Solve = Callable[[Floats], Floats]


def differentiable(column: str) -> bool:
    """Whether a column of the history is a smooth function of the parameters.

    >>> differentiable("normal_force"), differentiable("substeps"), differentiable("contact_width")
    (True, False, False)
    """
    return UNITS.get(column, "N") not in ("", "s") and not column.endswith(WHOLE)


def is_work(column: str) -> bool:
    """Whether a column is a work or an energy."""
    return column.endswith(("_work", "_energy", "_dissipation"))


def difference(values: Sequence[Any], step: float) -> Any:
    """Derivative from values of numbers or arrays at the `PLACES`, so many steps apart.

    >>> round(float(difference([np.exp(0.01 * k) for k in PLACES], 0.01)), 8)
    1.0
    """
    return sum(weight * np.asarray(value) for weight, value in zip(WEIGHTS, values, strict=True)) / step


def changes(owners: Sequence[Any], step: float) -> Any:
    """`difference` of arrays, or of every field of states or books that has real numbers."""
    if not is_dataclass(owners[0]):
        return difference(owners, step)
    each = [parts_of(one) for one in owners]
    real = [name for name, value in each[0].items() if np.asarray(value).dtype.kind == "f"]
    return {name: difference([one[name] for one in each], step) for name in real}


def parts_of(owner: Any) -> dict[str, Any]:
    """A state, or books, by name."""
    return owner.parts if isinstance(owner, State) else vars(owner)


def added(first: Change, second: Change) -> Change:
    """The sum of two derivatives."""
    return {name: value + second[name] for name, value in first.items()}


def moved(owner: Any, change: Change, way: float) -> Any:
    """A state, or books, so far along a derivative."""
    parts = parts_of(owner)
    further = {name: parts[name] + way * value for name, value in change.items()}
    return owner.with_parts(further) if isinstance(owner, State) else replace(owner, **further)


@dataclass(frozen=True, eq=False)
class Accepted:
    """A part that a run accepted: its states and their margins, which part of the step it is, where a jump of
    friction holds nodes (`pins`, (P, d) in mm, else nan), and the books of the run before and after it.
    """

    old: State
    new: State
    margins: Floats
    span: tuple[float, float]
    pins: Floats
    books: tuple[Books | None, Books]
    sums: tuple[dict[str, float], dict[str, float]]


@dataclass
class Beside:
    """A run that is never solved, of the scene with its parameter changed by `way`."""

    run: Run
    way: float
    requests: Iterator[Request]
    request: Request | None = None

    @classmethod
    def of(cls, scene: Scene, parameter: Parameter | None, way: float) -> Beside:
        """Of a scene, which does without the warnings that the run itself has given."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            run = Run(scene if parameter is None else parameter.applied(scene, way), None)
        return cls(run, way, run.requests())

    def begin(self, part: Accepted, jumps: Jumps, old: State) -> Equations:
        """The equations of a part from `old`; `jumps` of friction are those of the followed run."""
        assert self.request is not None
        pins, own = part.pins.copy(), self.run.model.equilibrium.interface.jumps.steps
        for node in np.flatnonzero(np.isfinite(pins[:, 0])):
            away = [np.abs(pins[node, one.axis] - one.place) for one in jumps]
            nearest = int(np.argmin([each.min() for each in away]))
            jump, axis = int(away[nearest].argmin()), jumps[nearest].axis
            pins[node, axis] += own[nearest].place[jump] - jumps[nearest].place[jump]
        return Equations.begin(self.run.model, old, self.request.path(*part.span), pins)

    def booked(self, old: State, new: State, begin: Books | None, sums: dict[str, float]) -> Ledger:
        """The books after a part that begins with these."""
        ledger = Ledger(self.run.model, dict(sums), begin)
        ledger.accept(old, new)
        return ledger

    def row(self, state: State, step: int, books: Books, sums: dict[str, float]) -> dict[str, Any]:
        """The row at the end of the present step."""
        assert self.request is not None
        one, run = self.request, self.run
        ledger = Ledger(run.model, sums, books)
        return ledger.row(state, step, one.motion_index, one.kind, run.time + one.duration)


@dataclass
class Line:
    """One parameter: `beside`, runs of changed scenes at the `PLACES` in steps of `step`; `wide`, the same
    for what is smooth, where a shape may change by more there; and `centre`, a run of the scene itself, for
    places along the states at most `longest` apart; derivatives of state, books and sums so far, and what was
    found step by step. Books are kept if it `works`.
    """

    name: str
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
        last = Beside.of(scene, parameter, PLACES[-1] * longest)
        inside, below = (max(1.0, share / PLACES[-1]) for share in _shifts(last, centre.run.model))
        step = longest / max(inside, below)
        beside = wide = _neighbours(scene, parameter, step, centre)
        if below > inside:
            wide = _neighbours(scene, parameter, longest / inside, centre)
        step = beside[-1].way / PLACES[-1]
        state = changes([one.run.state for one in beside], step)
        line = cls(parameter.name, step, longest, beside, wide, centre, lengths, works, state)
        line.reason = "" if _one_touches(beside, centre) else TIED
        return line

    @property
    def runs(self) -> list[Beside]:
        """All runs of changed scenes."""
        return self.beside if self.wide is self.beside else [*self.beside, *self.wide]

    # -- a part

    def follow(self, part: Accepted, solve: Solve, jumps: Jumps, patient: bool) -> bool:
        """Take the derivatives to the end of a part; not where `solve` is slow, unless `patient`."""
        equations = [one.begin(part, jumps, part.old) for one in self.beside]
        voltage = difference([one.target.voltage.voltage for one in equations], self.step)
        kept = part.new.parts
        change: Change = {name: np.zeros_like(kept[name]) for name in (*UNKNOWN, *SUNK) if name in kept}
        change["voltage"] = float(voltage)
        sunk = self._sunk(part, equations)
        by_parameter, reaction = self._partial(part, equations, jumps)
        rate, before, rounds = 1.0, 1.0, 0
        while rounds < ROUNDS:
            rounds += 1
            settling = self._sink(part, jumps, change, sunk) if sunk else 0.0
            more = solve(-by_parameter - self._along(part, jumps, change)[0])
            self._add(change, more)
            share = max(self._share(more, change, part.new), settling)
            rate, before = share / before if rounds > 1 else 1.0, share
            if share * rate <= DONE or (share <= ROUNDING and rate > NOISE):
                break
            if not np.isfinite(share) or (rate > SLOW and rounds > 1 and not patient):
                break
        if before <= WRONG and (patient or rate <= SLOW or before <= ROUNDING):
            change["reaction"] = reaction + self._along(part, jumps, change)[1]
            self._end(part, equations, jumps, change)
            return True
        self.reason = LOST if patient else ""
        return False

    def _partial(self, part: Accepted, equations: list[Equations], jumps: Jumps) -> tuple[Floats, Floats]:
        """Derivatives (m,) of the part's equations and (dim,) of the reaction by the parameter alone."""
        wide = equations
        if self.wide is not self.beside:
            wide = [one.begin(part, jumps, part.old) for one in self.wide]
        smooth, kinked = [one.smooth(part.new) for one in wide], [one.kinked(part.new) for one in equations]
        far = self.wide[-1].way / PLACES[-1]
        both = zip(zip(*smooth, strict=True), zip(*kinked, strict=True), strict=True)
        equation, reaction = (difference(a, far) + difference(b, self.step) for a, b in both)
        return equation, reaction

    def _sunk(self, part: Accepted, equations: list[Equations]) -> list[Any]:
        """Derivatives by the parameter alone of what an elastic surface gives way by, none of a rigid one."""
        if not self.centre.run.model.equilibrium.interface.bed.yields:
            return []
        found = zip(*(one.sunk(part.new) for one in equations), strict=True)
        return [difference(each, self.step) for each in found]

    def _sink(self, part: Accepted, jumps: Jumps, change: Change, by_parameter: list[Any]) -> float:
        """Take what an elastic surface gives way by along with the rest; returns its relative change."""
        along = self._slopes(part, jumps, change, self._way(part, change), Equations.sunk)
        before = change[SUNK[0]]
        usual = STEP / self.longest * np.abs(part.new.parts[SUNK[0]]).max()
        change |= {name: by_parameter[i] + along[i] for i, name in enumerate(SUNK)}
        largest = max(np.abs(change[SUNK[0]]).max(), usual, 1e-300)
        return float(np.abs(change[SUNK[0]] - before).max() / largest)

    def _add(self, change: Change, more: Floats) -> None:
        """Add a solution (m,) of a part's equations to a derivative."""
        body = self.centre.run.model.body
        parts = body.expand(more[: body.size]), more[body.bone], more[body.size :]
        for name, part in zip(UNKNOWN, parts, strict=True):
            change[name] = change[name] + part.reshape(change[name].shape)

    def _share(self, more: Floats, change: Change, state: State) -> float:
        """The largest change of an unknown, as a share of the largest derivative or value over parameter."""
        shares, size = [], self.centre.run.model.body.size
        for name, part in (("u", slice(0, size)), ("contact_force", slice(size, None))):
            usual = STEP / self.longest * np.abs(getattr(state, name)).max(initial=0.0)
            largest = max(np.abs(change[name]).max(initial=0.0), usual, 1e-300)
            shares.append(np.abs(more[part]).max(initial=0.0) / largest)
        return float(max(shares))

    def _along(self, part: Accepted, jumps: Jumps, change: Change) -> tuple[Floats, Floats]:
        """Derivatives (m,) of the part's equations and (dim,) of the reaction along those of its states."""
        near = self._slopes(part, jumps, change, self._way(part, change), Equations.kinked)
        far = self._slopes(part, jumps, change, FAR * self.longest, Equations.smooth)
        return near[0] + far[0], near[1] + far[1]

    def _slopes(self, part: Accepted, jumps: Jumps, change: Change, way: float, ask: Any) -> list[Any]:
        """Derivatives of arrays or states that the part's equations answer, from places `way` apart."""
        found = []
        for place in PLACES:
            begun = self.centre.begin(part, jumps, moved(part.old, self.state, place * way))
            found.append(ask(begun, moved(part.new, change, place * way)))
        return [changes(each, way) for each in zip(*found, strict=True)]

    def _way(self, part: Accepted, change: Change, reach: float = np.inf) -> float:
        """How far apart places along the states may be, within `reach` of the parameter."""
        model = self.centre.run.model
        slope = model.equilibrium.interface.surface_at(part.new).slope
        moves = change["u"][model.pad.nodes]
        moves = moves + change.get(SUNK[0], 0.0)
        rate = np.maximum(np.abs(moves[:, 1] - np.sum(slope * moves[:, ::2], axis=1)), 1e-300)
        nearest = min(float((self.lengths(part.new) / rate).min()), NEAR * reach)
        if model.equilibrium.interface.bounds.kinked:
            force, changed = part.new.contact_force[:, 0], np.abs(change["contact_force"][:, 0])
            pressed = force / np.maximum(changed, 1e-300)
            nearest = min(nearest, PRESSED * float(pressed[force > 0.0].min(initial=np.inf)))
        if not model.surface.is_flat:
            nearest = min(nearest, ALONG / max(float(np.abs(moves[:, 0]).max()), 1e-300))
        return max(min(self.longest, nearest / max(PLACES)), LEAST * self.longest)

    def _end(self, part: Accepted, equations: list[Equations], jumps: Jumps, change: Change) -> None:
        """The derivatives at a part's end: what it leaves behind, its books, how far its statuses hold."""
        step, way = self.step, self._way(part, change)
        by_parameter = changes([one.ended(part.new) for one in equations], step)
        ask: Any = lambda at, new: (at.ended(new), at.margins(new))  # noqa: E731
        with np.errstate(invalid="ignore"):  # of nodes that are infinitely far from another status
            near, margins = self._slopes(part, jumps, change, way, ask)
            along = self._slopes(part, jumps, change, FAR * self.longest, ask)[0]
            rate = margins + difference([one.margins(part.new) for one in equations], step)
        along |= {name: value for name, value in near.items() if name in NEARBY}
        state = added(by_parameter, along) | change
        counts = np.isfinite(part.margins) & np.isfinite(rate) & (rate != 0.0)
        reach = np.abs(part.margins[counts] / rate[counts])
        nearest = float(reach.min(initial=np.inf))
        self.reach = min(self.reach, nearest)
        self.way = self._way(part, change, nearest)
        if self.works:
            self._book(part, jumps, state, self.way)
        self.state = state

    def _book(self, part: Accepted, jumps: Jumps, state: Change, way: float) -> None:
        """The derivatives of the books after the part that ends with these of the state."""
        (begin, _), (sums, _) = part.books, part.sums
        fixed = [one.booked(part.old, part.new, begin, sums) for one in self.beside]
        along = []
        for place in PLACES:
            far = place * way
            old = moved(part.old, self.state, far)
            self.centre.begin(part, jumps, old)
            books = begin if begin is None else moved(begin, self.books, far)
            along.append(self.centre.booked(old, moved(part.new, state, far), books, sums))
        self.books = added(
            changes([one.end for one in fixed], self.step), changes([one.end for one in along], way)
        )
        for name in sums:
            more = difference([one.sums[name] for one in fixed], self.step)
            more += difference([one.sums[name] for one in along], way)
            self.sums[name] = self.sums.get(name, 0.0) + float(more)

    # -- a step

    def ends(
        self, step: int, state: State, books: Books, sums: dict[str, float], row: dict[str, Any]
    ) -> None:
        """A step is done: the derivative of its row, and how far its statuses hold."""
        fixed = [one.row(state, step, books, sums) for one in self.beside]
        way, along = self.way, []
        for place in PLACES:
            far = place * way
            of_sums = {name: value + far * self.sums.get(name, 0.0) for name, value in sums.items()}
            here = moved(state, self.state, far), step, moved(books, self.books, far), of_sums
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
    """Runs of changed scenes at the places, so near that all touch the surface first at one node, if any."""
    found = [Beside.of(scene, parameter, place * step) for place in PLACES]
    if _one_touches(found, centre) or step < LEAST * STEP * parameter.size:
        return found
    return _neighbours(scene, parameter, NEARER * step, centre)


def _one_touches(runs: Sequence[Beside], centre: Beside) -> bool:
    """Whether the height of the first touch is smooth over the places: with several nodes it has a kink."""
    models = [one.run.model for one in (*runs[:2], centre, *runs[2:])]
    y = np.array([float(model.surface.y) + model.first_gap for model in models])
    odd, even = 0.5 * (y[::-1] - y)[:2] / (2.0, 1.0), (y[::-1] + y - 2.0 * y[2])[:2] / (4.0, 1.0)
    allowed = ONE_NODE * np.abs([odd, even]).max() + ROUNDED * abs(y[2])
    return bool(abs(odd[0] - odd[1]) <= allowed and abs(even[0] - even[1]) <= allowed)


def _shifts(one: Beside, model: Model) -> tuple[float, float]:
    """How far nodes of a finger are from those of `model`, over how far they may: all of them, and those of
    the pad below an attraction or a profile; 0 for other meshes.
    """
    own, points = one.run.model.mesh.points, model.mesh.points
    if own.shape != points.shape:
        return 0.0, 0.0
    moves = np.abs(own - points).max(axis=1)
    plain = not model.attraction.parts and model.surface.is_flat
    below = 0.0 if plain else float(moves[model.pad.nodes].max()) / SHIFT
    return float(moves.max()) / (INSIDE * model.equilibrium.interface.length), below
