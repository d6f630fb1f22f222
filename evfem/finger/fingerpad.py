"""The finger: a parametric cross-section, or a user's mesh, with its materials.

`FingerPad` is the finger of the paper: outline, stratum corneum, ridges and moduli of its Table 2.
What the paper leaves open (thicknesses of the other layers, nail, bone, shape of the ridges) are
parameters with the defaults given there; every length is in mm.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from numbers import Integral
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from evfem.common.checks import check_fields, one_of, set_frozen, truth
from evfem.common.views import short
from evfem.errors import ABSENT, InputError, Mistakes, describe_value, unknown
from evfem.finger.layers import NAIL, thickness_of
from evfem.finger.outline import Ellipse, Ridges
from evfem.finger.scan import RidgeScan, ScannedRidges, is_texture
from evfem.finger.section import FULL, ZONE, Divisions, Section
from evfem.finger.sizes import (
    STEEPEST,
    Electrical,
    LayeredFinger,
    Materials,
    NailThickness,
    NailWidth,
    Relaxation,
    Skin,
    Viscosity,
    check_at_most,
    check_bone,
    check_cells,
    check_nail,
    check_profile,
    check_skin,
    pressure_error,
)
from evfem.mesh import file as meshfile
from evfem.mesh import memory, places
from evfem.mesh.mesh import Mesh, raised
from evfem.tissue.ogden import BulkRelaxes

#: The smallest and the largest ratio of height and width.
SLIMMEST = 0.5, 1.2

#: parameters that a scan of the ridges replaces, and the fraction of its depth that two nodes may miss
PROFILE = ("ridges", "ridge_height", "ridge_exponent", "ridge_phase", "ridge_crest", "ridge_groove")
MISSED = 0.5

#: resolution -> divisions in quadratic cells; the rows of each layer stand in `LAYERS`.
RESOLUTIONS: Mapping[str, Divisions] = {
    "coarse": Divisions(6, (("epidermis", 0), ("dermis", -1)), side=3, upper=3, nail=6),
    "medium": Divisions(12, (("epidermis", 0), ("dermis", -1)), side=5, upper=5, nail=10),
    "paper": Divisions(12, (("dermis", -2), ("dermis", -1)), side=5, upper=5, nail=26),
    "fine": Divisions(24, (("epidermis", 0), ("dermis", -1)), side=9, upper=9, nail=18),
}


def _ridges(key: str, value: Any) -> Any:
    """True, False, or a scan: what a file has in `ridge_scan`."""
    if isinstance(value, str):
        patterns = 'patterns and prints are those of a Fingertip (kind = "fingertip"), scans are `ridge_scan`'
        raise InputError(key, describe_value(value), f"true | false; {patterns}")
    return value if isinstance(value, RidgeScan) or is_texture(value) else truth(key, value)


RIDGES = {"allowed": "true | false", "type": bool, "check": _ridges}
_SCAN = str | dict[str, list[float]]


def _mesh(key: str, value: Any) -> Any:
    if not isinstance(value, str | os.PathLike) and not memory.is_mesh(value):
        raise InputError(key, describe_value(value), memory.ALLOWED)
    return value


_MESH = {"allowed": "the path of a mesh file", "check": _mesh}
_MESH |= {"key": "mesh", "type": str, "file": meshfile.LARGEST}


def _named(what: str, place: str) -> dict[str, Any]:
    """Rule of names that a file has otherwise: a number, a group, or a place."""
    allowed = f'a table name = number, name = "{what} of the file", or a place: {place}'

    def check(key: str, names: Any) -> Mapping[str, Any]:
        if not isinstance(names, Mapping):
            raise InputError(key, describe_value(names), allowed)
        for one in names.values():
            if isinstance(one, bool) or not isinstance(one, Integral | str | Mapping):
                raise InputError(key, describe_value(one), allowed)
        return names

    return {"allowed": allowed, "check": check}


Named = Mapping[str, int | str | Mapping[str, Any]] | None


@dataclass(frozen=True, repr=False)
class FingerPad(LayeredFinger):
    """The cross-section of a finger: an ellipse around (0, 0) with the pad below and the nail above.

    **Outline.** abs(x/a)**n + abs(y/b)**n = 1 with n = `outline`, by default 2, or the curve through the
    points of a measured cross-section (`evfem.finger.crosssection`), whose width and height the finger has.
    On its lower side fingerprint ridges, whose crests lie on that smooth outline at x = (k +
    `ridge_phase`) `ridge_width`. With t = abs(x - crest) / (`ridge_width`/2), x the abscissa of the point of
    the outline, a groove is `ridge_height` t**`ridge_exponent` deep, along the outline's normal; with
    `ridge_crest` > 0 crest and groove are flat instead, with cosine-shaped walls. Ridges fade out between
    0.72 and 0.79 of half the width (6.0 to 6.6 mm). `ridge_exponent` 7 is the shape that meets the ratio of
    ridge to gross contact area of Adams et al. (doi:10.1098/rsif.2012.0467) within 10 %. A `ridge_scan`, or
    as `ridges` a `RidgeScan` or a `Texture` of heights (of `evfem texture import`; its middle comes below the
    middle of the finger), replaces this profile; `ridge_width` then sets how finely the pad is
    divided.

    **Layers.** Interfaces are true normal offsets of the smooth outline and do not follow the ridges: the
    stratum corneum is `ridge_height` thinner in a groove. Its thickness, outline and ridges are Table 2 of
    the paper. Assumed, of the size that finger models use (for example doi:10.1115/1.1613673): epidermis and
    dermis. Below the nail everything down to the bone is dermis (the nail bed). The hypodermis fills the
    rest.

    **Nail and bone.** Nail 0.45 mm thick (measured 0.40 to 0.48 mm: Wollina et al., Skin Res.
    Technol. 7 (2001) 60-64), its width assumed. The bone is an ellipse of the benchmark problem's size,
    its centre assumed: there is more pulp than nail bed.

    **Mesh.** From coarse to fine 12, 24, 24 and 48 linear cells per ridge within about 3.5 mm of the middle;
    `paper` spreads its cells over the layers as the paper does. Sets of nodes: `pad` (the outline with y <=
    0), `bone`, `nail` (the outer side of the nail).

    Raises `InputError` for values out of range and for geometry that cannot exist.

    >>> from evfem.tissue.laws import NeoHookean
    >>> finger = FingerPad(resolution="coarse", materials={"nail": NeoHookean(E=20.0, nu=0.3)})
    >>> mesh = finger.mesh(order=1)
    >>> sorted(mesh.node_sets), mesh.kind, float(mesh.points[:, 1].min())
    (['bone', 'nail', 'pad'], 'quad', -6.395)
    >>> FingerPad(ridge_height=0.5)
    Traceback (most recent call last):
    evfem.errors.InputError: finger.ridge_height: given 0.5; allowed: 0.02 to 0.4 mm
    """

    ridges: Annotated[Any, RIDGES, "whether there are fingerprint ridges"] = True
    resolution: Annotated[str, one_of(*RESOLUTIONS), "about 3k, 10k, 22k, 50k nodes"] = "medium"
    ridge_scan: Annotated[
        RidgeScan | str | os.PathLike[str] | None,
        {"allowed": "the path of a csv file with the header x,height or x,y", "type": _SCAN, "file": True},
        "ridges as they were scanned",
    ] = None
    nail_thickness: NailThickness = thickness_of("nail")
    nail_width: NailWidth = 11.0
    beside = (NAIL,)

    def __post_init__(self) -> None:
        mistakes = Mistakes()
        with mistakes.of_a_part():
            check_fields(self, "finger.")
        with mistakes.of_a_part():
            if isinstance(self.ridges, RidgeScan) or is_texture(self.ridges):
                set_frozen(self, ridge_scan=self.ridges, ridges=True)
            if self.ridge_scan is not None:
                set_frozen(self, ridge_scan=RidgeScan.of(self.ridge_scan))
                _check_alone(self)
        mistakes.report()
        self._measured_sizes()
        self._with_default_laws()
        _check_section(self, self._shape)

    @property
    def _summary(self) -> tuple[dict[str, str], set[str]]:
        ridges = f"{self.ridge_height:g} mm high, every {self.ridge_width:g} mm" if self.ridges else "none"
        told = {"width", "height", "ridges", "ridge_scan", "ridge_height", "ridge_width", "resolution"}
        facts = {
            "cross-section": f"{self.width:g} x {self.height:g} mm",
            "ridges": ridges if self.ridge_scan is None else short(self.ridge_scan),
            "stratum corneum": f"{self.stratum_corneum_thickness:g} mm",
            "resolution": self.resolution,
        }
        return facts, told | {"stratum_corneum_thickness"}

    @property
    def _shape(self) -> Section:
        outer = self.outer
        bone = Ellipse(0.5 * self.bone_width, 0.5 * self.bone_height, self.bone_offset)
        ridges: Ridges | ScannedRidges | None = None
        if isinstance(self.ridge_scan, RidgeScan):
            scanned = self.ridge_scan.depths(outer)
            ridges = ScannedRidges(*scanned, self.ridge_width, FULL * outer.a, ZONE * outer.a)
        elif self.ridges:
            profile = (self.ridge_height, self.ridge_width, self.ridge_exponent, self.ridge_phase)
            ridges = Ridges(*profile, self.ridge_crest, self.ridge_groove, FULL * outer.a, ZONE * outer.a)
        divisions = RESOLUTIONS[self.resolution]
        if self.cells_per_ridge is not None:
            divisions = replace(divisions, per_ridge=self.cells_per_ridge // 2)
        return Section(
            outer,
            bone,
            layers=self.layers,
            thickness=tuple(getattr(self, layer.parameter) for layer in self.layers if layer.thickness),
            rows=tuple(layer.rows[self.resolution] for layer in self.layers),
            nail=self.nail_thickness,
            nail_width=self.nail_width,
            ridges=ridges,
            divisions=divisions,
        )

    @property
    def ridge_cells(self) -> float:
        """Distances of nodes from crest to crest; 0 of a smooth pad."""
        ridged = self.ridges or self.ridge_scan is not None
        return (self.cells_per_ridge or 2.0 * RESOLUTIONS[self.resolution].per_ridge) if ridged else 0.0

    @property
    def pressure_error(self) -> float:
        """Relative error of the peak contact pressure; of a smooth pad measured at .02 to .2 N/mm."""
        cells, smooth = self.ridge_cells, {"coarse": 0.1, "medium": 0.06, "paper": 0.06, "fine": 0.03}
        return pressure_error(cells) if cells else smooth[self.resolution]


def _check_alone(pad: FingerPad) -> None:
    """Refuse a formula of ridges, or none, beside scanned ones."""
    for name in PROFILE:
        if getattr(pad, name) != getattr(FingerPad, name):
            problem = f"{name} = {getattr(pad, name)} beside a scan"
            raise InputError(f"finger.{name}", problem, "one of the two: the scan has the ridges as they are")


def _check_section(pad: FingerPad, section: Section) -> None:
    """Raise InputError for inconsistent sizes."""
    (outermost, *_), (thickness, *_) = section.layers, section.thickness
    ridges, outer = section.ridges, section.outer
    check_cells(pad.cells_per_ridge, ridges is not None)
    low, high = SLIMMEST
    if not low * (1.0 - 1e-12) <= pad.height / pad.width <= high * (1.0 + 1e-12):
        raise InputError("finger.height", pad.height, f"{low:g} to {high:g} times finger.width")
    if ridges:
        check_at_most("ridge_width", ridges.pitch, 0.045 * pad.width, "0.045 times the width")
        height = "ridge_scan" if isinstance(ridges, ScannedRidges) else "ridge_height"
        meaning = f"0.7 times the {outermost.spoken}'s thickness"
        check_at_most(height, ridges.height, 0.7 * thickness, meaning)
        steeper = 1.0 / (1.0 - ridges.height * outer.below_ridges(FULL * outer.a))
        if isinstance(ridges, ScannedRidges):
            spacing = 0.5 * ridges.pitch / section.divisions.per_ridge
            _check_scan(ridges, ridges.steepest * steeper, spacing)
        else:
            check_profile(ridges, steeper)
    check_nail(pad.nail_thickness, section.layers, section.thickness)
    check_at_most("nail_width", pad.nail_width, 0.8 * pad.width, "0.8 times the width")
    skin = sum(section.thickness)
    check_skin(skin, outer.smallest_radius)
    theta = np.linspace(-np.pi, np.pi, 361)
    inside = outer.point(theta) - skin * outer.normal(theta)
    bone = section.bone
    check_bone("bone_height", inside - [0.0, bone.centre], (bone.a, bone.b))


def _check_scan(ridges: ScannedRidges, slope: float, spacing: float) -> None:
    missed, most = ridges.missed(spacing), MISSED * ridges.height
    if slope > STEEPEST or missed > most:
        problem = f"slopes up to {slope:.3g}, and {missed:.3g} mm of depth between two nodes"
        allowed = f"slopes up to {STEEPEST:g}, and at most {most:.3g} mm: a smoother scan, "
        raise InputError("finger.ridge_scan", problem, allowed + "or a finer finger.resolution")


@dataclass(frozen=True)
class MeshedFinger:
    """A finger on a mesh of the user's own: a file, a `Mesh`, a `meshio.Mesh`, a grid of PyVista, or the
    module `gmsh` with its current model; with the `regions` and `boundaries` of `meshfile.read`.

    A mesh in memory is kept as a `Mesh` with these names. It is read and checked at once: raises `InputError`
    when it is faulty or does not fit the materials.
    """

    source: Annotated[Any, _MESH, "a mesh of your own, in mm"]
    materials: Annotated[Materials, "the law of each region"]
    electrical: Skin = field(default_factory=Electrical)
    viscosity: Viscosity = 0.0
    regions: Annotated[
        Named,
        _named("group", f"{places.REST}, or {places.BOX}"),
        "what the file has by number, or without a name",
    ] = None
    boundaries: Annotated[
        Named, _named("set", places.PLACES), "sets that the file calls otherwise, or has not"
    ] = None
    relaxation: Relaxation = ()
    bulk_relaxation: BulkRelaxes = False

    def __post_init__(self) -> None:
        check_fields(self, "finger.")
        set_frozen(self, materials=dict(self.materials))
        if isinstance(self.source, str | os.PathLike):
            set_frozen(self, source=Path(self.source))
        else:
            own = memory.mesh_of(self.source, self.regions, self.boundaries)
            set_frozen(self, source=own, regions=None, boundaries=None)
        names = self._own.region_names
        for name in names:
            if name not in self.materials:
                raise InputError(
                    f"finger.materials.{name}", ABSENT, "a material for every region of the mesh"
                )
        for name in self.materials:
            if name not in names:
                raise unknown(f"finger.materials.{name}", name, tuple(names), "no such region")

    def mesh(self, order: int = 2) -> Mesh:
        """The mesh with cells of `order` 1 or 2; a linear mesh is raised with straight edges."""
        if order == 2:
            return raised(self._own)
        if self._own.order == 2:
            problem = f"a linear element on a mesh of {self._own.kind}"
            raise InputError("solver.element", problem, "q2 or q2p1 (p2 on triangles, hex27p1 on hexahedra)")
        return self._own

    @cached_property
    def _own(self) -> Mesh:
        source = self.source
        return source if isinstance(source, Mesh) else meshfile.read(source, self.regions, self.boundaries)
