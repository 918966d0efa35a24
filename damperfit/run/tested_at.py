"""What a table of tests tells of one log, taken into it: tare, temperature, skew, gas pressure."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from damperfit.conditioning import condition

if TYPE_CHECKING:
    from collections.abc import Mapping

    from damperfit.conditioning import ConditionOptions
    from damperfit.recording import Recording, Trace

__all__ = ["conditioned_as_tested"]


def conditioned_as_tested(
    recording: Recording, options: ConditionOptions, facts: Mapping[str, float]
) -> Trace:
    """Return the trace of a recording with what is told of this test alone.

    Parameters
    ----------
    recording : Recording
        As logged.
    options : ConditionOptions
        For all logs.
    facts : mapping of str to float
        Of the table of tests, SI, temperature in degrees Celsius; empty: nothing is told.
    """
    if "tare" in facts:
        recording = replace(recording, force=recording.force - facts["tare"])
    if "temperature" in facts:
        warmth = np.full(len(recording.time), facts["temperature"])
        recording = replace(recording, temperature=warmth)
    if "skew" in facts:
        options = replace(options, skew=facts["skew"])
    pressure = facts.get("gas_pressure")
    if pressure is not None and options.gas is not None:
        options = replace(options, gas=replace(options.gas, pressure=pressure))
    trace = condition(recording, options)
    return trace if pressure is None else replace(trace, gas_pressure=pressure)
