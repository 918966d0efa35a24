/* Python binding of signals.h: rows of doubles in and out, the GIL released while they run. */
#define PY_SSIZE_T_CLEAN
#define Py_LIMITED_API 0x030B0000
#include <Python.h>

#include "signals.h"
#include "signals_module.h"

enum { MOST_BUFFERS = 5 };

typedef struct {
    Py_buffer view[MOST_BUFFERS];
    int got;
} buffers;

static void release(buffers *b)
{
    while (b->got-- > 0)
        PyBuffer_Release(&b->view[b->got]);
}

/* Borrow n buffers; those from `written` on are written to. */
static int borrow(buffers *b, PyObject **objects, int n, int written)
{
    for (b->got = 0; b->got < n; b->got++) {
        const int flags = PyBUF_C_CONTIGUOUS | (b->got >= written ? PyBUF_WRITABLE : 0);
        if (PyObject_GetBuffer(objects[b->got], &b->view[b->got], flags)) {
            release(b);
            return 0;
        }
    }
    return 1;
}

static Py_ssize_t count(const Py_buffer *b)
{
    return b->len / (Py_ssize_t)sizeof(double);
}

static PyObject *refused(buffers *b, const char *what)
{
    release(b);
    PyErr_SetString(PyExc_ValueError, what);
    return NULL;
}

static PyObject *done(buffers *b)
{
    release(b);
    Py_RETURN_NONE;
}

PyObject *df_py_filter(PyObject *self, PyObject *args)
{
    (void)self;
    enum { SECTIONS, STEADY, IN, OUT, SCRATCH, N };
    PyObject *o[N];
    Py_ssize_t rows, pad;
    int way;
    if (!PyArg_ParseTuple(args, "OOOOOnni:run_filter", &o[SECTIONS], &o[STEADY], &o[IN], &o[OUT],
                          &o[SCRATCH], &rows, &pad, &way))
        return NULL;
    buffers b;
    if (!borrow(&b, o, N, OUT))
        return NULL;
    const Py_buffer *v = b.view;
    const Py_ssize_t n_sections = count(&v[SECTIONS]) / DF_SECTION_ROW;
    const Py_ssize_t n = rows > 0 ? count(&v[IN]) / rows : 0;
    if (n_sections > DF_MOST_SECTIONS || count(&v[SECTIONS]) != n_sections * DF_SECTION_ROW ||
        count(&v[STEADY]) != n_sections * DF_STEADY_ROW)
        return refused(&b, "run_filter: sections or their steady states have the wrong size");
    if (n < 2 || count(&v[IN]) != n * rows || v[OUT].len != v[IN].len || pad < 0 || pad >= n ||
        (way == 0 && count(&v[SCRATCH]) < n + 2 * pad))
        return refused(&b, "run_filter: signal, result or scratch have the wrong size");
    const df_sections f = {(int)n_sections, v[SECTIONS].buf, v[STEADY].buf};
    const double *in = v[IN].buf;
    double *out = v[OUT].buf;
    Py_BEGIN_ALLOW_THREADS
    for (Py_ssize_t k = 0; k < rows; k++) {
        if (way == 0)
            df_filter_both(&f, (size_t)n, (size_t)pad, in + k * n, out + k * n, v[SCRATCH].buf);
        else
            df_filter_once(&f, (size_t)n, in + k * n, out + k * n, way < 0);
    }
    Py_END_ALLOW_THREADS
    return done(&b);
}

PyObject *df_py_spline_slopes(PyObject *self, PyObject *args)
{
    (void)self;
    enum { IN, OUT, SCRATCH, N };
    PyObject *o[N];
    if (!PyArg_ParseTuple(args, "OOO:spline_slopes", &o[IN], &o[OUT], &o[SCRATCH]))
        return NULL;
    buffers b;
    if (!borrow(&b, o, N, OUT))
        return NULL;
    const Py_buffer *v = b.view;
    const Py_ssize_t n = count(&v[IN]);
    if (n < 4 || v[OUT].len != v[IN].len || v[SCRATCH].len != v[IN].len)
        return refused(&b, "spline_slopes: four samples or more, and as many slopes");
    Py_BEGIN_ALLOW_THREADS
    df_spline_slopes((size_t)n, v[IN].buf, v[OUT].buf, v[SCRATCH].buf);
    Py_END_ALLOW_THREADS
    return done(&b);
}

PyObject *df_py_between(PyObject *self, PyObject *args)
{
    (void)self;
    enum { IN, AT, OUT, N };
    PyObject *o[N];
    Py_ssize_t rows;
    if (!PyArg_ParseTuple(args, "OOOn:between", &o[IN], &o[AT], &o[OUT], &rows))
        return NULL;
    buffers b;
    if (!borrow(&b, o, N, OUT))
        return NULL;
    const Py_buffer *v = b.view;
    const Py_ssize_t n = rows > 0 ? count(&v[IN]) / rows : 0, n_at = count(&v[AT]);
    if (n < 8 || count(&v[IN]) != n * rows || count(&v[OUT]) != n_at * rows)
        return refused(&b, "between: eight samples or more, and a value for each position");
    const double *in = v[IN].buf;
    double *out = v[OUT].buf;
    Py_BEGIN_ALLOW_THREADS
    for (Py_ssize_t k = 0; k < rows; k++)
        df_between((size_t)n, in + k * n, (size_t)n_at, v[AT].buf, out + k * n_at);
    Py_END_ALLOW_THREADS
    return done(&b);
}
