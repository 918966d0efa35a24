/* Python binding of signals.h and cycles.h: rows of doubles in and out, the GIL released while they run. */
#define PY_SSIZE_T_CLEAN
#define Py_LIMITED_API 0x030B0000
#include <Python.h>

#include "buffers.h"
#include "cycles.h"
#include "signals.h"
#include "signals_module.h"

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
    df_buffers b;
    if (!df_borrow(&b, o, N, OUT))
        return NULL;
    const Py_buffer *v = b.view;
    const Py_ssize_t n_sections = df_count(&v[SECTIONS]) / DF_SECTION_ROW;
    const Py_ssize_t n = rows > 0 ? df_count(&v[IN]) / rows : 0;
    if (n_sections > DF_MOST_SECTIONS || df_count(&v[SECTIONS]) != n_sections * DF_SECTION_ROW ||
        df_count(&v[STEADY]) != n_sections * DF_STEADY_ROW)
        return df_refused(&b, "run_filter: sections or their steady states have the wrong size");
    if (n < 2 || df_count(&v[IN]) != n * rows || v[OUT].len != v[IN].len || pad < 0 || pad >= n ||
        (way == 0 && df_count(&v[SCRATCH]) < n + 2 * pad))
        return df_refused(&b, "run_filter: signal, result or scratch have the wrong size");
    const df_sections f = {(int)n_sections, v[SECTIONS].buf, v[STEADY].buf};
    const double *in = v[IN].buf;
    double *out = v[OUT].buf;
    Py_BEGIN_ALLOW_THREADS
    const int has_room = df_count(&v[SCRATCH]) >= 2 * (n + 2 * pad);
    for (Py_ssize_t k = 0; k < rows; k++) {
        if (way == 0 && has_room && k + 1 < rows) {
            df_filter_two_both(&f, (size_t)n, (size_t)pad, in + k * n, out + k * n, v[SCRATCH].buf);
            k++;
        } else if (way == 0)
            df_filter_both(&f, (size_t)n, (size_t)pad, in + k * n, out + k * n, v[SCRATCH].buf);
        else
            df_filter_once(&f, (size_t)n, in + k * n, out + k * n, way < 0);
    }
    Py_END_ALLOW_THREADS
    return df_done(&b);
}

PyObject *df_py_behind_lag(PyObject *self, PyObject *args)
{
    (void)self;
    enum { IN, OUT, N };
    PyObject *o[N];
    Py_ssize_t rows;
    df_lag lag;
    if (!PyArg_ParseTuple(args, "OOnddd:behind_lag", &o[IN], &o[OUT], &rows, &lag.a, &lag.b, &lag.c))
        return NULL;
    df_buffers b;
    if (!df_borrow(&b, o, N, OUT))
        return NULL;
    const Py_buffer *v = b.view;
    const Py_ssize_t n = rows > 0 ? df_count(&v[IN]) / rows : 0;
    if (rows < 0 || df_count(&v[IN]) != n * rows || v[OUT].len != v[IN].len)
        return df_refused(&b, "behind_lag: rows of one length, and as many samples behind it");
    Py_BEGIN_ALLOW_THREADS
    df_behind_lag(&lag, (size_t)rows, (size_t)n, v[IN].buf, v[OUT].buf);
    Py_END_ALLOW_THREADS
    return df_done(&b);
}

PyObject *df_py_lag_slope(PyObject *self, PyObject *args)
{
    (void)self;
    enum { IN, BEHIND, OUT, N };
    PyObject *o[N];
    df_lag lag = {0.0, 0.0, 0.0};
    double by_a, by_mean;
    if (!PyArg_ParseTuple(args, "OOOddd:lag_slope", &o[IN], &o[BEHIND], &o[OUT], &lag.a, &by_a, &by_mean))
        return NULL;
    df_buffers b;
    if (!df_borrow(&b, o, N, OUT))
        return NULL;
    const Py_buffer *v = b.view;
    if (v[BEHIND].len != v[IN].len || v[OUT].len != v[IN].len)
        return df_refused(&b, "lag_slope: as many samples behind the lag, and of its slope");
    Py_BEGIN_ALLOW_THREADS
    df_lag_slope(&lag, by_a, by_mean, (size_t)df_count(&v[IN]), v[IN].buf, v[BEHIND].buf, v[OUT].buf);
    Py_END_ALLOW_THREADS
    return df_done(&b);
}

PyObject *df_py_spline_slopes(PyObject *self, PyObject *args)
{
    (void)self;
    enum { IN, OUT, SCRATCH, N };
    PyObject *o[N];
    if (!PyArg_ParseTuple(args, "OOO:spline_slopes", &o[IN], &o[OUT], &o[SCRATCH]))
        return NULL;
    df_buffers b;
    if (!df_borrow(&b, o, N, OUT))
        return NULL;
    const Py_buffer *v = b.view;
    const Py_ssize_t n = df_count(&v[IN]);
    if (n < 4 || v[OUT].len != v[IN].len || v[SCRATCH].len != v[IN].len)
        return df_refused(&b, "spline_slopes: four samples or more, and as many slopes");
    Py_BEGIN_ALLOW_THREADS
    df_spline_slopes((size_t)n, v[IN].buf, v[OUT].buf, v[SCRATCH].buf);
    Py_END_ALLOW_THREADS
    return df_done(&b);
}

PyObject *df_py_between(PyObject *self, PyObject *args)
{
    (void)self;
    enum { IN, AT, OUT, N };
    PyObject *o[N];
    Py_ssize_t rows;
    if (!PyArg_ParseTuple(args, "OOOn:between", &o[IN], &o[AT], &o[OUT], &rows))
        return NULL;
    df_buffers b;
    if (!df_borrow(&b, o, N, OUT))
        return NULL;
    const Py_buffer *v = b.view;
    const Py_ssize_t n = rows > 0 ? df_count(&v[IN]) / rows : 0, n_at = df_count(&v[AT]);
    if (n < 8 || df_count(&v[IN]) != n * rows || df_count(&v[OUT]) != n_at * rows)
        return df_refused(&b, "between: eight samples or more, and a value for each position");
    Py_BEGIN_ALLOW_THREADS
    df_between((size_t)n, (size_t)rows, v[IN].buf, (size_t)n_at, v[AT].buf, v[OUT].buf);
    Py_END_ALLOW_THREADS
    return df_done(&b);
}

PyObject *df_py_crossings(PyObject *self, PyObject *args)
{
    (void)self;
    enum { X, V, AT, N };
    PyObject *o[N];
    double reach, level, sign;
    if (!PyArg_ParseTuple(args, "OOOddd:crossings", &o[X], &o[V], &o[AT], &reach, &level, &sign))
        return NULL;
    df_buffers b;
    if (!df_borrow(&b, o, N, AT))
        return NULL;
    const Py_buffer *v = b.view;
    const Py_ssize_t n = df_count(&v[X]);
    if (v[V].len != v[X].len || df_count(&v[AT]) < n / 2 + 1)
        return df_refused(&b, "crossings: as many velocities as places, and room for half as many");
    size_t found;
    Py_BEGIN_ALLOW_THREADS
    found = df_crossings((size_t)n, v[X].buf, v[V].buf, level, sign, reach, v[AT].buf);
    Py_END_ALLOW_THREADS
    df_release(&b);
    return PyLong_FromSize_t(found);
}

PyObject *df_py_tops(PyObject *self, PyObject *args)
{
    (void)self;
    enum { X, V, BOUNDARIES, TOPS, N };
    PyObject *o[N];
    double level, sign;
    if (!PyArg_ParseTuple(args, "OOOOdd:tops", &o[X], &o[V], &o[BOUNDARIES], &o[TOPS], &level,
                          &sign))
        return NULL;
    df_buffers b;
    if (!df_borrow(&b, o, N, TOPS))
        return NULL;
    const Py_buffer *v = b.view;
    const Py_ssize_t n = df_count(&v[X]), n_tops = df_count(&v[TOPS]);
    if (n < 2 || v[V].len != v[X].len || df_count(&v[BOUNDARIES]) != n_tops + 1)
        return df_refused(&b, "tops: two samples or more with velocities, and boundaries of each top");
    Py_BEGIN_ALLOW_THREADS
    df_tops((size_t)n, v[X].buf, v[V].buf, level, sign, (size_t)n_tops, v[BOUNDARIES].buf,
            v[TOPS].buf);
    Py_END_ALLOW_THREADS
    return df_done(&b);
}

PyObject *df_py_turns(PyObject *self, PyObject *args)
{
    (void)self;
    enum { X, TURNS, N };
    PyObject *o[N];
    double reach;
    if (!PyArg_ParseTuple(args, "OOd:turns", &o[X], &o[TURNS], &reach))
        return NULL;
    df_buffers b;
    if (!df_borrow(&b, o, N, TURNS))
        return NULL;
    const Py_buffer *v = b.view;
    if (v[TURNS].len < v[X].len)
        return df_refused(&b, "turns: room for as many turns as samples");
    size_t found;
    Py_BEGIN_ALLOW_THREADS
    found = df_turns((size_t)df_count(&v[X]), v[X].buf, reach, v[TURNS].buf);
    Py_END_ALLOW_THREADS
    df_release(&b);
    return PyLong_FromSize_t(found);
}

/* Whether samples rise, and there are so many. */
static int are_rising(const int64_t *samples, Py_ssize_t n, Py_ssize_t n_there)
{
    for (Py_ssize_t k = 0; k < n; k++)
        if (samples[k] < 0 || samples[k] >= n_there || (k && samples[k] <= samples[k - 1]))
            return 0;
    return 1;
}

