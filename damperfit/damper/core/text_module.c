/* Python binding of text.h: bytes in, rows of doubles out, the GIL released while it runs. */
#define PY_SSIZE_T_CLEAN
#define Py_LIMITED_API 0x030B0000
#include <Python.h>

#include "buffers.h"
#include "text.h"
#include "text_module.h"

PyObject *df_py_read_numbers(PyObject *self, PyObject *args)
{
    (void)self;
    enum { TEXT, WANTED, VALUES, N };
    PyObject *o[N];
    Py_ssize_t start, n_names, n_fields;
    int separator, decimal;
    if (!PyArg_ParseTuple(args, "OOOnCCnn:read_numbers", &o[TEXT], &o[WANTED], &o[VALUES], &start,
                          &separator, &decimal, &n_names, &n_fields))
        return NULL;
    df_buffers b;
    if (!df_borrow(&b, o, N, VALUES))
        return NULL;
    const Py_buffer *v = b.view;
    const Py_ssize_t n_wanted = df_count(&v[WANTED]);
    const Py_ssize_t most = n_wanted > 0 ? df_count(&v[VALUES]) / n_wanted : 0;
    if (start < 0 || start > v[TEXT].len || n_wanted < 1 || df_count(&v[VALUES]) != n_wanted * most ||
        separator > 127 || decimal > 127)
        return df_refused(&b, "read_numbers: a place in the text, and a row of values for each column");
    const df_rows rows = {(char)separator, (char)decimal, (size_t)n_names, (size_t)n_fields,
                          (size_t)n_wanted, v[WANTED].buf};
    ptrdiff_t found;
    Py_BEGIN_ALLOW_THREADS
    found = df_read_numbers((size_t)(v[TEXT].len - start), (const char *)v[TEXT].buf + start, &rows,
                            (size_t)most, v[VALUES].buf);
    Py_END_ALLOW_THREADS
    df_release(&b);
    return PyLong_FromSsize_t((Py_ssize_t)found);
}
