"""The surface below a finger, as a result knows it.

The scene in the result's provenance says its height everywhere. Where that cannot be read again (a
surface or law of the user's own, a mesh that is no file) the gaps of a frame say it at the nodes
of the pad: :math:`h(x) = y - g`, straight between them and level beyond.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from evfem.common.arrays import Floats
from evfem.errors import EvfemError
from evfem.simulation.result import Frame, Result

Height = Callable[[Floats], Floats]


def height_of(result: Result, frame: Frame) -> Height:
    """Height (mm) of the surface at x (mm) of the laboratory, while the finger is as in `frame`."""
    known = _from_scene(result)
    return _from_gaps(result, frame) if known is None else known


def _from_scene(result: Result) -> Height | None:
    from evfem.scene.file import loads
    from evfem.simulation.model import placed

    try:
        surface = loads(result.provenance.get("parameters", "")).ground
        mesh = result.mesh
        surface, _ = placed(surface, mesh.points[mesh.node_sets["pad"]])
    except EvfemError:
        return None
    return lambda x: surface.y + surface.height(x)


def _from_gaps(result: Result, frame: Frame) -> Height:
    pad = np.flatnonzero(np.isfinite(frame.gap))
    x, y = (result.mesh.points + frame.displacement)[pad].T
    order = np.argsort(x)
    return lambda at: np.interp(at, x[order], (y - frame.gap[pad])[order])
