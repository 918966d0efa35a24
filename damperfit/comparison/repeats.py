"""The scatter over repeats of the reference as the measure of a difference.

A damper taken off the rig and put on again differs by more than its cycles do. With n runs of the
reference, itself among them, a further one falls within t s sqrt(1 + 1/n) of their mean in 95 of
100, where s is their standard deviation and t has n - 1 degrees of freedom.
"""

from __future__ import annotations

import math
from dataclasses import replace
from statistics import fmean, stdev
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from damperfit.comparison.reading import Reading, Topic

__all__ = ["by_repeats"]


def by_repeats(
    reference: Sequence[Mapping[Topic, Reading]], other: Mapping[Topic, Reading]
) -> tuple[dict[Topic, Reading], dict[Topic, Reading]]:
    """Return the reference's mean with its scatter as error, and the other run without errors.

    Parameters
    ----------
    reference : sequence of mapping
        Readings of the reference and of its repeats, at least two.
    other : mapping
        Readings of the run that is compared.
    """
    means, bare = {}, {}
    for subject, second in other.items():
        if not all(subject in table for table in reference):
            continue
        means[subject] = _mean(subject, [table[subject] for table in reference])
        bare[subject] = replace(second, error=0.0, repeat=0.0, misfit=0.0, misses=math.nan)
    return means, bare


def _mean(subject: Topic, readings: Sequence[Reading]) -> Reading:
    values, n = [one.value for one in readings], len(readings)
    objection = next((one.objection for one in readings if one.objection), "")
    wider = math.sqrt(1.0 + 1.0 / n)
    if not all(map(math.isfinite, values)):
        return replace(readings[0], value=math.nan, objection=objection)
    if subject.is_logarithmic and min(values) > 0.0:
        logs = [math.log(value) for value in values]
        mean = math.exp(fmean(logs))
        error = mean * stdev(logs) * wider
    else:
        mean, error = fmean(values), stdev(values) * wider
    return replace(
        readings[0],
        value=mean,
        error=error,
        freedom=float(n - 1),
        repeat=0.0,
        misfit=0.0,
        misses=math.nan,
        scale=fmean([one.scale for one in readings]),
        objection=objection,
    )
