/* Hexahedra in vectors: LANES cells at a time, one in each lane. With reference gradients g_k of the
   shape functions and A = dxi/dX at a point, H = grad u = (sum_k u_k g_k^T) A and the shape gradients are
   A^T g_k. ln J is sampled at the points, or once with the means of the shape gradients over the cell. */

#include "lanes.h"

#define DIM 3
#define MOST_NODES 27  /* of a cell */
#define MOST_POINTS 27 /* where it is integrated, or ln J is sampled */
#define MOST_MODES 4
#define EACH(i) _Pragma("GCC unroll 3") for (int i = 0; i < DIM; i++)

typedef struct { lanes a[DIM][DIM]; } tensor;

/* The cells of a space in B blocks, n nodes each. */
typedef struct {
    Py_ssize_t blocks;
    int n, points, modes;
    const int32_t *nodes;        /* (B, n, LANES) */
    const stored *weight;        /* (B, points) */
    const double *reference;     /* (points, n, 3) */
    const stored *inverse;       /* (B, points, 9): dxi/dX, row by row */
    const stored *mean_gradient; /* (B, n, 3); NULL where ln J is sampled at the points */
    const stored *psi;           /* (B, modes, samples) */
    const stored *mean;          /* (B, modes): a_m */
} mesh;

INLINE int samples_of(const mesh *m) { return m->mean_gradient ? 1 : m->points; }

INLINE void gather(const double *u, const int32_t *nodes, int n, lanes *ue) {
    for (int k = 0; k < n; k++)
        for (int i = 0; i < LANES; i++) {
            const double *at = u + DIM * (Py_ssize_t)nodes[k * LANES + i];
            EACH(c) item(ue + DIM * k + c)[i] = at[c];
        }
}

INLINE void spread(lanes *fe, const int32_t *nodes, int n, double *out) {
    for (int k = 0; k < n; k++)
        for (int i = 0; i < LANES; i++) {
            double *at = out + DIM * (Py_ssize_t)nodes[k * LANES + i];
            EACH(c) at[c] += item(fe + DIM * k + c)[i];
        }
}

/* H = (sum_k u_k g_k^T) A at point q */
INLINE tensor displacement_gradient(const mesh *m, Py_ssize_t b, int q, const lanes *ue, int n) {
    const double *g = m->reference + DIM * n * q;
    const stored *A = m->inverse + DIM * DIM * (b * m->points + q);
    tensor D = {{{{0}}}}, H;
    for (int k = 0; k < n; k++)
        EACH(i) EACH(j) D.a[i][j] += ue[DIM * k + i] * g[DIM * k + j];
    EACH(i) EACH(j) H.a[i][j] = D.a[i][0] * A[j] + D.a[i][1] * A[3 + j] + D.a[i][2] * A[6 + j];
    return H;
}

/* fe_k += P (A^T g_k) at point q */
INLINE void add_forces(tensor P, const mesh *m, Py_ssize_t b, int q, int n, lanes *fe) {
    const double *g = m->reference + DIM * n * q;
    const stored *A = m->inverse + DIM * DIM * (b * m->points + q);
    tensor T;
    EACH(i) EACH(j) T.a[i][j] = P.a[i][0] * A[3 * j] + P.a[i][1] * A[3 * j + 1] + P.a[i][2] * A[3 * j + 2];
    for (int k = 0; k < n; k++)
        EACH(i) fe[DIM * k + i] +=
            T.a[i][0] * g[DIM * k] + T.a[i][1] * g[DIM * k + 1] + T.a[i][2] * g[DIM * k + 2];
}

/* The same where ln J is sampled. */
INLINE tensor sampled_gradient(const mesh *m, Py_ssize_t b, int s, const lanes *ue, int n) {
    if (!m->mean_gradient) return displacement_gradient(m, b, s, ue, n);
    const stored *G = m->mean_gradient + DIM * n * b;
    tensor H = {{{{0}}}};
    for (int k = 0; k < n; k++)
        EACH(i) EACH(j) H.a[i][j] += ue[DIM * k + i] * G[DIM * k + j];
    return H;
}

INLINE void add_sampled_forces(tensor P, const mesh *m, Py_ssize_t b, int s, int n, lanes *fe) {
    if (!m->mean_gradient) {
        add_forces(P, m, b, s, n, fe);
        return;
    }
    const stored *G = m->mean_gradient + DIM * n * b;
    for (int k = 0; k < n; k++)
        EACH(i) fe[DIM * k + i] +=
            P.a[i][0] * G[DIM * k] + P.a[i][1] * G[DIM * k + 1] + P.a[i][2] * G[DIM * k + 2];
}

/* cofactors of 1 + H, if `one` is 1, or of H, if it is 0 */
INLINE tensor cofactors(tensor H, double one) {
    tensor C, F = H;
    EACH(i) F.a[i][i] += one;
    EACH(i) EACH(j) {
        int k = (i + 1) % 3, l = (i + 2) % 3, p = (j + 1) % 3, q = (j + 2) % 3;
        C.a[i][j] = F.a[k][p] * F.a[l][q] - F.a[k][q] * F.a[l][p];
    }
    return C;
}

/* J - 1, with the digits that J loses where it is nearly 1 */
INLINE lanes volume_change(tensor H) {
    tensor C = cofactors(H, 0.0);
    lanes det = H.a[0][0] * C.a[0][0] + H.a[0][1] * C.a[0][1] + H.a[0][2] * C.a[0][2];
    return H.a[0][0] + H.a[1][1] + H.a[2][2] + (C.a[0][0] + C.a[1][1] + C.a[2][2] + det);
}

INLINE tensor inverse_transposed(tensor H, lanes e) {
    tensor C = cofactors(H, 1.0);
    lanes share = 1.0 / (1.0 + e);
    EACH(i) EACH(j) C.a[i][j] *= share;
    return C;
}

INLINE tensor scaled(lanes factor, tensor T) {
    EACH(i) EACH(j) T.a[i][j] *= factor;
    return T;
}

INLINE lanes contracted(tensor S, tensor T) {
    lanes total = {0};
    EACH(i) EACH(j) total += S.a[i][j] * T.a[i][j];
    return total;
}

/* Add one pair's stiffness (3, 3) to the entries of the matrix; what is below the diagonal of a node with
   itself goes to the place beyond the last one. */
INLINE void scatter(tensor K, const int32_t *place, double *data) {
    EACH(i) EACH(j) for (int l = 0; l < LANES; l++) data[place[(3 * i + j) * LANES + l]] += item(&K.a[i][j])[l];
}
