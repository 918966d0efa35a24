"""Which test next: how far further tests would narrow an interval.

A fit of old and new logs together has the covariance of u

    C' = (H + G)^-1 (H C H + S) (H + G)^-1

with C that of the run, H = J'J of its logs, G = J'J of the new test and S the covariance of the
new scores sum h_t, h_t = J_t r_t; J is of the core's sensitivities behind the run's own filter.
Candidates are ranked by one steady cycle, as if the noise s that the run has measured (the scatter
between cycles) were white behind the filter: S = s^2 G n / n_eff. What the best of them promise is
taken from a test as the rig would record it, with its rate and the noise of both channels: noise of
the displacement drives the model, so that the residual is neither white nor independent of J.

Lack of fit that repeats no test of the same kind reduces: that part of the interval stays.

Asked for the law, with d what another structure that the logs leave open has more force than the
chosen one in a test, the evidence is what is left of it once the chosen one is fitted anew::

    2 ln(likelihood ratio) = n ln(1 + E/n),   E = d'd - b' (C^-1 + G)^-1 b,   b = J'd

in units of the noise, with the n samples that count in the choice of a structure.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from statistics import median
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from damperfit.adjustment.force_at import force_at
from damperfit.arrays import FloatArray
from damperfit.conditioning import condition
from damperfit.conditioning.filters import apply_filter, design_filter, passed_filter
from damperfit.configuration.damper_section import damper_of_record
from damperfit.damper.model import Model, Values
from damperfit.damper.quantity import FRICTION
from damperfit.damper.quasi_static import quasi_static
from damperfit.errors import ConditioningError, ConfigurationError, SimulationError, did_you_mean
from damperfit.identification.logs import compare
from damperfit.problem import Option
from damperfit.recording import Recording
from damperfit.reporting.answer import Answer
from damperfit.reporting.records import entries_in, listed_in
from damperfit.reporting.sheet import Column, Sheet, laid_out
from damperfit.simulation import sine_motion
from damperfit.statistics import NORMAL_95
from damperfit.uncertainty.covariance import (
    correlation_length,
    larger,
    score_covariance,
    stationary_covariance,
)
from damperfit.units.quantities import parse_quantity

if TYPE_CHECKING:
    from damperfit.results import Run, SettingResult

LAW = "law"
# Twice the logarithm of a likelihood ratio is very strong evidence from 10 on (Kass and Raftery, J.
# Am. Stat. Assoc. 90 (1995) 773). It scatters with a variance of four times its expectation E: of
# E = 27 it is more than 10 in 95 of 100 tests.
DECIDES = 27.0
_AMPLITUDES, _FREQUENCIES = 6, 8  # of the grid of candidates, spaced evenly by their logarithm
_SAMPLES = 400  # of a cycle
_RUN_IN = 2  # cycles before the one that is evaluated
_FEWEST_CYCLES, _MOST_CYCLES = 3, 15
_FOLLOWED = 4  # candidates that are recorded too
_LONG = 10.0  # s of a record
_SLOWEST = 0.1  # Hz
_SMALLEST = 16.0  # times below the largest stroke
_USEFUL, _NOTICED = 0.8, 0.99  # of the interval: what a test that helps, or hardly helps, leaves
_NOISE = "displacement_noise"  # a finding
_SPOILT = 1e6  # times the largest plausible value
_BETWEEN = 10.0  # s that a rig needs to set up and settle


class Limits(NamedTuple):
    """What the rig can do: amplitude (m), speed (m/s), force (N), frequency (Hz), minutes, W."""

    stroke: float
    speed: float
    force: float
    frequency: float
    minutes: float
    heat: float


class Question(NamedTuple):
    """What is to be known better: a quantity, the law, or the force at a speed (minus: bump)."""

    quantity: str = ""
    speed: float = math.nan

    @classmethod
    def of(cls, text: str, run: Run) -> Question:
        """Read "k_e" or "force@0.05m/s"."""
        name, at, speed = text.strip().lower().partition("@")
        where, known = Option("for_", text), [name.lower() for name in run.damper.names]
        if name == "force" and at:
            return cls(speed=parse_quantity(speed, "velocity", option=Option("for_")))
        if at or name not in {LAW, *known}:
            expected = f"expected law, force@SPEED or one of {', '.join(known)}"
            if name == "force":
                expected = "expected a speed with it, as in force@0.05m/s"
            raise ConfigurationError(
                f"found {text!r}; {expected}.{did_you_mean(name, known)}",
                where=where,
                code="question",
            )
        return cls(name)

    @property
    def title(self) -> str:
        """As in a sentence."""
        stroke = "rebound" if self.speed >= 0.0 else "compression"
        return self.quantity or f"the {stroke} force at {abs(self.speed):g} m/s"

    def gradient(self, run: Run, setting: SettingResult) -> FloatArray:
        """By u of the setting's values that have an error."""
        if self.quantity:
            return np.array([float(name == self.quantity) for name in setting.names])
        how: Any = {"sensitivities": tuple(setting.names)}
        return quasi_static(run.damper, setting.parameters, [self.speed], **how).slopes[:, 0]

    def misfit(self, run: Run, setting: SettingResult) -> float:
        """Standard error of it from the model's misfit, which no test of the kind reduces."""
        if self.quantity:
            errors = np.array([setting.misfits.get(name, 0.0) for name in setting.names])
            errors /= _scales(setting.parameters, setting.names)
            return float(self.gradient(run, setting) @ errors)
        forces = force_at([setting], run.damper, [abs(self.speed)], measured=run.speed_forces)
        return next(one.misfit for one in forces if (one.stroke == "bump") is (self.speed < 0.0))


class NextTest(NamedTuple):
    """One candidate test, and what it promises, of an interval or against other structures."""

    amplitude: float  # of a sine, m
    frequency: float  # Hz
    cycles: int  # steady cycles that are evaluated
    minutes: float = 0.0  # of the rig, all settings
    # Interval after the test as a share of that before it, by setting; the worst over the
    # intervals of the values.
    shares: dict[str, float] = {}  # noqa: RUF012 - never changed
    # Against each structure that remains (`DECIDES`).
    evidence: dict[str, float] = {}  # noqa: RUF012 - never changed

    @property
    def speed(self) -> float:
        """Peak speed, m/s."""
        return 2.0 * math.pi * self.frequency * self.amplitude

    @property
    def share(self) -> float:
        """Median over the settings."""
        return median(self.shares.values())

    @property
    def decided(self) -> list[str]:
        """Titles of the structures that it tells from the chosen one."""
        return [title for title, found in self.evidence.items() if found >= DECIDES]

    @property
    def rank(self) -> tuple[float, float]:
        """The least is the best: most structures or the narrowest interval for its time."""
        if not self.evidence:  # errors fall with the root of the time
            return 0.0, self.share * math.sqrt(self.minutes)
        against = [self.evidence[title] for title in self.decided] or [max(self.evidence.values())]
        return -float(len(self.decided)), -min(against) / self.minutes

    @property
    def sentence(self) -> str:
        """What to run."""
        motion = f"{1e3 * self.amplitude:.3g} mm at {self.frequency:.3g} Hz"
        return f"test {motion} ({self.cycles} steady cycles, {self.minutes:.1f} min on the rig)"

    def document(self) -> dict[str, Any]:
        """Return it as JSON values."""
        about = {"share": self.share, "shares": self.shares} if self.shares else {}
        return {
            "amplitude_m": self.amplitude,
            "frequency_Hz": self.frequency,
            "peak_speed_m_per_s": self.speed,
            "cycles": self.cycles,
            "minutes": self.minutes,
            **(about or {"evidence": self.evidence}),
        }


_MOTION = (
    Column("amplitude", "mm", lambda test: f"{1e3 * test.amplitude:.3g}"),
    Column("frequency", "Hz", lambda test: f"{test.frequency:.3g}"),
    Column("speed", "m/s", lambda test: f"{test.speed:.3g}"),
    Column("cycles", "", lambda test: str(test.cycles)),
    Column("rig", "min", lambda test: f"{test.minutes:.1f}"),
)
_INTERVALS = (
    Column("interval", "% of now", lambda test: f"{100.0 * test.share:.3g}"),
    Column("worst setting", "% of now", lambda test: f"{100 * max(test.shares.values()):.3g}"),
)


@dataclass(frozen=True, repr=False, eq=False, kw_only=True)
class Advice(Answer):
    """Candidate tests by rank, and what is known today.

    Attributes
    ----------
    tests : tuple of NextTest
        The best first.
    known : mapping
        Half of today's 95 % interval by setting, relative for a quantity, N for a force
        ("interval_now"); or the structure that was "chosen" and titles of those "remaining".
    """

    title: str  # of the question
    sentence: str
    tests: tuple[NextTest, ...]
    known: dict[str, Any]
    remarks: tuple[str, ...] = ()
    tables: tuple[Sheet, ...] = ()  # of the candidates; none: no test is any use

    def document(self) -> dict[str, Any]:
        """Return the answer as JSON values."""
        about = {"for": self.title, "sentence": self.sentence, "remarks": list(self.remarks)}
        return about | self.known | {"tests": [test.document() for test in self.tests]}

    def sheets(self) -> tuple[Sheet, ...]:
        """Return the candidates as a table."""
        return self.tables


def advise(
    run: Run, question: Question, limits: Limits, settings: Sequence[SettingResult]
) -> Advice:
    """Return which sine tells most about a question, at the settings together."""
    if question.quantity == LAW:
        return _advise_law(run, limits, settings)
    title, rig = question.title, _Rig(run, question, limits, settings)
    if not rig.known:
        raise ConfigurationError(
            f"{run.name}: no setting has an error of {title}: it is held, or the fit "
            "found no minimum; fit it first",
            code="nothing-to-narrow",
        )
    screened = [test for motion in rig.candidates() if (test := rig.screened(motion))]
    ranked = sorted(screened, key=lambda test: test.rank)
    recorded = filter(None, (rig.recorded(test, question.quantity) for test in ranked))
    tests = tuple(sorted(islice(recorded, _FOLLOWED), key=lambda test: test.rank))
    is_any_use = any(test.share <= _NOTICED for test in tests)
    if not tests:
        where = "within the limits of the rig" + " and above its noise" * bool(ranked)
        sentence = f"no test is {where}, so none narrows {title}"
    elif tests[0].share <= _USEFUL:
        n, left = len(rig.known), f"{100.0 * tests[0].share:.2g} % of today's"
        left += f" (median of {n} settings)" if n > 1 else ""
        sentence = f"{tests[0].sentence}: the interval of {title} shrinks to {left}"
    else:
        why = "the force hardly depends on it at any motion within the limits"
        if median(one.floor / one.now for one in rig.known) > _USEFUL:
            why = (
                "most of the interval is lack of fit or an assumed default, which another test "
                "of this kind repeats"
            )
        most = f" by more than {100.0 * (1.0 - tests[0].share):.0f} %" if is_any_use else ""
        sentence = f"no test within these limits narrows the interval of {title}{most}: {why}"
    speed, tested = abs(question.speed), max(one.result.top_speed for one in rig.known)
    remark = (
        f"{speed:g} m/s was never tested (up to {tested:.3g} m/s): the force there is the model's, "
        "extrapolated, and so is its interval"
    )
    return Advice(
        title=title,
        sentence=sentence,
        tests=tests,
        known={"interval_now": {one.result.label: NORMAL_95 * one.now for one in rig.known}},
        remarks=(*run.remarks, *[remark] * (speed > tested)),
        tables=(laid_out(tests, (*_MOTION, *_INTERVALS)),) if is_any_use else (),
    )


def _advise_law(run: Run, limits: Limits, settings: Sequence[SettingResult]) -> Advice:
    """Return in which sine the structures that a run's logs leave open differ most."""
    rivals, choice = remaining(run), run.record["law_choice"]
    undecided = tuple(map(str, listed_in(choice, "undecided")))
    chosen, titles = choice.get("chosen", ""), [rival.title for rival in rivals]
    names = {title: f"structure {k}" for k, title in enumerate(titles, 1)}
    tests: tuple[NextTest, ...] = ()
    if rivals and (rig := _Rig(run, Question(LAW), limits, settings)).known:
        counted = choice.get("effective_samples")
        n = sum(part.get("n_samples") or 0 for part in entries_in(run.record, "stretches"))
        worth = n / counted if isinstance(counted, float) and counted > 0.0 else rig.worth
        found = (rig.decided(rivals, motion, worth) for motion in rig.candidates())
        tests = tuple(sorted(filter(None, found), key=lambda test: test.rank)[:_FOLLOWED])
    listed = ", ".join(names[title] for title in (tests and tests[0].decided) or titles)
    if not rivals and undecided:
        sentence = (
            f"no other structure that was tried comes near {chosen}; what these logs leave open, "
            "the notes say"
        )
    elif not rivals:
        sentence = f"these logs have decided: no other structure comes near {chosen}"
    elif not tests or not tests[0].decided:
        sentence = f"no test within these limits distinguishes the chosen structure from {listed}"
    else:
        sentence = f"{tests[0].sentence}: it distinguishes the chosen structure from {listed}"

    def against(title: str) -> Column:
        return Column(names[title], "2 ln LR", lambda test: f"{test.evidence[title]:.3g}")

    note = "evidence against a structure that remains, the chosen one fitted anew; 27 decides"
    return Advice(
        title=LAW,
        sentence=sentence,
        tests=tests,
        known={"chosen": chosen, "remaining": titles},
        remarks=tuple(f"{name}: {title}" for title, name in names.items()) or undecided,
        tables=(laid_out(tests, (*_MOTION, *map(against, titles)), note),) if rivals else (),
    )


class Rival(NamedTuple):
    """A structure that the logs leave open beside the chosen one, with its values by setting."""

    title: str
    damper: Model
    values: dict[str, Values]


def remaining(run: Run) -> tuple[Rival, ...]:
    """Return the structures that the logs of a run have not decided against."""
    choice = run.record.get("law_choice")
    if not isinstance(choice, dict) or "remaining" not in choice:
        why = "its model was not chosen by the logs, so no structures remain to tell apart"
        again = "identify the logs with {model}"
        if isinstance(choice, dict) and "chosen" in choice:
            why = "an earlier damperfit chose its model and did not keep which structures remain"
            again = "identify the logs again with {model}"
        text, model = f"{run.name or 'this run'}: {why}; {again}", Option("model", "auto")
        raise ConfigurationError(text, model=model, code="no-structures")
    rivals = []
    for entry in entries_in(choice, "remaining"):
        try:
            damper = damper_of_record(entry["damper"])
            values = {
                str(one["setting"]): damper.values(
                    {name: float(value) for name, value in one["values"].items()}
                )
                for one in entries_in(entry, "settings")
            }
            rivals.append(Rival(str(entry["title"]), damper, values))
        except (AttributeError, KeyError, TypeError, ValueError, ConfigurationError):  # edited
            continue
    return tuple(rivals)


class _Known:
    """What a run knows of one setting; vectors and matrices are by u of the values in error."""

    def __init__(self, run: Run, setting: SettingResult, question: Question) -> None:
        assert setting.covariance is not None
        self.result, self.gradient = setting, question.gradient(run, setting)
        self.covariance = setting.covariance  # of noise alone
        self.floor = question.misfit(run, setting)  # of the model: no test of the kind reduces it
        self.error = math.sqrt(max(float(self.gradient @ self.covariance @ self.gradient), 0.0))
        self.now = math.hypot(self.error, self.floor)
        self.segments = sorted(
            (
                segment
                for segment in entries_in(run.record, "stretches")
                if segment.get("setting") == setting.setting.cell
                and segment.get("noise_N")
                and segment.get("frequency_Hz")
            ),
            key=lambda segment: float(segment["noise_N"]),
        )
        if not self.segments:
            raise ConfigurationError(
                f"{run.name}: run.json does not have the noise of setting {setting.label}; "
                "identify logs with steady cycles",
                code="no-noise",
            )
        # Of the filtered force between cycles, N.
        self.noise = float(self.segments[len(self.segments) // 2]["noise_N"])

    def share_after(self, before: FloatArray, after: FloatArray, scores: FloatArray) -> float:
        """Interval after a test, as a share of that before: H, H + G and S of all settings."""
        moved = np.linalg.solve(after, self.gradient)
        variance = float(moved @ (before @ self.covariance @ before + scores) @ moved)
        return math.hypot(math.sqrt(max(variance, 0.0)), self.floor) / self.now


def _scales(values: Values, names: Sequence[str]) -> FloatArray:
    """dy/du: y of quantities taken by their logarithm."""
    return np.array([values[n] if values.quantity(n).is_logarithmic else 1.0 for n in names])


def _is_spoilt(values: Values) -> bool:
    """Whether a table that somebody has edited has a number that no damper has."""
    sizes = {one.name: max(map(abs, one.plausible)) for one in values.quantities}
    return not all(abs(values[name]) < _SPOILT * size for name, size in sizes.items())  # nor NaN


class _Rig:
    """What tests tell on a rig. Matrices are by u, in the noise s of a setting as the unit."""

    def __init__(
        self, run: Run, question: Question, limits: Limits, settings: Sequence[SettingResult]
    ) -> None:
        self.run, self.limits = run, limits
        judged = (one for one in settings if one.covariance is not None and len(one.names))
        known = [_Known(run, one, question) for one in judged if not _is_spoilt(one.parameters)]
        self.known = [one for one in known if one.now > 0.0 or question.quantity == LAW]
        self.options, inputs = run.own_configuration.conditioning, entries_in(run.record, "inputs")
        rates = [float(log["sample_rate_Hz"]) for log in inputs if log.get("sample_rate_Hz")]
        self.rate = median(rates) if rates else 1000.0  # of the logs, Hz
        # Samples to one that counts, of white noise behind the filter.
        effective = [log.effective_rate for log in run.logs if log.effective_rate]
        self.worth = self.rate / median(effective) if effective else 1.0
        noises = [
            parse_quantity(f"{finding['value']}{finding['unit']}", "length")
            for log in inputs
            for finding in log.get("findings", ())
            if finding.get("name") == _NOISE and finding.get("value")
        ]
        self.displacement_noise = median(noises) if noises else 0.0  # m
        self.told = []  # J'J of the logs of each setting
        for one in self.known:
            told = np.zeros((len(one.result.names),) * 2)
            for log in one.segments:
                motion = NextTest(log["amplitude_m"], log["frequency_Hz"], 0)
                per_sample = self._steady(one, one.result.parameters, motion, has_been=True)
                assert per_sample is not None
                told += log["n_samples"] * per_sample
            self.told.append(told)

    def candidates(self) -> Iterator[NextTest]:
        """Yield sines within the limits, as far as they are known without a simulation."""
        limits, slowest = self.limits, min(_SLOWEST, self.limits.frequency)
        for amplitude in np.geomspace(limits.stroke / _SMALLEST, limits.stroke, _AMPLITUDES):
            for frequency in np.geomspace(slowest, limits.frequency, _FREQUENCIES):
                seconds = 60.0 * limits.minutes - _BETWEEN
                cycles = min(_MOST_CYCLES, int(seconds * frequency) - _RUN_IN)
                whole = len(self.known) * ((cycles + _RUN_IN) / float(frequency) + _BETWEEN)
                test = NextTest(float(amplitude), float(frequency), cycles, whole / 60.0)
                if test.speed <= limits.speed * (1.0 + 1e-9) and cycles >= _FEWEST_CYCLES:
                    yield test

    def screened(self, test: NextTest, quantity: str = "", end: int = 0) -> NextTest | None:
        """A test by one steady cycle; None: a limit of the rig or the damper forbids it.

        With a quantity, that one at an end of its interval.
        """
        n, added = test.cycles / test.frequency * self.rate, []
        for one in self.known:
            values = one.result.parameters
            limit = one.result.intervals.get(quantity, (None, None))[end]
            if limit is not None and limit > 0.0:
                values = values.replace({quantity: limit})
            if (per_sample := self._steady(one, values, test)) is None:
                return None
            added.append((n * per_sample, n * per_sample * self.worth))
        return test._replace(shares=self._shares(added))

    def recorded(self, test: NextTest, quantity: str) -> NextTest | None:
        """The same test as the rig would record it, the worst over the interval of a quantity.

        None: the record is no log, or its noise would spoil it.
        """
        n = test.cycles / test.frequency * self.rate
        records = []
        for one in self.known:
            if (record := self._record(one, test)) is None:
                return None
            records.append((n * record[0], n * record[1]))
        shares = self._shares(records)
        for end in (0, 1) if quantity else ():
            if at_end := self.screened(test, quantity, end):
                for label, share in test.shares.items():
                    shares[label] *= max(1.0, at_end.shares[label] / share)
        return test._replace(shares={label: min(share, 1.0) for label, share in shares.items()})

    def decided(self, rivals: Sequence[Rival], test: NextTest, worth: float) -> NextTest | None:
        """What a test tells of structures that remain; None: it is beyond rig or damper.

        Of `worth` samples one counts, as in the choice of the structure.
        """
        evidence = dict.fromkeys([rival.title for rival in rivals], 0.0)
        n = test.cycles / test.frequency * self.rate / max(worth, self.worth)
        for one in self.known:
            own = self._cycle(self.run.damper, one.result.parameters, test, one.result.names)
            if own is None:
                return None
            jacobian = own[1] / one.noise
            weight = n / len(jacobian)
            after = weight * jacobian.T @ jacobian + np.linalg.pinv(one.covariance)
            for rival in (rival for rival in rivals if one.result.label in rival.values):
                other = self._cycle(rival.damper, rival.values[one.result.label], test)
                if other is None:
                    return None
                d = (other[0] - own[0]) / one.noise
                b = weight * jacobian.T @ d
                left = float(weight * d @ d - b @ np.linalg.solve(after, b))
                evidence[rival.title] += n * math.log1p(max(left, 0.0) / n)
        return test._replace(evidence=evidence)

    def _steady(
        self, known: _Known, values: Values, test: NextTest, *, has_been: bool = False
    ) -> FloatArray | None:
        """J'J a sample, from one steady cycle; None: beyond the rig or the damper."""
        names, damper = known.result.names, self.run.damper
        cycle = self._cycle(damper, values, test, names, has_been=has_been)
        if cycle is None:
            return None
        return np.asarray(cycle[1].T @ cycle[1] / (len(cycle[1]) * known.noise**2))

    def _cycle(
        self,
        damper: Model,
        values: Values,
        test: NextTest,
        names: Sequence[str] = (),
        *,
        has_been: bool = False,
    ) -> tuple[FloatArray, FloatArray] | None:
        """Force of one steady cycle behind the filter, and its Jacobian.

        None: it cannot be simulated, or takes too much force or heat. A test that has been is
        beyond nothing, whatever the limits of the next one are.
        """
        frequency = test.frequency
        per_cycle = max(_SAMPLES, math.ceil(4.0 * self.options.declared_corner / frequency))
        rate = per_cycle * frequency
        motion = sine_motion(test.amplitude, frequency, cycles=_RUN_IN + 2, sample_rate=rate)
        try:
            seen = damper.simulate(values, motion, sensitivities=names, options=self.run.solver)
        except SimulationError:
            if has_been:
                raise
            return None
        steady = slice(_RUN_IN * per_cycle, (_RUN_IN + 1) * per_cycle)
        heat = float(np.mean(seen.force[steady] * seen.velocity[steady]))
        is_beyond = np.abs(seen.force[steady]).max() > self.limits.force or heat > self.limits.heat
        if is_beyond and not has_been:
            return None
        rows = np.stack([seen.force, *(seen.sensitivities[name] for name in names)])
        rows = apply_filter(passed_filter(self.options, rate), rows)[:, steady]
        return rows[0], rows[1:].T * _scales(values, names)

    def _record(self, known: _Known, test: NextTest) -> tuple[FloatArray, FloatArray] | None:
        """J'J and the covariance of the scores, a sample, of a record; None where it is no log."""
        noise = known.noise
        cycles = min(max(_FEWEST_CYCLES, round(_LONG * test.frequency)), test.cycles)
        try:
            jacobian, residuals = self._log(known, test._replace(cycles=cycles))
        except (SimulationError, ConditioningError):
            return None
        lag = correlation_length(residuals, longest=round(0.25 / test.frequency * self.rate))
        scores = larger(
            score_covariance(jacobian * residuals[:, None], lag),
            stationary_covariance(jacobian, residuals, lag),
        )
        n = len(jacobian)
        return jacobian.T @ jacobian / (n * noise**2), scores / (n * noise**4)

    def _log(self, known: _Known, test: NextTest) -> tuple[FloatArray, FloatArray]:
        """Jacobian and residuals of a log as the rig writes it; the same noise in every call.

        The scatter between cycles is all taken for noise of the force, white before the filter;
        that of the displacement comes to it, for it drives the model.
        """
        random, values = np.random.default_rng(1), known.result.parameters
        names, white = known.result.names, known.noise * math.sqrt(self.worth)
        cycles, rate = test.cycles + _RUN_IN, self.rate
        motion = sine_motion(test.amplitude, test.frequency, cycles=cycles, sample_rate=rate)
        damper, solver = self.run.damper, self.run.solver
        force = damper.simulate(values, motion, sensitivities=(), options=solver).force
        n = len(motion.displacement)
        logged = np.stack([motion.displacement, force])
        logged += np.array([[self.displacement_noise], [white]]) * random.standard_normal((2, n))
        own = self.options
        if own.rig_filter != "none":
            how: Any = {"sample_rate": rate, "order": own.rig_filter_order}
            logged = apply_filter(design_filter(own.rig_filter, own.declared_corner, **how), logged)
        recording = Recording(
            *("advised test", "", "", None),
            time=np.arange(n) / rate,
            displacement=logged[0],
            force=logged[1],
            reverse_displacement=False,
            reverse_force=False,
        )
        trace = condition(recording, self.options)
        if any(f.name == _NOISE and f.severity == "warning" for f in trace.findings):
            raise ConditioningError("the displacement is too noisy for it", code="noise")
        seen = compare(values, trace, damper, sensitivities=names, solver=solver)
        part = trace.compared
        jacobian = (seen.sensitivities[:, part].T * _scales(values, names)).astype(float)
        return jacobian, trace.force[part] - seen.force[part]

    def _shares(self, added: Sequence[tuple[FloatArray, FloatArray]]) -> dict[str, float]:
        """Interval after the test at all settings, as a share of that before it, by setting.

        The test at one setting tells of shared values what its own values leave (a Schur
        complement), and that serves all settings. Procedure `paper` averages only the friction so.
        """
        is_paper = self.run.own_configuration.identification.procedure == "paper"
        whole, lent = [], []
        for one, before, (gained, scores) in zip(self.known, self.told, added, strict=True):
            after, n = before + gained, len(one.result.own)
            roles = [one.result.parameters.quantity(name).role for name in one.result.shared]
            lends = np.array([not is_paper or role == FRICTION for role in roles], dtype=float)
            left = []  # the scores of shared values once a setting's own are fitted
            for h, s in ((before, before), (after, after), (after, scores)):
                own = h[:n, :n] + 1e-9 * np.eye(n)
                rows = np.hstack([-np.linalg.solve(own, h[:n, n:]).T, np.eye(len(h) - n)])
                left.append((rows @ s @ rows.T) * np.outer(lends, lends))
            whole.append(np.stack([before, after, scores]))
            lent.append(np.stack(left))
        shares = {}
        for one, mine in zip(self.known, whole, strict=True):
            n = len(one.result.own)
            for other, more in zip(self.known, lent, strict=True):
                if other is not one and other.result.shared == one.result.shared:
                    mine[:, n:, n:] += more
            shares[one.result.label] = one.share_after(*mine)
        return shares
