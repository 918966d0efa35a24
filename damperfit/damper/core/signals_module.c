/* Python binding of signals.h and cycles.h: rows of doubles in and out, the GIL released while they run. */
#define PY_SSIZE_T_CLEAN
#define Py_LIMITED_API 0x030B0000
#include <Python.h>

#include "cycles.h"
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
    const int has_room = count(&v[SCRATCH]) >= 2 * (n + 2 * pad);
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

PyObject *df_py_crossings(PyObject *self, PyObject *args)
{
    (void)self;
    enum { X, V, AT, N };
    PyObject *o[N];
    double reach;
    if (!PyArg_ParseTuple(args, "OOOd:crossings", &o[X], &o[V], &o[AT], &reach))
        return NULL;
    buffers b;
    if (!borrow(&b, o, N, AT))
        return NULL;
    const Py_buffer *v = b.view;
    const Py_ssize_t n = count(&v[X]);
    if (v[V].len != v[X].len || count(&v[AT]) < n / 2 + 1)
        return refused(&b, "crossings: as many velocities as places, and room for half as many");
    size_t found;
    Py_BEGIN_ALLOW_THREADS
    found = df_crossings((size_t)n, v[X].buf, v[V].buf, reach, v[AT].buf);
    Py_END_ALLOW_THREADS
    release(&b);
    return PyLong_FromSize_t(found);
}

PyObject *df_py_tops(PyObject *self, PyObject *args)
{
    (void)self;
    enum { X, V, BOUNDARIES, TOPS, N };
    PyObject *o[N];
    if (!PyArg_ParseTuple(args, "OOOO:tops", &o[X], &o[V], &o[BOUNDARIES], &o[TOPS]))
        return NULL;
    buffers b;
    if (!borrow(&b, o, N, TOPS))
        return NULL;
    const Py_buffer *v = b.view;
    const Py_ssize_t n = count(&v[X]), n_tops = count(&v[TOPS]);
    if (n < 2 || v[V].len != v[X].len || count(&v[BOUNDARIES]) != n_tops + 1)
        return refused(&b, "tops: two samples or more with velocities, and boundaries of each top");
    Py_BEGIN_ALLOW_THREADS
    df_tops((size_t)n, v[X].buf, v[V].buf, (size_t)n_tops, v[BOUNDARIES].buf, v[TOPS].buf);
    Py_END_ALLOW_THREADS
    return done(&b);
}

PyObject *df_py_turns(PyObject *self, PyObject *args)
{
    (void)self;
    enum { X, TURNS, N };
    PyObject *o[N];
    double reach;
    if (!PyArg_ParseTuple(args, "OOd:turns", &o[X], &o[TURNS], &reach))
        return NULL;
    buffers b;
    if (!borrow(&b, o, N, TURNS))
        return NULL;
    const Py_buffer *v = b.view;
    if (v[TURNS].len < v[X].len)
        return refused(&b, "turns: room for as many turns as samples");
    size_t found;
    Py_BEGIN_ALLOW_THREADS
    found = df_turns((size_t)count(&v[X]), v[X].buf, reach, v[TURNS].buf);
    Py_END_ALLOW_THREADS
    release(&b);
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

PyObject *df_py_passages(PyObject *self, PyObject *args)
{
    (void)self;
    enum { X, TURNS, AT, N };
    PyObject *o[N];
    if (!PyArg_ParseTuple(args, "OOO:passages", &o[X], &o[TURNS], &o[AT]))
        return NULL;
    buffers b;
    if (!borrow(&b, o, N, AT))
        return NULL;
    const Py_buffer *v = b.view;
    const Py_ssize_t n_turns = count(&v[TURNS]);
    if (n_turns < 1 || count(&v[AT]) != n_turns - 1 ||
        !are_rising(v[TURNS].buf, n_turns, count(&v[X])))
        return refused(&b, "passages: rising samples, and a passage between each two");
    Py_BEGIN_ALLOW_THREADS
    df_passages(v[X].buf, (size_t)n_turns, v[TURNS].buf, v[AT].buf);
    Py_END_ALLOW_THREADS
    return done(&b);
}

PyObject *df_py_fold(PyObject *self, PyObject *args)
{
    (void)self;
    enum { Y, STARTS, PHASES, FOLDED, LAGS, N };
    PyObject *o[N];
    Py_ssize_t rows;
    if (!PyArg_ParseTuple(args, "OOOOOn:fold", &o[Y], &o[STARTS], &o[PHASES], &o[FOLDED], &o[LAGS],
                          &rows))
        return NULL;
    buffers b;
    if (!borrow(&b, o, N, FOLDED))
        return NULL;
    const Py_buffer *v = b.view;
    const Py_ssize_t n = rows > 0 ? count(&v[Y]) / rows : 0;
    const Py_ssize_t n_cycles = count(&v[STARTS]) - 1, n_phases = count(&v[PHASES]);
    if (n < 4 || count(&v[Y]) != n * rows || n_cycles < 0 ||
        count(&v[FOLDED]) != rows * n_cycles * n_phases || count(&v[LAGS]) != DF_LAGS)
        return refused(&b, "fold: four samples or more, and a value at each phase of each cycle");
    Py_BEGIN_ALLOW_THREADS
    df_fold((size_t)n, (size_t)rows, v[Y].buf, (size_t)n_cycles, v[STARTS].buf, (size_t)n_phases,
            v[PHASES].buf, v[FOLDED].buf, v[LAGS].buf);
    Py_END_ALLOW_THREADS
    return done(&b);
}

PyObject *df_py_outstanding(PyObject *self, PyObject *args)
{
    (void)self;
    enum { Y, OUT, N };
    PyObject *o[N];
    if (!PyArg_ParseTuple(args, "OO:outstanding", &o[Y], &o[OUT]))
        return NULL;
    buffers b;
    if (!borrow(&b, o, N, OUT))
        return NULL;
    const Py_buffer *v = b.view;
    if (v[OUT].len != v[Y].len)
        return refused(&b, "outstanding: as many results as samples");
    Py_BEGIN_ALLOW_THREADS
    df_outstanding((size_t)count(&v[Y]), v[Y].buf, v[OUT].buf);
    Py_END_ALLOW_THREADS
    return done(&b);
}

PyObject *df_py_harmonics(PyObject *self, PyObject *args)
{
    (void)self;
    enum { Y, POWERS, N };
    PyObject *o[N];
    double mean, angle;
    if (!PyArg_ParseTuple(args, "OOdd:harmonics", &o[Y], &o[POWERS], &mean, &angle))
        return NULL;
    buffers b;
    if (!borrow(&b, o, N, POWERS))
        return NULL;
    const Py_buffer *v = b.view;
    const Py_ssize_t n_powers = count(&v[POWERS]);
    if (count(&v[Y]) < 1 || n_powers > DF_MOST_HARMONICS)
        return refused(&b, "harmonics: a sample or more, and not too many powers");
    Py_BEGIN_ALLOW_THREADS
    df_harmonics((size_t)count(&v[Y]), v[Y].buf, mean, angle, (int)n_powers, v[POWERS].buf);
    Py_END_ALLOW_THREADS
    return done(&b);
}

PyObject *df_py_rank(PyObject *self, PyObject *args)
{
    (void)self;
    PyObject *o[1];
    Py_ssize_t rank;
    if (!PyArg_ParseTuple(args, "On:rank", &o[0], &rank))
        return NULL;
    buffers b;
    if (!borrow(&b, o, 1, 0))
        return NULL;
    const Py_ssize_t n = count(&b.view[0]);
    if (rank < 0 || rank >= n)
        return refused(&b, "rank: a rank below the count of values");
    double found;
    Py_BEGIN_ALLOW_THREADS
    found = df_rank((size_t)n, b.view[0].buf, (size_t)rank);
    Py_END_ALLOW_THREADS
    release(&b);
    return PyFloat_FromDouble(found);
}
