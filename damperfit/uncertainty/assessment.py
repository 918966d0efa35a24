"""A campaign judged: intervals and diagnoses of every setting, and the sentences they make."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from operator import itemgetter
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from damperfit.damper.model import Model, Quantity
from damperfit.errors import FitCancelledError, SimulationError, sparing
from damperfit.identification.blas_threads import one_blas_thread
from damperfit.identification.fit_problem import is_nothing
from damperfit.identification.fit_setting import NOT_DETERMINED, NOT_FIT_TO_SHARE, Fit, is_loose
from damperfit.identification.options import check_profile_names
from damperfit.identification.outcome import Outcome, Status
from damperfit.identification.procedures import TAKEN, Campaign
from damperfit.identification.sharing import Sharing, of_settings, unknown_at
from damperfit.problem import Option, Problem, warning
from damperfit.simulation import SolverOptions
from damperfit.statistics import NORMAL_95
from damperfit.tested.setting import Setting
from damperfit.uncertainty.covariance import (
    GasContent,
    Linearisation,
    Uncertainty,
    gas_content,
    linearise_settings,
    own_names,
    solved,
    uncertainties,
)
from damperfit.uncertainty.profiles import (
    Bench,
    MisfitProfile,
    doubtful_profiles,
    profile_at,
    profile_jointly,
    shared_limits,
)
from damperfit.uncertainty.residuals import (
    FLAWS,
    BySpeed,
    Diagnosis,
    diagnose,
    friction_by_speed,
    group_warning,
    hidden_friction,
    reconciled,
)
from damperfit.uncertainty.speed_forces import (
    Slopes,
    SpeedForces,
    beside_the_rig,
    speed_forces,
)
from damperfit.workers import executor

if TYPE_CHECKING:
    from damperfit.errors import OnError
    from damperfit.recording import Trace
    from damperfit.uncertainty.grades import Objection


# What is said of each parameter: its status once errors and profiles are known, and a verdict.


# Rigs repeat frequency and stroke to parts in a thousand: one log of at least so many that is off
# by more than so much, and by so many times what the others differ by, was logged otherwise. One
# off by far more is another test, as is one off by less of three, or of stepped tests.
_ENOUGH_LOGS, _FAR = 3, 10.0
_APART, _APART_OF_FEW, _OTHER_TEST = 5e-3, 1e-2, 0.1
# Settings disagree about a shared value from this factor and so many errors on, of those whose own
# logs know it better than by this error of its logarithm, where that is half of what they miss.
_UNLIKE, _SURELY, _TELLING, _MOST_OF_IT = 1.5, 3.0, 0.3, 0.5
# An offset of so much of the force's swing, of which a gas leaves no more than so much.
_OFFSET_THAT_MATTERS, _OF_OFFSET = 0.01, 0.2
# What changes within a log leaves a misfit that looks like a friction: it is named by its own name.
_CHANGES = {"force_drift", "force_trend"}
# Of a stroke's oil: a share below it is that of a passage which the logs do not show.
_UNNOTICED = 0.01


def with_least_openings(
    known: Sequence[Uncertainty],
    linearised: Sequence[Linearisation],
    sharing: Sharing,
    damper: Model,
) -> tuple[Uncertainty, ...]:
    """Return the errors with the openings that no log reaches: above the highest pressure on them.

    That of all settings that have the same number.
    """
    by_setting = {linear.fit.setting: linear for linear in linearised}
    widened = []
    for errors in known:
        highest, mine = {}, by_setting[errors.setting]
        for name in mine.pressed:
            alike = [mine]
            if name in sharing.estimated_at(errors.setting):
                own = unknown_at(name, sharing.follows, errors.setting)
                alike += [linear for linear in linearised if own.holds_at(linear.fit.setting)]
            if all(linear.pressed[name] < _passes_from(name, linear, damper) for linear in alike):
                highest[name] = max(linear.pressed[name] for linear in alike)
        widened.append(replace(errors, unopened=highest))
    return tuple(widened)


def _passes_from(name: str, linear: Linearisation, damper: Model) -> float:
    """The pressure above which a blow-off passes oil that a fit could notice, Pa."""
    from damperfit.damper.valve_dampers import ValveDamper

    opening, own = float(getattr(linear.fit.parameters, name)), damper.plain
    stroke = name.removesuffix("_opening")
    # A slope that lets nothing through is one way in which a fit shows that it does not open.
    slope: float | None = getattr(linear.fit.parameters, f"{stroke}_slope", None)
    if slope is None or not isinstance(own, ValveDamper):
        return opening
    area = own.pressed_areas[0 if stroke == "rebound" else 1]
    speed = max(part.peak_speed for log in linear.fit.logs for part in log.trace.segments)
    return opening + _UNNOTICED * own.oil_density * area * speed * slope


def reconsider(campaign: Campaign, assessment: Assessment) -> Campaign:
    """Return the campaign with the status that the errors and profiles of its parameters allow.

    The fit itself judges by rough errors of noise. A profile that sets no limit has the last word,
    and so have the printed intervals, which hold the misfit, and of a value that all settings share
    the printed error of noise. What ran to where its part does nothing, as a friction below the
    noise, is no bound that a fit strains against: the logs do not separate it from none.
    """
    sharing = campaign.sharing
    return replace(
        campaign, fits=tuple(_reconsidered(fit, sharing, assessment) for fit in campaign.fits)
    )


def _reconsidered(fit: Fit, sharing: Sharing, assessment: Assessment) -> Fit:
    profiles, values = assessment.telling(fit.setting), fit.parameters
    known = assessment.uncertainty(fit.setting)

    def is_unfit(name: str, share: float) -> bool:
        """Whether the printed error of noise is so large a share of the value."""
        if known is None or name not in known.names:
            return False
        quantity, error = values.quantity(name), known.error(name)
        error = error if quantity.is_logarithmic else error / quantity.size
        return is_loose(quantity, getattr(values, name), error, share)

    def is_unlimited(name: str) -> bool:
        """Whether it has no limit, or an interval as wide as of what no log determines."""
        if name in profiles:
            return profiles[name].is_flat
        (low, high), quantity = assessment.limits(fit.setting, name), values.quantity(name)
        if not (low and high and quantity.is_logarithmic):
            return False
        return is_loose(quantity, 1.0, math.log(high / low) / (2.0 * NORMAL_95), NOT_DETERMINED)

    def named(*statuses: Status) -> list[str]:
        return [name for name, status in fit.status.items() if status in statuses]

    lost = {name for name in named(Status.FITTED, Status.SHARED) if is_unlimited(name)}
    shared = (name for name in named(Status.SHARED) if name in sharing.estimated)
    lost |= {name for name in shared if is_unfit(name, NOT_FIT_TO_SHARE)}
    # What a setting finds only beside a shared slope of either sign that the logs leave open.
    slopes = {n for n in sharing.estimated if n in lost or fit.status[n] == Status.NOT_IDENTIFIABLE}
    if not all(values.quantity(name).is_logarithmic for name in slopes):
        lost |= {name for name in named(Status.FITTED) if is_unfit(name, NOT_DETERMINED)}
    at_bound = {*named(Status.AT_BOUND)}
    none = {name for name in at_bound if is_nothing(values, name)}
    is_own = bool(none or lost.intersection(named(Status.FITTED)))
    outcome, is_strained = fit.outcome, fit.outcome is Outcome.AT_BOUND and not none >= at_bound
    if is_own and outcome in {Outcome.CONVERGED, Outcome.AT_BOUND} and not is_strained:
        outcome = Outcome.NOT_IDENTIFIABLE
    changed = dict.fromkeys(lost | none, Status.NOT_IDENTIFIABLE)
    return replace(fit, status={**fit.status, **changed}, outcome=outcome)


def motions_apart(campaign: Campaign) -> Iterator[Problem]:
    """Yield the one log whose clock or stroke is off those of all others, which agree."""
    logs = [log.trace for fit in campaign.fits for log in fit.logs]
    for n_segments in sorted({len(trace.segments) for trace in logs}):
        alike = [log for log in logs if len(log.segments) == n_segments and log.fastest.n_cycles]
        if len(alike) >= _ENOUGH_LOGS:
            yield from _motions_apart(alike)


def _motions_apart(traces: Sequence[Trace]) -> Iterator[Problem]:
    """Yield the one log that is off all others, which have as many segments."""
    is_few = len(traces[0].segments) > 1 or len(traces) == _ENOUGH_LOGS
    least = _APART_OF_FEW if is_few else _APART
    kinds = (
        ("clock-apart", "Hz", 1.0, "clock", "frequency"),
        ("stroke-apart", "mm", 1e3, "displacement channel", "amplitude"),
    )
    for code, unit, scale, what, name in kinds:
        # By log and segment; of a stepped test all steps are off alike.
        values = np.array([[getattr(part, name) for part in trace.segments] for trace in traces])
        middles = np.median(values, axis=0)
        ratios = np.median(values / middles, axis=1) - 1.0
        off, values, middle = np.abs(ratios), values[:, 0], float(middles[0])
        *_, second, most = np.sort(off).tolist()
        if least < most < _OTHER_TEST and most > _FAR * second:
            place = int(np.argmax(off))
            yield warning(
                code,
                "{log} has {found} {unit}, all other logs have {expected} {unit}: its {what} is "
                "{percent} % off, or it is another test; a wrong {what} puts its parameters off by "
                "about as much",
                log=traces[place].name,
                found=f"{scale * values[place]:.4g}",
                expected=f"{scale * middle:.4g}",
                unit=unit,
                what=what,
                percent=f"{100.0 * most:.2g}",
            )


def gas_in_offset(campaign: Campaign, damper: Model) -> Iterator[Problem]:
    """Yield what of the damper explains both the gas volume that was found and the offset."""
    gas, determined = damper.plain.gas, {Status.FITTED, Status.SHARED}
    volumes: list[float] = []
    offsets: list[float] = []
    for fit in campaign.fits:
        for q in fit.parameters.quantities:
            if fit.status[q.name] in determined and (q.is_offset or q.name == "gas_volume"):
                (offsets if q.is_offset else volumes).append(getattr(fit.parameters, q.name))
    if gas is None or not volumes or not offsets:
        return
    area, pressure, volume, _, ambient = gas
    times, offset = volume / float(np.median(volumes)), float(np.median(offsets))
    logs = (log.trace for fit in campaign.fits for log in fit.logs)
    swing = max(float(np.ptp(trace.force[trace.compared])) for trace in logs)
    if abs(offset) < _OFFSET_THAT_MATTERS * swing:
        return
    # What the offset is left with: a stiffer gas spring is one of more pressure, or a thicker rod.
    left = {
        "gas pressure": offset + area * pressure * (times - 1.0),
        "rod": offset + area * (pressure - ambient) * (math.sqrt(times) - 1.0),
    }
    what = min(left, key=lambda name: abs(left[name]))
    if abs(left[what]) < _OF_OFFSET * abs(offset):
        by_rod = f"{times**0.25:.3g} times the declared diameter"
        yield warning(
            "gas-in-offset",
            "a {what} of {amount} explains both the stiffness of the gas spring and the force "
            "offset of {offset} N, which was taken as the rig's tare and is in no force of the "
            "damper: measure it, and declare it",
            what=what,
            amount=by_rod if what == "rod" else f"{1e-5 * times * pressure:.3g} bar",
            offset=f"{offset:.3g}",
        )


def shared_apart(linearised: Sequence[Linearisation], sharing: Sharing) -> Iterator[Problem]:
    """Yield what the logs of two settings, each alone, would have otherwise than all together."""
    mine = [linear for linear in linearised if linear.fit.setting in sharing.settings]
    for name in sharing.common if sharing.jointly and len(mine) > 1 else ():
        quantity, alone = mine[0].fit.parameters.quantity(name), []
        for linear in mine:
            row = solved(linear, (*own_names(linear.fit, sharing), name))[-1]
            step = float(row @ linear.gradient)
            error = math.sqrt(abs(float(row @ linear.scores @ row)))
            if quantity.is_logarithmic and 0.0 < error < _TELLING:
                n = sum(log.trace.n_samples for log in linear.fit.logs)
                fall = step**2 / float(row[linear.places([name])[0]]) * linear.precision / n
                alone.append((step, error, fall, linear.fit))
        if not alone:
            continue
        low, high = (end(alone, key=itemgetter(0)) for end in (min, max))
        distance, fall = high[0] - low[0], 0.5 * (low[2] + high[2])
        is_sure = distance > _SURELY * math.hypot(low[1], high[1]) and fall > _MOST_OF_IT
        if is_sure and distance > math.log(_UNLIKE):
            first, second = (
                getattr(fit.parameters, name) / 10.0**quantity.power * math.exp(min(step, 5.0))
                for step, *_, fit in (low, high)
            )
            yield warning(
                "shared-apart",
                "{label}: the logs of setting {first} alone give about {low}, those of setting "
                "{second} {high} {unit}: they disagree about the value that all settings share: "
                "something else is part of it{untie}",
                label=quantity.label,
                first=low[-1].setting,
                second=high[-1].setting,
                low=f"{first:.2g}",
                high=f"{second:.2g}",
                unit=quantity.shown_unit or quantity.unit,
                untie=Option("untie", name, is_aside=True),
            )


def _verdict(  # noqa: PLR0911 - a sentence for each way a value was found
    name: str,
    fit: Fit,
    known: Uncertainty,
    profile: MisfitProfile | None,
    sharing: Sharing,
    tied: str,
) -> str:
    status, quantity = fit.status[name], fit.parameters.quantity(name)
    (scale, unit), value = quantity.shown, fit.parameters[name]
    seen = "" if profile is None else _seen(profile, quantity)
    limit = f" ({seen})" if seen else ""
    if status == Status.FIXED:
        return f"held at the value given{limit}"
    if status == Status.ABSENT:
        return f"has no effect at this setting and was left out of the fit{limit}"
    if status == Status.AT_BOUND:
        limit = f": {seen}" if seen else ""
        return f"is at a bound of its plausible range{limit}; hold it, or check units and signs"
    closed, interval = _unopened(name, fit, known), known.intervals.get(name)
    if interval is None:
        if status != Status.NOT_IDENTIFIABLE:
            return "no interval: the fit did not converge to a minimum"
        closed = closed or f"these logs cannot distinguish it from none{limit}"
        return f"{closed}: the model may as well lack this part"
    whose = sharing.whose(name, fit.setting) if name in sharing.estimated_at(fit.setting) else ""
    where = _span(interval.low, interval.high, quantity)
    if profile is not None and profile.is_complete and (profile.is_flat or not interval.misfit):
        where = seen
    if profile is not None and profile.better is not None:
        better = f"{scale * profile.better.value:.4g}{unit}"
        where += f", a better minimum lies near {better}: fit with 20 starts"
    if status != Status.NOT_IDENTIFIABLE:
        if interval.misfit > 0.0:
            where += (
                f" (standard errors: {scale * interval.error:.2g}{unit} from noise, "
                f"{scale * interval.misfit:.2g}{unit} from lack of fit)"
            )
        origin = f"shared by {whose or 'all settings'}" if status == Status.SHARED else "fitted"
        return f"{origin}, {where}{tied}"
    used = f"; {scale * value:.4g}{unit} is used"
    used_for = f"{used} for {whose}" if whose else ""
    if profile is not None and profile.shape == "flat upward":
        part = "mounting" if quantity.is_of_mounting else "oil" * quantity.is_open
        rigid = f", as with rigid {part}" * bool(part)
        return (
            f"not identifiable upward: at least {scale * (profile.low or 0.0):.4g}{unit} (95 %), "
            f"and any higher value fits these logs as well{rigid}{tied}{used_for or used}; hold "
            "it, or fit faster logs with more force"
        )
    if closed:
        return f"{closed}; hold it, or fit faster logs with more force"
    if used_for and profile is not None and profile.shape == "flat downward":
        used_for += ", instead of 0: any value below the limit fits as well"
    return f"these logs do not determine it ({where}{tied}){used_for}; hold it, or fit more logs"


def _unopened(name: str, fit: Fit, known: Uncertainty) -> str:
    """A sentence on a number of a blow-off that no log opens; empty for others."""
    least, quantity = known.unopened.get(name), fit.parameters.quantity(name)
    if least is not None:
        (scale, unit), value = quantity.shown, fit.parameters[name]
        used = "" if value > least else " with a slope that lets next to nothing through"
        return (
            f"these logs do not open it: it opens above {scale * least:.4g}{unit}, the highest "
            "pressure on it in them, and any higher value fits as well; "
            f"{scale * value:.4g}{unit} is used{used}"
        )
    is_beside = quantity.group == "blow_off" and quantity.beside("opening") in known.unopened
    return "these logs do not determine it: they do not open the blow-off" * is_beside


def _span(low: float, high: float, quantity: Quantity) -> str:
    """Its 95 %; an end beyond the plausible range is no limit."""
    (least, most), (scale, unit) = quantity.plausible, quantity.shown
    lowest, highest = f"{scale * low:.4g}", f"{scale * high:.4g}{unit}"
    if low >= least:
        return f"95 % from {lowest} to {highest}" if high <= most else f"95 % above {lowest}{unit}"
    if high <= most:
        return f"95 % below {highest}"
    return "no value of its plausible range is excluded"


def _seen(profile: MisfitProfile, quantity: Quantity) -> str:
    """What the misfit along the parameter says."""
    scale, unit = quantity.shown
    low, high = (end and scale * end for end in (profile.low, profile.high))
    if not profile.is_complete:
        return "its profile was not completed; ask for profiles"
    if low is not None and high is not None:
        return f"95 % from {low:.4g} to {high:.4g}{unit} by its profile"
    if high is not None:
        return f"only an upper limit: 95 % below {high:.4g}{unit}"
    if low is not None:
        return f"only a lower limit: 95 % above {low:.4g}{unit}"
    return "no limit at all"


# Of an MSE in per cent: a misfit of 1 % of the force.
_MATTERS = 0.01

METHOD = (
    "Errors and 95 % intervals: sandwich covariance on the logarithm of the parameter with the "
    "residuals' own autocorrelation; the errors of shared parameters are included. Where a misfit "
    "repeats, an error from the model's misfit, estimated from blocks of the cycle, is added; so "
    "is the error of defaults that were not measured."
)


@dataclass(frozen=True, eq=False)  # no slots: what is asked for by each setting is kept
class Assessment:
    """How far the numbers of a campaign may be trusted; by rising setting."""

    uncertainties: tuple[Uncertainty, ...] = ()  # errors, intervals, correlations
    diagnoses: tuple[Diagnosis, ...] = ()  # what the residuals say
    # Of the parameters that were in doubt, and of those asked for (see `profile_campaign`).
    profiles: tuple[MisfitProfile, ...] = ()
    gas: GasContent | None = None  # what K_e follows from, in a joint fit that asked for it
    forces: tuple[SpeedForces, ...] = ()  # measured over speed, and what the model misses there
    # Why grades are withheld: `damperfit.uncertainty.grades.objections`.
    objections: Mapping[Setting, tuple[Objection, ...]] = field(default_factory=dict)
    apart: tuple[Problem, ...] = ()  # a log whose clock or stroke is off those of all others

    @cached_property
    def _known(self) -> dict[Setting, Uncertainty]:
        return {errors.setting: errors for errors in self.uncertainties}

    def uncertainty(self, setting: Setting) -> Uncertainty | None:
        """Return the errors of a setting; None where none are known."""
        return self._known.get(setting)

    def telling(self, setting: Setting) -> dict[str, MisfitProfile]:
        """Return the closest finished profiles that apply to a setting: its own, R_m3's source."""
        profiles = {p.name: p for p in self.profiles if p.name == TAKEN and p.is_shared}
        mine = [p for p in self.profiles if p.setting == setting]
        for name in {p.name for p in mine}:
            own = (p for p in mine if p.name == name)
            closest = max(own, key=lambda p: (p.is_complete, len(p.points)))
            profiles |= {} if closest.is_partial else {name: closest}
        return profiles

    def limits(self, setting: Setting, name: str) -> tuple[float | None, float | None]:
        """Return the 95 % limits to print, SI; None where the logs set none.

        Of the covariances, or of the profile where the quadratic approximation was in doubt or the
        profile is flat. A profile follows noise: with a misfit the wider limits hold.
        """
        profile, errors = self.telling(setting).get(name), self.uncertainty(setting)
        known = None if errors is None else errors.intervals.get(name)
        if profile is None or not (
            profile.is_flat or (profile.is_complete and profile.is_doubtful)
        ):
            return (None, None) if known is None else (known.low, known.high)
        low, high = profile.low, profile.high
        if known is None or not known.misfit or low is None or high is None:
            return low, high
        return min(low, known.low), max(high, known.high)

    def plausible_limits(self, fit: Fit, name: str) -> tuple[float | None, float | None]:
        """Return the `limits` of a fitted value, SI; of what is not determined within its range.

        Of a blow-off that its logs do not open they exclude what is below the pressure on it.
        """
        low, high = self.limits(fit.setting, name)
        if fit.status[name] == Status.NOT_IDENTIFIABLE:
            least, most = fit.parameters.quantity(name).plausible
            low = None if low is None or low < least else low
            high = None if high is None or high > most else high
            errors = self.uncertainty(fit.setting)
            above = errors.unopened.get(name) if errors else None
            low = low if above is None or above >= getattr(fit.parameters, name) else above
        return low, high

    def unlimited(self, fit: Fit) -> frozenset[str]:
        """Return what the logs of a fit do not determine, and give no upper limit.

        Rigid oil or mounting is none: any stiffness above its limit gives the same force.
        """
        return frozenset(
            quantity.name
            for quantity in fit.parameters.quantities
            if fit.status[quantity.name] == Status.NOT_IDENTIFIABLE
            and not (quantity.is_open or quantity.is_of_mounting)
            and self.plausible_limits(fit, quantity.name)[1] is None
        )

    def verdicts(self, campaign: Campaign) -> dict[Setting, dict[str, str]]:
        """Return a sentence on each parameter, by setting: how it was found, how well, and ties."""
        fits = {fit.setting: fit for fit in campaign.fits}
        sentences = {}
        for known in self.uncertainties:
            fit, profiles = fits[known.setting], self.telling(known.setting)
            ties: dict[str, str] = {}
            for name, other, value in sorted(known.ties, key=lambda tie: abs(tie[2])):
                ties[name] = f", correlated with {other} ({value:+.2f})"
                ties[other] = f", correlated with {name} ({value:+.2f})"
            sentences[fit.setting] = {
                n: _verdict(n, fit, known, profiles.get(n), campaign.sharing, ties.get(n, ""))
                for n in fit.parameters.names
            }
        return sentences

    def doubts(self, campaign: Campaign) -> tuple[Problem, ...]:
        """Return what a reader must know of the parameters first: the undetermined, and ties."""
        fitted = {fit.setting for fit in campaign.fits}
        ties: dict[tuple[str, str], list[tuple[Setting, float]]] = defaultdict(list)
        for known in (known for known in self.uncertainties if known.setting in fitted):
            for name, other, value in known.ties:
                ties[name, other].append((known.setting, value))
        problems = list(self.undetermined(campaign))
        symbol_of = {quantity.name: quantity.symbol for quantity in campaign.quantities}
        for (name, other), where in ties.items():
            low, high = min(value for _, value in where), max(value for _, value in where)
            spread = f"{low:+.2f} to {high:+.2f}" if high - low > 0.005 else f"{low:+.2f}"
            text = (
                "{symbols} are strongly correlated at {settings} ({correlation}): "
                "the logs determine their combination better than each"
            )
            values = {"quantity": name, "other": other, "correlation": spread}
            values["symbols"] = f"{symbol_of[name]} and {symbol_of[other]}"
            values["settings"] = of_settings(setting for setting, _ in where)
            problems.append(warning("correlated", text, **values))
        return tuple(problems)

    def undetermined(self, campaign: Campaign) -> tuple[Problem, ...]:
        """Return each way in which parameters are at a bound or not determined, and where."""
        where: dict[tuple[str, Status, str], list[Setting]] = defaultdict(list)
        for fit in (fit for fit in campaign.fits if fit.setting in self._known):
            known, profiles = self._known[fit.setting], self.telling(fit.setting)
            for name, status in ((name, s) for name, s in fit.status.items() if s.has_failed):
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

    @property
    def warnings(self) -> tuple[Problem, ...]:
        """Logs with a motion apart; of each kind of misfit that repeats the settings it is at.

        A misfit without a cause is one where it is 1 % of the force; the report has smaller ones.
        """
        groups: dict[str, list[Diagnosis]] = defaultdict(list)
        for diagnosis in self.diagnoses:
            hints, is_much = diagnosis.hints, diagnosis.repeating_percent > _MATTERS
            if diagnosis.is_structured and (hints or is_much):
                groups[hints[0].name if hints else ""].append(diagnosis)
        return (*self.apart, *(group_warning(group) for group in groups.values()))

    @property
    def sentences(self) -> tuple[str, ...]:
        """Noise and lack of fit: one for each structured setting, one for all the others."""
        single = [d for d in self.diagnoses if math.isnan(d.noise_percent)]
        quiet = [d for d in self.diagnoses if not d.is_structured and d not in single]
        loud = [d for d in self.diagnoses if d.is_structured]
        sentences = [f"setting {d.setting}: {d.sentence}" for d in (*loud, *single)]
        if quiet:
            least = min(100.0 * d.noise_percent / max(d.mse_percent, 1e-300) for d in quiet)
            text = (
                f"{of_settings(d.setting for d in quiet)}: no misfit repeats from cycle to cycle; "
            )
            sentences.insert(len(loud), f"{text}noise makes up {least:.0f} % of the MSE or more")
        return tuple(sentences)


class _Alone(NamedTuple):
    """What is known of a setting by itself."""

    linearised: Linearisation
    diagnosis: Diagnosis
    forces: tuple[tuple[SpeedForces, Slopes], ...]
    friction: BySpeed | None


def _with_hidden_friction(
    settings: Sequence[_Alone],
) -> tuple[list[Linearisation], tuple[Problem, ...]]:
    """The settings with a friction by speed that they show together, no other misfit beside it."""
    linearised, name = [setting.linearised for setting in settings], "friction_with_speed"
    is_other = any(s.diagnosis.is_structured and name not in s.linearised.flawed for s in settings)
    known = [setting.friction for setting in settings if setting.friction is not None]
    place, amount = hidden_friction(known)
    if is_other or len(known) < len(settings) or not amount:
        return linearised, ()
    with_friction = [
        replace(linear, flawed={name: amount * friction.pulls[place], **linear.flawed})
        for linear, friction in zip(linearised, known, strict=True)
    ]
    logs = (log for linear in linearised for log in linear.fit.logs)
    warned = {x.code for log in logs for x in log.trace.findings if x.severity == "warning"}
    if warned & _CHANGES or any(name in linear.flawed for linear in linearised):
        return with_friction, ()
    text = "{settings}: a small misfit looks like {words}; the intervals allow for it."
    where = of_settings(setting.diagnosis.setting for setting in settings)
    problem = warning(
        "misfit-of-all", text, settings=where, words=FLAWS[name].words(amount), flaw=name
    )
    return with_friction, (problem,)


def assess(
    campaign: Campaign,
    damper: Model,
    *,
    solver: SolverOptions = SolverOptions(tolerance=1e-2),
    jobs: int = 1,
    cancelled: Callable[[], bool] = lambda: False,
    on_error: OnError | None = None,
) -> Assessment:
    """Judge every setting of a campaign, the result of `damperfit.identification.identify`.

    Costs one simulation for each log, and 0.7 of what its fit has cost at most where a
    parameter's error is so large that the quadratic approximation is in doubt. `cancelled` is asked
    before each simulation of a profile; when it returns True no more are traced. An error met while
    judging a setting is passed to `on_error`, or raised.
    """
    frictions = tuple(quantity.name for quantity in damper.quantities if quantity.is_friction)
    sharing = campaign.sharing
    doubted = frictions if sharing.friction_varies else ()

    def alone(fit: Fit) -> _Alone | None:
        own = replace(campaign, fits=(fit,))
        for linear in linearise_settings(own, damper, solver=solver, on_error=on_error):
            with sparing(fit.setting, on_error):
                diagnosis, pulls = diagnose(linear, doubted=doubted)
                is_structured = diagnosis.is_structured
                over_speed = speed_forces(linear, is_structured=is_structured)
                seen = linear.summed(is_structured=is_structured, pulls=pulls)
                return _Alone(seen, diagnosis, over_speed, friction_by_speed(linear))
        return None

    with executor(jobs) as pool, one_blas_thread():
        assessed = [setting for setting in pool.map(alone, campaign.fits) if setting is not None]
    everywhere, together = _with_hidden_friction(assessed)
    errors = uncertainties(everywhere, sharing, on_error=on_error)
    known = {e.setting: e for e in with_least_openings(errors, everywhere, sharing, damper)}
    linearised = [linear for linear in everywhere if linear.fit.setting in known]
    bench = Bench(damper, solver, cancelled, jobs, sharing, known)

    def doubtful(linear: Linearisation) -> tuple[MisfitProfile, ...]:
        setting = linear.fit.setting
        with sparing(setting, on_error), suppress(SimulationError, FitCancelledError):
            return doubtful_profiles(linear, bench)
        return ()

    with executor(jobs) as pool, one_blas_thread():
        profiles = tuple(p for several in pool.map(doubtful, linearised) for p in several)
    return Assessment(
        uncertainties=tuple(known.values()),
        diagnoses=reconciled(s.diagnosis for s in assessed if s.diagnosis.setting in known),
        profiles=(*profiles, *shared_limits(linearised, bench)),
        gas=gas_content(linearised, sharing),
        forces=tuple(
            beside_the_rig(force, slopes, seen.linearised.fit, known[setting], damper)
            if (setting := seen.diagnosis.setting) in known
            else force
            for seen in assessed
            for force, slopes in seen.forces
        ),
        apart=(
            *motions_apart(campaign),
            *shared_apart(linearised, sharing),
            *gas_in_offset(campaign, damper),
            *together,
        ),
    )


def profile_campaign(
    campaign: Campaign,
    assessment: Assessment,
    bench: Bench,
    *,
    names: Sequence[str],
    on_error: OnError | None = None,
) -> Assessment:
    """Return the assessment with full profiles of some parameters, by name, at every setting.

    A parameter that is fixed, or a setting whose fit is no minimum, has none. Settings that were
    finished when the caller asked to stop are kept. An error at a setting is passed to
    `on_error`, or raised; a ConfigurationError: a name is not known.
    """
    check_profile_names(names, bench.damper.names)
    sharing, known = campaign.sharing, {e.setting: e for e in assessment.uncertainties}
    bench = bench._replace(sharing=sharing, known=known)
    fits = tuple(fit for fit in campaign.fits if fit.setting in known)
    structured = {d.setting for d in assessment.diagnoses if d.is_structured}

    def seen(fit: Fit) -> list[Linearisation]:
        own = replace(campaign, fits=(fit,))
        linearised = linearise_settings(own, bench.damper, solver=bench.solver)
        return [linear.summed(is_structured=fit.setting in structured) for linear in linearised]

    with executor(bench.jobs) as pool, one_blas_thread():
        each = list(pool.map(seen, fits))
    linearised = {linear.fit.setting: linear for few in each for linear in few}
    finished: list[MisfitProfile] = []

    def traced(name: str, linear: Linearisation) -> MisfitProfile | None:
        with sparing(linear.fit.setting, on_error), suppress(SimulationError, FitCancelledError):
            return profile_at(name, linear, bench)
        return None

    with executor(bench.jobs) as pool, one_blas_thread():
        for name in dict.fromkeys(names):
            for unknown in sharing.unknowns if name in sharing.jointly else ():
                first = next((s for s in sharing.settings if unknown.holds_at(s)), None)
                if unknown.name != name or first is None:
                    continue
                with sparing(first, on_error), suppress(SimulationError, FitCancelledError):
                    for profile in profile_jointly(unknown, [*linearised.values()], bench):
                        is_so = bench.is_doubtful(name, linearised[profile.setting].fit)
                        finished.append(replace(profile, is_doubtful=is_so))
            if name not in sharing.jointly:
                settings = [linearised[setting] for setting in sorted(linearised)]
                profiles = pool.map(lambda linear, name=name: traced(name, linear), settings)
                finished.extend(profile for profile in profiles if profile is not None)
    return replace(assessment, profiles=(*assessment.profiles, *finished))
