/* Functions of fitting_module.c, for the table in module.c. */
#ifndef DAMPERFIT_FITTING_MODULE_H
#define DAMPERFIT_FITTING_MODULE_H

#include <Python.h>

PyObject *df_py_fold(PyObject *self, PyObject *args);
PyObject *df_py_triangle(PyObject *self, PyObject *args);
PyObject *df_py_cycle_products(PyObject *self, PyObject *args);

#endif
