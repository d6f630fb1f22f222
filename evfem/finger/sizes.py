"""The sizes of a finger, of a cross-section and of a whole pad: ranges, meanings, what fits together."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.checks import between, whole
from evfem.errors import InputError
from evfem.finger.layers import LAYERS, NAIL
from evfem.finger.outline import Ridges

#: What can be meshed well: the largest slope of the wall of a rounded and of a flat-topped ridge, and the
#: smallest distance between bone and dermis (mm).
STEEPEST, STEEPEST_FLAT, CLEARANCE = 4.88, 3.5, 0.3

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
CELLS = "an even whole number from 4 to 96"
CellsPerRidge = Annotated[
    int | None,
    whole(96, 4, CELLS),
    "distances of nodes from crest to crest (half as many quadratic cells); without it by resolution",
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


def check_at_most(name: str, value: float, limit: float, meaning: str, unit: str = " mm") -> None:
    """Refuse a size beyond a limit that follows from others."""
    if value > limit * (1.0 + 1e-12):
        raise InputError(f"finger.{name}", value, f"at most {limit:.4g}{unit} ({meaning})")


def check_skin(skin: float, radius: float, factor: float) -> None:
    """Refuse layers that are together thicker than so many times the surface's smallest radius."""
    deepest = [layer for layer in LAYERS if layer.thickness][-1]
    meaning = f"{factor:g} times the surface's smallest radius, together with the layers above it"
    check_at_most(deepest.parameter, skin, factor * radius, meaning)


def check_profile(ridges: Ridges, steeper: float = 1.0) -> None:
    """Refuse ridges whose flat parts leave no walls, or whose walls are too steep on an outline that
    makes them so many times steeper.
    """
    check_at_most("ridge_crest", ridges.crest + ridges.groove, 0.9, "together with finger.ridge_groove", "")
    slope, limit = ridges.steepest * steeper, STEEPEST_FLAT if ridges.crest > 0.0 else STEEPEST
    if slope > limit:
        allowed = f"slopes up to {limit:g}: lower or wider ridges, a smaller ridge_exponent or ridge_crest"
        raise InputError("finger.ridge_height", f"walls with a slope of {slope:.3g}", allowed)


def area_error(cells: float) -> float:
    """By how much, as a share of itself, the real contact width or area of ridges may be wrong with so
    many `cells` (linear ones) from crest to crest.

    Measured with the ridges of Table 2 at .02 and .05 N/mm against 96 cells: 34 % with 6, 8 % with 12,
    4 % with 24, 2 % with 48.

    >>> [round(area_error(cells), 3) for cells in (6, 12, 48)]
    [0.361, 0.09, 0.019]
    """
    return max(13.0 / cells**2, 0.9 / cells)


def check_cells(cells: int | None, ridged: bool) -> None:
    """Refuse `cells_per_ridge` that are odd, or of a pad without ridges."""
    if cells is not None and not ridged:
        raise InputError("finger.cells_per_ridge", f"{cells} without ridges", "a pad with ridges")
    if cells is not None and cells % 2:
        raise InputError("finger.cells_per_ridge", cells, CELLS)


def check_bone(name: str, from_bone: Floats, axes: tuple[float, ...]) -> None:
    """Refuse a bone that the dermis has no room around: points (N, d) of its inner side from the
    bone's centre, the bone's half axes (d,).
    """
    clear = (1.0 - 1.0 / np.linalg.norm(from_bone / axes, axis=1)) * np.linalg.norm(from_bone, axis=1)
    if not clear.min() >= CLEARANCE:
        given = f"a bone that leaves {clear.min():.3g} mm to the dermis"
        allowed = f"at least {CLEARANCE:g} mm all around: a smaller or lower bone, or thinner layers"
        raise InputError(f"finger.{name}", given, allowed)
