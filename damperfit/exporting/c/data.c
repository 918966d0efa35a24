/* In the library that is built once: no damper. Export writes another file of this name beside it. */
#include "exported.h"

const char damperfit_data[] = "";
