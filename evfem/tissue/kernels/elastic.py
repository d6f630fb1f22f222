"""Compiled element loops for neo-Hookean tissue, part of `evfem[fast]`: twins of the form
`neo_hookean`.

psi = mu/2 (F:F - 2 - 2 theta) + lmbda/2 theta^2, so S = mu F, q = lmbda theta - mu, and the only
moduli are mu (per gradient component) and lmbda (for theta). Cells come in blocks
(`evfem.tissue.kernels.lanes`), moduli as (B, L). For the plane alone.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.tissue.kernels.lanes import (
    LANES,
    Cells,
    compiled,
    displacement_gradient,
    gather,
    inlined,
    spread,
    volume,
)


@inlined
def _states(ue: Any, gradient: Any, sample: Any, H: Any, inverse: Any, log_J: Any) -> None:
    """H (Q, 4, L) at the points of a block, F^-T (S, 4, L) and ln J (S, L) at its samples."""
    for q in range(gradient.shape[0]):
        displacement_gradient(ue, gradient[q], H[q])
    if sample.shape[0] == 0:
        for s in range(gradient.shape[0]):
            volume(H[s], inverse[s], log_J[s])
        return
    Hs = np.empty((4, LANES))
    for s in range(sample.shape[0]):
        displacement_gradient(ue, sample[s], Hs)
        volume(Hs, inverse[s], log_J[s])


@inlined
def _theta(log_J: Any, projection: Any, theta: Any) -> None:
    """Volume measure at the points (Q, L) from ln J at the samples (S, L)."""
    if projection.shape[0] == 0:
        theta[:] = log_J
        return
    theta[:] = 0.0
    for q in range(theta.shape[0]):
        for s in range(log_J.shape[0]):
            for i in range(LANES):
                theta[q, i] += projection[q, s, i] * log_J[s, i]


@inlined
def _to_samples(values: Any, projection: Any, out: Any) -> None:
    """Transpose of `_theta`: what acts on theta (Q, L), gathered at the samples (S, L)."""
    if projection.shape[0] == 0:
        out[:] = values
        return
    out[:] = 0.0
    for q in range(values.shape[0]):
        for s in range(out.shape[0]):
            for i in range(LANES):
                out[s, i] += projection[q, s, i] * values[q, i]


@inlined
def _volume_force(theta: Any, mu: Any, lmbda: Any, weight: Any) -> None:
    """Turn theta (Q, L) into the weighted q = lmbda theta - mu."""
    for q in range(theta.shape[0]):
        for i in range(LANES):
            theta[q, i] = weight[q, i] * (lmbda[i] * theta[q, i] - mu[i])


@inlined
def _add_forces(P: Any, gradient: Any, fe: Any) -> None:
    """fe (n, 2, L) += P (4, L) times the shape gradients (n, 2, L) of one point."""
    for k in range(gradient.shape[0]):
        for i in range(LANES):
            gx, gy = gradient[k, 0, i], gradient[k, 1, i]
            fe[k, 0, i] += P[0, i] * gx + P[1, i] * gy
            fe[k, 1, i] += P[2, i] * gx + P[3, i] * gy


@inlined
def _stresses(H: Any, mu: Any, weight: Any) -> None:
    """Turn H (Q, 4, L) into the weighted mu F."""
    for q in range(H.shape[0]):
        for i in range(LANES):
            w = weight[q, i] * mu[i]
            H[q, 0, i] = w * (1.0 + H[q, 0, i])
            H[q, 1, i] *= w
            H[q, 2, i] *= w
            H[q, 3, i] = w * (1.0 + H[q, 3, i])


@inlined
def _volume_states(ue: Any, moduli: Any, block: Any, states: Any, pull: Any) -> None:
    """Everything of a block that depends on the displacements: the `states` H (Q, 4, L), F^-T (S,
    4, L), ln J (S, L) and theta (Q, L), and the weighted volume force gathered at the samples,
    pull (S, L).
    """
    mu, lmbda = moduli
    gradient, weight, sample, projection = block
    H, inverse, log_J, theta = states
    _states(ue, gradient, sample, H, inverse, log_J)
    _theta(log_J, projection, theta)
    _volume_force(theta, mu, lmbda, weight)
    _to_samples(theta, projection, pull)


@compiled
def forces(u: Floats, mu: Floats, lmbda: Floats, cells: Cells) -> Floats:
    """Internal nodal forces (N, 2); nan where a cell is inverted."""
    nodes, gradient, weight, sample, projection = cells
    B, Q, n = gradient.shape[:3]
    S = sample.shape[1] or Q
    out = np.zeros_like(u)
    ue, fe, H = np.empty((n, 2, LANES)), np.empty((n, 2, LANES)), np.empty((Q, 4, LANES))
    inverse, log_J = np.empty((S, 4, LANES)), np.empty((S, LANES))
    theta, pull = np.empty((Q, LANES)), np.empty((S, LANES))
    for b in range(B):
        gather(u, nodes[b], ue)
        block = (gradient[b], weight[b], sample[b], projection[b])
        _volume_states(ue, (mu[b], lmbda[b]), block, (H, inverse, log_J, theta), pull)
        _stresses(H, mu[b], weight[b])
        for s in range(S):
            for j in range(4):
                for i in range(LANES):
                    inverse[s, j, i] *= pull[s, i]
        fe[:] = 0.0
        if sample.shape[1] == 0:
            H += inverse
        for s in range(sample.shape[1]):
            _add_forces(inverse[s], sample[b, s], fe)
        for q in range(Q):
            _add_forces(H[q], gradient[b, q], fe)
        spread(fe, nodes[b], out)
    return out


@inlined
def _pushed(inverse: Any, sample: Any, push: Any) -> None:
    """F^-T times the shape gradients (S, n, 2, L): the change of ln J by nodal displacements (S,
    n, 2, L).
    """
    for s in range(sample.shape[0]):
        for k in range(sample.shape[1]):
            for i in range(LANES):
                gx, gy = sample[s, k, 0, i], sample[s, k, 1, i]
                push[s, k, 0, i] = inverse[s, 0, i] * gx + inverse[s, 1, i] * gy
                push[s, k, 1, i] = inverse[s, 2, i] * gx + inverse[s, 3, i] * gy


@inlined
def _theta_rows(push: Any, projection: Any, rows: Any) -> None:
    """Change of theta by nodal displacements (Q, n, 2, L)."""
    if projection.shape[0] == 0:
        rows[:] = push
        return
    rows[:] = 0.0
    for q in range(rows.shape[0]):
        for s in range(push.shape[0]):
            for k in range(rows.shape[1]):
                for i in range(LANES):
                    rows[q, k, 0, i] += projection[q, s, i] * push[s, k, 0, i]
                    rows[q, k, 1, i] += projection[q, s, i] * push[s, k, 1, i]


@inlined
def _pair(k: int, m: int, stiff: Any, rows: Any, pull: Any, push: Any, K: Any) -> None:
    """Stiffness (4, L) between nodes k and m of what acts through theta: its modulus `stiff` (Q,
    L), and the curvature of ln J.
    """
    K[:] = 0.0
    for q in range(rows.shape[0]):
        for i in range(LANES):
            x, y = stiff[q, i] * rows[q, k, 0, i], stiff[q, i] * rows[q, k, 1, i]
            K[0, i] += x * rows[q, m, 0, i]
            K[1, i] += x * rows[q, m, 1, i]
            K[2, i] += y * rows[q, m, 0, i]
            K[3, i] += y * rows[q, m, 1, i]
    for s in range(push.shape[0]):
        for i in range(LANES):
            x, y = pull[s, i] * push[s, m, 0, i], pull[s, i] * push[s, m, 1, i]
            K[0, i] -= x * push[s, k, 0, i]
            K[1, i] -= x * push[s, k, 1, i]
            K[2, i] -= y * push[s, k, 0, i]
            K[3, i] -= y * push[s, k, 1, i]


@inlined
def _shear(k: int, m: int, gradient: Any, weight: Any, mu: Any, K: Any) -> None:
    """Add mu grad(k) . grad(m) to the diagonal of K (4, L)."""
    for q in range(gradient.shape[0]):
        for i in range(LANES):
            value = gradient[q, k, 0, i] * gradient[q, m, 0, i] + gradient[q, k, 1, i] * gradient[q, m, 1, i]
            value *= weight[q, i] * mu[i]
            K[0, i] += value
            K[3, i] += value


@inlined
def _store(K: Any, k: int, m: int, first: int, out: Any) -> None:
    """Write the stiffness (4, L) of nodes k and m and its transpose into the matrices of a block's
    cells.
    """
    for i in range(min(LANES, out.shape[0] - first)):
        cell = out[first + i]
        cell[2 * k, 2 * m] = cell[2 * m, 2 * k] = K[0, i]
        cell[2 * k, 2 * m + 1] = cell[2 * m + 1, 2 * k] = K[1, i]
        cell[2 * k + 1, 2 * m] = cell[2 * m, 2 * k + 1] = K[2, i]
        cell[2 * k + 1, 2 * m + 1] = cell[2 * m + 1, 2 * k + 1] = K[3, i]


@compiled
def tangent(u: Floats, pressure: Floats, mu: Floats, lmbda: Floats, cells: Cells, count: int) -> Floats:
    """Cell tangents (E, 2 n, 2 n) of E = `count` cells, with the curvature of ln J weighted by
    `pressure` (B, Q, L), or by the law's own if there are no blocks of it.
    """
    nodes, gradient, weight, sample, projection = cells
    B, Q, n = gradient.shape[:3]
    S = sample.shape[1] or Q
    out = np.empty((count, 2 * n, 2 * n))
    ue, H = np.empty((n, 2, LANES)), np.empty((Q, 4, LANES))
    inverse, log_J = np.empty((S, 4, LANES)), np.empty((S, LANES))
    theta, pull, stiff = np.empty((Q, LANES)), np.empty((S, LANES)), np.empty((Q, LANES))
    push, rows, K = np.empty((S, n, 2, LANES)), np.empty((Q, n, 2, LANES)), np.empty((4, LANES))
    for b in range(B):
        gather(u, nodes[b], ue)
        block = (gradient[b], weight[b], sample[b], projection[b])
        _volume_states(ue, (mu[b], lmbda[b]), block, (H, inverse, log_J, theta), pull)
        if len(pressure):
            _to_samples(pressure[b] * weight[b], projection[b], pull)
        _pushed(inverse, sample[b] if sample.shape[1] else gradient[b], push)
        _theta_rows(push, projection[b], rows)
        for q in range(Q):
            for i in range(LANES):
                stiff[q, i] = weight[b, q, i] * lmbda[b, i]
        for k in range(n):
            for m in range(k, n):
                _pair(k, m, stiff, rows, pull, push, K)
                _shear(k, m, gradient[b], weight[b], mu[b], K)
                _store(K, k, m, b * LANES, out)
    return out


@compiled
def pressure(u: Floats, mu: Floats, lmbda: Floats, cells: Cells) -> Floats:
    """q = lmbda theta - mu at the points (B, Q, L)."""
    nodes, gradient, _, sample, projection = cells
    B, Q, n = gradient.shape[:3]
    S = sample.shape[1] or Q
    out = np.empty((B, Q, LANES))
    ue, H = np.empty((n, 2, LANES)), np.empty((Q, 4, LANES))
    inverse, log_J = np.empty((S, 4, LANES)), np.empty((S, LANES))
    for b in range(B):
        gather(u, nodes[b], ue)
        _states(ue, gradient[b], sample[b], H, inverse, log_J)
        _theta(log_J, projection[b], out[b])
        for q in range(Q):
            for i in range(LANES):
                out[b, q, i] = lmbda[b, i] * out[b, q, i] - mu[b, i]
    return out


@compiled
def pressure_change(u: Floats, du: Floats, mu: Floats, lmbda: Floats, cells: Cells) -> Floats:
    """Derivative of `pressure` at u along du, lmbda Pi (F^-T : grad du), (B, Q, L)."""
    nodes, gradient, _, sample, projection = cells
    B, Q, n = gradient.shape[:3]
    points = sample if sample.shape[1] else gradient
    S = points.shape[1]
    out = np.empty((B, Q, LANES))
    ue, H, inverse = np.empty((n, 2, LANES)), np.empty((4, LANES)), np.empty((4, LANES))
    log_J, change = np.empty(LANES), np.empty((S, LANES))
    for b in range(B):
        for s in range(S):
            gather(u, nodes[b], ue)
            displacement_gradient(ue, points[b, s], H)
            volume(H, inverse, log_J)
            gather(du, nodes[b], ue)
            displacement_gradient(ue, points[b, s], H)
            for i in range(LANES):
                change[s, i] = inverse[0, i] * H[0, i] + inverse[1, i] * H[1, i]
                change[s, i] += inverse[2, i] * H[2, i] + inverse[3, i] * H[3, i]
        _theta(change, projection[b], out[b])
        for q in range(Q):
            for i in range(LANES):
                out[b, q, i] *= lmbda[b, i]
    return out


@compiled
def pressure_forces(u: Floats, q: Floats, cells: Cells) -> Floats:
    """Nodal forces (N, 2) of q dtheta(v) at u, with q (B, Q, L)."""
    nodes, gradient, weight, sample, projection = cells
    points = sample if sample.shape[1] else gradient
    B, S, n = points.shape[:3]
    out = np.zeros_like(u)
    ue, fe, H = np.empty((n, 2, LANES)), np.empty((n, 2, LANES)), np.empty((4, LANES))
    stress, log_J, pull = np.empty((4, LANES)), np.empty(LANES), np.empty((S, LANES))
    for b in range(B):
        gather(u, nodes[b], ue)
        _to_samples(q[b] * weight[b], projection[b], pull)
        fe[:] = 0.0
        for s in range(S):
            displacement_gradient(ue, points[b, s], H)
            volume(H, stress, log_J)
            stress *= pull[s]
            _add_forces(stress, points[b, s], fe)
        spread(fe, nodes[b], out)
    return out


@compiled
def smallest_J(u: Floats, cells: Cells) -> float:
    """Smallest volume ratio over all cells and sample points."""
    n = cells.gradient.shape[2]
    ue, H, smallest = np.empty((n, 2, LANES)), np.empty((4, LANES)), np.inf
    points = cells.sample if cells.sample.shape[1] else cells.gradient
    for b in range(len(points)):
        gather(u, cells.nodes[b], ue)
        for s in range(points.shape[1]):
            displacement_gradient(ue, points[b, s], H)
            for i in range(LANES):
                smallest = min(smallest, (1.0 + H[0, i]) * (1.0 + H[3, i]) - H[1, i] * H[2, i])
    return smallest


@compiled
def energy(u: Floats, mu: Floats, lmbda: Floats, cells: Cells) -> float:
    """Stored energy."""
    nodes, gradient, weight, sample, projection = cells
    B, Q, n = gradient.shape[:3]
    S = sample.shape[1] or Q
    ue, H, theta = np.empty((n, 2, LANES)), np.empty((Q, 4, LANES)), np.empty((Q, LANES))
    inverse, log_J = np.empty((S, 4, LANES)), np.empty((S, LANES))
    total = 0.0
    for b in range(B):
        gather(u, nodes[b], ue)
        _states(ue, gradient[b], sample[b], H, inverse, log_J)
        _theta(log_J, projection[b], theta)
        for q in range(Q):
            for i in range(LANES):
                # F:F - 2 - 2 theta, without the 2 that would swallow the digits of small strains
                shear = 2.0 * (H[q, 0, i] + H[q, 3, i] - theta[q, i])
                shear += H[q, 0, i] ** 2 + H[q, 1, i] ** 2 + H[q, 2, i] ** 2 + H[q, 3, i] ** 2
                volume = lmbda[b, i] * theta[q, i] ** 2
                total += 0.5 * weight[b, q, i] * (mu[b, i] * shear + volume)
    return total
