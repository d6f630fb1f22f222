"""The finger: a user's mesh with its materials."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from evfem import meshfile
from evfem.errors import InputError
from evfem.mesh import Mesh, raised
from evfem.meshcheck import check


@dataclass(frozen=True)
class Electrical:
    """The dielectric between the pad's surface and the conducting tissue below.

    `stratum_corneum_thickness` in mm; None takes the local thickness of the region `stratum_corneum` of the mesh.
    """

    stratum_corneum_thickness: float | None = None
    stratum_corneum_eps_r: float = 1650.0

    def __post_init__(self) -> None:
        d, eps = self.stratum_corneum_thickness, self.stratum_corneum_eps_r
        if d is not None and not 0.0 < d < 10.0:
            raise InputError("finger.electrical.stratum_corneum_thickness", d, "a thickness up to 10 mm")
        if not 1.0 <= eps < 1e9:
            raise InputError("finger.electrical.stratum_corneum_eps_r", eps, "a number of at least 1")


@dataclass(frozen=True)
class MeshedFinger:
    """A finger on a mesh of the user's own: a file or a `Mesh`, one material law per region.

    `regions` maps names to numbers as in `meshfile.read`; `viscosity` is the relaxation time in s of every
    material that has none of its own. Raises `InputError` when the mesh and the materials do not fit.
    """

    source: str | os.PathLike[str] | Mesh
    materials: Mapping[str, Any]
    electrical: Electrical = field(default_factory=Electrical)
    viscosity: float = 0.0
    regions: Mapping[str, int] | None = None

    def mesh(self, order: int = 2) -> Mesh:
        """The mesh with cells of `order` 1 or 2; a linear mesh is raised with straight edges."""
        if order == 2:
            return raised(self._own)
        if self._own.order == 2:
            given = f"a linear element on a mesh of {self._own.kind}"
            raise InputError("solver.element", given, "q2 or q2p1 (p2 on triangles)")
        return self._own

    @cached_property
    def _own(self) -> Mesh:
        source = self.source
        return check(source) if isinstance(source, Mesh) else meshfile.read(source, self.regions)
