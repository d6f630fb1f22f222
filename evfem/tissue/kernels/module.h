/* The loops for Python, twins of the weak forms `neo_hookean` (`elastic.h`), `kelvin_voigt` (`viscous.h`) and
   `maxwell` (`relaxing.h`), in the plane and in space (DIM): of each a version for every instruction set of
   x86, chosen when the module is loaded; elsewhere for the one there is. */

#define PY_SSIZE_T_CLEAN
#define Py_LIMITED_API 0x030b0000
#define STRAINS (DIM * (DIM + 1) / 2)
#include "relaxing.h"
#include "arrays.h"

/* Each loop's name, the kinds of its arrays after the cells (`hold_kind`; capitals are written to), how many
   numbers it returns, and its help. */
#define LOOPS(X, ...)                                                                                    \
    X(forces, "uccU", 2, "(cells, u, mu, lmbda, out): add the nodal forces; stored energy, smallest J.",  \
      __VA_ARGS__)                                                                                       \
    X(energies, "uuccwW", 0,                                                                             \
      "(cells, u, du, mu, lmbda, places, out): stored energies at u plus the shares `places` of du.",    \
      __VA_ARGS__)                                                                                       \
    X(add_tangent, "uccopD", 0,                                                                          \
      "(cells, u, mu, lmbda, pressure, places, data): add what changes of the tangent; its curvature\n"   \
      "of ln J is weighted with a pressure, or with the law's own if that is None.", __VA_ARGS__)        \
    X(log_volumes, "uvS", 0,                                                                             \
      "(cells, u, du, out): ln J, or its change along du if that is not None.", __VA_ARGS__)             \
    X(volume_forces, "usU", 0, "(cells, u, pressure, out): add the nodal forces of a pressure.",         \
      __VA_ARGS__)                                                                                       \
    X(smallest_J, "u", 1, "(cells, u): smallest volume ratio of all samples.", __VA_ARGS__)              \
    X(strains, "uE", 0, "(cells, u, out): Green strains.", __VA_ARGS__)                                  \
    X(viscous, "uceU", 1, "(cells, u, rate, strain0, out): add the nodal forces; dissipated energy.",    \
      __VA_ARGS__)                                                                                       \
    X(add_viscous, "ucepD", 0, "(cells, u, rate, strain0, places, data): add the tangent of `viscous`.", \
      __VA_ARGS__)                                                                                       \
    X(begin_relaxing, "ubkA", 0,                                                                         \
      "(cells, u, x, kept, before): B and a of steps of x relaxation times, from C_i `kept`.",           \
      __VA_ARGS__)                                                                                       \
    X(relaxing, "ubaU", 0, "(cells, u, modulus, before, out): add the branches' nodal forces.",          \
      __VA_ARGS__)                                                                                       \
    X(add_relaxing, "ubapD", 0,                                                                          \
      "(cells, u, modulus, before, places, data): add the tangent of `relaxing`.", __VA_ARGS__)          \
    X(end_relaxing, "ubauklK", 2,                                                                        \
      "(cells, u, modulus, before, u0, kept, loss, out): C_i at the end; stored energy, what was lost.", \
      __VA_ARGS__)

/* -- one version for each instruction set ---------------------------------------------------- */

#define LOOP(NAME, KINDS, COUNT, HELP, SUFFIX, ISA) \
    ISA static void NAME##_##SUFFIX(request *r) { SIZED(NAME, r) }
#define ENTRY(NAME, KINDS, COUNT, HELP, SUFFIX, ISA) NAME##_##SUFFIX,
#define VERSION(SUFFIX, ISA)      \
    LOOPS(LOOP, SUFFIX, ISA)      \
    static void (*const version_##SUFFIX[])(request *) = {LOOPS(ENTRY, SUFFIX, ISA)};

VERSION(plain, )
#if defined(__x86_64__)
VERSION(avx2, __attribute__((target("avx2,fma"))))
VERSION(avx512, __attribute__((target("avx512f,fma"))))
#endif

static void (*const *version)(request *) = version_plain;

static void choose_version(void) {
#if defined(__x86_64__)
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) version = version_avx2;
    if (__builtin_cpu_supports("avx512f")) version = version_avx512;
#endif
}

/* -- for Python ------------------------------------------------------------------------------ */

/* Read a tuple `evfem.tissue.kernels.blocks.Cells`; size is N of its sizes (N, B, n, Q, S, M). */
static mesh read_cells(held *all, PyObject *cells, Py_ssize_t *size) {
    mesh m = {0};
    PyObject *nodes, *weight, *at[2], *sample[2], *psi, *mean;
    int S = 0;
    if (!PyArg_ParseTuple(cells, "(nniiii)OOOOOOOO", size, &m.blocks, &m.n, &m.at.count, &S, &m.modes,
                          &nodes, &weight, &at[0], &at[1], &sample[0], &sample[1], &psi, &mean))
        return m;
    Py_ssize_t B = m.blocks, n = m.n, Q = m.at.count, M = m.modes;
    int known = DIM == 2 ? n == 4 || n == 6 || n == 9 : (n == 8 || n == 27) && M > 0;
    known = known && *size >= 0 && *size <= INT32_MAX && B >= 0 && B <= INT32_MAX;
    known = known && Q >= 0 && Q <= MOST_POINTS && S >= 0 && S <= MOST_POINTS && M >= 0 && M <= MOST_MODES;
    if (!known || (DIM == 2 && !M != !S))
        PyErr_SetString(PyExc_ValueError, "cells of a kind that the loops do not know");
    m.nodes = numbers_of(nodes, B * n * LANES, *size);
    m.weight = hold(all, weight, 'd', B * Q * LANES, 0);
    m.at.reference = hold(all, at[0], 'd', DIM * Q * n, 0);
    m.at.inverse = hold(all, at[1], 'd', B * Q * DIM * DIM * LANES, 0);
    m.apart = S > 0;
    m.sample = m.at;
    if (m.apart) {
        int whole = DIM == 3 && sample[0] == Py_None; /* means over the cell */
        m.sample.count = whole ? 1 : S;
        m.sample.reference = whole ? NULL : hold(all, sample[0], 'd', DIM * S * n, 0);
        m.sample.inverse = hold(all, sample[1], 'd', B * DIM * (whole ? n : S * DIM) * LANES, 0);
    }
    m.psi = hold(all, psi, 'd', B * M * (M ? m.sample.count : 0) * LANES, 0);
    m.mean = hold(all, mean, 'd', B * M * LANES, 0);
    return m;
}

/* How many numbers an array of a kind has; `size` nodes. */
static Py_ssize_t count_of(const request *r, Py_ssize_t size, char kind) {
    Py_ssize_t cells = r->m.blocks * LANES, points = cells * r->m.at.count;
    switch (kind) {
    case 'u': case 'v': case 'U': return DIM * size;                   /* displacements or forces (N, DIM) */
    case 'c': return cells;                                            /* (B, LANES) */
    case 's': case 'o': case 'S': return cells * r->m.sample.count;    /* where ln J is sampled (B, S, LANES) */
    case 'e': case 'E': return points * STRAINS;                       /* (B, Q, STRAINS, LANES) */
    case 'k': case 'K': return points * r->branches * KEPT;            /* (B, Q, branches, KEPT, LANES) */
    case 'a': case 'A': return points * r->branches * (KEPT + 1);      /* (B, Q, branches, KEPT + 1, LANES) */
    case 'l': return 4 * cells * r->branches;                          /* (B, branches, 4, LANES) */
    case 'W': return r->places;                                        /* (W,) */
    case 'p': return cells * DIM * DIM * r->m.n * (r->m.n + 1) / 2;    /* (B, pairs, DIM DIM, LANES) */
    default: return -1;                                                /* any: b, w, D */
    }
}

/* The data of one array of a kind; v and o may be None, b (B, branches, LANES) says how many branches, and w
   (W,) how many places. */
static void *hold_kind(held *all, request *r, Py_ssize_t size, char kind, PyObject *array) {
    if ((kind == 'v' || kind == 'o') && array == Py_None) return NULL;
    void *found = hold(all, array, 'd', count_of(r, size, kind), kind < 'a');
    if (found && kind == 'w') {
        Py_ssize_t places = all->views[all->count - 1].len / (Py_ssize_t)sizeof(double);
        if (places > INT16_MAX)
            PyErr_SetString(PyExc_ValueError, "too many places");
        else
            r->places = (int)places;
    }
    if (found && kind == 'b') {
        Py_ssize_t each = r->m.blocks * LANES * (Py_ssize_t)sizeof(double), length = all->views[all->count - 1].len;
        if (length < 0 || (each ? length % each || length / each > INT16_MAX : length))
            PyErr_SetString(PyExc_ValueError, "branches of other cells");
        else
            r->branches = each ? (int)(length / each) : 0;
    }
    return found;
}

static PyObject *call(int loop, const char *kinds, int count, PyObject *args) {
    held all;
    request r = {{0}};
    Py_ssize_t size = 0, arrays = (Py_ssize_t)strlen(kinds);
    all.count = 0;
    if (PyTuple_Size(args) != arrays + 1)
        return PyErr_Format(PyExc_TypeError, "%zd arguments; expected %zd", PyTuple_Size(args), arrays + 1);
    r.m = read_cells(&all, PyTuple_GetItem(args, 0), &size);
    for (Py_ssize_t i = 0; i < arrays; i++) {
        int places = kinds[i] == 'p'; /* into the data that follow */
        r.arrays[i + places] = hold_kind(&all, &r, size, kinds[i + places], PyTuple_GetItem(args, i + places + 1));
        if (places && r.arrays[i + 1]) {
            Py_ssize_t end = all.views[all.count - 1].len / (Py_ssize_t)sizeof(double);
            r.arrays[i] = (void *)numbers_of(PyTuple_GetItem(args, i + 1), count_of(&r, size, 'p'), end);
        }
        i += places;
    }
    int wrong = PyErr_Occurred() != NULL;
    if (!wrong) {
        Py_BEGIN_ALLOW_THREADS
        version[loop](&r);
        Py_END_ALLOW_THREADS
    }
    release(&all);
    if (wrong) return NULL;
    if (count == 2) return Py_BuildValue("dd", r.found[0], r.found[1]);
    return count ? PyFloat_FromDouble(r.found[0]) : Py_NewRef(Py_None);
}

#define NUMBER(NAME, ...) number_##NAME,
enum { LOOPS(NUMBER, ) };
#define CALL(NAME, KINDS, COUNT, ...) \
    static PyObject *call_##NAME(PyObject *self, PyObject *args) { return call(number_##NAME, KINDS, COUNT, args); }
LOOPS(CALL, )

#define METHOD(NAME, KINDS, COUNT, HELP, ...) {#NAME, call_##NAME, METH_VARARGS, #NAME HELP},
static PyMethodDef methods[] = {
    {"bounded", call_bounded, METH_VARARGS,
     "bounded(numbers, end): nodes or places, all from 0 to below end, as the other functions take them."},
    LOOPS(METHOD, ){NULL, NULL, 0, NULL}};

static struct PyModuleDef module = {PyModuleDef_HEAD_INIT, MODULE, "Compiled element loops.", -1, methods};

PyMODINIT_FUNC INIT(void) {
    choose_version();
    PyObject *made = PyModule_Create(&module);
    if (made && PyModule_AddIntConstant(made, "LANES", LANES) < 0) Py_CLEAR(made);
    return made;
}
