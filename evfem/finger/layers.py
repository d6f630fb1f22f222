"""The layers of the finger pad: one row each, from the outline to the bone, and the nail.

A row has all that the package knows about a layer. A layer more is a row at its place in `LAYERS`, and its
thickness a parameter of `LayeredFinger`: the field `NAME_thickness`, with the default `thickness_of("NAME")`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from evfem.tissue.ogden import Ogden


class Moduli(NamedTuple):
    """Young's modulus (MPa) and Poisson's ratio."""

    E: float
    nu: float


class Thickness(NamedTuple):
    """Default and range of a layer's thickness (mm)."""

    default: float
    lowest: float
    highest: float


@dataclass(frozen=True)
class TissueLayer:
    """One layer of the cross-section, a region of its mesh.

    `number` is the region's in files and stays what it is when layers are added. `moduli` are
    those of the default neo-Hookean material. A layer without `thickness` fills what the others
    leave. `rows`: its rows of quadratic cells for each resolution of a cross-section, `solid_rows`
    of a whole pad, one where none is given (the nail has those of the layer that it replaces).
    """

    name: str
    number: int
    moduli: Moduli
    thickness: Thickness | None
    rows: Mapping[str, int] = field(default_factory=dict)
    solid_rows: Mapping[str, int] = field(default_factory=dict)

    @property
    def parameter(self) -> str:
        """The parameter of `FingerPad` that is its thickness."""
        return f"{self.name}_thickness"

    @property
    def spoken(self) -> str:
        """Its name in a sentence."""
        return self.name.replace("_", " ")


#: Table 2 of the paper.
TABLE_2: Mapping[str, Moduli] = {
    "stratum_corneum": Moduli(1.000, 0.30),
    "epidermis": Moduli(0.136, 0.30),
    "dermis": Moduli(0.080, 0.48),
    "hypodermis": Moduli(0.034, 0.48),
    "nail": Moduli(17.000, 0.30),
}

#: The layers of the pad, from the outline to the bone.
LAYERS: tuple[TissueLayer, ...] = (
    TissueLayer(
        name="stratum_corneum",
        number=0,
        moduli=TABLE_2["stratum_corneum"],
        thickness=Thickness(0.38, lowest=0.1, highest=0.8),
        rows={"coarse": 2, "medium": 4, "paper": 2, "fine": 8},
        solid_rows={"coarse": 1, "medium": 1, "fine": 1},
    ),
    TissueLayer(
        name="epidermis",
        number=1,
        moduli=TABLE_2["epidermis"],
        thickness=Thickness(0.47, lowest=0.15, highest=1.0),
        rows={"coarse": 2, "medium": 4, "paper": 11, "fine": 10},
        solid_rows={"coarse": 1, "medium": 1, "fine": 2},
    ),
    TissueLayer(
        name="dermis",
        number=2,
        moduli=TABLE_2["dermis"],
        thickness=Thickness(1.0, lowest=0.5, highest=2.0),
        rows={"coarse": 2, "medium": 4, "paper": 6, "fine": 14},
        solid_rows={"coarse": 1, "medium": 1, "fine": 2},
    ),
    TissueLayer(
        name="hypodermis",
        number=3,
        moduli=TABLE_2["hypodermis"],
        thickness=None,
        rows={"coarse": 3, "medium": 5, "paper": 6, "fine": 14},
        solid_rows={"coarse": 2, "medium": 2, "fine": 3},
    ),
)
#: Takes the place of the outermost layer on top; everything below it, down to the bone, is `NAIL_BED`.
NAIL = TissueLayer(
    name="nail",
    number=4,
    moduli=TABLE_2["nail"],
    thickness=Thickness(0.45, lowest=0.2, highest=1.0),
)
NAIL_BED = "dermis"


def thickness_of(name: str) -> float:
    """The default thickness (mm) of a layer that has one.

    >>> thickness_of("epidermis")
    0.47
    """
    (found,) = (layer.thickness for layer in (*LAYERS, NAIL) if layer.name == name and layer.thickness)
    return found.default


def stiffening_skin(exponent: float = 14.0, factor: float = 0.5) -> dict[str, Ogden]:
    """Materials of the four layers that stiffen with their stretch: one term of Ogden's law each.

    `factor` multiplies Table 2's moduli, which are the initial ones; `exponent` is alpha (2: the default
    tissue). That one such term describes skin, with an exponent that does not depend on the rate, was
    measured on pigs (Shergold, Fleck and Radford 2006, doi:10.1016/j.ijimpeng.2004.11.010). The two numbers
    are illustrative, chosen so that a finger's contact area falls in slip, as Delhaye et al. 2014 measured,
    where that of neo-Hookean skin changes by less than meshes differ.

    >>> skin = stiffening_skin()
    >>> skin["dermis"].alpha, round(skin["dermis"].shear_modulus, 5), round(0.5 * 0.080 / 2 / 1.48, 5)
    ((14.0,), 0.01351, 0.01351)
    """
    found = {}
    for layer in LAYERS:
        E, nu = layer.moduli
        shear = factor * 0.5 * E / (1.0 + nu)
        found[layer.name] = Ogden(mu=2.0 * shear / exponent, alpha=exponent, nu=nu)
    return found
