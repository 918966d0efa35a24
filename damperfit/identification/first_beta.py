"""What temperature does, as far as single settings tell it: where a fit of all settings begins.

A setting whose logs are all equally warm does not tell it, and one whose logs are not is missed
by a fit that knows nothing of it. So the settings with the widest range are fitted first.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from damperfit.damper.warmed import BETA

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from damperfit.identification.every_setting import Campaign
    from damperfit.identification.options import FitOptions
    from damperfit.identification.procedure_input import ProcedureInput
    from damperfit.recording import Trace

__all__ = ["with_first_beta"]

_ASKED = 3  # settings; their mean only has to be near
_WIDE = 3.0  # K within a setting that tell it anything


def with_first_beta(
    given: ProcedureInput, options: FitOptions, fit: Callable[[ProcedureInput], Campaign]
) -> FitOptions:
    """Return the options of a fit of single settings that hold beta at what some of them tell.

    Parameters
    ----------
    given : ProcedureInput
        All settings.
    options : FitOptions
        With beta among what is free.
    fit : callable
        The procedure that fits settings one by one.

    Raises
    ------
    FitCancelledError
        When the caller asked to stop.
    """
    beta = options.start.named.get(BETA.name, 0.0)
    reach = {setting: _range(traces) for setting, traces in given.settings.items()}
    telling = [one for one in sorted(reach, key=lambda s: -reach[s]) if reach[one] >= _WIDE]
    if telling:
        asked = {setting: given.settings[setting] for setting in sorted(telling[:_ASKED])}
        told = fit(replace(given, settings=asked, options=options, on_fit=lambda _: None))
        found = [one.parameters.beta for one in told.fits if one.outcome.is_minimum]
        beta = float(np.median(found)) if found else beta
    left = tuple(name for name in options.free or () if name != BETA.name)
    return replace(options, free=left, fixed={**options.fixed, BETA.name: beta})


def _range(traces: Sequence[Trace]) -> float:
    known = [trace.temperature for trace in traces if trace.temperature is not None]
    return max(known) - min(known) if known else 0.0
