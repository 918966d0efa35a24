"""Recording to trace: uniform samples, filters, velocity, steady whole cycles.

`log_to_trace` is the chain. `timebase` says how stamps become uniform samples, `filters` what each
filter does and which stands where, `cycles` which cycles count, `segments` what is compared,
`drive` what drives the model, `noise` how much cycles differ, `polarity` which way
the channels count, `delay` by how much the force is late, `findings` what is found of all this.
"""

from damperfit.door import door

__getattr__ = door(
    __name__, "options", "log_to_trace", "cycles", "filters", "findings", "noise", "segments"
)
