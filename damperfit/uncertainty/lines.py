"""Which profiles there are: of a setting's own parameters, and of those found for all settings.

An own parameter is profiled beside the others of its setting, with the shared ones as they are; the
scale of the rise carries their errors (see `profiles`). A shared one is profiled where the logs
gave it: R_m3 of procedure `paper` at its setting, f_f at each setting of its mean with everything
free, and those of procedure `joint` over all settings at once.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from damperfit.damper.parameters import PARAMETER_NAMES
from damperfit.identification.descent import Misfit
from damperfit.simulation import SolverOptions
from damperfit.uncertainty.intervals import own_names, solved
from damperfit.uncertainty.profile_walk import Line, trace_profile
from damperfit.uncertainty.profiles import OFFSET_UNIT, MisfitProfile, Stride

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from damperfit.damper.parameters import Damper
    from damperfit.identification import Fit, Sharing
    from damperfit.uncertainty.information import Evidence
    from damperfit.uncertainty.intervals import Uncertainty

__all__ = ["Bench", "doubtful_profiles", "is_doubtful", "lines_of"]

# Above this standard error of ln y the profile's limits leave those of the quadratic approximation
# by a tenth of their distance (4 N and 200 N of noise, K_e at settings 1, 10 and 20).
_DOUBTFUL = 0.1
# A look at the two limits alone: three simulations where the quadratic approximation is near.
_QUICK_STEP, _QUICK_REACH = 2.05, 1.96
# What it may cost at a setting: a share of what its fit has, which is ten simulations or more.
_QUICK_SHARE, _QUICK_LEAST = 0.7, 8
_FAILED = ("at_bound", "not_identifiable")


@dataclass(frozen=True, slots=True)
class Bench:
    """What every profile of a campaign needs.

    Attributes
    ----------
    damper : Damper
        Geometry, oil and gas.
    solver : SolverOptions
        How exactly to integrate.
    cancelled : callable
        Asked before each simulation.
    jobs : int
        Threads.
    """

    damper: Damper
    solver: SolverOptions = SolverOptions(tolerance=1e-2)
    cancelled: Callable[[], bool] = lambda: False
    jobs: int = 1

    def misfit(self, fit: Fit, free: Sequence[str]) -> Misfit:
        """What a setting's logs say of some parameters."""
        ordered = tuple(name for name in PARAMETER_NAMES if name in free)
        traces = tuple(log.trace for log in fit.logs)
        return Misfit(traces, self.damper, ordered, self.solver, 1, self.cancelled)


def lines_of(
    name: str,
    evidence: Mapping[int, Evidence],
    known: Mapping[int, Uncertainty],
    sharing: Sharing,
    bench: Bench,
) -> Iterator[Line]:
    """Yield the lines along which a parameter of a campaign can be profiled, by rising setting.

    A parameter of a joint fit yields none here; see `damperfit.uncertainty.joint_profiles`.

    Parameters
    ----------
    name : str
        Parameter.
    evidence, known : mapping of int to Evidence, Uncertainty
        By setting.
    sharing : Sharing
        How the shared parameters were found.
    bench : Bench
        Damper, solver, cancellation.
    """
    for setting in sorted(evidence):
        one = evidence[setting]
        if name in sharing.found:
            line = _shared_line(name, one, known[setting], sharing, bench)
        else:
            line = _own_line(name, one, known[setting], sharing, bench)
        if line is not None:
            yield line


def _own_line(
    name: str, one: Evidence, known: Uncertainty, sharing: Sharing, bench: Bench
) -> Line | None:
    own = own_names(one.fit, sharing)
    is_at_bound = one.fit.status[name] == "at_bound"
    if not own or (name not in own and not is_at_bound):
        return None
    free = tuple(n for n in PARAMETER_NAMES if n in own or one.fit.status[n] == "at_bound")
    if is_at_bound:
        return _line(name, one, bench, free=free, beside=(*own, name))
    place = known.names.index(name)
    return _line(
        name, one, bench, free=free, beside=own, variance=float(known.covariance[place, place])
    )


def _shared_line(
    name: str, one: Evidence, known: Uncertainty, sharing: Sharing, bench: Bench
) -> Line | None:
    if sharing.jointly:
        return None
    setting = one.fit.setting
    if name == "r_m3" and setting == sharing.r_m3_from:
        free = tuple(n for n in sharing.free if not (sharing.is_refined and n == "f_f"))
        place = known.names.index(name)
        variance = float(known.covariance[place, place])
        return _line(name, one, bench, free=free, beside=free, variance=variance)
    if name == "f_f" and setting in sharing.f_f_from:
        return _line(name, one, bench, free=sharing.free, beside=sharing.free)
    return None


def _line(
    name: str,
    one: Evidence,
    bench: Bench,
    *,
    free: tuple[str, ...],
    beside: tuple[str, ...],
    variance: float | None = None,
) -> Line:
    """The line with the scale that belongs to a variance; the sandwich of `beside` by default."""
    ordered = tuple(n for n in PARAMETER_NAMES if n in beside)
    row = solved(one.information, ordered)[ordered.index(name)]
    if variance is None:
        variance = float(row @ one.scores @ row)
    curvature = float(row[PARAMETER_NAMES.index(name)])
    # `linearise` counts f_0 in units of 100 N, the evidence in N.
    unit = OFFSET_UNIT if name == "f_0" else 1.0
    is_known = variance > 0.0 and math.isfinite(variance)
    return Line(
        setting=one.fit.setting,
        name=name,
        misfit=bench.misfit(one.fit, free),
        start=one.fit.parameters,
        scale=curvature / variance if is_known else 0.0,
        error=math.sqrt(variance) / unit if is_known else math.inf,
    )


def doubtful_profiles(
    one: Evidence, known: Uncertainty, sharing: Sharing, bench: Bench
) -> tuple[MisfitProfile, ...]:
    """Return short profiles of what the quadratic approximation leaves in doubt at a setting.

    Parameters at a bound, not identified, or with a standard error of ln y above 0.1; a shared
    R_m3 where it was taken from. Together they may cost 0.7 of what the fit has.
    """
    budget = max(_QUICK_LEAST, int(_QUICK_SHARE * one.fit.evaluations))
    found = []
    # What has failed first: the budget may not reach for all.
    names = sorted(PARAMETER_NAMES[:-1], key=lambda name: one.fit.status[name] not in _FAILED)
    for name in names:
        if budget < _QUICK_LEAST // 2 or not is_doubtful(name, one.fit, known):
            continue
        mine, its = {one.fit.setting: one}, {one.fit.setting: known}
        for line in lines_of(name, mine, its, sharing, bench):
            if name == "f_f" and name in sharing.found:
                continue  # a mean over settings has no profile in one of them
            profile = trace_profile(line, Stride(_QUICK_STEP, _QUICK_REACH, budget))
            budget -= profile.evaluations
            is_shared = name in sharing.found
            found.append(replace(profile, is_shared=is_shared, is_doubtful=True))
    return tuple(found)


def is_doubtful(name: str, fit: Fit, known: Uncertainty) -> bool:
    """Whether the quadratic approximation of the misfit may not hold as far as the limits."""
    if fit.status[name] in _FAILED:
        return True
    if name not in known.names:
        return False
    place = known.names.index(name)
    return bool(known.covariance[place, place] > _DOUBTFUL**2)
