"""What somebody tells of one log, taken into it: tare, temperature, skew, gas pressure.

The log's own preamble tells it, [rig] before that, then the log's profile, the table of tests, and
the command line before all.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from damperfit.conditioning import condition
from damperfit.io.tests_table import facts_in

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from damperfit.conditioning import ConditionOptions
    from damperfit.configuration.options import Configuration
    from damperfit.io import TestRow
    from damperfit.recording import Recording, Trace


def facts_of(
    recording: Recording, path: Path, configuration: Configuration, row: TestRow | None
) -> tuple[dict[str, float], tuple[str, ...]]:
    """Return what is stated of one test, SI, by the nearest word, and which words say too little.

    Parameters
    ----------
    recording : Recording
        As logged.
    path : pathlib.Path
        Its file.
    configuration : Configuration
        [rig], profiles, and what was typed.
    row : TestRow or None
        Its row in the table of tests.
    """
    own, notes = facts_in(recording.metadata)
    if recording.temperature is not None:
        own.pop("temperature", None)
    reading = configuration.reading
    near, _ = reading.for_file(path.name)
    facts = {**own, **near.tested_at, **(row.facts if row else {})}
    for name in configuration.test.typed:
        facts.pop(name, None)
        if name in reading.tested_at:
            facts[name] = reading.tested_at[name]
    return facts, notes


def conditioned_as_tested(
    recording: Recording, options: ConditionOptions, facts: Mapping[str, float]
) -> Trace:
    """Return the trace of a recording with what is stated of this test alone.

    Parameters
    ----------
    recording : Recording
        As logged.
    options : ConditionOptions
        For all logs.
    facts : mapping of str to float
        Of this test, SI, temperature in degrees Celsius; empty: nothing is stated.
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
