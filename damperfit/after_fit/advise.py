"""Which test next: how far further tests would narrow an interval.

The force is linear in du near the fitted values, so a test with information G narrows the variance
of a quantity with gradient g to g' (C^-1 + G)^-1 g, with C the covariance of the run. Candidates
are screened by one steady cycle behind the run's own filter,

    G = J'J n_eff / (n s^2)

with J from the sensitivities of the core, s the scatter between cycles that the run has measured,
and n_eff the effective sample size of white noise behind the filter. The best are then recorded as
the rig would do it, with its rate and the noise of both channels: noise of the displacement drives
the model, and its residual is neither white nor independent of J. With scores h_t = J_t r_t

    G = H S^-1 H,    H = J'J,    S = the covariance of sum h_t

C includes lack of fit that repeats, which no test of the same kind reduces: that part stays.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from statistics import median
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.conditioning import condition
from damperfit.conditioning.filters import apply_filter, design_filter
from damperfit.damper.quasi_static import quasi_static
from damperfit.errors import ConditioningError, ConfigurationError, SimulationError, did_you_mean
from damperfit.identification.simulated_log import compare
from damperfit.problem import Option
from damperfit.recording import Recording
from damperfit.reporting.sheet import Sheet
from damperfit.simulation import sine_motion
from damperfit.statistics import NORMAL_95
from damperfit.uncertainty.correlation import (
    correlation_length,
    independent_samples,
    score_covariance,
)
from damperfit.units.quantities import parse_quantity

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.damper.model import Values
    from damperfit.recording import Trace
    from damperfit.results import Run, SettingResult

    FloatArray = NDArray[np.float64]

__all__ = ["Advice", "Limits", "NextTest", "Question", "advise", "half_interval"]

_AMPLITUDES, _FREQUENCIES = 6, 8  # of the grid of candidates, spaced evenly by their logarithm
_SAMPLES = 400  # of a cycle
_RUN_IN = 2  # cycles before the one that is evaluated
_FEWEST_CYCLES, _MOST_CYCLES = 3, 15
_FOLLOWED = 4  # candidates that are recorded too
_SLOWEST = 0.1  # Hz
_SMALLEST = 16.0  # times below the largest stroke
_USEFUL = 0.8  # of the interval: what a test that helps leaves at most
_AVERAGED = ("f_f",)  # over the settings, by procedure `paper`
_BETWEEN = 10.0  # s that a rig needs to set up and settle


@dataclass(frozen=True, slots=True)
class Limits:
    """What the rig can do.

    Attributes
    ----------
    stroke, speed, force, frequency : float
        Largest amplitude (m), peak speed (m/s), force (N) and frequency (Hz).
    minutes : float
        Longest test at one setting.
    """

    stroke: float
    speed: float
    force: float = math.inf
    frequency: float = 10.0
    minutes: float = 2.0


@dataclass(frozen=True, slots=True)
class Question:
    """What is to be known better: a quantity, or the force at a speed (negative: compression)."""

    quantity: str = ""
    speed: float = math.nan

    @classmethod
    def of(cls, text: str) -> Question:
        """Read "k_e" or "force@0.05m/s"."""
        name, at, speed = text.strip().lower().partition("@")
        if name != "force":
            return cls(quantity=name)
        if not at:
            raise ConfigurationError(
                "found 'force'; expected a speed with it, as in force@0.05m/s",
                where=Option("for_", text),
                code="question",
            )
        return cls(speed=parse_quantity(speed, "velocity", option=Option("for_")))

    @property
    def title(self) -> str:
        """As in a sentence."""
        if self.quantity:
            return self.quantity
        stroke = "rebound" if self.speed >= 0.0 else "compression"
        return f"the {stroke} force at {abs(self.speed):g} m/s"


@dataclass(frozen=True, slots=True)
class NextTest:
    """One candidate test, and what it promises.

    Attributes
    ----------
    amplitude, frequency : float
        m and Hz of a sine.
    cycles : int
        Steady cycles that are evaluated.
    minutes : float
        Of the rig, all settings.
    shares : dict of str to float
        Interval after the test as a share of that before it, by setting; the worst over the
        intervals of the values.
    """

    amplitude: float
    frequency: float
    cycles: int
    minutes: float
    shares: dict[str, float]

    @property
    def share(self) -> float:
        """Median over the settings."""
        return median(self.shares.values())

    @property
    def rank(self) -> float:
        """Errors fall with the root of the time: share for the same time on the rig."""
        return self.share * math.sqrt(self.minutes)

    @property
    def speed(self) -> float:
        """Peak speed, m/s."""
        return 2.0 * math.pi * self.frequency * self.amplitude


@dataclass(frozen=True, slots=True)
class Advice:
    """The answer: candidates by rank, and what is known today.

    Attributes
    ----------
    question : Question
        What was asked.
    tests : tuple of NextTest
        The best first.
    now : dict of str to float
        Half of today's 95 % interval by setting: relative for a quantity, N for a force.
    floors : dict of str to float
        What of it no further test of this kind takes off, by setting.
    """

    question: Question
    tests: tuple[NextTest, ...]
    now: dict[str, float]
    floors: dict[str, float]

    def document(self) -> dict[str, Any]:
        """Return the answer as JSON values."""
        return {
            "for": self.question.title,
            "sentence": self.sentence,
            "interval_now": self.now,
            "tests": [
                {
                    "amplitude_m": test.amplitude,
                    "frequency_Hz": test.frequency,
                    "peak_speed_m_per_s": test.speed,
                    "cycles": test.cycles,
                    "minutes": test.minutes,
                    "share": test.share,
                    "shares": test.shares,
                }
                for test in self.tests
            ],
        }

    def sheet(self) -> Sheet:
        """Return the candidates as a table."""
        rows = tuple(
            (
                f"{1e3 * test.amplitude:.3g}",
                f"{test.frequency:.3g}",
                f"{test.speed:.3g}",
                str(test.cycles),
                f"{test.minutes:.1f}",
                f"{100.0 * test.share:.3g}",
                f"{100.0 * max(test.shares.values()):.3g}",
            )
            for test in self.tests
        )
        return Sheet(
            ("amplitude", "frequency", "speed", "cycles", "rig", "interval", "worst setting"),
            ("mm", "Hz", "m/s", "", "min", "% of now", "% of now"),
            rows,
            (True,) * 7,
        )

    @property
    def sentence(self) -> str:
        """The advice in a sentence or two."""
        title = self.question.title
        if not self.tests:
            return f"no test is within the limits of the rig, so none narrows {title}"
        best = self.tests[0]
        if best.share > _USEFUL:
            floor = median(self.floors[name] / self.now[name] for name in self.now)
            why = (
                "most of the interval is lack of fit or an undeclared default, which another test "
                "of this kind repeats"
                if floor > _USEFUL
                else "the force hardly depends on it at any motion within the limits"
            )
            return (
                f"no test within these limits narrows the interval of {title} by more than "
                f"{max(100.0 * (1.0 - best.share), 0.0):.0f} %: {why}"
            )
        return (
            f"test {1e3 * best.amplitude:.3g} mm at {best.frequency:.3g} Hz "
            f"({best.cycles} steady cycles): the interval of {title} shrinks to "
            f"{100.0 * best.share:.2g} % of today's (median of {len(best.shares)} settings), in "
            f"{best.minutes:.1f} min on the rig"
        )


def advise(
    run: Run, question: Question, limits: Limits, settings: Sequence[SettingResult]
) -> Advice:
    """Return which sine tells most about a question, at the settings together.

    Parameters
    ----------
    run : Run
        With covariances.
    question : Question
        What is to be known better.
    limits : Limits
        Of the rig.
    settings : sequence of SettingResult
        Of the run.

    Raises
    ------
    ConfigurationError
        The run has no errors, or its model no such quantity.
    """
    known = [_Known.of(run, setting, question) for setting in settings if _has_errors(setting)]
    known = [setting for setting in known if setting.now > 0.0]
    if not known:
        raise ConfigurationError(
            f"{run.name}: no setting has an error of {question.title}: it is held, or the fit "
            "found no minimum; fit it first",
            code="nothing-to-narrow",
        )
    rig = _Rig.of(run, limits)
    tests = [
        test
        for amplitude, frequency in _candidates(limits)
        if (test := _promise(rig, known, amplitude, frequency)) is not None
    ]
    tests.sort(key=lambda test: test.rank)
    # The best once more: over the intervals of the values, and with the noise of both channels.
    for k, screened in enumerate(tests[:_FOLLOWED]):
        wide = _promise(rig, known, screened.amplitude, screened.frequency, question.quantity)
        tests[k] = _recorded_promise(rig, known, wide or screened)
    tests = sorted(tests[:_FOLLOWED], key=lambda test: test.rank)
    return Advice(
        question,
        tuple(tests),
        {setting.result.label: setting.now for setting in known},
        {setting.result.label: setting.floor for setting in known},
    )


def half_interval(run: Run, setting: SettingResult, question: Question) -> float:
    """Return half of the 95 % interval: relative for a quantity, N for a force."""
    assert setting.covariance is not None
    gradient = _gradient(run, setting, question)
    return NORMAL_95 * math.sqrt(max(float(gradient @ setting.covariance @ gradient), 0.0))


def _has_errors(setting: SettingResult) -> bool:
    return setting.covariance is not None and len(setting.names) > 0


def _candidates(limits: Limits) -> Iterator[tuple[float, float]]:
    smallest = limits.stroke / _SMALLEST
    slowest = min(_SLOWEST, limits.frequency)
    for amplitude in np.geomspace(smallest, limits.stroke, _AMPLITUDES):
        for frequency in np.geomspace(slowest, limits.frequency, _FREQUENCIES):
            if 2.0 * math.pi * amplitude * frequency <= limits.speed * (1.0 + 1e-9):
                yield float(amplitude), float(frequency)


@dataclass(frozen=True, slots=True, eq=False)
class _Known:
    """What a run knows of one setting."""

    result: SettingResult
    covariance: FloatArray  # of noise alone, u
    gradient: FloatArray  # of the question by u
    segment: Mapping[str, Any]  # of its logs, with the noise of the filtered force
    now: float
    floor: float

    @classmethod
    def of(cls, run: Run, setting: SettingResult, question: Question) -> _Known:
        assert setting.covariance is not None
        gradient = _gradient(run, setting, question)
        total = float(gradient @ setting.covariance @ gradient)
        misfit = _misfit_covariance(setting)
        fixed = min(float(gradient @ misfit @ gradient), total)
        covariance = setting.covariance - misfit
        if np.linalg.eigvalsh(covariance).min() <= 0.0:  # rounding: keep the shape, lose the part
            covariance = setting.covariance * max(1.0 - fixed / total, 1e-6) if total else misfit
        return cls(
            setting,
            covariance,
            gradient,
            _segment_of(run, setting),
            NORMAL_95 * math.sqrt(max(total, 0.0)),
            NORMAL_95 * math.sqrt(max(fixed, 0.0)),
        )

    @property
    def noise(self) -> float:
        """Scatter of the filtered force between cycles, N."""
        return float(self.segment["noise_N"])

    def share_after(self, information: FloatArray) -> float:
        """Interval after a test with this information, as a share of that before."""
        precision = np.linalg.inv(self.covariance) + information
        variance = self.gradient @ np.linalg.solve(precision, self.gradient)
        half = NORMAL_95 * math.sqrt(max(float(variance), 0.0))
        return math.hypot(half, self.floor) / self.now


def _gradient(run: Run, setting: SettingResult, question: Question) -> FloatArray:
    """The question by u of the setting's values that have an error."""
    names = setting.names
    if question.quantity:
        known = [name.lower() for name in run.damper.names]
        if question.quantity not in known:
            raise ConfigurationError(
                f"found {question.quantity!r}; expected force@SPEED or one of "
                f"{', '.join(known)}.{did_you_mean(question.quantity, known)}",
                where=Option("for_", question.quantity),
                code="question",
            )
        return np.array([float(name == question.quantity) for name in names])
    forces = quasi_static(
        run.damper, setting.parameters, [question.speed], sensitivities=tuple(names)
    )
    return forces.slopes[:, 0]


def _scales(values: Values, names: Sequence[str]) -> FloatArray:
    """dy/du: y of quantities taken by their logarithm."""
    return np.array(
        [values[name] if values.quantity(name).is_logarithmic else 1.0 for name in names]
    )


def _misfit_covariance(setting: SettingResult) -> FloatArray:
    errors = np.array([setting.misfits.get(name, 0.0) for name in setting.names])
    return np.diag((errors / _scales(setting.parameters, setting.names)) ** 2)


def _segment_of(run: Run, setting: SettingResult) -> Mapping[str, Any]:
    """The steady segment of a setting's logs with the median noise of the force."""
    known: list[Mapping[str, Any]] = [
        segment
        for segment in run.record.get("stretches", ())
        if segment.get("setting") == setting.setting.cell
        and segment.get("noise_N")
        and segment.get("frequency_Hz")
    ]
    if not known:
        raise ConfigurationError(
            f"{run.name}: run.json does not have the noise of setting {setting.label}; identify "
            "logs with steady cycles",
            code="no-noise",
        )
    return sorted(known, key=lambda segment: float(segment["noise_N"]))[len(known) // 2]


def _channels_of(run: Run) -> tuple[float, float]:
    """Sample rate of the logs, Hz, and noise of their displacement, m."""
    inputs = run.record.get("inputs", ())
    rates = [float(log["sample_rate_Hz"]) for log in inputs if log.get("sample_rate_Hz")]
    noises = [
        parse_quantity(f"{finding['value']}{finding['unit']}", "length")
        for log in inputs
        for finding in log.get("findings", ())
        if finding.get("name") == "displacement_noise" and finding.get("value")
    ]
    return (median(rates) if rates else 1000.0), (median(noises) if noises else 0.0)


@dataclass(frozen=True, slots=True)
class _Rig:
    """What simulates a test as the rig would record it."""

    run: Run
    limits: Limits
    filter: str
    corner: float
    order: int
    samples_per_second: float  # effective ones, of white noise behind the filter
    rate: float  # of the logs, Hz
    displacement_noise: float  # m

    @classmethod
    def of(cls, run: Run, limits: Limits) -> _Rig:
        options = run.configuration.conditioning
        kind, corner, order = options.filter, options.filter_corner, options.filter_order
        if options.rig_filter != "none":
            kind, corner, order = (
                options.rig_filter,
                options.rig_filter_corner,
                options.rig_filter_order,
            )
        rate, seconds = 1000.0, 10.0
        design = design_filter(kind, corner, sample_rate=rate, order=order)
        return cls(
            run,
            limits,
            kind,
            corner,
            order,
            independent_samples(design, round(rate * seconds)) / seconds,
            *_channels_of(run),
        )

    def information(
        self,
        known: _Known,
        values: Values,
        amplitude: float,
        frequency: float,
        cycles: int,
    ) -> FloatArray | None:
        """Information of a test by u, from one steady cycle; None: beyond the rig's force."""
        per_cycle = max(_SAMPLES, math.ceil(4.0 * self.corner / frequency))
        rate = per_cycle * frequency
        motion = sine_motion(amplitude, frequency, cycles=_RUN_IN + 2, sample_rate=rate)
        names = known.result.names
        response = self.run.damper.simulate(
            values, motion, sensitivities=names, options=self.run.solver
        )
        design = design_filter(self.filter, self.corner, sample_rate=rate, order=self.order)
        steady = slice(_RUN_IN * per_cycle, (_RUN_IN + 1) * per_cycle)
        if np.abs(response.force[steady]).max() > self.limits.force:
            return None
        slopes = np.stack([response.sensitivities[name] for name in names])
        jacobian = apply_filter(design, slopes)[:, steady].T * _scales(values, names)
        n_effective = cycles / frequency * self.samples_per_second
        return jacobian.T @ jacobian * (n_effective / len(jacobian) / known.noise**2)

    def recorded_information(
        self, known: _Known, amplitude: float, frequency: float, cycles: int
    ) -> FloatArray:
        """Information of a test by u as the rig would record it, noise of both channels in it."""
        values, names = known.result.parameters, known.result.names
        white = self._force_noise(known)
        trace = self._recorded(values, amplitude, frequency, cycles, white)
        seen = compare(values, trace, self.run.damper, sensitivities=names, solver=self.run.solver)
        part = trace.compared
        jacobian = (seen.sensitivities[:, part].T * _scales(values, names)).astype(float)
        residuals = trace.force[part] - seen.force[part]
        longest = round(0.25 / frequency / trace.interval)
        lag = correlation_length(residuals, longest=longest)
        scores = score_covariance(jacobian * residuals[:, None], lag)
        h = jacobian.T @ jacobian
        return np.asarray(h @ np.linalg.pinv(scores, hermitian=True) @ h)

    def _force_noise(self, known: _Known) -> float:
        """White noise of the force, N: what the scatter holds beside that of the displacement."""
        segment = known.segment
        amplitude, frequency = segment["amplitude_m"], segment["frequency_Hz"]
        values = known.result.parameters
        trace = self._recorded(values, amplitude, frequency, _RUN_IN + 6, 0.0)
        seen = compare(values, trace, self.run.damper, solver=self.run.solver)
        by_displacement = float(np.std((trace.force - seen.force)[trace.compared]))
        left = max(known.noise**2 - by_displacement**2, 0.01 * known.noise**2)
        return math.sqrt(left * self.rate / self.samples_per_second)

    def _recorded(
        self, values: Values, amplitude: float, frequency: float, cycles: int, white: float
    ) -> Trace:
        """A log of a test, conditioned; the same noise in every call."""
        random = np.random.default_rng(1)
        motion = sine_motion(amplitude, frequency, cycles=cycles + _RUN_IN, sample_rate=self.rate)
        response = self.run.damper.simulate(
            values, motion, sensitivities=(), options=self.run.solver
        )
        n = len(motion.displacement)
        recording = Recording(
            name="advised test",
            path="",
            sha256="",
            setting=None,
            time=np.arange(n) / self.rate,
            displacement=motion.displacement + self.displacement_noise * random.standard_normal(n),
            force=response.force + white * random.standard_normal(n),
            reverse_displacement=False,
            reverse_force=False,
        )
        return condition(recording, self.run.configuration.conditioning)


def _promise(
    rig: _Rig, known: Sequence[_Known], amplitude: float, frequency: float, quantity: str = ""
) -> NextTest | None:
    """What a test promises at each setting; None: a limit of the rig or the damper forbids it.

    With a quantity, the least over its interval.
    """
    seconds = 60.0 * rig.limits.minutes - _BETWEEN
    cycles = min(_MOST_CYCLES, int(seconds * frequency) - _RUN_IN)
    if cycles < _FEWEST_CYCLES:
        return None
    worst: dict[str, float] = {}
    for place in range(3 if quantity else 1):
        informations = []
        for setting in known:
            values = _within_interval(setting.result, quantity, place)
            try:
                information = rig.information(setting, values, amplitude, frequency, cycles)
            except SimulationError:
                return None
            if information is None:
                return None
            informations.append(information)
        worst = _larger(worst, _shares(rig.run, known, informations))
    minutes = len(known) * ((cycles + _RUN_IN) / frequency + _BETWEEN) / 60.0
    return NextTest(amplitude, frequency, cycles, minutes, worst)


def _recorded_promise(rig: _Rig, known: Sequence[_Known], screened: NextTest) -> NextTest:
    """The promise of a test that is recorded with the noise of the rig."""
    motion = (screened.amplitude, screened.frequency, screened.cycles)
    try:
        informations = [rig.recorded_information(setting, *motion) for setting in known]
    except (SimulationError, ConditioningError):  # it cannot be evaluated as it stands
        return replace(screened, shares=dict.fromkeys(screened.shares, 1.0))
    shares = _larger(screened.shares, _shares(rig.run, known, informations))
    return replace(screened, shares=shares)


def _larger(shares: dict[str, float], others: dict[str, float]) -> dict[str, float]:
    return {label: max(share, shares.get(label, 0.0)) for label, share in others.items()}


def _shares(
    run: Run, known: Sequence[_Known], informations: Sequence[FloatArray]
) -> dict[str, float]:
    """Interval after the test at all settings, as a share of that before it, by setting.

    The test at one setting tells of shared values what its own values leave (a Schur complement),
    and that serves all settings. Procedure `paper` averages only the friction so.
    """
    is_paper = run.configuration.identification.procedure == "paper"
    reduced = []
    for setting, information in zip(known, informations, strict=True):
        n = len(setting.result.own)
        own = information[:n, :n] + 1e-9 * np.eye(n)
        across = information[:n, n:]
        left = information[n:, n:] - across.T @ np.linalg.solve(own, across)
        if is_paper:
            averaged = np.array([name in _AVERAGED for name in setting.result.shared])
            left = left * np.outer(averaged, averaged)
        reduced.append(left)
    shares = {}
    for setting, information in zip(known, informations, strict=True):
        n, names = len(setting.result.own), setting.result.shared
        whole = information.copy()
        for other, left in zip(known, reduced, strict=True):
            if other is not setting and other.result.shared == names:
                whole[n:, n:] += left
        shares[setting.result.label] = setting.share_after(whole)
    return shares


def _within_interval(setting: SettingResult, quantity: str, place: int) -> Values:
    """The fitted values (place 0), or those with the quantity at an end of its interval."""
    limits = setting.intervals.get(quantity) if place else None
    limit = limits[place - 1] if limits else None
    if limit is None or limit <= 0.0:
        return setting.parameters
    return setting.parameters.replace({quantity: limit})
