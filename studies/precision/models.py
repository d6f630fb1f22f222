"""The attraction of the hovering finger without a mesh: closed form and quadrature, with their
cost.

What a rigid outline and a deformable pad give is among the runs of the study.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

from evfem.electrostatics.forces import EllipsoidalPad, pad_force_per_depth, plate_force
from evfem.electrostatics.laws import Kaczmarek

from ..benchmark import OUTER
from ..peers.problem import LAYERS
from .scenes import GAP, HOVER_VOLTAGE

REPEATS = 200


@dataclass(frozen=True)
class Model:
    """A model of the hovering finger: CPU seconds of one evaluation, attraction in N/mm."""

    key: str
    cpu_s: float
    force: float


def models() -> list[Model]:
    """A plate as wide as the finger, equation (7), and the traction over the ellipse, equation
    (8b).
    """
    width, height = 2.0 * OUTER[0], 2.0 * OUTER[1]
    law, pad = Kaczmarek(), EllipsoidalPad(width, height, 1.0)
    return [
        _timed("closed_form_plate", lambda: float(plate_force(law, width, GAP, HOVER_VOLTAGE, LAYERS))),
        _timed(
            "outline_quadrature", lambda: float(pad_force_per_depth(law, pad, GAP, HOVER_VOLTAGE, LAYERS))
        ),
    ]


def _timed(key: str, force: Callable[[], float]) -> Model:
    found, begin = force(), time.process_time()
    for _ in range(REPEATS):
        force()
    return Model(key, (time.process_time() - begin) / REPEATS, found)
