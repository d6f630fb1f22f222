/* The weak form `kelvin_voigt` in space: S = 2 r (E - E0), r = eta / time step, E = (H + H^T + H^T H)/2. */

#include "solid_elastic.h"

/* Rows and columns of the six components of a symmetric tensor. */
static const int ROW[6] = {0, 1, 2, 0, 1, 0}, COLUMN[6] = {0, 1, 2, 1, 2, 2};

INLINE void green_strain(tensor H, lanes *E) {
    for (int c = 0; c < 6; c++) {
        int i = ROW[c], j = COLUMN[c];
        E[c] = 0.5 * (H.a[i][j] + H.a[j][i] + H.a[0][i] * H.a[0][j] + H.a[1][i] * H.a[1][j] +
                      H.a[2][i] * H.a[2][j]);
    }
}

/* Green strains of all points (B, points, 6) as xx, yy, zz, xy, yz, xz. */
INLINE void viscous_strains(const mesh *m, int n, const double *u, stored *out) {
    for (Py_ssize_t b = 0; b < m->blocks; b++) {
        lanes ue[DIM * MOST_NODES], E[6];
        gather(u, m->nodes + b * n * LANES, n, ue);
        for (int q = 0; q < m->points; q++) {
            green_strain(displacement_gradient(m, b, q, ue, n), E);
            for (int c = 0; c < 6; c++) out[6 * (b * m->points + q) + c] = E[c];
        }
    }
}

/* F and the weighted S of one point; returns r w. */
INLINE lanes viscous_stress(const mesh *m, Py_ssize_t b, int q, int n, const lanes *ue, lanes rate,
                            const stored *strain0, tensor *F, tensor *S) {
    Py_ssize_t point = b * m->points + q;
    lanes w = rate * m->weight[point], E[6];
    *F = displacement_gradient(m, b, q, ue, n);
    green_strain(*F, E);
    for (int c = 0; c < 6; c++)
        S->a[ROW[c]][COLUMN[c]] = S->a[COLUMN[c]][ROW[c]] = 2.0 * w * (E[c] - strain0[6 * point + c]);
    EACH(i) F->a[i][i] += 1.0;
    return w;
}

/* Nodal forces F S : grad v added to out (N, 3); returns what the step dissipates, S : (E - E0). */
INLINE double viscous_forces(const mesh *m, int n, const double *u, const stored *rate,
                             const stored *strain0, double *out) {
    lanes total = {0};
    for (Py_ssize_t b = 0; b < m->blocks; b++) {
        if (!any(rate[b])) continue;
        lanes ue[DIM * MOST_NODES], fe[DIM * MOST_NODES] = {{0}};
        gather(u, m->nodes + b * n * LANES, n, ue);
        for (int q = 0; q < m->points; q++) {
            tensor F, S, P;
            lanes w = viscous_stress(m, b, q, n, ue, rate[b], strain0, &F, &S);
            lanes square = contracted(S, S);
            for (int i = 0; i < LANES; i++)
                if (w[i] != 0.0) total[i] += square[i] / (2.0 * w[i]);
            EACH(i) EACH(j) P.a[i][j] =
                F.a[i][0] * S.a[0][j] + F.a[i][1] * S.a[1][j] + F.a[i][2] * S.a[2][j];
            add_forces(P, m, b, q, n, fe);
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
        lanes ue[DIM * MOST_NODES], w[MOST_POINTS];
        lanes shape[MOST_POINTS][DIM * MOST_NODES], push[MOST_POINTS][DIM * MOST_NODES];
        lanes traction[MOST_POINTS][DIM * MOST_NODES];
        tensor B[MOST_POINTS];
        gather(u, m->nodes + b * n * LANES, n, ue);
        for (int q = 0; q < m->points; q++) {
            tensor F, S, unit = {{{{0}}}};
            w[q] = viscous_stress(m, b, q, n, ue, rate[b], strain0, &F, &S);
            EACH(i) unit.a[i][i] += 1.0;
            EACH(i) EACH(j) B[q].a[i][j] =
                F.a[i][0] * F.a[j][0] + F.a[i][1] * F.a[j][1] + F.a[i][2] * F.a[j][2];
            memset(shape[q], 0, sizeof(lanes) * DIM * n);
            memset(push[q], 0, sizeof(lanes) * DIM * n);
            memset(traction[q], 0, sizeof(lanes) * DIM * n);
            add_forces(unit, m, b, q, n, shape[q]);
            add_forces(F, m, b, q, n, push[q]);
            add_forces(S, m, b, q, n, traction[q]);
        }
        const int32_t *place = places + b * (n * (n + 1) / 2) * DIM * DIM * LANES;
        for (int k = 0; k < n; k++)
            for (int l = k; l < n; l++, place += DIM * DIM * LANES) {
                tensor K = {{{{0}}}};
                for (int q = 0; q < m->points; q++) {
                    const lanes *v = shape[q] + DIM * k, *h = shape[q] + DIM * l, *t = traction[q] + DIM * k;
                    const lanes *pv = push[q] + DIM * k, *ph = push[q] + DIM * l;
                    lanes inner = w[q] * (v[0] * h[0] + v[1] * h[1] + v[2] * h[2]);
                    lanes stress = t[0] * h[0] + t[1] * h[1] + t[2] * h[2];
                    EACH(i) EACH(j) K.a[i][j] += inner * B[q].a[i][j] + w[q] * ph[i] * pv[j];
                    EACH(i) K.a[i][i] += stress;
                }
                scatter(K, place, data);
            }
    }
}
