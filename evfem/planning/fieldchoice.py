"""Whether a scene needs the full field, decided by bounds that cost no solution."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from evfem.errors import InputError
from evfem.mesh.mesh import Mesh
from evfem.scene.electrics import without_field
from evfem.scene.scene import Scene
from evfem.surface.pad import make_pad
from evfem.terms.fullfield import Bounds, certificate, facing, in_line

#: `field = "auto"` solves for the field where the column law's energy may be too small by more than this
AUTO = 0.02


@dataclass(frozen=True)
class FieldChoice:
    """Whether the field is solved for, and the words of the plan."""

    full: bool
    reason: str


def chosen_field(scene: Scene, mesh: Mesh) -> FieldChoice:
    """The choice of a scene whose `field` is not `local`, by the worst of the bounds where motions end."""
    if mesh.dim == 3:
        if scene.field == "full":
            raise InputError("electrostatics.field", "full with a solid", "local or auto: the plane has it")
        return FieldChoice(False, "column by column: a solid has no other")
    against = without_field(scene)
    if against is not None:
        return FieldChoice(False, f"column by column: {against[0]} goes with no field")
    bounds, gap = max(
        ((field_bounds(scene, mesh, gap), gap) for gap in _gaps(scene)), key=lambda one: one[0].spread
    )
    share = f"{100.0 * bounds.spread:.2g} %"
    where = "at first touch" if gap == 0.0 else f"at a gap of {gap:g} mm"
    text = f"column by column the energy {where} is at most {share} too small"
    if scene.field == "auto":
        choice = "more than" if bounds.spread > AUTO else "less than"
        text += f", {choice} {100.0 * AUTO:g} %"
    full = scene.field == "full" or bounds.spread > AUTO
    return FieldChoice(full, f"{'solved for' if full else 'not solved for'}: {text}")


def _gaps(scene: Scene) -> list[float]:
    """Gaps (mm) of the undeformed pad where motions end: 0 and those above, without 0 if it only hovers."""
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
