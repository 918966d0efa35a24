/* Buffers that Python lends: rows of doubles or of 64-bit integers. For the binding alone. */
#ifndef DAMPERFIT_BUFFERS_H
#define DAMPERFIT_BUFFERS_H

#include <Python.h>

enum { DF_MOST_BUFFERS = 12 };

typedef struct {
    Py_buffer view[DF_MOST_BUFFERS];
    int got;
} df_buffers;

static inline void df_release(df_buffers *b)
{
    while (b->got-- > 0)
        PyBuffer_Release(&b->view[b->got]);
}

/* Borrow n buffers; those from `written` on are written to. */
static inline int df_borrow(df_buffers *b, PyObject **objects, int n, int written)
{
    for (b->got = 0; b->got < n; b->got++) {
        const int flags = PyBUF_C_CONTIGUOUS | (b->got >= written ? PyBUF_WRITABLE : 0);
        if (PyObject_GetBuffer(objects[b->got], &b->view[b->got], flags)) {
            df_release(b);
            return 0;
        }
    }
    return 1;
}

static inline Py_ssize_t df_count(const Py_buffer *b)
{
    return b->len / (Py_ssize_t)sizeof(double);
}

static inline PyObject *df_refused(df_buffers *b, const char *what)
{
    df_release(b);
    PyErr_SetString(PyExc_ValueError, what);
    return NULL;
}

static inline PyObject *df_done(df_buffers *b)
{
    df_release(b);
    Py_RETURN_NONE;
}

#endif
