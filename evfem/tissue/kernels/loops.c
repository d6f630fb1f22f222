/* Compiled element loops of the plane: twins of the weak forms `neo_hookean` (`elastic.h`) and
   `kelvin_voigt` (`viscous.h`). */

#define PY_SSIZE_T_CLEAN
#define Py_LIMITED_API 0x030b0000
#include "viscous.h"
#include "arrays.h"

#define MODULE "loops"
#define INIT PyInit_loops
#define SIZED(NAME, ...)                            \
    switch (m->n) {                                 \
    case 4: return NAME(m, 4, __VA_ARGS__);         \
    case 6: return NAME(m, 6, __VA_ARGS__);         \
    default: return NAME(m, 9, __VA_ARGS__);        \
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

static int points_of(const mesh *m) { return m->at.count; }

static int samples_of(const mesh *m) { return m->modes ? m->sample.count : m->at.count; }

#include "module.h"
