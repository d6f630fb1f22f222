"""Cells in blocks of `LANES`, the last axis of every array: loops over it become vector
instructions.

Part of `evfem[fast]`: `Cells` is what the compiled loops of `elastic` and `viscous` read, and the
few lines that they share. With H = grad u the volume change is e = J - 1 = tr H + det H, and ln J
= ln(1 + e) keeps its digits where tissue is nearly incompressible.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numba.core import event

from evfem.common.arrays import Floats, Ints
from evfem.common.notices import LOG

LANES = 16
#: beyond this square of e / (2 + e), |ln J| about 1/3, the series of ln J is too short
FAR = 0.028


class _Compiling(event.Listener):
    """Says that loops of this package are being compiled: the first run of an installation waits
    for it.
    """

    said = False

    def on_start(self, event: Any) -> None:
        ours = event.data["dispatcher"].py_func.__module__.startswith("evfem.")
        if ours and not self.said:
            self.said = True
            LOG.info("compiling the element loops, once after an installation: up to a minute")

    def on_end(self, event: Any) -> None:
        pass


COMPILING = _Compiling()
event.register("numba:compile", COMPILING)

compiled = njit(cache=True, error_model="numpy", fastmath={"contract"})
inlined = njit(cache=True, error_model="numpy", fastmath={"contract"}, inline="always")


class Cells(NamedTuple):
    """A space in blocks: `nodes` (B, n, L), `gradient` (B, Q, n, 2, L), `weight` (B, Q, L);
    `sample` (B, S, n, 2, L), with S = 0 if ln J is sampled where it is integrated; `projection`
    (B, Q, S, L), (B, 0, 0, L) if theta = ln J pointwise. What fills the last block weighs nothing.
    """

    nodes: Ints
    gradient: Floats
    weight: Floats
    sample: Floats
    projection: Floats


def blocked(values: Any) -> Any:
    """(E, ...) as (B, ..., L), filled up with zeros."""
    blocks = -(-len(values) // LANES)
    filled = np.zeros((blocks * LANES, *values.shape[1:]), dtype=values.dtype)
    filled[: len(values)] = values
    return np.ascontiguousarray(np.moveaxis(filled.reshape(blocks, LANES, *values.shape[1:]), 1, -1))


@inlined
def gather(u: Any, nodes: Any, ue: Any) -> None:
    """Displacements (n, 2, L) of a block's nodes (n, L)."""
    for k in range(nodes.shape[0]):
        for i in range(LANES):
            ue[k, 0, i] = u[nodes[k, i], 0]
            ue[k, 1, i] = u[nodes[k, i], 1]


@inlined
def spread(fe: Any, nodes: Any, out: Any) -> None:
    """Add a block's forces (n, 2, L) to the nodes'."""
    for k in range(nodes.shape[0]):
        for i in range(LANES):
            node = nodes[k, i]
            out[node, 0] += fe[k, 0, i]
            out[node, 1] += fe[k, 1, i]


@inlined
def displacement_gradient(ue: Any, gradient: Any, H: Any) -> None:
    """H = grad u (4, L) as 11, 12, 21, 22 of one point from shape gradients (n, 2, L)."""
    H[:] = 0.0
    for k in range(gradient.shape[0]):
        for i in range(LANES):
            x, y = ue[k, 0, i], ue[k, 1, i]
            gx, gy = gradient[k, 0, i], gradient[k, 1, i]
            H[0, i] += x * gx
            H[1, i] += x * gy
            H[2, i] += y * gx
            H[3, i] += y * gy


@inlined
def volume(H: Any, inverse: Any, log_J: Any) -> None:
    """F^-T (4, L) and ln J (L,) of one point; ln J is nan where the cell is inverted.

    ln J = 2 artanh(z), z = e / (2 + e), by its series where z is small.
    """
    far = 0.0
    for i in range(LANES):
        e = H[0, i] + H[3, i] + (H[0, i] * H[3, i] - H[1, i] * H[2, i])
        share = 1.0 / (1.0 + e)
        inverse[0, i] = (1.0 + H[3, i]) * share
        inverse[1, i] = -H[2, i] * share
        inverse[2, i] = -H[1, i] * share
        inverse[3, i] = (1.0 + H[0, i]) * share
        z = e / (2.0 + e)
        s = z * z
        p = s / 21.0 + 1.0 / 19.0
        p = p * s + 1.0 / 17.0
        p = p * s + 1.0 / 15.0
        p = p * s + 1.0 / 13.0
        p = p * s + 1.0 / 11.0
        p = p * s + 1.0 / 9.0
        p = p * s + 1.0 / 7.0
        p = p * s + 1.0 / 5.0
        p = p * s + 1.0 / 3.0
        log_J[i] = 2.0 * z * (p * s + 1.0)
        far = max(far, s if e > -1.0 else 1.0)
    if not far <= FAR:
        for i in range(LANES):
            log_J[i] = np.log1p(H[0, i] + H[3, i] + (H[0, i] * H[3, i] - H[1, i] * H[2, i]))
