"""A verdict on each parameter of a setting, in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from damperfit.damper.parameters import PARAMETER_NAMES

if TYPE_CHECKING:
    from damperfit.identification import Fit
    from damperfit.uncertainty.intervals import Uncertainty

__all__ = ["verdicts"]

# At this correlation knowing the one would shrink the error of the other to a third.
_CORRELATED = 0.95


def verdicts(fit: Fit, known: Uncertainty) -> dict[str, str]:
    """Return one sentence for each parameter: how it was found, how well, tied to which other.

    Parameters
    ----------
    fit : Fit
        The setting's fit.
    known : Uncertainty
        The same setting's intervals.
    """
    return {name: _verdict(name, fit, known) for name in PARAMETER_NAMES}


def _verdict(name: str, fit: Fit, known: Uncertainty) -> str:
    status = fit.status[name]
    if status == "fixed":
        return "held at the value given"
    if status == "at_bound":
        return "ran to the edge of its plausible range; fix it, or check units and signs"
    interval = known.intervals.get(name)
    if interval is None:
        return "no interval: the fit did not end at a minimum"
    where = f"95 % from {interval.low:.4g} to {interval.high:.4g}"
    tied = _tied(name, known)
    if status == "not_identifiable":
        return f"these logs do not tell it ({where}{tied}); fix it, or fit more logs"
    found = "shared by all settings" if status == "shared" else "fitted"
    return f"{found}, {where}{tied}"


def _tied(name: str, known: Uncertainty) -> str:
    row = known.correlation[known.names.index(name)].copy()
    row[known.names.index(name)] = 0.0
    if not len(row) or not np.max(np.abs(row)) > _CORRELATED:
        return ""
    partner = int(np.argmax(np.abs(row)))
    return f", correlated with {known.names[partner]} ({row[partner]:+.2f})"
