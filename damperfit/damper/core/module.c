/* Python binding of the core: buffers of doubles in and out, the GIL released while it runs. */
#define PY_SSIZE_T_CLEAN
#define Py_LIMITED_API 0x030B0000
#include <Python.h>

#include "buffers.h"
#include "hysteresis.h"
#include "network.h"
#include "signals_module.h"

enum { BODY, NUMBERS, PASSAGES, NET_X, NET_V, NET_JUMPS, NET_WHICH, NET_PRESSURES, NET_MASSES, NET_FORCE,
       NET_SENSITIVITIES, NET_STATE, N_NETWORK_BUFFERS };

static const char *const NETWORK_NAMES[N_NETWORK_BUFFERS] = {
    "body", "numbers", "passages", "displacement", "velocity", "jumps", "which",
    "pressures", "masses", "force", "sensitivities", "state"};

/* Rows of integers: from, to, the places of a law's terms, two_way. */
#define PASSAGE_ROW (DF_TERMS + 3)

static int sizes_are(const Py_buffer *b, const char *const *names, const Py_ssize_t *expected, int n)
{
    for (int k = 0; k < n; k++) {
        if (b[k].len != expected[k]) {
            PyErr_Format(PyExc_ValueError, "%s: %zd bytes, expected %zd", names[k], b[k].len, expected[k]);
            return 0;
        }
    }
    return 1;
}

static int network_sizes_fit(const Py_buffer *b)
{
    const Py_ssize_t d = (Py_ssize_t)sizeof(double), row = b[NET_X].len;
    const Py_ssize_t n_which = b[NET_WHICH].len / (Py_ssize_t)sizeof(int);
    const Py_ssize_t expected[N_NETWORK_BUFFERS] = {
        6 * d, b[NUMBERS].len, b[PASSAGES].len, row - row % d, row,
        b[NET_JUMPS].len - b[NET_JUMPS].len % (Py_ssize_t)sizeof(df_jump), n_which * (Py_ssize_t)sizeof(int),
        3 * row, 2 * row, row, n_which * row, b[NET_STATE].len < (Py_ssize_t)sizeof(df_network_state) ? 0 : b[NET_STATE].len};
    if (!sizes_are(b, NETWORK_NAMES, expected, N_NETWORK_BUFFERS))
        return 0;
    if (b[NUMBERS].len % d == 0 && b[NUMBERS].len <= DF_MOST_NUMBERS * d &&
        b[PASSAGES].len % (Py_ssize_t)(PASSAGE_ROW * sizeof(int)) == 0 &&
        b[PASSAGES].len <= (Py_ssize_t)(DF_MOST_PASSAGES * PASSAGE_ROW * sizeof(int)))
        return 1;
    PyErr_Format(PyExc_ValueError, "a network has at most %d passages and %d numbers", DF_MOST_PASSAGES,
                 DF_MOST_NUMBERS);
    return 0;
}

/* The last sample of a state that goes on from where it is; a motion of one sample begins it. */
static int step_network(df_network *q, const df_options *o, const df_motion *m, const df_result *r,
                        df_network_state *now, df_work *work)
{
    if (m->n < 1)
        return DF_BAD_ARGUMENT;
    const size_t i = m->n - 1;
    work->failed_sample = i;
    int code = i ? df_plan_network(q) : df_begin_network(q, o, m->x[0], m->v[0], NULL, 0, now);
    if (code == DF_OK && i)
        code = df_advance_network(q, o, m->x[i], m->v[i], m->interval, now, work);
    if (code != DF_OK)
        return code;
    r->force[i] = df_force_network(q, o, now, NULL);
    for (size_t k = 0; k < 3; k++)
        r->pressures[k * m->n + i] = now->b.P[k];
    return DF_OK;
}

static PyObject *run_network(const Py_buffer *b, double interval, double rounding, int floating,
                             const df_options *options)
{
    const double *body = b[BODY].buf, *numbers = b[NUMBERS].buf;
    const int *rows = b[PASSAGES].buf;
    df_network q = {body[0], body[1], body[2], body[3], body[4], body[5], rounding, floating,
                    (int)(b[PASSAGES].len / (Py_ssize_t)(PASSAGE_ROW * sizeof(int))), {{0}},
                    (int)(b[NUMBERS].len / (Py_ssize_t)sizeof(double)), {0}};
    for (int k = 0; k < q.n_passages; k++, rows += PASSAGE_ROW) {
        df_passage *passage = &q.passages[k];
        passage->from = rows[0];
        passage->to = rows[1];
        memcpy(passage->places, rows + 2, sizeof passage->places);
        passage->two_way = rows[2 + DF_TERMS];
    }
    for (int k = 0; k < q.n_numbers; k++)
        q.numbers[k] = numbers[k];
    const df_motion motion = {(size_t)b[NET_X].len / sizeof(double), interval, b[NET_X].buf, b[NET_V].buf,
                              (size_t)b[NET_JUMPS].len / sizeof(df_jump), b[NET_JUMPS].buf};
    const df_result result = {b[NET_PRESSURES].buf, b[NET_MASSES].buf, b[NET_FORCE].buf,
                              b[NET_SENSITIVITIES].buf, b[NET_WHICH].buf,
                              (int)(b[NET_WHICH].len / (Py_ssize_t)sizeof(int))};
    df_work work = {0};
    int code;
    Py_BEGIN_ALLOW_THREADS
    code = b[NET_STATE].len ? step_network(&q, options, &motion, &result, b[NET_STATE].buf, &work)
                            : df_simulate_network(&q, options, &motion, &result, &work);
    Py_END_ALLOW_THREADS
    return Py_BuildValue("(illln)", code, work.steps, work.rejected, work.newton,
                         (Py_ssize_t)work.failed_sample);
}

static PyObject *simulate_network(PyObject *self, PyObject *args)
{
    (void)self;
    PyObject *o[N_NETWORK_BUFFERS];
    double interval, rounding;
    int floating;
    df_options options;
    o[NET_STATE] = NULL;
    if (!PyArg_ParseTuple(args, "OOOOOOOOOOOddpddl|O:simulate_network", &o[0], &o[1], &o[2], &o[3], &o[4],
                          &o[5], &o[6], &o[7], &o[8], &o[9], &o[10], &interval, &rounding, &floating,
                          &options.tolerance, &options.dead_band, &options.max_steps_per_sample, &o[NET_STATE]))
        return NULL;
    df_buffers b;
    b.view[NET_STATE].len = 0;
    if (!df_borrow(&b, o, o[NET_STATE] ? N_NETWORK_BUFFERS : NET_STATE, NET_PRESSURES))
        return NULL;
    PyObject *answer =
        network_sizes_fit(b.view) ? run_network(b.view, interval, rounding, floating, &options) : NULL;
    df_release(&b);
    return answer;
}

enum { STATE_NUMBERS, LAYOUT, STATE_X, STATE_V, STATE, STATE_SLOPES, N_STATE_BUFFERS };

static const char *const STATE_NAMES[N_STATE_BUFFERS] = {"numbers",  "layout", "displacement",
                                                         "velocity", "force",  "slopes"};

/* Places of stiffness, play and half length, then rows of is_rebound, p_open, R, S. */
#define LAYOUT_HEAD 3
#define PATH_ROW 4

static int state_sizes_fit(const Py_buffer *b)
{
    const Py_ssize_t d = (Py_ssize_t)sizeof(double), row = b[STATE_X].len;
    const Py_ssize_t width = b[STATE_NUMBERS].len / d;
    const Py_ssize_t expected[N_STATE_BUFFERS] = {
        width * d, b[LAYOUT].len, row - row % d, row, row, width * row};
    if (!sizes_are(b, STATE_NAMES, expected, N_STATE_BUFFERS))
        return 0;
    const Py_ssize_t n = b[LAYOUT].len / (Py_ssize_t)sizeof(int) - LAYOUT_HEAD;
    if (n == -LAYOUT_HEAD ? width == DF_N_BOUC_WEN
                          : n >= 0 && n % PATH_ROW == 0 && n / PATH_ROW <= DF_MOST_PATHS &&
                                width <= DF_MOST_STATE_NUMBERS)
        return 1;
    PyErr_SetString(PyExc_ValueError, "layout: neither a dashpot's nor empty for three numbers");
    return 0;
}

static int places_fit(const df_elastic_dashpot *d)
{
    int fit = d->stiffness >= 0 && d->stiffness < d->n_numbers && d->play < d->n_numbers &&
              d->half_length < d->n_numbers;
    for (int k = 0; k < d->n_paths; k++)
        fit = fit && d->paths[k].p_open < d->n_numbers && d->paths[k].R < d->n_numbers &&
              d->paths[k].S < d->n_numbers;
    if (!fit)
        PyErr_SetString(PyExc_ValueError, "layout: a place beyond the numbers");
    return fit;
}

/* A dashpot where there is a layout, otherwise Bouc and Wen's variable. */
static PyObject *run_state(const Py_buffer *b, double interval, double rounding)
{
    const double *numbers = b[STATE_NUMBERS].buf;
    const int *rows = b[LAYOUT].buf;
    const df_motion motion = {(size_t)b[STATE_X].len / sizeof(double), interval, b[STATE_X].buf,
                              b[STATE_V].buf, 0, NULL};
    const int is_dashpot = b[LAYOUT].len > 0;
    df_elastic_dashpot d = {0};
    if (is_dashpot) {
        d.stiffness = rows[0], d.play = rows[1], d.half_length = rows[2];
        d.n_paths = (int)((b[LAYOUT].len / (Py_ssize_t)sizeof(int) - LAYOUT_HEAD) / PATH_ROW);
        d.n_numbers = (int)(b[STATE_NUMBERS].len / (Py_ssize_t)sizeof(double));
        d.rounding = rounding;
        rows += LAYOUT_HEAD;
        for (int k = 0; k < d.n_paths; k++, rows += PATH_ROW) {
            const df_path path = {rows[0], rows[1], rows[2], rows[3]};
            d.paths[k] = path;
        }
        for (int k = 0; k < d.n_numbers; k++)
            d.numbers[k] = numbers[k];
        if (!places_fit(&d))
            return NULL;
    }
    size_t sample = 0;
    int code;
    Py_BEGIN_ALLOW_THREADS
    code = is_dashpot
               ? df_follow_dashpot(&d, &motion, b[STATE].buf, b[STATE_SLOPES].buf, &sample)
               : df_follow_bouc_wen(numbers, &motion, b[STATE].buf, b[STATE_SLOPES].buf, &sample);
    Py_END_ALLOW_THREADS
    return Py_BuildValue("(in)", code, (Py_ssize_t)sample);
}

static PyObject *follow(PyObject *self, PyObject *args)
{
    (void)self;
    PyObject *o[N_STATE_BUFFERS];
    double interval, rounding;
    if (!PyArg_ParseTuple(args, "OOOOOOdd:follow", &o[0], &o[1], &o[2], &o[3], &o[4], &o[5],
                          &interval, &rounding))
        return NULL;
    df_buffers b;
    if (!df_borrow(&b, o, N_STATE_BUFFERS, STATE))
        return NULL;
    PyObject *answer = state_sizes_fit(b.view) ? run_state(b.view, interval, rounding) : NULL;
    df_release(&b);
    return answer;
}

static PyMethodDef METHODS[] = {
    {"simulate_network", simulate_network, METH_VARARGS,
     "simulate_network(body, numbers, passages, displacement, velocity, jumps, which, pressures,\n"
     "                 masses, force, sensitivities, interval, rounding, floating_piston,\n"
     "                 tolerance, dead_band, max_steps_per_sample[, state])\n"
     "-> (code, steps, rejected, newton, sample). Fills the last five buffers; with a state the last\n"
     "sample alone, from where it is, or begins it where there is one sample."},
    {"follow", follow, METH_VARARGS,
     "follow(numbers, layout, displacement, velocity, force, slopes, interval, rounding)\n"
     "-> (code, sample). Fills force and its slopes, a row of numbers for each sample."},
    {"run_filter", df_py_filter, METH_VARARGS,
     "run_filter(sections, steady, signal, result, scratch, rows, pad, way)\n"
     "Filters each row; way 1 forward, -1 backward, 0 both with its ends reflected over pad."},
    {"behind_lag", df_py_behind_lag, METH_VARARGS,
     "behind_lag(signals, result, rows, a, b, c)\nFills each row behind a first-order lag."},
    {"spline_slopes", df_py_spline_slopes, METH_VARARGS,
     "spline_slopes(samples, slopes, scratch)\nFills the slopes of the spline, by sample."},
    {"between", df_py_between, METH_VARARGS,
     "between(signal, positions, values, rows)\nFills each row's values at fractional samples."},
    {"turns", df_py_turns, METH_VARARGS,
     "turns(x, turns, reach) -> n. Fills the samples (64-bit integers) at which x turns."},
    {"without_smooth", df_py_without_smooth, METH_VARARGS,
     "without_smooth(lag, force, columns, sums, reach, kink) -> power\n"
     "Fills smooth columns square to each other, what they leave of the force, and their sums."},
    {"steps", df_py_steps, METH_VARARGS,
     "steps(lag, columns, sums, delays, rest, heights, scratch, power, width, least)\n"
     "Fills what a step at each delay leaves, and its height."},
    {"at_speeds", df_py_at_speeds, METH_VARARGS,
     "at_speeds(v, speeds, rows, counts, means, squares, sign)\n"
     "Fills what rows are where sign v passes rising speeds, on the way up and on the way down."},
    {"triangle", df_py_triangle, METH_VARARGS,
     "triangle(columns, triangle, width)\nFills R of the columns, which are written over."},
    {"fold", df_py_fold, METH_VARARGS,
     "fold(x, v, f, starts, means, beside, room)\n"
     "Fills the mean cycle of three channels, and squares of the force beside it."},
    {NULL, NULL, 0, NULL}};

/* Two phases, so that every interpreter of a process has a module of its own. From 3.12 on one with
   a lock of its own needs to be told that this will do; 3.11 refuses slots that it does not know,
   and this file is compiled once for both. */
enum { MULTIPLE_INTERPRETERS = 3 }; /* Py_mod_multiple_interpreters */
#define PER_INTERPRETER_GIL ((void *)2) /* Py_MOD_PER_INTERPRETER_GIL_SUPPORTED */

static PyModuleDef_Slot SLOTS[] = {{MULTIPLE_INTERPRETERS, PER_INTERPRETER_GIL}, {0, NULL}};
static PyModuleDef_Slot NO_SLOTS[] = {{0, NULL}};

#define DEFINITION(slots) \
    {PyModuleDef_HEAD_INIT, "_core", "The compiled damper model.", 0, METHODS, slots, NULL, NULL, NULL}
static struct PyModuleDef MODULE = DEFINITION(SLOTS);
static struct PyModuleDef MODULE_3_11 = DEFINITION(NO_SLOTS);

PyMODINIT_FUNC PyInit__core(void)
{
    return PyModuleDef_Init(Py_Version >= 0x030C0000 ? &MODULE : &MODULE_3_11);
}
