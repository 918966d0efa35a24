/* Drives text.c over every cut of some odd texts; a sanitizer ends the program. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "text.h"

static const char *const TEXTS[] = {
    "1,2,3\n-4.5,6e-2,\r\n\r7,8,9\n", "1e99999999999999999999,2,3\n", "9007199254740993,1,1\n",
    ",,\n , , \n-,1,1\n", "1,2\n", "1,2,3,4\n", "\n\n\n", "0.00000000000000000000001,1E+5,2e-\n"};

int main(void)
{
    static const int64_t wanted[][3] = {{0, 1, 2}, {1, 2, 0}, {2, 7, 9}};
    for (size_t which = 0; which < sizeof TEXTS / sizeof *TEXTS; which++)
        for (size_t n = 0; n <= strlen(TEXTS[which]); n++) {
            char *cut = malloc(n ? n : 1); /* of its own, so that a byte behind it is seen */
            memcpy(cut, TEXTS[which], n);
            for (size_t most = 0; most < 4; most++)
                for (size_t n_wanted = 1; n_wanted <= 3; n_wanted++)
                    for (size_t set = 0; set < 3; set++) {
                        double *values = malloc((n_wanted * most + 1) * sizeof *values);
                        const df_rows rows = {',', '.', set == 2 ? 2 : 3, 3, n_wanted, wanted[set]};
                        if (df_read_numbers(n, cut, &rows, most, values) > (ptrdiff_t)most)
                            abort();
                        free(values);
                    }
            free(cut);
        }
    puts("ok");
    return 0;
}
