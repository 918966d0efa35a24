/* The file that an exported damper is read from. */
#ifndef DAMPERFIT_READING_H
#define DAMPERFIT_READING_H

#include "exported.h"

/* Fill `damper` from the text of damper.txt; 0 and a sentence where it is none. */
int ex_parse(const char *text, ex_damper *damper, char *why);

/* The text of damper.txt in a folder that is given as a path or as a file URI; NULL: not there. To
 * be freed. */
char *ex_read_text(const char *folder);

#endif
