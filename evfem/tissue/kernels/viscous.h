/* The weak form `kelvin_voigt`: S = 2 r (E - E0), r = eta / time step, E = (H + H^T + H^T H)/2. */

#include "elastic.h" /* cells, and where a pair's stiffness goes */

typedef struct { lanes xx, yy, xy; } symmetric;

INLINE symmetric green_strain(tensor H) {
    return (symmetric){H.xx + 0.5 * (H.xx * H.xx + H.yx * H.yx), H.yy + 0.5 * (H.xy * H.xy + H.yy * H.yy),
                       0.5 * (H.xy + H.yx + H.xx * H.xy + H.yx * H.yy)};
}

/* Green strains of all points (B, at.count, 3). */
INLINE void viscous_strains(const mesh *m, int n, const double *u, stored *out) {
    for (Py_ssize_t b = 0; b < m->blocks; b++) {
        lanes ue[2 * MOST_NODES];
        gather(u, m->nodes + b * n * LANES, n, ue);
        for (int q = 0; q < m->at.count; q++) {
            Py_ssize_t point = b * m->at.count + q;
            tensor H = displacement_gradient(ue, m->at.reference + 2 * n * q, m->at.inverse + 4 * point, n);
            symmetric E = green_strain(H);
            out[3 * point] = E.xx, out[3 * point + 1] = E.yy, out[3 * point + 2] = E.xy;
        }
    }
}

/* F and the weighted S of one point; returns r w. */
INLINE lanes viscous_stress(const mesh *m, Py_ssize_t b, int q, int n, const lanes *ue, lanes rate,
                            const stored *strain0, tensor *F, symmetric *S) {
    Py_ssize_t point = b * m->at.count + q;
    lanes w = rate * m->weight[point];
    *F = displacement_gradient(ue, m->at.reference + 2 * n * q, m->at.inverse + 4 * point, n);
    symmetric E = green_strain(*F);
    *S = (symmetric){2.0 * w * (E.xx - strain0[3 * point]), 2.0 * w * (E.yy - strain0[3 * point + 1]),
                     2.0 * w * (E.xy - strain0[3 * point + 2])};
    F->xx += 1.0, F->yy += 1.0;
    return w;
}

/* Nodal forces F S : grad v added to out (N, 2); returns what the step dissipates, S : (E - E0). */
INLINE double viscous_forces(const mesh *m, int n, const double *u, const stored *rate,
                             const stored *strain0, double *out) {
    lanes total = {0};
    for (Py_ssize_t b = 0; b < m->blocks; b++) {
        if (!any(rate[b])) continue;
        lanes ue[2 * MOST_NODES], fe[2 * MOST_NODES] = {{0}};
        gather(u, m->nodes + b * n * LANES, n, ue);
        for (int q = 0; q < m->at.count; q++) {
            tensor F;
            symmetric S;
            lanes w = viscous_stress(m, b, q, n, ue, rate[b], strain0, &F, &S);
            lanes square = S.xx * S.xx + S.yy * S.yy + 2.0 * S.xy * S.xy;
            for (int i = 0; i < LANES; i++)
                if (w[i] != 0.0) total[i] += square[i] / (2.0 * w[i]);
            tensor P = {F.xx * S.xx + F.xy * S.xy, F.xx * S.xy + F.xy * S.yy,
                        F.yx * S.xx + F.yy * S.xy, F.yx * S.xy + F.yy * S.yy};
            add_forces(P, m->at.reference + 2 * n * q, m->at.inverse + 4 * (b * m->at.count + q), n, fe);
        }
        spread(fe, m->nodes + b * n * LANES, n, out);
    }
    return sum(total);
}

/* Tangent of `viscous_forces` added to the matrix, like `elastic_tangent`. With S weighted by r w:
   grad v S grad w on the diagonal, and r w (F grad w . grad v F^T + grad v . grad w F F^T). */
INLINE void viscous_tangent(const mesh *m, int n, const double *u, const stored *rate,
                            const stored *strain0, const int32_t *places, double *data) {
    for (Py_ssize_t b = 0; b < m->blocks; b++) {
        if (!any(rate[b])) continue;
        int Q = m->at.count;
        lanes ue[2 * MOST_NODES], w[MOST_POINTS];
        lanes shape[MOST_POINTS][2 * MOST_NODES], push[MOST_POINTS][2 * MOST_NODES];
        symmetric S[MOST_POINTS], B[MOST_POINTS];
        gather(u, m->nodes + b * n * LANES, n, ue);
        for (int q = 0; q < Q; q++) {
            tensor F;
            const double *g = m->at.reference + 2 * n * q;
            const stored *A = m->at.inverse + 4 * (b * Q + q);
            w[q] = viscous_stress(m, b, q, n, ue, rate[b], strain0, &F, &S[q]);
            B[q] = (symmetric){F.xx * F.xx + F.xy * F.xy, F.yx * F.yx + F.yy * F.yy,
                               F.xx * F.yx + F.xy * F.yy};
            for (int k = 0; k < n; k++) {
                lanes x = A[0] * g[2 * k] + A[2] * g[2 * k + 1], y = A[1] * g[2 * k] + A[3] * g[2 * k + 1];
                shape[q][2 * k] = x, shape[q][2 * k + 1] = y;
                push[q][2 * k] = F.xx * x + F.xy * y, push[q][2 * k + 1] = F.yx * x + F.yy * y;
            }
        }
        const int32_t *place = places + b * (n * (n + 1) / 2) * 4 * LANES;
        for (int k = 0; k < n; k++)
            for (int l = k; l < n; l++, place += 4 * LANES) {
                tensor K = {{0}, {0}, {0}, {0}};
                for (int q = 0; q < Q; q++) {
                    const lanes *v = shape[q] + 2 * k, *h = shape[q] + 2 * l;
                    const lanes *pv = push[q] + 2 * k, *ph = push[q] + 2 * l;
                    lanes inner = w[q] * (v[0] * h[0] + v[1] * h[1]);
                    lanes stress = (S[q].xx * v[0] + S[q].xy * v[1]) * h[0] +
                                   (S[q].xy * v[0] + S[q].yy * v[1]) * h[1];
                    K.xx += stress + inner * B[q].xx + w[q] * ph[0] * pv[0];
                    K.xy += inner * B[q].xy + w[q] * ph[0] * pv[1];
                    K.yx += inner * B[q].xy + w[q] * ph[1] * pv[0];
                    K.yy += stress + inner * B[q].yy + w[q] * ph[1] * pv[1];
                }
                scatter(K, place, data);
            }
    }
}
