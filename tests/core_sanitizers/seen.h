/* All that a driver sees, as one number: what is read but was never set shows as a change of it. */
#ifndef DF_TESTS_SEEN_H
#define DF_TESTS_SEEN_H

#include <stdio.h>
#include <string.h>

static unsigned long long seen = 14695981039346656037ULL;

static void see(const double *a, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        unsigned char bytes[sizeof(double)];
        memcpy(bytes, &a[i], sizeof bytes);
        for (size_t k = 0; k < sizeof bytes; k++)
            seen = (seen ^ bytes[k]) * 1099511628211ULL;
    }
}

static void tell_what_was_seen(void) { printf("seen %016llx\n", seen); }

#endif
