/* Contact in the plane on a dense compliance: the twin of `LinearContactStep._settled` (evfem.contact.condensed),
   where, in `signorini` and in `solve`, names and equations are told. All vectors here are along (x, y). The
   dense solver is LAPACK's dgesv, of MKL or scipy. */

#define PY_SSIZE_T_CLEAN
#define Py_LIMITED_API 0x030b0000
#include <Python.h>
#include <math.h>
#include <stdint.h>
#include <string.h>
#include "arrays.h"

#define TRIES 20 /* solves of an active set: what takes more goes round in a circle */

/* The table of nodes, `LinearContactStep._compiled`; N and T begin vectors, the others pairs are (n, t). */
enum { GAP, SLIP, MU, COHESION, GIVE, N = GIVE + 2, T = N + 2, RATE = T + 2, WEAKENING = RATE + 2, CLOSING, GAIN,
       LOSS = GAIN + 2, PRESENT = LOSS + 2, SUNK, COLUMNS };
enum { OPEN, STICK, FORWARD, BACKWARD };

typedef void (*lu)(int *, int *, double *, int *, int *, double *, int *, int *);

/* An unknown of a node: by one of it the node's contact force and drop of attraction (n, t, n, t) and the force on
   the body; and its equation, how far the node has moved along `row` plus `own` times the unknown less `right`. */
typedef struct {
    int node;
    double gives[4], force[2], row[2], own, right;
} unknown;

typedef struct {
    lu solve;
    int c, p, rough, attracted, count;
    double tolerance, stable, least_own;
    const double *C, *free, *nodes, *equations; /* of p unknowns: by forces (2 c), by them (p), right, least pivot */
    int32_t *status, *near;
    double *moved, *pushed, *acts, *extra; /* found; contact forces and drops of attraction act, (c, 4) */
    double *G, *x, *line, *own;
    unknown *unknowns;
    int *pivots;
} step;

#define NODE(s, a) ((s)->nodes + (Py_ssize_t)COLUMNS * (a))
#define EACH_NEAR(s, a) for (int a = 0; a < (s)->c; a++) if ((s)->near[a])

#define RESISTS(node) ((node)[MU] > 0.0 || (node)[COHESION] > 0.0)
#define TURNS(node) ((node)[RATE] != 0.0 || (node)[RATE + 1] != 0.0)

static double dot(const double *a, const double *b, int n) {
    double sums[8] = {0}, total = 0.0;
    for (; n >= 8; n -= 8, a += 8, b += 8)
        for (int i = 0; i < 8; i++) sums[i] += a[i] * b[i];
    for (int i = 0; i < n; i++) total += a[i] * b[i];
    for (int i = 0; i < 8; i++) total += sums[i];
    return total;
}

static double pair(const double *a, const double *b) { return a[0] * b[0] + a[1] * b[1]; }

/* How far forces on all candidates move a node along a vector: its row (2 c,) of the compliance. */
static void row_of(const step *s, int node, const double *along, double *row) {
    const double *x = s->C + (Py_ssize_t)4 * s->c * node, *y = x + 2 * s->c;
    for (int i = 0; i < 2 * s->c; i++) row[i] = along[0] * x[i] + along[1] * y[i];
}

/* By how much, at most, attraction (its stiffness by roots) and forces that turn move a node along a vector, if all
   near nodes move by 1: the larger of these and of what was known. */
static void feedback(step *s, int a, const double *along, double by, const double *root, double *most) {
    double sums[2] = {0};
    row_of(s, a, along, s->line);
    EACH_NEAR(s, b) {
        sums[0] += fabs(pair(s->line + 2 * b, NODE(s, b) + N)) * root[b];
        sums[1] += fabs(pair(s->line + 2 * b, NODE(s, b) + RATE));
    }
    for (int i = 0; i < 2; i++) most[i] = fmax(most[i], by * sums[i]);
}

/* Own compliances of the near nodes; whether the attraction, forces turning, surely does not return to itself. */
static int begin(step *s) {
    double mean[2] = {0}, up[2] = {0}, aside[2] = {0}, *root = s->x;
    int k = 0, weakens = 0;
    EACH_NEAR(s, a) root[a] = sqrt(NODE(s, a)[WEAKENING]);
    EACH_NEAR(s, a) {
        const double *node = NODE(s, a);
        for (int r = 0; r < 2; r++) {
            const double *x = s->C + (Py_ssize_t)4 * s->c * a + 2 * a, *along = node + N + 2 * r;
            double own = along[0] * pair(x, along) + along[1] * pair(x + 2 * s->c, along);
            mean[r] += s->own[2 * a + r] = fabs(own + node[GIVE + r]);
        }
        weakens |= root[a] > 0.0, k++;
        if (s->status[a] != OPEN && !RESISTS(node)) s->status[a] = FORWARD;
    }
    EACH_NEAR(s, a)
        for (int r = 0; r < 2; r++)
            s->own[2 * a + r] = fmax(s->own[2 * a + r], fmax(s->least_own * mean[r] / k, 1e-300));
    EACH_NEAR(s, a) {
        if (root[a] > 0.0) feedback(s, a, NODE(s, a) + N, root[a], root, up);
        if (weakens && TURNS(NODE(s, a))) feedback(s, a, (double[]){1.0, 0.0}, 1.0, root, aside);
    }
    s->attracted = weakens || s->rough;
    return !weakens || (aside[1] < 1.0 && up[0] + up[1] * aside[0] / (1.0 - aside[1]) < s->stable);
}

/* The force along (x, y) of what acts on a node along (n, t, n, t). */
static void force_of(const double *node, const double *acts, double *force) {
    for (int i = 0; i < 2; i++) force[i] = (acts[0] + acts[2]) * node[N + i] + (acts[1] + acts[3]) * node[T + i];
}

/* One more unknown, whose force is given or that of what it gives. */
static void add(step *s, int a, const double *gives, const double *force, const double *row, double own, double right) {
    unknown it = {a, {gives[0], gives[1], gives[2], gives[3]}, {0}, {row[0], row[1]}, own, right};
    force_of(NODE(s, a), gives, it.force);
    if (force) memcpy(it.force, force, sizeof it.force);
    s->unknowns[s->count++] = it;
}

/* The unknowns of nodes with their statuses, and what acts that no unknown changes. */
static void pose(step *s) {
    static const double none[4] = {0}, shear[4] = {0, 1}, drop[4] = {0, 0, 1}, x_axis[2] = {1.0, 0.0};
    s->count = 0;
    memset(s->pushed, 0, 2 * s->c * sizeof(double));
    memset(s->acts, 0, 4 * s->c * sizeof(double));
    EACH_NEAR(s, a) {
        const double *node = NODE(s, a), *n = node + N, *t = node + T;
        int status = s->status[a], opened = status == OPEN;
        double along = (status == BACKWARD) - (status == FORWARD), *acts = s->acts + 4 * a;
        acts[1] = node[COHESION] * along;
        for (int r = 0; r < 2; r++) acts[2 + r] = opened ? node[LOSS + r] : node[GAIN + r] * node[PRESENT];
        if (s->attracted && !opened) acts[2] -= node[CLOSING];
        force_of(node, acts, s->pushed + 2 * a);
        const double presses[] = {1.0, node[MU] * along, -node[GAIN], -node[GAIN + 1]};
        if (!opened) add(s, a, presses, NULL, n, node[GIVE], -node[GAP]);
        else if (node[WEAKENING] > 0.0) add(s, a, drop, NULL, n, -1.0 / node[WEAKENING], 0.0);
        if (status == STICK) add(s, a, shear, NULL, t, node[GIVE + 1], -node[SLIP]);
        if (TURNS(node)) add(s, a, none, node + RATE, x_axis, -1.0, 0.0); /* how far the node goes aside */
    }
}

/* The equation of an unknown, or of one of the p further ones: a row of G, which has its columns together. */
static void equation(step *s, int i) {
    int c = s->c, p = s->p, u = s->count, t = u + p;
    double *row = s->line, *at = row + 2 * c, *G = s->G + i;
    const unknown *it = s->unknowns + i;
    if (i < u) {
        const double *x = s->free + (Py_ssize_t)2 * (1 + p) * it->node, *y = x + 1 + p;
        row_of(s, it->node, it->row, row);
        for (int q = 0; q < p; q++) at[q] = it->row[0] * x[1 + q] + it->row[1] * y[1 + q];
        at[p] = it->right - it->row[0] * x[0] - it->row[1] * y[0];
    } else
        memcpy(row, s->equations + (Py_ssize_t)(2 * c + p + 2) * (i - u), (2 * c + p + 2) * sizeof(double));
    for (int j = 0; j < u; j++) G[(Py_ssize_t)t * j] = pair(row + 2 * s->unknowns[j].node, s->unknowns[j].force);
    for (int q = 0; q < p; q++) G[(Py_ssize_t)t * (u + q)] = at[q];
    s->x[i] = at[p] - dot(row, s->pushed, 2 * c);
    double *own = G + (Py_ssize_t)t * i;
    if (i < u) *own += it->own;
    else if (fabs(*own) < at[p + 1]) *own = at[p + 1];
}

/* Forces of nodes that have their statuses, and where they move the candidates; 0 where there are none. */
static int solve_statuses(step *s) {
    int c = s->c, p = s->p, u = s->count, t = u + p, one = 1, failed = 0;
    for (int i = 0; i < t; i++) equation(s, i);
    if (t) s->solve(&t, &one, s->G, &t, s->pivots, s->x, &t, &failed);
    if (failed) return 0;
    for (int i = 0; i < u; i++) {
        const unknown *it = s->unknowns + i;
        for (int r = 0; r < 4; r++) s->acts[4 * it->node + r] += it->gives[r] * s->x[i];
        for (int r = 0; r < 2; r++) s->pushed[2 * it->node + r] += it->force[r] * s->x[i];
    }
    memcpy(s->extra, s->x + u, p * sizeof(double));
    for (Py_ssize_t i = 0; i < 2 * c; i++) {
        const double *free = s->free + (1 + p) * i;
        s->moved[i] = free[0] + dot(free + 1, s->extra, p) + dot(s->C + 2 * c * i, s->pushed, 2 * c);
    }
    return 1;
}

/* The status that the laws make of a node's forces, gap and slip, and by how much they miss; -1 not finite. */
static int projected(const step *s, int a, double *miss, double *scale) {
    const double *node = NODE(s, a), *force = s->acts + 4 * a, *own = s->own + 2 * a;
    double gap = node[GAP] + pair(node + N, s->moved + 2 * a) + node[GIVE] * force[0];
    double p = force[0] - gap / own[0];
    double z = force[1] - (node[SLIP] + pair(node + T, s->moved + 2 * a) + node[GIVE + 1] * force[1]) / own[1];
    double limit = p > 0.0 ? node[MU] * p + node[COHESION] : 0.0, normal = fmax(p, 0.0), shear = 0.0;
    int before = s->status[a], slip = z < 0.0 ? FORWARD : BACKWARD, status = OPEN;
    if (!isfinite(p) || !isfinite(z)) return -1;
    if (p > 0.0) {
        status = fabs(z) <= limit && RESISTS(node) ? STICK : slip;
        shear = status == STICK ? z : z * limit / fmax(fabs(z), fmax(limit, 1e-300));
    }
    const double sizes[] = {normal, shear, force[0], force[1], force[2], force[3], 1e-3 * gap / own[0]};
    for (int i = 0; i < 7; i++) *scale = fmax(*scale, fabs(sizes[i]));
    *miss = fmax(fabs(normal - force[0]), fabs(shear - force[1]));
    if (before == OPEN && status == STICK && z != 0.0) return slip; /* changes pass through slip, or stick */
    return before >= FORWARD && status >= FORWARD && before != status ? STICK : status;
}

/* Whether the statuses are those that the laws make of the forces, which they become if not; -1: give up. */
static int obeyed(step *s) {
    double scale = 1e-300, *miss = s->x;
    int *wanted = s->pivots, found = 1;
    EACH_NEAR(s, a) if ((wanted[a] = projected(s, a, miss + a, &scale)) < 0) return -1;
    EACH_NEAR(s, a) found &= wanted[a] == s->status[a] || miss[a] <= s->tolerance * scale;
    EACH_NEAR(s, a) if (!found) s->status[a] = wanted[a];
    return found;
}

/* How many linear systems were solved, -1 where the other twin is to decide. */
static int settle(step *s) {
    for (int solves = 0, sunk = 1; sunk;) {
        int found = 0, tries = 0;
        if (!begin(s)) return -1;
        for (; !found; solves++) {
            pose(s);
            if (tries++ == TRIES || !solve_statuses(s) || (found = obeyed(s)) < 0) return -1;
        }
        sunk = 0;
        for (int a = 0; a < s->c; a++) {
            const double *node = NODE(s, a);
            if (s->near[a] || !(node[GAP] + pair(node + N, s->moved + 2 * a) < node[SUNK])) continue;
            s->near[a] = sunk = 1;
        }
        if (!sunk) return solves;
    }
    return -1;
}

static PyObject *call_settle(PyObject *self, PyObject *args) {
    held all;
    step s = {0};
    PyObject *given[6];
    unsigned long long lapack;
    int solves = 0;
    all.count = 0;
    if (!PyArg_ParseTuple(args, "Kiipddd(OOOOOO)", &lapack, &s.c, &s.p, &s.rough, &s.tolerance, &s.stable,
                          &s.least_own, &given[0], &given[1], &given[2], &given[3], &given[4], &given[5]))
        return NULL;
    Py_ssize_t c = s.c, p = s.p, m = 2 * c, t = 3 * c + p, room = (t * t + t + 2 * m + p + 2) * sizeof(double);
    if (c < 1 || c > INT16_MAX || p < 0 || p > INT16_MAX) return PyErr_Format(PyExc_ValueError, "%zd nodes", c);
    s.C = hold(&all, given[0], 'd', m * m, 0);
    s.free = hold(&all, given[1], 'd', m * (1 + p), 0);
    s.nodes = hold(&all, given[2], 'd', COLUMNS * c, 0);
    s.equations = hold(&all, given[3], 'd', p * (m + p + 2), 0);
    s.status = hold(&all, given[4], 'i', 2 * c, 1);
    s.moved = hold(&all, given[5], 'd', 4 * m + p, 1);
    if (s.moved) s.solve = (lu)(uintptr_t)lapack;
    if (s.solve && !(s.G = PyMem_Malloc(room + t * (sizeof(unknown) + sizeof(int))))) PyErr_NoMemory();
    if (s.G) {
        s.near = s.status + c, s.pushed = s.moved + m, s.acts = s.pushed + m, s.extra = s.acts + 2 * m;
        s.x = s.G + t * t, s.line = s.x + t, s.own = s.line + m + p + 2;
        s.unknowns = (unknown *)(s.own + m), s.pivots = (int *)(s.unknowns + t);
        Py_BEGIN_ALLOW_THREADS
        solves = settle(&s);
        Py_END_ALLOW_THREADS
        PyMem_Free(s.G);
    }
    release(&all);
    return PyErr_Occurred() ? NULL : PyLong_FromLong(solves);
}

static PyMethodDef methods[] = {
    {"settle", call_settle, METH_VARARGS,
     "settle(address of dgesv, c, p, rough, tolerance, stable, least_own, (compliance, free, nodes, equations,\n"
     "marks, found)): contact among c candidates with p more unknowns; number of solves, -1 if nothing was found."},
    {NULL, NULL, 0, NULL}};

static struct PyModuleDef module = {PyModuleDef_HEAD_INIT, "contact", "Compiled contact in the plane.", -1, methods};

PyMODINIT_FUNC PyInit_contact(void) { return PyModule_Create(&module); }
