/* The weak form `neo_hookean`: W = mu/2 (F:F - 2 - 2 theta) + lmbda/2 theta^2. The volume measure theta
   of a cell has modes that are orthonormal in its area, theta = sum_m c_m phi_m, c_m = sum_s Psi_ms ln
   J_s; with a_m the integral of phi_m

       volume energy  sum_m lmbda/2 c_m^2 - mu a_m c_m,   pressure_s = sum_m Psi_ms (lmbda c_m - mu a_m)
       forces         mu F : grad v at the points, pressure F^-T : grad v at the samples
       tangent        mu grad v : grad w (constant, not here) + lmbda sum_m r_m r_m^T
                      - sum_s pressure_s F^-T grad(w)^T F^-T : grad v,  r_m = sum_s Psi_ms F^-T : grad v

   pressure_s is what works with ln J_s, with its weight. Without modes theta = ln J at every point: Psi
   = sqrt(w), one mode for each. */

#include "cells.h"

/* One block's state of the volume: F^-T and ln J at the samples, and the pressure on each; returns the
   volume's energy and keeps the smallest J. */
INLINE lanes volume(const mesh *m, Py_ssize_t b, int n, const lanes *ue, lanes mu, lanes lmbda,
                    tensor *inverse, lanes *pressure, double *smallest) {
    const points *sample = m->modes ? &m->sample : &m->at;
    lanes log_J[MOST_POINTS], energy = {0};
    for (int s = 0; s < sample->count; s++) {
        tensor H = displacement_gradient(ue, sample->reference + 2 * n * s,
                                         sample->inverse + 4 * (b * sample->count + s), n);
        lanes e = volume_change(H);
        inverse[s] = inverse_transposed(H, e);
        log_J[s] = log_of_volume(e);
        for (int i = 0; i < LANES; i++)
            if (!(1.0 + e[i] >= *smallest)) *smallest = 1.0 + e[i];
        if (!m->modes) {
            lanes w = m->weight[b * sample->count + s];
            pressure[s] = w * (lmbda * log_J[s] - mu);
            energy += w * log_J[s] * (0.5 * lmbda * log_J[s] - mu);
        } else
            pressure[s] = (lanes){0};
    }
    for (int j = 0; j < m->modes; j++) {
        const stored *psi = m->psi + (b * m->modes + j) * sample->count;
        lanes c = {0}, mean = m->mean[b * m->modes + j];
        for (int s = 0; s < sample->count; s++) c += psi[s] * log_J[s];
        energy += c * (0.5 * lmbda * c - mu * mean);
        for (int s = 0; s < sample->count; s++) pressure[s] += psi[s] * (lmbda * c - mu * mean);
    }
    return energy;
}

/* Nodal forces added to out (N, 2); returns the stored energy, and the smallest J. */
INLINE double elastic_forces(const mesh *m, int n, const double *u, const stored *mu,
                             const stored *lmbda, double *out, double *smallest) {
    const points *at = &m->at;
    lanes total = {0};
    *smallest = INFINITY;
    for (Py_ssize_t b = 0; b < m->blocks; b++) {
        lanes ue[2 * MOST_NODES], fe[2 * MOST_NODES] = {{0}}, pressure[MOST_POINTS];
        tensor inverse[MOST_POINTS];
        gather(u, m->nodes + b * n * LANES, n, ue);
        total += volume(m, b, n, ue, mu[b], lmbda[b], inverse, pressure, smallest);
        for (int q = 0; q < at->count; q++) {
            const double *g = at->reference + 2 * n * q;
            const stored *A = at->inverse + 4 * (b * at->count + q);
            tensor H = displacement_gradient(ue, g, A, n);
            lanes w = mu[b] * m->weight[b * at->count + q];
            /* F:F - 2, without the 2 that would swallow the digits of small strains */
            total += w * (H.xx + H.yy) + 0.5 * w * (H.xx * H.xx + H.xy * H.xy + H.yx * H.yx + H.yy * H.yy);
            tensor P = {w * (1.0 + H.xx), w * H.xy, w * H.yx, w * (1.0 + H.yy)};
            if (!m->modes) {
                tensor T = scaled(pressure[q], inverse[q]);
                P = (tensor){P.xx + T.xx, P.xy + T.xy, P.yx + T.yx, P.yy + T.yy};
            }
            add_forces(P, g, A, n, fe);
        }
        for (int s = 0; s < (m->modes ? m->sample.count : 0); s++)
            add_forces(scaled(pressure[s], inverse[s]), m->sample.reference + 2 * n * s,
                       m->sample.inverse + 4 * (b * m->sample.count + s), n, fe);
        spread(fe, m->nodes + b * n * LANES, n, out);
    }
    return sum(total);
}

/* Add one pair's stiffness (2, 2) to the entries of the matrix; K.yx of a node with itself goes to
   the place beyond the last one. */
INLINE void scatter(tensor K, const int32_t *place, double *data) {
    for (int i = 0; i < LANES; i++) {
        data[place[i]] += item(&K.xx)[i];
        data[place[LANES + i]] += item(&K.xy)[i];
        data[place[2 * LANES + i]] += item(&K.yx)[i];
        data[place[3 * LANES + i]] += item(&K.yy)[i];
    }
}

/* What changes of the tangent, added to the matrix: pairs k <= l of nodes, places (B, pairs, 4,
   LANES). The curvature of ln J is weighted with the law's own pressure, or with a given one (B, S). */
INLINE void elastic_tangent(const mesh *m, int n, const double *u, const stored *mu,
                            const stored *lmbda, const stored *given, const int32_t *places,
                            double *data) {
    const points *sample = m->modes ? &m->sample : &m->at;
    int S = sample->count, rank = m->modes ? m->modes : S;
    for (Py_ssize_t b = 0; b < m->blocks; b++) {
        lanes ue[2 * MOST_NODES], pressure[MOST_POINTS];
        double smallest = INFINITY;
        lanes push[MOST_POINTS][2 * MOST_NODES], weighted[MOST_POINTS][2 * MOST_NODES];
        lanes modes[MOST_POINTS][2 * MOST_NODES], stiff[MOST_POINTS][2 * MOST_NODES];
        lanes(*row)[2 * MOST_NODES] = m->modes ? modes : push;
        tensor inverse[MOST_POINTS];
        gather(u, m->nodes + b * n * LANES, n, ue);
        volume(m, b, n, ue, mu[b], lmbda[b], inverse, pressure, &smallest);
        for (int s = 0; s < S; s++) {
            memset(push[s], 0, sizeof(lanes) * 2 * n);
            add_forces(inverse[s], sample->reference + 2 * n * s, sample->inverse + 4 * (b * S + s), n,
                       push[s]);
            if (given) pressure[s] = given[b * S + s];
            for (int k = 0; k < 2 * n; k++) weighted[s][k] = pressure[s] * push[s][k];
        }
        for (int j = 0; j < rank; j++) {
            const stored *psi = m->psi + (b * m->modes + j) * S;
            for (int k = 0; k < 2 * n && m->modes; k++) {
                modes[j][k] = (lanes){0};
                for (int s = 0; s < S; s++) modes[j][k] += psi[s] * push[s][k];
            }
            lanes modulus = m->modes ? lmbda[b] : lmbda[b] * m->weight[b * S + j];
            for (int k = 0; k < 2 * n; k++) stiff[j][k] = modulus * row[j][k];
        }
        const int32_t *place = places + b * (n * (n + 1) / 2) * 4 * LANES;
        for (int k = 0; k < n; k++)
            for (int l = k; l < n; l++, place += 4 * LANES) {
                tensor K = {{0}, {0}, {0}, {0}};
                for (int j = 0; j < rank; j++) {
                    K.xx += stiff[j][2 * k] * row[j][2 * l];
                    K.xy += stiff[j][2 * k] * row[j][2 * l + 1];
                    K.yx += stiff[j][2 * k + 1] * row[j][2 * l];
                    K.yy += stiff[j][2 * k + 1] * row[j][2 * l + 1];
                }
                for (int s = 0; s < S; s++) {
                    K.xx -= weighted[s][2 * l] * push[s][2 * k];
                    K.xy -= weighted[s][2 * l] * push[s][2 * k + 1];
                    K.yx -= weighted[s][2 * l + 1] * push[s][2 * k];
                    K.yy -= weighted[s][2 * l + 1] * push[s][2 * k + 1];
                }
                scatter(K, place, data);
            }
    }
}

/* ln J at the samples (B, S), or with du its change along du, F^-T : grad du. */
INLINE void log_volumes(const mesh *m, int n, const double *u, const double *du, stored *out) {
    const points *sample = m->modes ? &m->sample : &m->at;
    for (Py_ssize_t b = 0; b < m->blocks; b++) {
        lanes ue[2 * MOST_NODES], change[2 * MOST_NODES];
        gather(u, m->nodes + b * n * LANES, n, ue);
        if (du) gather(du, m->nodes + b * n * LANES, n, change);
        for (int s = 0; s < sample->count; s++) {
            Py_ssize_t point = b * sample->count + s;
            const double *g = sample->reference + 2 * n * s;
            tensor H = displacement_gradient(ue, g, sample->inverse + 4 * point, n);
            lanes e = volume_change(H);
            if (!du) {
                out[point] = log_of_volume(e);
                continue;
            }
            tensor G = inverse_transposed(H, e);
            tensor D = displacement_gradient(change, g, sample->inverse + 4 * point, n);
            out[point] = G.xx * D.xx + G.xy * D.xy + G.yx * D.yx + G.yy * D.yy;
        }
    }
}

/* Nodal forces pressure F^-T : grad v of a given pressure (B, S), added to out (N, 2). */
INLINE void volume_forces(const mesh *m, int n, const double *u, const stored *pressure, double *out) {
    const points *sample = m->modes ? &m->sample : &m->at;
    for (Py_ssize_t b = 0; b < m->blocks; b++) {
        lanes ue[2 * MOST_NODES], fe[2 * MOST_NODES] = {{0}};
        gather(u, m->nodes + b * n * LANES, n, ue);
        for (int s = 0; s < sample->count; s++) {
            Py_ssize_t point = b * sample->count + s;
            const double *g = sample->reference + 2 * n * s;
            const stored *A = sample->inverse + 4 * point;
            tensor H = displacement_gradient(ue, g, A, n);
            add_forces(scaled(pressure[point], inverse_transposed(H, volume_change(H))), g, A, n, fe);
        }
        spread(fe, m->nodes + b * n * LANES, n, out);
    }
}

/* Smallest volume ratio over all samples. */
INLINE double smallest_volume(const mesh *m, int n, const double *u) {
    const points *sample = m->modes ? &m->sample : &m->at;
    double smallest = INFINITY;
    for (Py_ssize_t b = 0; b < m->blocks; b++) {
        lanes ue[2 * MOST_NODES];
        gather(u, m->nodes + b * n * LANES, n, ue);
        for (int s = 0; s < sample->count; s++) {
            tensor H = displacement_gradient(ue, sample->reference + 2 * n * s,
                                             sample->inverse + 4 * (b * sample->count + s), n);
            lanes J = 1.0 + volume_change(H);
            for (int i = 0; i < LANES; i++)
                if (!(J[i] >= smallest)) smallest = J[i];
        }
    }
    return smallest;
}

/* Means over the cells of the Cauchy stress xx, yy, zz, xy, and of J, (B, 5): J sigma = mu F F^T + q with
   the pressure q (B, Q) at the points, zz with F_zz = 1. */
INLINE void cell_stresses(const mesh *m, int n, const double *u, const stored *mu, const stored *pressure,
                          stored *out) {
    const points *at = &m->at;
    for (Py_ssize_t b = 0; b < m->blocks; b++) {
        lanes ue[2 * MOST_NODES], total = {0}, means[5] = {{0}};
        gather(u, m->nodes + b * n * LANES, n, ue);
        for (int q = 0; q < at->count; q++) {
            Py_ssize_t point = b * at->count + q;
            tensor H = displacement_gradient(ue, at->reference + 2 * n * q, at->inverse + 4 * point, n);
            lanes w = m->weight[point], J = 1.0 + volume_change(H), share = w / J;
            lanes xx = 1.0 + H.xx, yy = 1.0 + H.yy;
            total += w;
            means[0] += share * (mu[b] * (xx * xx + H.xy * H.xy) + pressure[point]);
            means[1] += share * (mu[b] * (H.yx * H.yx + yy * yy) + pressure[point]);
            means[2] += share * (mu[b] + pressure[point]);
            means[3] += share * mu[b] * (xx * H.yx + H.xy * yy);
            means[4] += w * J;
        }
        for (int i = 0; i < 5; i++) out[5 * b + i] = means[i] / total;
    }
}
