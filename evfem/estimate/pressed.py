r"""The pad of the textures as it slides over a flat surface, and how it yields there.

On a flat surface, once all of its contact slips, the pad's nodes have moved by q relative to the bone and
carry the forces f. With the condensed tangent's compliance C, other forces f' move them by ``q + C (f' - f)``
to first order. `remember` takes these from the model at `LOADS` and `FRICTIONS`, for a smooth and a ridged
finger. In between, with bilinear weights w over the logarithm of the load and the friction,

.. math:: q(f') = \sum_k w_k \left(q_k - \tfrac12 C_k f_k\right) + \bar C\,(f' - \tfrac12 \bar f)

which is exact at what is stored, and in between where the compliance changes linearly with the
force. The file holds the triangles of C in half precision, packed by what each bit pattern differs
by from the one before: that the curves differ by less than they do from the model's is tested.
"""

from __future__ import annotations

import itertools
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import evfem
from evfem.common.arrays import Floats, Ints
from evfem.common.storage import load_arrays, save_arrays
from evfem.contact.signorini import OPEN
from evfem.estimate.parametric import SLIP_PER_FORCE, STEPS_BEFORE, Parametric, sliding
from evfem.newton.condensation import make_condensation
from evfem.simulation.run import Run
from evfem.surface.pad import outline_nodes
from evfem.surface.surfaces import Flat

FILE, FORMAT = "textures-pads.npz", "evfem-textures-pads-2"
#: what is remembered: loads (N/mm) and friction coefficients
LOADS, FRICTIONS = np.geomspace(0.02, 0.1, 5), np.array([0.1, 0.6])
#: nodes kept beyond those that touch on the flat surface, on either side
MARGIN = 14


@dataclass(frozen=True, eq=False)
class PressedPad:
    """n nodes of a pad under a `load` (N/mm), at `x`, `y` (n,) relative to the bone (mm) if unmoved. Forces F
    (2 n,), y first, move them by `base` + `compliance` F; `force` are those on a flat surface.
    """

    x: Floats
    y: Floats
    base: Floats
    compliance: Floats
    force: Floats
    load: float


@dataclass(frozen=True, eq=False)
class Remembered:
    """What is stored of one finger, for each of K loads and frictions: places (n, 2), displacements
    and forces (K, 2 n) and compliances (K, 2 n, 2 n), y components first.
    """

    points: Floats
    moved: Floats
    force: Floats
    compliance: Any

    def at(self, load: float, friction: float) -> PressedPad:
        """The pad under a load (N/mm) and friction within those stored: nodes that touch or nearly do."""
        weight = np.outer(_hats(np.log(LOADS), np.log(load)), _hats(FRICTIONS, friction)).ravel()
        n = len(self.points)
        force = weight @ self.force
        touching = np.flatnonzero(force[:n] > 0.0)
        near = np.arange(max(touching[0] - MARGIN, 0), min(touching[-1] + MARGIN + 1, n))
        both = np.concatenate([near, n + near])
        used = np.flatnonzero(weight)
        compliances = self.compliance[np.ix_(used, both, both)].astype(float)
        compliance = np.tensordot(weight[used], compliances, 1)
        half = np.einsum("kij,kj->ki", compliances, 0.5 * self.force[np.ix_(used, both)])
        base = weight[used] @ (self.moved[np.ix_(used, both)] - half) - 0.5 * compliance @ force[both]
        x, y = self.points[near].T
        return PressedPad(x, y, base, compliance, force[both], load)


def _hats(nodes: Floats, x: float) -> Floats:
    """Weights of linear interpolation at x between growing nodes."""
    return np.array([np.interp(x, nodes, unit) for unit in np.eye(nodes.size)])


@cache
def shipped_pad(ridged: bool) -> Remembered:
    """The pad of one finger that comes with evfem."""
    return read(Path(evfem.__file__).parent / "data" / FILE, ridged)


def read(path: Path, ridged: bool) -> Remembered:
    """The pad of one finger in a file that `write` wrote."""
    arrays = load_arrays(path, "pads", FORMAT)
    names = ("points", "moved", "force", "triangle")
    points, moved, force, packed = (arrays[f"{name}_{int(ridged)}"] for name in names)
    size = moved.shape[1]
    upper = np.triu_indices(size)
    compliance = np.zeros((len(moved), size, size), dtype=np.float32)
    steps = np.frombuffer(zlib.decompress(packed.tobytes()), np.int16).reshape(len(moved), -1)
    triangles = np.cumsum(steps, axis=1, dtype=np.int16).view(np.float16)
    compliance[:, upper[0], upper[1]] = triangles
    compliance[:, upper[1], upper[0]] = triangles
    return Remembered(points, moved, force, compliance)


def write(path: Path, pads: Mapping[bool, Remembered]) -> None:
    """Pads, by whether they are ridged, as a file."""
    arrays = {"format": np.array(FORMAT)}
    for ridged, pad in pads.items():
        upper = np.triu_indices(pad.moved.shape[1])
        triangles = pad.compliance[:, upper[0], upper[1]].astype(np.float16).view(np.int16)
        steps = np.diff(triangles, axis=1, prepend=np.int16(0))
        arrays |= {
            f"points_{int(ridged)}": pad.points,
            f"moved_{int(ridged)}": pad.moved,
            f"force_{int(ridged)}": pad.force,
            f"triangle_{int(ridged)}": np.frombuffer(zlib.compress(steps.tobytes(), 9), np.uint8),
        }
    save_arrays(path, arrays)


def remember(ridged: bool) -> Remembered:
    """Run the model on a flat surface at `LOADS` and `FRICTIONS` until all slips; what is stored of it."""
    cases = itertools.product(LOADS.tolist(), FRICTIONS.tolist())
    runs = [_slid(Parametric(friction=mu, load=load, ridged=ridged)) for load, mu in cases]
    mesh, pad = runs[0].model.mesh, runs[0].model.pad
    order = np.searchsorted(pad.nodes, outline_nodes(mesh))
    order = order[pad.free[order]]
    touching = np.flatnonzero(np.any([run.state.status[order] != OPEN for run in runs], axis=0))
    near = order[max(touching[0] - MARGIN, 0) : touching[-1] + MARGIN + 1]
    nodes = pad.nodes[near]
    moved = np.array([run.state.u[nodes] - run.state.bone for run in runs])
    force = np.array([run.model.equilibrium.interface.contact_forces(run.state)[near] for run in runs])
    compliance = np.stack([_compliance(run, nodes) for run in runs])
    return Remembered(mesh.points[nodes], _y_first(moved), _y_first(force), compliance)


def _y_first(vectors: Floats) -> Floats:
    """Vectors (K, n, 2) as (K, 2 n)."""
    return np.concatenate([vectors[:, :, 1], vectors[:, :, 0]], axis=1)


def _slid(finger: Parametric) -> Run:
    slide = SLIP_PER_FORCE * finger.friction * finger.load, STEPS_BEFORE
    run = Run(sliding(Flat(friction=finger.friction), finger, [slide], name="flat"), None)
    for request in run.requests():
        run.advance(request)
        run.frames.clear()
    return run


def _compliance(run: Run, nodes: Ints) -> Floats:
    """Condensed compliance (2 n, 2 n) of pad nodes, the bone held."""
    body = run.model.body
    unknowns = body.unknowns[nodes]
    order = np.concatenate([unknowns[:, 1], unknowns[:, 0], body.bone])
    factor = make_condensation(body.pattern, order, run.scene.solver.threads)
    factor.factorise(body.tangent(run.state.u))
    inverse = np.linalg.inv(factor.schur[:-2, :-2])
    return np.asarray(0.5 * (inverse + inverse.T))
