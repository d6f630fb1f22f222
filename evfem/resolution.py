"""Whether the pad's nodes are close enough together to feel a profile."""

from __future__ import annotations

from typing import Any

import numpy as np

from evfem.mesh import Mesh
from evfem.motion import Slide
from evfem.scene import Scene

#: share of a profile's height that may lie between two neighbouring nodes and be missed by both
MISSED = 0.2
#: samples of the profile per node spacing, and at most
PER_SPACING, MOST = 8, 200_000


def unresolved(scene: Scene, mesh: Mesh) -> str | None:
    """A sentence if the surface is sharper than the node spacing of the pad, else None.

    Compared are the profile's height in the middle between two nodes with the mean of its heights below
    them, all along the way.
    """
    surface: Any = scene.ground
    if surface.is_flat or not len(mesh.edges_of("pad")):
        return None
    ends = mesh.points[mesh.edges_of("pad")[:, :2]]
    spacing = float(np.median(np.hypot(*(ends[:, 0] - ends[:, 1]).T))) / mesh.order
    x = _way(scene, mesh, spacing / PER_SPACING)
    height = surface.height(x)
    middle = 0.5 * (surface.height(x - 0.5 * spacing) + surface.height(x + 0.5 * spacing))
    missed, whole = float(np.abs(height - middle).max()), float(np.ptp(height))
    if missed <= MISSED * whole:
        return None
    return (
        f"the surface is sharper than the node spacing of the pad ({spacing:.2g} mm): up to {missed:.2g} of "
        f"its {whole:.2g} mm of height lie between two nodes; use a finer mesh or a smoother profile"
    )


def _way(scene: Scene, mesh: Mesh, step: float) -> Any:
    """Positions (mm) that the pad may come to, `step` apart or as near to that as memory allows."""
    position = np.cumsum([0.0, *(motion.distance for motion in scene.motion if isinstance(motion, Slide))])
    pad = mesh.points[mesh.node_sets["pad"], 0]
    first, last = pad.min() + position.min(), pad.max() + position.max()
    return np.linspace(first, last, int(np.clip((last - first) / step, 2, MOST)))
