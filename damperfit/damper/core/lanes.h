/* Four doubles side by side, as GCC and Clang make them of what the processor has. */
#ifndef DAMPERFIT_LANES_H
#define DAMPERFIT_LANES_H

#include <stdint.h>

#include "laws.h"

/* All of it is inline: nothing is handed over in a way that compilers differ in. */
#if !defined(__clang__)
#pragma GCC diagnostic ignored "-Wpsabi"
#endif

enum { DF_LANES = 4 };
typedef double lanes __attribute__((vector_size(32)));
typedef int64_t marks __attribute__((vector_size(32)));

DF_FOR_EACH_KIND lanes pick(marks m, lanes a, lanes b)
{
    return (lanes)((m & (marks)a) | (~m & (marks)b));
}

DF_FOR_EACH_KIND int any(marks m)
{
    return (m[0] | m[1] | m[2] | m[3]) != 0;
}

DF_FOR_EACH_KIND lanes size_of(lanes a)
{
    const marks sign = {INT64_MIN, INT64_MIN, INT64_MIN, INT64_MIN};
    return (lanes)((marks)a & ~sign);
}

DF_FOR_EACH_KIND lanes with_sign(lanes a, lanes of)
{
    const marks sign = {INT64_MIN, INT64_MIN, INT64_MIN, INT64_MIN};
    return (lanes)(((marks)a & ~sign) | ((marks)of & sign));
}

DF_FOR_EACH_KIND lanes all_of(double a)
{
    const lanes r = {a, a, a, a};
    return r;
}

/* One instruction where the compiler need not set errno: -fno-math-errno. */
DF_FOR_EACH_KIND lanes root_of(lanes a)
{
    lanes r;
    for (int l = 0; l < DF_LANES; l++)
        r[l] = sqrt(a[l]);
    return r;
}

DF_FOR_EACH_KIND lanes larger_of(lanes a, lanes b)
{
    return pick(a > b, a, b);
}

DF_FOR_EACH_KIND double largest(lanes a)
{
    double most = a[0];
    for (int l = 1; l < DF_LANES; l++)
        most = a[l] > most || a[l] != a[l] ? a[l] : most;
    return most;
}

#endif
