"""Choice between the column law and the full electric field, by bounds that need no field solution."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from evfem.errors import InputError
from evfem.mesh.mesh import Mesh
from evfem.scene.electrics import without_field
from evfem.scene.scene import IN_SPACE, Scene
from evfem.surface.pad import make_pad
from evfem.terms.fullfield import Bounds, certificate, facing, in_line

#: `field = "auto"` solves for the field if the relative error of the column law's energy may exceed this
AUTO = 0.02


@dataclass(frozen=True)
class FieldChoice:
    """Whether the full field is solved for, and the explanation printed by `plan`."""

    full: bool
    reason: str


def chosen_field(scene: Scene, mesh: Mesh) -> FieldChoice:
    """The choice for a scene whose `field` is not `local`, from the widest bounds at the ends of motions."""
    if mesh.dim == 3:
        if scene.field == "full":
            raise InputError("electrostatics.field", "full with a solid", f"local or auto: {IN_SPACE}")
        return FieldChoice(False, "not solved for: only the column law is available in three dimensions")
    against = without_field(scene)
    if against is not None:
        return FieldChoice(False, f"not solved for: not available with {against[0]}")
    bounds, gap = max(
        ((field_bounds(scene, mesh, gap), gap) for gap in _gaps(scene)), key=lambda one: one[0].spread
    )
    error = f"{100.0 * bounds.spread:.2g} %"
    where = "at first touch" if gap == 0.0 else f"at a gap of {gap:g} mm"
    text = f"{where} the column law's energy is at most {error} too small"
    if scene.field == "auto":
        choice = "more than" if bounds.spread > AUTO else "less than"
        text += f", {choice} the limit of {100.0 * AUTO:g} %"
    full = scene.field == "full" or bounds.spread > AUTO
    return FieldChoice(full, f"{'solved for' if full else 'not solved for'}: {text}")


def _gaps(scene: Scene) -> list[float]:
    """Gaps (mm) of the undeformed pad at the ends of motions; 0 (touch) included unless it only hovers."""
    moves = [course for course in scene.courses if course.distance or course.depth is not None]
    gaps = {max(-(course.indentation or 0.0), 0.0) for course in moves}
    return sorted(gaps if moves and all(course.hovers for course in moves) else {*gaps, 0.0})


def field_bounds(scene: Scene, mesh: Mesh, gap: float) -> Bounds:
    """Bounds of the undeformed pad's capacitance at a gap (mm)."""
    pad = make_pad(mesh)
    position = mesh.points[pad.nodes]
    line = in_line(pad, facing(pad, position))
    ground = scene.ground.height(position[:, 0])
    height = position[:, 1] - ground
    electrics = scene.electrics.above(scene.finger.electrical, mesh, pad.nodes)
    skin, insulator = (electrics.lossless(layer) for layer in (electrics.skin, electrics.insulator))
    reduced = np.asarray(skin.thickness) / skin.eps_r
    above = height - height.min() + gap
    levels = np.stack([ground, ground + above])[:, line]
    return certificate(position[line, 0], levels, insulator, reduced[line], electrics.gap_eps_r)
