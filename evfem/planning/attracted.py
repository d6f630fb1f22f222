"""Doubts about an attraction by its closed form, of a scene or of a display alone: fields beyond the
breakdown of insulators and air, attractions that no load presses with, smooth faces that decide the force.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from evfem.electrostatics.breakdown import inception_voltage
from evfem.electrostatics.laws import Layer, Layers

#: mean contact pressure (MPa) of a fingertip under 1 N: 1 N over some 50 mm2 that touch
PRESSED = 0.02
#: air (mm) that rough skin keeps at least (docs, which law), and the share of the attraction of smooth faces
#: below which the roughness decides
AIR, DECIDES = 0.005, 0.5


def broken_down(voltage: float, solids: Mapping[str, tuple[Layer, float]]) -> Iterator[str]:
    """Solid layers, each with its field (V/mm) per volt, that a peak `voltage` (V) breaks down."""
    for name, (layer, each) in solids.items():
        field = voltage * each
        if field > layer.strength and np.max(layer.thickness) > 0.0:
            held = f"{1e-3 * layer.strength:g} V/um, from {layer.strength / each:.3g} V on"
            yield (
                f"where skin touches {voltage:g} V make a field of {1e-3 * field:.3g} V/um in the {name}, "
                f"which breaks down above {held}: voltages are in V, thicknesses in mm"
            )


def broken_air(voltage: float, layers: Layers) -> str:
    """From which voltage on air breaks down over these layers, and in which gap; empty below it.

    >>> broken_air(1000.0, Layers.of(Layer(0.38, 1650.0), Layer(0.09, 3.35)))
    'air breaks down from 790 V on (28.5 um)'
    """
    least, gap = (float(np.min(one)) for one in inception_voltage(layers))
    return f"air breaks down from {least:.3g} V on ({1e3 * gap:.3g} um)" if voltage > least else ""


def touching(law: Any, layers: Layers, voltage: float, gap: float) -> Iterator[str]:
    """Of touching faces that are a rough `gap` (mm) apart, 0 for smooth ones: an attraction beyond any load,
    or one that a few micrometres of air change by a multiple.

    >>> from evfem.electrostatics.laws import TOUCHSCREEN, Kaczmarek, StrongTroxel
    >>> stack = Layers.of(Layer(0.38, 1650.0), TOUCHSCREEN)
    >>> [[len(list(touching(law(), stack, 15.9, gap))) for gap in (0.0, 0.005)]
    ...  for law in (StrongTroxel, Kaczmarek)]
    [[1, 0], [0, 0]]
    """
    smooth = gap == 0.0 and getattr(law, "of_a_field", False)
    traction = float(np.max(law.traction(gap, voltage, layers)))
    if traction > PRESSED:
        yield (
            f"at {voltage:g} V touching skin is attracted with {traction:.3g} MPa, and a load presses a "
            f"fingertip with up to {PRESSED:g} MPa: the attraction exceeds the load"
            + ("; rough faces keep a gap: see roughness_gap" if smooth else "")
        )
    elif smooth and traction > 0.0:
        left = float(np.max(law.traction(AIR, voltage, layers))) / traction
        if left < DECIDES:
            yield (
                f"{1e3 * AIR:g} um of air between rough faces leave {left:.2%} of the attraction of smooth "
                "ones, so the roughness decides the force: see roughness_gap"
            )
