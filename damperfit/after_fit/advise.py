"""Which test next: how far further tests would narrow an interval.

Candidates are ranked by one steady cycle: with C the covariance of u that the run has found and
G = J'J/s^2 of the new test, J of the core's sensitivities behind the run's own filter and s the
noise that the run has measured (the scatter between cycles), a setting is left with (C^-1 + G)^-1.

The best of them are then tried: the tests of the run and the new one are simulated as the rig would
record them, with its filter, its rate and the noise of both channels, and fitted as the run was.
What these fits give is promised. Lack of fit that they do not have no test of the kind reduces.

Asked for the law, with d what another structure that the logs leave open has more force than the
chosen one in a test, the evidence is what is left of it once the chosen one is fitted anew::

    2 ln(likelihood ratio) = n ln(1 + E/n),   E = d'd - b' (C^-1 + G)^-1 b,   b = J'd

in units of the noise, with the n samples that count in the choice of a structure.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import islice
from statistics import median, median_high
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from damperfit.adjustment.force_at import Stage, force_at, stage_of
from damperfit.arrays import FloatArray
from damperfit.conditioning.filters import apply_filter, passed_filter
from damperfit.conditioning.log_to_trace import condition
from damperfit.configuration.damper_section import damper_of_record
from damperfit.damper.model import Model, Values
from damperfit.damper.quasi_static import quasi_static
from damperfit.errors import (
    ConditioningError,
    ConfigurationError,
    LogError,
    SimulationError,
    did_you_mean,
)
from damperfit.identification.options import GivenStart
from damperfit.identification.procedures import identify
from damperfit.problem import Option, findings_in
from damperfit.recording import Recording, Trace
from damperfit.reporting.answer import Answer
from damperfit.reporting.records import entries_in, listed_in, number_in
from damperfit.reporting.sheet import Column, Sheet, laid_out
from damperfit.settings_and_logs import numbers_in, segments_in
from damperfit.simulation import sine_motion
from damperfit.statistics import NORMAL_95
from damperfit.uncertainty.assessment import assess, reconsider
from damperfit.uncertainty.speed_forces import SpeedForces
from damperfit.units.quantities import parse_quantity
from damperfit.workers import available_cores

if TYPE_CHECKING:
    from damperfit.results import Run
    from damperfit.sections import RigSection
    from damperfit.settings_and_logs import SettingResult

LAW = "law"
# Twice the logarithm of a likelihood ratio is very strong evidence from 10 on (Kass and Raftery, J.
# Am. Stat. Assoc. 90 (1995) 773). It scatters with a variance of four times its expectation E: of
# E = 27 it is more than 10 in 95 of 100 tests.
DECIDES = 27.0
_AMPLITUDES, _FREQUENCIES = 6, 8  # of the grid of candidates, spaced evenly by their logarithm
_SAMPLES = 400  # of a cycle
_RUN_IN = 2  # cycles before the one that is evaluated
_FEWEST_CYCLES, _MOST_CYCLES = 3, 15
_FOLLOWED, _TRIED = 3, 5  # candidates that are tried, and settings
_SEEDS = (1, 2)  # of the noise with which they are
_UNFITTED = (SimulationError, ConditioningError, LogError)
_FINER = 8  # times the rate of the logs
# Where a cycle is a whole number of samples, what is read of friction's jumps hangs on where they
# fall in it; an analogue filter has met them between the samples.
_OFF_SAMPLES = 0.382  # of a sample more, so that no two of many cycles are sampled alike
_OF_SINE = ("amplitude_m", "frequency_Hz", "cycles", "noise_N")  # of a segment
_SLOWEST, _FASTEST = 0.1, 10.0  # Hz; the latter where the rig's is not declared
_FASTER, _OF_TRAVEL = 2.0, 0.9  # times the tested speed, likewise; of the damper's travel
_SMALLEST = 16.0  # times below the largest stroke
_USEFUL, _NOTICED = 0.8, 0.99  # of the interval: what a test that helps, or hardly helps, leaves
_NOISE = "displacement_noise"  # a finding
_ABOVE, _FLAT = 6.0, 0.6  # times the motion's frequency, and the corner: where noise is read
_SPOILT = 1e6  # times the largest plausible value
_BETWEEN = 10.0  # s that a rig needs to set up and settle


def with_limits(rig: RigSection, run: Run) -> RigSection:
    """Return a rig with the limits that it does not declare, by what was tested."""
    stroke = rig.max_stroke or run.tested.stroke
    speed = rig.max_speed or _FASTER * (run.tested.speed or 0.0)
    if not stroke or not speed:
        raise ConfigurationError(
            f"{run.name}: the tested stroke and speed are not known; declare rig.max_stroke "
            "and rig.max_speed",
            code="no-limits",
        )
    return rig.but(
        max_stroke=min(stroke, _OF_TRAVEL * run.damper.travel),
        max_speed=speed,
        max_force=rig.max_force or math.inf,
        max_frequency=rig.max_frequency or _FASTEST,
        max_heat=rig.max_heat or math.inf,
    )


class Question(NamedTuple):
    """What is to be known better: a quantity, the law, or the force at a speed (minus: bump)."""

    quantity: str = ""
    speed: float = math.nan

    @classmethod
    def of(cls, text: str, run: Run) -> Question:
        """Read "k_e" or "force@0.05m/s"."""
        name, at, speed = text.strip().lower().partition("@")
        known = [name.lower() for name in run.damper.names]
        if name == "force" and at:
            return cls(speed=parse_quantity(speed, "velocity", option=Option("for_")))
        if at or name not in {LAW, *known}:
            text = f"found {text!r}; " if text else ""
            text += f"expected law, a force as in force@0.05m/s, or one of {', '.join(known)}"
            text += f".{did_you_mean(name, known)}"
            raise ConfigurationError(text, where=Option("for_"), code="question")
        return cls(name)

    @property
    def title(self) -> str:
        """As in a sentence."""
        stroke = "rebound" if self.speed >= 0.0 else "compression"
        return self.quantity or f"the {stroke} force at {abs(self.speed):g} m/s"

    def gradient(self, damper: Model, stage: Stage) -> FloatArray:
        """By u of the setting's values that have an error."""
        if self.quantity:
            return np.array([float(name == self.quantity) for name in stage.names])
        how: Any = {"sensitivities": stage.names}
        return quasi_static(damper, stage.parameters, [self.speed], **how).slopes[:, 0]

    def errors(
        self, damper: Model, stage: Stage, measured: Sequence[SpeedForces]
    ) -> tuple[float, float]:
        """Standard error of it, relative of a logarithmic quantity, and the misfit's share."""
        if not self.quantity:
            forces = force_at([stage], damper, [abs(self.speed)], measured=measured)
            force = next(side for side in forces if (side.stroke == "bump") is (self.speed < 0.0))
            return force.reach / NORMAL_95, force.misfit
        if self.quantity not in stage.names:  # held; or the law
            return 0.0, 0.0
        is_relative = stage.parameters.quantity(self.quantity).is_logarithmic
        unit = stage.parameters[self.quantity] if is_relative else 1.0
        place, misfit = stage.names.index(self.quantity), stage.misfits[self.quantity] / unit
        return math.hypot(math.sqrt(np.asarray(stage.covariance)[place, place]), misfit), misfit


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
        """Titles of the structures that it separates from the chosen one."""
        return [title for title, evidence in self.evidence.items() if evidence >= DECIDES]

    @property
    def rank(self) -> tuple[float, float]:
        """The least is the best: most structures or the narrowest interval for its time."""
        if not self.evidence:  # errors fall with the root of the time
            return float(self.share > _USEFUL), self.share * math.sqrt(self.minutes)
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
    run: Run, question: Question, limits: RigSection, settings: Sequence[SettingResult]
) -> Advice:
    """Return which sine shows most about a question, at the settings together."""
    if question.quantity == LAW:
        return _advise_law(run, limits, settings)
    title, rig = question.title, _Rig(run, question, limits, settings)
    if not rig.planned:
        raise ConfigurationError(
            f"{run.name}: no setting has an error of {title}: it is held, or the fit "
            "found no minimum; fit it first",
            code="nothing-to-narrow",
        )
    screened = sorted(filter(None, map(rig.screened, rig.candidates())), key=lambda t: t.rank)
    tried = islice(filter(None, map(rig.tried, screened)), _FOLLOWED)
    tests = tuple(sorted(tried, key=lambda test: test.rank))
    least = min((test.share for test in tests), default=1.0)
    is_any_use = least <= _NOTICED
    if not tests:
        where = "within the limits of the rig" + " and above its noise" * bool(screened)
        sentence = f"no test is {where}, so none narrows {title}"
    elif tests[0].share <= _USEFUL:
        n, left = len(rig.planned), f"{100.0 * tests[0].share:.2g} % of today's"
        left += f" (median of {n} settings)" if n > 1 else ""
        sentence = f"{tests[0].sentence}: the interval of {title} shrinks to {left}"
    else:
        why = "the force hardly depends on it at any motion within the limits"
        if median(known.floor / known.now for known in rig.planned) > _USEFUL:
            why = (
                "most of the interval is lack of fit or an assumed default, which another test "
                "of this kind repeats"
            )
        elif tests[0].share > 1.0 / _USEFUL:
            why = "it would show a lack of fit that today's interval does not include"
        most = f" by more than {100.0 * (1.0 - least):.2g} %" if is_any_use else ""
        sentence = f"no test within these limits narrows the interval of {title}{most}: {why}"
    speed, tested = abs(question.speed), max(known.setting.top_speed for known in rig.planned)
    remark = (
        f"{speed:g} m/s was never tested (up to {tested:.3g} m/s): the force there is the model's, "
        "extrapolated, and so is its interval"
    )
    return Advice(
        title=title,
        sentence=sentence,
        tests=tests,
        known={"interval_now": {known.label: NORMAL_95 * known.now for known in rig.planned}},
        remarks=(*map(str, run.remarks), *[remark] * (speed > tested)),
        tables=(laid_out(tests, (*_MOTION, *_INTERVALS)),) if is_any_use else (),
    )


def _advise_law(run: Run, limits: RigSection, settings: Sequence[SettingResult]) -> Advice:
    """Return in which sine the structures that a run's logs leave open differ most."""
    rivals, choice = remaining(run), run.record["law_choice"]
    undecided = tuple(map(str, listed_in(choice, "undecided")))
    chosen, titles = choice.get("chosen", ""), [rival.title for rival in rivals]
    names = {title: f"structure {k}" for k, title in enumerate(titles, 1)}
    tests: tuple[NextTest, ...] = ()
    if rivals and (rig := _Rig(run, Question(LAW), limits, settings)).planned:
        counted = choice.get("effective_samples")
        segments = entries_in(run.record, "stretches")
        stops, starts = (sum(numbers_in(segments, at)) for at in ("stop_s", "start_s"))
        if isinstance(counted, float) and counted > 0.0:  # as in the choice of the structure
            rig.worth = max(rig.rate * (stops - starts) / counted, rig.worth)
        decided = (rig.decided(rivals, motion) for motion in rig.candidates())
        tests = tuple(sorted(filter(None, decided), key=lambda test: test.rank)[:_FOLLOWED])
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
        text = f"{run.name} does not say which structures remain; identify the logs with {{model}}"
        raise ConfigurationError(text, model=Option("model", "auto"), code="no-structures")
    rivals = []
    for entry in entries_in(choice, "remaining"):
        with suppress(
            AttributeError, KeyError, TypeError, ValueError, ConfigurationError
        ):  # edited
            damper = damper_of_record(entry["damper"])
            numbers = {
                str(row["setting"]): {name: float(value) for name, value in row["values"].items()}
                for row in entries_in(entry, "settings")
            }
            values = {label: damper.values(own) for label, own in numbers.items()}
            rivals.append(Rival(str(entry["title"]), damper, values))
    return tuple(rivals)


class _Known:
    """What a run knows of one setting; vectors and matrices are by u of the values in error."""

    def __init__(self, run: Run, setting: SettingResult, question: Question) -> None:
        self.setting, self.label = setting, setting.label
        self.gradient = question.gradient(run.damper, setting)
        self.covariance = np.asarray(setting.covariance)  # of noise alone
        self.now, self.floor = question.errors(run.damper, setting, run.speed_forces)
        segments = [
            (segment, log.temperature)
            for log in run.logs
            if log.setting == setting.setting and log.role == "fitted"
            for segment in segments_in(log.facts)
            if all(map(segment.get, _OF_SINE))
        ]
        # As if they were planned, with their temperatures, degC.
        self.tests = [
            (NextTest(x["amplitude_m"], x["frequency_Hz"], x["cycles"]), temperature)
            for x, temperature in segments
        ]
        # Of the filtered force between cycles, N.
        self.noise = median_high(x["noise_N"] for x, _ in segments) if segments else math.nan

    def variance(self, gradient: FloatArray, information: FloatArray) -> float:
        """What a new test leaves of the variance along a gradient, g' (C^-1 + G)^-1 g."""
        narrowed = np.eye(len(gradient)) + information @ self.covariance
        return float(gradient @ self.covariance @ np.linalg.solve(narrowed, gradient))


def _is_spoilt(values: Values) -> bool:
    """Whether a table that somebody has edited has a number that no damper has."""
    sizes = {quantity.name: max(map(abs, quantity.plausible)) for quantity in values.quantities}
    return not all(abs(values[name]) < _SPOILT * size for name, size in sizes.items())  # nor NaN


def _spread(settings: Sequence[_Known], most: int) -> list[_Known]:
    """So many of the settings, from the first to the last."""
    n = min(most, len(settings))
    return [settings[k] for k in np.linspace(0, len(settings) - 1, n).round().astype(int)]


def _displacement_noise(run: Run, corner: float, logged: float) -> float:
    """White noise of the displacement at the rate of the logs, Hz, rms, m.

    As inspection found it; behind a filter of the rig, which hides it, by the spectrum between the
    motion's harmonics below the corner, of logs of one motion.
    """
    findings = (finding for log in run.logs for finding in findings_in(log.facts))
    sizes = (f.values["value"] for f in findings if f.code == _NOISE)
    if noises := [1e-6 * float(size) for size in sizes if size]:
        return median(noises)
    for log in run.logs:
        signals, frequency = log.signals, number_in(log.facts, "frequency_Hz")
        if signals is None or frequency is None or len(segments_in(log.facts)) > 1:
            continue
        x, rate = signals.displacement, 1.0 / float(np.median(np.diff(signals.time)))
        window, frequencies = np.blackman(len(x)), np.fft.rfftfreq(len(x), 1.0 / rate)
        band = (frequencies > _ABOVE * frequency) & (frequencies < _FLAT * corner)
        power = np.abs(np.fft.rfft((x - x.mean()) * window)[band]) ** 2
        if len(power):  # of a line it is exponential, with the median ln 2 times its mean
            density = np.median(power) / (math.log(2.0) * float(window @ window) * rate)
            noises.append(math.sqrt(density * logged))
    return median(noises) if noises else 0.0


class _Rig:
    """What tests show on a rig."""

    def __init__(
        self, run: Run, question: Question, limits: RigSection, settings: Sequence[SettingResult]
    ) -> None:
        self.run, self.question, self.limits = run, question, limits
        judged = [s for s in run.settings if s.covariance is not None and len(s.names)]
        known = [_Known(run, s, question) for s in judged if not _is_spoilt(s.parameters)]
        known = [k for k in known if k.now > 0.0 or question.quantity == LAW]
        labels = {setting.label for setting in settings}
        self.planned = [k for k in known if k.label in labels]
        if mute := [k.label for k in self.planned if not k.tests]:
            raise ConfigurationError(
                f"{run.name}: run.json does not have the noise of setting {mute[0]}; "
                "identify logs with steady cycles",
                code="no-noise",
            )
        # A test is tried at some of them; the others of the run show what they share.
        self.probed = _spread(self.planned, _TRIED)
        others = [k for k in known if k.label not in labels and k.tests]
        self.fitted = [*self.probed, *_spread(others, _TRIED - len(self.probed))]
        self.is_whole = len(self.fitted) == len(known)
        # What is simulated is in time, and about the middle of the stroke.
        self.options = run.own_configuration.conditioning.but(skew=0.0, centre=None)
        self.rate = median(numbers_in(run.inputs, "sample_rate_Hz") or [1000.0])  # of the logs, Hz
        # Samples to one that counts, of white noise behind the filter.
        effective = [log.effective_rate for log in run.logs if log.effective_rate]
        self.worth = self.rate / median(effective) if effective else 1.0
        self.displacement_noise = _displacement_noise(run, self.options.declared_corner, self.rate)

    def candidates(self) -> Iterator[NextTest]:
        """Yield sines within the limits, as far as they are known without a simulation."""
        limits, slowest = self.limits, min(_SLOWEST, self.limits.max_frequency)
        for amplitude in np.geomspace(
            limits.max_stroke / _SMALLEST, limits.max_stroke, _AMPLITUDES
        ):
            for frequency in np.geomspace(slowest, limits.max_frequency, _FREQUENCIES):
                if self.options.rig_filter != "analogue":
                    whole = math.ceil(self.rate / frequency - 1e-6)
                    frequency = self.rate / (whole + _OFF_SAMPLES)  # noqa: PLW2901
                seconds = 60.0 * limits.minutes - _BETWEEN
                cycles = min(_MOST_CYCLES, int(seconds * frequency) - _RUN_IN)
                lasts = len(self.planned) * ((cycles + _RUN_IN) / float(frequency) + _BETWEEN)
                test = NextTest(float(amplitude), float(frequency), cycles, lasts / 60.0)
                if test.speed <= limits.max_speed * (1.0 + 1e-9) and cycles >= _FEWEST_CYCLES:
                    yield test

    def screened(self, test: NextTest, end: int | None = None) -> NextTest | None:
        """A test by one steady cycle; None: a limit of the rig or the damper forbids it.

        With an end, the quantity in question is at that end of its interval.
        """
        shares, n = {}, self._samples(test)
        for known in self.planned:
            values, name = known.setting.parameters, self.question.quantity
            limit = None if end is None else known.setting.intervals[name][end]
            if limit is not None and limit > 0.0:
                values = values.replace({name: limit})
            cycle = self._cycle(known.setting, test, values)
            if cycle is None:
                return None
            jacobian = cycle[1] / known.noise
            variance = known.variance(known.gradient, n / len(jacobian) * jacobian.T @ jacobian)
            shares[known.label] = math.hypot(math.sqrt(variance), known.floor) / known.now
        return test._replace(shares=shares)

    def tried(self, test: NextTest) -> NextTest | None:
        """A test as the rig would record it, fitted: the worst over the interval of a quantity.

        None: it cannot be recorded or fitted at every setting.
        """
        if self._first is None:
            return None
        own, before = self._first
        try:
            both = [[*traces] for traces in own]
            for seed, traces in zip(_SEEDS, both, strict=True):
                for known in self.probed:
                    warm = known.tests[0][1]
                    traces.append(self._recorded(known, test, warm, [seed, len(traces)]))
                    findings = traces[-1].findings
                    if any(f.code == _NOISE and f.severity == "warning" for f in findings):
                        return None
            after = self._refitted(both)
        except _UNFITTED:
            return None
        # Of what was screened; by chance of one noise a test may look better than it is.
        ratios = {known.label: 1.0 for known in self.probed}
        for known in self.probed:
            (today, misfit), (left, _) = before[known.label], after[known.label]
            if today > 0.0 and left > 0.0:  # else one fit has no error of it: as screened
                # What the rig's filter makes of lack of fit is in the simulated tests too.
                more = max(known.floor**2 - misfit, 0.0)
                now = known.now if self.is_whole else math.sqrt(today + more)
                ratios[known.label] = math.sqrt(left + more) / now / test.shares[known.label]
        usual = median(ratios.values())
        shares = {label: share * ratios.get(label, usual) for label, share in test.shares.items()}
        for end in (0, 1) if self.question.quantity else ():
            if at_end := self.screened(test, end):
                for label, share in test.shares.items():
                    shares[label] *= max(1.0, at_end.shares[label] / share)
        return test._replace(shares=shares)

    def decided(self, rivals: Sequence[Rival], test: NextTest) -> NextTest | None:
        """What a test decides of the structures that remain; None: it is beyond rig or damper."""
        evidence = dict.fromkeys([rival.title for rival in rivals], 0.0)
        n = self._samples(test)
        for known in self.planned:
            own, label = self._cycle(known.setting, test), known.label
            if own is None:
                return None
            jacobian = own[1] / known.noise
            weight = n / len(jacobian)
            for rival in (rival for rival in rivals if label in rival.values):
                other = self._cycle(known.setting, test, rival.values[label], damper=rival.damper)
                if other is None:
                    return None
                d = (other[0] - own[0]) / known.noise
                fitted = known.variance(weight * jacobian.T @ d, weight * jacobian.T @ jacobian)
                left = max(float(weight * d @ d) - fitted, 0.0)
                evidence[rival.title] += n * math.log1p(left / n)
        return test._replace(evidence=evidence)

    def _samples(self, test: NextTest) -> float:
        """Those of a test that count."""
        return test.cycles / test.frequency * self.rate / self.worth

    def _cycle(
        self,
        setting: SettingResult,
        test: NextTest,
        values: Values | None = None,
        *,
        damper: Model | None = None,
    ) -> tuple[FloatArray, FloatArray] | None:
        """Force of one steady cycle behind the filter, and its Jacobian; none of another damper.

        None: it cannot be simulated, or takes too much force or heat.
        """
        values, names = values or setting.parameters, () if damper else setting.names
        per_cycle = max(_SAMPLES, math.ceil(4.0 * self.options.declared_corner / test.frequency))
        rate = per_cycle * test.frequency
        motion = sine_motion(test.amplitude, test.frequency, cycles=_RUN_IN + 2, sample_rate=rate)
        how: Any = {"sensitivities": names, "options": self.run.solver}
        try:
            seen = (damper or self.run.damper).simulate(values, motion, **how)
        except SimulationError:
            return None
        steady = slice(_RUN_IN * per_cycle, (_RUN_IN + 1) * per_cycle)
        force, heat = seen.force[steady], np.mean(seen.force[steady] * seen.velocity[steady])
        if np.abs(force).max() > self.limits.max_force or heat > self.limits.max_heat:
            return None
        rows = np.stack([seen.force, *(seen.sensitivities[name] for name in names)])
        rows = apply_filter(passed_filter(self.options, rate), rows)[:, steady]
        scales = [values[n] if values.quantity(n).is_logarithmic else 1.0 for n in names]
        return rows[0], rows[1:].T * np.array(scales)

    @cached_property
    def _first(self) -> tuple[list[list[Trace]], dict[str, FloatArray]] | None:
        """The run's tests by the seed of their noise, and their errors; None: they have no fit.

        What settings share is known worse by a few of them, before a test and after it.
        """
        tests = [(known, *test) for known in self.fitted for test in known.tests]
        with suppress(*_UNFITTED):
            own = [
                [self._recorded(*motion, [seed, k]) for k, motion in enumerate(tests)]
                for seed in _SEEDS
            ]
            return own, self._refitted(own)
        return None

    def _refitted(self, tests: Sequence[Sequence[Trace]]) -> dict[str, FloatArray]:
        """The error in question and its misfit, mean squares of some noises, by label.

        Tests are fitted as the run was, from its values on; a LogError where they have no errors.
        """
        damper, made = self.run.damper, self.run.own_configuration.identification
        ended = {known.setting.setting: dict(known.setting.values) for known in self.fitted}
        options = replace(made, start=GivenStart(by_setting=ended, is_of_one_model=True))
        squares = {known.label: np.zeros(2) for known in self.probed}
        for traces in tests:
            campaign = identify(traces, damper, options, jobs=available_cores())
            assessment = assess(campaign, damper, solver=options.solver, jobs=available_cores())
            judged = [stage_of(fit, assessment) for fit in reconsider(campaign, assessment).fits]
            stages = {stage.setting.label: stage for stage in judged}
            for label in squares:
                if label not in stages or stages[label].covariance is None:
                    raise LogError(f"setting {label} has no errors", code="no-setting-fitted")
                errors = self.question.errors(damper, stages[label], assessment.forces)
                squares[label] += np.square(errors) / len(tests)
        return squares

    def _recorded(
        self, known: _Known, test: NextTest, warm: float | None, seed: Sequence[int]
    ) -> Trace:
        """A test as the rig writes it, conditioned; the same noise in every call.

        The scatter between cycles is all taken for noise of the force, white before the filter;
        that of the displacement comes to it, for it drives the model. An analogue filter of the
        rig is nearly one at a multiple of the rate.
        """
        own, finer = self.options, _FINER if self.options.rig_filter == "analogue" else 1
        rate = finer * self.rate
        motion = sine_motion(
            test.amplitude, test.frequency, cycles=test.cycles + _RUN_IN, sample_rate=rate
        )
        force = known.setting.simulate(replace(motion, temperature=warm)).force

        def filtered(channels: FloatArray, rate: float) -> FloatArray:
            if own.rig_filter == "none":
                return channels
            design, is_whole = passed_filter(own, rate), own.rig_filter == "zero_phase"
            return apply_filter(design._replace(is_zero_phase=is_whole), channels)

        # Samples of an analogue filter fall at any phase of the motion.
        first = sum(seed) % finer
        logged = filtered(np.stack([motion.displacement, force]), rate)[:, first::finer]
        white = np.random.default_rng(seed).standard_normal(logged.shape)
        white *= [[self.displacement_noise], [known.noise * math.sqrt(self.worth)]]
        logged += filtered(white, self.rate)
        recording = Recording(
            *(f"test {seed}", "", "", known.setting.setting),
            time=np.arange(logged.shape[1]) / self.rate,
            displacement=logged[0],
            force=logged[1],
            temperature=None if warm is None else np.full(logged.shape[1], warm),
            reverse_displacement=False,
            reverse_force=False,
        )
        return condition(recording, own)
