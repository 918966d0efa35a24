/* Python binding of repeats.h, ends.h and speeds.h: rows of doubles in and out, the GIL released meanwhile. */
#define PY_SSIZE_T_CLEAN
#define Py_LIMITED_API 0x030B0000
#include <Python.h>

#include "buffers.h"
#include "ends.h"
#include "repeats.h"
#include "repeats_module.h"
#include "speeds.h"

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

PyObject *df_py_cycle_means(PyObject *self, PyObject *args)
{
    (void)self;
    enum { Y, BOUNDARIES, MEANS, N };
    PyObject *o[N];
    if (!PyArg_ParseTuple(args, "OOO:cycle_means", &o[Y], &o[BOUNDARIES], &o[MEANS]))
        return NULL;
    df_buffers b;
    if (!df_borrow(&b, o, N, MEANS))
        return NULL;
    const Py_buffer *v = b.view;
    const Py_ssize_t n_means = df_count(&v[MEANS]);
    if (df_count(&v[Y]) < 2 || df_count(&v[BOUNDARIES]) != n_means + 1)
        return df_refused(&b, "cycle_means: two samples or more, and boundaries of each mean");
    Py_BEGIN_ALLOW_THREADS
    df_cycle_means((size_t)df_count(&v[Y]), v[Y].buf, (size_t)n_means, v[BOUNDARIES].buf,
                   v[MEANS].buf);
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

PyObject *df_py_rough(PyObject *self, PyObject *args)
{
    (void)self;
    enum { Y, SCRATCH, N };
    PyObject *o[N];
    if (!PyArg_ParseTuple(args, "OO:rough", &o[Y], &o[SCRATCH]))
        return NULL;
    df_buffers b;
    if (!df_borrow(&b, o, N, SCRATCH))
        return NULL;
    const Py_buffer *v = b.view;
    double found;
    if (v[SCRATCH].len != v[Y].len)
        return df_refused(&b, "rough: as much room as samples");
    Py_BEGIN_ALLOW_THREADS
    found = df_rough((size_t)df_count(&v[Y]), v[Y].buf, v[SCRATCH].buf);
    Py_END_ALLOW_THREADS
    df_release(&b);
    return PyFloat_FromDouble(found);
}

PyObject *df_py_sort(PyObject *self, PyObject *args)
{
    (void)self;
    enum { VALUES, ROOM, N };
    PyObject *o[N];
    if (!PyArg_ParseTuple(args, "OO:sort", &o[VALUES], &o[ROOM]))
        return NULL;
    df_buffers b;
    if (!df_borrow(&b, o, N, VALUES))
        return NULL;
    const Py_buffer *v = b.view;
    if (v[ROOM].len != v[VALUES].len)
        return df_refused(&b, "sort: as much room as values");
    Py_BEGIN_ALLOW_THREADS
    df_sort((size_t)df_count(&v[VALUES]), v[VALUES].buf, v[ROOM].buf);
    Py_END_ALLOW_THREADS
    return df_done(&b);
}

PyObject *df_py_step(PyObject *self, PyObject *args)
{
    (void)self;
    enum { ORDER, SCRATCH, N };
    PyObject *o[N];
    double bar;
    if (!PyArg_ParseTuple(args, "OOd:step", &o[ORDER], &o[SCRATCH], &bar))
        return NULL;
    df_buffers b;
    if (!df_borrow(&b, o, N, SCRATCH))
        return NULL;
    const Py_buffer *v = b.view;
    double found;
    if (v[SCRATCH].len != v[ORDER].len)
        return df_refused(&b, "step: as much room as values");
    Py_BEGIN_ALLOW_THREADS
    found = df_step((size_t)df_count(&v[ORDER]), v[ORDER].buf, bar, v[SCRATCH].buf);
    Py_END_ALLOW_THREADS
    df_release(&b);
    return PyFloat_FromDouble(found);
}

PyObject *df_py_equal_runs(PyObject *self, PyObject *args)
{
    (void)self;
    enum { Y, BEGINS, ENDS, N };
    PyObject *o[N];
    Py_ssize_t fewest;
    if (!PyArg_ParseTuple(args, "OOOn:equal_runs", &o[Y], &o[BEGINS], &o[ENDS], &fewest))
        return NULL;
    df_buffers b;
    if (!df_borrow(&b, o, N, BEGINS))
        return NULL;
    const Py_buffer *v = b.view;
    const Py_ssize_t n = df_count(&v[Y]);
    if (fewest < 2 || df_count(&v[BEGINS]) < n / fewest + 1 || v[ENDS].len != v[BEGINS].len)
        return df_refused(&b, "equal_runs: runs of two or more, and room for the most there can be");
    size_t found;
    Py_BEGIN_ALLOW_THREADS
    found = df_equal_runs((size_t)n, v[Y].buf, (size_t)fewest, v[BEGINS].buf, v[ENDS].buf);
    Py_END_ALLOW_THREADS
    df_release(&b);
    return PyLong_FromSize_t(found);
}
