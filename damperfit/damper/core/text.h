/* Rows of numbers in delimited text. */
#ifndef DAMPERFIT_TEXT_H
#define DAMPERFIT_TEXT_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* What the rows of a text are like: the fields of each, of which those from n_names on are empty,
   and the fields that are read (rising). */
typedef struct {
    char separator, decimal;
    size_t n_names, n_fields, n_wanted;
    const int64_t *wanted;
} df_rows;

/* Reads plain numbers, each the nearest double; blank fields are NaN, blank lines are left out.
   values: n_wanted rows of `most`. Returns how many rows there are; -1 where a row has other fields,
   a field is no plain number or has more digits than are exact here, or there is no more room. */
ptrdiff_t df_read_numbers(size_t n, const char *text, const df_rows *rows, size_t most,
                          double *values);

#ifdef __cplusplus
}
#endif
#endif
