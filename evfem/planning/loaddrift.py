r"""Load drift of a slide at held indentation, from friction and geometry.

At constant height of the bone the load is not constant. Friction rotates the pad about the bone, by

    K phi + F h'(phi) = T b,    K = 4 pi G r^2 R^2 / (R^2 - r^2)

with the friction force T = mu F, the load F, half the height b of the outline, its height h(phi) below
the middle when it is turned by phi (of an ellipse h' = (a^2 - b^2)/b phi for small angles), and K the
moment of an annulus of the softest tissue (shear modulus G) between the bone's larger half axis r and
the mean radius R of the layers around that tissue; the pressure moves off the middle by h' and resists
with F h'. The outline is wider than high, so that it stands deeper by h(phi) - b, and

    dF / F = n (h(phi) - b) / d,    F ~ d^n,    n = 1.6

with the indentation d, which for a finger like Table 2's is near 0.08 w (F / (G w))^0.62, w = 2 a.
For fingers 16.7 to 20 mm wide and 12.8 to 14 mm high, and outlines with exponents up to 4, under 0.02
to 0.2 N/mm at friction 0.5 to 1 the load drifts by 0.4 to 1.8 times the estimate (some cases are
tested). Attraction, slopes and viscosity are neglected. Lengths in mm, forces in N/mm, moduli in MPa.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from evfem.common.arrays import Floats
from evfem.finger.fingerpad import FingerPad
from evfem.finger.outline import Outline
from evfem.mesh.mesh import Mesh
from evfem.planning.resolution import path_lines
from evfem.scene.scene import Scene

#: relative drift of the load that is worth a warning
WORTH = 0.05
#: F ~ d^n: the exponent n, and the indentation d over the width w at F = G w
LOAD_EXPONENT, DEPTH_COEFFICIENT = 1.6, 0.08
#: spacing (mm) of the positions at which the friction is sampled
STEP = 0.02
#: largest angle (rad) by which the pad is thought to roll
FARTHEST = 0.6


def load_drift(finger: FingerPad, friction: float, load: float, modulus: float) -> float:
    """Estimated relative change of the `load` (N/mm) of a finger that slides at constant indentation;
    `modulus` is the shear modulus (MPa) of its softest tissue.

    >>> f"{load_drift(FingerPad(), friction=1.0, load=0.05, modulus=0.0115):.0%}"
    '14%'
    """
    a, b, width = 0.5 * finger.width, 0.5 * finger.height, finger.width
    layers = finger.stratum_corneum_thickness + finger.epidermis_thickness + finger.dermis_thickness
    outer, bone = (a - layers) * (b - layers), (0.5 * max(finger.bone_width, finger.bone_height)) ** 2
    if outer <= bone:
        return 0.0
    moment = 4.0 * np.pi * modulus * bone * outer / (outer - bone)
    angle, rise = _rolled(finger.outer)
    resisting = moment * angle + load * np.abs(np.gradient(rise, angle))
    deeper = np.interp(friction * load * b, resisting, rise)
    indentation = DEPTH_COEFFICIENT * width * (load / (modulus * width)) ** (1.0 / LOAD_EXPONENT)
    return float(LOAD_EXPONENT * deeper / indentation)


def _rolled(outer: Outline) -> tuple[Floats, Floats]:
    """Angles (K,) by which an outline is turned, and how much deeper (mm) it then reaches."""
    angle = np.linspace(0.0, FARTHEST, 301)
    points = outer.point(np.linspace(-np.pi, 0.0, 2001))
    depth = (points @ np.array([np.sin(angle), -np.cos(angle)])).max(axis=0)
    return angle, depth - depth[0]


def drifting(scene: Scene, mesh: Mesh, moduli: Mapping[str, float]) -> Iterator[str]:
    """A warning for the first slide at constant indentation, after a press to a force, whose load drifts."""
    if not isinstance(scene.finger, FingerPad) or not scene.ground.is_flat:
        return
    friction = float(np.max(scene.ground.friction_at(path_lines(scene, mesh, STEP))))
    load = None
    for i, course in enumerate(scene.courses):
        if course.depth is not None:
            load = course.force
        elif course.distance and course.hold == "indentation" and load:
            drift = load_drift(scene.finger, friction, load, min(moduli.values()))
            if abs(drift) > WORTH:
                yield (
                    f"motion {i} slides at constant indentation: at friction {friction:.2g} the pad rolls "
                    f"about the bone, and the load of {load:g} N/mm drifts by about {drift:.0%}; "
                    'hold = "force" keeps it'
                )
                return
