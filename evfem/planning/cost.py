r"""Memory and CPU time of a run, before it is begun.

The time is that of the packages and the mesh plus that of the steps, which grows with the nodes N. In the
plane

.. math:: t = t_0 + c\,(N/1000)^{1.3}\,s^{0.77}\,(1 + 2.15\,(p/\mu)^{0.26}) \prod_i f_i

with the attraction p of touching skin at the largest voltage relative to the softest shear modulus
:math:`\mu`, and factors f of a full field and a relief; in space :math:`t = t_0 + c\,(N/1000)^{1.5}\,s`.
Steps that press count in s, and others by `SLIDING`, since they seldom factorise. Iterations are not known
beforehand: where contact snaps from crest to crest they are ten times those of a press. What is said is
therefore a range.

Fitted to the CPU times of 330 scenes in the plane and 40 fingertips of `evfem study campaign` (seeds 77 and
4711), and of thirteen fingertips with 5,000 to 53,000 nodes; nine of ten lie within.
"""

from __future__ import annotations

import numpy as np

from evfem.mesh.mesh import Mesh
from evfem.planning.plausibility import touching_traction
from evfem.scene.scene import Scene
from evfem.scene.spatial import needed_memory
from evfem.tissue.laws import split

#: seconds of packages and mesh, and of a step with 1,000 nodes by dimension
BEGINNING, STEP = 0.7, {2: 0.0069, 3: 0.02}
#: a step that slides relative to one that presses
SLIDING = {2: 0.72, 3: 0.15}
#: factors in the plane of a full field and of a relief; in space they are within the range
FULL_FIELD, RELIEF = 2.9, 1.6
#: an attraction over the shear modulus that counts as strong, and what one not known beforehand is taken for
STRONG, UNKNOWN = 0.1, 0.3
#: seconds of a step above an elastic surface in space with 1,000 pad nodes, stiff and soft
SINKING = (6.0, 60.0)
#: range about the estimate: without a strong attraction, with it, and with it on a relief
CALM, ATTRACTED, SNAPPING = (0.4, 2.5), (0.3, 3.5), (0.3, 10.0)


def needed_time(scene: Scene, mesh: Mesh) -> tuple[float, float]:
    """CPU time (s), from and to, of a run with compiled loops, on the processor of
    `docs/performance.md`; nine of ten drawn scenes lie within.
    """
    pressing = sum(motion.steps for motion in scene.motion if motion.course.presses)
    others = sum(motion.steps for motion in scene.motion) - pressing
    steps, thousands = pressing + SLIDING[mesh.dim] * others, len(mesh.points) / 1000.0
    pulled, relief = _attraction(scene, mesh), not scene.ground.is_flat
    if mesh.dim == 2:
        stepping = thousands**1.3 * steps**0.77 * (1.0 + 2.15 * pulled**0.26)
        stepping *= (FULL_FIELD if scene.field != "local" else 1.0) * (RELIEF if relief else 1.0)
    else:
        stepping = thousands**1.5 * steps
    middle = BEGINNING + STEP[mesh.dim] * stepping
    least, most = CALM if pulled < STRONG else SNAPPING if relief else ATTRACTED
    sunk = np.array(SINKING) * _sinking(scene, mesh)
    return float(least * middle + sunk[0]), float(most * middle + sunk[1])


def _sinking(scene: Scene, mesh: Mesh) -> float:
    """Squared thousands of pad nodes times steps, above an elastic surface in space: each iteration makes its
    compliance anew.
    """
    if mesh.dim == 2 or scene.ground.elastic is None:
        return 0.0
    return (len(mesh.node_sets["pad"]) / 1000.0) ** 2 * scene.total_steps


def _attraction(scene: Scene, mesh: Mesh) -> float:
    """Attraction of touching skin over the softest shear modulus; `UNKNOWN` where a run decides it."""
    if not scene.electrics.acts:
        return 0.0
    traction = touching_traction(scene)
    softest = min(split(law, mesh.dim).shear_modulus for law in scene.finger.materials.values())
    return UNKNOWN if traction is None else traction / softest


def needs(scene: Scene, mesh: Mesh) -> str:
    """Memory and time of a run in a sentence."""
    least, most = (f"{float(f'{seconds:.1g}'):g}" for seconds in needed_time(scene, mesh))
    snaps = ", most where contact snaps" if _attraction(scene, mesh) >= STRONG else ""
    memory = needed_memory(mesh) / 1e9
    return f"a run takes about {memory:.2g} GB of memory and {least} to {most} s of CPU time{snaps}"
