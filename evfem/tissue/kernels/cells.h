/* Cells of the plane in vectors: LANES cells at a time, one in each lane. With reference gradients g_k
   of the shape functions and A = dxi/dX at a point, H = grad u = (sum_k u_k g_k^T) A and the shape
   gradients are A^T g_k. */

#include "lanes.h"

#define DIM 2
#define MOST_NODES 9  /* of a cell */
#define MOST_POINTS 9 /* where it is integrated, or ln J is sampled */

typedef struct { lanes xx, xy, yx, yy; } tensor;

/* Gradients of the shape functions at some points of all cells. */
typedef struct {
    int count;
    const double *reference; /* (count, n, 2) */
    const stored *inverse;    /* (B, count, 4): dxi/dX as 11, 12, 21, 22 */
} points;

/* The cells of a space in B blocks, n nodes each. */
typedef struct {
    Py_ssize_t blocks;
    int n, modes;
    const int32_t *nodes; /* (B, n, LANES) */
    points at, sample;
    const stored *weight; /* (B, at.count) */
    const stored *psi;    /* (B, modes, sample.count) */
    const stored *mean;   /* (B, modes): a_m */
} mesh;

/* -- at a point ------------------------------------------------------------------------------ */

INLINE void gather(const double *u, const int32_t *nodes, int n, lanes *ue) {
    for (int k = 0; k < n; k++)
        for (int i = 0; i < LANES; i++) {
            const double *at = u + 2 * (Py_ssize_t)nodes[k * LANES + i];
            item(ue + 2 * k)[i] = at[0];
            item(ue + 2 * k + 1)[i] = at[1];
        }
}

INLINE void spread(lanes *fe, const int32_t *nodes, int n, double *out) {
    for (int k = 0; k < n; k++)
        for (int i = 0; i < LANES; i++) {
            double *at = out + 2 * (Py_ssize_t)nodes[k * LANES + i];
            at[0] += item(fe + 2 * k)[i];
            at[1] += item(fe + 2 * k + 1)[i];
        }
}

/* H = (sum_k u_k g_k^T) A */
INLINE tensor displacement_gradient(const lanes *ue, const double *g, const stored *A, int n) {
    lanes xx = {0}, xy = {0}, yx = {0}, yy = {0};
    for (int k = 0; k < n; k++) {
        xx += ue[2 * k] * g[2 * k];
        xy += ue[2 * k] * g[2 * k + 1];
        yx += ue[2 * k + 1] * g[2 * k];
        yy += ue[2 * k + 1] * g[2 * k + 1];
    }
    return (tensor){xx * A[0] + xy * A[2], xx * A[1] + xy * A[3],
                    yx * A[0] + yy * A[2], yx * A[1] + yy * A[3]};
}

/* fe_k += P (A^T g_k) */
INLINE void add_forces(tensor P, const double *g, const stored *A, int n, lanes *fe) {
    lanes xx = P.xx * A[0] + P.xy * A[1], xy = P.xx * A[2] + P.xy * A[3];
    lanes yx = P.yx * A[0] + P.yy * A[1], yy = P.yx * A[2] + P.yy * A[3];
    for (int k = 0; k < n; k++) {
        fe[2 * k] += xx * g[2 * k] + xy * g[2 * k + 1];
        fe[2 * k + 1] += yx * g[2 * k] + yy * g[2 * k + 1];
    }
}

/* J - 1, with the digits that J loses where it is nearly 1 */
INLINE lanes volume_change(tensor H) { return H.xx + H.yy + (H.xx * H.yy - H.xy * H.yx); }

INLINE tensor inverse_transposed(tensor H, lanes e) {
    lanes share = 1.0 / (1.0 + e);
    return (tensor){(1.0 + H.yy) * share, -H.yx * share, -H.xy * share, (1.0 + H.xx) * share};
}

INLINE tensor scaled(lanes factor, tensor T) {
    return (tensor){factor * T.xx, factor * T.xy, factor * T.yx, factor * T.yy};
}
