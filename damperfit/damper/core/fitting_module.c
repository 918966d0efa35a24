/* Python binding of fitting.h: rows of doubles in and out, the GIL released while they run. */
#define PY_SSIZE_T_CLEAN
#define Py_LIMITED_API 0x030B0000
#include <Python.h>

#include "buffers.h"
#include "fitting.h"
#include "fitting_module.h"
#include "taps.h"

PyObject *df_py_fold(PyObject *self, PyObject *args)
{
    (void)self;
    enum { X, V, F, STARTS, MEANS, BESIDE, ROOM, N };
    PyObject *o[N];
    if (!PyArg_ParseTuple(args, "OOOOOOO:fold", &o[X], &o[V], &o[F], &o[STARTS], &o[MEANS], &o[BESIDE], &o[ROOM]))
        return NULL;
    df_buffers b;
    if (!df_borrow(&b, o, N, MEANS))
        return NULL;
    const Py_buffer *v = b.view;
    const Py_ssize_t n = df_count(&v[X]), n_cycles = df_count(&v[STARTS]) - 1, n_phases = df_count(&v[BESIDE]);
    if (n < DF_TAPS || v[V].len != v[X].len || v[F].len != v[X].len || n_cycles < 1 ||
        df_count(&v[MEANS]) != DF_FOLDED * n_phases || df_count(&v[ROOM]) != n_cycles)
        return df_refused(&b, "fold: channels of one length, where cycles begin, and room for all of them");
    const double *const y[DF_FOLDED] = {v[X].buf, v[V].buf, v[F].buf};
    Py_BEGIN_ALLOW_THREADS
    df_fold((size_t)n, y, (size_t)n_cycles, v[STARTS].buf, (size_t)n_phases, v[MEANS].buf, v[BESIDE].buf,
            v[ROOM].buf);
    Py_END_ALLOW_THREADS
    return df_done(&b);
}

PyObject *df_py_triangle(PyObject *self, PyObject *args)
{
    (void)self;
    enum { COLUMNS, TRIANGLE, N };
    PyObject *o[N];
    Py_ssize_t width;
    if (!PyArg_ParseTuple(args, "OOn:triangle", &o[COLUMNS], &o[TRIANGLE], &width))
        return NULL;
    df_buffers b;
    if (!df_borrow(&b, o, N, COLUMNS))
        return NULL;
    const Py_buffer *v = b.view;
    const Py_ssize_t n = width > 0 ? df_count(&v[COLUMNS]) / width : 0;
    if (width < 1 || n < width || df_count(&v[COLUMNS]) != n * width ||
        df_count(&v[TRIANGLE]) != width * width)
        return df_refused(&b, "triangle: columns of one length, no shorter than they are many");
    Py_BEGIN_ALLOW_THREADS
    df_triangle((size_t)n, (size_t)width, v[COLUMNS].buf, v[TRIANGLE].buf);
    Py_END_ALLOW_THREADS
    return df_done(&b);
}

PyObject *df_py_cycle_products(PyObject *self, PyObject *args)
{
    (void)self;
    enum { RESIDUALS, SLOPES, KERNEL, PRODUCTS, ROOM, N };
    PyObject *o[N];
    Py_ssize_t n_cycles;
    if (!PyArg_ParseTuple(args, "OOOOOn:cycle_products", &o[RESIDUALS], &o[SLOPES], &o[KERNEL], &o[PRODUCTS],
                          &o[ROOM], &n_cycles))
        return NULL;
    df_buffers b;
    if (!df_borrow(&b, o, N, PRODUCTS))
        return NULL;
    const Py_buffer *v = b.view;
    const Py_ssize_t n_phases = n_cycles > 0 ? df_count(&v[RESIDUALS]) / n_cycles : 0, n_lags = df_count(&v[KERNEL]);
    const Py_ssize_t width = n_phases > 0 ? df_count(&v[SLOPES]) / n_phases : 0;
    if (width < 1 || df_count(&v[RESIDUALS]) != n_cycles * n_phases || df_count(&v[SLOPES]) != n_phases * width ||
        df_count(&v[PRODUCTS]) != width * width || df_count(&v[ROOM]) != n_lags * n_phases + width)
        return df_refused(&b, "cycle_products: residuals of whole cycles, slopes of each phase, and room for both");
    Py_BEGIN_ALLOW_THREADS
    df_cycle_products((size_t)n_cycles, (size_t)n_phases, (size_t)width, (size_t)n_lags, v[RESIDUALS].buf,
                      v[SLOPES].buf, v[KERNEL].buf, v[PRODUCTS].buf, v[ROOM].buf);
    Py_END_ALLOW_THREADS
    return df_done(&b);
}
