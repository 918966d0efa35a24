"""Named checks of a run, each passed, failed or not evaluated, with the reason; which are gates.

A check that cannot be evaluated has passed None and says why. A reason names the settings it speaks
of. A check that was not evaluated is a gate not met: it must not pass. What moves no force
by more than 1 % fails no check: it is a note in the reason of one that passed.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from damperfit.adjustment.trends import LEAST_FOR_TREND, Trend, in_few_words
from damperfit.damper.model import Quantity
from damperfit.errors import ConfigurationError, did_you_mean
from damperfit.identification.fit_setting import Fit
from damperfit.identification.outcome import Status
from damperfit.identification.procedures import Campaign
from damperfit.identification.sharing import of_runs, of_settings
from damperfit.problem import FEW, Key, Problem, listed_names
from damperfit.recording import Trace
from damperfit.tested.setting import ADJUSTER, Setting, clicks_between, lines_of
from damperfit.uncertainty.assessment import Assessment
from damperfit.uncertainty.grades import doubted_cavitation, what_spreads
from damperfit.uncertainty.residuals import Diagnosis

if TYPE_CHECKING:
    from damperfit.adjustment.clicks import Adjustment

_EXPLAINED = 0.5  # share of the MSE
_MATTERS = 0.01  # of the force, or of a parameter, which moves the force by no more
_TURNS_OF_THREE = 0.05  # of a parameter, which three settings show by their errors alone
_Verdict = tuple[bool | None, str]
_FOUND = (Status.FITTED, Status.SHARED)


@dataclass(frozen=True, slots=True)
class Check:
    """One check's result: a name of `CHECKS`, and one sentence that names its settings."""

    name: str
    passed: bool | None  # None: not evaluated
    reason: str


@dataclass(frozen=True, slots=True, eq=False)
class Subject:
    """The fits that are checked, with what was declared of the test."""

    campaign: Campaign  # the fits
    assessment: Assessment  # their residuals and intervals
    adjustment: Adjustment  # the settings compared
    missing: tuple[str, ...] = ()  # logs and settings without a result, by name, and why
    temperature: float = 26.0  # nominal temperature of the test, degrees Celsius
    temperature_tolerance: float = 1.0
    undeclared: tuple[str, ...] = ()  # undeclared figures of the damper
    whose: str = ""  # whose dimensions are taken where none is declared; empty where some is

    @property
    def fits(self) -> tuple[Fit, ...]:
        """The fits, by setting."""
        return self.campaign.fits

    @property
    def traces(self) -> tuple[Trace, ...]:
        """The logs fitted."""
        return tuple(log.trace for fit in self.fits for log in fit.logs)


def _mse_below_1_percent(subject: Subject) -> _Verdict:
    """The MSE of every setting is below 1 %."""
    from damperfit.identification.fit_setting import EXCELLENT

    def misfit(fit: Fit) -> tuple[bool, float]:
        return not fit.mse_percent < math.inf, fit.mse_percent

    above = [fit for fit in subject.fits if not fit.mse_percent < EXCELLENT]
    worst = max(above or subject.fits, key=misfit)
    place = f"{worst.mse_percent:.3g} % at setting {worst.setting}"
    if above:
        return False, f"MSE is 1 % or more at {_settings(above)}, worst {place}"
    return True, f"worst MSE {place}"


def _no_parameter_at_bound(subject: Subject) -> _Verdict:
    """No parameter is at the edge of its plausible range."""
    state = "at a bound of its plausible range"
    bad = _with_status(subject, Status.AT_BOUND, f"is {state}")
    return not bad, bad or f"no fitted parameter is {state}"


def _all_parameters_identifiable(subject: Subject) -> _Verdict:
    """The logs determine every free parameter."""
    bad = _with_status(subject, Status.NOT_IDENTIFIABLE, "is not determined by the logs")
    return not bad, bad or "the logs determine every parameter that was fitted"


def _with_status(subject: Subject, status: Status, words: str) -> str:
    by_name = {
        name: [
            f for f in subject.fits if f.status[name] == status and not _is_rigid(subject, f, name)
        ]
        for name in subject.fits[0].parameters.names
    }
    return "; ".join(
        f"{_symbol(subject, name)} {words} at {_settings(fits)}"
        for name, fits in by_name.items()
        if fits
    )


def _symbol(subject: Subject, name: str) -> str:
    return subject.fits[0].parameters.quantity(name).symbol


def _is_rigid(subject: Subject, fit: Fit, name: str) -> bool:
    """Whether the logs show a rigid mounting: any stiffness above a limit fits."""
    is_mounting = fit.parameters.quantity(name).is_of_mounting
    is_unknown = is_mounting and fit.status[name] == Status.NOT_IDENTIFIABLE
    return is_unknown and subject.assessment.plausible_limits(fit, name)[1] is None


def _no_cavitation(subject: Subject) -> _Verdict:
    """No chamber reaches zero pressure."""
    empty = [fit for fit in subject.fits if fit.cavitation.fraction > 0.0]
    finite = [fit for fit in subject.fits if math.isfinite(fit.cavitation.r_m3_margin)]
    if empty:
        worst = max(empty, key=lambda fit: fit.cavitation.fraction)
        share = f"{100.0 * worst.cavitation.fraction:.1f} % of the cycle at setting"
        reason = f"a chamber cavitates at {_settings(empty)}, most for {share} {worst.setting}"
        if doubted := doubted_cavitation(subject.assessment.objections):
            settings = of_settings(doubted)
            reason += f"; the model does not match the logs of {settings}: it may be full"
        return False, reason
    if not finite:
        return True, "no chamber reaches zero pressure"
    nearest = min(finite, key=lambda fit: fit.cavitation.r_m3_margin)
    margin = f"{100.0 * nearest.cavitation.r_m3_margin:.0f} % at setting {nearest.setting}"
    return True, f"no chamber reaches zero pressure; R_m3 may rise by {margin}, elsewhere by more"


def _trend_monotone(subject: Subject) -> _Verdict:
    """Valves rise or fall throughout, within errors, scatter and 1 %."""
    trends = subject.adjustment.trends
    evaluated = [trend for trend in trends if trend.monotone is not None]
    if not evaluated:
        turns = "; ".join(_turns_of_three(subject))
        return (False, turns) if turns else (None, _no_trend(subject))
    turning = [trend for trend in evaluated if not trend.monotone]
    if bad := [trend.sentence for trend in turning if _turn_of(trend) > _MATTERS]:
        return False, "; ".join(bad)
    directions = {"rising": "rises", "falling": "falls", "flat": "stays constant"}
    lines: dict[str, list[str]] = defaultdict(list)
    for trend in evaluated:
        by = "the setting" if trend.adjuster == ADJUSTER else trend.adjuster
        by += f" ({trend.held})" if trend.held else ""
        lines[by].append(f"{trend.symbol} {directions[trend.direction or '']}")
    text = "; with ".join(f"{by} {', '.join(trends)}" for by, trends in lines.items())
    unknown = [trend for trend in trends if trend.monotone is None]
    notes = [f"; {trend.symbol} is not determined" for trend in unknown]
    notes += [f"; {trend.symbol} turns by less than 1 %" for trend in turning]
    return True, f"with {text}, within errors and scatter{''.join(notes)}"


def _turns_of_three(subject: Subject) -> Iterator[str]:
    """Yield the valves of three settings that turn at the middle one, far beyond their errors."""
    for line in lines_of(fit.setting for fit in subject.fits):
        fits = [fit for fit in subject.fits if fit.setting in line.numbers]
        if len(fits) != LEAST_FOR_TREND - 1:
            continue
        fits.sort(key=lambda fit: line.numbers[fit.setting])
        place = f"{line.adjuster} {line.numbers[fits[1].setting]:g}"
        for q in fits[0].parameters.quantities:
            if not q.is_logarithmic or q.is_open or q.is_friction:
                continue
            limits = [subject.assessment.limits(fit.setting, q.name) for fit in fits]
            pairs = [(low, high) for low, high in limits if low and high]
            if len(pairs) < len(fits) or any(fit.status[q.name] != Status.FITTED for fit in fits):
                continue
            first, (low, high), last = pairs
            times = max(low / max(first[1], last[1]), min(first[0], last[0]) / high)
            if times > 1.0 + _TURNS_OF_THREE:
                yield (
                    f"{q.symbol} turns at {place}, by {100.0 * (times - 1.0):.0f} % or more: are "
                    "settings mixed up?"
                )


def _turn_of(trend: Trend) -> float:
    """Return by how much a parameter goes against its direction, at most, as a share of it."""
    values = {point.setting: point.found for point in trend.points}
    turns = [(values.get(a), values.get(b)) for a, b in trend.reversals]
    return max((abs(b / a - 1.0) if a and b else math.inf for a, b in turns), default=math.inf)


def _no_outlier_setting(subject: Subject) -> _Verdict:
    """No setting is off the trend of the others by more than 1 %."""
    trends = subject.adjustment.trends
    evaluated = [trend for trend in trends if trend.outliers_judged]
    if not evaluated:
        return None, _no_trend(subject)
    off: dict[tuple[str, str, float], list[str]] = defaultdict(list)
    for trend in evaluated:
        for outlier in trend.outliers:
            if abs(outlier.deviation) > _MATTERS:
                deviation = f"{trend.symbol} {100.0 * outlier.deviation:+.1f} %"
                off[trend.adjuster, trend.held, outlier.setting].append(deviation)
    if off:
        places = (
            f"{adjuster} {clicks:g}{f' with {held}' if held else ''} ({', '.join(parameters)})"
            for (adjuster, held, clicks), parameters in sorted(off.items())
        )
        return False, f"off the trend of the others: {', '.join(places)}"
    mixed_up = [trend for trend in trends if trend.is_erratic and not trend.outliers_judged]
    if mixed_up:
        return None, "; ".join(trend.sentence for trend in mixed_up)
    small = [outlier for trend in evaluated for outlier in trend.outliers]
    limit = " by more than 1 %" if small else ""
    symbols = ", ".join(trend.symbol for trend in evaluated)
    return True, f"no setting is off the trend of {symbols}{limit}"


def _no_trend(subject: Subject) -> str:
    sentences = in_few_words(subject.adjustment.trends)
    return "; ".join(sentences) or "no parameter was fitted setting by setting"


def _every_click_counts(subject: Subject) -> _Verdict:
    """Every click changes the force at some speed by more than its error."""
    clicks = subject.adjustment.clicks
    if not clicks:
        return None, "there are no two settings to compare"
    if any(math.isnan(click.low) for click in clicks):
        return None, "the errors of the forces are not known"
    moves: dict[tuple[Setting, Setting], bool] = defaultdict(bool)
    for click in clicks:
        moves[click.first, click.second] |= not click.low <= 0.0 <= click.high
    if dead := [f"{a} to {b}" for (a, b), is_moved in moves.items() if not is_moved]:
        return False, f"no force changes from setting {', '.join(dead)} by more than its error"
    is_wide = any((clicks_between(*step) or 0.0) > 1.0 for step in moves)
    step = "every step from one tested setting to the next" if is_wide else "every click"
    return True, f"{step} changes the force by more than its error"


def _residuals_white(subject: Subject) -> _Verdict:
    """No misfit above 1 % of the force repeats from cycle to cycle."""
    structured, large, unknown = _repeating(subject)
    if not structured or (unknown and not large):
        return (None, unknown) if unknown else (True, "no misfit repeats from cycle to cycle")
    worst = max(structured, key=_repeats_by)
    most = f"{100.0 * _repeats_by(worst):.2g} % of the force at setting {worst.setting}"
    if large:
        settings = of_settings(diagnosis.setting for diagnosis in large)
        return False, f"the misfit repeats from cycle to cycle at {settings}, most {most}"
    return True, f"lack of fit is below 1 % of the force: at most {most}"


def _repeats_by(diagnosis: Diagnosis) -> float:
    """Return the rms of what repeats over that of the force about its mean."""
    return math.sqrt(diagnosis.repeating_percent / 100.0)


def _noise_floor_explained(subject: Subject) -> _Verdict:
    """Noise explains half of the MSE, or the repeating misfit is below 1 % of the force."""
    _, large, unknown = _repeating(subject)
    short = [d for d in large if d.noise_percent < _EXPLAINED * d.mse_percent]
    if short:
        worst = min(short, key=lambda diagnosis: diagnosis.noise_percent / diagnosis.mse_percent)
        settings = of_settings(diagnosis.setting for diagnosis in short)
        share = 100.0 * worst.noise_percent / worst.mse_percent
        most = f"setting {worst.setting}: {share:.2g} % of its {worst.mse_percent:.3g} %"
        return False, f"noise explains less than half of the MSE at {settings}, least at {most}"
    result = "noise explains half of the MSE or more, or lack of fit is below 1 % of the force"
    return (None, unknown) if unknown else (True, f"{result}, at every setting")


def _repeating(subject: Subject) -> tuple[list[Diagnosis], list[Diagnosis], str]:
    """Return the diagnoses with lack of fit, those above 1 %, and why settings have none."""
    diagnoses = subject.assessment.diagnoses
    single = [diagnosis.setting for diagnosis in diagnoses if math.isnan(diagnosis.noise_percent)]
    lacking = {fit.setting for fit in subject.fits} - {diagnosis.setting for diagnosis in diagnoses}
    reasons = []
    if single:
        settings = of_settings(single)
        reasons.append(f"a single cycle cannot separate noise from lack of fit, at {settings}")
    if lacking:
        reasons.append(f"the residuals were not evaluated, at {of_settings(lacking)}")
    structured = [d for d in diagnoses if d.is_structured and d.setting not in single]
    return structured, [d for d in structured if _repeats_by(d) > _MATTERS], "; ".join(reasons)


def _temperature_in_window(subject: Subject) -> _Verdict:
    """Every log was taken within the temperature window."""
    centre, reach = subject.temperature, subject.temperature_tolerance
    if not math.isfinite(reach):
        return None, "the configuration requires no temperature (rig.temperature_tolerance = inf)"
    window = f"{centre - reach:g} to {centre + reach:g} degC"
    outside, unknown = [], []
    for trace in subject.traces:
        # The window of the paper's test asks nothing of another motion.
        if any((f.code, f.severity) == ("temperature", "note") for f in trace.findings):
            continue
        if trace.temperature is None:
            unknown.append(trace.name)
        elif not abs(trace.temperature - centre) <= reach:
            outside.append(f"setting {trace.setting} ({trace.name}, {trace.temperature:.1f} degC)")
    if outside:
        return False, f"outside {window}: {_named(outside)}"
    if unknown:
        count = f"{len(unknown)} of {len(subject.traces)} logs"
        return None, (
            f"no temperature in {count} ({unknown[0]}); the test asks for {window}; without a "
            "sensor set rig.temperature_tolerance = inf"
        )
    return True, f"all logs within {window}"


def _damper_declared(subject: Subject) -> _Verdict:
    """Every key of [damper] is declared."""
    if subject.whose:
        text = f"no damper is declared: {subject.whose} is assumed; declare yours in [damper] of a"
        return None, f"{text} configuration"
    if names := ", ".join(subject.undeclared):
        return False, f"[damper] is declared without {names}: defaults are used for these"
    return True, "every key of [damper] is declared"


def _every_setting_fitted(subject: Subject) -> _Verdict:
    """Every log and setting has a result."""
    reasons = [_named(subject.missing, "; ")] if subject.missing else []
    if not subject.campaign.is_complete:
        reasons.append("interrupted before every setting was done")
    if subject.campaign.gaps:
        reasons.append(f"no result for {of_runs(subject.campaign.gaps)}")
    if reasons:
        return False, "; ".join(reasons)
    done = bool(subject.fits)
    return done, f"{_settings(subject.fits)} fitted" if done else "no setting could be fitted"


def _fits_converged(subject: Subject) -> _Verdict:
    """Every fit converged to a minimum."""
    bad = [fit for fit in subject.fits if not fit.outcome.is_minimum]
    if bad:
        settings = [f"setting {fit.setting} ({fit.outcome.value})" for fit in bad]
        return False, f"no minimum was reached at {_named(settings)}"
    if any(problem.code == "no-minimum" for problem in subject.campaign.warnings):
        return False, "the joint fit stopped before its minimum"
    return True, "every fit converged to a minimum"


def _no_log_warnings(subject: Subject) -> _Verdict:
    """No log has a warning."""
    warned: dict[str, set[Setting]] = defaultdict(set)
    for trace in subject.traces:
        for finding in trace.findings:
            if finding.severity == "warning":
                warned[finding.code] |= {trace.setting} - {None}  # type: ignore[arg-type]
    if warned:
        listed = (f"{name} at {of_settings(sorted(at))}" for name, at in warned.items())
        return False, f"the logs carry warnings: {', '.join(listed)}"
    return True, "no log carries a warning"


def _settings(fits: Iterable[Fit]) -> str:
    return of_settings(fit.setting for fit in fits)


def _named(names: Sequence[str], mark: str = ", ") -> str:
    return listed_names(names, few=FEW, mark=mark)


# Against physics and the log itself, by the objections that withhold a grade: both agree.


def _every_grade_stands(subject: Subject) -> _Verdict:
    """No grade is withheld."""
    for first, objections in subject.assessment.objections.items():
        settings = of_settings(subject.assessment.objections)
        reasons = "; ".join(objection.sentence for objection in objections)
        return False, f"grades are withheld at {settings}; setting {first}: {reasons}"
    return True, f"no objection to the grade of {_settings(subject.fits)}"


def _bulk_modulus_of_oil(subject: Subject) -> _Verdict:
    """K_e is one that oil can have."""
    names = _quantities(subject, lambda q: q.unit == "Pa" and math.isfinite(q.believable[1]))
    if not names:
        return None, "the oil of the model is incompressible"
    return _unless_objected(subject, subject.fits, names, "beyond", "that of oil")


def _offset_as_in_log(subject: Subject) -> _Verdict:
    """The offset f_0 agrees with the offset that the log shows."""
    names = _quantities(subject, lambda q: q.is_offset)
    if not names:
        return None, "the model has no offset of the force"
    against = _against(subject, names, "offset")
    return not against, against or "no offset contradicts the level of the force in the logs"


def _friction_within_jump(subject: Subject) -> _Verdict:
    """Friction needs no more than the jump of the force at the reversals."""
    names = _quantities(subject, lambda q: q.is_friction)
    if not names:
        return None, "the model has no friction"
    readable = [fit for fit in subject.fits if not what_spreads(fit)]
    if not readable:
        return None, what_spreads(subject.fits[0])
    return _unless_objected(
        subject, readable, names, "friction", "within the jump of the force at the reversals"
    )


def _series_stiffness_found(subject: Subject) -> _Verdict:
    """A fitted elasticity of the mounting was really found."""
    names = _quantities(subject, lambda q: q.unit == "N/m")
    if not names:
        return None, "the model has no stiffness in series"
    undetermined = [
        fit
        for fit in subject.fits
        for name in names
        if fit.status[name].has_failed and not _is_rigid(subject, fit, name)
    ]
    if undetermined:
        symbols = " and ".join(_symbol(subject, name) for name in names)
        return False, f"{symbols} is not determined by the logs at {_settings(undetermined)}"
    return _unless_objected(subject, subject.fits, names, "beyond", "in the range of test rigs")


def _quantities(subject: Subject, belongs: Callable[[Quantity], bool]) -> tuple[str, ...]:
    return tuple(q.name for q in subject.fits[0].parameters.quantities if belongs(q))


def _unless_objected(
    subject: Subject, fits: Sequence[Fit], names: Sequence[str], kind: str, result: str
) -> _Verdict:
    """Fail with the first objection, pass where the logs determine a value; else not evaluated."""
    if against := _against(subject, names, kind):
        return False, against
    determined = [fit for fit in fits if any(fit.status[name] in _FOUND for name in names)]
    symbols = [_symbol(subject, name) for name in names]
    if not determined:
        return None, f"no log determined {' or '.join(symbols)}"
    return True, f"{' and '.join(symbols)} is {result} at {_settings(determined)}"


def _against(subject: Subject, names: Sequence[str], kind: str) -> str:
    """Return where there are objections of a kind, and the first of them; empty: none."""
    against = {
        setting: objection.sentence
        for setting, objections in subject.assessment.objections.items()
        for objection in objections
        if objection.kind == kind and objection.quantity in names
    }
    prefix = f"at {of_settings(against)}: " if len(against) > 1 else ""
    return next((f"{prefix}setting {first}: {text}" for first, text in against.items()), "")


# A check is a function of the subject, whose docstring the manual shows, and a line here.
CHECKS: dict[str, Callable[[Subject], _Verdict]] = {
    check.__name__[1:]: check
    for check in (
        _every_setting_fitted,
        _fits_converged,
        _mse_below_1_percent,
        _no_parameter_at_bound,
        _all_parameters_identifiable,
        _no_cavitation,
        _residuals_white,
        _noise_floor_explained,
        _trend_monotone,
        _no_outlier_setting,
        _every_click_counts,
        _temperature_in_window,
        _no_log_warnings,
        _damper_declared,
        _every_grade_stands,
        _bulk_modulus_of_oil,
        _offset_as_in_log,
        _friction_within_jump,
        _series_stiffness_found,
    )
}


def run_checks(subject: Subject) -> tuple[Check, ...]:
    """Return the result of every check, in the order of `CHECKS`."""
    nothing = (None, "no setting could be fitted")
    return tuple(
        Check(
            name, *(check(subject) if subject.fits or check is _every_setting_fitted else nothing)
        )
        for name, check in CHECKS.items()
    )


def unchecked() -> tuple[Check, ...]:
    """Return the result of every check after an internal error: not evaluated."""
    return tuple(Check(name, None, "not evaluated because of an internal error") for name in CHECKS)


# What the paper checked by hand: the MSE at every setting (its section 6), cavitation (6.2), the
# trends of the parameters over the settings (Figs 14 to 16), and the temperature of the test.
CHECK_LISTS: dict[str, tuple[str, ...]] = {
    "purdy2000": (
        "every_setting_fitted",
        "mse_below_1_percent",
        "no_parameter_at_bound",
        "no_cavitation",
        "trend_monotone",
        "no_outlier_setting",
        "temperature_in_window",
    ),
}


def expand_checks(names: Iterable[str], *, pointless: Iterable[str] = ()) -> tuple[str, ...]:
    """Return the checks that names of checks and of lists stand for, each once.

    A minus before its name excludes a check from the lists. Lists go without those that are
    pointless: the declaration of the test excludes their evaluation.

    >>> expand_checks(["no_cavitation", "no_cavitation"])
    ('no_cavitation',)
    >>> "temperature_in_window" in expand_checks(["purdy2000", "-temperature_in_window"])
    False
    """
    pointless = set(pointless)
    chosen: list[str] = []
    excluded: list[str] = []
    for text in names:
        name = text.removeprefix("-")
        if name not in CHECKS and name not in CHECK_LISTS:
            choices = f"{', '.join(CHECKS)} and the lists {', '.join(CHECK_LISTS)}"
            hint = did_you_mean(name, (*CHECKS, *CHECK_LISTS))
            refusal = f"no check {text!r}; there are {choices}.{hint}"
            where = Key(("output", "checks"))
            raise ConfigurationError(refusal, where=where, code="unknown-check")
        members = CHECK_LISTS.get(name, (name,))
        if text.startswith("-"):
            excluded += members
        else:
            chosen += [member for member in members if member == name or member not in pointless]
    if unmatched := [name for name in excluded if name not in chosen and name not in pointless]:
        refusal = (
            f"check '-{unmatched[0]}' excludes a check that was not requested; expected it after a "
            f"list that includes it, as in {next(iter(CHECK_LISTS))},-{unmatched[0]}"
        )
        raise ConfigurationError(refusal, code="unknown-check")
    return tuple(dict.fromkeys(name for name in chosen if name not in excluded))


def missed_gates(checks: Sequence[Check], gates: Iterable[str]) -> tuple[Problem, ...]:
    """Return the gates that are not met, or were not evaluated."""
    results = {check.name: check for check in checks}
    missed = (results[name] for name in gates if not results[name].passed)
    texts = {False: "check {check}: {why}", None: "check not evaluated: {check}: {why}"}
    return tuple(
        Problem(
            "failed-check", texts[check.passed], values={"check": check.name, "why": check.reason}
        )
        for check in missed
    )
