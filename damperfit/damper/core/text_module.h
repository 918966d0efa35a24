/* Functions of text_module.c, for the table in module.c. */
#ifndef DAMPERFIT_TEXT_MODULE_H
#define DAMPERFIT_TEXT_MODULE_H

#include <Python.h>

PyObject *df_py_read_numbers(PyObject *self, PyObject *args);

#endif
