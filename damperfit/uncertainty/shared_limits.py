"""What all settings share and none determines: the limit on the side that the logs do exclude.

A mounting that no log shows give ends at the upper edge of its range, where a change of it does
nothing: the quadratic approximation then excludes no value. Softer ones do fit worse, and a short
walk with all settings refitted says from where on.
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

from damperfit.errors import FitCancelledError, SimulationError
from damperfit.identification.fit_setting import NOT_FIT_TO_SHARE
from damperfit.statistics import NORMAL_95
from damperfit.uncertainty.profile_walk import profile_jointly
from damperfit.uncertainty.profiles import Stride, squared_error

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from damperfit.identification import Fit, Sharing
    from damperfit.tested.setting import Setting
    from damperfit.uncertainty.intervals import Uncertainty
    from damperfit.uncertainty.linearisation import Linearisation
    from damperfit.uncertainty.profiles import Bench, MisfitProfile

__all__ = ["shared_limits"]

# A look at the limits alone, a little beyond them.
_STEP, _REACH = 1.05 * NORMAL_95, NORMAL_95
# Simulations of the settings that it may cost, over those of their fits.
_SHARE = 0.7


def shared_limits(
    linearised: Sequence[Linearisation],
    known: Mapping[Setting, Uncertainty],
    sharing: Sharing,
    bench: Bench,
) -> Iterator[MisfitProfile]:
    """Yield short profiles of what a joint fit shares and its logs do not determine.

    Parameters
    ----------
    linearised : sequence of Linearisation
        Of all settings.
    known : mapping of Setting to Uncertainty
        Their errors.
    sharing : Sharing
        What was shared.
    bench : Bench
        Damper, solver, cancellation.
    """
    budget = int(_SHARE * sum(one.fit.evaluations for one in linearised))
    # The law of K_e has numbers of the gas, which are none of a setting.
    for unknown in (one for one in sharing.unknowns if one.name in sharing.jointly):
        having = [one.fit for one in linearised if unknown.holds_at(one.fit.setting)]
        if not having or not _is_lost(having[0], known, unknown.name):
            continue
        own = known[having[0].setting]
        error = math.sqrt(squared_error(own, unknown.name))
        # By as much of 1/y as an error of it: a value at its edge is far from where it matters.
        stride = Stride(_STEP, _REACH, budget, math.log1p(_STEP * error))
        with suppress(SimulationError, FitCancelledError):
            found = profile_jointly(unknown, linearised, own, sharing, bench, stride=stride)
            told = {one.setting: one for one in found}
            for fit in having:  # also one that was no part of it, for it has the same value
                one = told.get(fit.setting, found[0])
                yield replace(one, setting=fit.setting, is_shared=True, is_doubtful=True)


def _is_lost(fit: Fit, known: Mapping[Setting, Uncertainty], name: str) -> bool:
    """Whether its logs do not determine it, by the fit's rough error or by that of noise."""
    one, quantity = known[fit.setting], fit.parameters.quantity(name)
    place = one.names.index(name)
    error = math.sqrt(abs(float(one.covariance[place, place])))
    is_loose = error > NOT_FIT_TO_SHARE or fit.status[name].has_failed
    return quantity.is_logarithmic and is_loose
