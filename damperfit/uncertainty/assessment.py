"""A campaign judged: intervals and diagnoses of every setting, and the sentences they make."""

from __future__ import annotations

import math
from collections import defaultdict
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

from damperfit.errors import FitCancelledError, SimulationError, sparing
from damperfit.identification.blas_threads import one_blas_thread
from damperfit.identification.outcome import Status
from damperfit.identification.paper import TAKEN
from damperfit.identification.sharing import of_settings
from damperfit.problem import warning
from damperfit.simulation import SolverOptions
from damperfit.statistics import percentiles
from damperfit.uncertainty.covariance import GasContent, Uncertainty, gas_content, uncertainties
from damperfit.uncertainty.flaws import BySpeed, friction_by_speed, hidden_friction, words_of
from damperfit.uncertainty.linearisation import linearise_settings
from damperfit.uncertainty.options import check_profile_names
from damperfit.uncertainty.profiles import (
    Bench,
    MisfitProfile,
    Stride,
    doubtful_profiles,
    is_doubtful,
    profile_at,
    profile_jointly,
    shared_limits,
)
from damperfit.uncertainty.residuals import Diagnosis, diagnose, group_warning, reconciled
from damperfit.uncertainty.speed_forces import SpeedForces, speed_forces
from damperfit.uncertainty.verdicts import (
    doubts,
    motions_apart,
    shared_apart,
    undetermined,
    verdicts,
    with_least_openings,
)
from damperfit.workers import apart, executor, told_here

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from damperfit.damper.model import Model
    from damperfit.errors import OnError
    from damperfit.identification import Campaign, Fit
    from damperfit.problem import Problem
    from damperfit.tested.setting import Setting
    from damperfit.uncertainty.grades import Objection
    from damperfit.uncertainty.linearisation import Linearisation

# Of an MSE in per cent: a misfit of 1 % of the force.
_MATTERS = 0.01
# A jackknife over 15 cycles scatters by a fifth; below this it misses something.
_BLIND = 0.4

METHOD = (
    "Errors and 95 % intervals: sandwich covariance on the logarithm of the parameter with the "
    "residuals' own autocorrelation; the errors of shared parameters are included. Where a misfit "
    "repeats, an error from the model's misfit, estimated from blocks of the cycle, is added; so "
    "is what was held at a default that nobody has measured."
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
        return {one.setting: one for one in self.uncertainties}

    def uncertainty(self, setting: Setting) -> Uncertainty | None:
        """Return the errors of a setting; None where none are known."""
        return self._known.get(setting)

    def profile(self, setting: Setting, name: str) -> MisfitProfile | None:
        """Return the closest finished profile of a parameter at a setting, if there is one."""
        mine = [p for p in self.profiles if (p.setting, p.name) == (setting, name)]
        return max(mine, key=lambda p: (p.is_complete, len(p.points)), default=None)

    def telling(self, setting: Setting) -> dict[str, MisfitProfile]:
        """Return the profiles that speak of a setting: its own, and R_m3's from its source."""
        found = {p.name: p for p in self.profiles if p.name == TAKEN and p.is_shared}
        for name in {p.name for p in self.profiles}:
            own = self.profile(setting, name)
            if own is not None and not own.is_partial:
                found[name] = own
        return found

    def limits(self, setting: Setting, name: str) -> tuple[float | None, float | None]:
        """Return the 95 % limits to print, SI; None where the logs set none.

        Those of the covariances, or of the profile where the quadratic approximation was in doubt
        or the profile is flat. A profile follows noise: with a misfit the wider limits hold.
        """
        profile, errors = self.telling(setting).get(name), self.uncertainty(setting)
        known = None if errors is None else errors.intervals.get(name)
        if profile is not None and (
            profile.is_flat or (profile.is_complete and profile.is_doubtful)
        ):
            low, high = profile.low, profile.high
            if known is None or not known.misfit or low is None or high is None:
                return low, high
            return min(low, known.low), max(high, known.high)
        return (None, None) if known is None else (known.low, known.high)

    def plausible_limits(self, fit: Fit, name: str) -> tuple[float | None, float | None]:
        """Return the `limits` of a fitted value, SI.

        What its logs do not determine has none beyond its plausible range: they exclude nothing,
        but of a blow-off that they do not open what is below the pressure that they put on it.
        """
        low, high = self.limits(fit.setting, name)
        if fit.status[name] == Status.NOT_IDENTIFIABLE:
            least, most = fit.parameters.quantity(name).plausible
            low = None if low is None or low < least else low
            high = None if high is None or high > most else high
            errors = self.uncertainty(fit.setting)
            above = math.inf if errors is None else errors.unopened.get(name, math.inf)
            low = above if low is None and above < getattr(fit.parameters, name) else low
        return low, high

    def unlimited(self, fit: Fit) -> frozenset[str]:
        """Return what the logs of a fit do not determine, and give no upper limit.

        Rigid oil is none of them: any stiffness above its limit gives the same force.
        """
        return frozenset(
            name
            for name, status in fit.status.items()
            if status == Status.NOT_IDENTIFIABLE
            and not fit.parameters.quantity(name).is_open
            and self.plausible_limits(fit, name)[1] is None
        )

    def verdicts(self, campaign: Campaign) -> dict[Setting, dict[str, str]]:
        """Return a sentence on each parameter, by setting."""
        fits = {fit.setting: fit for fit in campaign.fits}
        return {
            one.setting: verdicts(
                fits[one.setting], one, campaign.sharing, self.telling(one.setting)
            )
            for one in self.uncertainties
        }

    def doubts(self, campaign: Campaign) -> tuple[Problem, ...]:
        """Return what a reader must know of the parameters before using them."""
        return doubts(campaign, self)

    def undetermined(self, campaign: Campaign) -> tuple[Problem, ...]:
        """Return the part of the doubts on parameters at a bound or not identifiable."""
        return undetermined(campaign, self)

    @property
    def warnings(self) -> tuple[Problem, ...]:
        """Logs with a motion apart; of each kind of misfit that repeats the settings it is at.

        A misfit without a cause is one where it is 1 % of the force; the report has smaller ones.
        """
        groups: dict[str, list[Diagnosis]] = defaultdict(list)
        for one in self.diagnoses:
            if one.is_structured and (one.hints or one.repeating_percent > _MATTERS):
                groups[one.hints[0].name if one.hints else ""].append(one)
        return (*self.apart, *(group_warning(group) for group in groups.values()))

    @property
    def cycle_check(self) -> str:
        """How the errors compare with a jackknife over whole cycles; empty with nothing to say."""
        ratios = [
            interval.cycle_ratio
            for known in self.uncertainties
            for interval in known.intervals.values()
            if math.isfinite(interval.cycle_ratio)
        ]
        if not ratios:
            return ""
        low, middle, high = percentiles(ratios, 5.0, 50.0, 95.0)
        said = (
            "Check of these errors: a jackknife over whole cycles gives "
            f"{middle:.2g} times as much (median; 9 of 10 from {low:.2g} to {high:.2g})"
        )
        return said + (
            "; it cannot see a misfit that repeats in every cycle, and the larger errors are given."
            if low < _BLIND
            else "."
        )

    @property
    def sentences(self) -> tuple[str, ...]:
        """Noise and lack of fit: one for each structured setting, one for all the others."""
        said = [f"setting {d.setting}: {d.sentence}" for d in self.diagnoses if d.is_structured]
        single = [d for d in self.diagnoses if math.isnan(d.noise_percent)]
        quiet = [d for d in self.diagnoses if not d.is_structured and d not in single]
        if quiet:
            least = min(100.0 * d.noise_percent / max(d.mse_percent, 1e-300) for d in quiet)
            said.append(
                f"{of_settings(d.setting for d in quiet)}: no misfit repeats from cycle to "
                f"cycle; noise makes up {least:.0f} % of the MSE or more"
            )
        said.extend(f"setting {d.setting}: {d.sentence}" for d in single)
        return tuple(said)


class _Alone(NamedTuple):
    """What is known of a setting by itself."""

    linearised: Linearisation
    diagnosis: Diagnosis
    forces: tuple[SpeedForces, ...]
    friction: BySpeed | None


def _with_hidden_friction(
    found: Sequence[_Alone],
) -> tuple[list[Linearisation], tuple[Problem, ...]]:
    """Return the settings with a friction by speed that they show together, and a word on it.

    Where a misfit of another cause shows, what is below it is not looked for.
    """
    linearised = [one.linearised for one in found]
    name = "friction_with_speed"
    named = [one for one in found if name in one.linearised.flawed]
    others = [one for one in found if one.diagnosis.is_structured and one not in named]
    known = [one.friction for one in found if one.friction is not None]
    place, amount = hidden_friction(known)
    if others or len(known) < len(found) or not amount:
        return linearised, ()
    linearised = [
        replace(one, flawed={name: amount * friction.pulls[place], **one.flawed})
        for one, friction in zip(linearised, known, strict=True)
    ]
    if named:
        return linearised, ()
    text = "{settings}: a small misfit is as from {words}; the intervals allow for it."
    where = of_settings(one.diagnosis.setting for one in found)
    told = warning("misfit-of-all", text, settings=where, words=words_of(name, amount), flaw=name)
    return linearised, (told,)


def assess(
    campaign: Campaign,
    damper: Model,
    *,
    solver: SolverOptions = SolverOptions(tolerance=1e-2),
    jobs: int = 1,
    cancelled: Callable[[], bool] = lambda: False,
    on_error: OnError | None = None,
) -> Assessment:
    """Judge every setting of a campaign.

    Costs one simulation for each log, and 0.7 of what its fit has cost at most where a
    parameter's error is so large that the quadratic approximation is in doubt.

    Parameters
    ----------
    campaign : Campaign
        Result of `damperfit.identification.identify`.
    damper : Model
        The damper's model.
    solver : SolverOptions
        How exactly to integrate.
    jobs : int
        Workers.
    cancelled : callable, optional
        Asked before each simulation of a profile; when it returns True no more are traced.
    on_error : callable, optional
        Told of a setting and the error that judging it has met; without it such an error is raised.
    """
    frictions = tuple(one.name for one in damper.quantities if one.is_friction)
    sharing = campaign.sharing
    doubted = frictions if sharing.friction_varies else ()
    take = None if on_error is None else told_here(on_error)

    def alone(fit: Fit) -> _Alone | None:
        own = replace(campaign, fits=(fit,))
        for one in linearise_settings(own, damper, solver=solver, on_error=take):
            with sparing(fit.setting, take):
                diagnosis, pulls = diagnose(one, doubted=doubted)
                is_structured = diagnosis.is_structured
                over_speed = tuple(speed_forces(one, is_structured=is_structured))
                seen = one.summed(is_structured=is_structured, pulls=pulls)
                return _Alone(seen, diagnosis, over_speed, friction_by_speed(one))
        return None

    each = apart(alone, campaign.fits, jobs=jobs, known=(*campaign.fits, damper))
    found = [one for one in each if one is not None]
    everywhere, told_together = _with_hidden_friction(found)
    errors = uncertainties(everywhere, sharing, on_error=on_error)
    known = {one.setting: one for one in with_least_openings(errors, everywhere, sharing, damper)}
    linearised = [one for one in everywhere if one.fit.setting in known]
    bench = Bench(damper, solver, cancelled, jobs)

    def doubtful(one: Linearisation) -> tuple[MisfitProfile, ...]:
        setting = one.fit.setting
        with sparing(setting, on_error), suppress(SimulationError, FitCancelledError):
            return doubtful_profiles(one, known[setting], sharing, bench)
        return ()

    with executor(jobs) as pool, one_blas_thread():
        profiles = tuple(p for several in pool.map(doubtful, linearised) for p in several)
    return Assessment(
        uncertainties=tuple(known.values()),
        diagnoses=reconciled(one.diagnosis for one in found if one.diagnosis.setting in known),
        profiles=(*profiles, *shared_limits(linearised, known, sharing, bench)),
        gas=gas_content(linearised, sharing),
        forces=tuple(force for one in found for force in one.forces),
        apart=(
            *motions_apart(campaign),
            *shared_apart(linearised, sharing),
            *told_together,
        ),
    )


def profile_campaign(
    campaign: Campaign,
    assessment: Assessment,
    bench: Bench,
    *,
    names: Sequence[str],
    stride: Stride = Stride(),
    on_error: OnError | None = None,
) -> Assessment:
    """Return the assessment with full profiles of some parameters at every setting.

    A parameter that is fixed, or a setting whose fit is no minimum, has none. Settings that were
    finished when the caller asked to stop are kept.

    Parameters
    ----------
    campaign, assessment : Campaign, Assessment
        The fits and their errors.
    bench : Bench
        Damper, solver, threads, cancellation.
    names : sequence of str
        Parameters.
    stride : Stride
        How closely.
    on_error : callable, optional
        Told of a setting and the error that it met; without it such an error is raised.

    Raises
    ------
    ConfigurationError
        A name is not known.
    """
    check_profile_names(names, bench.damper.names)
    sharing, known = campaign.sharing, {one.setting: one for one in assessment.uncertainties}
    judged = tuple(fit for fit in campaign.fits if fit.setting in known)
    structured = {one.setting for one in assessment.diagnoses if one.is_structured}

    def seen(fit: Fit) -> list[Linearisation]:
        own = replace(campaign, fits=(fit,))
        found = linearise_settings(own, bench.damper, solver=bench.solver)
        return [one.summed(is_structured=fit.setting in structured) for one in found]

    each = apart(seen, judged, jobs=bench.jobs, known=(*judged, bench.damper))
    linearised = {one.fit.setting: one for few in each for one in few}
    found: list[MisfitProfile] = []

    def traced(name: str, one: Linearisation) -> MisfitProfile | None:
        setting = one.fit.setting
        with sparing(setting, on_error), suppress(SimulationError, FitCancelledError):
            return profile_at(name, one, known[setting], sharing, bench, stride)
        return None

    def together(name: str) -> None:
        for unknown in (one for one in sharing.unknowns if one.name == name):
            first = next(one for one in sharing.settings if unknown.holds_at(one))
            with sparing(first, on_error), suppress(SimulationError, FitCancelledError):
                every = list(linearised.values())
                for one in profile_jointly(
                    unknown, every, known[first], sharing, bench, stride=stride
                ):
                    fit = linearised[one.setting].fit
                    is_so = is_doubtful(name, fit, known[one.setting])
                    found.append(replace(one, is_doubtful=is_so))

    with executor(bench.jobs) as pool, one_blas_thread():
        for name in dict.fromkeys(names):
            if name in sharing.jointly:
                together(name)
                continue
            settings = [linearised[setting] for setting in sorted(linearised)]
            profiles = pool.map(lambda one, name=name: traced(name, one), settings)
            found.extend(one for one in profiles if one is not None)
    return replace(assessment, profiles=(*assessment.profiles, *found))
