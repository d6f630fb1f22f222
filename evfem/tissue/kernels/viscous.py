"""Compiled element loops for the Kelvin-Voigt stress, part of `evfem[fast]`: twins of
`kelvin_voigt`.

S = 2 r (E - E0), r = eta / time step, E = (H + H^T + H^T H)/2 with H = grad u. Cells come in
blocks (`evfem.tissue.kernels.lanes`), strains as (B, Q, 3, L) for 11, 22, 12, rates r as (B, L);
blocks without viscosity are skipped. For the plane alone.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.tissue.kernels.lanes import LANES, Cells, compiled, displacement_gradient, gather, inlined, spread


@inlined
def _strain(H: Any, strain: Any) -> None:
    """Green strain (3, L) of H (4, L)."""
    for i in range(LANES):
        a, b, c, d = H[0, i], H[1, i], H[2, i], H[3, i]
        strain[0, i] = a + 0.5 * (a * a + c * c)
        strain[1, i] = d + 0.5 * (b * b + d * d)
        strain[2, i] = 0.5 * (b + c + a * b + c * d)


@compiled
def strains(u: Floats, cells: Cells) -> Floats:
    """Green strains of all points (B, Q, 3, L)."""
    B, Q, n = cells.gradient.shape[:3]
    out = np.empty((B, Q, 3, LANES))
    ue, H = np.empty((n, 2, LANES)), np.empty((4, LANES))
    for b in range(B):
        gather(u, cells.nodes[b], ue)
        for q in range(Q):
            displacement_gradient(ue, cells.gradient[b, q], H)
            _strain(H, out[b, q])
    return out


@inlined
def _stress(ue: Any, gradient: Any, weighted: Any, strain0: Any, F: Any, S: Any) -> None:
    """F (4, L) and the weighted S (3, L) of one point; `weighted` (L,) r times the weight."""
    displacement_gradient(ue, gradient, F)
    _strain(F, S)
    for i in range(LANES):
        for j in range(3):
            S[j, i] = 2.0 * weighted[i] * (S[j, i] - strain0[j, i])
        F[0, i] += 1.0
        F[3, i] += 1.0


@compiled
def forces(u: Floats, rate: Floats, cells: Cells, strain0: Floats) -> Floats:
    """Nodal forces (N, 2)."""
    B, Q, n = cells.gradient.shape[:3]
    out = np.zeros_like(u)
    ue, fe, weighted = np.empty((n, 2, LANES)), np.empty((n, 2, LANES)), np.empty(LANES)
    F, S = np.empty((4, LANES)), np.empty((3, LANES))
    for b in range(B):
        if not rate[b].any():
            continue
        gather(u, cells.nodes[b], ue)
        fe[:] = 0.0
        for q in range(Q):
            weighted[:] = rate[b] * cells.weight[b, q]
            _stress(ue, cells.gradient[b, q], weighted, strain0[b, q], F, S)
            for k in range(n):
                for i in range(LANES):
                    gx, gy = cells.gradient[b, q, k, 0, i], cells.gradient[b, q, k, 1, i]
                    tx, ty = S[0, i] * gx + S[2, i] * gy, S[2, i] * gx + S[1, i] * gy
                    fe[k, 0, i] += F[0, i] * tx + F[1, i] * ty
                    fe[k, 1, i] += F[2, i] * tx + F[3, i] * ty
        spread(fe, cells.nodes[b], out)
    return out


@inlined
def _add_pair(k: int, m: int, gradient: Any, weighted: Any, B: Any, S: Any, push: Any, K: Any) -> None:
    """Add one point's stiffness between nodes k and m to K (4, L); B = F F^T (3, L), push = F grad
    (n, 2, L).
    """
    for i in range(LANES):
        gx, gy, hx, hy = gradient[k, 0, i], gradient[k, 1, i], gradient[m, 0, i], gradient[m, 1, i]
        r = weighted[i]
        inner = r * (gx * hx + gy * hy)
        stress = (S[0, i] * gx + S[2, i] * gy) * hx + (S[2, i] * gx + S[1, i] * gy) * hy
        K[0, i] += stress + inner * B[0, i] + r * push[m, 0, i] * push[k, 0, i]
        K[1, i] += inner * B[2, i] + r * push[m, 0, i] * push[k, 1, i]
        K[2, i] += inner * B[2, i] + r * push[m, 1, i] * push[k, 0, i]
        K[3, i] += stress + inner * B[1, i] + r * push[m, 1, i] * push[k, 1, i]


@inlined
def _point(F: Any, gradient: Any, B: Any, push: Any) -> None:
    """B = F F^T (3, L) and F grad (n, 2, L) of one point."""
    for i in range(LANES):
        B[0, i] = F[0, i] * F[0, i] + F[1, i] * F[1, i]
        B[1, i] = F[2, i] * F[2, i] + F[3, i] * F[3, i]
        B[2, i] = F[0, i] * F[2, i] + F[1, i] * F[3, i]
    for k in range(gradient.shape[0]):
        for i in range(LANES):
            gx, gy = gradient[k, 0, i], gradient[k, 1, i]
            push[k, 0, i] = F[0, i] * gx + F[1, i] * gy
            push[k, 1, i] = F[2, i] * gx + F[3, i] * gy


@compiled
def add_tangent(u: Floats, rate: Floats, cells: Cells, strain0: Floats, out: Floats) -> None:
    """Add the tangents of `forces` to the cell matrices (E, 2 n, 2 n)."""
    blocks, Q, n = cells.gradient.shape[:3]
    ue, weighted = np.empty((n, 2, LANES)), np.empty((Q, LANES))
    F, S, B = np.empty((4, LANES)), np.empty((Q, 3, LANES)), np.empty((Q, 3, LANES))
    push, K = np.empty((Q, n, 2, LANES)), np.empty((4, LANES))
    for b in range(blocks):
        if not rate[b].any():
            continue
        gather(u, cells.nodes[b], ue)
        for q in range(Q):
            weighted[q] = rate[b] * cells.weight[b, q]
            _stress(ue, cells.gradient[b, q], weighted[q], strain0[b, q], F, S[q])
            _point(F, cells.gradient[b, q], B[q], push[q])
        for k in range(n):
            for m in range(k, n):
                K[:] = 0.0
                for q in range(Q):
                    _add_pair(k, m, cells.gradient[b, q], weighted[q], B[q], S[q], push[q], K)
                _add(K, k, m, b * LANES, out)


@inlined
def _add(K: Any, k: int, m: int, first: int, out: Any) -> None:
    """Add the stiffness (4, L) of nodes k and m, and its transpose, to the matrices of a block's
    cells.
    """
    for i in range(min(LANES, out.shape[0] - first)):
        cell = out[first + i]
        for j in range(4):
            row, column = 2 * k + j // 2, 2 * m + j % 2
            cell[row, column] += K[j, i]
            if k != m:
                cell[column, row] += K[j, i]
