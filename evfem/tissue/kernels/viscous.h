/* The weak form `kelvin_voigt`: S = 2 r (E - E0), r = eta / time step, E = (H + H^T + H^T H)/2. */

#include "elastic.h"

/* Rows and columns of the components of a symmetric tensor. */
#if DIM == 2
static const int ROW[STRAINS] = {0, 1, 0}, COLUMN[STRAINS] = {0, 1, 1};
#else
static const int ROW[STRAINS] = {0, 1, 2, 0, 1, 0}, COLUMN[STRAINS] = {0, 1, 2, 1, 2, 2};
#endif

INLINE void green_strain(tensor H, lanes *E) {
    for (int c = 0; c < STRAINS; c++) {
        int i = ROW[c], j = COLUMN[c];
        E[c] = H.a[i][j] + H.a[j][i];
        EACH(k) E[c] += H.a[k][i] * H.a[k][j];
        E[c] *= 0.5;
    }
}

/* Green strains of all points (B, at.count, STRAINS) as xx, yy, (zz,) xy(, yz, xz). */
INLINE void strains(request *r, int n) {
    const mesh *m = &r->m;
    const double *u = r->arrays[0];
    stored *out = r->arrays[1];
    for (Py_ssize_t b = 0; b < m->blocks; b++) {
        lanes ue[DIM * MOST_NODES], E[STRAINS];
        gather(u, m->nodes + b * n * LANES, n, ue);
        for (int q = 0; q < m->at.count; q++) {
            green_strain(displacement_gradient(&m->at, b, q, ue, n), E);
            for (int c = 0; c < STRAINS; c++) out[STRAINS * (b * m->at.count + q) + c] = E[c];
        }
    }
}

/* F and the weighted S of one point; returns r w. */
INLINE lanes viscous_stress(const mesh *m, Py_ssize_t b, int q, int n, const lanes *ue, lanes rate,
                            const stored *strain0, tensor *F, tensor *S) {
    Py_ssize_t point = b * m->at.count + q;
    lanes w = rate * m->weight[point], E[STRAINS];
    *F = displacement_gradient(&m->at, b, q, ue, n);
    green_strain(*F, E);
    for (int c = 0; c < STRAINS; c++)
        S->a[ROW[c]][COLUMN[c]] = S->a[COLUMN[c]][ROW[c]] = 2.0 * w * (E[c] - strain0[STRAINS * point + c]);
    EACH(i) F->a[i][i] += 1.0;
    return w;
}

/* Nodal forces F S : grad v added to out (N, DIM); returns what the step dissipates, S : (E - E0). */
INLINE void viscous(request *r, int n) {
    const mesh *m = &r->m;
    const double *u = r->arrays[0];
    const stored *rate = r->arrays[1], *strain0 = r->arrays[2];
    double *out = r->arrays[3];
    lanes total = {0};
    for (Py_ssize_t b = 0; b < m->blocks; b++) {
        if (!any(rate[b])) continue;
        lanes ue[DIM * MOST_NODES], fe[DIM * MOST_NODES] = {{0}};
        gather(u, m->nodes + b * n * LANES, n, ue);
        for (int q = 0; q < m->at.count; q++) {
            tensor F, S, P;
            lanes w = viscous_stress(m, b, q, n, ue, rate[b], strain0, &F, &S);
            lanes square = contracted(S, S);
            for (int i = 0; i < LANES; i++)
                if (w[i] != 0.0) total[i] += square[i] / (2.0 * w[i]);
            EACH(i) EACH(j) P.a[i][j] = DOT(F.a[i], 1, &S.a[0][j], DIM);
            add_forces(P, &m->at, b, q, n, fe);
        }
        spread(fe, m->nodes + b * n * LANES, n, out);
    }
    r->found[0] = sum(total);
}

/* Tangent of `viscous` added to the matrix, like `add_tangent`. With S weighted by r w:
   grad v S grad w on the diagonal, and r w (F grad w . grad v F^T + grad v . grad w F F^T). */
INLINE void add_viscous(request *r, int n) {
    const mesh *m = &r->m;
    const double *u = r->arrays[0];
    const stored *rate = r->arrays[1], *strain0 = r->arrays[2];
    const int32_t *places = r->arrays[3];
    double *data = r->arrays[4];
    int Q = m->at.count;
    for (Py_ssize_t b = 0; b < m->blocks; b++) {
        if (!any(rate[b])) continue;
        lanes ue[DIM * MOST_NODES], w[MOST_POINTS];
        lanes shape[MOST_POINTS][DIM * MOST_NODES], push[MOST_POINTS][DIM * MOST_NODES];
        lanes traction[MOST_POINTS][DIM * MOST_NODES];
        tensor B[MOST_POINTS];
        gather(u, m->nodes + b * n * LANES, n, ue);
        for (int q = 0; q < Q; q++) {
            tensor F, S;
            shape_gradients(m, b, q, n, shape[q]);
            w[q] = viscous_stress(m, b, q, n, ue, rate[b], strain0, &F, &S);
            EACH(i) EACH(j) B[q].a[i][j] = DOT(F.a[i], 1, F.a[j], 1);
            for (int k = 0; k < n; k++) {
                const lanes *v = shape[q] + DIM * k;
                EACH(i) push[q][DIM * k + i] = DOT(F.a[i], 1, v, 1);
                EACH(i) traction[q][DIM * k + i] = DOT(S.a[i], 1, v, 1);
            }
        }
        const int32_t *place = places + b * (n * (n + 1) / 2) * DIM * DIM * LANES;
        for (int k = 0; k < n; k++)
            for (int l = k; l < n; l++, place += DIM * DIM * LANES) {
                tensor K = ZERO;
                for (int q = 0; q < Q; q++) {
                    const lanes *v = shape[q] + DIM * k, *h = shape[q] + DIM * l, *t = traction[q] + DIM * k;
                    const lanes *pv = push[q] + DIM * k, *ph = push[q] + DIM * l;
                    lanes inner = w[q] * DOT(v, 1, h, 1), stress = DOT(t, 1, h, 1);
                    EACH(i) EACH(j) if (i == j)
                        K.a[i][j] += stress + inner * B[q].a[i][j] + w[q] * ph[i] * pv[j];
                    else
                        K.a[i][j] += inner * B[q].a[i][j] + w[q] * ph[i] * pv[j];
                }
                scatter(K, place, data);
            }
    }
}
