"""Which rooms a scene has: the one table from keys of a scene to capabilities, written by hand.

Plan and model ask it; docs, Inside, shows it. A capability of the package is a row here, a branch of
`evfem.simulation.model` that makes its room, and the file of the room. One of the user's own is in
`Scene(rooms=...)`, and needs no row.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from evfem.circuit.load import Air, Load, Supply
from evfem.common.rooms import Room
from evfem.scene.scene import Scene
from evfem.terms.friction import ApparentFriction, OverallFriction
from evfem.tissue.dynamics import DYNAMICS


@dataclass(frozen=True)
class Kind:
    """A capability: its `key` in a scene file, its `name` in a plan, the `module` of its room, and whether a
    scene has it; `books` is a room that has columns alone.
    """

    key: str
    name: str
    module: str
    there: Callable[[Scene], bool]
    books: Room = field(default=Room())


KINDS = (
    Kind(
        "surface.friction_law",
        "friction",
        "terms.friction",
        lambda scene: scene.has_friction,
        OverallFriction(),
    ),
    Kind("surface.elastic", "elastic surface", "terms.foundation", lambda scene: bool(scene.ground.elastic)),
    Kind("solver.contact", "penalties", "terms.foundation", lambda scene: scene.solver.contact != "exact"),
    Kind("electrostatics", "electrostatics", "terms.attraction", lambda scene: scene.electrics.acts),
    Kind("electrostatics.field", "full field", "terms.fullfield", lambda scene: scene.field != "local"),
    Kind(
        "electrostatics.drive", "charges", "terms.charging", lambda scene: scene.electrics.resolved, Supply()
    ),
    Kind(
        "electrostatics.frequency", "load", "circuit.load", lambda scene: scene.electrics.alternates, Load()
    ),
    Kind("electrostatics.breakdown", "breakdown", "circuit.load", lambda scene: scene.may_spark, Air()),
    Kind("adhesion", "adhesion", "terms.attraction", lambda scene: scene.adhesion is not None),
    Kind(
        "surface.friction",
        "apparent friction",
        "terms.friction",
        lambda scene: scene.has_friction and scene.is_pulled,
        ApparentFriction(),
    ),
    Kind("solver.dynamics", "time", "tissue.dynamics", lambda scene: bool(DYNAMICS[scene.solver.dynamics])),
    Kind("hand", "hand", "terms.hand", lambda scene: scene.hand is not None),
)


def rooms_of(scene: Scene) -> tuple[Kind, ...]:
    """The capabilities of the package that a scene has, in the order of `KINDS`.

    >>> from evfem import Display, FingerPad, Kaczmarek, Press
    >>> scene = Scene(FingerPad(), Display(friction=0.3), Kaczmarek(), 100.0, Press(force=0.1))
    >>> [one.name for one in rooms_of(scene)]
    ['friction', 'electrostatics', 'breakdown', 'apparent friction']
    """
    return tuple(kind for kind in KINDS if kind.there(scene))
