"""What is said of each parameter: its status once errors and profiles are known, and a verdict."""

from __future__ import annotations

import math
from collections import defaultdict
from dataclasses import replace
from operator import itemgetter
from typing import TYPE_CHECKING

import numpy as np

from damperfit.damper.temperature_law import WithTemperature
from damperfit.identification.fit_problem import is_nothing
from damperfit.identification.fit_setting import NOT_FIT_TO_SHARE, NOT_FOUND, is_loose
from damperfit.identification.outcome import Outcome, Status
from damperfit.identification.sharing import of_settings, unknown_at
from damperfit.problem import Option, Problem, warning
from damperfit.statistics import NORMAL_95
from damperfit.uncertainty.covariance import own_names, solved

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from damperfit.damper.model import Model
    from damperfit.damper.quantity import Quantity
    from damperfit.identification import Campaign, Fit, Sharing
    from damperfit.tested.setting import Setting
    from damperfit.uncertainty.assessment import Assessment
    from damperfit.uncertainty.covariance import Uncertainty
    from damperfit.uncertainty.linearisation import Linearisation
    from damperfit.uncertainty.profiles import MisfitProfile

# At this correlation knowing the one would shrink the error of the other to a third.
_CORRELATED = 0.95
# Rigs repeat frequency and stroke to parts in a thousand: one log of at least so many that is off
# by more than so much, and by so many times what the others differ by, was logged otherwise.
_ENOUGH_LOGS, _APART, _FAR = 4, 5e-3, 10.0
# Settings disagree about a shared value from this factor and so many errors on, of those whose own
# logs tell it better than by this error of its logarithm, where that is half of what they miss.
_UNLIKE, _SURELY, _TELLING, _MOST_OF_IT = 1.5, 3.0, 0.3, 0.5
# Of a stroke's oil: a share below it is that of a passage which the logs do not show.
_UNNOTICED = 0.01
_FOUND = frozenset({Status.FITTED, Status.SHARED})


def with_least_openings(
    known: Sequence[Uncertainty],
    linearised: Sequence[Linearisation],
    sharing: Sharing,
    damper: Model,
) -> tuple[Uncertainty, ...]:
    """Return the errors of all settings with the openings that no log reaches.

    Of a blow-off that does not open the logs tell a lower limit of its preload, the highest
    pressure on it at any setting with the same number, and nothing more.
    """

    def least(mine: Linearisation) -> dict[str, float]:
        highest = {}
        for name in mine.pressed:
            alike = [mine]
            if name in sharing.found_at(mine.fit.setting):
                own = unknown_at(name, sharing.follows, mine.fit.setting)
                alike += [one for one in linearised if own.holds_at(one.fit.setting)]
            if all(one.pressed[name] < _passes_from(name, one, damper) for one in alike):
                highest[name] = max(one.pressed[name] for one in alike)
        return highest

    by_setting = {one.fit.setting: one for one in linearised}
    return tuple(replace(one, unopened=least(by_setting[one.setting])) for one in known)


def _passes_from(name: str, one: Linearisation, damper: Model) -> float:
    """The pressure above which a blow-off passes oil that a fit could notice, Pa.

    A slope that lets nothing through is one way in which a fit tells that it does not open.
    """
    opening: float = getattr(one.fit.parameters, name)
    own = damper.damper if isinstance(damper, WithTemperature) else damper
    stroke = name.removesuffix("_opening")
    if f"{stroke}_slope" not in one.names:
        return opening
    from damperfit.damper.valve_dampers import ValveDamper

    if not isinstance(own, ValveDamper):
        return opening
    area = own.pressed_areas[0 if stroke == "rebound" else 1]
    speed = max(part.peak_speed for log in one.fit.logs for part in log.trace.stretches)
    slope: float = getattr(one.fit.parameters, f"{stroke}_slope")
    return opening + _UNNOTICED * own.oil_density * area * speed * slope


def reconsider(campaign: Campaign, assessment: Assessment) -> Campaign:
    """Return the campaign with the status that the errors and profiles of its parameters allow.

    The fit itself judges by rough errors of noise. A profile that sets no limit has the last word,
    and so have the printed intervals, which hold the misfit, and of a value that all settings share
    the printed error of noise. What ran to where its part does nothing, as a friction below the
    noise, is no bound that a fit strains against: the logs do not tell it from none.
    """
    fits = tuple(_reconsidered(fit, campaign.sharing, assessment) for fit in campaign.fits)
    return replace(campaign, fits=fits)


def _reconsidered(fit: Fit, sharing: Sharing, assessment: Assessment) -> Fit:
    profiles, values = assessment.telling(fit.setting), fit.parameters
    known = assessment.uncertainty(fit.setting)

    def is_unfit(name: str, share: float) -> bool:
        """Whether the printed error of noise is so large a share of the value."""
        if known is None or name not in known.names:
            return False
        one, error = values.quantity(name), known.error(name)
        error = error if one.is_logarithmic else error / one.size
        return is_loose(one, getattr(values, name), error, share)

    lost = set()
    for name, status in fit.status.items():
        if status not in _FOUND:
            continue
        if name in profiles:
            is_lost = profiles[name].is_flat
        else:  # an interval as wide as of what no log tells
            low, high = assessment.limits(fit.setting, name)
            one, is_lost = values.quantity(name), False
            if low and high and one.is_logarithmic:
                error = math.log(high / low) / (2.0 * NORMAL_95)
                is_lost = is_loose(one, 1.0, error, NOT_FOUND)
        is_shared = name in sharing.found and status == Status.SHARED
        if is_lost or (is_shared and is_unfit(name, NOT_FIT_TO_SHARE)):
            lost.add(name)
    # What a setting finds only beside a shared slope of either sign that the logs do not tell.
    slopes = {n for n in sharing.found if n in lost or fit.status[n] == Status.NOT_IDENTIFIABLE}
    if not all(values.quantity(name).is_logarithmic for name in slopes):
        fitted = (name for name, status in fit.status.items() if status == Status.FITTED)
        lost |= {name for name in fitted if is_unfit(name, NOT_FOUND)}
    at_bound = {name for name, status in fit.status.items() if status == Status.AT_BOUND}
    none = {name for name in at_bound if is_nothing(values, name)}
    own = none | {name for name in lost if fit.status[name] == Status.FITTED}
    is_strained = fit.outcome is Outcome.AT_BOUND and not none >= at_bound
    outcome = fit.outcome
    if own and outcome in {Outcome.CONVERGED, Outcome.AT_BOUND} and not is_strained:
        outcome = Outcome.NOT_IDENTIFIABLE
    changed = dict.fromkeys(lost | none, Status.NOT_IDENTIFIABLE)
    return replace(fit, status={**fit.status, **changed}, outcome=outcome)


# Sentences


def verdicts(
    fit: Fit, known: Uncertainty, sharing: Sharing, profiles: Mapping[str, MisfitProfile]
) -> dict[str, str]:
    """Return one sentence for each parameter: how it was found, how well, tied to which other.

    `profiles` are those that speak of the setting, by parameter.
    """
    partners: dict[str, str] = {}
    for one, other, value in sorted(_ties(known), key=lambda tie: abs(tie[2])):
        partners[one] = f", correlated with {other} ({value:+.2f})"
        partners[other] = f", correlated with {one} ({value:+.2f})"
    return {
        name: _verdict(name, fit, known, profiles.get(name), sharing, partners.get(name, ""))
        for name in fit.parameters.names
    }


def undetermined(campaign: Campaign, assessment: Assessment) -> tuple[Problem, ...]:
    """Return each way in which parameters are at a bound or not determined, with its settings."""
    where: dict[tuple[str, Status, str], list[Setting]] = defaultdict(list)
    for fit in campaign.fits:
        if (known := assessment.uncertainty(fit.setting)) is None:
            continue
        profiles = assessment.telling(fit.setting)
        for name, status in fit.status.items():
            if status.has_failed:
                words = _verdict(name, fit, known, profiles.get(name), campaign.sharing, "")
                where[name, status, words].append(fit.setting)
    return tuple(
        warning(
            "at-bound" if status == Status.AT_BOUND else "not-determined",
            "{quantity} at {settings}: {words}",
            quantity=name,
            settings=of_settings(settings),
            words=words,
        )
        for (name, status, words), settings in where.items()
    )


def doubts(campaign: Campaign, assessment: Assessment) -> tuple[Problem, ...]:
    """Return what a reader must know before using the numbers: what is `undetermined`, and ties."""
    fitted = {fit.setting for fit in campaign.fits}
    ties: dict[tuple[str, str], list[tuple[Setting, float]]] = defaultdict(list)
    for known in assessment.uncertainties:
        for one, other, value in _ties(known) if known.setting in fitted else ():
            ties[one, other].append((known.setting, value))
    problems = list(undetermined(campaign, assessment))
    for (one, other), where in ties.items():
        low, high = min(value for _, value in where), max(value for _, value in where)
        spread = f"{low:+.2f} to {high:+.2f}" if high - low > 0.005 else f"{low:+.2f}"
        text = (
            "{quantity} and {other} are strongly correlated at {settings} ({correlation}): the "
            "logs determine their combination better than each"
        )
        at = of_settings(setting for setting, _ in where)
        problems.append(
            warning("correlated", text, quantity=one, other=other, settings=at, correlation=spread)
        )
    return tuple(problems)


def motions_apart(campaign: Campaign) -> Iterator[Problem]:
    """Yield the one log whose clock or stroke is off those of all others, which agree."""
    motions = [
        (log.trace.name, stretch.frequency, log.trace.amplitude)
        for fit in campaign.fits
        for log in fit.logs
        for stretch in log.trace.stretches
        if stretch.n_cycles and len(log.trace.stretches) == 1
    ]
    if len(motions) < _ENOUGH_LOGS:
        return
    names, *columns = zip(*motions, strict=True)
    for code, unit, scale, what, values in (
        ("clock-apart", "Hz", 1.0, "clock", columns[0]),
        ("stroke-apart", "mm", 1e3, "displacement channel", columns[1]),
    ):
        middle = float(np.median(values))
        off = np.abs(np.array(values) / middle - 1.0)
        *_, second, most = np.sort(off).tolist()
        if most > _APART and most > _FAR * second:
            place = int(np.argmax(off))
            yield warning(
                code,
                "{log} has {found} {unit}, all other logs have {expected} {unit}: its {what} is "
                "{percent} % off, or it is another test; a wrong {what} puts its parameters off by "
                "about as much",
                log=names[place],
                found=f"{scale * values[place]:.4g}",
                expected=f"{scale * middle:.4g}",
                unit=unit,
                what=what,
                percent=f"{100.0 * most:.2g}",
            )


def shared_apart(linearised: Sequence[Linearisation], sharing: Sharing) -> Iterator[Problem]:
    """Yield what the logs of two settings, each alone, would have otherwise than all together."""
    for name in sharing.common if sharing.jointly else ():
        alone, mine = [], [one for one in linearised if one.fit.setting in sharing.settings]
        if len(mine) < 2:
            continue
        quantity = mine[0].fit.parameters.quantity(name)
        for one in mine:
            row = solved(one, (*own_names(one.fit, sharing), name))[-1]
            step, error = float(row @ one.gradient), math.sqrt(abs(float(row @ one.scores @ row)))
            if quantity.is_logarithmic and 0.0 < error < _TELLING:
                n = sum(log.trace.n_samples for log in one.fit.logs)
                fall = step**2 / float(row[one.places([name])[0]]) * one.precision / n
                alone.append((step, error, fall, one.fit))
        low, high = (end(alone, key=itemgetter(0), default=None) for end in (min, max))
        if low is None or high is None:
            continue
        apart, fall = high[0] - low[0], 0.5 * (low[2] + high[2])
        is_sure = apart > _SURELY * math.hypot(low[1], high[1]) and fall > _MOST_OF_IT
        if is_sure and apart > math.log(_UNLIKE):
            scale, unit = 10.0**quantity.power, quantity.shown_unit or quantity.unit
            known = [getattr(fit.parameters, name) / scale * math.exp(min(step, 5.0))
                     for step, *_, fit in (low, high)]  # fmt: skip
            yield warning(
                "shared-apart",
                "{label}: the logs of setting {first} by themselves ask for about {low}, those of "
                "setting {second} for {high} {unit}: they disagree about the one value that all "
                "settings have; part of it is something else{untie}",
                label=quantity.label,
                first=low[-1].setting,
                second=high[-1].setting,
                low=f"{known[0]:.2g}",
                high=f"{known[1]:.2g}",
                unit=unit,
                untie=Option("untie", name, is_aside=True),
            )


def _ties(known: Uncertainty) -> Iterator[tuple[str, str, float]]:
    matrix = known.correlation
    for i, j in zip(*np.nonzero(np.abs(np.triu(matrix, 1)) > _CORRELATED), strict=True):
        yield known.names[i], known.names[j], float(matrix[i, j])


def _verdict(  # noqa: PLR0911 - a sentence for each way a value was found
    name: str,
    fit: Fit,
    known: Uncertainty,
    profile: MisfitProfile | None,
    sharing: Sharing,
    tied: str,
) -> str:
    status, quantity = fit.status[name], fit.parameters.quantity(name)
    unit, value = quantity.unit, getattr(fit.parameters, name)
    seen = "" if profile is None else _seen(profile, unit)
    if status == Status.FIXED:
        return f"held at the value given{f' ({seen})' if seen else ''}"
    if status == Status.ABSENT:
        limit = f" ({seen})" if seen else ""
        return f"has no effect at this setting and was left out of the fit{limit}"
    if status == Status.AT_BOUND:
        limit = f": {seen}" if seen else ""
        return f"is at a bound of its plausible range{limit}; hold it, or check units and signs"
    closed, interval = _unopened(name, fit, known), known.intervals.get(name)
    if interval is None:
        if status != Status.NOT_IDENTIFIABLE:
            return "no interval: the fit did not converge to a minimum"
        limit = f" ({seen})" if seen else ""
        told = closed or f"these logs cannot distinguish it from none{limit}"
        return f"{told}: the law may as well lack this part"
    whose = sharing.whose(name, fit.setting) if name in sharing.found_at(fit.setting) else ""
    where = _span(interval.low, interval.high, quantity)
    if profile is not None and profile.is_complete and (profile.is_flat or not interval.misfit):
        where = seen
    if profile is not None and profile.better is not None:
        better = f"{profile.better.value:.4g} {unit}"
        where += f", a better minimum lies near {better}: fit with 20 starts"
    if status != Status.NOT_IDENTIFIABLE:
        if interval.misfit > 0.0:
            where += (
                f" (standard errors: {interval.error:.2g} {unit} from noise, "
                f"{interval.misfit:.2g} {unit} from lack of fit)"
            )
        found = f"shared by {whose or 'all settings'}" if status == Status.SHARED else "fitted"
        return f"{found}, {where}{tied}"
    used = f"; {value:.4g} {unit} is used"
    used_for = f"{used} for {whose}" if whose else ""
    if profile is not None and profile.shape == "flat upward":
        rigid = ", as with rigid oil" if quantity.is_open else ""
        return (
            f"not identifiable upward: at least {profile.low:.4g} {unit} (95 %), and any higher "
            f"value fits these logs as well{rigid}{tied}{used_for or used}; hold it, or fit faster "
            "logs with more force"
        )
    if closed:
        return f"{closed}; hold it, or fit faster logs with more force"
    if used_for and profile is not None and profile.shape == "flat downward":
        used_for += ", instead of 0: any value below the limit fits as well"
    return f"these logs do not determine it ({where}{tied}){used_for}; hold it, or fit more logs"


def _unopened(name: str, fit: Fit, known: Uncertainty) -> str:
    """What is said of a number of a blow-off that no log opens; empty of others."""
    least, quantity = known.unopened.get(name), fit.parameters.quantity(name)
    if least is not None:
        value, unit = getattr(fit.parameters, name), quantity.unit
        used = "" if value > least else " with a slope that lets next to nothing through"
        return (
            f"these logs do not open it: it opens above {least:.4g} {unit}, the highest pressure "
            f"on it in them, and any higher value fits as well; {value:.4g} {unit} is used{used}"
        )
    if quantity.group == "blow_off" and quantity.beside("opening") in known.unopened:
        return "these logs do not determine it: they do not open the blow-off"
    return ""


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
        return "its profile was not completed; ask for profiles"
    if low is not None and high is not None:
        return f"95 % from {low:.4g} to {high:.4g} {unit} by its profile"
    if high is not None:
        return f"flat downward, only an upper limit: 95 % below {high:.4g} {unit}"
    if low is not None:
        return f"flat upward, only a lower limit: 95 % above {low:.4g} {unit}"
    return "flat upward and downward: no limit at all"
