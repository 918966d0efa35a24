/* An instance of FMI 3.0, as its two files know it. */
#ifndef DAMPERFIT_FMI3_COMPONENT_H
#define DAMPERFIT_FMI3_COMPONENT_H

#include "exported.h"
#include "fmi3_declarations.h"

typedef struct {
    ex_instance e;
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
} component;

/* Tell the importer what went wrong, and return the status. */
fmi3Status ex_fmi3_report(component *c, fmi3Status status, const char *what);
fmi3Status ex_fmi3_ended(fmi3Instance c, int code); /* the same of a code of ours */

#endif
