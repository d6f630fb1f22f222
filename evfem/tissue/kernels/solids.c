/* Compiled element loops of hexahedra: twins of the weak forms `neo_hookean` (`solid_elastic.h`) and
   `kelvin_voigt` (`solid_viscous.h`). */

#define PY_SSIZE_T_CLEAN
#define Py_LIMITED_API 0x030b0000
#include "solid_viscous.h"
#include "arrays.h"

#define MODULE "solids"
#define INIT PyInit_solids
#define SIZED(NAME, ...)                            \
    switch (m->n) {                                 \
    case 8: return NAME(m, 8, __VA_ARGS__);         \
    default: return NAME(m, 27, __VA_ARGS__);       \
    }

/* Read a tuple `evfem.tissue.kernels.blocks.SolidCells`; size is N of its sizes (N, B, n, Q, M). */
static mesh read_cells(held *all, PyObject *cells, Py_ssize_t *size) {
    mesh m = {0};
    PyObject *nodes, *weight, *reference, *inverse, *mean_gradient, *psi, *mean;
    if (!PyArg_ParseTuple(cells, "(nniii)OOOOOOO", size, &m.blocks, &m.n, &m.points, &m.modes, &nodes, &weight,
                          &reference, &inverse, &mean_gradient, &psi, &mean))
        return m;
    Py_ssize_t B = m.blocks, n = m.n, Q = m.points, M = m.modes;
    if ((n != 8 && n != 27) || Q > MOST_POINTS || M < 1 || M > MOST_MODES)
        PyErr_SetString(PyExc_ValueError, "cells of a kind that the loops do not know");
    m.nodes = hold(all, nodes, 'i', B * n * LANES, 0);
    m.weight = hold(all, weight, 'd', B * Q * LANES, 0);
    m.reference = hold(all, reference, 'd', DIM * Q * n, 0);
    m.inverse = hold(all, inverse, 'd', B * Q * DIM * DIM * LANES, 0);
    if (mean_gradient != Py_None) m.mean_gradient = hold(all, mean_gradient, 'd', B * n * DIM * LANES, 0);
    m.psi = hold(all, psi, 'd', B * M * samples_of(&m) * LANES, 0);
    m.mean = hold(all, mean, 'd', B * M * LANES, 0);
    return m;
}

static int points_of(const mesh *m) { return m->points; }

#include "module.h"
