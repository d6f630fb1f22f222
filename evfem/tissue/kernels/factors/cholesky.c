/* Sparse Cholesky factors of the interior of a symmetric matrix, and its Schur complement on the unknowns that are
   kept, by the multifrontal method (Liu 1992, doi:10.1137/1034004; Davis 2006, doi:10.1137/1.9780898718881).

       K = [A, B^T; B, D],   A = L L^T,   S = D - B A^-1 B^T

   Columns of L with the same rows below them form a supernode, a dense panel of `width` columns: its own
   triangle, then `below` rows. In postorder of the elimination tree each takes its entries of K and the update
   matrices of its children, is factorised by LAPACK and BLAS, and leaves its own update matrix, on a stack; those
   of roots are added to S. A place is the number of an unknown in the order of elimination, the kept ones last. */

#define PY_SSIZE_T_CLEAN
#define Py_LIMITED_API 0x030b0000
#include <Python.h>
#include <limits.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include "../arrays.h"
#include "dissection.h"

#define PLAN "evfem plan of a factorisation"

typedef struct {
    int first, width, below, children, *rows; /* the places below its own */
    int64_t entries, at;                      /* without the zeros of mergers; where its panel begins */
} supernode;

typedef struct {
    unsigned long long addresses[5]; /* of potrf, trsm, syrk, gemv, trsv */
    int single, size, inner, count, *order, *place, *local; /* `inner` unknowns are eliminated, in `count` supernodes */
    int64_t entries, *begin, *source;               /* of each column the rows below, and their entries' values */
    int *row, *waiting;
    supernode *nodes;
    void *panels, *stack, *update, *vector, *line;
} plan;

static int ascending(const void *a, const void *b) { return *(const int *)a - *(const int *)b; }

/* Of each entry of the matrix its lower place in the list of the higher one, or the other way round, with its number
   as `source`. */
static void lists(plan *p, const int *indptr, const int *indices, int by_higher) {
    memset(p->begin, 0, (p->size + 2) * sizeof *p->begin);
    for (int fill = 0; fill < 2; fill++) {
        for (int i = 0; i < p->size; i++)
            for (int e = indptr[i]; e < indptr[i + 1]; e++) {
                int a = p->place[i], b = p->place[indices[e]], low = a < b ? a : b, high = a < b ? b : a;
                int64_t *at = p->begin + (by_higher ? high : low);
                if (!fill)
                    at[2]++;
                else
                    p->source[at[1]] = e, p->row[at[1]++] = by_higher ? low : high;
            }
        if (!fill) for (int i = 0; i < p->size; i++) p->begin[i + 2] += p->begin[i + 1];
    }
}

static void placed(plan *p) {
    for (int i = 0; i < p->size; i++) p->place[p->order[i]] = i;
}

/* Put the interior in postorder of its elimination tree; `work` has room for 5 numbers an unknown. */
static void postorder(plan *p, const int *indptr, const int *indices, int *work) {
    int n = p->inner, *parent = work, *past = parent + n, *head = past + n, *next = head + n, *todo = next + n;
    int roots = -1, count = 0, depth = 0;
    placed(p);
    lists(p, indptr, indices, 1);
    for (int j = 0; j < n; j++) {
        parent[j] = past[j] = head[j] = -1;
        for (int64_t e = p->begin[j]; e < p->begin[j + 1]; e++)
            for (int k = p->row[e], up; k != -1 && k < j; k = up) { /* past: a root of k's tree, so far */
                up = past[k], past[k] = j;
                if (up == -1) parent[k] = j;
            }
    }
    for (int j = n - 1; j >= 0; j--) {
        int *children = parent[j] < 0 ? &roots : head + parent[j];
        next[j] = *children, *children = j;
    }
    for (int root = roots; root != -1; root = next[root])
        for (todo[depth++] = root; depth;) {
            int j = todo[depth - 1], child = head[j];
            if (child != -1)
                head[j] = next[child], todo[depth++] = child;
            else
                past[count++] = p->order[j], depth--;
        }
    memcpy(p->order, past, n * sizeof(int));
    placed(p);
    lists(p, indptr, indices, 0);
}

/* The rows of column j, from its entries and from the supernodes of its children; returns how many. */
static int rows_of(const plan *p, int j, const int *head, const int *next, int *mark, int *rows) {
    int count = 0;
    mark[j] = j;
#define MEET(place) if (mark[place] != j) mark[place] = j, rows[count++] = place
    for (int64_t e = p->begin[j]; e < p->begin[j + 1]; e++) MEET(p->row[e]);
    for (int c = head[j]; c != -1; c = next[c])
        for (int i = 0; i < p->nodes[c].below; i++) MEET(p->nodes[c].rows[i]);
    return count;
}

/* Supernodes: columns that follow one another in the tree and have the same rows below. 0 where memory ends. */
static int supernodes(plan *p, int *work) {
    int n = p->inner, *mark = work, *head = mark + p->size, *next = head + n, *rows = next + n;
    for (int i = 0; i < p->size; i++) mark[i] = -1;
    for (int j = 0; j < n; j++) head[j] = -1;
    for (int j = 0; j < n; j++) {
        int below = rows_of(p, j, head, next, mark, rows), last = p->count - 1;
        supernode *s = p->nodes + last;
        if (head[j] == last && last >= 0 && next[last] == -1 && s->below == below + 1) {
            s->width++, s->below--, s->entries += below + 1;
            memmove(s->rows, s->rows + 1, below * sizeof(int));
        } else {
            s = p->nodes + ++last;
            *s = (supernode){j, 1, below, 0, malloc((below + 1) * sizeof(int)), below + 1, 0};
            if (!s->rows) return 0;
            p->count++;
            qsort(rows, below, sizeof(int), ascending);
            memcpy(s->rows, rows, below * sizeof(int));
        }
        if (below && s->rows[0] < n) next[last] = head[s->rows[0]], head[s->rows[0]] = last;
    }
    return 1;
}

/* Whether a supernode may take in its child, for few zeros that are stored then (as in CHOLMOD). */
static int merges(const supernode *child, const supernode *s) {
    if (!child->below || child->rows[0] < s->first || child->rows[0] >= s->first + s->width) return 0;
    double width = child->width + s->width, all = width * (width + s->below) - 0.5 * width * (width - 1.0);
    double zeros = 1.0 - (double)(child->entries + s->entries) / all;
    return width <= 8 || (width <= 16 && zeros < 0.8) || (width <= 48 && zeros < 0.15) || zeros < 0.05;
}

/* Merge supernodes with the child before them; count children, panels, and the room that update matrices need. */
static void merge(plan *p, int *of, int64_t *numbers, int64_t *stack, int64_t *largest) {
    int count = 0;
    int64_t depth = 0;
    for (int s = 0; s < p->count; s++) {
        supernode now = p->nodes[s];
        for (; count && merges(p->nodes + count - 1, &now); count--) {
            supernode *child = p->nodes + count - 1;
            now.first = child->first, now.width += child->width, now.entries += child->entries;
            free(child->rows);
        }
        p->nodes[count++] = now;
    }
    p->count = count;
    *numbers = *stack = *largest = 0;
    for (int s = 0; s < count; s++)
        for (int j = 0; j < p->nodes[s].width; j++) of[p->nodes[s].first + j] = s;
    for (int s = 0, top = 0; s < count; s++) {
        supernode *now = p->nodes + s;
        int64_t update = (int64_t)now->below * now->below;
        now->at = *numbers, *numbers += (int64_t)now->width * (now->width + now->below);
        if (update > *largest) *largest = update;
        for (int c = 0; c < now->children; c++) {
            int64_t below = p->nodes[p->waiting[--top]].below;
            depth -= below * below;
        }
        if (!now->below || now->rows[0] >= p->inner) continue;
        p->nodes[of[now->rows[0]]].children++, p->waiting[top++] = s, depth += update;
        if (depth > *stack) *stack = depth;
    }
}

#define REAL double
#define OF(name) name##_double
#include "multifrontal.h"
#undef REAL
#undef OF
#define REAL float
#define OF(name) name##_single
#include "multifrontal.h"

static void drop(plan *p) {
    for (int s = 0; p->nodes && s < p->count; s++) free(p->nodes[s].rows);
    void *all[] = {p->order, p->place,  p->local, p->begin,  p->source, p->row,  p->waiting,
                   p->nodes, p->panels, p->stack, p->update, p->vector, p->line, p};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) free(all[i]);
}

static void forget_plan(PyObject *capsule) { drop(PyCapsule_GetPointer(capsule, PLAN)); }

/* Everything that does not depend on the values; 0 where memory ends. */
static int analyse(plan *p, const int *indptr, const int *indices, const int *order) {
    size_t n = p->size, numbers = n * sizeof(int), real = p->single ? sizeof(float) : sizeof(double);
    int64_t panels, stack, largest;
    int *work = malloc(5 * numbers), fits = 0;
#define ROOM(of, bytes) (p->of = malloc((bytes) + sizeof(double)))
    if (work && ROOM(order, numbers) && ROOM(place, numbers) && ROOM(local, numbers) && ROOM(waiting, numbers) &&
        ROOM(begin, (n + 2) * sizeof(int64_t)) && ROOM(source, p->entries * sizeof(int64_t)) &&
        ROOM(row, p->entries * sizeof(int)) && ROOM(nodes, n * sizeof(supernode)) &&
        ROOM(vector, n * sizeof(double)) && ROOM(line, n * sizeof(double))) {
        memcpy(p->order, order, numbers);
        postorder(p, indptr, indices, work);
        if (supernodes(p, work)) {
            merge(p, work, &panels, &stack, &largest);
            fits = ROOM(panels, panels * real) && ROOM(stack, stack * real) && ROOM(update, largest * real);
        }
    }
    free(work);
    return fits;
}

/* Whether rows of the upper triangle are sound, and the order is one of all unknowns. */
static int sound(const plan *p, const int *indptr, const int *indices, const int *order, char *seen) {
    if (indptr[0] || indptr[p->size] != p->entries) return 0;
    for (int i = 0; i < p->size; i++) {
        if (indptr[i] > indptr[i + 1] || order[i] < 0 || order[i] >= p->size || seen[order[i]]++) return 0;
        for (int e = indptr[i]; e < indptr[i + 1]; e++) if (indices[e] < i || indices[e] >= p->size) return 0;
    }
    return 1;
}

static PyObject *call_analyse(PyObject *self, PyObject *args) {
    held all;
    PyObject *given[3], *capsule = NULL;
    unsigned long long at[5];
    int n, kept, single, right = 0;
    Py_ssize_t entries;
    all.count = 0;
    if (!PyArg_ParseTuple(args, "iinp(OOO)(KKKKK)", &n, &kept, &entries, &single, &given[0], &given[1], &given[2], &at[0],
                          &at[1], &at[2], &at[3], &at[4]))
        return NULL;
    if (kept < 0 || kept > n || n < 1 || entries < 0)
        return PyErr_Format(PyExc_ValueError, "%d of %d unknowns", kept, n);
    const int *indptr = hold(&all, given[0], 'i', (Py_ssize_t)n + 1, 0);
    const int *indices = hold(&all, given[1], 'i', entries, 0);
    const int *order = hold(&all, given[2], 'i', n, 0);
    plan *p = order ? calloc(1, sizeof *p) : NULL;
    char *seen = order ? calloc(n, 1) : NULL;
    if (p && seen) {
        p->size = n, p->inner = n - kept, p->entries = entries, p->single = single;
        memcpy(p->addresses, at, sizeof at);
        if (!(right = sound(p, indptr, indices, order, seen)))
            PyErr_SetString(PyExc_IndexError, "no upper triangle, or no order of its unknowns");
        else if (analyse(p, indptr, indices, order))
            capsule = PyCapsule_New(p, PLAN, forget_plan);
        else
            PyErr_NoMemory();
    } else if (order)
        PyErr_NoMemory();
    if (p && !capsule) drop(p);
    free(seen);
    release(&all);
    return capsule;
}

static PyObject *call_factorise(PyObject *self, PyObject *args) {
    held all;
    PyObject *capsule, *given[2];
    int done = 0;
    all.count = 0;
    if (!PyArg_ParseTuple(args, "OOO", &capsule, &given[0], &given[1])) return NULL;
    plan *p = PyCapsule_GetPointer(capsule, PLAN);
    if (!p) return NULL;
    Py_ssize_t m = p->size - p->inner;
    const double *values = hold(&all, given[0], 'd', p->entries, 0);
    void *S = hold(&all, given[1], p->single ? 'f' : 'd', m * m, 1);
    if (S) {
        Py_BEGIN_ALLOW_THREADS
        done = p->single ? factorise_single(p, values, S) : factorise_double(p, values, S);
        Py_END_ALLOW_THREADS
    }
    release(&all);
    return PyErr_Occurred() ? NULL : PyBool_FromLong(done);
}

static PyObject *call_solve(PyObject *self, PyObject *args) {
    held all;
    PyObject *capsule, *given;
    int transposed;
    all.count = 0;
    if (!PyArg_ParseTuple(args, "OpO", &capsule, &transposed, &given)) return NULL;
    plan *p = PyCapsule_GetPointer(capsule, PLAN);
    double *x = p ? hold(&all, given, 'd', p->size, 1) : NULL;
    if (x) {
        Py_BEGIN_ALLOW_THREADS
        p->single ? solve_single(p, transposed, x) : solve_double(p, transposed, x);
        Py_END_ALLOW_THREADS
    }
    release(&all);
    if (PyErr_Occurred()) return NULL;
    Py_RETURN_NONE;
}

static PyObject *call_dissect(PyObject *self, PyObject *args) {
    held all;
    PyObject *given, *order;
    int n, directions, done = 0;
    all.count = 0;
    if (!PyArg_ParseTuple(args, "iiOO", &directions, &n, &given, &order)) return NULL;
    const int *cells = hold(&all, given, 'i', -1, 0);
    int *found = hold(&all, order, 'i', -1, 1);
    Py_ssize_t size = found ? all.views[0].len / (Py_ssize_t)sizeof(int) : 0;
    Py_ssize_t count = found ? all.views[1].len / (Py_ssize_t)sizeof(int) : 0;
    int right = found && n > 0 && size % n == 0 && size <= INT_MAX && count > 0 && count <= INT_MAX / 8;
    for (Py_ssize_t i = 0; right && i < size; i++) right = cells[i] >= 0 && cells[i] < count;
    if (right) {
        Py_BEGIN_ALLOW_THREADS
        found[count - 1] = (int)count - 1;
        done = dissect(whole((int)count - 1, cells, (int)(size / n), n), directions, found);
        Py_END_ALLOW_THREADS
        if (!done) PyErr_NoMemory();
    } else if (found)
        PyErr_Format(PyExc_IndexError, "no cells of %d among %zd nodes", n, count);
    release(&all);
    if (!done) return NULL;
    Py_RETURN_NONE;
}

static PyMethodDef methods[] = {
    {"dissect", call_dissect, METH_VARARGS,
     "dissect(directions, n, cells, order): an order of elimination of little fill for the nodes of cells of n nodes each;\n"
     "the last node comes last."},
    {"analyse", call_analyse, METH_VARARGS,
     "analyse(unknowns, kept, entries, single, (indptr, indices, order), addresses of potrf, trsm, syrk, gemv, trsv):\n"
     "a plan for the upper triangle of a matrix (CSR, int32), eliminated in `order`, the kept unknowns last."},
    {"factorise", call_factorise, METH_VARARGS,
     "factorise(plan, values, S): the lower triangle of the Schur complement, by columns; whether the interior\n"
     "is positive definite."},
    {"solve", call_solve, METH_VARARGS, "solve(plan, transposed, x): with L, or its transpose, in place."},
    {NULL, NULL, 0, NULL}};

static struct PyModuleDef module = {PyModuleDef_HEAD_INIT, "cholesky", "Sparse Cholesky factors.", -1, methods};

PyMODINIT_FUNC PyInit_cholesky(void) { return PyModule_Create(&module); }
