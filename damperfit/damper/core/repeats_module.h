/* Functions of repeats_module.c, for the table in module.c. */
#ifndef DAMPERFIT_REPEATS_MODULE_H
#define DAMPERFIT_REPEATS_MODULE_H

#include <Python.h>

PyObject *df_py_without_smooth(PyObject *self, PyObject *args);
PyObject *df_py_steps(PyObject *self, PyObject *args);
PyObject *df_py_at_speeds(PyObject *self, PyObject *args);
PyObject *df_py_scatter(PyObject *self, PyObject *args);
PyObject *df_py_beside(PyObject *self, PyObject *args);
PyObject *df_py_strokes(PyObject *self, PyObject *args);
PyObject *df_py_fold(PyObject *self, PyObject *args);
PyObject *df_py_triangle(PyObject *self, PyObject *args);

#endif
