"""A verdict on each parameter of a setting, in words an engineer acts on."""

from __future__ import annotations

from collections import defaultdict
from typing import TYPE_CHECKING

import numpy as np

from damperfit.identification.outcome import Status
from damperfit.identification.sharing import of_settings

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from numpy.typing import NDArray

    from damperfit.damper.quantity import Quantity
    from damperfit.identification import Fit, Sharing
    from damperfit.tested.setting import Setting
    from damperfit.uncertainty.intervals import Uncertainty
    from damperfit.uncertainty.profiles import MisfitProfile

    FloatArray = NDArray[np.float64]

__all__ = ["doubts", "undetermined", "verdicts"]

# At this correlation knowing the one would shrink the error of the other to a third.
_CORRELATED = 0.95
# What oil meets once a blow-off is open.
_BEHIND_OPENING = ("slope", "port")


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
    stroke, _, part = name.rpartition("_")
    if part in _BEHIND_OPENING and f"{stroke}_opening" in known.unopened:
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
