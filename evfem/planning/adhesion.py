"""The law of adhesion as a mesh resolves it, and what a plan says of it."""

from __future__ import annotations

from typing import Any

import numpy as np

from evfem.planning.core import Closing
from evfem.surface.adhesion import BEYOND, Softened

#: slope (MPa/mm) of rigid cells
STEEPEST = 1e12
#: slopes within this factor count as one
CLASS = 1.1


def softened(closing: Closing) -> Softened:
    """The scene's law with a line of the same work where it falls faster than the mesh at a node resolves
    (`evfem.planning.core`), half as fast beside a voltage; core = "off": the law itself.
    """
    scene = closing.scene
    if scene.solver.core == "off":
        return Softened(scene.adhesion, closing.closed, np.full(closing.stiffness.shape, np.inf))
    steepest = np.minimum(closing.resolved * closing.stiffness, STEEPEST)
    classes = CLASS ** np.floor(np.log(steepest) / np.log(CLASS))
    return Softened(scene.adhesion, closing.closed, classes)


def told(closing: Closing) -> str:
    """The adhesion of a scene, in words."""
    law: Any = closing.scene.adhesion
    found = softened(closing)
    work = float(law.potential(closing.closed + BEYOND)) - float(law.potential(closing.closed))
    begin, end = (1e3 * float(gap[closing.first].max()) for gap in (found.begin, found.end))
    line = ""
    if end > begin:
        line = (
            f"; from {begin:.2g} to {end:.2g} um a line of the same work takes its place, the steepest that "
            "this mesh resolves"
        )
    return f"{type(law).__name__}, work of adhesion {work:.2g} N/mm, always on{line}"
