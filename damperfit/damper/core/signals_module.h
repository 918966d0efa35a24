/* Functions of signals_module.c, for the table in module.c. */
#ifndef DAMPERFIT_SIGNALS_MODULE_H
#define DAMPERFIT_SIGNALS_MODULE_H

#include <Python.h>

PyObject *df_py_filter(PyObject *self, PyObject *args);
PyObject *df_py_behind_lag(PyObject *self, PyObject *args);
PyObject *df_py_spline_slopes(PyObject *self, PyObject *args);
PyObject *df_py_between(PyObject *self, PyObject *args);
PyObject *df_py_turns(PyObject *self, PyObject *args);
PyObject *df_py_without_smooth(PyObject *self, PyObject *args);
PyObject *df_py_steps(PyObject *self, PyObject *args);
PyObject *df_py_at_speeds(PyObject *self, PyObject *args);
PyObject *df_py_fold(PyObject *self, PyObject *args);
PyObject *df_py_triangle(PyObject *self, PyObject *args);

#endif
