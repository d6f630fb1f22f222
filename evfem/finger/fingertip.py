"""The whole finger pad in three dimensions, with its materials.

The cross-section through its middle is that of `FingerPad` below the equator: the same outline,
layers, ridges and moduli. What a cross-section does not say (length of finger and bone, posture,
how the rim is held) are parameters; every length is in mm.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from evfem import data
from evfem.common.checks import between, check_fields, one_of, set_frozen
from evfem.common.views import short
from evfem.errors import InputError, Mistakes, describe_value
from evfem.finger import fingerprint
from evfem.finger.crosssection import EXPONENTS, outline_of
from evfem.finger.fingerpad import FingerPad
from evfem.finger.fingerprint import PATTERNS, FingerprintPattern, HeightMap
from evfem.finger.layers import NAIL, thickness_of
from evfem.finger.outline import Ridges
from evfem.finger.sizes import (
    LayeredFinger,
    NailThickness,
    NailWidth,
    check_at_most,
    check_bone,
    check_cells,
    check_nail,
    check_profile,
    check_skin,
    pressure_error,
)
from evfem.finger.solid import RECTANGLE, Body, Ellipsoid, Grid, Nail, Solid, rows_that_merge
from evfem.mesh.mesh import Mesh
from evfem.mesh.quality import scaled_jacobian

RIMS = ("fixed", "free", "nail")
#: angle (degrees) at which the finger of Table 1 was held, whose length is seen from above
HELD = 30.0
#: smallest scaled Jacobian of a cell below measured ridges
SMALLEST_SHAPE = 0.02


@dataclass(frozen=True)
class TipDivisions:
    """How finely to divide, in quadratic cells: columns, sides of the rectangle, columns per ridge."""

    across: int
    along: int
    sides: int
    per_ridge: float
    per_curved_ridge: float


#: resolution -> divisions; the rows of each layer stand in `LAYERS`
TIP_RESOLUTIONS: Mapping[str, TipDivisions] = {
    "coarse": TipDivisions(across=7, along=8, sides=2, per_ridge=3.0, per_curved_ridge=1.5),
    "medium": TipDivisions(across=10, along=12, sides=3, per_ridge=3.0, per_curved_ridge=2.0),
    "fine": TipDivisions(across=16, along=20, sides=4, per_ridge=6.0, per_curved_ridge=3.0),
}
_RIDGES = (
    f"false | none | true | {' | '.join(PATTERNS)}, the path of a csv file with the header x,z,height or of "
    "a grey image, or a table of x, z and rows of height"
)


def _is_file(ridges: str) -> bool:
    return bool(Path(ridges).suffix)


@dataclass(frozen=True, repr=False)
class Fingertip(LayeredFinger):
    """The lower half of a finger's end in three dimensions, or all of it: x across the finger, y up, z along
    it, its tip towards +z.

    **Shape.** The lower half of an ellipsoid around (0, 0, 0), above it the lower half of the bone, another
    ellipsoid. With the exponent `outline` above 2 it is the flatter body abs(x/a)**n + abs(y/b)**n +
    abs(z/c)**n = 1; of a measured cross-section the lower half counts, and along the finger it keeps its
    shape and becomes smaller as an ellipsoid does. `length` is about that of the paper's fingers seen from
    above, 26 mm held at 30 degrees; the bone's length is assumed. The cut between the two moves with the bone
    (`rim` "fixed", as a nail would hold it) or is "free". With `rim` "nail" the upper halves are there too,
    and a nail of `nail_thickness` on top, as wide as `nail_width` along the lines of the mesh and as long
    (assumed), ending 0.64 of the half length from the middle; the bone alone is held.

    **Ridges.** False or "none"; "along" (True: those of the cross-section, whose crests run along the
    finger), "across", "whorl", "loop" or "arch" (`evfem.finger.fingerprint`), with the profile of
    `FingerPad`. Or a measured print: a `HeightMap`, the path of a csv file with the header x,z,height in mm,
    or of a grey image whose points are `ridge_pixel` mm apart, seen from below with the tip up, in which
    `ridge_dark` ("ridges", as scanners and ink show them, or "grooves") is black, and white `ridge_height`
    from it; `ridge_width` then says how finely the pad is divided. Ridges fade out towards
    the edges of the rectangle that is 0.64 of the pad's axes.

    **Layers and materials** are those of `FingerPad` (one table), nail and nail bed with `rim` "nail" alone.

    **Mesh.** Smooth about 5k, 12k and 43k nodes; with parallel ridges 22k, 34k and 115k, with curved ones
    53k, 83k and 193k; with a nail nearly twice as many. Sets of nodes: `pad` (the skin's surface), `bone`
    (with the cut, where the rim is fixed), `rim` (the cut), `nail` (its outer side). `mesh(1)` has linear
    hexahedra, twice as many in each direction.

    Raises `InputError` for values out of range and for geometry that cannot exist.

    >>> finger = Fingertip(ridges=False, resolution="coarse")
    >>> mesh = finger.mesh()
    >>> mesh.kind, sorted(mesh.node_sets), float(mesh.points[:, 1].min())
    ('hexahedron27', ['bone', 'pad', 'rim'], -6.395)
    >>> Fingertip(length=60.0)
    Traceback (most recent call last):
    evfem.errors.InputError: finger.length: given 60.0; allowed: 16 to 32 mm
    """

    ridges: Annotated[
        bool | str | os.PathLike[str] | HeightMap,
        {"allowed": _RIDGES, "type": bool | str | dict[str, list[Any]], "file": _is_file},
        "pattern of the fingerprint ridges, or a measured print",
    ] = "along"
    resolution: Annotated[
        str, one_of(*TIP_RESOLUTIONS), "smooth about 5k, 12k, 43k nodes; with ridges 22k, 34k, 115k and more"
    ] = "medium"
    length: Annotated[float, between(16.0, 32.0, "mm"), "full length of the ellipsoid"] = 22.5
    bone_length: Annotated[float, between(6.0, 28.0, "mm"), "full length of the bone"] = 17.0
    rim: Annotated[str, one_of(*RIMS), "what holds the edge of the lower half"] = "fixed"
    posture: Annotated[float, between(0.0, 45.0, "degrees"), "how far the tip is turned down"] = 0.0
    ridge_pixel: Annotated[float, between(0.005, 0.5, "mm"), "from point to point of a grey image"] = 0.05
    ridge_dark: Annotated[
        str | None, one_of("ridges", "grooves"), "what is dark in a grey image, which must be said"
    ] = None

    nail_thickness: NailThickness = thickness_of("nail")
    nail_width: NailWidth = 11.0
    beside = (NAIL,)

    def __post_init__(self) -> None:
        mistakes = Mistakes()
        with mistakes.of_a_part():
            check_fields(self, "finger.")
        with mistakes.of_a_part():
            if not mistakes.found:
                set_frozen(self, ridges=_ridges(self))
        mistakes.report()
        self._measured_sizes()
        self._with_default_laws()
        _check_shape(self, self._shape)

    @classmethod
    def sizes_of(cls, participant: str) -> dict[str, Any]:
        sizes = super().sizes_of(participant)
        length = data.load("table1").value(participant, "c") * math.cos(math.radians(HELD))
        return sizes | {"length": length, "bone_length": cls.bone_length * length / cls.length}

    @property
    def _summary(self) -> tuple[dict[str, str], set[str]]:
        facts = {
            "ellipsoid": f"{self.width:g} x {self.height:g} x {self.length:g} mm",
            "ridges": short(self.ridges),
            "rim": self.rim,
            "resolution": self.resolution,
        }
        return facts, {"width", "height", "length", *facts}

    def mesh(self, order: int = 2) -> Mesh:
        mesh = super().mesh(order)
        if isinstance(self.ridges, HeightMap):
            shape = float(scaled_jacobian(mesh).min())
            if not shape > SMALLEST_SHAPE:
                problem = f"a print that leaves cells with a scaled Jacobian of {shape:.2g}"
                allowed = "a smoother or lower print, or a finer finger.resolution or finger.ridge_width"
                raise InputError("finger.ridges", describe_value(problem), allowed)
        return mesh

    @property
    def _shape(self) -> Solid:
        outer = self._body
        axes = 0.5 * self.bone_width, 0.5 * self.bone_height, 0.5 * self.bone_length
        relief: Any = self.ridges
        if self.ridges == "none":
            relief = None
        elif isinstance(self.ridges, str):
            relief = FingerprintPattern(self.ridges, self._profile)
        return Solid(
            outer,
            Ellipsoid(*axes, self.bone_offset),
            layers=self.layers,
            thickness=tuple(getattr(self, layer.parameter) for layer in self.layers if layer.thickness),
            rows=tuple(layer.solid_rows.get(self.resolution, 1) for layer in self.layers),
            grid=self._grid(outer),
            relief=relief,
            rim_is_fixed=self.rim == "fixed",
            posture=self.posture,
            nail=Nail(self.nail_thickness, self.nail_width) if self.rim == "nail" else None,
        )

    @property
    def _body(self) -> Ellipsoid:
        """The smooth surface."""
        axes = 0.5 * self.width, 0.5 * self.height, 0.5 * self.length
        if self.outline == EXPONENTS.low:
            return Ellipsoid(*axes)
        section = outline_of(self.outline, 1.0, 1.0)
        return Body(*axes, section=section, m=getattr(section, "exponent", 2.0))

    @property
    def _usual(self) -> dict[str, Any]:
        laws = super()._usual
        return {name: law for name, law in laws.items() if self.rim == "nail" or name != NAIL.name}

    @property
    def _profile(self) -> Ridges:
        """The ridges' profile; how they fade is said in `evfem.finger.solid`."""
        shape = self.ridge_exponent, self.ridge_phase, self.ridge_crest, self.ridge_groove
        return Ridges(self.ridge_height, self.ridge_width, *shape, full=0.0, end=1.0)

    def _grid(self, outer: Ellipsoid) -> Grid:
        """Columns of the rectangle: fine under ridges, with lines on crests and grooves of parallel ones."""
        divisions = TIP_RESOLUTIONS[self.resolution]
        fine = self.ridges not in ("across", "none"), self.ridges not in ("along", "none")
        (across, *x), (along, *z) = (
            self._lines(axis, fine[k] and self.ridges in ("along", "across"), plain if not fine[k] else 0)
            for k, (axis, plain) in enumerate(((outer.a, divisions.across), (outer.c, divisions.along)))
        )
        merging = rows_that_merge(self.layers[0].solid_rows.get(self.resolution, 1), fine)
        return Grid((across, along), merging, divisions.sides, (x[0], z[0]), (x[1], z[1]))

    @property
    def ridge_cells(self) -> float:
        """Distances of nodes from crest to crest; 0 of a smooth pad."""
        divisions, parallel = TIP_RESOLUTIONS[self.resolution], self.ridges in ("along", "across")
        by_resolution = 2.0 * (divisions.per_ridge if parallel else divisions.per_curved_ridge)
        return 0.0 if self.ridges == "none" else self.cells_per_ridge or by_resolution

    @property
    def pressure_error(self) -> float:
        """Relative error of the peak contact pressure; of a smooth tip measured at .2 and .5 N."""
        cells, smooth = self.ridge_cells, {"coarse": 0.25, "medium": 0.1, "fine": 0.05}
        return pressure_error(cells) if cells else smooth[self.resolution]

    @property
    def gap_error(self) -> str:
        """What a posture costs, in words: the lowest point of a tip turned by more than about 20 degrees lies
        beside the rectangle of small cells. Measured on rigid, smooth tips 21 to 28 mm long against
        `outline_force`.
        """
        errors = {"coarse": "26 % at 0.25 mm, 96 % at 0.05", "medium": "7 % at 0.25 mm, 26 % at 0.05"}
        found = errors.get(self.resolution, "4 % at 0.25 mm, 13 % at 0.05")
        near = f"turned by {self.posture:g} degrees it touches beside its small cells"
        return (
            f"; {near}: attraction in hovering has an error of up to {found}" if self.posture > TURNED else ""
        )

    def _lines(self, axis: float, parallel: bool, plain: int) -> tuple[int, float, float]:
        """Columns of the rectangle at the bone (mm) and its ends: `plain`, or nine times that for ridges."""
        if plain:
            return plain, -RECTANGLE, RECTANGLE
        step = 18.0 * self.ridge_width / self.ridge_cells
        fitting = 2.0 * RECTANGLE * axis / step
        if not parallel:
            return max(round(fitting), 1), -RECTANGLE, RECTANGLE
        count = max(int(fitting + 0.1), 1)
        middle, half = ((self.ridge_phase + 0.25) % 0.5 - 0.25) * self.ridge_width, 0.5 * count * step
        return count, (middle - half) / axis, (middle + half) / axis


#: degrees up to which the lowest point of a tip lies in the rectangle
TURNED = 20.0
#: parametric fingers by their kinds in a file
FINGERS: Mapping[str, Any] = {"pad": FingerPad, "fingertip": Fingertip}


def _ridges(tip: Fingertip) -> str | HeightMap:
    """Name of the pattern, or the measured print."""
    pattern = tip.ridges
    if isinstance(pattern, HeightMap):
        return pattern
    if isinstance(pattern, Mapping) and set(pattern) == {"x", "z", "height"}:
        return HeightMap(**pattern)
    if isinstance(pattern, bool):
        return "along" if pattern else "none"
    if isinstance(pattern, str) and pattern in ("none", *PATTERNS):
        return pattern
    if isinstance(pattern, str | os.PathLike) and _is_file(os.fspath(pattern)):
        return fingerprint.read(Path(pattern), tip.ridge_pixel, tip.ridge_height, tip.ridge_dark)
    raise InputError("finger.ridges", describe_value(pattern), _RIDGES)


def _check_shape(tip: Fingertip, solid: Solid) -> None:
    """Raise InputError for inconsistent sizes."""
    skin = sum(solid.thickness)
    check_skin(skin, solid.outer.smallest_radius)
    check_cells(tip.cells_per_ridge, tip.ridges != "none")
    if (relief := tip.ridges) != "none":
        axis = tip.length if relief == "across" else tip.width
        check_at_most("ridge_width", tip.ridge_width, 0.045 * axis, "0.045 times the axis across the ridges")
        height = float(np.ptp(relief.height)) if isinstance(relief, HeightMap) else tip.ridge_height
        meaning = "0.7 times the stratum corneum's thickness"
        check_at_most("ridge_height", height, 0.7 * solid.thickness[0], meaning)
        if not isinstance(relief, HeightMap):
            check_profile(tip._profile)
    if solid.nail is not None:
        check_nail(tip.nail_thickness, tip.layers, solid.thickness)
        check_at_most("nail_width", tip.nail_width, 0.7 * tip.width, "0.7 times the width")
    angle = np.linspace(0.0, 0.5 * np.pi, 46)
    theta, phi = (grid.ravel() for grid in np.meshgrid(angle, angle))
    unit = np.column_stack([np.sin(theta) * np.cos(phi), -np.cos(theta), np.sin(theta) * np.sin(phi)])
    if solid.nail is not None:
        unit = np.vstack([unit, unit * [1.0, -1.0, 1.0]])
    inside = solid.outer.point(unit) - skin * solid.outer.normal(unit)
    bone = solid.bone
    check_bone("bone_length", inside - [0.0, bone.centre, 0.0], (bone.a, bone.b, bone.c))
