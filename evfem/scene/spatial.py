"""What a finger in three dimensions, or in the plane, cannot do yet, and the memory that its direct
solver needs.

`check_space` refuses in one sentence each what no run could use; nothing has been computed then.
"""

from __future__ import annotations

from evfem.contact.friction import Coulomb
from evfem.electrostatics.roughness import ConstantRoughness, roughness_of
from evfem.electrostatics.signals import FollowForce
from evfem.errors import InputError, Mistakes
from evfem.mesh.mesh import Mesh
from evfem.scene.motion import Slide
from evfem.scene.scene import Scene

SOLID = "with a finger in three dimensions"
#: factors of a hexahedral finger (bytes) and their growth with the nodes: 98 MB of 11k nodes, n^1.4
FACTOR_BYTES, FACTOR_NODES, FACTOR_GROWTH = 98e6, 11e3, 1.4


def check_space(scene: Scene, mesh: Mesh) -> None:
    """Raise InputError for what a finger of this mesh cannot do."""
    mistakes = Mistakes()
    for key, given, allowed in (_check_solid if mesh.dim == 3 else _check_plane)(scene):
        with mistakes.of_a_part():
            raise InputError(key, given, allowed)
    mistakes.report()


def _check_plane(scene: Scene) -> list[tuple[str, str, str]]:
    return [
        (f"motion[{i}].angle", f"{motion.angle:g} degrees with a finger in the plane", "0, or a Fingertip")
        for i, motion in enumerate(scene.motion)
        if isinstance(motion, Slide) and motion.angle != 0.0
    ]


def _check_solid(scene: Scene) -> list[tuple[str, str, str]]:
    found = []
    if len(scene.ground.friction_jumps):
        allowed = "a number, or a table without jumps: a short ramp from one coefficient to the next"
        found.append(("surface.friction", f"a jump of the coefficient {SOLID}", allowed))
    if not isinstance(scene.friction_law, Coulomb):
        given = f"{type(scene.friction_law).__name__} {SOLID}"
        found.append(("surface.friction_law", given, "Coulomb's law"))
    if scene.hand is not None:
        found.append(("hand", f"a hand {SOLID}", "no hand"))
    if scene.solver.contact != "exact":
        found.append(("solver.contact", f"{scene.solver.contact} {SOLID}", "exact"))
    if scene.law is not None and scene.direction != "vertical":
        found.append(("electrostatics.direction", f"{scene.direction} {SOLID}", "vertical"))
    if scene.law is not None and scene.field != "local":
        found.append(("electrostatics.field", f"{scene.field} {SOLID}", "local"))
    if not isinstance(roughness_of(scene.roughness_gap), (ConstantRoughness, type(None))):
        allowed = "a number: separations that depend on the pressure are those of the plane"
        found.append(("electrostatics.roughness_gap", f"a law {SOLID}", allowed))
    if scene.drive is not None and scene.drive.resolved:
        found.append(("electrostatics.drive", f"resolved {SOLID}", "mean"))
    if scene.depth is not None:
        found.append(("depth", f"{scene.depth:g} {SOLID}", "no depth: its forces are in N already"))
    if isinstance(scene.voltage, FollowForce) and any(
        isinstance(motion, Slide) and motion.way[1] != 0.0 for motion in scene.motion
    ):
        allowed = "angle 0 or 180: the friction force that is followed is that along x"
        found.append(("electrostatics.voltage", "a friction force to follow on a slide across x", allowed))
    return found


def factor_memory(nodes: int) -> float:
    """Memory (bytes) that the factors of a hexahedral finger take, about.

    >>> f"{factor_memory(22_000) / 1e6:.0f} MB, {factor_memory(107_000) / 1e9:.1f} GB"
    '259 MB, 2.4 GB'
    """
    return float(FACTOR_BYTES * (nodes / FACTOR_NODES) ** FACTOR_GROWTH)


def memory(mesh: Mesh) -> str:
    """What the direct solver of a finger in three dimensions needs, in a sentence."""
    factors = factor_memory(len(mesh.points))
    return f"its factors take about {factors / 1e6:.2g} MB, twice that while they are made"
