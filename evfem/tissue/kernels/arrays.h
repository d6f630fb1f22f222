/* Arrays of Python in C. */

#define MOST_VIEWS 14 /* of one call */

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
    if (all->count == MOST_VIEWS && !PyErr_Occurred()) PyErr_SetString(PyExc_IndexError, "too many arrays");
    if (PyErr_Occurred()) return NULL;
    Py_buffer *view = &all->views[all->count];
    int flags = PyBUF_C_CONTIGUOUS | PyBUF_FORMAT | (writable ? PyBUF_WRITABLE : 0);
    if (PyObject_GetBuffer(array, view, flags) < 0) return NULL;
    all->count++;
    if (view->format[0] != format || (length >= 0 && view->len != length * view->itemsize)) {
        PyErr_Format(PyExc_ValueError, "an array of %zd items, format %s; expected %zd, format %c",
                     view->itemsize ? view->len / view->itemsize : 0, view->format, length, format);
        return NULL;
    }
    return view->buf;
}

/* Whole numbers that lead into arrays of at least `end` items: checked once, and copied, so that nobody
   changes them afterwards. */
typedef struct {
    Py_ssize_t count, end;
    int32_t numbers[];
} bounded;

#define BOUNDED "evfem bounded numbers"

static void forget(PyObject *capsule) { PyMem_Free(PyCapsule_GetPointer(capsule, BOUNDED)); }

static inline PyObject *call_bounded(PyObject *self, PyObject *args) {
    PyObject *array, *capsule = NULL;
    Py_ssize_t end;
    bounded *own = NULL;
    int wrong = 0;
    held all;
    all.count = 0;
    if (!PyArg_ParseTuple(args, "On", &array, &end)) return NULL;
    const int32_t *given = hold(&all, array, 'i', -1, 0);
    Py_ssize_t count = given ? all.views[0].len / (Py_ssize_t)sizeof(int32_t) : 0;
    for (Py_ssize_t i = 0; i < count; i++) wrong |= given[i] < 0 || given[i] >= end;
    if (wrong)
        PyErr_Format(PyExc_IndexError, "a number outside 0 to %zd", end - 1);
    else if (given && !(own = PyMem_Malloc(sizeof(bounded) + count * sizeof(int32_t))))
        PyErr_NoMemory();
    if (own) {
        own->count = count;
        own->end = end;
        memcpy(own->numbers, given, count * sizeof(int32_t));
        if (!(capsule = PyCapsule_New(own, BOUNDED, forget))) PyMem_Free(own);
    }
    release(&all);
    return capsule;
}

/* The numbers of a capsule, if there are so many and none leads beyond `size` items; else NULL with an error
   set, as by `hold`. */
static inline const int32_t *numbers_of(PyObject *capsule, Py_ssize_t count, Py_ssize_t size) {
    if (PyErr_Occurred()) return NULL;
    const bounded *all = PyCapsule_GetPointer(capsule, BOUNDED);
    if (all && all->count != count)
        PyErr_Format(PyExc_ValueError, "%zd numbers; expected %zd", all->count, count);
    else if (all && all->end > size)
        PyErr_Format(PyExc_IndexError, "numbers up to %zd lead out of an array of %zd", all->end - 1, size);
    return PyErr_Occurred() ? NULL : all->numbers;
}
