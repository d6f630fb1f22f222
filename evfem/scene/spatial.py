"""What a finger in three dimensions, or in the plane, cannot do yet, and the memory of its runs.

`check_space` refuses in one sentence each what no run could use; nothing has been computed then.
"""

from __future__ import annotations

import os
from collections.abc import Iterator

from evfem.errors import InputError, Mistakes
from evfem.mesh.mesh import Mesh
from evfem.scene.scene import IN_SPACE, Scene
from evfem.surface.skin import make_skin

SOLID, PLANE = "with a finger in three dimensions", "with a finger in the plane"
#: memory of a run (bytes): of Python and its packages; of mesh, tangent and factors, by dimension, which grow
#: with the power of a thousand nodes; in space of the dense matrices of contact, which grow with the square
#: of the skin's nodes, of which a fifth may touch. Fitted to peaks of pads and benchmarks with 3,000 to
#: 495,000 nodes (factors in double precision take more), and of fingers with 5,000 to 53,000 nodes.
PACKAGES, BODY, CONTACT = {2: 0.095e9, 3: 0.13e9}, {2: (6.5e6, 1.0), 3: (0.019e9, 1.1)}, {2: 0.0, 3: 10.0}


def check_space(scene: Scene, mesh: Mesh) -> None:
    """Raise InputError for what a finger of this mesh cannot do."""
    mistakes = Mistakes()
    beyond = _beyond_space(scene, mesh) if mesh.dim == 3 else _beyond_plane(scene)
    mistakes.found = [InputError(*one) for one in beyond]
    mistakes.report()


def _beyond_plane(scene: Scene) -> Iterator[tuple[str, str, str]]:
    for i, course in enumerate(scene.courses):
        if course.angle != 0.0:
            yield f"motion[{i}].angle", f"{course.angle:g} degrees {PLANE}", "0, or a Fingertip"
    if scene.ground.crosses:
        allowed = "a surface at angle 0 whose height and friction are the same along z, or a Fingertip"
        yield "surface", f"heights or friction over x and z {PLANE}", allowed


def _beyond_space(scene: Scene, mesh: Mesh) -> Iterator[tuple[str, str, str]]:
    skin = make_skin(mesh)
    apart, layers = skin.spacing(mesh.points[skin.nodes]), getattr(scene.ground.elastic, "layers", ())
    if layers and layers[0].thickness < apart:
        allowed = f"an upper layer at least as thick as the pad's nodes are apart, {apart:.2g} mm"
        yield "surface.elastic", f"one {layers[0].thickness:g} mm thick {SOLID}", allowed
    if scene.solver.contact != "exact":
        yield "solver.contact", f"{scene.solver.contact} {SOLID}", "exact"
    if scene.law is not None and scene.field != "local":
        yield "electrostatics.field", f"{scene.field} {SOLID}", f"local: {IN_SPACE}"
    if scene.depth is not None:
        yield "depth", f"{scene.depth:g} {SOLID}", "no depth: its forces are in N already"


def needed_memory(mesh: Mesh) -> float:
    """Memory (bytes) that a run takes at most, within 40 %; in space where its tissue is not nearly
    incompressible.

    >>> from evfem.finger.fingertip import Fingertip
    >>> f"{needed_memory(Fingertip(resolution='coarse').mesh()) / 1e9:.1f} GB"
    '0.8 GB'
    """
    each, growth = BODY[mesh.dim]
    skin = float(len(mesh.node_sets["pad"]))
    return PACKAGES[mesh.dim] + each * (len(mesh.points) / 1000.0) ** growth + CONTACT[mesh.dim] * skin**2


def check_memory(mesh: Mesh) -> None:
    """Raise InputError where a finger needs more memory than there is."""
    needed, there = needed_memory(mesh), physical_memory()
    if needed > there:
        given = f"{len(mesh.points)} nodes, whose direct solver needs about {needed / 1e9:.2g} GB of memory"
        allowed = (
            f"what fits into the {there / 1e9:.2g} GB of this machine: a coarser resolution, or fewer ridges"
        )
        raise InputError("finger", given, allowed)


def physical_memory() -> float:
    """Bytes of memory of this machine; no limit where the system does not say."""
    try:
        return float(os.sysconf("SC_PHYS_PAGES")) * float(os.sysconf("SC_PAGE_SIZE"))
    except (AttributeError, OSError, ValueError):
        return float("inf")
