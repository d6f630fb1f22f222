"""Compiled element loops for neo-Hookean tissue, part of `evfem[fast]`: the same sums as `Tissue`, one cell
after the other.

psi = mu/2 (F:F - 2 - 2 theta) + lmbda/2 theta^2, so S = mu F, q = lmbda theta - mu, and the only moduli are
mu (per gradient component) and lmbda (for theta). Array shapes as in `evfem.assembly`; `projection` of size 0
means theta = ln J pointwise.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from evfem.mesh import Floats, Ints


@njit(cache=True, error_model="numpy")
def _deformation(u: Any, cell: Any, gradient: Any) -> Any:
    """F11, F12, F21, F22 of one point from shape gradients (n, 2) of its cell's nodes (n,)."""
    a, b, c, d = 1.0, 0.0, 0.0, 1.0
    for k in range(cell.size):
        gx, gy = gradient[k, 0], gradient[k, 1]
        ux, uy = u[cell[k], 0], u[cell[k], 1]
        a += ux * gx
        b += ux * gy
        c += uy * gx
        d += uy * gy
    return a, b, c, d


@njit(cache=True, error_model="numpy")
def _jacobians(u: Any, nodes: Any, sample: Any, inverse: Any, log_J: Any) -> None:
    """F^-T (S, 2, 2) and ln J (S,) of one cell; ln J is nan where the cell is inverted."""
    for s in range(sample.shape[0]):
        a, b, c, d = _deformation(u, nodes, sample[s])
        J = a * d - b * c
        log_J[s] = np.log(J)
        inverse[s, 0, 0] = d / J
        inverse[s, 0, 1] = -c / J
        inverse[s, 1, 0] = -b / J
        inverse[s, 1, 1] = a / J


@njit(cache=True, error_model="numpy")
def _volume_force(log_J: Any, mu: float, lmbda: float, weight: Any, projection: Any, force: Any) -> None:
    """Weighted q = lmbda theta - mu, gathered at the samples of ln J: force (S,)."""
    if projection.size == 0:
        for s in range(log_J.size):
            force[s] = weight[s] * (lmbda * log_J[s] - mu)
        return
    force[:] = 0.0
    for q in range(weight.size):
        theta = 0.0
        for s in range(log_J.size):
            theta += projection[q, s] * log_J[s]
        value = weight[q] * (lmbda * theta - mu)
        for s in range(log_J.size):
            force[s] += projection[q, s] * value


@njit(cache=True, error_model="numpy")
def forces(
    u: Floats,
    mu: Floats,
    lmbda: Floats,
    nodes: Ints,
    gradient: Floats,
    weight: Floats,
    sample: Floats,
    projection: Floats,
) -> Floats:
    """Internal nodal forces (N, 2); nan where a cell is inverted."""
    E, Q, n = gradient.shape[:3]
    S = sample.shape[1]
    out = np.zeros_like(u)
    inverse, log_J, volume = np.empty((S, 2, 2)), np.empty(S), np.empty(S)
    fe = np.empty((n, 2))
    none = projection.size == 0
    for e in range(E):
        fe[:] = 0.0
        cell = nodes[e]
        _jacobians(u, cell, sample[e], inverse, log_J)
        P = projection.reshape(0, 0) if none else projection[e]
        _volume_force(log_J, mu[e], lmbda[e], weight[e], P, volume)
        for q in range(Q):
            a, b, c, d = _deformation(u, cell, gradient[e, q])
            w = weight[e, q] * mu[e]
            for k in range(n):
                gx, gy = gradient[e, q, k, 0], gradient[e, q, k, 1]
                fe[k, 0] += w * (a * gx + b * gy)
                fe[k, 1] += w * (c * gx + d * gy)
        for s in range(S):
            for k in range(n):
                gx, gy = sample[e, s, k, 0], sample[e, s, k, 1]
                fe[k, 0] += volume[s] * (inverse[s, 0, 0] * gx + inverse[s, 0, 1] * gy)
                fe[k, 1] += volume[s] * (inverse[s, 1, 0] * gx + inverse[s, 1, 1] * gy)
        for k in range(n):
            out[cell[k], 0] += fe[k, 0]
            out[cell[k], 1] += fe[k, 1]
    return out


@njit(cache=True, error_model="numpy")
def tangent(
    u: Floats,
    mu: Floats,
    lmbda: Floats,
    nodes: Ints,
    gradient: Floats,
    weight: Floats,
    sample: Floats,
    projection: Floats,
) -> Floats:
    """Cell tangents (E, 2 n, 2 n)."""
    E, Q, n = gradient.shape[:3]
    S = sample.shape[1]
    out = np.zeros((E, 2 * n, 2 * n))
    inverse, log_J, volume = np.empty((S, 2, 2)), np.empty(S), np.empty(S)
    push = np.empty((S, n, 2))
    rows = np.empty((Q, 2 * n))
    none = projection.size == 0
    for e in range(E):
        K = out[e]
        _jacobians(u, nodes[e], sample[e], inverse, log_J)
        P = projection.reshape(0, 0) if none else projection[e]
        _volume_force(log_J, mu[e], lmbda[e], weight[e], P, volume)
        for s in range(S):
            for k in range(n):
                gx, gy = sample[e, s, k, 0], sample[e, s, k, 1]
                push[s, k, 0] = inverse[s, 0, 0] * gx + inverse[s, 0, 1] * gy
                push[s, k, 1] = inverse[s, 1, 0] * gx + inverse[s, 1, 1] * gy
        for q in range(Q):
            for j in range(2 * n):
                if none:
                    rows[q, j] = push[q, j // 2, j % 2]
                else:
                    value = 0.0
                    for s in range(S):
                        value += P[q, s] * push[s, j // 2, j % 2]
                    rows[q, j] = value
        for k in range(n):
            for m in range(k, n):
                shear = 0.0
                for q in range(Q):
                    shear += weight[e, q] * (
                        gradient[e, q, k, 0] * gradient[e, q, m, 0]
                        + gradient[e, q, k, 1] * gradient[e, q, m, 1]
                    )
                shear *= mu[e]
                for i in range(2):
                    for j in range(2):
                        value = shear if i == j else 0.0
                        for q in range(Q):
                            value += lmbda[e] * weight[e, q] * rows[q, 2 * k + i] * rows[q, 2 * m + j]
                        for s in range(S):
                            value -= volume[s] * push[s, k, j] * push[s, m, i]
                        K[2 * k + i, 2 * m + j] = value
                        K[2 * m + j, 2 * k + i] = value
    return out


@njit(cache=True, error_model="numpy")
def smallest_J(u: Floats, nodes: Ints, sample: Floats) -> float:
    """Smallest volume ratio over all cells and sample points."""
    smallest = np.inf
    for e in range(nodes.shape[0]):
        for s in range(sample.shape[1]):
            a, b, c, d = _deformation(u, nodes[e], sample[e, s])
            smallest = min(smallest, a * d - b * c)
    return smallest


@njit(cache=True, error_model="numpy")
def viscous_forces(
    u: Floats, rate: Floats, nodes: Ints, gradient: Floats, weight: Floats, strain0: Floats
) -> Floats:
    """Nodal forces (N, 2) of S = 2 rate (E - E0) with `rate` (E,) = eta / time step and E0 (E, Q, 2, 2)."""
    out = np.zeros_like(u)
    F, S = np.empty((2, 2)), np.empty((2, 2))
    for e in range(nodes.shape[0]):
        if rate[e] == 0.0:
            continue
        for q in range(weight.shape[1]):
            _viscous_point(u, nodes[e], gradient[e, q], rate[e] * weight[e, q], strain0[e, q], F, S)
            p00 = F[0, 0] * S[0, 0] + F[0, 1] * S[1, 0]
            p01 = F[0, 0] * S[0, 1] + F[0, 1] * S[1, 1]
            p10 = F[1, 0] * S[0, 0] + F[1, 1] * S[1, 0]
            p11 = F[1, 0] * S[0, 1] + F[1, 1] * S[1, 1]
            for k in range(nodes.shape[1]):
                gx, gy = gradient[e, q, k, 0], gradient[e, q, k, 1]
                out[nodes[e, k], 0] += p00 * gx + p01 * gy
                out[nodes[e, k], 1] += p10 * gx + p11 * gy
    return out


@njit(cache=True, error_model="numpy")
def _viscous_point(u: Any, cell: Any, gradient: Any, rate: float, strain0: Any, F: Any, S: Any) -> None:
    """F (2, 2) and S = 2 rate (E - E0) of one point."""
    a, b, c, d = _deformation(u, cell, gradient)
    F[0, 0], F[0, 1], F[1, 0], F[1, 1] = a, b, c, d
    S[0, 0] = 2.0 * rate * (0.5 * (a * a + c * c - 1.0) - strain0[0, 0])
    S[1, 1] = 2.0 * rate * (0.5 * (b * b + d * d - 1.0) - strain0[1, 1])
    S[0, 1] = S[1, 0] = 2.0 * rate * (0.5 * (a * b + c * d) - strain0[0, 1])


@njit(cache=True, error_model="numpy")
def add_viscous_tangent(
    u: Floats, rate: Floats, nodes: Ints, gradient: Floats, weight: Floats, strain0: Floats, cells: Floats
) -> None:
    """Add the tangents of `viscous_forces` to the cell matrices (E, 2 n, 2 n)."""
    n = nodes.shape[1]
    F, S = np.empty((2, 2)), np.empty((2, 2))
    push = np.empty((n, 2))
    for e in range(nodes.shape[0]):
        if rate[e] == 0.0:
            continue
        for q in range(weight.shape[1]):
            r = rate[e] * weight[e, q]
            _viscous_point(u, nodes[e], gradient[e, q], r, strain0[e, q], F, S)
            b00 = F[0, 0] * F[0, 0] + F[0, 1] * F[0, 1]
            b01 = F[0, 0] * F[1, 0] + F[0, 1] * F[1, 1]
            b11 = F[1, 0] * F[1, 0] + F[1, 1] * F[1, 1]
            for k in range(n):
                gx, gy = gradient[e, q, k, 0], gradient[e, q, k, 1]
                push[k, 0] = F[0, 0] * gx + F[0, 1] * gy
                push[k, 1] = F[1, 0] * gx + F[1, 1] * gy
            for k in range(n):
                gx, gy = gradient[e, q, k, 0], gradient[e, q, k, 1]
                sx, sy = S[0, 0] * gx + S[0, 1] * gy, S[1, 0] * gx + S[1, 1] * gy
                for m in range(n):
                    hx, hy = gradient[e, q, m, 0], gradient[e, q, m, 1]
                    inner = r * (gx * hx + gy * hy)
                    stress = sx * hx + sy * hy
                    cells[e, 2 * k, 2 * m] += stress + inner * b00 + r * push[m, 0] * push[k, 0]
                    cells[e, 2 * k, 2 * m + 1] += inner * b01 + r * push[m, 0] * push[k, 1]
                    cells[e, 2 * k + 1, 2 * m] += inner * b01 + r * push[m, 1] * push[k, 0]
                    cells[e, 2 * k + 1, 2 * m + 1] += stress + inner * b11 + r * push[m, 1] * push[k, 1]
