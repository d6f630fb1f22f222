"""Which scenes are their own mirror image about a vertical line, so that half of them will do."""

from __future__ import annotations

from evfem.electrostatics.signals import FollowForce
from evfem.mesh.mesh import Mesh
from evfem.mesh.symmetry import Half, right_half
from evfem.scene.motion import Slide
from evfem.scene.scene import Scene

HALF = "the right half of the mesh, mirrored; the whole from where that finds no equilibrium"


def unsymmetric(scene: Scene) -> str:
    """What of a scene has no mirror image, or is not taken by halves, in words; empty where all has."""
    reasons = {
        "friction": scene.has_friction,
        "a textured surface": not scene.ground.is_flat,
        "a slide": any(isinstance(motion, Slide) for motion in scene.motion),
        "a wished force": isinstance(scene.voltage, FollowForce),
        "traction along the outline's normal": scene.direction != "vertical",
        "the full field": scene.field != "local",
        "a drive": scene.drive is not None,
        "time": scene.solver.dynamics != "quasistatic",
        "penalty contact": scene.solver.contact != "exact",
        "a hand": scene.hand is not None,
        "forms of your own": bool(scene.forms),
    }
    return next((name for name, there in reasons.items() if there), "")


def half_of(scene: Scene, mesh: Mesh) -> tuple[Half | None, str]:
    """The right half of the mesh of a scene that asks for it, and why, or why not."""
    reason = unsymmetric(scene) or ("three dimensions" if mesh.dim == 3 else "")
    if reason:
        return None, f"the whole mesh: {reason}"
    half = right_half(mesh)
    return half, HALF if half is not None else "the whole mesh, which is not its own mirror image"
