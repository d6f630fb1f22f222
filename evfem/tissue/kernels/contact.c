/* Contact in the plane on a dense compliance: the twin of `LinearContactStep._settled` (evfem.contact.condensed),
   whose equations and names are told there, in `follower`, `signorini` and `solve`. Components of k near nodes are
   (y, x) node by node, later (n, t); K = 2 k. LAPACK and BLAS are those of scipy. */

#define PY_SSIZE_T_CLEAN
#define Py_LIMITED_API 0x030b0000
#include <Python.h>
#include <math.h>
#include <stdint.h>
#include <string.h>
#define MOST_VIEWS 14
#include "arrays.h"

#define TRIES 20 /* solves of the active set: what takes more goes round in a circle */

/* Columns of the table of nodes: `LinearContactStep._table`. */
enum {
    GAP, SLIP, MU, COHESION, GIVE_N, GIVE_T, NY, NX, TY, TX, HELD_Y, HELD_X, RATE_Y, RATE_X, WEAKENING, CLOSING,
    GAIN_N, GAIN_T, LOSS_N, LOSS_T, PRESENT, SUNK, COLUMNS
};
enum { OPEN, STICK, FORWARD, BACKWARD };

typedef void (*lu)(int *, int *, double *, int *, int *, double *, int *, int *);
typedef void (*product)(char *, char *, int *, int *, int *, double *, double *, int *, double *, int *, double *,
                        double *, int *);

typedef struct {
    lu solve;
    product multiply;
    int c, p, k, rough, attracted;
    double tolerance, stable, least_own;
    const double *C, *free, *nodes, *balance, *pivot0, *value0, *floor;
    int32_t *status, *flag;
    double *moved, *whole, *force, *extra;
    int *near, *loaded, *place, *pivots, *wanted;
    double *A, *R, *B, *Y, *M, *G, *x, *held, *start, *pivot, *value, *pressing, *drop, *v, *own;
} step;

#define NODE(s, a) ((s)->nodes + COLUMNS * (Py_ssize_t)(s)->near[a])
#define WIDTH(s) (2 * (s)->k + 1 + (s)->p) /* of the rows of A: compliance, motion without forces, by unknowns */
#define ROW(s, i) ((s)->A + (Py_ssize_t)(i) * WIDTH(s))

static double dot(const double *a, const double *b, int n) {
    double sums[4] = {0}, rest = 0.0;
    int i = 0;
    for (; i + 4 <= n; i += 4)
        for (int j = 0; j < 4; j++) sums[j] += a[i + j] * b[i + j];
    for (; i < n; i++) rest += a[i] * b[i];
    return sums[0] + sums[1] + sums[2] + sums[3] + rest;
}

/* A pair of components along the axes of a node. */
static void turn(const double *node, double *y, double *x) {
    double given = *y;
    *y = node[NY] * given + node[NX] * *x;
    *x = node[TY] * given + node[TX] * *x;
}

/* The near nodes' compliance and free motion, and the unknowns' equations. */
static void gather(step *s) {
    int k = s->k, K = 2 * k, p = s->p;
    for (int i = 0; i < K; i++) s->held[i] = NODE(s, i / 2)[HELD_Y + i % 2];
    for (int i = 0; i < K; i++) {
        Py_ssize_t row = 2 * s->near[i / 2] + 1 - i % 2;
        const double *given = s->C + row * 2 * s->c;
        double *own = ROW(s, i);
        for (int b = 0; b < k; b++) own[2 * b] = given[2 * s->near[b] + 1], own[2 * b + 1] = given[2 * s->near[b]];
        memcpy(own + K, s->free + row * (1 + p), (1 + p) * sizeof(double));
        own[K] += dot(own, s->held, K);
    }
    for (int q = 0; q < p; q++)
        for (int i = 0; i < K; i++)
            s->R[q * K + i] = s->balance[(Py_ssize_t)q * 2 * s->c + 2 * s->near[i / 2] + 1 - i % 2];
    memcpy(s->pivot, s->pivot0, p * p * sizeof(double));
    memcpy(s->value, s->value0, p * sizeof(double));
}

/* (1 - C T)^-1 applied to all that moves, and what T adds to the unknowns' equations; whether that worked. */
static int follow(step *s) {
    int k = s->k, K = 2 * k, N = WIDTH(s), p = s->p, l = 0, failed = 0;
    for (int a = 0; a < k; a++)
        if (NODE(s, a)[RATE_Y] != 0.0 || NODE(s, a)[RATE_X] != 0.0) s->loaded[l++] = a;
    for (int a = 0; a < l; a++) {
        const double *rate = NODE(s, s->loaded[a]) + RATE_Y;
        for (int i = 0; i < K; i++) {
            const double *at = ROW(s, i) + 2 * s->loaded[a];
            s->B[i * l + a] = at[0] * rate[0] + at[1] * rate[1];
        }
    }
    for (int a = 0; a < l; a++)
        for (int b = 0; b < l; b++) s->M[b * l + a] = (a == b) - s->B[(2 * s->loaded[a] + 1) * l + b];
    for (int j = 0; j < N; j++)
        for (int a = 0; a < l; a++) s->Y[(Py_ssize_t)j * l + a] = ROW(s, 2 * s->loaded[a] + 1)[j];
    if (l) {
        double one = 1.0;
        s->solve(&l, &N, s->M, &l, s->pivots, s->Y, &l, &failed);
        if (failed) return 0;
        s->multiply("T", "N", &N, &K, &l, &one, s->Y, &l, s->B, &l, &one, s->A, &N);
    }
    for (int i = 0; i < K; i++) ROW(s, i)[K] -= dot(ROW(s, i), s->held, K);
    for (int q = 0; q < p; q++) {
        double *row = s->R + q * K, *through = s->M;
        for (int a = 0; a < l; a++) {
            const double *rate = NODE(s, s->loaded[a]) + RATE_Y, *at = row + 2 * s->loaded[a];
            through[a] = at[0] * rate[0] + at[1] * rate[1];
        }
        for (int a = 0; a < l; a++) {
            const double *moved = ROW(s, 2 * s->loaded[a] + 1);
            for (int i = 0; i < K; i++) row[i] += through[a] * moved[i];
            for (int r = 0; r < p; r++) s->pivot[q * p + r] += through[a] * moved[K + 1 + r];
            s->value[q] -= through[a] * moved[K];
        }
        if (fabs(s->pivot[q * p + q]) < s->floor[q]) s->pivot[q * p + q] = s->floor[q];
    }
    return 1;
}

/* Everything in the nodes' frames; whether the attraction does not return to itself. */
static int frames(step *s) {
    int k = s->k, K = 2 * k, N = WIDTH(s), weakens = 0;
    double mean[2] = {0}, most = 0.0;
    for (int a = 0; a < k; a++) {
        double *y = ROW(s, 2 * a), *x = y + N;
        for (int j = 0; j < N; j++) turn(NODE(s, a), y + j, x + j);
        s->start[2 * a] = y[K] + NODE(s, a)[GAP], s->start[2 * a + 1] = x[K] + NODE(s, a)[SLIP];
    }
    for (int i = 0; i < K + s->p; i++) {
        double *row = i < K ? ROW(s, i) : s->R + (i - K) * K;
        for (int b = 0; b < k; b++) turn(NODE(s, b), row + 2 * b, row + 2 * b + 1);
    }
    for (int i = 0; i < K; i++) {
        s->own[i] = fabs(ROW(s, i)[i] + NODE(s, i / 2)[GIVE_N + i % 2]);
        mean[i % 2] += s->own[i] / k;
    }
    for (int i = 0; i < K; i++) s->own[i] = fmax(s->own[i], fmax(s->least_own * mean[i % 2], 1e-300));
    for (int a = 0; a < k; a++) {
        double root = sqrt(NODE(s, a)[WEAKENING]), sum = 0.0;
        for (int b = 0; b < k && root > 0.0; b++)
            sum += fabs(root * ROW(s, 2 * a)[2 * b] * sqrt(NODE(s, b)[WEAKENING]));
        most = fmax(most, sum), weakens |= root > 0.0;
    }
    s->attracted = weakens || s->rough;
    return most < s->stable;
}

/* Forces of nodes that have their statuses; whether there are any. */
static int solve_statuses(step *s) {
    int k = s->k, K = 2 * k, p = s->p, closed = 0, u = 0, one = 1, failed = 0, steady = 0;
    double *felt = s->v, *both = s->Y;
    for (int a = 0; a < k; a++) {
        const double *node = NODE(s, a);
        int status = s->status[s->near[a]], opened = status == OPEN;
        double along = (status == BACKWARD) - (status == FORWARD), gain[2] = {0};
        for (int r = 0; r < 2; r++) {
            gain[r] = s->rough ? node[GAIN_N + r] : 0.0;
            s->drop[2 * a + r] = s->rough ? (opened ? node[LOSS_N + r] : gain[r] * node[PRESENT]) : 0.0;
        }
        if (s->attracted && !opened) s->drop[2 * a] -= node[CLOSING];
        s->pressing[2 * a] = 0.0, s->pressing[2 * a + 1] = node[COHESION] * along;
        felt[2 * a] = 1.0 - gain[0], felt[2 * a + 1] = node[MU] * along - gain[1];
        if (!opened) s->place[u++] = 2 * a;
    }
    closed = u;
    for (int a = 0; a < k; a++)
        if (s->status[s->near[a]] == STICK) s->place[u++] = 2 * a + 1;
    int held = u;
    for (int a = 0; a < k; a++)
        if (s->status[s->near[a]] == OPEN && NODE(s, a)[WEAKENING] > 0.0) s->place[u++] = 2 * a;
    for (int i = 0; i < K; i++) both[i] = s->drop[i] + s->pressing[i], steady |= both[i] != 0.0;
    int t = u + p;
    for (int i = 0; i < t; i++) { /* rows: gaps and slips of unknowns, then the extra equations */
        const double *row = i < u ? ROW(s, s->place[i]) : s->R + (i - u) * K, *node = NODE(s, i < u ? s->place[i] / 2 : 0);
        for (int j = 0; j < u; j++) {
            int at = s->place[j];
            s->G[(Py_ssize_t)j * t + i] = j < closed ? row[at] * felt[at] + row[at + 1] * felt[at + 1] : row[at];
        }
        for (int q = 0; q < p; q++) s->G[(Py_ssize_t)(u + q) * t + i] = i < u ? row[K + 1 + q] : s->pivot[(i - u) * p + q];
        s->x[i] = (i < u ? -s->start[s->place[i]] : s->value[i - u]) - (steady ? dot(row, both, K) : 0.0);
        if (i < held) s->G[(Py_ssize_t)i * t + i] += node[GIVE_N + s->place[i] % 2];
        else if (i < u) s->G[(Py_ssize_t)i * t + i] -= 1.0 / node[WEAKENING], s->x[i] += node[GAP];
    }
    if (t) s->solve(&t, &one, s->G, &t, s->pivots, s->x, &t, &failed);
    if (failed) return 0;
    for (int i = 0; i < u; i++) {
        int at = s->place[i];
        if (i >= held) s->drop[at] += s->x[i];
        else if (i >= closed) s->pressing[at] += s->x[i];
        else {
            const double *node = NODE(s, at / 2);
            for (int r = 0; r < 2; r++) { /* felt is the force less its gain */
                double gain = s->rough ? node[GAIN_N + r] : 0.0;
                s->pressing[at + r] += (felt[at + r] + gain) * s->x[i];
                s->drop[at + r] -= gain * s->x[i];
            }
        }
    }
    for (int q = 0; q < p; q++) s->extra[q] = s->x[u + q];
    for (int i = 0; i < K; i++) both[i] = s->pressing[i] + s->drop[i];
    for (int i = 0; i < K; i++) {
        const double *row = ROW(s, i);
        s->v[i] = s->start[i] + dot(row, both, K) + NODE(s, i / 2)[GIVE_N + i % 2] * s->pressing[i];
        for (int q = 0; q < p; q++) s->v[i] += row[K + 1 + q] * s->extra[q];
    }
    return 1;
}

/* What the laws make of the forces: whether the statuses hold; else what they are to be, -1 if not finite. */
static int project(step *s) {
    int k = s->k, found = 1;
    double scale = 1e-300, *wrong = s->x;
    for (int a = 0; a < k; a++) {
        const double *node = NODE(s, a), *force = s->pressing + 2 * a, *v = s->v + 2 * a, *own = s->own + 2 * a;
        double p = force[0] - v[0] / own[0], z = force[1] - v[1] / own[1], size = fabs(z);
        double limit = p > 0.0 ? node[MU] * p + node[COHESION] : 0.0;
        int before = s->status[s->near[a]], slip = z < 0.0 ? FORWARD : BACKWARD, status = OPEN;
        if (p > 0.0) status = size <= limit && (node[MU] > 0.0 || node[COHESION] > 0.0) ? STICK : slip;
        double normal = fmax(p, 0.0), part = status == STICK ? 1.0 : limit / fmax(size, fmax(limit, 1e-300));
        double shear = status == OPEN ? 0.0 : z * part;
        scale = fmax(scale, fmax(fmax(normal, fabs(shear)), fmax(fabs(force[0]), fabs(force[1]))));
        scale = fmax(scale, fmax(fmax(fabs(s->drop[2 * a]), fabs(s->drop[2 * a + 1])), fabs(1e-3 * v[0] / own[0])));
        wrong[a] = fmax(fabs(normal - force[0]), fabs(shear - force[1]));
        if (!isfinite(p) || !isfinite(z)) return -1;
        if (before == OPEN && status == STICK && z != 0.0) status = slip; /* through slip, or stick */
        else if (before >= FORWARD && status >= FORWARD && before != status) status = STICK;
        s->wanted[a] = status;
    }
    for (int a = 0; a < k; a++)
        if (s->wanted[a] != s->status[s->near[a]] && wrong[a] / scale > s->tolerance) found = 0;
    for (int a = 0; a < k && !found; a++) s->status[s->near[a]] = s->wanted[a];
    return found;
}

/* Forces on the body and where they move the candidates; how many of these sink in, which are near from now on. */
static int move(step *s) {
    int k = s->k, p = s->p, sunk = 0;
    memset(s->whole, 0, 2 * s->c * sizeof(double));
    memset(s->force, 0, 2 * s->c * sizeof(double));
    for (int a = 0; a < k; a++) {
        const double *node = NODE(s, a), *force = s->pressing + 2 * a, *drop = s->drop + 2 * a, *v = s->v + 2 * a;
        double *pushed = s->whole + 2 * s->near[a], normal = force[0] + drop[0], shear = force[1] + drop[1];
        double up = v[0] - node[GAP] - node[GIVE_N] * force[0], aside = v[1] - node[SLIP] - node[GIVE_T] * force[1];
        double x = node[NX] * up + node[TX] * aside;
        pushed[1] = node[NY] * normal + node[TY] * shear + node[RATE_Y] * x;
        pushed[0] = node[NX] * normal + node[TX] * shear + node[RATE_X] * x;
        memcpy(s->force + 2 * s->near[a], force, 2 * sizeof(double));
    }
    for (Py_ssize_t i = 0; i < 2 * s->c; i++) {
        s->moved[i] = s->free[i * (1 + p)] + dot(s->C + i * 2 * s->c, s->whole, 2 * s->c);
        for (int q = 0; q < p; q++) s->moved[i] += s->free[i * (1 + p) + 1 + q] * s->extra[q];
    }
    for (int j = 0; j < s->c; j++) {
        const double *node = s->nodes + COLUMNS * (Py_ssize_t)j;
        double gap = node[GAP] + node[NY] * s->moved[2 * j + 1] + node[NX] * s->moved[2 * j];
        if (!s->flag[j] && gap < node[SUNK]) s->flag[j] = 1, sunk++;
    }
    return sunk;
}

/* How many linear systems were solved, -1 where the other twin is to decide. */
static int settle(step *s) {
    for (int solves = 0, sunk = 1; sunk;) {
        s->k = 0;
        for (int j = 0; j < s->c; j++)
            if (s->flag[j]) s->near[s->k++] = j;
        for (int a = 0; a < s->k; a++)
            if (s->status[s->near[a]] != OPEN && !(NODE(s, a)[MU] > 0.0 || NODE(s, a)[COHESION] > 0.0))
                s->status[s->near[a]] = FORWARD;
        gather(s);
        if (!follow(s) || !frames(s)) return -1;
        for (int tries = 0, found = 0; !found; tries++) {
            if (tries == TRIES || !solve_statuses(s)) return -1;
            solves++;
            if ((found = project(s)) < 0) return -1;
        }
        sunk = move(s);
        if (!sunk) return solves;
    }
    return -1;
}

/* -- for Python ------------------------------------------------------------------------------ */

/* Room for the numbers of a step with all candidates near; NULL with an error set. */
static double *room(step *s) {
    Py_ssize_t c = s->c, p = s->p, K = 2 * c, N = K + 1 + p;
    Py_ssize_t sizes[] = {K * N, p * K, K * c, N * c + K, c * c, (K + p) * (K + p), K + p, p * p, p, K, K, K, K, K, K};
    double **parts[] = {&s->A, &s->R, &s->B, &s->Y, &s->M, &s->G, &s->x, &s->pivot, &s->value,
                        &s->held, &s->start, &s->pressing, &s->drop, &s->v, &s->own};
    int **whole[] = {&s->near, &s->loaded, &s->wanted, &s->place, &s->pivots};
    Py_ssize_t numbers = 0;
    for (int i = 0; i < 15; i++) numbers += sizes[i];
    double *all = PyMem_Malloc(numbers * sizeof(double) + (3 * c + K + K + p) * sizeof(int)), *next = all;
    if (!all) return (double *)PyErr_NoMemory();
    for (int i = 0; i < 15; next += sizes[i++]) *parts[i] = next;
    int *then = (int *)next;
    for (int i = 0; i < 5; then += i < 3 ? c : K, i++) *whole[i] = then;
    return all;
}

static PyObject *call_settle(PyObject *self, PyObject *args) {
    held all;
    step s = {0};
    PyObject *lapack, *blas, *given[13];
    all.count = 0;
    if (!PyArg_ParseTuple(args, "OOiiiddd(OOOOOOO)(OOOOOO)", &lapack, &blas, &s.c, &s.p, &s.rough, &s.tolerance,
                          &s.stable, &s.least_own, &given[0], &given[1], &given[2], &given[3], &given[4], &given[5],
                          &given[6], &given[7], &given[8], &given[9], &given[10], &given[11], &given[12]))
        return NULL;
    Py_ssize_t c = s.c, p = s.p, K = 2 * c, sizes[] = {K * K, K * (1 + p), COLUMNS * c, p * K, p * p, p, p, c, c, K, K, K, p};
    if (c < 1 || c > INT16_MAX || p < 0 || p > INT16_MAX) return PyErr_Format(PyExc_ValueError, "%zd candidates", c);
    s.solve = (lu)PyCapsule_GetPointer(lapack, PyCapsule_GetName(lapack));
    if (s.solve) s.multiply = (product)PyCapsule_GetPointer(blas, PyCapsule_GetName(blas));
    void *data[13];
    for (int i = 0; i < 13; i++) data[i] = hold(&all, given[i], i == 7 || i == 8 ? 'i' : 'd', sizes[i], i > 6);
    double *own = PyErr_Occurred() ? NULL : room(&s);
    if (own) {
        s.C = data[0], s.free = data[1], s.nodes = data[2], s.balance = data[3], s.pivot0 = data[4];
        s.value0 = data[5], s.floor = data[6], s.status = data[7], s.flag = data[8], s.moved = data[9];
        s.whole = data[10], s.force = data[11], s.extra = data[12];
        int solves;
        Py_BEGIN_ALLOW_THREADS
        solves = settle(&s);
        Py_END_ALLOW_THREADS
        PyMem_Free(own);
        release(&all);
        return PyLong_FromLong(solves);
    }
    release(&all);
    return NULL;
}

static PyMethodDef methods[] = {
    {"settle", call_settle, METH_VARARGS,
     "settle(dgesv, dgemm, c, p, rough, tolerance, stable, least_own, (compliance, free, nodes, balance, pivot,\n"
     "value, floor), (status, near, moved, whole, force, extra)): contact among c candidates with p more unknowns;\n"
     "how many systems were solved, -1 where that is not found so."},
    {NULL, NULL, 0, NULL}};

static struct PyModuleDef module = {PyModuleDef_HEAD_INIT, "contact", "Compiled contact in the plane.", -1, methods};

PyMODINIT_FUNC PyInit_contact(void) { return PyModule_Create(&module); }
