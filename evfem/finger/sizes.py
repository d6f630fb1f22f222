"""Parameters of cross-section and whole pad: ranges, meanings and consistency checks."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, ClassVar, Self

import numpy as np

from evfem import data
from evfem.common.arrays import Floats
from evfem.common.checks import Checked, Within, between, choice, number, set_frozen, whole
from evfem.common.views import called, changed, short, table
from evfem.errors import InputError, describe_value, unknown
from evfem.finger.crosssection import CrossSection, FingerOutline, outline_of
from evfem.finger.layers import LAYERS, NAIL, TissueLayer, thickness_of
from evfem.finger.outline import Outline, Ridges
from evfem.mesh.mesh import Mesh
from evfem.protocols import Material
from evfem.tissue.laws import LAWS, NeoHookean
from evfem.tissue.ogden import BRANCHES, BulkRelaxes, Pairs

#: Limits of what can be meshed: largest slope of the walls of rounded and of flat-topped ridges, smallest
#: distance between bone and dermis (mm), largest thickness of the skin over the surface's smallest radius.
STEEPEST, STEEPEST_FLAT, CLEARANCE, THICKEST = 4.88, 3.5, 0.3, 0.7

_PITCHES = {"of": "of the pitch"}


def thickness_range(name: str) -> dict[str, Any]:
    """Admissible range of a layer's thickness."""
    (found,) = (layer.thickness for layer in (*LAYERS, NAIL) if layer.name == name and layer.thickness)
    return between(found.lowest, found.highest, "mm")


NailThickness = Annotated[float, thickness_range("nail"), "of the nail"]
NailWidth = Annotated[float, between(4.0, 18.0, "mm"), "chord of the nail"]
FEWEST, MOST = 4, 96
CELLS = f"an even whole number from {FEWEST} to {MOST}"
Viscosity = Annotated[float, between(0.0, 1e3, "s"), "relaxation time of materials without their own"]
Relaxation = Annotated[Pairs, BRANCHES, "Maxwell branches of materials without their own"]
Materials = Annotated[
    Mapping[str, Material],
    {"allowed": "a table [finger.materials.NAME]", "kinds": lambda: LAWS, "tag": "law"},
    "laws of regions that are not to have Table 2's",
]
Skin = Annotated["Electrical", {"allowed": "a table [finger.electrical]"}, "the dielectric skin"]


@dataclass(frozen=True)
class Electrical(Checked):
    """The dielectric between the pad's surface and the conducting tissue below."""

    stratum_corneum_thickness: Annotated[
        float | None,
        number("a thickness in mm, larger than 0, up to 10", Within(0.0, 10.0, above=True), "mm"),
        "without it the region's local thickness",
    ] = None
    stratum_corneum_eps_r: Annotated[
        float, number("a relative permittivity from 1 to 1e9", Within(1.0, 1e9)), "relative permittivity"
    ] = 1650.0
    _table = "finger.electrical."


#: Parameters that are scaled with the width of a participant's finger.
WITH_WIDTH = (
    "nail_thickness",
    "nail_width",
    "bone_width",
    "bone_offset",
    "epidermis_thickness",
    "dermis_thickness",
)


@dataclass(frozen=True, repr=False)
class LayeredFinger:
    """A parametric finger: outline, ridges, layers and bone, with materials."""

    width: Annotated[float, between(12.0, 24.0, "mm"), "full width of the cross-section"] = 16.68
    height: Annotated[float, between(9.0, 20.0, "mm"), "full height of the cross-section"] = 12.79
    ridges: Any = True
    ridge_height: Annotated[
        float, between(0.02, 0.4, "mm"), "depth of the grooves; crests lie on the outline"
    ] = 0.15
    ridge_width: Annotated[float, between(0.3, 0.8, "mm"), "the pitch, from crest to crest"] = 0.50
    ridge_exponent: Annotated[
        float, between(2.0, 16.0), "depth = height t^exponent, t = 0 at a crest, 1 in a groove"
    ] = 7.0
    ridge_phase: Annotated[
        float, between(-1.0, 1.0, "pitches"), "0: a crest in the middle, 0.5: a groove"
    ] = 0.0
    ridge_crest: Annotated[
        float, between(0.0, 0.9, "pitches", **_PITCHES), "flat part of a crest; 0: rounded ridges"
    ] = 0.0
    ridge_groove: Annotated[
        float, between(0.0, 0.5, "pitches", **_PITCHES), "flat part of a groove, with flat crests"
    ] = 0.0
    # of each layer that has one: default and range stand in its row of `evfem.finger.layers.LAYERS`
    stratum_corneum_thickness: Annotated[float, thickness_range("stratum_corneum"), "at a crest"] = (
        thickness_of("stratum_corneum")
    )
    epidermis_thickness: Annotated[float, thickness_range("epidermis"), "of the living epidermis"] = (
        thickness_of("epidermis")
    )
    dermis_thickness: Annotated[float, thickness_range("dermis"), "of the dermis"] = thickness_of("dermis")
    bone_width: Annotated[float, between(2.0, 12.0, "mm"), "full width of the bone"] = 6.0
    bone_height: Annotated[float, between(2.0, 10.0, "mm"), "full height of the bone"] = 5.0
    bone_offset: Annotated[float, between(-1.0, 3.0, "mm"), "centre of the bone above that of the finger"] = (
        1.0
    )
    resolution: str = "medium"
    cells_per_ridge: Annotated[
        int | None,
        whole(MOST, FEWEST, CELLS),
        "distances of nodes from crest to crest (half as many quadratic cells); without it by resolution",
    ] = None
    materials: Materials = field(default_factory=dict)
    electrical: Skin = field(default_factory=Electrical)
    viscosity: Viscosity = 0.0
    relaxation: Relaxation = ()
    bulk_relaxation: BulkRelaxes = False
    outline: FingerOutline = 2.0
    layers: ClassVar[tuple[TissueLayer, ...]] = LAYERS
    beside: ClassVar[tuple[TissueLayer, ...]] = ()

    @classmethod
    def participant(cls, name: str, resolution: str = "medium", **more: Any) -> Self:
        """The finger of a participant of the paper's Table 1, by its number there ("i" to "xi").

        Width and height are the measured ones, the length of a `Fingertip` seen from above is the measured
        c cos 30 degrees; `more` are other parameters. Bone, nail, epidermis and dermis are scaled with the
        width or height (assumed); stratum corneum, ridges and moduli were not measured and are Table 2's.

        >>> from evfem.finger.fingerpad import FingerPad
        >>> FingerPad.participant("ii").width, round(FingerPad.participant("ii").bone_width, 3)
        (14.04, 5.05)
        >>> from evfem.finger.fingertip import Fingertip
        >>> finger = Fingertip.participant("ii", ridges=False)
        >>> finger.width, round(finger.length, 2), round(finger.bone_length, 2)
        (14.04, 22.23, 16.8)
        """
        return cls(resolution=resolution, **cls.sizes_of(name) | more)

    @classmethod
    def sizes_of(cls, participant: str) -> dict[str, Any]:
        """Parameters (mm) that differ from the defaults for a participant of Table 1."""
        measured = data.load("table1")
        choice("finger.participant", participant, tuple(measured["participant"]))
        width, height = measured.value(participant, "a"), measured.value(participant, "b")
        sizes = {key: getattr(cls, key) * width / cls.width for key in WITH_WIDTH if hasattr(cls, key)}
        sizes |= {"width": width, "height": height, "bone_height": cls.bone_height * height / cls.height}
        return sizes

    def __repr__(self) -> str:
        """Parameters that differ from Table 2."""
        return called(type(self).__name__, self._non_defaults())

    def _repr_html_(self) -> str:
        """For notebooks: a table of sizes, and of parameters that differ from Table 2."""
        facts, told = self._summary
        own = {name: short(value) for name, value in self._non_defaults(told).items()}
        return table(type(self).__name__, [*(facts | own).items()])

    def mesh(self, order: int = 2) -> Mesh:
        """The mesh: linear cells of order 1, or half as many divisions of quadratic ones of order 2."""
        if order not in (1, 2):
            raise InputError("order", describe_value(order), "1 or 2")
        mesh: Mesh = self._shape.mesh(order)
        return mesh

    def at(self, resolution: str) -> Self:
        """The same finger on the mesh of another resolution; `cells_per_ridge` of its own change as those of
        the resolutions do.

        >>> from evfem.finger.fingerpad import FingerPad
        >>> FingerPad(resolution="coarse", cells_per_ridge=16).at("medium")
        FingerPad(cells_per_ridge=32)
        """
        usual: Any = replace(self, cells_per_ridge=None)
        other: Any = replace(usual, resolution=resolution)
        if self.cells_per_ridge is None:
            return other
        cells = 2 * round(0.5 * self.cells_per_ridge * other.ridge_cells / usual.ridge_cells)
        return replace(other, cells_per_ridge=int(np.clip(cells, FEWEST, MOST)))

    @property
    def _shape(self) -> Any:
        """Geometry with its divisions (layers, bone, ridges); has a method `mesh`."""
        raise NotImplementedError

    @property
    def _summary(self) -> tuple[dict[str, str], set[str]]:
        """Rows of the notebook table that summarise the finger, and the parameters they contain."""
        raise NotImplementedError

    def _measured_sizes(self) -> None:
        """Width and height are those of a measured outline; InputError for others beside it."""
        if not isinstance(outline := self.outline, CrossSection):
            return
        for name in ("width", "height"):
            given, own = getattr(self, name), getattr(outline, name)
            if given not in (getattr(type(self), name), own):
                allowed = f"none, or {own!r}: points are in mm, and have their own {name}"
                raise InputError(f"finger.{name}", f"{given} beside a measured outline", allowed)
            set_frozen(self, **{name: own})

    @property
    def outer(self) -> Outline:
        """The smooth outline of the cross-section."""
        return outline_of(self.outline, 0.5 * self.width, 0.5 * self.height)

    def _with_default_laws(self) -> None:
        """Complete `materials`: layers without a law get that of Table 2."""
        if not isinstance(self.materials, Mapping):
            allowed = "a law for each region that is not to have that of Table 2"
            raise InputError("finger.materials", describe_value(self.materials), allowed)
        laws = self._usual
        for name in self.materials:
            if name not in laws:
                raise unknown(f"finger.materials.{name}", name, tuple(laws), "no such region")
        set_frozen(self, materials=laws | dict(self.materials))

    @property
    def _usual(self) -> dict[str, Any]:
        return {
            layer.name: NeoHookean(E=layer.moduli.E, nu=layer.moduli.nu)
            for layer in (*self.layers, *self.beside)
        }

    def _non_defaults(self, told: Collection[str] = ()) -> dict[str, Any]:
        """Parameters that differ from their defaults, without those in `told`."""
        laws = {name: law for name, law in self.materials.items() if law != self._usual[name]}
        found = {name: value for name, value in changed(self).items() if name not in (*told, "materials")}
        return found | ({"materials": laws} if laws else {})


def check_at_most(name: str, value: float, limit: float, meaning: str, unit: str = " mm") -> None:
    """Raise InputError if a size exceeds a limit that follows from other sizes."""
    if value > limit * (1.0 + 1e-12):
        raise InputError(f"finger.{name}", value, f"at most {limit:.4g}{unit} ({meaning})")


def check_skin(skin: float, radius: float) -> None:
    """Raise InputError if the layers are thicker than `THICKEST` times the smallest radius of curvature."""
    deepest = [layer for layer in LAYERS if layer.thickness][-1]
    meaning = f"{THICKEST:g} times the surface's smallest radius, together with the layers above it"
    check_at_most(deepest.parameter, skin, THICKEST * radius, meaning)


def check_nail(nail: float, layers: Sequence[TissueLayer], thickness: Sequence[float]) -> None:
    """Raise InputError if the nail reaches too far into the second layer."""
    meaning = f"{layers[0].spoken} + 0.7 {layers[1].spoken}"
    check_at_most("nail_thickness", nail, thickness[0] + 0.7 * thickness[1], meaning)


def check_profile(ridges: Ridges, steeper: float = 1.0) -> None:
    """Raise InputError if flat crests and grooves leave no walls, or if walls are too steep to mesh."""
    check_at_most("ridge_crest", ridges.crest + ridges.groove, 0.9, "together with finger.ridge_groove", "")
    slope, limit = ridges.steepest * steeper, STEEPEST_FLAT if ridges.crest > 0.0 else STEEPEST
    if slope > limit:
        allowed = f"slopes up to {limit:g}: lower or wider ridges, a smaller ridge_exponent or ridge_crest"
        raise InputError("finger.ridge_height", f"walls with a slope of {slope:.3g}", allowed)


def area_error(cells: float) -> float:
    """Relative error of the real contact width or area of ridges with `cells` linear cells per ridge.

    Measured with the ridges of Table 2 at .02 and .05 N/mm against 96 cells: 34 % with 6, 8 % with 12,
    4 % with 24, 2 % with 48.

    >>> [round(area_error(cells), 3) for cells in (6, 12, 48)]
    [0.361, 0.09, 0.019]
    """
    return max(13.0 / cells**2, 0.9 / cells)


def pressure_error(cells: float) -> float:
    """Relative error of the peak contact pressure of ridges with `cells` linear cells per ridge; it zigzags
    with the nodes at the edges of crests.

    Measured with the ridges of Table 2 at .02, .05, .1 and .2 N/mm against 96 cells: up to 29 % with 6, 24 %
    with 12, 7 % with 24, 5 % with 48; 28 % with 12 after a slide.

    >>> [round(pressure_error(cells), 3) for cells in (6, 12, 48)]
    [0.583, 0.292, 0.073]
    """
    return 3.5 / cells


def check_cells(cells: int | None, ridged: bool) -> None:
    """Raise InputError if `cells_per_ridge` is odd, or set for a pad without ridges."""
    if cells is not None and not ridged:
        raise InputError("finger.cells_per_ridge", f"{cells} without ridges", "a pad with ridges")
    if cells is not None and cells % 2:
        raise InputError("finger.cells_per_ridge", cells, CELLS)


def check_bone(name: str, from_bone: Floats, axes: tuple[float, ...]) -> None:
    """Raise InputError if the bone (half axes (d,)) is too close to the dermis: its inner points (N, d),
    relative to the centre of the bone.
    """
    clear = (1.0 - 1.0 / np.linalg.norm(from_bone / axes, axis=1)) * np.linalg.norm(from_bone, axis=1)
    if not clear.min() >= CLEARANCE:
        problem = f"a bone that leaves {clear.min():.3g} mm to the dermis"
        allowed = f"at least {CLEARANCE:g} mm all around: a smaller or lower bone, or thinner layers"
        raise InputError(f"finger.{name}", problem, allowed)
