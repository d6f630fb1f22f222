"""The sizes of a finger with their ranges and meanings, of a cross-section and of a whole pad."""

from __future__ import annotations

from typing import Annotated, Any

from evfem.common.checks import between
from evfem.finger.layers import LAYERS, NAIL

_PART = {"of": "of the pitch"}


def _thickness(name: str) -> dict[str, Any]:
    (found,) = (layer.thickness for layer in (*LAYERS, NAIL) if layer.name == name and layer.thickness)
    return between(found.lowest, found.highest, "mm")


Width = Annotated[float, between(12.0, 24.0, "mm"), "full width of the cross-section"]
Height = Annotated[float, between(9.0, 20.0, "mm"), "full height of the cross-section"]
RidgeHeight = Annotated[float, between(0.02, 0.4, "mm"), "depth of the grooves; crests lie on the ellipse"]
RidgeWidth = Annotated[float, between(0.3, 0.8, "mm"), "the pitch, from crest to crest"]
RidgeExponent = Annotated[
    float, between(2.0, 16.0), "depth = height t^exponent, t = 0 at a crest, 1 in a groove"
]
RidgePhase = Annotated[float, between(-1.0, 1.0, "pitches"), "0: a crest in the middle, 0.5: a groove"]
RidgeCrest = Annotated[
    float, between(0.0, 0.9, "pitches", **_PART), "flat part of a crest; 0: rounded ridges"
]
RidgeGroove = Annotated[
    float, between(0.0, 0.5, "pitches", **_PART), "flat part of a groove, with flat crests"
]
StratumCorneum = Annotated[float, _thickness("stratum_corneum"), "at a crest"]
Epidermis = Annotated[float, _thickness("epidermis"), "of the living epidermis"]
Dermis = Annotated[float, _thickness("dermis"), "of the dermis"]
BoneWidth = Annotated[float, between(2.0, 12.0, "mm"), "full width of the bone"]
BoneHeight = Annotated[float, between(2.0, 10.0, "mm"), "full height of the bone"]
BoneOffset = Annotated[float, between(-1.0, 3.0, "mm"), "centre of the bone above that of the finger"]
Viscosity = Annotated[float, between(0.0, 1e3, "s"), "relaxation time of materials without their own"]
NailThickness = Annotated[float, _thickness("nail"), "of the nail"]
NailWidth = Annotated[float, between(4.0, 18.0, "mm"), "chord of the nail"]
