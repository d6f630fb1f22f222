/* The weak form `neo_hookean`: W = mu/2 (F:F - DIM - 2 theta) + lmbda/2 theta^2. The volume measure theta
   of a cell has modes that are orthonormal in its area, theta = sum_m c_m phi_m, c_m = sum_s Psi_ms ln
   J_s; with a_m the integral of phi_m

       volume energy  sum_m lmbda/2 c_m^2 - mu a_m c_m,   pressure_s = sum_m Psi_ms (lmbda c_m - mu a_m)
       forces         mu F : grad v at the points, pressure F^-T : grad v at the samples
       tangent        mu grad v : grad w (constant, not here) + lmbda sum_m r_m r_m^T
                      - sum_s pressure_s F^-T grad(w)^T F^-T : grad v,  r_m = sum_s Psi_ms F^-T : grad v

   pressure_s is what works with ln J_s, with its weight. Without modes, in the plane, theta = ln J at every
   point: Psi = sqrt(w), one mode for each. */

#include "cells.h"

#define HAS_MODES(m) (DIM == 3 || (m)->modes)

/* One block's state of the volume: F^-T and ln J at the samples, and the pressure on each; returns the
   volume's energy and keeps the smallest J. */
INLINE lanes volume(const mesh *m, Py_ssize_t b, int n, const lanes *ue, lanes mu, lanes lmbda,
                    tensor *inverse, lanes *pressure, double *smallest) {
    int S = m->sample.count;
    lanes log_J[MOST_POINTS], energy = {0};
    for (int s = 0; s < S; s++) {
        tensor H = displacement_gradient(&m->sample, b, s, ue, n);
        lanes e = volume_change(H);
        inverse[s] = inverse_transposed(H, e);
        log_J[s] = log_of_volume(e);
        for (int i = 0; i < LANES; i++)
            if (!(1.0 + e[i] >= *smallest)) *smallest = 1.0 + e[i];
        if (!HAS_MODES(m)) {
            lanes w = m->weight[b * S + s];
            pressure[s] = w * (lmbda * log_J[s] - mu);
            energy += w * log_J[s] * (0.5 * lmbda * log_J[s] - mu);
        } else
            pressure[s] = (lanes){0};
    }
    for (int j = 0; j < m->modes; j++) {
        const stored *psi = m->psi + (b * m->modes + j) * S;
        lanes c = {0}, mean = m->mean[b * m->modes + j];
        for (int s = 0; s < S; s++) c += psi[s] * log_J[s];
        energy += c * (0.5 * lmbda * c - mu * mean);
        for (int s = 0; s < S; s++) pressure[s] += psi[s] * (lmbda * c - mu * mean);
    }
    return energy;
}

/* Nodal forces added to out (N, DIM); returns the stored energy, and the smallest J. */
INLINE void forces(request *r, int n) {
    const mesh *m = &r->m;
    const double *u = r->arrays[0];
    const stored *mu = r->arrays[1], *lmbda = r->arrays[2];
    double *out = r->arrays[3], smallest = INFINITY;
    lanes total = {0};
    for (Py_ssize_t b = 0; b < m->blocks; b++) {
        lanes ue[DIM * MOST_NODES], fe[DIM * MOST_NODES] = {{0}}, pressure[MOST_POINTS];
        tensor inverse[MOST_POINTS];
        gather(u, m->nodes + b * n * LANES, n, ue);
        total += volume(m, b, n, ue, mu[b], lmbda[b], inverse, pressure, &smallest);
        for (int q = 0; q < m->at.count; q++) {
            tensor P = displacement_gradient(&m->at, b, q, ue, n);
            lanes w = mu[b] * m->weight[b * m->at.count + q];
            /* F:F - DIM, without the DIM that would swallow the digits of small strains */
            total += w * trace(P) + 0.5 * w * contracted(P, P);
            EACH(i) P.a[i][i] += 1.0;
            P = scaled(w, P);
            if (!m->apart)
                EACH(i) EACH(j) P.a[i][j] += pressure[q] * inverse[q].a[i][j];
            add_forces(P, &m->at, b, q, n, fe);
        }
        for (int s = 0; s < (m->apart ? m->sample.count : 0); s++)
            add_forces(scaled(pressure[s], inverse[s]), &m->sample, b, s, n, fe);
        spread(fe, m->nodes + b * n * LANES, n, out);
    }
    r->found[0] = sum(total), r->found[1] = smallest;
}

/* Stored energies (W,) at u plus the shares `places` (W,) of du: the gradients of both serve all of them. */
INLINE void energies(request *r, int n) {
    const mesh *m = &r->m;
    const double *u = r->arrays[0], *du = r->arrays[1], *places = r->arrays[4];
    const stored *mu = r->arrays[2], *lmbda = r->arrays[3];
    double *out = r->arrays[5];
    int S = m->sample.count, Q = m->at.count;
    for (int w = 0; w < r->places; w++) out[w] = 0.0;
    for (Py_ssize_t b = 0; b < m->blocks; b++) {
        lanes ue[DIM * MOST_NODES], change[DIM * MOST_NODES];
        tensor H[MOST_POINTS], D[MOST_POINTS], at[MOST_POINTS], along[MOST_POINTS];
        gather(u, m->nodes + b * n * LANES, n, ue);
        gather(du, m->nodes + b * n * LANES, n, change);
        for (int s = 0; s < S; s++) {
            H[s] = displacement_gradient(&m->sample, b, s, ue, n);
            D[s] = displacement_gradient(&m->sample, b, s, change, n);
        }
        for (int q = 0; q < Q; q++) {
            at[q] = m->apart ? displacement_gradient(&m->at, b, q, ue, n) : H[q];
            along[q] = m->apart ? displacement_gradient(&m->at, b, q, change, n) : D[q];
        }
        for (int w = 0; w < r->places; w++) {
            lanes log_J[MOST_POINTS], share = (lanes){0} + places[w], total = {0};
            for (int s = 0; s < S; s++) {
                log_J[s] = log_of_volume(volume_change(between(H[s], share, D[s])));
                if (!HAS_MODES(m))
                    total += m->weight[b * S + s] * log_J[s] * (0.5 * lmbda[b] * log_J[s] - mu[b]);
            }
            for (int j = 0; j < m->modes; j++) {
                const stored *psi = m->psi + (b * m->modes + j) * S;
                lanes c = {0};
                for (int s = 0; s < S; s++) c += psi[s] * log_J[s];
                total += c * (0.5 * lmbda[b] * c - mu[b] * m->mean[b * m->modes + j]);
            }
            for (int q = 0; q < Q; q++) {
                tensor P = between(at[q], share, along[q]);
                total += mu[b] * m->weight[b * Q + q] * (trace(P) + 0.5 * contracted(P, P));
            }
            out[w] += sum(total);
        }
    }
}

/* What changes of the tangent, added to the matrix: pairs k <= l of nodes, places (B, pairs, DIM DIM,
   LANES). The curvature of ln J is weighted with the law's own pressure, or with a given one (B, S). */
INLINE void add_tangent(request *r, int n) {
    const mesh *m = &r->m;
    const double *u = r->arrays[0];
    const stored *mu = r->arrays[1], *lmbda = r->arrays[2], *given = r->arrays[3];
    const int32_t *places = r->arrays[4];
    double *data = r->arrays[5];
    int S = m->sample.count, rank = HAS_MODES(m) ? m->modes : S;
    for (Py_ssize_t b = 0; b < m->blocks; b++) {
        lanes ue[DIM * MOST_NODES], pressure[MOST_POINTS];
        double smallest = INFINITY;
        lanes push[MOST_POINTS][DIM * MOST_NODES], weighted[MOST_POINTS][DIM * MOST_NODES];
        lanes modes[MOST_MODES][DIM * MOST_NODES], stiff[MOST_MODES][DIM * MOST_NODES];
        lanes(*row)[DIM * MOST_NODES] = HAS_MODES(m) ? modes : push;
        tensor inverse[MOST_POINTS];
        gather(u, m->nodes + b * n * LANES, n, ue);
        volume(m, b, n, ue, mu[b], lmbda[b], inverse, pressure, &smallest);
        for (int s = 0; s < S; s++) {
            memset(push[s], 0, sizeof(lanes) * DIM * n);
            add_forces(inverse[s], &m->sample, b, s, n, push[s]);
            if (given) pressure[s] = given[b * S + s];
            for (int k = 0; k < DIM * n; k++) weighted[s][k] = pressure[s] * push[s][k];
        }
        for (int j = 0; j < rank; j++) {
            const stored *psi = m->psi + (b * m->modes + j) * S;
            for (int k = 0; k < DIM * n && HAS_MODES(m); k++) {
                modes[j][k] = (lanes){0};
                for (int s = 0; s < S; s++) modes[j][k] += psi[s] * push[s][k];
            }
            lanes modulus = HAS_MODES(m) ? lmbda[b] : lmbda[b] * m->weight[b * S + j];
            for (int k = 0; k < DIM * n; k++) stiff[j][k] = modulus * row[j][k];
        }
        const int32_t *place = places + b * (n * (n + 1) / 2) * DIM * DIM * LANES;
        for (int k = 0; k < n; k++)
            for (int l = k; l < n; l++, place += DIM * DIM * LANES) {
                tensor K = ZERO;
                for (int h = 0; h < rank; h++)
                    EACH(i) EACH(j) K.a[i][j] += stiff[h][DIM * k + i] * row[h][DIM * l + j];
                for (int s = 0; s < S; s++)
                    EACH(i) EACH(j) K.a[i][j] -= weighted[s][DIM * l + i] * push[s][DIM * k + j];
                scatter(K, place, data);
            }
    }
}

/* ln J at the samples (B, S), or with du its change along du, F^-T : grad du. */
INLINE void log_volumes(request *r, int n) {
    const mesh *m = &r->m;
    const double *u = r->arrays[0], *du = r->arrays[1];
    stored *out = r->arrays[2];
    int S = m->sample.count;
    for (Py_ssize_t b = 0; b < m->blocks; b++) {
        lanes ue[DIM * MOST_NODES], change[DIM * MOST_NODES];
        gather(u, m->nodes + b * n * LANES, n, ue);
        if (du) gather(du, m->nodes + b * n * LANES, n, change);
        for (int s = 0; s < S; s++) {
            tensor H = displacement_gradient(&m->sample, b, s, ue, n);
            lanes e = volume_change(H);
            out[b * S + s] = du ? contracted(inverse_transposed(H, e),
                                             displacement_gradient(&m->sample, b, s, change, n))
                                : log_of_volume(e);
        }
    }
}

/* Nodal forces pressure F^-T : grad v of a given pressure (B, S), added to out (N, DIM). */
INLINE void volume_forces(request *r, int n) {
    const mesh *m = &r->m;
    const double *u = r->arrays[0];
    const stored *pressure = r->arrays[1];
    double *out = r->arrays[2];
    int S = m->sample.count;
    for (Py_ssize_t b = 0; b < m->blocks; b++) {
        lanes ue[DIM * MOST_NODES], fe[DIM * MOST_NODES] = {{0}};
        gather(u, m->nodes + b * n * LANES, n, ue);
        for (int s = 0; s < S; s++) {
            tensor H = displacement_gradient(&m->sample, b, s, ue, n);
            tensor P = scaled(pressure[b * S + s], inverse_transposed(H, volume_change(H)));
            add_forces(P, &m->sample, b, s, n, fe);
        }
        spread(fe, m->nodes + b * n * LANES, n, out);
    }
}

/* Smallest volume ratio over all samples. */
INLINE void smallest_J(request *r, int n) {
    const mesh *m = &r->m;
    const double *u = r->arrays[0];
    double smallest = INFINITY;
    for (Py_ssize_t b = 0; b < m->blocks; b++) {
        lanes ue[DIM * MOST_NODES];
        gather(u, m->nodes + b * n * LANES, n, ue);
        for (int s = 0; s < m->sample.count; s++) {
            lanes J = 1.0 + volume_change(displacement_gradient(&m->sample, b, s, ue, n));
            for (int i = 0; i < LANES; i++)
                if (!(J[i] >= smallest)) smallest = J[i];
        }
    }
    r->found[0] = smallest;
}
