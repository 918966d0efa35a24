/* Steps an FMU 2.0 as a simulator does, 1 ms a step on the standard sine, and prints the processor's
 * time by step: tests/exporting/test_fmu_importers.py compiles and runs it. */
#include "fmi2_declarations.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

fmi2Component fmi2Instantiate(fmi2String, fmi2Type, fmi2String, fmi2String, const fmi2CallbackFunctions *, fmi2Boolean,
                              fmi2Boolean);
fmi2Status fmi2SetupExperiment(fmi2Component, fmi2Boolean, fmi2Real, fmi2Real, fmi2Boolean, fmi2Real);
fmi2Status fmi2EnterInitializationMode(fmi2Component);
fmi2Status fmi2ExitInitializationMode(fmi2Component);
fmi2Status fmi2SetReal(fmi2Component, const fmi2ValueReference[], size_t, const fmi2Real[]);
fmi2Status fmi2GetReal(fmi2Component, const fmi2ValueReference[], size_t, fmi2Real[]);
fmi2Status fmi2SetInteger(fmi2Component, const fmi2ValueReference[], size_t, const fmi2Integer[]);
fmi2Status fmi2DoStep(fmi2Component, fmi2Real, fmi2Real, fmi2Boolean);

int main(int n, char **arguments)
{
    const fmi2ValueReference inputs[] = {1, 2}, force = 3, setting = 8;
    const fmi2CallbackFunctions nothing = {NULL, NULL, NULL, NULL, NULL};
    const double w = 2.0 * 3.14159265358979323846 * 1.5, a = 0.032;
    double found = 0.0;
    const long steps = 200000;
    if (n < 4)
        return 2;
    const int wanted = atoi(arguments[3]);
    fmi2Component c = fmi2Instantiate("a", fmi2CoSimulation, arguments[1], arguments[2], &nothing, 0, 0);
    if (!c)
        return 3;
    fmi2SetInteger(c, &setting, 1, &wanted);
    fmi2SetupExperiment(c, 0, 0.0, 0.0, 0, 0.0);
    fmi2EnterInitializationMode(c);
    const double first[] = {0.0, a * w};
    fmi2SetReal(c, inputs, 2, first);
    fmi2ExitInitializationMode(c);
    const clock_t begun = clock();
    for (long i = 0; i < steps; i++) {
        const double t = 1e-3 * (double)i, now[] = {a * sin(w * t), a * w * cos(w * t)};
        fmi2SetReal(c, inputs, 2, now);
        if (fmi2DoStep(c, t, 1e-3, 1) != fmi2OK)
            return 4;
        fmi2GetReal(c, &force, 1, &found);
    }
    printf("%.9g %.9g\n", (double)(clock() - begun) / CLOCKS_PER_SEC / (double)steps, found);
    return 0;
}
