/* Python binding of signals.h, ends.h and repeats.h: rows of doubles in and out, the GIL released meanwhile. */
#define PY_SSIZE_T_CLEAN
#define Py_LIMITED_API 0x030B0000
#include <Python.h>

#include "buffers.h"
#include "ends.h"
#include "repeats.h"
#include "signals.h"
#include "signals_module.h"
#include "taps.h"

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
    for (Py_ssize_t k = 0; k < rows; k++) {
        if (way == 0)
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
