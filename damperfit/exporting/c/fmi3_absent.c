/* FMI 3.0: the functions for what an exported damper has none of, which importers look for all the
 * same: scheduled execution, other types of variables, clocks, dependencies by element. */
#include "fmi3_component.h"

FMI3_DOOR fmi3Instance FMI3(InstantiateScheduledExecution)(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible, fmi3Boolean logging,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, fmi3ClockUpdateCallback update,
    fmi3LockPreemptionCallback lock, fmi3UnlockPreemptionCallback unlock)
{
    (void)name, (void)token, (void)resources, (void)visible, (void)logging;
    (void)update, (void)lock, (void)unlock;
    if (log)
        log(environment, fmi3Error, "logStatusError", "scheduled execution is not offered: there are no clocks");
    return NULL;
}

/* Types of which there is no variable. */
#define NONE_OF(type)                                                                                       \
    FMI3_DOOR fmi3Status FMI3(Get##type)(fmi3Instance c, const fmi3ValueReference r[], size_t n,            \
                                         fmi3##type value[], size_t n_values)                               \
    {                                                                                                       \
        (void)r, (void)value, (void)n_values;                                                               \
        return ex_fmi3_ended(c, n ? EX_NO_VARIABLE : DF_OK);                                                        \
    }                                                                                                       \
    FMI3_DOOR fmi3Status FMI3(Set##type)(fmi3Instance c, const fmi3ValueReference r[], size_t n,            \
                                         const fmi3##type value[], size_t n_values)                         \
    {                                                                                                       \
        (void)r, (void)value, (void)n_values;                                                               \
        return ex_fmi3_ended(c, n ? EX_NO_VARIABLE : DF_OK);                                                        \
    }

NONE_OF(Float32)
NONE_OF(Int8)
NONE_OF(UInt8)
NONE_OF(Int16)
NONE_OF(UInt16)
NONE_OF(UInt32)
NONE_OF(Int64)
NONE_OF(UInt64)
NONE_OF(Boolean)
NONE_OF(String)

FMI3_DOOR fmi3Status FMI3(GetBinary)(fmi3Instance c, const fmi3ValueReference r[], size_t n, size_t sizes[],
                                     fmi3Binary value[], size_t n_values)
{
    (void)r, (void)sizes, (void)value, (void)n_values;
    return ex_fmi3_ended(c, n ? EX_NO_VARIABLE : DF_OK);
}

FMI3_DOOR fmi3Status FMI3(SetBinary)(fmi3Instance c, const fmi3ValueReference r[], size_t n, const size_t sizes[],
                                     const fmi3Binary value[], size_t n_values)
{
    (void)r, (void)sizes, (void)value, (void)n_values;
    return ex_fmi3_ended(c, n ? EX_NO_VARIABLE : DF_OK);
}

FMI3_DOOR fmi3Status FMI3(GetClock)(fmi3Instance c, const fmi3ValueReference r[], size_t n, fmi3Clock value[])
{
    (void)r, (void)value;
    return ex_fmi3_ended(c, n ? EX_NO_VARIABLE : DF_OK);
}

FMI3_DOOR fmi3Status FMI3(SetClock)(fmi3Instance c, const fmi3ValueReference r[], size_t n, const fmi3Clock value[])
{
    (void)r, (void)value;
    return ex_fmi3_ended(c, n ? EX_NO_VARIABLE : DF_OK);
}

FMI3_DOOR fmi3Status FMI3(GetIntervalDecimal)(fmi3Instance c, const fmi3ValueReference r[], size_t n,
                                              fmi3Float64 interval[], fmi3IntervalQualifier qualifier[])
{
    (void)r, (void)interval, (void)qualifier;
    return ex_fmi3_ended(c, n ? EX_NO_VARIABLE : DF_OK);
}

FMI3_DOOR fmi3Status FMI3(GetIntervalFraction)(fmi3Instance c, const fmi3ValueReference r[], size_t n,
                                               fmi3UInt64 counter[], fmi3UInt64 resolution[],
                                               fmi3IntervalQualifier qualifier[])
{
    (void)r, (void)counter, (void)resolution, (void)qualifier;
    return ex_fmi3_ended(c, n ? EX_NO_VARIABLE : DF_OK);
}

FMI3_DOOR fmi3Status FMI3(GetShiftDecimal)(fmi3Instance c, const fmi3ValueReference r[], size_t n, fmi3Float64 shift[])
{
    (void)r, (void)shift;
    return ex_fmi3_ended(c, n ? EX_NO_VARIABLE : DF_OK);
}

FMI3_DOOR fmi3Status FMI3(GetShiftFraction)(fmi3Instance c, const fmi3ValueReference r[], size_t n,
                                            fmi3UInt64 counter[], fmi3UInt64 resolution[])
{
    (void)r, (void)counter, (void)resolution;
    return ex_fmi3_ended(c, n ? EX_NO_VARIABLE : DF_OK);
}

FMI3_DOOR fmi3Status FMI3(SetIntervalDecimal)(fmi3Instance c, const fmi3ValueReference r[], size_t n,
                                              const fmi3Float64 interval[])
{
    (void)r, (void)interval;
    return ex_fmi3_ended(c, n ? EX_NO_VARIABLE : DF_OK);
}

FMI3_DOOR fmi3Status FMI3(SetIntervalFraction)(fmi3Instance c, const fmi3ValueReference r[], size_t n,
                                               const fmi3UInt64 counter[], const fmi3UInt64 resolution[])
{
    (void)r, (void)counter, (void)resolution;
    return ex_fmi3_ended(c, n ? EX_NO_VARIABLE : DF_OK);
}

FMI3_DOOR fmi3Status FMI3(SetShiftDecimal)(fmi3Instance c, const fmi3ValueReference r[], size_t n,
                                           const fmi3Float64 shift[])
{
    (void)r, (void)shift;
    return ex_fmi3_ended(c, n ? EX_NO_VARIABLE : DF_OK);
}

FMI3_DOOR fmi3Status FMI3(SetShiftFraction)(fmi3Instance c, const fmi3ValueReference r[], size_t n,
                                            const fmi3UInt64 counter[], const fmi3UInt64 resolution[])
{
    (void)r, (void)counter, (void)resolution;
    return ex_fmi3_ended(c, n ? EX_NO_VARIABLE : DF_OK);
}

FMI3_DOOR fmi3Status FMI3(ActivateModelPartition)(fmi3Instance c, fmi3ValueReference clock, fmi3Float64 time)
{
    (void)clock, (void)time;
    return ex_fmi3_ended(c, EX_NO_VARIABLE);
}

/* The model description tells them; by element there are none, for every variable is a scalar. */
FMI3_DOOR fmi3Status FMI3(GetNumberOfVariableDependencies)(fmi3Instance c, fmi3ValueReference r, size_t *n)
{
    (void)r;
    *n = 0;
    return ex_fmi3_report(c, fmi3Error, "dependencies stand in modelDescription.xml");
}

FMI3_DOOR fmi3Status FMI3(GetVariableDependencies)(fmi3Instance c, fmi3ValueReference dependent,
                                                   size_t elements[], fmi3ValueReference independents[],
                                                   size_t elements_of_them[], fmi3DependencyKind kinds[], size_t n)
{
    (void)dependent, (void)elements, (void)independents, (void)elements_of_them, (void)kinds, (void)n;
    return ex_fmi3_report(c, fmi3Error, "dependencies stand in modelDescription.xml");
}
