"""Recording to trace: uniform samples, filters, velocity, steady whole cycles.

`log_to_trace` is the chain. `timebase` says how stamps become uniform samples, `filters` what each
filter does and which stands where, `cycles` which cycles count, `segments` what is compared,
`drive` what drives the model, `noise` how much cycles differ, `polarity` and `gas_force` which way
the channels count, `delay` by how much the force is late, `findings` what is told of all this.
"""

from damperfit.conditioning.cycles import clean_cycles
from damperfit.conditioning.filters import apply_filter, design_filter, differentiate
from damperfit.conditioning.findings import examine_raw
from damperfit.conditioning.log_to_trace import condition
from damperfit.conditioning.noise import noise_floor
from damperfit.conditioning.options import ConditionOptions, GasFacts, NominalTest, OffsetFacts
from damperfit.conditioning.segments import TRANSIENTS, transients

__all__ = [
    "TRANSIENTS",
    "ConditionOptions",
    "GasFacts",
    "NominalTest",
    "OffsetFacts",
    "apply_filter",
    "clean_cycles",
    "condition",
    "design_filter",
    "differentiate",
    "examine_raw",
    "noise_floor",
    "transients",
]
