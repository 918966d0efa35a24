/* Functions of signals_module.c, for the table in module.c. */
#ifndef DAMPERFIT_SIGNALS_MODULE_H
#define DAMPERFIT_SIGNALS_MODULE_H

#include <Python.h>

PyObject *df_py_filter(PyObject *self, PyObject *args);
PyObject *df_py_spline_slopes(PyObject *self, PyObject *args);
PyObject *df_py_between(PyObject *self, PyObject *args);

#endif
