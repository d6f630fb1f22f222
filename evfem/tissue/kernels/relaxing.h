/* The weak form `maxwell` without bulk, `branches` at a time: A = sum of m_i C_i^-1, C_i = M_i / det(M_i)^(1/3),
   M_i = B_i + a_i Cbar, P = c (F A - tr(C A)/3 F^-T), c = J^(-2/3), Cbar = c C, C = F^T F. With unit dF = e_j e_b^T

       dCbar = c (e_b f_j^T + f_j e_b^T) - 2/3 G_jb Cbar,    G = F^-T,  f_j row j of F
       dA    = -sum of m_i a_i / det(M_i)^(1/3) [C_i^-1 dCbar C_i^-1 - (C_i^-1 : dCbar)/3 C_i^-1]
       dP_ia = -2/3 (G_jb P_ia + c (F A)_jb G_ia) + c (delta_ij A_ab + tr(C A)/3 G_ib G_ja)
               + c ((F dA)_ia - tr(C dA)/3 G_ia)

   A symmetric tensor is KEPT numbers, xx, yy, zz, xy(, yz, xz); in the plane zz counts too. */

#include "viscous.h"

#define KEPT (DIM == 2 ? 4 : 6)

/* A tensor in the plane or in space; `out` is its zz in the plane. */
typedef struct {
    tensor in;
    lanes out;
} solid;

INLINE solid unpacked(const stored *from) {
    solid T;
#if DIM == 2
    T.in = (tensor){{{from[0], from[3]}, {from[3], from[1]}}};
    T.out = from[2];
#else
    T.in = (tensor){{{from[0], from[3], from[5]}, {from[3], from[1], from[4]}, {from[5], from[4], from[2]}}};
    T.out = (lanes){0};
#endif
    return T;
}

INLINE void pack(solid T, stored *to) {
    to[0] = T.in.a[0][0], to[1] = T.in.a[1][1], to[3] = T.in.a[0][1];
#if DIM == 2
    to[2] = T.out;
#else
    to[2] = T.in.a[2][2], to[4] = T.in.a[1][2], to[5] = T.in.a[0][2];
#endif
}

INLINE solid plus(solid S, lanes factor, solid T) {
    EACH(i) EACH(j) S.in.a[i][j] += factor * T.in.a[i][j];
    S.out += factor * T.out;
    return S;
}

INLINE solid times(lanes factor, solid T) { return (solid){scaled(factor, T.in), factor * T.out}; }

INLINE lanes full_contraction(solid S, solid T) { return contracted(S.in, T.in) + S.out * T.out; }

INLINE lanes whole_trace(solid T) { return trace(T.in) + T.out; }

INLINE solid product(solid S, solid T) {
    solid U;
    EACH(i) EACH(j) U.in.a[i][j] = DOT(S.in.a[i], 1, &T.in.a[0][j], DIM);
    U.out = S.out * T.out;
    return U;
}

/* tr(S T) */
INLINE lanes traced(solid S, solid T) {
    lanes total = S.out * T.out;
    EACH(i) EACH(j) total += S.in.a[i][j] * T.in.a[j][i];
    return total;
}

INLINE lanes cube_root(lanes x) {
    for (int i = 0; i < LANES; i++) x[i] = cbrt(x[i]);
    return x;
}

/* M^-1 det(M)^(1/3) of a symmetric M, and det(M)^(1/3) */
INLINE solid unimodular_inverse(solid M, lanes *root) {
    solid A;
#if DIM == 2
    lanes det = M.in.a[0][0] * M.in.a[1][1] - M.in.a[0][1] * M.in.a[0][1];
    *root = cube_root(det * M.out);
    lanes factor = *root / det;
    A.in = (tensor){{{factor * M.in.a[1][1], -factor * M.in.a[0][1]},
                     {-factor * M.in.a[0][1], factor * M.in.a[0][0]}}};
    A.out = *root / M.out;
#else
    EACH(i) EACH(j) A.in.a[i][j] = minor(M.in, i, j);
    lanes det = DOT(M.in.a[0], 1, A.in.a[0], 1);
    *root = cube_root(det);
    A.in = scaled(*root / det, A.in);
    A.out = (lanes){0};
#endif
    return A;
}

/* F, G = F^-T, c = J^(-2/3) and Cbar of one point */
typedef struct {
    tensor F, G;
    lanes c;
    solid bar;
} strained;

INLINE strained strained_at(const mesh *m, Py_ssize_t b, int q, int n, const lanes *ue) {
    strained at;
    tensor H = displacement_gradient(&m->at, b, q, ue, n);
    lanes e = volume_change(H), root = cube_root(1.0 + e);
    at.G = inverse_transposed(H, e);
    at.F = H;
    EACH(i) at.F.a[i][i] += 1.0;
    at.c = 1.0 / (root * root);
    EACH(i) EACH(j) at.bar.in.a[i][j] = at.c * DOT(&at.F.a[0][i], DIM, &at.F.a[0][j], DIM);
    at.bar.out = DIM == 2 ? at.c : (lanes){0};
    return at;
}

/* c F X - (Cbar : X)/3 G */
INLINE tensor isochoric_stress(const strained *at, solid X) {
    tensor P;
    lanes third = full_contraction(at->bar, X) / 3.0;
    EACH(i) EACH(j) P.a[i][j] = at->c * DOT(at->F.a[i], 1, &X.in.a[0][j], DIM) - third * at->G.a[i][j];
    return P;
}

/* M of a branch from its B and a, `before` (KEPT + 1) */
INLINE solid moved_on(const stored *before, solid bar) { return plus(unpacked(before), before[KEPT], bar); }

/* Whether any of a block's cells has a branch. */
INLINE int relaxes(const stored *modulus, int branches) {
    for (int i = 0; i < branches; i++)
        if (any(modulus[i])) return 1;
    return 0;
}

/* -- the beginning of a step -------------------------------------------------------------------- */

/* (1 - e^-y)/y, 1 less that, and e^-y */
INLINE void means(lanes y, lanes *f, lanes *rest, lanes *decay) {
    for (int i = 0; i < LANES; i++) {
        double one = y[i];
        (*decay)[i] = exp(-one);
        (*f)[i] = -expm1(-one) / one;
        double series = one / 2.0 * (1.0 - one / 3.0 * (1.0 - one / 4.0 * (1.0 - one / 5.0)));
        (*rest)[i] = one < 1e-3 ? series : 1.0 - (*f)[i];
    }
}

/* B and a of all branches, both over 1 + a, from steps over their times x (B, branches), displacements and
   C_i (B, Q, branches, KEPT). */
INLINE void begin_relaxing(request *r, int n) {
    const mesh *m = &r->m;
    const int branches = r->branches;
    const double *u = r->arrays[0];
    const stored *x = r->arrays[1], *kept = r->arrays[2];
    stored *before = r->arrays[3];
    for (Py_ssize_t b = 0; b < m->blocks; b++) {
        lanes ue[DIM * MOST_NODES];
        gather(u, m->nodes + b * n * LANES, n, ue);
        for (int q = 0; q < m->at.count; q++) {
            strained at = strained_at(m, b, q, n, ue);
            for (int i = 0; i < branches; i++) {
                Py_ssize_t place = (b * m->at.count + q) * branches + i;
                solid C = unpacked(kept + KEPT * place);
                lanes root, f, rest, decay, h = full_contraction(at.bar, unimodular_inverse(C, &root)) / root / 3.0;
                means(h * x[b * branches + i], &f, &rest, &decay);
                lanes a = rest / h, scale = 1.0 / (1.0 + a);
                pack(times(scale, plus(times(decay, C), (f - decay) / h, at.bar)), before + (KEPT + 1) * place);
                before[(KEPT + 1) * place + KEPT] = a * scale;
            }
        }
    }
}

/* -- forces and tangent ------------------------------------------------------------------------- */

/* Nodal forces P : grad v added to out (N, DIM); moduli (B, branches), `before` (B, Q, branches, KEPT + 1). */
INLINE void relaxing(request *r, int n) {
    const mesh *m = &r->m;
    const int branches = r->branches;
    const double *u = r->arrays[0];
    const stored *modulus = r->arrays[1], *before = r->arrays[2];
    double *out = r->arrays[3];
    for (Py_ssize_t b = 0; b < m->blocks; b++) {
        if (!relaxes(modulus + b * branches, branches)) continue;
        lanes ue[DIM * MOST_NODES], fe[DIM * MOST_NODES] = {{0}}, root;
        gather(u, m->nodes + b * n * LANES, n, ue);
        for (int q = 0; q < m->at.count; q++) {
            Py_ssize_t point = b * m->at.count + q;
            strained at = strained_at(m, b, q, n, ue);
            solid A = {ZERO, {0}};
            for (int i = 0; i < branches; i++) {
                solid M = moved_on(before + (KEPT + 1) * (point * branches + i), at.bar);
                A = plus(A, modulus[b * branches + i] * m->weight[point], unimodular_inverse(M, &root));
            }
            add_forces(isochoric_stress(&at, A), &m->at, b, q, n, fe);
        }
        spread(fe, m->nodes + b * n * LANES, n, out);
    }
}

/* Moduli of one point, dP_ia = D[i][j].a[a][b] dF_jb, with its weight. */
INLINE void relaxing_moduli(const strained *at, int branches, const stored *modulus, const stored *before,
                            lanes weight, tensor (*D)[DIM]) {
    solid A = {ZERO, {0}}, dA[DIM][DIM];
    EACH(j) EACH(b) dA[j][b] = A;
    for (int i = 0; i < branches; i++) {
        lanes root, m = modulus[i] * weight;
        solid C = unimodular_inverse(moved_on(before + (KEPT + 1) * i, at->bar), &root);
        solid far = product(product(C, at->bar), C);
        lanes beta = -m * before[(KEPT + 1) * i + KEPT] / root, mean = full_contraction(C, at->bar);
        A = plus(A, m, C);
        EACH(j) {
            lanes p[DIM];
            EACH(k) p[k] = at->c * DOT(C.in.a[k], 1, at->F.a[j], 1);
            EACH(b) {
                lanes g = 2.0 / 3.0 * at->G.a[j][b], along = 2.0 * p[b] - g * mean;
                solid *to = &dA[j][b];
                *to = plus(plus(*to, -beta * g, far), -beta * along / 3.0, C);
                EACH(k) EACH(l) to->in.a[k][l] += beta * (C.in.a[b][k] * p[l] + p[k] * C.in.a[b][l]);
            }
        }
    }
    tensor P = isochoric_stress(at, A), FA;
    lanes third = full_contraction(at->bar, A) / 3.0;
    EACH(i) EACH(a) FA.a[i][a] = at->c * DOT(at->F.a[i], 1, &A.in.a[0][a], DIM);
    EACH(j) EACH(b) {
        tensor dP = isochoric_stress(at, dA[j][b]);
        EACH(i) EACH(a) {
            lanes more = third * at->G.a[i][b] * at->G.a[j][a];
            more -= 2.0 / 3.0 * (at->G.a[j][b] * P.a[i][a] + FA.a[j][b] * at->G.a[i][a]);
            if (i == j) more += at->c * A.in.a[a][b];
            D[i][j].a[a][b] = dP.a[i][a] + more;
        }
    }
}

/* Tangent of `relaxing` added to the matrix, like `add_tangent`. */
INLINE void add_relaxing(request *r, int n) {
    const mesh *m = &r->m;
    const int branches = r->branches;
    const double *u = r->arrays[0];
    const stored *modulus = r->arrays[1], *before = r->arrays[2];
    const int32_t *places = r->arrays[3];
    double *data = r->arrays[4];
    for (Py_ssize_t b = 0; b < m->blocks; b++) {
        if (!relaxes(modulus + b * branches, branches)) continue;
        lanes ue[DIM * MOST_NODES];
        tensor K[MOST_NODES * (MOST_NODES + 1) / 2];
        memset(K, 0, sizeof(tensor) * (n * (n + 1) / 2));
        gather(u, m->nodes + b * n * LANES, n, ue);
        for (int q = 0; q < m->at.count; q++) {
            Py_ssize_t point = b * m->at.count + q;
            strained at = strained_at(m, b, q, n, ue);
            tensor D[DIM][DIM], *pair = K;
            lanes shape[DIM * MOST_NODES];
            relaxing_moduli(&at, branches, modulus + b * branches, before + (KEPT + 1) * point * branches,
                            m->weight[point], D);
            shape_gradients(m, b, q, n, shape);
            for (int k = 0; k < n; k++) {
                lanes left[DIM][DIM][DIM];
                EACH(i) EACH(j) EACH(c) left[i][j][c] = DOT(shape + DIM * k, 1, &D[i][j].a[0][c], DIM);
                for (int l = k; l < n; l++, pair++)
                    EACH(i) EACH(j) pair->a[i][j] += DOT(left[i][j], 1, shape + DIM * l, 1);
            }
        }
        const int32_t *place = places + b * (n * (n + 1) / 2) * DIM * DIM * LANES;
        for (int p = 0; p < n * (n + 1) / 2; p++, place += DIM * DIM * LANES) scatter(K[p], place, data);
    }
}

/* -- the end of a step -------------------------------------------------------------------------- */

/* dev(C^-1 Cbar)/2, from C^-1 */
INLINE solid overstrain(solid inverse, solid bar) {
    solid e = times(0.5 + (lanes){0}, product(inverse, bar));
    lanes mean = whole_trace(e) / 3.0;
    EACH(i) e.in.a[i][i] -= mean;
    if (DIM == 2) e.out -= mean;
    return e;
}

/* C_i at the end (B, Q, branches, KEPT); returns the stored energy and what was lost since the displacements
   u0 and C_i `kept`, with the numbers `loss` (B, branches, 4): e^-x and those of e0:e0, e0:d and d:d, where
   d = e1 - e^-x e0. */
INLINE void end_relaxing(request *r, int n) {
    const mesh *m = &r->m;
    const int branches = r->branches;
    const double *u = r->arrays[0], *u0 = r->arrays[3];
    const stored *modulus = r->arrays[1], *before = r->arrays[2], *kept = r->arrays[4], *loss = r->arrays[5];
    stored *out = r->arrays[6];
    lanes total = {0}, gone = {0};
    for (Py_ssize_t b = 0; b < m->blocks; b++) {
        if (!relaxes(modulus + b * branches, branches)) continue;
        lanes ue[DIM * MOST_NODES], ue0[DIM * MOST_NODES];
        gather(u, m->nodes + b * n * LANES, n, ue);
        gather(u0, m->nodes + b * n * LANES, n, ue0);
        for (int q = 0; q < m->at.count; q++) {
            Py_ssize_t point = b * m->at.count + q;
            strained at = strained_at(m, b, q, n, ue), at0 = strained_at(m, b, q, n, ue0);
            for (int i = 0; i < branches; i++) {
                Py_ssize_t place = point * branches + i;
                const stored *number = loss + 4 * (b * branches + i);
                lanes root, root0, w = modulus[b * branches + i] * m->weight[point];
                solid M = moved_on(before + (KEPT + 1) * place, at.bar), A = unimodular_inverse(M, &root);
                solid A0 = unimodular_inverse(unpacked(kept + KEPT * place), &root0);
                A0 = times(1.0 / root0, A0);
                solid e0 = overstrain(A0, at0.bar), d = plus(overstrain(A, at.bar), -number[0], e0);
                pack(times(1.0 / root, M), out + KEPT * place);
                total += 0.5 * w * (full_contraction(A, at.bar) - 3.0);
                gone += 2.0 * w * (number[1] * traced(e0, e0) + number[2] * traced(e0, d) + number[3] * traced(d, d));
            }
        }
    }
    r->found[0] = sum(total), r->found[1] = sum(gone);
}
