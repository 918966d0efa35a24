"""What the data of a log show of its quality: findings with a severity, never a change of data."""

from __future__ import annotations

from typing import TYPE_CHECKING

from damperfit.conditioning.spectrum import looks_filtered
from damperfit.recording import Finding

if TYPE_CHECKING:
    from damperfit.conditioning.options import ConditionOptions
    from damperfit.conditioning.timebase import UniformLog

__all__ = ["examine"]


def examine(log: UniformLog, options: ConditionOptions) -> tuple[Finding, ...]:
    """Return what is remarkable in a log.

    Parameters
    ----------
    log : UniformLog
        Uniform, not yet filtered by us.
    options : ConditionOptions
        What was declared of the rig.
    """
    if options.rig_filter != "none":
        return ()
    if not looks_filtered(log.displacement, log.force, log.interval):
        return ()
    # Undeclared, a 30 Hz filter in the rig shifts parameters by up to 2.5 %.
    text = (
        "both channels look as if the rig had filtered them: if so, say rig.filter = "
        "'causal' or 'zero_phase' in the configuration, or every parameter is off by up to 2 %"
    )
    return (Finding("rig_filter", "warning", text),)
