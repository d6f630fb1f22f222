r"""The tangent of a step: contact candidates, factorisation, and the decision when to factorise again.

A factorisation is kept across iterations and steps. Algorithm (`refactorise_if_needed`)::

    factorise at the present state if
        there is no factorisation, or the contact candidates have changed, or
        the time step is another one than it was made for, or
        the residual has stalled, or falls so slowly that more iterations than `patience` would be left
    S <- Schur complement on (candidates, bone),  C <- (S_cc - coupling)^-1

The coupling is the stiffness that the attraction's tributary lengths add between neighbouring nodes;
under the full field, once iterations stagnate, also that of the fringe field: the electric field beyond
that of parallel plates, at edges and ridges.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from evfem.common import constants
from evfem.common.arrays import Floats, Ints, Memory
from evfem.contact.byforce import OF_GAP_ALONE, OfGapAlone
from evfem.contact.condensed import COMPONENTS, CondensedTangent
from evfem.contact.signorini import OPEN, STICK
from evfem.newton.condensation import Singular, make_condensation
from evfem.newton.interface import Interface
from evfem.newton.state import NOTHING, Beginning, Limits, Record, State, StepFailed, TangentPoint
from evfem.surface.pad import surface_state
from evfem.terms.traction import Entries, PadState, PadTraction
from evfem.tissue.body import Body


def no_progress(residuals: list[float], same: bool) -> bool:
    """Whether iterations stagnate: over the last two with the `same` nodes in contact, or over the last four
    with the bone at its prescribed position.

    >>> no_progress([1e-2, 2e-2, 5e-2], True), no_progress([1e-2, 2e-2, 5e-2], False)
    (True, False)
    """
    if same and len(residuals) > 2 and min(residuals[-2:]) > residuals[-3]:
        return True
    return len(residuals) > 8 and max(residuals[-4:]) < 1.0 and min(residuals[-4:]) > min(residuals[:-4])


def too_old(residuals: list[float], tolerance: float, patience: float, over: int) -> bool:
    """Whether a factorisation is to be made anew: at the mean rate of the last `over` iterations, but for the
    first one of a step, more than `patience` would be left, or residuals fall too slowly.

    >>> falls = [1.0, 1e-2, 3e-5, 2e-5]
    >>> too_old(falls, 1e-8, 8.0, over=1), too_old(falls, 1e-8, 8.0, over=3)
    (True, False)
    """
    if (count := len(residuals) - 1) < 1:
        return False
    now, first = residuals[-1], max(count - over, min(1, count - 2), 0)
    rate = (now / max(residuals[first], 1e-30)) ** (1.0 / (count - first))
    if now > constants.STALLED or rate > constants.SLOW:
        return True
    return bool(now > tolerance and np.log(tolerance / now) / np.log(rate) > patience)


class Linearisation:
    """Candidates, factorisation and condensed tangent of a body under an attraction."""

    def __init__(self, body: Body, interface: Interface, attraction: PadTraction, limits: Limits) -> None:
        self.body, self.interface, self.attraction, self.limits = body, interface, attraction, limits
        self.pad = interface.pad
        self.record = Record()
        self.candidates: Ints = np.zeros(0, dtype=np.int64)
        depth = float(np.ptp(body.space.mesh.points[:, 1]))
        self.softest = min(law.shear_modulus for law, _ in body.tissue.groups) / depth
        self.steep = constants.STEEP * self.softest
        height = self.interface.points[:, 1]
        self._reachable = height - height.min() <= constants.FAR * limits.deepest
        self.factor: Any = None
        self.tangent: Any = None
        self.stiffest, self._memory = 0.0, Memory()
        self._single = self.inaccurate = False
        self.touching: Any = np.zeros(self.pad.nodes.size, dtype=bool)
        self._made_at: TangentPoint | None = None
        none = np.zeros((0, 0))
        self._begin = Beginning(none, none, self.candidates, 0.0, NOTHING)
        self._seconds = 0.0
        self._outdated = False
        self._may_drop_candidates = True
        self._status: Ints = np.zeros(0, dtype=np.int64)
        self._drag_rate = 0.0
        self.fringes = False

    def begin(self, old: State) -> None:
        """Start a step from `old`."""
        self.touching = old.status != OPEN
        self._may_drop_candidates, self._outdated = True, self.fringes
        if self.fringes:
            self.fringes, self._made_at = False, None

    def begin_step(self, old: State, duration: float) -> None:
        """Start the time of a step from `old`; a factorisation for a much different duration is outdated."""
        self._outdated |= self.body.drag_rate != self._drag_rate
        if self._made_at is not None:
            self._outdated |= self.body.outdates(self._made_at.duration, duration)
        self._begin, self._seconds = Beginning.of(old), duration

    def choose_candidates(self, state: State, reach: float) -> None:
        """Make nodes with a gap below `reach` (mm) candidates, and those that the deepest press reaches."""
        position = self.interface.places(state)
        gap = np.where(self.pad.free, self.interface.surface_at(state).gap, np.inf)
        weakening = self.weakening(state)
        if self.interface.follows:
            least = constants.STEEP_IN_SPACE * self.softest
            self._follow(state, gap, weakening > least * self.pad.tributary(position))
            return
        steep, near = self.steep * self.pad.tributary(position), (gap <= reach) | (state.status != OPEN)
        needed = self.pad.free & (near | (weakening > steep))
        if not needed.any():
            needed[np.argmin(gap)] = True
        if needed[self.candidates].sum() == needed.sum():
            return
        # gap below which `SPARE` times as many nodes lie: a new choice costs an analysis of the matrix
        enough = np.sort(gap)[min(int(constants.SPARE * near.sum()), int(self.pad.free.sum()) - 1)]
        wider = (gap <= max(enough, self.interface.neighbourhood)) | (constants.SPARE * weakening > steep)
        wider = self.pad.free & (wider | self._reachable) | needed
        self.candidates = np.union1d(self.candidates, np.flatnonzero(wider))
        self.factor = None

    def _follow(self, state: State, gap: Floats, steep: Any) -> None:
        """Candidates in three dimensions: nodes in contact and others near them, as many as cost little;
        distant ones are dropped once a step.
        """
        needed = self.pad.free & ((gap <= 0.0) | (state.status != OPEN) | steep)
        if self.candidates.size and needed[self.candidates].sum() == needed.sum():
            return
        count = max(constants.SPARE * needed.sum(), constants.FIRST_CANDIDATES * self.pad.free.sum())
        if self._costly and self.touching.any():  # in a linear step from afar too many would touch at once
            count = max(count, min(constants.KEPT * needed.sum(), self._cheap))
        enough = np.sort(gap)[min(int(count), int(self.pad.free.sum()) - 1)]
        chosen = np.flatnonzero(self.pad.free & (gap <= enough) | needed)
        self.candidates = chosen if self._may_drop_candidates else np.union1d(self.candidates, chosen)
        self.factor, self._may_drop_candidates = None, False

    @property
    def _costly(self) -> bool:
        """Whether a factorisation takes the time of several iterations: of a large body in space."""
        return bool(self.interface.follows and self.body.pattern.size >= constants.LARGE_BODY)

    @property
    def _cheap(self) -> float:
        """Number of candidates in space whose compliance takes few operations, m^3 for m unknowns, beside the
        factorisation, about 10 n^2 for n unknowns.
        """
        return (constants.CHEAP * 10.0 * self.body.pattern.size**2) ** (1.0 / 3.0) / 3.0

    # -- factorisation

    def refactorise_if_needed(self, state: State, history: list[float]) -> bool:
        """Factorise where there is no factorisation, iterations stall, or a new one saves time; returns
        whether it did.
        """
        same, self._status = np.array_equal(self._status, state.status), state.status
        if self._has_fringes(state) and no_progress(history, same):
            self._outdated |= not self.fringes
            self.fringes = True
        limits, over = self.limits, constants.RATES if self._costly else 1
        if not self.outdated and not too_old(history, limits.tolerance, limits.strategy.patience, over):
            return False
        self.factorise(state)
        return True

    @property
    def outdated(self) -> bool:
        """Whether there is no factorisation, or one of other candidates, another drag or time step."""
        return self.factor is None or self._outdated

    def _has_fringes(self, state: State) -> bool:
        """Whether the attraction at `state` has a fringe field, with a stiffness beside that of columns."""
        return bool(self.attraction.has_fringes and state.voltage != 0.0)

    def factorise(self, state: State) -> None:
        """Factorise at `state`; raises `StepFailed` if the tangent is singular."""
        self._outdated, self._drag_rate, self.tangent = False, self.body.drag_rate, None
        if self.factor is None:
            unknowns = self.body.unknowns[self.pad.nodes[self.candidates]].ravel()
            # static condensation keeps candidates and bone
            kept = np.concatenate([unknowns, self.body.bone])
            large = kept.size >= constants.LARGE_SCHUR or self.body.pattern.size >= constants.LARGE_BODY
            self._single = large and not self.inaccurate
            self.factor = make_condensation(self.body.pattern, kept, self.limits.threads, self._single)
            self.record.backend = type(self.factor).__name__
        pressure = state.memory.get("pressure")
        upper = self.body.tangent(state.u, pressure)
        if self.interface.follows:
            self._subtract_softening(upper, state)
        self.stiffest, dim = float(upper[self.body.pattern.diagonal].max()), self.body.bone.size
        try:
            self.factor.factorise(upper)
        except Singular as error:
            raise StepFailed(f"the tangent is singular ({error})", self.record.residuals) from error
        self.inaccurate |= self._single and self.factor.schur.dtype != np.float32
        del upper  # a twentieth of the memory of a large body
        self.tangent = CondensedTangent.make(self.factor.schur, self._coupling(state), dim, self._memory)
        self._made_at = TangentPoint(state, self.touching, self._begin, self._seconds)
        self.record.factorisations += 1

    def _subtract_softening(self, upper: Floats, state: State) -> None:
        """Subtract the electrostatic softening (negative stiffness of the attraction) of open nodes that are
        no candidates from the matrix, bounded so that it stays positive definite.
        """
        most = constants.SUBTRACTED * self.softest * self.pad.tributary(self.interface.places(state))
        weakening = np.minimum(self.weakening(state), most)
        weakening[self.candidates] = 0.0
        weakened = np.flatnonzero((weakening > 0.0) & self.pad.free)
        unknowns = self.body.unknowns[self.pad.nodes[weakened]][:, 1]
        upper[self.body.pattern.diagonal[unknowns]] -= weakening[weakened]

    def is_tangent_of(self, state: State) -> bool:
        """Whether the factorisation was made at `state`."""
        return self._made_at is not None and self._made_at.state.u is state.u

    @property
    def reusable(self) -> TangentPoint | None:
        """Point of the factorisation that the next step may use; None with the stiffness of fringe fields."""
        return None if self.factor is None or self.fringes else self._made_at

    def restore(self, at: TangentPoint) -> None:
        """Repeat the factorisation that the resumed run had made at `at`."""
        self.touching = at.touched
        self._begin, self._seconds = at.begin, at.duration
        self.body.begin(at.begin, at.duration)
        for traction in self.attraction.keeping:
            traction.begin(self.interface.pad_state(at.begin, at.begin.touching), at.duration)
        self.factorise(at.state)

    # -- the attraction

    def pad_state(self, state: State) -> PadState:
        """The pad at an iterate of the present step."""
        return self.interface.pad_state(state, self.touching)

    def weakening(self, state: State) -> Floats:
        """Electrostatic softening: decrease of every pad node's attraction with its gap, (P,) N/mm per mm."""
        if not self.attraction.acts(state.voltage):
            return np.zeros(self.pad.nodes.size)
        return np.asarray(self.attraction.weakening(self.pad_state(state)))

    def gain_on_closing(self, state: State) -> Floats:
        """Increase of the attraction of every pad node when its gap closes, (P,) in N/mm."""
        attraction = self.attraction
        if not attraction.acts(state.voltage):
            return np.zeros(self.pad.nodes.size)
        now = self.pad_state(state)
        everywhere = self.pad_state(replace(state, status=np.full_like(state.status, STICK)))
        pull, closed = (attraction.column_law.forces(pad)[:, 1] for pad in (now, everywhere))
        return np.asarray(attraction.tangent_factor(now) * np.maximum(pull - closed, 0.0))

    def by_force(self, state: State) -> OfGapAlone:
        """How the attraction of every pad node depends on its contact force."""
        attraction = self.attraction
        return attraction.by_force(self.pad_state(state)) if attraction.acts(state.voltage) else OF_GAP_ALONE

    def _coupling(self, state: State) -> Floats | None:
        """Off-diagonal stiffness of the attraction between neighbouring candidates, from the change of
        tributary lengths, (dim C, dim C) in N/mm per mm. None if below `SMALLEST_STIFFENING` of the tissue
        stiffness, which keeps the compliance symmetric (a third of the time), and with charge transport, so
        that a factorisation does not depend on the step.
        """
        attraction = self.attraction
        if attraction.flows or not attraction.acts(state.voltage):
            return None
        pad, c, dim = self.pad_state(state), self.candidates, self.body.bone.size
        whole = attraction.full_stiffness(pad) if self.fringes else attraction.stiffness(pad)
        unknowns = (dim * c[:, None] + np.arange(dim)).ravel()
        number = np.full(whole.size, -1)
        number[unknowns] = np.arange(unknowns.size)
        row, column, axis = number[whole.row], number[whole.column], whole.column % dim
        # nodes beyond the candidates move along with their neighbours, so that sliding changes nothing
        along = np.where((column < 0) & (axis != 1), row - row % dim + axis, column)
        inside = (row >= 0) & (along >= 0)
        normal = surface_state(self.interface.surface, pad.position[c]).axes[:, 0, COMPONENTS[:dim]]
        # softening with the node's own gap is in the contact problem already
        softening = -self.weakening(state)[c, None, None] * normal[:, :, None] * normal[:, None, :]
        own = np.arange(unknowns.size).reshape(c.size, dim)
        between = row[inside], along[inside], whole.value[inside]
        within = own[:, :, None], own[:, None, :], softening
        added = Entries.of(unknowns.size, [between, within]).summed()
        stiffened = np.bincount(added.row, np.abs(added.value), added.size)
        faint = (stiffened <= constants.SMALLEST_STIFFENING * np.diagonal(self.factor.schur)[:-dim]).all()
        return None if faint else added.toarray()
