/* The weak form `neo_hookean` in space: W = mu/2 (F:F - 3 - 2 theta) + lmbda/2 theta^2; modes, pressure,
   forces and tangent are those of `elastic.h`, and there is always at least one mode. */

#include "solid_cells.h"

/* One block's state of the volume: F^-T and ln J at the samples, and the pressure on each; returns the
   volume's energy and keeps the smallest J. */
INLINE lanes volume(const mesh *m, Py_ssize_t b, int n, const lanes *ue, lanes mu, lanes lmbda,
                    tensor *inverse, lanes *pressure, double *smallest) {
    int S = samples_of(m);
    lanes log_J[MOST_POINTS], energy = {0};
    for (int s = 0; s < S; s++) {
        tensor H = sampled_gradient(m, b, s, ue, n);
        lanes e = volume_change(H);
        inverse[s] = inverse_transposed(H, e);
        log_J[s] = log_of_volume(e);
        pressure[s] = (lanes){0};
        for (int i = 0; i < LANES; i++)
            if (!(1.0 + e[i] >= *smallest)) *smallest = 1.0 + e[i];
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

/* Nodal forces added to out (N, 3); returns the stored energy, and the smallest J. */
INLINE double elastic_forces(const mesh *m, int n, const double *u, const stored *mu,
                             const stored *lmbda, double *out, double *smallest) {
    lanes total = {0};
    *smallest = INFINITY;
    for (Py_ssize_t b = 0; b < m->blocks; b++) {
        lanes ue[DIM * MOST_NODES], fe[DIM * MOST_NODES] = {{0}}, pressure[MOST_POINTS];
        tensor inverse[MOST_POINTS];
        gather(u, m->nodes + b * n * LANES, n, ue);
        total += volume(m, b, n, ue, mu[b], lmbda[b], inverse, pressure, smallest);
        for (int q = 0; q < m->points; q++) {
            tensor P = displacement_gradient(m, b, q, ue, n);
            lanes w = mu[b] * m->weight[b * m->points + q];
            /* F:F - 3, without the 3 that would swallow the digits of small strains */
            total += w * (P.a[0][0] + P.a[1][1] + P.a[2][2]) + 0.5 * w * contracted(P, P);
            EACH(i) P.a[i][i] += 1.0;
            P = scaled(w, P);
            if (!m->mean_gradient)
                EACH(i) EACH(j) P.a[i][j] += pressure[q] * inverse[q].a[i][j];
            add_forces(P, m, b, q, n, fe);
        }
        if (m->mean_gradient) add_sampled_forces(scaled(pressure[0], inverse[0]), m, b, 0, n, fe);
        spread(fe, m->nodes + b * n * LANES, n, out);
    }
    return sum(total);
}

/* What changes of the tangent, added to the matrix: pairs k <= l of nodes, places (B, pairs, 9,
   LANES). The curvature of ln J is weighted with the law's own pressure, or with a given one (B, S). */
INLINE void elastic_tangent(const mesh *m, int n, const double *u, const stored *mu,
                            const stored *lmbda, const stored *given, const int32_t *places,
                            double *data) {
    int S = samples_of(m), M = m->modes;
    for (Py_ssize_t b = 0; b < m->blocks; b++) {
        lanes ue[DIM * MOST_NODES], pressure[MOST_POINTS];
        double smallest = INFINITY;
        lanes push[MOST_POINTS][DIM * MOST_NODES], weighted[MOST_POINTS][DIM * MOST_NODES];
        lanes row[MOST_MODES][DIM * MOST_NODES], stiff[MOST_MODES][DIM * MOST_NODES];
        tensor inverse[MOST_POINTS];
        gather(u, m->nodes + b * n * LANES, n, ue);
        volume(m, b, n, ue, mu[b], lmbda[b], inverse, pressure, &smallest);
        for (int s = 0; s < S; s++) {
            memset(push[s], 0, sizeof(lanes) * DIM * n);
            add_sampled_forces(inverse[s], m, b, s, n, push[s]);
            lanes p = given ? given[b * S + s] : pressure[s];
            for (int k = 0; k < DIM * n; k++) weighted[s][k] = p * push[s][k];
        }
        for (int j = 0; j < M; j++) {
            const stored *psi = m->psi + (b * M + j) * S;
            for (int k = 0; k < DIM * n; k++) {
                row[j][k] = (lanes){0};
                for (int s = 0; s < S; s++) row[j][k] += psi[s] * push[s][k];
                stiff[j][k] = lmbda[b] * row[j][k];
            }
        }
        const int32_t *place = places + b * (n * (n + 1) / 2) * DIM * DIM * LANES;
        for (int k = 0; k < n; k++)
            for (int l = k; l < n; l++, place += DIM * DIM * LANES) {
                tensor K = {{{{0}}}};
                for (int h = 0; h < M; h++)
                    EACH(i) EACH(j) K.a[i][j] += stiff[h][DIM * k + i] * row[h][DIM * l + j];
                for (int s = 0; s < S; s++)
                    EACH(i) EACH(j) K.a[i][j] -= weighted[s][DIM * l + i] * push[s][DIM * k + j];
                scatter(K, place, data);
            }
    }
}

/* ln J at the samples (B, S), or with du its change along du, F^-T : grad du. */
INLINE void log_volumes(const mesh *m, int n, const double *u, const double *du, stored *out) {
    int S = samples_of(m);
    for (Py_ssize_t b = 0; b < m->blocks; b++) {
        lanes ue[DIM * MOST_NODES], change[DIM * MOST_NODES];
        gather(u, m->nodes + b * n * LANES, n, ue);
        if (du) gather(du, m->nodes + b * n * LANES, n, change);
        for (int s = 0; s < S; s++) {
            tensor H = sampled_gradient(m, b, s, ue, n);
            lanes e = volume_change(H);
            out[b * S + s] = du ? contracted(inverse_transposed(H, e), sampled_gradient(m, b, s, change, n))
                                : log_of_volume(e);
        }
    }
}

/* Nodal forces pressure F^-T : grad v of a given pressure (B, S), added to out (N, 3). */
INLINE void volume_forces(const mesh *m, int n, const double *u, const stored *pressure, double *out) {
    int S = samples_of(m);
    for (Py_ssize_t b = 0; b < m->blocks; b++) {
        lanes ue[DIM * MOST_NODES], fe[DIM * MOST_NODES] = {{0}};
        gather(u, m->nodes + b * n * LANES, n, ue);
        for (int s = 0; s < S; s++) {
            tensor H = sampled_gradient(m, b, s, ue, n);
            add_sampled_forces(scaled(pressure[b * S + s], inverse_transposed(H, volume_change(H))), m, b, s,
                               n, fe);
        }
        spread(fe, m->nodes + b * n * LANES, n, out);
    }
}

/* Smallest volume ratio over all samples. */
INLINE double smallest_volume(const mesh *m, int n, const double *u) {
    double smallest = INFINITY;
    for (Py_ssize_t b = 0; b < m->blocks; b++) {
        lanes ue[DIM * MOST_NODES];
        gather(u, m->nodes + b * n * LANES, n, ue);
        for (int s = 0; s < samples_of(m); s++) {
            lanes J = 1.0 + volume_change(sampled_gradient(m, b, s, ue, n));
            for (int i = 0; i < LANES; i++)
                if (!(J[i] >= smallest)) smallest = J[i];
        }
    }
    return smallest;
}

/* Means over the cells of the Cauchy stress xx, yy, zz, xy, yz, xz, and of J, (B, 7): J sigma = mu F F^T + q
   with the pressure q (B, Q) at the points. */
INLINE void cell_stresses(const mesh *m, int n, const double *u, const stored *mu, const stored *pressure,
                          stored *out) {
    for (Py_ssize_t b = 0; b < m->blocks; b++) {
        lanes ue[DIM * MOST_NODES], total = {0}, means[7] = {{0}};
        gather(u, m->nodes + b * n * LANES, n, ue);
        for (int q = 0; q < m->points; q++) {
            tensor F = displacement_gradient(m, b, q, ue, n), S;
            lanes w = m->weight[b * m->points + q], J = 1.0 + volume_change(F), share = w / J;
            EACH(i) F.a[i][i] += 1.0;
            EACH(i) EACH(j) S.a[i][j] = share * mu[b] * (F.a[i][0] * F.a[j][0] + F.a[i][1] * F.a[j][1] +
                                                         F.a[i][2] * F.a[j][2]);
            EACH(i) means[i] += S.a[i][i] + share * pressure[b * m->points + q];
            means[3] += S.a[0][1];
            means[4] += S.a[1][2];
            means[5] += S.a[0][2];
            means[6] += w * J;
            total += w;
        }
        for (int i = 0; i < 7; i++) out[7 * b + i] = means[i] / total;
    }
}
