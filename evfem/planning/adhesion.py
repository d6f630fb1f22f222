"""The law of adhesion as a mesh resolves it, and what a plan says of it."""

from __future__ import annotations

from typing import Any

import numpy as np

from evfem.planning.core import RESOLVED, Closing
from evfem.surface.adhesion import Softened


def softened(closing: Closing) -> Softened:
    """The scene's law with a line of the same work where it falls faster than the mesh of the nodes that
    touch first resolves (`evfem.planning.core`), half as fast beside a voltage; core = "off": the law itself.
    """
    scene = closing.scene
    steepest = np.inf if scene.solver.core == "off" else closing.resolved * closing.stiffness
    return Softened(scene.adhesion, closing.closed, float(steepest))


def told(closing: Closing) -> str:
    """The adhesion of a scene, in words."""
    law: Any = closing.scene.adhesion
    found = softened(closing)
    work = float(law.potential(closing.closed + 1e3)) - float(law.potential(closing.closed))
    line = ""
    if found.line is not None:
        begin, end = (1e3 * gap for gap in found.line)
        line = (
            f"; from {begin:.2g} to {end:.2g} um a line of the same work takes its place, the steepest that "
            f"this mesh resolves (times {1.0 / RESOLVED:.0f} the tissue's own)"
        )
    return f"{type(law).__name__}, work of adhesion {work:.2g} N/mm, always on{line}"
