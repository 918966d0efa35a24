"""What is said of each parameter: its status once errors and profiles are known, and a verdict."""

from __future__ import annotations

import math
from collections import defaultdict
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from damperfit.damper.valve_dampers import ValveDamper
from damperfit.damper.warmed import Warmed
from damperfit.identification.fit_setting import NOT_FIT_TO_SHARE, NOT_FOUND, is_loose
from damperfit.identification.inactive_parts import is_nothing
from damperfit.identification.outcome import Outcome, Status
from damperfit.identification.sharing import of_settings, unknown_at
from damperfit.statistics import NORMAL_95

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.damper.model import Model
    from damperfit.damper.quantity import Quantity
    from damperfit.identification import Campaign, Fit, Sharing
    from damperfit.tested.setting import Setting
    from damperfit.uncertainty.assessment import Assessment
    from damperfit.uncertainty.covariance import Uncertainty
    from damperfit.uncertainty.linearisation import Linearisation
    from damperfit.uncertainty.profiles import MisfitProfile

    FloatArray = NDArray[np.float64]

__all__ = ["doubts", "reconsider", "undetermined", "verdicts", "with_least_openings"]

# At this correlation knowing the one would shrink the error of the other to a third.
_CORRELATED = 0.95
# What oil meets once a blow-off is open.
# Of a stroke's oil: a share below it is that of a passage which the logs do not show.
_UNNOTICED = 0.01
_FOUND = frozenset({Status.FITTED, Status.SHARED})


def with_least_openings(
    known: Uncertainty,
    mine: Linearisation,
    linearised: Sequence[Linearisation],
    sharing: Sharing,
    damper: Model,
) -> Uncertainty:
    """Return a setting's errors with the openings that no log reaches, and what each is above.

    Parameters
    ----------
    known : Uncertainty
        Of the setting.
    mine : Linearisation
        Of the same setting.
    linearised : sequence of Linearisation
        Of all settings: another that shares the opening may press on it more.
    sharing : Sharing
        Which do.
    damper : Model
        The damper.
    """
    if not mine.pressed:
        return known
    found = {}
    for name in mine.pressed:
        alike = list(_alike(name, mine, linearised, sharing))
        if all(one.pressed[name] < _passes_from(name, one, damper) for one in alike):
            found[name] = max(one.pressed[name] for one in alike)
    return replace(known, unopened=found)


def _passes_from(name: str, one: Linearisation, damper: Model) -> float:
    """The pressure above which a blow-off passes oil that a fit could notice, Pa.

    A slope that lets nothing through is one way in which a fit tells that it does not open.
    """
    opening: float = getattr(one.fit.parameters, name)
    own = damper.damper if isinstance(damper, Warmed) else damper
    if not isinstance(own, ValveDamper):
        return opening
    quantity = own.quantity(name)
    stroke, slope_name = quantity.stroke, quantity.beside("slope")
    if slope_name not in one.names:
        return opening
    area = own.pressed_areas[0 if stroke == "rebound" else 1]
    speed = max(part.peak_speed for log in one.fit.logs for part in log.trace.stretches)
    slope: float = getattr(one.fit.parameters, slope_name)
    return opening + _UNNOTICED * own.oil_density * area * speed * slope


def _alike(
    name: str, one: Linearisation, all_of: Sequence[Linearisation], sharing: Sharing
) -> Iterator[Linearisation]:
    """The setting, and others with the same number."""
    yield one
    setting = one.fit.setting
    if name in sharing.found_at(setting):
        own = unknown_at(name, sharing.follows, setting)
        yield from (other for other in all_of if own.holds_at(other.fit.setting))


def reconsider(campaign: Campaign, assessment: Assessment) -> Campaign:
    """Return the campaign with the status that the errors and profiles of its parameters allow.

    The fit itself judges by rough errors of noise. A profile that sets no limit has the last word,
    and so have the printed intervals, which hold the misfit, and of a value that all settings share
    the printed error of noise. What ran to where its part does nothing, as a friction below the
    noise, is no bound that a fit strains against: the logs do not tell it from none.
    """
    known = {one.setting: one for one in assessment.uncertainties}
    fits = []
    for fit in campaign.fits:
        flat = {
            name
            for name, profile in assessment.telling(fit.setting).items()
            if profile.is_flat and fit.status[name] in _FOUND
        }
        flat |= {
            name
            for name in campaign.sharing.found
            if fit.status[name] == Status.SHARED and _is_unfit(fit, name, known.get(fit.setting))
        }
        flat |= _anywhere(fit, assessment)
        lost = flat.intersection(campaign.sharing.found)
        lost |= {
            name for name in campaign.sharing.found if fit.status[name] == Status.NOT_IDENTIFIABLE
        }
        flat |= _carried(fit, lost, known.get(fit.setting))
        at_bound = {name for name, status in fit.status.items() if status == Status.AT_BOUND}
        none = {name for name in at_bound if is_nothing(fit.parameters, name)}
        own = none | {name for name in flat if fit.status[name] == Status.FITTED}
        is_strained = fit.outcome is Outcome.AT_BOUND and not none >= at_bound
        outcome = fit.outcome
        if own and outcome in {Outcome.CONVERGED, Outcome.AT_BOUND} and not is_strained:
            outcome = Outcome.NOT_IDENTIFIABLE
        status = {**fit.status, **dict.fromkeys(flat | none, Status.NOT_IDENTIFIABLE)}
        fits.append(replace(fit, status=status, outcome=outcome))
    return replace(campaign, fits=tuple(fits))


def _is_unfit(fit: Fit, name: str, known: Uncertainty | None) -> bool:
    """Whether a shared value is less than three errors away from nothing, or from any other."""
    if known is None or name not in known.names:
        return False
    quantity, value = fit.parameters.quantity(name), getattr(fit.parameters, name)
    return is_loose(quantity, value, _error(quantity, known), NOT_FIT_TO_SHARE)


def _anywhere(fit: Fit, assessment: Assessment) -> set[str]:
    """What was found with an interval as wide as of what no log tells; a profile decides itself."""
    profiles = assessment.telling(fit.setting)
    found = set()
    for name, status in fit.status.items():
        if name in profiles:
            continue
        low, high = assessment.limits(fit.setting, name)
        quantity = fit.parameters.quantity(name)
        if status in _FOUND and low and high and quantity.is_logarithmic:
            error = math.log(high / low) / (2.0 * NORMAL_95)
            if is_loose(quantity, 1.0, error, NOT_FOUND):
                found.add(name)
    return found


def _error(quantity: Quantity, known: Uncertainty) -> float:
    """Its printed error of noise, of its logarithm or in its size."""
    place = known.names.index(quantity.name)
    error = math.sqrt(abs(float(known.covariance[place, place])))
    return error if quantity.is_logarithmic else error / quantity.size


def _carried(fit: Fit, lost: set[str], known: Uncertainty | None) -> set[str]:
    """What a setting finds only beside a shared slope of either sign that the logs do not tell."""
    is_told = all(fit.parameters.quantity(name).is_logarithmic for name in lost)
    if known is None or is_told:
        return set()
    return {
        name
        for name in known.names
        if fit.status[name] == Status.FITTED
        and is_loose(
            one := fit.parameters.quantity(name),
            getattr(fit.parameters, name),
            _error(one, known),
            NOT_FOUND,
        )
    }


def verdicts(
    fit: Fit, known: Uncertainty, sharing: Sharing, profiles: Mapping[str, MisfitProfile]
) -> dict[str, str]:
    """Return one sentence for each parameter: how it was found, how well, tied to which other.

    Parameters
    ----------
    fit : Fit
        The setting's fit.
    known : Uncertainty
        The same setting's intervals.
    sharing : Sharing
        How the shared parameters were found.
    profiles : mapping of str to MisfitProfile
        By parameter, where the misfit was followed; of shared ones too.
    """
    correlation = known.correlation
    return {
        name: _verdict(name, fit, known, profiles.get(name), sharing, correlation)
        for name in fit.parameters.names
    }


def undetermined(
    campaign_fits: Iterable[Fit],
    known: Mapping[Setting, Uncertainty],
    sharing: Sharing,
    profiles: Mapping[Setting, Mapping[str, MisfitProfile]],
) -> tuple[str, ...]:
    """Return one sentence for each way in which parameters are at a bound or not determined.

    Parameters
    ----------
    campaign_fits : iterable of Fit
        All settings.
    known : mapping of Setting to Uncertainty
        By setting.
    sharing : Sharing
        How the shared parameters were found.
    profiles : mapping of Setting to mapping of str to MisfitProfile
        By setting and parameter.
    """
    said: dict[tuple[str, str], list[Setting]] = defaultdict(list)
    for fit in campaign_fits:
        if fit.setting not in known:
            continue
        mine = profiles.get(fit.setting, {})
        for name in fit.parameters.names:
            if fit.status[name].has_failed:
                words = _verdict(name, fit, known[fit.setting], mine.get(name), sharing)
                said[name, words].append(fit.setting)
    return tuple(
        f"{name} at {of_settings(settings)}: {words}" for (name, words), settings in said.items()
    )


def doubts(
    campaign_fits: Iterable[Fit],
    known: Mapping[Setting, Uncertainty],
    sharing: Sharing,
    profiles: Mapping[Setting, Mapping[str, MisfitProfile]],
) -> tuple[str, ...]:
    """Return what a reader must know before using the numbers: what is `undetermined`, and ties.

    Parameters
    ----------
    campaign_fits : iterable of Fit
        All settings.
    known : mapping of Setting to Uncertainty
        By setting.
    sharing : Sharing
        How the shared parameters were found.
    profiles : mapping of Setting to mapping of str to MisfitProfile
        By setting and parameter.
    """
    fits = tuple(campaign_fits)
    ties: dict[tuple[str, str], list[tuple[Setting, float]]] = defaultdict(list)
    for fit in fits:
        if fit.setting in known:
            for one, other, value in _ties(known[fit.setting]):
                ties[one, other].append((fit.setting, value))
    sentences = list(undetermined(fits, known, sharing, profiles))
    for (one, other), where in ties.items():
        values = [value for _, value in where]
        spread = f"{min(values):+.2f}" + (
            f" to {max(values):+.2f}" if max(values) - min(values) > 0.005 else ""
        )
        sentences.append(
            f"{one} and {other} are strongly correlated at {of_settings(s for s, _ in where)} "
            f"({spread}): the logs determine their combination better than each"
        )
    return tuple(sentences)


_NOT_FITTED: dict[Status, str] = {
    Status.FIXED: "held at the value given",
    Status.ABSENT: "has no effect at this setting and was left out of the fit",
}


def _verdict(
    name: str,
    fit: Fit,
    known: Uncertainty,
    profile: MisfitProfile | None,
    sharing: Sharing,
    correlation: FloatArray | None = None,
) -> str:
    status, unit = fit.status[name], fit.parameters.quantity(name).unit
    if status in _NOT_FITTED:
        limit = f" ({_seen(profile, unit)})" if profile is not None else ""
        return f"{_NOT_FITTED[status]}{limit}"
    if status == Status.AT_BOUND:
        seen = f": {_seen(profile, unit)}" if profile is not None else ""
        return f"ran to the edge of its plausible range{seen}; fix it, or check units and signs"
    interval = known.intervals.get(name)
    if interval is None:
        return _without_interval(status, profile, unit, _unopened(name, fit, known))
    tied = "" if correlation is None else _tied(name, known, correlation)
    whose = sharing.whose(name, fit.setting) if name in sharing.found_at(fit.setting) else ""
    where = (
        _span(interval.low, interval.high, fit.parameters.quantity(name))
        if profile is None or not profile.is_complete or (interval.misfit and not profile.is_flat)
        else _seen(profile, unit)
    )
    if profile is not None and profile.better is not None:
        where += f", a better minimum lies near {profile.better.value:.4g} {unit}: give --starts 20"
    if status == Status.NOT_IDENTIFIABLE:
        return _of_undetermined(name, fit, known, profile, whose, (where, tied))
    if interval.misfit > 0.0:
        where += (
            f" (standard errors: {interval.error:.2g} {unit} from noise, "
            f"{interval.misfit:.2g} {unit} from lack of fit)"
        )
    found = f"shared by {whose or 'all settings'}" if status == Status.SHARED else "fitted"
    return f"{found}, {where}{tied}"


def _of_undetermined(
    name: str,
    fit: Fit,
    known: Uncertainty,
    profile: MisfitProfile | None,
    whose: str,
    seen: tuple[str, str],
) -> str:
    quantity, (where, tied) = fit.parameters.quantity(name), seen
    unit, shape = quantity.unit, "" if profile is None else profile.shape
    used = f"; {getattr(fit.parameters, name):.4g} {unit} is used"
    used_for = f"{used} for {whose}" if whose else ""
    faster = f"{used_for or used}; fix it, or fit faster logs with more force"
    if profile is not None and shape == "flat upward":
        rigid = ", as with rigid oil" if quantity.is_open else ""
        return (
            f"not identifiable upward: at least {profile.low:.4g} {unit} (95 %), and any higher "
            f"value fits these logs as well{rigid}{tied}{faster}"
        )
    if closed := _unopened(name, fit, known):
        return f"{closed}; fix it, or fit faster logs with more force"
    if used_for and shape == "flat downward":
        used_for += ", instead of 0: any value below the limit fits as well"
    return f"these logs do not determine it ({where}{tied}){used_for}; fix it, or fit more logs"


def _unopened(name: str, fit: Fit, known: Uncertainty) -> str:
    """What is said of a number of a blow-off that no log opens; empty of others."""
    least, unit = known.unopened.get(name), fit.parameters.quantity(name).unit
    if least is not None:
        value = getattr(fit.parameters, name)
        used = "" if value > least else " with a slope that lets next to nothing through"
        return (
            f"these logs do not open it: it opens above {least:.4g} {unit}, the highest pressure "
            f"on it in them, and any higher value fits as well; {value:.4g} {unit} is used{used}"
        )
    quantity = fit.parameters.quantity(name)
    if quantity.group == "blow_off" and quantity.beside("opening") in known.unopened:
        return "these logs do not determine it: they do not open the blow-off"
    return ""


def _without_interval(status: Status, profile: MisfitProfile | None, unit: str, closed: str) -> str:
    if status != Status.NOT_IDENTIFIABLE:
        return "no interval: the fit did not converge to a minimum"
    if closed:
        return f"{closed}: the law may as well lack this part"
    seen = f" ({_seen(profile, unit)})" if profile is not None else ""
    return f"these logs cannot tell it from none{seen}: the law may as well lack this part"


def _span(low: float, high: float, quantity: Quantity) -> str:
    """Its 95 %; an end beyond the plausible range is no limit."""
    has_low, has_high = low >= quantity.plausible[0], high <= quantity.plausible[1]
    if has_low and has_high:
        return f"95 % from {low:.4g} to {high:.4g} {quantity.unit}"
    if has_low:
        return f"95 % above {low:.4g} {quantity.unit}"
    if has_high:
        return f"95 % below {high:.4g} {quantity.unit}"
    return "no value of its plausible range is excluded"


def _seen(profile: MisfitProfile, unit: str) -> str:
    """What the misfit along the parameter says."""
    low, high = profile.low, profile.high
    if not profile.is_complete:
        return "its profile was not completed; give --profile"
    if low is not None and high is not None:
        return f"95 % from {low:.4g} to {high:.4g} {unit} by its profile"
    if high is not None:
        return f"flat downward, only an upper limit: 95 % below {high:.4g} {unit}"
    if low is not None:
        return f"flat upward, only a lower limit: 95 % above {low:.4g} {unit}"
    return "flat upward and downward: no limit at all"


def _ties(known: Uncertainty) -> Iterable[tuple[str, str, float]]:
    matrix = known.correlation
    for i, one in enumerate(known.names):
        for j in range(i + 1, len(known.names)):
            if abs(matrix[i, j]) > _CORRELATED:
                yield one, known.names[j], float(matrix[i, j])


def _tied(name: str, known: Uncertainty, correlation: FloatArray) -> str:
    row = correlation[known.names.index(name)].copy()
    row[known.names.index(name)] = 0.0
    if not len(row) or not np.max(np.abs(row)) > _CORRELATED:
        return ""
    partner = int(np.argmax(np.abs(row)))
    return f", correlated with {known.names[partner]} ({row[partner]:+.2f})"
