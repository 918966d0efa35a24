/* Python binding of repeats.h, ends.h and speeds.h: rows of doubles in and out, the GIL released meanwhile. */
#define PY_SSIZE_T_CLEAN
#define Py_LIMITED_API 0x030B0000
#include <Python.h>

#include "buffers.h"
#include "ends.h"
#include "repeats.h"
#include "repeats_module.h"
#include "speeds.h"
#include "taps.h"

PyObject *df_py_without_smooth(PyObject *self, PyObject *args)
{
    (void)self;
    enum { LAG, FORCE, COLUMNS, SUMS, N };
    PyObject *o[N];
    double reach, kink, power;
    if (!PyArg_ParseTuple(args, "OOOOdd:without_smooth", &o[LAG], &o[FORCE], &o[COLUMNS], &o[SUMS],
                          &reach, &kink))
        return NULL;
    df_buffers b;
    if (!df_borrow(&b, o, N, COLUMNS))
        return NULL;
    const Py_buffer *v = b.view;
    const Py_ssize_t n = df_count(&v[LAG]), row = n > 0 ? df_count(&v[COLUMNS]) / n : 0;
    if (n < 1 || v[FORCE].len != v[LAG].len || (row != DF_SMOOTH + 1 && row != DF_BENT + 1) ||
        df_count(&v[COLUMNS]) != n * row || df_count(&v[SUMS]) != (n + 1) * row)
        return df_refused(&b, "without_smooth: as many forces as lags, and five or seven columns");
    Py_BEGIN_ALLOW_THREADS
    power = df_without_smooth((size_t)n, v[LAG].buf, v[FORCE].buf, reach, (int)row - 1, kink,
                              v[COLUMNS].buf, v[SUMS].buf);
    Py_END_ALLOW_THREADS
    df_release(&b);
    return PyFloat_FromDouble(power);
}

PyObject *df_py_steps(PyObject *self, PyObject *args)
{
    (void)self;
    enum { LAG, COLUMNS, SUMS, DELAYS, REST, HEIGHTS, SCRATCH, N };
    PyObject *o[N];
    double power, width, least;
    if (!PyArg_ParseTuple(args, "OOOOOOOddd:steps", &o[LAG], &o[COLUMNS], &o[SUMS], &o[DELAYS],
                          &o[REST], &o[HEIGHTS], &o[SCRATCH], &power, &width, &least))
        return NULL;
    df_buffers b;
    if (!df_borrow(&b, o, N, REST))
        return NULL;
    const Py_buffer *v = b.view;
    const Py_ssize_t n = df_count(&v[LAG]), row = n > 0 ? df_count(&v[COLUMNS]) / n : 0;
    if (n < 1 || (row != DF_SMOOTH + 1 && row != DF_BENT + 1) || df_count(&v[COLUMNS]) != n * row ||
        df_count(&v[SUMS]) != (n + 1) * row || v[REST].len != v[DELAYS].len ||
        v[HEIGHTS].len != v[DELAYS].len || df_count(&v[SCRATCH]) < n)
        return df_refused(&b, "steps: columns and sums of each lag, rest and height of each delay");
    Py_BEGIN_ALLOW_THREADS
    df_steps((size_t)n, v[LAG].buf, (int)row - 1, v[COLUMNS].buf, v[SUMS].buf, power, width, least,
             (size_t)df_count(&v[DELAYS]), v[DELAYS].buf, v[REST].buf, v[HEIGHTS].buf,
             v[SCRATCH].buf);
    Py_END_ALLOW_THREADS
    return df_done(&b);
}

PyObject *df_py_at_speeds(PyObject *self, PyObject *args)
{
    (void)self;
    enum { V, SPEEDS, ROWS, COUNTS, MEANS, SQUARES, N };
    PyObject *o[N];
    double sign;
    if (!PyArg_ParseTuple(args, "OOOOOOd:at_speeds", &o[V], &o[SPEEDS], &o[ROWS], &o[COUNTS],
                          &o[MEANS], &o[SQUARES], &sign))
        return NULL;
    df_buffers b;
    if (!df_borrow(&b, o, N, COUNTS))
        return NULL;
    const Py_buffer *v = b.view;
    const Py_ssize_t n = df_count(&v[V]), n_speeds = df_count(&v[SPEEDS]);
    const Py_ssize_t n_rows = n > 0 ? df_count(&v[ROWS]) / n : 0;
    if (n < 1 || df_count(&v[ROWS]) != n * n_rows || df_count(&v[COUNTS]) != 2 * n_speeds ||
        df_count(&v[MEANS]) != 2 * n_speeds * n_rows || v[SQUARES].len != v[MEANS].len)
        return df_refused(&b, "at_speeds: rows as long as the velocity, and room for each speed");
    Py_BEGIN_ALLOW_THREADS
    df_at_speeds((size_t)n, v[V].buf, sign, (size_t)n_speeds, v[SPEEDS].buf, (size_t)n_rows,
                 v[ROWS].buf, v[COUNTS].buf, v[MEANS].buf, v[SQUARES].buf);
    Py_END_ALLOW_THREADS
    return df_done(&b);
}

PyObject *df_py_scatter(PyObject *self, PyObject *args)
{
    (void)self;
    enum { Y, STARTS, PHASES, FOLDED, LAGS, N };
    PyObject *o[N];
    if (!PyArg_ParseTuple(args, "OOOOO:scatter", &o[Y], &o[STARTS], &o[PHASES], &o[FOLDED],
                          &o[LAGS]))
        return NULL;
    df_buffers b;
    if (!df_borrow(&b, o, N, FOLDED))
        return NULL;
    const Py_buffer *v = b.view;
    const Py_ssize_t n_cycles = df_count(&v[STARTS]) - 1, n_phases = df_count(&v[PHASES]);
    double found;
    if (df_count(&v[Y]) < 4 || n_cycles < 2 || n_phases < 1 ||
        df_count(&v[FOLDED]) != n_cycles * n_phases || df_count(&v[LAGS]) != DF_LAGS)
        return df_refused(&b, "scatter: four samples and two cycles or more, and room for each phase");
    Py_BEGIN_ALLOW_THREADS
    found = df_scatter((size_t)df_count(&v[Y]), v[Y].buf, (size_t)n_cycles, v[STARTS].buf,
                       (size_t)n_phases, v[PHASES].buf, v[FOLDED].buf, v[LAGS].buf);
    Py_END_ALLOW_THREADS
    df_release(&b);
    return PyFloat_FromDouble(found);
}

PyObject *df_py_beside(PyObject *self, PyObject *args)
{
    (void)self;
    enum { X, V, F, STARTS, PRODUCTS, ROOM, N };
    PyObject *o[N];
    Py_ssize_t n_phases;
    if (!PyArg_ParseTuple(args, "OOOOOOn:beside", &o[X], &o[V], &o[F], &o[STARTS], &o[PRODUCTS],
                          &o[ROOM], &n_phases))
        return NULL;
    df_buffers b;
    if (!df_borrow(&b, o, N, PRODUCTS))
        return NULL;
    const Py_buffer *v = b.view;
    const Py_ssize_t n = df_count(&v[X]), n_cycles = df_count(&v[STARTS]) - 1;
    if (n < 4 || v[V].len != v[X].len || v[F].len != v[X].len || n_cycles < 1 || n_phases < 0 ||
        df_count(&v[PRODUCTS]) != DF_BESIDE * DF_BESIDE ||
        df_count(&v[ROOM]) != DF_BESIDE * (n_cycles + n))
        return df_refused(&b, "beside: three channels alike, a cycle or more, and room for each");
    Py_BEGIN_ALLOW_THREADS
    df_beside((size_t)n, v[X].buf, v[V].buf, v[F].buf, (size_t)n_cycles, v[STARTS].buf,
              (size_t)n_phases, v[PRODUCTS].buf, v[ROOM].buf);
    Py_END_ALLOW_THREADS
    return df_done(&b);
}

PyObject *df_py_strokes(PyObject *self, PyObject *args)
{
    (void)self;
    enum { X, V, F, FOUND, PRODUCTS, ALONG, N };
    PyObject *o[N];
    double span, fastest;
    if (!PyArg_ParseTuple(args, "OOOOOOdd:strokes", &o[X], &o[V], &o[F], &o[FOUND], &o[PRODUCTS],
                          &o[ALONG], &span, &fastest))
        return NULL;
    df_buffers b;
    if (!df_borrow(&b, o, N, PRODUCTS))
        return NULL;
    const Py_buffer *v = b.view;
    const Py_ssize_t row = DF_STROKE_COLUMNS;
    if (v[V].len != v[X].len || v[F].len != v[X].len || df_count(&v[FOUND]) != row ||
        df_count(&v[PRODUCTS]) != row * row || df_count(&v[ALONG]) != row)
        return df_refused(&b, "strokes: three channels alike, and room for seven columns");
    Py_BEGIN_ALLOW_THREADS
    df_strokes((size_t)df_count(&v[X]), v[X].buf, v[V].buf, v[F].buf, span, fastest, v[FOUND].buf,
               v[PRODUCTS].buf, v[ALONG].buf);
    Py_END_ALLOW_THREADS
    return df_done(&b);
}

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
