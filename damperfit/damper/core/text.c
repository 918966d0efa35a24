/* Rows of numbers in delimited text. No allocation, no globals that change, no locale, re-entrant. */
#include "text.h"

#include <float.h>
#include <math.h>

/* Whole numbers and powers of ten up to these are doubles, and one product or quotient of two
   doubles is rounded once: the nearest double to what is written. */
static const uint64_t MOST_WHOLE = (uint64_t)1 << 53;
enum { MOST_TENS = 22, MOST_EXPONENT = 999 };
static const double TENS[MOST_TENS + 1] = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,
                                           1e8,  1e9,  1e10, 1e11, 1e12, 1e13, 1e14, 1e15,
                                           1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};

static int is_digit(char c)
{
    return c >= '0' && c <= '9';
}

static int is_line_end(char c)
{
    return c == '\n' || c == '\r';
}

/* Digits behind a whole number; how many, or -1 where there are more than are exact. */
static int add_digits(const char **at, const char *end, uint64_t *whole)
{
    int n = 0;
    for (; *at < end && is_digit(**at); ++*at, n++) {
        if (*whole > (MOST_WHOLE - 9) / 10)
            return -1;
        *whole = *whole * 10 + (uint64_t)(**at - '0');
    }
    return n;
}

/* Reads [-]digits[mark digits][e[+-]digits] in blanks, or nothing; 0 where it is something else. */
static int read_number(const char **at, const char *end, const df_rows *rows, double *value)
{
    uint64_t whole = 0;
    int tens = 0;
    while (*at < end && **at == ' ')
        ++*at;
    if (*at == end || **at == rows->separator || is_line_end(**at)) {
        *value = NAN;
        return 1;
    }
    const int is_negative = **at == '-';
    *at += is_negative;
    if (add_digits(at, end, &whole) < 1)
        return 0;
    if (*at < end && **at == rows->decimal) {
        ++*at;
        const int behind = add_digits(at, end, &whole);
        if (behind < 1)
            return 0;
        tens = -behind;
    }
    if (*at < end && (**at == 'e' || **at == 'E')) {
        ++*at;
        const int is_down = *at < end && **at == '-';
        *at += *at < end && (**at == '-' || **at == '+');
        uint64_t power = 0;
        if (add_digits(at, end, &power) < 1 || power > MOST_EXPONENT)
            return 0;
        tens += is_down ? -(int)power : (int)power;
    }
    while (*at < end && **at == ' ')
        ++*at;
    if (tens < -MOST_TENS || tens > MOST_TENS)
        return 0;
    const double size = tens < 0 ? (double)whole / TENS[-tens] : (double)whole * TENS[tens];
    *value = is_negative ? -size : size;
    return 1;
}

/* Reads one row into a column of values; 0 where it is not as the others are to be. */
static int read_row(const char **at, const char *end, const df_rows *rows, size_t most,
                    double *values)
{
    size_t next = 0;
    for (size_t field = 0; field < rows->n_fields; field++) {
        if (next < rows->n_wanted && (uint64_t)rows->wanted[next] == field) {
            if (!read_number(at, end, rows, values + next * most))
                return 0;
            next++;
        } else if (field < rows->n_names)
            while (*at < end && **at != rows->separator && !is_line_end(**at))
                ++*at;
        const int is_last = field + 1 == rows->n_fields;
        if (is_last ? *at < end && !is_line_end(**at) : *at == end || **at != rows->separator)
            return 0;
        *at += !is_last;
    }
    return next == rows->n_wanted;
}

ptrdiff_t df_read_numbers(size_t n, const char *text, const df_rows *rows, size_t most,
                          double *values)
{
    const char *at = text, *end = text + n;
    size_t found = 0;
    if (FLT_EVAL_METHOD != 0) /* where more digits are carried, a quotient is rounded twice */
        return -1;
    while (at < end) {
        if (is_line_end(*at)) {
            at++;
            continue;
        }
        if (found == most || !read_row(&at, end, rows, most, values + found))
            return -1;
        found++;
    }
    return (ptrdiff_t)found;
}
