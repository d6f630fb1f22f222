"""Pads as an attraction sees them, wherever their nodes are."""

import numpy as np

from evfem.surface.pad import surface_state
from evfem.terms.traction import PadState


def seen(attraction, position, voltage, touching=None, pressing=None):
    """The pad of an attraction with its nodes at `position` (P, dim) in mm, none touching and none pressed
    unless it is said; on a path of W states positions are (W, P, dim) and voltages (W,).
    """
    size = position.shape[-2]
    touching = np.zeros(size, dtype=bool) if touching is None else touching
    below = surface_state(attraction.surface, position) if position.ndim == 2 else None
    load = np.ones(np.shape(voltage))[()]
    return PadState(
        attraction.pad, attraction.surface, position, voltage, pressing, touching, below=below, load=load
    )
