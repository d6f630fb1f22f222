/* Cells in vectors: LANES cells at a time, one in each lane. With reference gradients g_k of the shape
   functions and A = dxi/dX at a point, H = grad u = (sum_k u_k g_k^T) A and the shape gradients are A^T g_k.
   DIM is 2 for quadrilaterals and triangles of the plane, 3 for hexahedra. */

#include <Python.h>
#include <math.h>
#include <stdint.h>
#include <string.h>

#define LANES 8
#define FAR 0.028 /* of z^2: |ln J| about 1/3, where its series becomes too short */
#define INLINE static inline __attribute__((always_inline))

typedef double lanes __attribute__((vector_size(8 * LANES)));
typedef lanes stored __attribute__((aligned(8))); /* as numpy's arrays are */

/* The numbers in the lanes of a vector in memory. */
INLINE double *item(lanes *vector) { return (double *)vector; }

INLINE double sum(lanes values) {
    double total = 0.0;
    for (int i = 0; i < LANES; i++) total += values[i];
    return total;
}

/* ln J = 2 artanh(z), z = e / (2 + e), by its series; exactly where |ln J| > 1/3. nan if J < 0. */
INLINE lanes log_of_volume(lanes e) {
    lanes z = e / (2.0 + e), s = z * z, p = s / 21.0 + 1.0 / 19.0;
    p = p * s + 1.0 / 17.0;
    p = p * s + 1.0 / 15.0;
    p = p * s + 1.0 / 13.0;
    p = p * s + 1.0 / 11.0;
    p = p * s + 1.0 / 9.0;
    p = p * s + 1.0 / 7.0;
    p = p * s + 1.0 / 5.0;
    p = p * s + 1.0 / 3.0;
    lanes log_J = 2.0 * z * (p * s + 1.0);
    double far = 0.0;
    for (int i = 0; i < LANES; i++) far = e[i] > -1.0 && s[i] < far ? far : e[i] > -1.0 ? s[i] : 1.0;
    if (!(far <= FAR))
        for (int i = 0; i < LANES; i++) log_J[i] = log1p(e[i]);
    return log_J;
}

INLINE int any(lanes values) {
    for (int i = 0; i < LANES; i++)
        if (values[i] != 0.0) return 1;
    return 0;
}

#if DIM == 2
#define MOST_NODES 9  /* of a cell */
#define MOST_POINTS 9 /* where it is integrated, or ln J is sampled */
#define MOST_MODES 9
#define ZERO {{{{0}, {0}}, {{0}, {0}}}}
#define DOT(x, m, y, n) ((x)[0] * (y)[0] + (x)[m] * (y)[n])
#define SIZED(NAME, r)              \
    switch ((r)->m.n) {             \
    case 4: NAME(r, 4); break;      \
    case 6: NAME(r, 6); break;      \
    default: NAME(r, 9);            \
    }
#else
#define MOST_NODES 27
#define MOST_POINTS 27
#define MOST_MODES 4
#define ZERO {{{{0}}}}
#define DOT(x, m, y, n) ((x)[0] * (y)[0] + (x)[m] * (y)[n] + (x)[2 * (m)] * (y)[2 * (n)])
#define SIZED(NAME, r) \
    if ((r)->m.n == 8) NAME(r, 8); \
    else NAME(r, 27);
#endif
#define MOST_ARRAYS 7
#define EACH(i) _Pragma("GCC unroll 3") for (int i = 0; i < DIM; i++)

typedef struct { lanes a[DIM][DIM]; } tensor;

/* Gradients of the shape functions at some points of all cells. */
typedef struct {
    int count;
    const double *reference; /* (count, n, DIM); NULL: `inverse` has the gradients themselves, of one point */
    const stored *inverse;   /* (B, count, DIM DIM): dxi/dX, row by row; or (B, n, DIM) */
} points;

/* The cells of a space in B blocks, n nodes each. */
typedef struct {
    Py_ssize_t blocks;
    int n, modes, apart;  /* whether ln J is sampled elsewhere than at the points */
    const int32_t *nodes; /* (B, n, LANES) */
    points at, sample;
    const stored *weight; /* (B, at.count) */
    const stored *psi;    /* (B, modes, sample.count) */
    const stored *mean;   /* (B, modes): a_m */
} mesh;

/* What a loop works on: cells, its arrays in the order of `LOOPS` (`module.h`), branches of the tissue, places
   on a way; and the numbers that it finds. */
typedef struct {
    mesh m;
    void *arrays[MOST_ARRAYS];
    int branches, places;
    double found[2];
} request;

/* -- at a point ------------------------------------------------------------------------------ */

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

/* H = (sum_k u_k g_k^T) A at point q of block b */
INLINE tensor displacement_gradient(const points *at, Py_ssize_t b, int q, const lanes *ue, int n) {
    tensor D = ZERO, H;
    if (DIM == 3 && !at->reference) {
        const stored *G = at->inverse + DIM * n * b;
        for (int k = 0; k < n; k++)
            EACH(i) EACH(j) D.a[i][j] += ue[DIM * k + i] * G[DIM * k + j];
        return D;
    }
    const double *g = at->reference + DIM * n * q;
    const stored *A = at->inverse + DIM * DIM * (b * at->count + q);
    for (int k = 0; k < n; k++)
        EACH(i) EACH(j) D.a[i][j] += ue[DIM * k + i] * g[DIM * k + j];
    EACH(i) EACH(j) H.a[i][j] = DOT(D.a[i], 1, A + j, DIM);
    return H;
}

/* fe_k += P (A^T g_k) at point q of block b */
INLINE void add_forces(tensor P, const points *at, Py_ssize_t b, int q, int n, lanes *fe) {
    if (DIM == 3 && !at->reference) {
        const stored *G = at->inverse + DIM * n * b;
        for (int k = 0; k < n; k++)
            EACH(i) fe[DIM * k + i] += DOT(P.a[i], 1, G + DIM * k, 1);
        return;
    }
    const double *g = at->reference + DIM * n * q;
    const stored *A = at->inverse + DIM * DIM * (b * at->count + q);
    tensor T;
    EACH(i) EACH(j) T.a[i][j] = DOT(P.a[i], 1, A + DIM * j, 1);
    for (int k = 0; k < n; k++)
        EACH(i) fe[DIM * k + i] += DOT(T.a[i], 1, g + DIM * k, 1);
}

/* Shape gradients at point q of block b, (n, DIM). */
INLINE void shape_gradients(const mesh *m, Py_ssize_t b, int q, int n, lanes *out) {
    const double *g = m->at.reference + DIM * n * q;
    const stored *A = m->at.inverse + DIM * DIM * (b * m->at.count + q);
    for (int k = 0; k < n; k++) EACH(i) out[DIM * k + i] = DOT(A + i, DIM, g + DIM * k, 1);
}

#if DIM == 2
/* cofactors of 1 + H */
INLINE tensor cofactors(tensor H) {
    return (tensor){{{1.0 + H.a[1][1], -H.a[1][0]}, {-H.a[0][1], 1.0 + H.a[0][0]}}};
}

/* J - 1, with the digits that J loses where it is nearly 1 */
INLINE lanes volume_change(tensor H) {
    return H.a[0][0] + H.a[1][1] + (H.a[0][0] * H.a[1][1] - H.a[0][1] * H.a[1][0]);
}

#else
INLINE lanes minor(tensor F, int i, int j) {
    int k = (i + 1) % 3, l = (i + 2) % 3, p = (j + 1) % 3, q = (j + 2) % 3;
    return F.a[k][p] * F.a[l][q] - F.a[k][q] * F.a[l][p];
}

INLINE tensor cofactors(tensor H) {
    tensor C, F = H;
    EACH(i) F.a[i][i] += 1.0;
    EACH(i) EACH(j) C.a[i][j] = minor(F, i, j);
    return C;
}

INLINE lanes volume_change(tensor H) {
    tensor C;
    EACH(i) EACH(j) C.a[i][j] = minor(H, i, j);
    lanes det = H.a[0][0] * C.a[0][0] + H.a[0][1] * C.a[0][1] + H.a[0][2] * C.a[0][2];
    return H.a[0][0] + H.a[1][1] + H.a[2][2] + (C.a[0][0] + C.a[1][1] + C.a[2][2] + det);
}

#endif

INLINE lanes contracted(tensor S, tensor T) {
    lanes total = {0};
    EACH(i) EACH(j) total += S.a[i][j] * T.a[i][j];
    return total;
}

INLINE lanes trace(tensor H) {
    lanes total = {0};
    EACH(i) total += H.a[i][i];
    return total;
}

INLINE tensor scaled(lanes factor, tensor T) {
    EACH(i) EACH(j) T.a[i][j] *= factor;
    return T;
}

/* H + s D */
INLINE tensor between(tensor H, lanes s, tensor D) {
    EACH(i) EACH(j) H.a[i][j] += s * D.a[i][j];
    return H;
}

INLINE tensor inverse_transposed(tensor H, lanes e) { return scaled(1.0 / (1.0 + e), cofactors(H)); }

/* Add one pair's stiffness (DIM, DIM) to the entries of the matrix; what is below the diagonal of a node
   with itself goes to the place beyond the last one. */
INLINE void scatter(tensor K, const int32_t *place, double *data) {
    EACH(i) EACH(j) for (int l = 0; l < LANES; l++)
        data[place[(DIM * i + j) * LANES + l]] += item(&K.a[i][j])[l];
}
