/* Compiled element loops: twins of the weak forms `neo_hookean` and `kelvin_voigt` in the plane.

   LANES cells at a time, one in each lane of a vector; the arrays are laid out so by
   `evfem.tissue.kernels.blocks`. With reference gradients g_k of the shape functions and A = dxi/dX
   at a point, H = grad u = (sum_k u_k g_k^T) A and the shape gradients are A^T g_k.

   neo_hookean: W = mu/2 (F:F - 2 - 2 theta) + lmbda/2 theta^2. The volume measure theta of a cell
   has modes that are orthonormal in its area, theta = sum_m c_m phi_m, c_m = sum_s Psi_ms ln J_s; with
   a_m the integral of phi_m

       volume energy  sum_m lmbda/2 c_m^2 - mu a_m c_m,   pull_s = sum_m Psi_ms (lmbda c_m - mu a_m)
       forces         mu F : grad v at the points, pull F^-T : grad v at the samples
       tangent        mu grad v : grad w (constant, not here) + lmbda sum_m r_m r_m^T
                      - sum_s pull_s F^-T grad(w)^T F^-T : grad v,  r_m = sum_s Psi_ms F^-T : grad v

   Without modes theta = ln J at every point: Psi = sqrt(w), one mode for each.

   kelvin_voigt: S = 2 r (E - E0), r = eta / time step, E = (H + H^T + H^T H) / 2.

   Every loop is compiled for three instruction sets of x86 and chosen when the module is loaded. */

#define PY_SSIZE_T_CLEAN
#define Py_LIMITED_API 0x030b0000
#include <Python.h>
#include <math.h>
#include <stdint.h>
#include <string.h>

#define LANES 8
#define MOST_NODES 9  /* of a cell */
#define MOST_POINTS 9 /* where it is integrated, or ln J is sampled */
#define FAR 0.028      /* of z^2: |ln J| about 1/3, where its series becomes too short */
#define INLINE static inline __attribute__((always_inline))

typedef double lanes __attribute__((vector_size(8 * LANES)));
typedef lanes stored __attribute__((aligned(8))); /* as numpy's arrays are */
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

/* The numbers in the lanes of a vector in memory. */
INLINE double *item(lanes *vector) { return (double *)vector; }

INLINE double sum(lanes values) {
    double total = 0.0;
    for (int i = 0; i < LANES; i++) total += values[i];
    return total;
}

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

INLINE tensor inverse_transposed(tensor H, lanes e) {
    lanes share = 1.0 / (1.0 + e);
    return (tensor){(1.0 + H.yy) * share, -H.yx * share, -H.xy * share, (1.0 + H.xx) * share};
}

INLINE tensor scaled(lanes factor, tensor T) {
    return (tensor){factor * T.xx, factor * T.xy, factor * T.yx, factor * T.yy};
}

/* -- neo_hookean ----------------------------------------------------------------------------- */

/* One block's state of the volume: F^-T and ln J at the samples, and the pull on each; returns the
   volume's energy and keeps the smallest J. */
INLINE lanes volume(const mesh *m, Py_ssize_t b, int n, const lanes *ue, lanes mu, lanes lmbda,
                    tensor *inverse, lanes *pull, double *smallest) {
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
            pull[s] = w * (lmbda * log_J[s] - mu);
            energy += w * log_J[s] * (0.5 * lmbda * log_J[s] - mu);
        } else
            pull[s] = (lanes){0};
    }
    for (int j = 0; j < m->modes; j++) {
        const stored *psi = m->psi + (b * m->modes + j) * sample->count;
        lanes c = {0}, mean = m->mean[b * m->modes + j];
        for (int s = 0; s < sample->count; s++) c += psi[s] * log_J[s];
        energy += c * (0.5 * lmbda * c - mu * mean);
        for (int s = 0; s < sample->count; s++) pull[s] += psi[s] * (lmbda * c - mu * mean);
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
        lanes ue[2 * MOST_NODES], fe[2 * MOST_NODES] = {{0}}, pull[MOST_POINTS];
        tensor inverse[MOST_POINTS];
        gather(u, m->nodes + b * n * LANES, n, ue);
        total += volume(m, b, n, ue, mu[b], lmbda[b], inverse, pull, smallest);
        for (int q = 0; q < at->count; q++) {
            const double *g = at->reference + 2 * n * q;
            const stored *A = at->inverse + 4 * (b * at->count + q);
            tensor H = displacement_gradient(ue, g, A, n);
            lanes w = mu[b] * m->weight[b * at->count + q];
            /* F:F - 2, without the 2 that would swallow the digits of small strains */
            total += w * (H.xx + H.yy) + 0.5 * w * (H.xx * H.xx + H.xy * H.xy + H.yx * H.yx + H.yy * H.yy);
            tensor P = {w * (1.0 + H.xx), w * H.xy, w * H.yx, w * (1.0 + H.yy)};
            if (!m->modes) {
                tensor T = scaled(pull[q], inverse[q]);
                P = (tensor){P.xx + T.xx, P.xy + T.xy, P.yx + T.yx, P.yy + T.yy};
            }
            add_forces(P, g, A, n, fe);
        }
        for (int s = 0; s < (m->modes ? m->sample.count : 0); s++)
            add_forces(scaled(pull[s], inverse[s]), m->sample.reference + 2 * n * s,
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
   LANES). The curvature of ln J is weighted with the law's own pull, or with a given one (B, S). */
INLINE void elastic_tangent(const mesh *m, int n, const double *u, const stored *mu,
                            const stored *lmbda, const stored *given, const int32_t *places,
                            double *data) {
    const points *sample = m->modes ? &m->sample : &m->at;
    int S = sample->count, rank = m->modes ? m->modes : S;
    for (Py_ssize_t b = 0; b < m->blocks; b++) {
        lanes ue[2 * MOST_NODES], pull[MOST_POINTS];
        double smallest = INFINITY;
        lanes push[MOST_POINTS][2 * MOST_NODES], pulled[MOST_POINTS][2 * MOST_NODES];
        lanes modes[MOST_POINTS][2 * MOST_NODES], stiff[MOST_POINTS][2 * MOST_NODES];
        lanes(*row)[2 * MOST_NODES] = m->modes ? modes : push;
        tensor inverse[MOST_POINTS];
        gather(u, m->nodes + b * n * LANES, n, ue);
        volume(m, b, n, ue, mu[b], lmbda[b], inverse, pull, &smallest);
        for (int s = 0; s < S; s++) {
            memset(push[s], 0, sizeof(lanes) * 2 * n);
            add_forces(inverse[s], sample->reference + 2 * n * s, sample->inverse + 4 * (b * S + s), n,
                       push[s]);
            if (given) pull[s] = given[b * S + s];
            for (int k = 0; k < 2 * n; k++) pulled[s][k] = pull[s] * push[s][k];
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
                    K.xx -= pulled[s][2 * l] * push[s][2 * k];
                    K.xy -= pulled[s][2 * l] * push[s][2 * k + 1];
                    K.yx -= pulled[s][2 * l + 1] * push[s][2 * k];
                    K.yy -= pulled[s][2 * l + 1] * push[s][2 * k + 1];
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

/* Nodal forces pull F^-T : grad v of a given pull (B, S), added to out (N, 2). */
INLINE void volume_forces(const mesh *m, int n, const double *u, const stored *pull, double *out) {
    const points *sample = m->modes ? &m->sample : &m->at;
    for (Py_ssize_t b = 0; b < m->blocks; b++) {
        lanes ue[2 * MOST_NODES], fe[2 * MOST_NODES] = {{0}};
        gather(u, m->nodes + b * n * LANES, n, ue);
        for (int s = 0; s < sample->count; s++) {
            Py_ssize_t point = b * sample->count + s;
            const double *g = sample->reference + 2 * n * s;
            const stored *A = sample->inverse + 4 * point;
            tensor H = displacement_gradient(ue, g, A, n);
            add_forces(scaled(pull[point], inverse_transposed(H, volume_change(H))), g, A, n, fe);
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

/* -- kelvin_voigt ---------------------------------------------------------------------------- */

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

INLINE int any(lanes values) {
    for (int i = 0; i < LANES; i++)
        if (values[i] != 0.0) return 1;
    return 0;
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

/* -- one version for each instruction set ---------------------------------------------------- */

#define SIZED(NAME, ...)                            \
    switch (m->n) {                                 \
    case 4: return NAME(m, 4, __VA_ARGS__);         \
    case 6: return NAME(m, 6, __VA_ARGS__);         \
    default: return NAME(m, 9, __VA_ARGS__);        \
    }

#define VERSION(SUFFIX, ISA)                                                                             \
    ISA static double forces_##SUFFIX(const mesh *m, const double *u, const stored *mu,                  \
                                      const stored *lmbda, double *out, double *smallest) {              \
        SIZED(elastic_forces, u, mu, lmbda, out, smallest)                                               \
    }                                                                                                    \
    ISA static void tangent_##SUFFIX(const mesh *m, const double *u, const stored *mu,                   \
                                     const stored *lmbda, const stored *given, const int32_t *places,    \
                                     double *data) {                                                     \
        SIZED(elastic_tangent, u, mu, lmbda, given, places, data)                                        \
    }                                                                                                    \
    ISA static void log_volumes_##SUFFIX(const mesh *m, const double *u, const double *du, stored *out) {\
        SIZED(log_volumes, u, du, out)                                                                   \
    }                                                                                                    \
    ISA static void volume_forces_##SUFFIX(const mesh *m, const double *u, const stored *pull,           \
                                           double *out) {                                                \
        SIZED(volume_forces, u, pull, out)                                                               \
    }                                                                                                    \
    ISA static double smallest_##SUFFIX(const mesh *m, const double *u) { SIZED(smallest_volume, u) }    \
    ISA static void strains_##SUFFIX(const mesh *m, const double *u, stored *out) {                      \
        SIZED(viscous_strains, u, out)                                                                   \
    }                                                                                                    \
    ISA static double viscous_##SUFFIX(const mesh *m, const double *u, const stored *rate,               \
                                       const stored *strain0, double *out) {                             \
        SIZED(viscous_forces, u, rate, strain0, out)                                                     \
    }                                                                                                    \
    ISA static void viscous_tangent_##SUFFIX(const mesh *m, const double *u, const stored *rate,         \
                                             const stored *strain0, const int32_t *places, double *data) { \
        SIZED(viscous_tangent, u, rate, strain0, places, data)                                           \
    }                                                                                                    \
    static const versions version_##SUFFIX = {                                                           \
        forces_##SUFFIX,   tangent_##SUFFIX, log_volumes_##SUFFIX, volume_forces_##SUFFIX,               \
        smallest_##SUFFIX, strains_##SUFFIX, viscous_##SUFFIX,     viscous_tangent_##SUFFIX};

typedef struct {
    double (*forces)(const mesh *, const double *, const stored *, const stored *, double *, double *);
    void (*tangent)(const mesh *, const double *, const stored *, const stored *, const stored *,
                    const int32_t *, double *);
    void (*log_volumes)(const mesh *, const double *, const double *, stored *);
    void (*volume_forces)(const mesh *, const double *, const stored *, double *);
    double (*smallest)(const mesh *, const double *);
    void (*strains)(const mesh *, const double *, stored *);
    double (*viscous)(const mesh *, const double *, const stored *, const stored *, double *);
    void (*viscous_tangent)(const mesh *, const double *, const stored *, const stored *, const int32_t *,
                            double *);
} versions;

VERSION(plain, )
#if defined(__x86_64__)
VERSION(avx2, __attribute__((target("avx2,fma"))))
VERSION(avx512, __attribute__((target("avx512f,fma"))))
#endif

static const versions *chosen(void) {
#if defined(__x86_64__)
    if (__builtin_cpu_supports("avx512f")) return &version_avx512;
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) return &version_avx2;
#endif
    return &version_plain;
}

/* -- for Python ------------------------------------------------------------------------------ */

#define MOST_VIEWS 14

/* Arrays held while a loop runs. */
typedef struct {
    Py_buffer views[MOST_VIEWS];
    int count;
} held;

static void release(held *all) {
    while (all->count > 0) PyBuffer_Release(&all->views[--all->count]);
}

/* The data of a contiguous array of `length` items of one format; NULL with an error set, also by
   an earlier call. A length of -1 is any. */
static void *hold(held *all, PyObject *array, char format, Py_ssize_t length, int writable) {
    Py_buffer *view = &all->views[all->count];
    int flags = PyBUF_C_CONTIGUOUS | PyBUF_FORMAT | (writable ? PyBUF_WRITABLE : 0);
    if (PyErr_Occurred() || PyObject_GetBuffer(array, view, flags) < 0) return NULL;
    all->count++;
    if (view->format[0] != format || (length >= 0 && view->len != length * view->itemsize)) {
        PyErr_Format(PyExc_ValueError, "an array of %zd items, format %s; expected %zd, format %c",
                     view->itemsize ? view->len / view->itemsize : 0, view->format, length, format);
        return NULL;
    }
    return view->buf;
}

/* Read a tuple `evfem.tissue.kernels.blocks.Cells`; size is N of its sizes (N, B, n, Q, S, M). */
static mesh read_cells(held *all, PyObject *cells, Py_ssize_t *size) {
    mesh m = {0};
    PyObject *nodes, *weight, *at[2], *sample[2], *psi, *mean;
    if (!PyArg_ParseTuple(cells, "(nniiii)OOOOOOOO", size, &m.blocks, &m.n, &m.at.count, &m.sample.count,
                          &m.modes, &nodes, &weight, &at[0], &at[1], &sample[0], &sample[1], &psi, &mean))
        return m;
    Py_ssize_t B = m.blocks, n = m.n, Q = m.at.count, S = m.sample.count, M = m.modes;
    if ((n != 4 && n != 6 && n != 9) || Q > MOST_POINTS || S > MOST_POINTS || M > MOST_POINTS)
        PyErr_SetString(PyExc_ValueError, "cells of a kind that the loops do not know");
    m.nodes = hold(all, nodes, 'i', B * n * LANES, 0);
    m.weight = hold(all, weight, 'd', B * Q * LANES, 0);
    m.at.reference = hold(all, at[0], 'd', 2 * Q * n, 0);
    m.at.inverse = hold(all, at[1], 'd', B * Q * 4 * LANES, 0);
    m.sample.reference = hold(all, sample[0], 'd', 2 * S * n, 0);
    m.sample.inverse = hold(all, sample[1], 'd', B * S * 4 * LANES, 0);
    m.psi = hold(all, psi, 'd', B * M * S * LANES, 0);
    m.mean = hold(all, mean, 'd', B * M * LANES, 0);
    return m;
}

static const versions *version;

typedef struct {
    held all;
    mesh m;
    const double *u;     /* (N, 2) */
    const stored *first; /* mu or rate, (B, LANES) */
    const stored *second; /* lmbda (B, LANES), or strains (B, Q, 3, LANES) */
} request;

/* Read what all loops begin with: cells, u and, where asked for, moduli or strains. */
static Py_ssize_t read_request(request *r, PyObject *cells, PyObject *u, PyObject *first, PyObject *second,
                               Py_ssize_t points) {
    Py_ssize_t size = 0;
    r->all.count = 0;
    r->m = read_cells(&r->all, cells, &size);
    r->u = hold(&r->all, u, 'd', 2 * size, 0);
    if (first) r->first = hold(&r->all, first, 'd', r->m.blocks * LANES, 0);
    if (second)
        r->second = hold(&r->all, second, 'd', r->m.blocks * (points ? 3 * r->m.at.count : 1) * LANES, 0);
    return size;
}

static Py_ssize_t pairs(const mesh *m) { return m->blocks * m->n * (m->n + 1) / 2; }

static PyObject *finish(request *r, PyObject *result) {
    release(&r->all);
    return result;
}

static PyObject *call_forces(PyObject *self, PyObject *args) {
    PyObject *cells, *u, *mu, *lmbda, *out;
    request r;
    if (!PyArg_ParseTuple(args, "OOOOO", &cells, &u, &mu, &lmbda, &out)) return NULL;
    Py_ssize_t size = read_request(&r, cells, u, mu, lmbda, 0);
    double *force = hold(&r.all, out, 'd', 2 * size, 1), energy, smallest;
    if (PyErr_Occurred()) return finish(&r, NULL);
    Py_BEGIN_ALLOW_THREADS
    energy = version->forces(&r.m, r.u, r.first, r.second, force, &smallest);
    Py_END_ALLOW_THREADS
    return finish(&r, Py_BuildValue("dd", energy, smallest));
}

/* An array (B, S, LANES) of what acts or is found where ln J is sampled. */
static void *hold_samples(request *r, PyObject *array, int writable) {
    int samples = r->m.modes ? r->m.sample.count : r->m.at.count;
    return hold(&r->all, array, 'd', r->m.blocks * samples * LANES, writable);
}

static PyObject *call_add_tangent(PyObject *self, PyObject *args) {
    PyObject *cells, *u, *mu, *lmbda, *pull, *places, *data;
    request r;
    if (!PyArg_ParseTuple(args, "OOOOOOO", &cells, &u, &mu, &lmbda, &pull, &places, &data)) return NULL;
    read_request(&r, cells, u, mu, lmbda, 0);
    const stored *given = pull == Py_None ? NULL : hold_samples(&r, pull, 0);
    const int32_t *place = hold(&r.all, places, 'i', pairs(&r.m) * 4 * LANES, 0);
    double *values = hold(&r.all, data, 'd', -1, 1);
    if (PyErr_Occurred()) return finish(&r, NULL);
    Py_BEGIN_ALLOW_THREADS
    version->tangent(&r.m, r.u, r.first, r.second, given, place, values);
    Py_END_ALLOW_THREADS
    return finish(&r, Py_NewRef(Py_None));
}

static PyObject *call_log_volumes(PyObject *self, PyObject *args) {
    PyObject *cells, *u, *du, *out;
    request r;
    if (!PyArg_ParseTuple(args, "OOOO", &cells, &u, &du, &out)) return NULL;
    Py_ssize_t size = read_request(&r, cells, u, NULL, NULL, 0);
    const double *along = du == Py_None ? NULL : hold(&r.all, du, 'd', 2 * size, 0);
    stored *found = hold_samples(&r, out, 1);
    if (PyErr_Occurred()) return finish(&r, NULL);
    Py_BEGIN_ALLOW_THREADS
    version->log_volumes(&r.m, r.u, along, found);
    Py_END_ALLOW_THREADS
    return finish(&r, Py_NewRef(Py_None));
}

static PyObject *call_volume_forces(PyObject *self, PyObject *args) {
    PyObject *cells, *u, *pull, *out;
    request r;
    if (!PyArg_ParseTuple(args, "OOOO", &cells, &u, &pull, &out)) return NULL;
    Py_ssize_t size = read_request(&r, cells, u, NULL, NULL, 0);
    const stored *given = hold_samples(&r, pull, 0);
    double *force = hold(&r.all, out, 'd', 2 * size, 1);
    if (PyErr_Occurred()) return finish(&r, NULL);
    Py_BEGIN_ALLOW_THREADS
    version->volume_forces(&r.m, r.u, given, force);
    Py_END_ALLOW_THREADS
    return finish(&r, Py_NewRef(Py_None));
}

static PyObject *call_smallest_J(PyObject *self, PyObject *args) {
    PyObject *cells, *u;
    request r;
    if (!PyArg_ParseTuple(args, "OO", &cells, &u)) return NULL;
    read_request(&r, cells, u, NULL, NULL, 0);
    if (PyErr_Occurred()) return finish(&r, NULL);
    double smallest;
    Py_BEGIN_ALLOW_THREADS
    smallest = version->smallest(&r.m, r.u);
    Py_END_ALLOW_THREADS
    return finish(&r, PyFloat_FromDouble(smallest));
}

static PyObject *call_strains(PyObject *self, PyObject *args) {
    PyObject *cells, *u, *out;
    request r;
    if (!PyArg_ParseTuple(args, "OOO", &cells, &u, &out)) return NULL;
    read_request(&r, cells, u, NULL, NULL, 0);
    stored *strain = hold(&r.all, out, 'd', r.m.blocks * r.m.at.count * 3 * LANES, 1);
    if (PyErr_Occurred()) return finish(&r, NULL);
    Py_BEGIN_ALLOW_THREADS
    version->strains(&r.m, r.u, strain);
    Py_END_ALLOW_THREADS
    return finish(&r, Py_NewRef(Py_None));
}

static PyObject *call_viscous(PyObject *self, PyObject *args) {
    PyObject *cells, *u, *rate, *strain0, *out;
    request r;
    if (!PyArg_ParseTuple(args, "OOOOO", &cells, &u, &rate, &strain0, &out)) return NULL;
    Py_ssize_t size = read_request(&r, cells, u, rate, strain0, 1);
    double *force = hold(&r.all, out, 'd', 2 * size, 1), dissipation;
    if (PyErr_Occurred()) return finish(&r, NULL);
    Py_BEGIN_ALLOW_THREADS
    dissipation = version->viscous(&r.m, r.u, r.first, r.second, force);
    Py_END_ALLOW_THREADS
    return finish(&r, PyFloat_FromDouble(dissipation));
}

static PyObject *call_add_viscous(PyObject *self, PyObject *args) {
    PyObject *cells, *u, *rate, *strain0, *places, *data;
    request r;
    if (!PyArg_ParseTuple(args, "OOOOOO", &cells, &u, &rate, &strain0, &places, &data)) return NULL;
    read_request(&r, cells, u, rate, strain0, 1);
    const int32_t *place = hold(&r.all, places, 'i', pairs(&r.m) * 4 * LANES, 0);
    double *values = hold(&r.all, data, 'd', -1, 1);
    if (PyErr_Occurred()) return finish(&r, NULL);
    Py_BEGIN_ALLOW_THREADS
    version->viscous_tangent(&r.m, r.u, r.first, r.second, place, values);
    Py_END_ALLOW_THREADS
    return finish(&r, Py_NewRef(Py_None));
}

static PyMethodDef methods[] = {
    {"forces", call_forces, METH_VARARGS,
     "forces(cells, u, mu, lmbda, out): add the nodal forces (N, 2); stored energy and smallest J."},
    {"add_tangent", call_add_tangent, METH_VARARGS,
     "add_tangent(cells, u, mu, lmbda, pull, places, data): add what changes of the tangent; its\n"
     "curvature of ln J is weighted with pull (B, S, LANES), or with the law's own if that is None."},
    {"log_volumes", call_log_volumes, METH_VARARGS,
     "log_volumes(cells, u, du, out): ln J (B, S, LANES), or its change along du if that is not None."},
    {"volume_forces", call_volume_forces, METH_VARARGS,
     "volume_forces(cells, u, pull, out): add the nodal forces (N, 2) of pull (B, S, LANES)."},
    {"smallest_J", call_smallest_J, METH_VARARGS, "smallest_J(cells, u): smallest volume ratio of all samples."},
    {"strains", call_strains, METH_VARARGS, "strains(cells, u, out): Green strains (B, Q, 3, LANES)."},
    {"viscous", call_viscous, METH_VARARGS,
     "viscous(cells, u, rate, strain0, out): add the nodal forces (N, 2); dissipated energy."},
    {"add_viscous", call_add_viscous, METH_VARARGS,
     "add_viscous(cells, u, rate, strain0, places, data): add the tangent of `viscous`."},
    {NULL, NULL, 0, NULL}};

static struct PyModuleDef module = {PyModuleDef_HEAD_INIT, "loops", "Compiled element loops.", -1, methods};

PyMODINIT_FUNC PyInit_loops(void) {
    version = chosen();
    PyObject *made = PyModule_Create(&module);
    if (made && PyModule_AddIntConstant(made, "LANES", LANES) < 0) Py_CLEAR(made);
    return made;
}
