/* Arrays of Python in C. */

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
    if (all->count == MOST_VIEWS && !PyErr_Occurred()) PyErr_SetString(PyExc_ValueError, "too many arrays");
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
