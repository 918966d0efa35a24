"""Displacement and force behind the filter, and the filter that a simulated force must pass.

Which filter stands where (C is one causal pass, C* the same pass run backward in time, Z the
zero-phase filter; x and f are what the rig's sensors saw)::

    rig_filter   filter       displacement of the trace   force of the trace   model_filter
    none         none         x                           f                    -
    none         zero_phase   Z x                         Z f                  Z
    none         causal       C* C x                      C* C f               C* C
    zero_phase   (not used)   as logged, C* C x           as logged, C* C f    C* C
    causal       (not used)   C* (logged)  = C* C x       C* (logged)          C* C

A model driven by an already delayed displacement must not be delayed again, and one displacement
cannot be both late (beside the late force) and in time (for the model). So a causal pass, the
rig's or ours, is completed by its backward pass: both channels come back in time, loops are
aligned, and the model's force passes the completed filter. ``filter = "causal"`` thus treats a
raw log exactly as ``rig_filter = "causal"`` treats one that the rig has filtered.

C is the bilinear design at the log's rate. A rig whose filter is analogue, or digital at a much
higher rate, differs from it near half the log's rate: without noise that costs up to 0.3 % of a
parameter at 500 Hz, 0.06 % at 1 kHz (`tests/test_told_figures.py`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from damperfit.conditioning.derivatives import differentiate
from damperfit.conditioning.filters import (
    apply_filter,
    complete_causal,
    completed,
    design_filter,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from damperfit.conditioning.options import ConditionOptions
    from damperfit.conditioning.timebase import UniformLog
    from damperfit.recording import FilterDesign

    FloatArray = NDArray[np.float64]

__all__ = ["FilteredLog", "behind_filter"]


class FilteredLog(NamedTuple):
    """A log and what is seen of it behind the filter: m, N, m/s."""

    log: UniformLog
    displacement: FloatArray
    force: FloatArray
    velocity: FloatArray
    model_filter: FilterDesign


def behind_filter(log: UniformLog, options: ConditionOptions) -> FilteredLog:
    """Return both channels behind the filter, and the filter for the model.

    Parameters
    ----------
    log : UniformLog
        As logged.
    options : ConditionOptions
        What is to be filtered, and what the rig has filtered.

    Raises
    ------
    ConditioningError
        The corner is not below half the sample rate.
    """
    displacement, force, design = _filtered(log, options)
    return FilteredLog(log, displacement, force, differentiate(displacement, log.interval), design)


def _filtered(
    log: UniformLog, options: ConditionOptions
) -> tuple[FloatArray, FloatArray, FilterDesign]:
    """Return displacement, force, and the filter for the model (table in the module's text)."""
    rate = 1.0 / log.interval
    channels = np.stack([log.displacement, log.force])
    if options.rig_filter == "none" and options.filter != "causal":
        design = design_filter(
            options.filter, options.filter_corner, sample_rate=rate, order=options.filter_order
        )
        channels = apply_filter(design, channels)
        return channels[0], channels[1], design
    if options.rig_filter == "none":
        corner, order = options.filter_corner, options.filter_order
    else:
        corner, order = options.rig_filter_corner, options.rig_filter_order
    section = "conditioning" if options.rig_filter == "none" else "rig"
    design = design_filter(
        "causal", corner, sample_rate=rate, order=order, key=f"{section}.filter_corner"
    )
    if options.rig_filter == "none":
        channels = apply_filter(design, channels)
    if options.rig_filter != "zero_phase":
        channels = complete_causal(design, channels)
    return channels[0], channels[1], completed(design, corner, order)
