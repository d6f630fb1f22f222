/* The loops for Python, twins of the weak forms `neo_hookean` (`elastic.h`), `kelvin_voigt` (`viscous.h`) and
   `maxwell` (`relaxing.h`), in the plane and in space (DIM): of each a version for every instruction set of x86, chosen when the module
   is loaded; elsewhere for the one there is. */

#define PY_SSIZE_T_CLEAN
#define Py_LIMITED_API 0x030b0000
#define STRAINS (DIM * (DIM + 1) / 2)
#define STRESSES (DIM == 2 ? 4 : 6)
#include "relaxing.h"
#include "arrays.h"

/* -- one version for each instruction set ---------------------------------------------------- */

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
    ISA static void log_volumes_##SUFFIX(const mesh *m, const double *u, const double *du, stored *out) { \
        SIZED(log_volumes, u, du, out)                                                                   \
    }                                                                                                    \
    ISA static void volume_forces_##SUFFIX(const mesh *m, const double *u, const stored *pressure,       \
                                           double *out) {                                                \
        SIZED(volume_forces, u, pressure, out)                                                           \
    }                                                                                                    \
    ISA static void stresses_##SUFFIX(const mesh *m, const double *u, const stored *mu,                  \
                                      const stored *pressure, stored *out) {                             \
        SIZED(cell_stresses, u, mu, pressure, out)                                                       \
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
                                             const stored *strain0, const int32_t *places,               \
                                             double *data) {                                             \
        SIZED(viscous_tangent, u, rate, strain0, places, data)                                           \
    }                                                                                                    \
    ISA static void begin_##SUFFIX(const mesh *m, const double *u, int branches, const stored *x,        \
                                   const stored *kept, stored *before) {                                 \
        SIZED(relaxing_begin, u, branches, x, kept, before)                                              \
    }                                                                                                    \
    ISA static void relaxing_##SUFFIX(const mesh *m, const double *u, int branches,                      \
                                      const stored *modulus, const stored *before, double *out) {        \
        SIZED(relaxing_forces, u, branches, modulus, before, out)                                        \
    }                                                                                                    \
    ISA static void relaxing_tangent_##SUFFIX(const mesh *m, const double *u, int branches,              \
                                              const stored *modulus, const stored *before,               \
                                              const int32_t *places, double *data) {                     \
        SIZED(relaxing_tangent, u, branches, modulus, before, places, data)                              \
    }                                                                                                    \
    ISA static double end_##SUFFIX(const mesh *m, const double *u, int branches, const stored *modulus,  \
                                   const stored *before, const double *u0, const stored *kept,           \
                                   const stored *loss, stored *out, double *lost) {                      \
        SIZED(relaxing_end, u, branches, modulus, before, u0, kept, loss, out, lost)                     \
    }                                                                                                    \
    static const versions version_##SUFFIX = {                                                           \
        forces_##SUFFIX,   tangent_##SUFFIX, log_volumes_##SUFFIX, volume_forces_##SUFFIX,               \
        stresses_##SUFFIX, smallest_##SUFFIX, strains_##SUFFIX,    viscous_##SUFFIX,                     \
        viscous_tangent_##SUFFIX, begin_##SUFFIX, relaxing_##SUFFIX, relaxing_tangent_##SUFFIX,          \
        end_##SUFFIX};

typedef struct {
    double (*forces)(const mesh *, const double *, const stored *, const stored *, double *, double *);
    void (*tangent)(const mesh *, const double *, const stored *, const stored *, const stored *,
                    const int32_t *, double *);
    void (*log_volumes)(const mesh *, const double *, const double *, stored *);
    void (*volume_forces)(const mesh *, const double *, const stored *, double *);
    void (*stresses)(const mesh *, const double *, const stored *, const stored *, stored *);
    double (*smallest)(const mesh *, const double *);
    void (*strains)(const mesh *, const double *, stored *);
    double (*viscous)(const mesh *, const double *, const stored *, const stored *, double *);
    void (*viscous_tangent)(const mesh *, const double *, const stored *, const stored *, const int32_t *,
                            double *);
    void (*begin)(const mesh *, const double *, int, const stored *, const stored *, stored *);
    void (*relaxing)(const mesh *, const double *, int, const stored *, const stored *, double *);
    void (*relaxing_tangent)(const mesh *, const double *, int, const stored *, const stored *,
                             const int32_t *, double *);
    double (*end)(const mesh *, const double *, int, const stored *, const stored *, const double *,
                  const stored *, const stored *, stored *, double *);
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

static const versions *version;

typedef struct {
    held all;
    mesh m;
    const double *u;     /* (N, DIM) */
    const stored *first; /* mu or rate, (B, LANES) */
    const stored *second; /* lmbda (B, LANES), or strains (B, Q, STRAINS, LANES) */
} request;

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

/* Read what all loops begin with: cells, u and, where asked for, moduli or strains. */
static Py_ssize_t read_request(request *r, PyObject *cells, PyObject *u, PyObject *first, PyObject *second,
                               int strains) {
    Py_ssize_t size = 0;
    r->all.count = 0;
    r->m = read_cells(&r->all, cells, &size);
    r->u = hold(&r->all, u, 'd', DIM * size, 0);
    if (first) r->first = hold(&r->all, first, 'd', r->m.blocks * LANES, 0);
    int items = strains ? STRAINS * r->m.at.count : 1;
    if (second) r->second = hold(&r->all, second, 'd', r->m.blocks * items * LANES, 0);
    return size;
}

static Py_ssize_t pairs(const mesh *m) { return m->blocks * m->n * (m->n + 1) / 2; }

/* The matrix's entries, and where in them those of the pairs go. */
static const int32_t *hold_places(request *r, PyObject *places, PyObject *data, double **values) {
    Py_ssize_t count = pairs(&r->m) * DIM * DIM * LANES;
    *values = hold(&r->all, data, 'd', -1, 1);
    if (!*values) return NULL;
    return numbers_of(places, count, r->all.views[r->all.count - 1].len / (Py_ssize_t)sizeof(double));
}

static PyObject *finish(request *r, PyObject *result) {
    release(&r->all);
    return result;
}

static PyObject *call_forces(PyObject *self, PyObject *args) {
    PyObject *cells, *u, *mu, *lmbda, *out;
    request r;
    if (!PyArg_ParseTuple(args, "OOOOO", &cells, &u, &mu, &lmbda, &out)) return NULL;
    Py_ssize_t size = read_request(&r, cells, u, mu, lmbda, 0);
    double *force = hold(&r.all, out, 'd', DIM * size, 1), energy, smallest;
    if (PyErr_Occurred()) return finish(&r, NULL);
    Py_BEGIN_ALLOW_THREADS
    energy = version->forces(&r.m, r.u, r.first, r.second, force, &smallest);
    Py_END_ALLOW_THREADS
    return finish(&r, Py_BuildValue("dd", energy, smallest));
}

/* An array (B, S, LANES) of what acts or is found where ln J is sampled. */
static void *hold_samples(request *r, PyObject *array, int writable) {
    return hold(&r->all, array, 'd', r->m.blocks * r->m.sample.count * LANES, writable);
}

static PyObject *call_add_tangent(PyObject *self, PyObject *args) {
    PyObject *cells, *u, *mu, *lmbda, *pressure, *places, *data;
    request r;
    if (!PyArg_ParseTuple(args, "OOOOOOO", &cells, &u, &mu, &lmbda, &pressure, &places, &data)) return NULL;
    read_request(&r, cells, u, mu, lmbda, 0);
    const stored *given = pressure == Py_None ? NULL : hold_samples(&r, pressure, 0);
    double *values;
    const int32_t *place = hold_places(&r, places, data, &values);
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
    const double *along = du == Py_None ? NULL : hold(&r.all, du, 'd', DIM * size, 0);
    stored *found = hold_samples(&r, out, 1);
    if (PyErr_Occurred()) return finish(&r, NULL);
    Py_BEGIN_ALLOW_THREADS
    version->log_volumes(&r.m, r.u, along, found);
    Py_END_ALLOW_THREADS
    return finish(&r, Py_NewRef(Py_None));
}

static PyObject *call_volume_forces(PyObject *self, PyObject *args) {
    PyObject *cells, *u, *pressure, *out;
    request r;
    if (!PyArg_ParseTuple(args, "OOOO", &cells, &u, &pressure, &out)) return NULL;
    Py_ssize_t size = read_request(&r, cells, u, NULL, NULL, 0);
    const stored *given = hold_samples(&r, pressure, 0);
    double *force = hold(&r.all, out, 'd', DIM * size, 1);
    if (PyErr_Occurred()) return finish(&r, NULL);
    Py_BEGIN_ALLOW_THREADS
    version->volume_forces(&r.m, r.u, given, force);
    Py_END_ALLOW_THREADS
    return finish(&r, Py_NewRef(Py_None));
}

static PyObject *call_stresses(PyObject *self, PyObject *args) {
    PyObject *cells, *u, *mu, *pressure, *out;
    request r;
    if (!PyArg_ParseTuple(args, "OOOOO", &cells, &u, &mu, &pressure, &out)) return NULL;
    read_request(&r, cells, u, mu, NULL, 0);
    const stored *given = hold(&r.all, pressure, 'd', r.m.blocks * r.m.at.count * LANES, 0);
    stored *found = hold(&r.all, out, 'd', r.m.blocks * (STRESSES + 1) * LANES, 1);
    if (PyErr_Occurred()) return finish(&r, NULL);
    Py_BEGIN_ALLOW_THREADS
    version->stresses(&r.m, r.u, r.first, given, found);
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
    stored *strain = hold(&r.all, out, 'd', r.m.blocks * r.m.at.count * STRAINS * LANES, 1);
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
    double *force = hold(&r.all, out, 'd', DIM * size, 1), dissipation;
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
    double *values;
    const int32_t *place = hold_places(&r, places, data, &values);
    if (PyErr_Occurred()) return finish(&r, NULL);
    Py_BEGIN_ALLOW_THREADS
    version->viscous_tangent(&r.m, r.u, r.first, r.second, place, values);
    Py_END_ALLOW_THREADS
    return finish(&r, Py_NewRef(Py_None));
}

/* Numbers of each branch (B, branches, LANES), and how many branches there are. */
static const stored *hold_branches(request *r, PyObject *array, int *branches) {
    const stored *found = hold(&r->all, array, 'd', -1, 0);
    if (!found) return NULL;
    Py_ssize_t each = r->m.blocks * LANES * (Py_ssize_t)sizeof(double);
    Py_ssize_t length = r->all.views[r->all.count - 1].len;
    if (length < 0 || (each ? length % each || length / each > INT16_MAX : length))
        PyErr_SetString(PyExc_ValueError, "branches of other cells");
    *branches = PyErr_Occurred() || !each ? 0 : (int)(length / each);
    return found;
}

/* `items` of each branch at each point (B, Q, branches, items, LANES). */
static stored *hold_points(request *r, PyObject *array, int branches, int items, int writable) {
    return hold(&r->all, array, 'd', r->m.blocks * r->m.at.count * branches * items * LANES, writable);
}

static PyObject *call_begin_relaxing(PyObject *self, PyObject *args) {
    PyObject *cells, *u, *x, *kept, *before;
    request r;
    int branches = 0;
    if (!PyArg_ParseTuple(args, "OOOOO", &cells, &u, &x, &kept, &before)) return NULL;
    read_request(&r, cells, u, NULL, NULL, 0);
    const stored *steps = hold_branches(&r, x, &branches);
    const stored *given = hold_points(&r, kept, branches, KEPT, 0);
    stored *found = hold_points(&r, before, branches, KEPT + 1, 1);
    if (PyErr_Occurred()) return finish(&r, NULL);
    Py_BEGIN_ALLOW_THREADS
    version->begin(&r.m, r.u, branches, steps, given, found);
    Py_END_ALLOW_THREADS
    return finish(&r, Py_NewRef(Py_None));
}

static PyObject *call_relaxing(PyObject *self, PyObject *args) {
    PyObject *cells, *u, *modulus, *before, *out;
    request r;
    int branches = 0;
    if (!PyArg_ParseTuple(args, "OOOOO", &cells, &u, &modulus, &before, &out)) return NULL;
    Py_ssize_t size = read_request(&r, cells, u, NULL, NULL, 0);
    const stored *moduli = hold_branches(&r, modulus, &branches);
    const stored *begun = hold_points(&r, before, branches, KEPT + 1, 0);
    double *force = hold(&r.all, out, 'd', DIM * size, 1);
    if (PyErr_Occurred()) return finish(&r, NULL);
    Py_BEGIN_ALLOW_THREADS
    version->relaxing(&r.m, r.u, branches, moduli, begun, force);
    Py_END_ALLOW_THREADS
    return finish(&r, Py_NewRef(Py_None));
}

static PyObject *call_add_relaxing(PyObject *self, PyObject *args) {
    PyObject *cells, *u, *modulus, *before, *places, *data;
    request r;
    int branches = 0;
    if (!PyArg_ParseTuple(args, "OOOOOO", &cells, &u, &modulus, &before, &places, &data)) return NULL;
    read_request(&r, cells, u, NULL, NULL, 0);
    const stored *moduli = hold_branches(&r, modulus, &branches);
    const stored *begun = hold_points(&r, before, branches, KEPT + 1, 0);
    double *values;
    const int32_t *place = hold_places(&r, places, data, &values);
    if (PyErr_Occurred()) return finish(&r, NULL);
    Py_BEGIN_ALLOW_THREADS
    version->relaxing_tangent(&r.m, r.u, branches, moduli, begun, place, values);
    Py_END_ALLOW_THREADS
    return finish(&r, Py_NewRef(Py_None));
}

static PyObject *call_end_relaxing(PyObject *self, PyObject *args) {
    PyObject *cells, *u, *modulus, *before, *u0, *kept, *loss, *out;
    request r;
    int branches = 0;
    if (!PyArg_ParseTuple(args, "OOOOOOOO", &cells, &u, &modulus, &before, &u0, &kept, &loss, &out))
        return NULL;
    Py_ssize_t size = read_request(&r, cells, u, NULL, NULL, 0);
    const stored *moduli = hold_branches(&r, modulus, &branches);
    const stored *begun = hold_points(&r, before, branches, KEPT + 1, 0);
    const double *first = hold(&r.all, u0, 'd', DIM * size, 0);
    const stored *given = hold_points(&r, kept, branches, KEPT, 0);
    const stored *numbers = hold(&r.all, loss, 'd', 4 * r.m.blocks * branches * LANES, 0);
    stored *found = hold_points(&r, out, branches, KEPT, 1);
    if (PyErr_Occurred()) return finish(&r, NULL);
    double stored_energy, lost;
    Py_BEGIN_ALLOW_THREADS
    stored_energy = version->end(&r.m, r.u, branches, moduli, begun, first, given, numbers, found, &lost);
    Py_END_ALLOW_THREADS
    return finish(&r, Py_BuildValue("dd", stored_energy, lost));
}

static PyMethodDef methods[] = {
    {"bounded", call_bounded, METH_VARARGS,
     "bounded(numbers, end): nodes or places, all from 0 to below end, as the other functions take them."},
    {"forces", call_forces, METH_VARARGS,
     "forces(cells, u, mu, lmbda, out): add the nodal forces (N, DIM); stored energy and smallest J."},
    {"add_tangent", call_add_tangent, METH_VARARGS,
     "add_tangent(cells, u, mu, lmbda, pressure, places, data): add what changes of the tangent; its\n"
     "curvature of ln J is weighted with pressure (B, S, LANES), or with the law's own if that is None."},
    {"log_volumes", call_log_volumes, METH_VARARGS,
     "log_volumes(cells, u, du, out): ln J (B, S, LANES), or its change along du if that is not None."},
    {"volume_forces", call_volume_forces, METH_VARARGS,
     "volume_forces(cells, u, pressure, out): add the nodal forces (N, DIM) of pressure (B, S, LANES)."},
    {"stresses", call_stresses, METH_VARARGS,
     "stresses(cells, u, mu, pressure, out): cell means (B, STRESSES + 1, LANES) of the Cauchy stress xx, yy,\n"
     "zz, xy, yz, xz and of J, with the pressure (B, Q, LANES)."},
    {"smallest_J", call_smallest_J, METH_VARARGS, "smallest_J(cells, u): smallest volume ratio of all samples."},
    {"strains", call_strains, METH_VARARGS, "strains(cells, u, out): Green strains (B, Q, STRAINS, LANES)."},
    {"viscous", call_viscous, METH_VARARGS,
     "viscous(cells, u, rate, strain0, out): add the nodal forces (N, DIM); dissipated energy."},
    {"add_viscous", call_add_viscous, METH_VARARGS,
     "add_viscous(cells, u, rate, strain0, places, data): add the tangent of `viscous`."},
    {"begin_relaxing", call_begin_relaxing, METH_VARARGS,
     "begin_relaxing(cells, u, x, kept, before): B and a (B, Q, branches, KEPT + 1, LANES) of steps of x\n"
     "relaxation times (B, branches, LANES), from C_i `kept` (B, Q, branches, KEPT, LANES)."},
    {"relaxing", call_relaxing, METH_VARARGS,
     "relaxing(cells, u, modulus, before, out): add the branches' nodal forces (N, DIM)."},
    {"add_relaxing", call_add_relaxing, METH_VARARGS,
     "add_relaxing(cells, u, modulus, before, places, data): add the tangent of `relaxing`."},
    {"end_relaxing", call_end_relaxing, METH_VARARGS,
     "end_relaxing(cells, u, modulus, before, u0, kept, loss, out): C_i at the end; stored energy, and what\n"
     "was lost, with the numbers `loss` (B, branches, 4, LANES) of `relaxing_end`."},
    {NULL, NULL, 0, NULL}};

static struct PyModuleDef module = {PyModuleDef_HEAD_INIT, MODULE, "Compiled element loops.", -1, methods};

PyMODINIT_FUNC INIT(void) {
    version = chosen();
    PyObject *made = PyModule_Create(&module);
    if (made && PyModule_AddIntConstant(made, "LANES", LANES) < 0) Py_CLEAR(made);
    return made;
}
