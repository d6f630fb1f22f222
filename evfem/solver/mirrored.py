r"""Equilibria of a symmetric finger from its right half.

Without friction, on a flat surface, a symmetric finger that is moved up and down has equilibria that
are their own mirror images. They are those of the right half on a support along its middle
(`evfem.tissue.body.Body`), under half of the force:

.. math:: u_x(-x, y) = -u_x(x, y), \qquad u_y(-x, y) = u_y(x, y), \qquad F = 2 F_{half}.

Nodes in the middle carry half of their forces in the half body. States, rows and fields are those of
the whole finger, so nothing behind the steps knows of it. Where the half body finds no equilibrium,
the whole one goes on from there to the end of the run: what is lost need not be lost symmetrically.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.contact.signorini import BACKWARD, FORWARD
from evfem.mesh.symmetry import Half
from evfem.solver.control import Force, Target
from evfem.solver.equilibrium import Equilibrium
from evfem.solver.state import Reusable, State, StepFailed, TangentPoint

#: the mirror image of an upright vector's components
MIRROR = np.array([-1.0, 1.0])


@dataclass(frozen=True, eq=False)
class Halves:
    """Which pad nodes of the whole finger are the half's, `right` (p,), their images `left` (p,),
    and which of them are in the `middle` (p,) bool; the same for all nodes in `half`.
    """

    half: Half
    right: Ints
    left: Ints
    middle: Ints

    @classmethod
    def of(cls, half: Half, whole_pad: Ints, half_pad: Ints) -> Halves:
        """From the numbers of the pad nodes in the whole mesh (P,) and in the half (p,)."""
        right = np.searchsorted(whole_pad, half.nodes[half_pad])
        left = np.searchsorted(whole_pad, half.images[half_pad])
        return cls(half, right, left, half.middle[half_pad])

    def cut(self, state: State) -> State:
        """The right half of a state."""
        nodes, right = self.half.nodes, self.right
        return replace(
            state,
            u=state.u[nodes],
            contact_force=self.share(state.contact_force),
            status=state.status[right],
            attraction=self.share(state.attraction),
            reaction=0.5 * state.reaction,
            velocity=state.velocity[nodes],
            last_increment=state.last_increment[nodes],
        )

    def mirrored(self, state: State) -> State:
        """The whole state of a right half."""
        return replace(
            state,
            u=self._whole(state.u),
            contact_force=self._both(state.contact_force, MIRROR[::-1]),
            status=self._statuses(state.status),
            attraction=self._both(state.attraction, MIRROR),
            reaction=np.array([0.0, 2.0 * state.reaction[1]]),
            velocity=self._whole(state.velocity),
            last_increment=self._whole(state.last_increment),
        )

    def share(self, forces: Floats) -> Floats:
        """The half's forces (p, 2) of those on the whole pad (P, 2)."""
        return np.where(self.middle[:, None], 0.5, 1.0) * forces[self.right]

    def _both(self, forces: Floats, sign: Floats) -> Floats:
        """The sums (P, 2) of forces on the half's pad (p, 2) and their images."""
        total = np.zeros((max(self.right.max(), self.left.max()) + 1, 2))
        total[self.right] += forces
        total[self.left] += sign * forces
        return total

    def _whole(self, nodal: Floats) -> Floats:
        """Nodal vectors (N, 2) of the whole from those of the half (n, 2)."""
        whole = np.empty((max(self.half.nodes.max(), self.half.images.max()) + 1, 2))
        whole[self.half.images] = MIRROR * nodal
        whole[self.half.nodes] = nodal
        return whole

    def _statuses(self, status: Ints) -> Ints:
        whole = np.empty(max(self.right.max(), self.left.max()) + 1, dtype=np.int64)
        turned = np.where(status == FORWARD, BACKWARD, np.where(status == BACKWARD, FORWARD, status))
        whole[self.left] = turned
        whole[self.right] = status
        return whole

    def whole_point(self, point: TangentPoint) -> TangentPoint:
        """Where a tangent of the half was taken, as places of the whole; the pressure stays its
        own.
        """
        status = self._statuses(point.status)
        touching = self._statuses(point.touching.astype(np.int64)) != 0
        u, begin = self._whole(point.u), self._whole(point.begin)
        return replace(point, u=u, begin=begin, touching=touching, status=status)

    def half_point(self, point: TangentPoint) -> TangentPoint:
        """The other way round."""
        nodes, right = self.half.nodes, self.right
        u, begin = point.u[nodes], point.begin[nodes]
        return replace(point, u=u, begin=begin, touching=point.touching[right], status=point.status[right])


class Mirrored(Equilibrium):
    """Steps of a symmetric finger: the `half` solver's, mirrored, for as long as it finds them;
    then those of the whole `body`.
    """

    def __init__(self, whole: Equilibrium, half: Equilibrium, halves: Halves) -> None:
        """Both count their work in one record, made for the half."""
        self.__dict__.update(whole.__dict__)
        self.half, self.halves = half, halves
        self.broken = False

    def step(
        self, old: State, target: Target, frozen: Floats | None = None, start: State | None = None
    ) -> State:
        """The equilibrium at `target`, see `Equilibrium.step`."""
        if not self.broken:
            halves = self.halves
            share = None if frozen is None else halves.share(frozen)
            begin = None if start is None else halves.cut(start)
            try:
                return halves.mirrored(self.half.step(halves.cut(old), _halved(target), share, begin))
            except StepFailed:
                self.broken = True
        return super().step(old, target, frozen, start)

    def reusable(self) -> Reusable:
        """What goes to the next step; candidates of the half by their places on the whole pad."""
        if self.broken:
            return super().reusable()
        carried = self.half.reusable()
        at = None if carried.tangent_point is None else self.halves.whole_point(carried.tangent_point)
        places = np.sort(self.halves.right[carried.candidates])
        return replace(carried, candidates=places, tangent_point=at)

    def resume(self, state: State, carried: Reusable) -> None:
        """Put the solver where it was: candidates on the left are of a whole body."""
        halves = self.halves
        place = np.full(self.interface.pad.nodes.size, -1)
        place[halves.right] = np.arange(halves.right.size)
        candidates = place[carried.candidates]
        self.broken = bool((candidates < 0).any())
        if self.broken:
            super().resume(state, carried)
            return
        at = None if carried.tangent_point is None else halves.half_point(carried.tangent_point)
        half = replace(carried, candidates=np.sort(candidates), tangent_point=at)
        self.half.resume(halves.cut(state), half)


def _halved(target: Target) -> Target:
    """The same target for one half."""
    if isinstance(target.height, Force):
        return replace(target, height=Force(0.5 * target.height.force))
    return target
