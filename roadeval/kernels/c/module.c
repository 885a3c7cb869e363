/* The Python module of the loops. It checks the arguments of each loop and calls it.
 *
 * It reads arrays by the buffer protocol and never copies them. It checks the element type, the
 * dimensions and the order of each array; roadeval/kernels/compiled.py checks whether the shapes
 * fit together. The interpreter lock is released while a loop runs. */

#define Py_LIMITED_API 0x030b0000
#include <Python.h>

#include "loops.h"

/* No loop takes more arguments. */
#define MOST 16

typedef struct {
    union {
        void *array;
        int64_t size;
        double number;
    } values[MOST];
    Py_buffer views[MOST];
    int view_count;
} taken_t;

static void release(taken_t *taken)
{
    while (taken->view_count > 0)
        PyBuffer_Release(&taken->views[--taken->view_count]);
}

/* Return whether a buffer's elements are of a type. NumPy has two letters for some types. */
static bool has_type(const Py_buffer *view, char type)
{
    const char *format = view->format ? view->format : "B";
    if (format[0] == '\0' || format[1] != '\0')
        return false;
    if (type == 'q')
        return view->itemsize == 8 && (format[0] == 'q' || format[0] == 'l');
    if (type == 'Q')
        return view->itemsize == 8 && (format[0] == 'Q' || format[0] == 'L');
    if (type == 'i')
        return view->itemsize == 4 && (format[0] == 'i' || format[0] == 'l');
    if (type == 'I')
        return view->itemsize == 4 && (format[0] == 'I' || format[0] == 'L');
    return format[0] == type;
}

/* Read the arguments, and return whether they are of the kinds that `kinds` lists.
 *
 * The kind n is a size or a flag, and the kind d is a number. The kind of an array is the type of
 * its elements, as a letter of Python's module `struct`, and then its number of dimensions. A >
 * stands before the kind of an array that the loop writes. */
static bool take(
    taken_t *taken, const char *kinds, PyObject *const *arguments, Py_ssize_t count)
{
    taken->view_count = 0;
    Py_ssize_t place = 0;
    for (const char *kind = kinds; *kind; kind++) {
        if (*kind == ' ')
            continue;
        if (place == count) {
            place = -1;
            break;
        }
        PyObject *argument = arguments[place];
        if (*kind == 'n') {
            taken->values[place++].size = PyLong_AsLongLong(argument);
        } else if (*kind == 'd' && (kind[1] == ' ' || kind[1] == '\0')) {
            taken->values[place++].number = PyFloat_AsDouble(argument);
        } else {
            bool written = *kind == '>';
            kind += written;
            char type = *kind++;
            Py_buffer *view = &taken->views[taken->view_count];
            int flags = PyBUF_C_CONTIGUOUS | PyBUF_FORMAT | (written ? PyBUF_WRITABLE : 0);
            if (PyObject_GetBuffer(argument, view, flags) < 0) {
                PyErr_Format(PyExc_TypeError, "argument %zd is no C-contiguous array", place);
                break;
            }
            taken->view_count++;
            if (!has_type(view, type) || view->ndim != *kind - '0') {
                PyErr_Format(
                    PyExc_TypeError, "argument %zd has %d dimensions of type %s, not %c of %c",
                    place, view->ndim, view->format ? view->format : "B", *kind, type);
                break;
            }
            taken->values[place++].array = view->buf;
        }
        if (PyErr_Occurred())
            break;
    }
    if (!PyErr_Occurred() && place == count)
        return true;
    if (!PyErr_Occurred())
        PyErr_Format(PyExc_TypeError, "%zd arguments, where \"%s\" are taken", count, kinds);
    release(taken);
    return false;
}

#define ARRAY(place) taken.values[place].array
#define SIZE(place) taken.values[place].size
#define NUMBER(place) taken.values[place].number
#define PLANES ARRAY(0), ARRAY(1), ARRAY(2), SIZE(3), SIZE(4)

/* FUNCTION defines a function of the module: its name, the kinds of its arguments, its call. */
#define FUNCTION(name, kinds, call) \
    static PyObject *call_##name( \
        PyObject *Py_UNUSED(self), PyObject *const *arguments, Py_ssize_t count) \
    { \
        taken_t taken; \
        int64_t result = 0; \
        if (!take(&taken, kinds, arguments, count)) \
            return NULL; \
        Py_BEGIN_ALLOW_THREADS \
        call; \
        Py_END_ALLOW_THREADS \
        release(&taken); \
        return PyLong_FromLongLong(result); \
    }

FUNCTION(look_up_sum_min, "B2 B2 B2 n n B2 >B2 >q1 >i1",
    look_up_sum_min(PLANES, ARRAY(5), ARRAY(6), ARRAY(7), ARRAY(8)))

FUNCTION(mahalanobis, "B2 B2 B2 n n d1 d2 d >f2 >B2",
    mahalanobis(PLANES, ARRAY(5), ARRAY(6), NUMBER(7), ARRAY(8), ARRAY(9)))

FUNCTION(look_up_colours, "B2 B2 B2 n n Q1 >B2 >i1 >B1",
    look_up_colours(PLANES, ARRAY(5), ARRAY(6), ARRAY(7), ARRAY(8)))

FUNCTION(run_sums, "B2 B2 B2 n i2 n >q2",
    run_sums(ARRAY(0), ARRAY(1), ARRAY(2), SIZE(3), ARRAY(4), SIZE(5), ARRAY(6)))

FUNCTION(ring_sums, "B2 B2 B2 n n i2 q1 Q2 n n >q2 >q1 >q1",
    ring_sums(PLANES, ARRAY(5), ARRAY(6), ARRAY(7), SIZE(8), SIZE(9), ARRAY(10), ARRAY(11),
        ARRAY(12)))

FUNCTION(transfer, ">B3 n i2 n d2 d2 d2 n >q1 >B1",
    transfer(ARRAY(0), SIZE(1), ARRAY(2), SIZE(3), ARRAY(4), ARRAY(5), ARRAY(6), SIZE(7),
        ARRAY(8), ARRAY(9)))

FUNCTION(components, "Q2 n n n >q1 >i1 >i1 >q1 >i2",
    result = components(ARRAY(0), SIZE(1), SIZE(2), (int)SIZE(3), ARRAY(4), ARRAY(5), ARRAY(6),
        ARRAY(7), ARRAY(8)))

FUNCTION(keep_region, "Q2 n n >q1 >i1 >i1 >q1 >q1 >Q2",
    keep_region(ARRAY(0), SIZE(1), SIZE(2), ARRAY(3), ARRAY(4), ARRAY(5), ARRAY(6), ARRAY(7),
        ARRAY(8)))

FUNCTION(fill_holes, "Q2 n n >q1 >i1 >i1 >q1 >B1 >Q2",
    fill_holes(ARRAY(0), SIZE(1), SIZE(2), ARRAY(3), ARRAY(4), ARRAY(5), ARRAY(6), ARRAY(7),
        ARRAY(8)))

FUNCTION(count_bits, "Q2 n Q2 n Q2 n n >q3 >Q1",
    count_bits(ARRAY(0), SIZE(1), ARRAY(2), SIZE(3), ARRAY(4), SIZE(5), SIZE(6), ARRAY(7),
        ARRAY(8)))

FUNCTION(dilate, "Q2 n n q1 n >Q1 >Q2",
    dilate(ARRAY(0), SIZE(1), SIZE(2), ARRAY(3), SIZE(4), ARRAY(5), ARRAY(6)))

FUNCTION(erode, "Q2 n n q1 n >Q1 >Q2",
    erode(ARRAY(0), SIZE(1), SIZE(2), ARRAY(3), SIZE(4), ARRAY(5), ARRAY(6)))

FUNCTION(geodesics, "H2 B2 n n n >i2",
    geodesics(ARRAY(0), ARRAY(1), SIZE(2), SIZE(3), SIZE(4), ARRAY(5)))

FUNCTION(tree_sum, "f2 n n i2 f2 I2 f2 n n >f1 >f1",
    tree_sum(ARRAY(0), SIZE(1), SIZE(2), ARRAY(3), ARRAY(4), ARRAY(5), ARRAY(6), SIZE(7), SIZE(8),
        ARRAY(9), ARRAY(10)))

FUNCTION(filter_rows, "B2 n n n >B2", filter_rows(ARRAY(0), SIZE(1), SIZE(2), SIZE(3), ARRAY(4)))

FUNCTION(label_rows, "B2 n n n >B2",
    label_rows(ARRAY(0), SIZE(1), SIZE(2), (int)SIZE(3), ARRAY(4)))

#define METHOD(name) {#name, (PyCFunction)(void (*)(void))call_##name, METH_FASTCALL, NULL}

static PyMethodDef methods[] = {
    METHOD(look_up_sum_min), METHOD(mahalanobis), METHOD(look_up_colours), METHOD(run_sums),
    METHOD(ring_sums), METHOD(transfer), METHOD(components),
    METHOD(keep_region), METHOD(fill_holes), METHOD(count_bits), METHOD(dilate), METHOD(erode),
    METHOD(geodesics), METHOD(tree_sum),
    METHOD(filter_rows), METHOD(label_rows),
    {NULL, NULL, 0, NULL},
};

static struct PyModuleDef module = {
    .m_base = PyModuleDef_HEAD_INIT,
    .m_name = "_loops",
    .m_doc = "Loops in C: see roadeval.kernels.compiled.",
    .m_methods = methods,
};

PyMODINIT_FUNC PyInit__loops(void)
{
    return PyModule_Create(&module);
}
