"""What was held out: which logs, segments and cycles, and how the parameters predict them.

A low MSE is no proof of a model: at one amplitude and frequency a wrong one bends its parameters
until it fits. It shows where nothing was bent: at another amplitude or frequency. What is held out
and missed withholds a grade, which is then one of the tests, not of the damper.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.conditioning import TRANSIENTS, noise_floor
from damperfit.errors import ConfigurationError, LogError, SimulationError
from damperfit.identification import (
    Status,
    compare,
    normalised_mse,
    unlimited_in,
    values_from_others,
)
from damperfit.problem import Problem, warning
from damperfit.simulation import SolverOptions
from damperfit.tested.setting import Setting
from damperfit.uncertainty.grades import LIMITS, Objection
from damperfit.uncertainty.residuals import residual_scatter
from damperfit.units.quantities import parse_quantity

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from damperfit.damper.model import Model
    from damperfit.identification import Campaign, Fit, SimulatedLog
    from damperfit.recording import Stretch, Trace
    from damperfit.uncertainty.assessment import Assessment

    FloatArray = NDArray[np.float64]

# What is held out


@dataclass(frozen=True, slots=True)
class SegmentRange:
    """The segments of a log that have a frequency, or a peak speed, within limits."""

    dimension: str  # "frequency" or "velocity"
    low: float  # both limits are included, Hz or m/s
    high: float

    @classmethod
    def parse(cls, text: str) -> SegmentRange | None:
        """Return the range that a text says, as in "4Hz-10Hz" or "0.2m/s-"; None: it says none.

        A ConfigurationError: the upper limit lies below the lower one.

        Examples
        --------
        >>> SegmentRange.parse("0.2m/s-")
        SegmentRange(dimension='velocity', low=0.2, high=inf)
        >>> SegmentRange.parse("run-2.csv") is None
        True
        """
        number = r"(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?"
        for dimension, units in (("frequency", "k?Hz"), ("velocity", "m?m/s|in/s")):
            limit = f"({number} ?(?:{units}))?"
            found = re.fullmatch(f"{limit} ?- ?{limit}", text.strip(), re.IGNORECASE)
            if found is None or not any(found.groups()):
                continue
            low, high = (
                parse_quantity(end, dimension) if end else default
                for end, default in zip(found.groups(), (0.0, math.inf), strict=True)
            )
            if low > high:
                raise ConfigurationError(
                    f"{text}: the upper limit lies below the lower one; expected as in 4Hz-10Hz",
                    code="out-of-range",
                )
            return cls(dimension, low, high)
        return None

    def holds(self, segment: Stretch) -> bool:
        """Whether a segment lies within the limits."""
        is_speed = self.dimension == "velocity"
        return self.low <= (segment.peak_speed if is_speed else segment.frequency) <= self.high

    def split(self, trace: Trace) -> tuple[Trace | None, ...]:
        """Return a log without the segments within the limits, and these alone; None for none."""
        parts = []
        for is_held in (False, True):
            kept = tuple(part for part in trace.stretches if self.holds(part) is is_held)
            parts.append(replace(trace, stretches=kept) if kept else None)
        return tuple(parts)


def split_cycles(trace: Trace, cycles: float) -> tuple[Trace, Trace]:
    """Return a log without its last steady cycles, and with these alone.

    A whole number, or below 1 a share of them (one at least). A stretch with too few is fitted
    whole; a LogError: no cycle would be left to fit.
    """
    fitted, held_out = [], []
    for stretch in trace.stretches:
        # The last ones of each, in one piece: where a log drifts, it shows there, and the filter's
        # memory joins the two parts at one place only.
        n, starts = stretch.n_cycles, stretch.cycle_starts
        left = n - (max(1, round(cycles * n)) if cycles < 1.0 else round(cycles))
        if left <= 0:
            fitted.append(stretch)
            continue
        edge, (ahead, behind) = round(float(starts[left])), stretch.smeared
        inner, outer = starts[: left + 1], starts[left:]
        fitted.append(replace(stretch, stop=edge, cycle_starts=inner, smeared=(ahead, 0)))
        held_out.append(replace(stretch, first=edge, cycle_starts=outer, smeared=(0, behind)))
    if not held_out:
        n = max(stretch.n_cycles for stretch in trace.stretches)
        raise LogError(
            f"{n} steady cycle{'s' if n > 1 else ''}, of which {max(1, round(cycles))} are to be "
            "held out: none is left to fit; hold out fewer, or give a longer log",
            subject=trace.name,
            code="nothing-to-fit",
        )
    return replace(trace, stretches=tuple(fitted)), replace(trace, stretches=tuple(held_out))


# How it is predicted

# Twice the expected square is beyond the scatter of an MSE over a cycle or more; ten times is a
# misfit three times as large as where the model was fitted.
_WORSE = 2.0
_NOT_PREDICTED = 10.0
# Of the deviation of the fitted forces. The first quarter of a cycle at the slowest of several
# speeds has a thirtieth of it, and friction that turns in the noise of a sensor a hundredth.
_SMALL = 0.01
# Times the noise of the velocity that drives the model; slower than that chance decides which way
# friction acts. A run-down at 0.2 Hz spends a quarter of its time there: of the exact truth 36 of
# 44 % were missed in it, and beyond three deviations no more than everywhere. With less than the
# second share of the variance left nothing is tested.
_OF_CHANCE = 3.0
_LEAST_TESTED = 0.3
# N; a load cell drifts by less between tests.
_TOLD_OFFSET = 1.0
# Stroke and peak speed that differ by less are one motion: rigs repeat both to a per cent or two.
_SAME_MOTION = 0.05


@dataclass(frozen=True, slots=True, eq=False)
class Prediction:
    """How the parameters of a setting meet what was not fitted."""

    setting: Setting
    trace: Trace  # what was predicted; its stretches hold the held-out cycles only
    is_part: bool  # whether the other cycles of the same log were fitted
    mse_percent: float  # eq. (22) over them,
    noise_floor_percent: float  # and the part that is scatter between its cycles; NaN for one
    fitted_mse_percent: float  # eq. (22) over the logs that were fitted
    # What the MSE would be with the lack of fit of the fitted logs and the noise, of both channels,
    # of this one; at another motion at least what matters, 0.05 %, for noise of the displacement
    # costs far more at low speed, and a single cycle does not tell how much.
    expected_mse_percent: float
    # Whether its strokes and speeds were all fitted too: then it tells of drift and scatter, and
    # every law that was bent to the one meets the other.
    is_same_motion: bool = False
    is_same_speed: bool = False  # whether its peak speeds were all fitted, at other strokes
    # No log of its setting was fitted: its values are put together from those of other settings
    # with the same clicks; a force offset, which is each test's own, is taken from the log.
    is_unseen: bool = False
    # Of those the values to which the logs of these settings set no upper limit.
    unlimited: tuple[str, ...] = ()
    # N, of the log beyond the fitted one, where that is a number of each test and not counted: of
    # another log and another motion, whose rig may have been tared anew. 0: it is counted.
    own_offset: float = 0.0
    # Of the force's variance, in the samples that are compared: beside cycles those in which the
    # velocity is within its own noise are left out, for chance turns the friction there.
    tested_share: float = 1.0

    @property
    def ratio(self) -> float:
        """MSE over the one expected; about 1 for a model that carries over."""
        return self.mse_percent / max(self.expected_mse_percent, 1e-300)

    @property
    def is_test(self) -> bool:
        """Whether enough of the force lies where the model can be tested."""
        return self.tested_share >= _LEAST_TESTED

    @property
    def is_failed(self) -> bool:
        """Whether it is met clearly worse than what was fitted."""
        return self.is_test and self.ratio >= _WORSE

    @property
    def cycles(self) -> str:
        """Which of the log's steady cycles, in words; "transients": what moves beside them."""
        if not self.is_part:
            return "all"
        if self.trace.n_cycles and not self.is_same_motion:
            return f"{self.trace.n_cycles} of other segments"
        return f"last {self.trace.n_cycles}" if self.trace.n_cycles else TRANSIENTS

    @property
    def verdict(self) -> str:
        """The ratio in words, and whether it tests the model at all."""
        if not self.is_test:
            share = 100.0 * (1.0 - self.tested_share)
            words = (
                f"no test: {share:.0f} % of the force's variance lies where the speed is within "
                "its noise"
            )
        elif self.is_failed and self.ratio >= _NOT_PREDICTED:
            words = f"not predicted: {float(f'{self.ratio:.2g}'):.0f} times the expected MSE"
        elif self.is_failed:
            # 9.96 rounded up would say that the log is not predicted.
            words = f"worse than fitted: {min(self.ratio, 9.9):.2g} times the expected MSE"
        elif self.mse_percent < _NOT_PREDICTED * self.fitted_mse_percent:
            words = "predicted as well as fitted"
        else:
            words = f"predicted within the expected {self.expected_mse_percent:.2g} %"
        if self.is_unseen:
            words = f"{words}; parameters combined from settings that share its clicks"
            names = ", ".join(self.unlimited)
            return f"{words}, whose logs do not determine {names}" if names else words
        if self.is_same_motion:
            return f"{words}; same stroke and speed as the fitted logs, so no test of the model"
        own = float(f"{self.own_offset:.2g}")
        if abs(own) >= _TOLD_OFFSET:
            words = f"{words}; with its own force offset, {own:+g} N from the fitted"
        if self.is_same_speed:
            words = f"{words}; peak speeds are those of the fitted logs, so it proves little"
        return words

    def describe(self) -> dict[str, Any]:
        """Return the prediction for run.json."""
        return {
            "setting": self.setting,
            "log": self.trace.name,
            "cycles": self.cycles,
            "amplitude_m": self.trace.amplitude,
            "frequency_Hz": self.trace.frequency,
            "mse_percent": self.mse_percent,
            "noise_floor_percent": self.noise_floor_percent,
            "fitted_mse_percent": self.fitted_mse_percent,
            "expected_mse_percent": self.expected_mse_percent,
            "is_same_motion": self.is_same_motion,
            "is_same_speed": self.is_same_speed,
            "is_unseen": self.is_unseen,
            "unlimited": list(self.unlimited),
            "own_offset_N": self.own_offset,
            "tested_share": self.tested_share,
            "verdict": self.verdict,
        }


def predict(
    campaign: Campaign,
    assessment: Assessment,
    traces: Sequence[Trace],
    *,
    damper: Model,
    solver: SolverOptions = SolverOptions(tolerance=1e-2),
) -> tuple[Prediction, ...]:
    """Predict held-out logs with the parameters of their settings, by setting; a simulation each.

    Those of a setting without a fit are predicted where others of a joint fit have its clicks;
    else, or where they cannot be simulated, they are left out. An empty assessment: all misfit of
    the fitted logs counts as lack of fit.
    """
    fits = {fit.setting: fit for fit in campaign.fits}
    parameters = {setting: fit.parameters for setting, fit in fits.items()}
    noise = {one.setting: _known(one.noise_percent) for one in assessment.diagnoses}
    unlimited = {fit.setting: assessment.unlimited(fit) for fit in campaign.fits}
    lacks = [max(fit.mse_percent - noise.get(fit.setting, 0.0), 0.0) for fit in campaign.fits]
    found = []
    for trace in traces:
        if trace.setting is None:
            continue
        setting = Setting.of(trace.setting)
        fit = fits.get(trace.setting)
        values = values_from_others(parameters, setting) if fit is None else fit.parameters
        if values is None:
            continue
        try:
            seen = compare(values, trace, damper, solver=solver)
        except SimulationError:
            continue
        if fit is not None:
            found.append(_prediction(fit, trace, seen, noise.get(fit.setting, 0.0)))
            continue
        measured, simulated = trace.force[trace.compared], seen.force[trace.compared]
        if any(one.is_offset for one in values.quantities):
            simulated = simulated + float(np.mean(measured - simulated))
        lack = float(np.mean(lacks))
        found.append(
            Prediction(
                setting=setting,
                trace=trace,
                is_part=False,
                mse_percent=normalised_mse(measured, simulated),
                noise_floor_percent=noise_floor(trace),
                fitted_mse_percent=float(np.mean([fit.mse_percent for fit in campaign.fits])),
                expected_mse_percent=_expected(lack + _noise(trace, measured - simulated, 0.0)),
                is_unseen=True,
                unlimited=unlimited_in(values, parameters, unlimited),
            )
        )
    return tuple(sorted(found, key=lambda prediction: prediction.setting))


def _prediction(fit: Fit, trace: Trace, seen: SimulatedLog, fitted_noise: float) -> Prediction:
    measured, simulated = trace.force[trace.compared], seen.force[trace.compared]
    fitted = np.concatenate([log.trace.force[log.trace.compared] for log in fit.logs])
    elsewhere = 0.01 * fitted_noise * float(np.var(fitted))
    noise = _noise(trace, measured - simulated, elsewhere)
    is_part = any(log.trace.name == trace.name for log in fit.logs)
    is_same_motion = _is_same_motion(fit, trace)
    # An offset that the fit has found is that of its own logs, and no number of the damper.
    is_tared = any(
        one.is_offset and fit.status[one.name] in {Status.FITTED, Status.SHARED}
        for one in fit.parameters.quantities
    )
    offset, share = 0.0, 1.0
    if is_tared and not is_part and not is_same_motion:
        offset = float(np.mean(measured - simulated))
        simulated = simulated + offset
    if is_part and not trace.n_cycles:
        # The MSE below which no law is asked to explain more of what moves beside cycles.
        least = _SMALL * float(np.std(fitted)) / float(np.std(measured))
        noise = max(noise, 100.0 * least**2)
        tested = _tested(trace)
        spread = (measured - np.mean(measured)) ** 2
        share = float(np.sum(spread[tested]) / max(float(np.sum(spread)), 1e-300))
        if share >= _LEAST_TESTED:
            measured, simulated = measured[tested], simulated[tested]
    expected = max(fit.mse_percent - fitted_noise, 0.0) + noise
    return Prediction(
        setting=fit.setting,
        trace=trace,
        is_part=is_part,
        mse_percent=normalised_mse(measured, simulated),
        noise_floor_percent=noise_floor(trace),
        fitted_mse_percent=fit.mse_percent,
        expected_mse_percent=expected if is_same_motion else _expected(expected),
        is_same_motion=is_same_motion,
        is_same_speed=_is_same_motion(fit, trace, has_same_stroke=False),
        own_offset=offset,
        tested_share=share,
    )


def _expected(percent: float) -> float:
    """Return the MSE that a model which carries over has, %; none below what matters is asked."""
    from damperfit.laws.law_fit import PREDICTED_PERCENT

    return max(percent, PREDICTED_PERCENT)


def _noise(trace: Trace, rest: FloatArray, elsewhere: float) -> float:
    """What scatter between a residual's cycles costs, %; else as much as there is `elsewhere`."""
    scatter = sum(
        stretch.n_samples
        * (residual_scatter(rest[place], stretch) if stretch.n_cycles > 1 else elsewhere)
        for stretch, place in zip(trace.stretches, trace.places, strict=True)
    )
    variance = float(np.var(trace.force[trace.compared]))
    return _known(100.0 * scatter / trace.n_samples / variance)


def _known(percent: float) -> float:
    """Nothing is known of the scatter of a single cycle: then all of the misfit is lack of fit."""
    return 0.0 if math.isnan(percent) else percent


def _tested(trace: Trace) -> NDArray[np.bool_]:
    """Return the compared samples whose speed is beyond its noise, which turns friction there."""
    found = (one.value for one in trace.findings if one.name == "displacement_noise")
    displacement = 1e-6 * (next(found, None) or 0.0)
    corner = min(trace.drive.corner, 0.5 / trace.interval)
    passed = math.sqrt(2.0 * corner * trace.interval) * 2.0 * math.pi * corner / math.sqrt(3.0)
    speed = np.abs(trace.drive.velocity[trace.compared])
    return np.asarray(speed > _OF_CHANCE * passed * displacement)


def _is_same_motion(fit: Fit, trace: Trace, *, has_same_stroke: bool = True) -> bool:
    """Whether every stretch of a log has the speed of a fitted one, and its stroke; no road has."""
    fitted = [one for log in fit.logs for one in log.trace.stretches if one.n_cycles]
    return all(
        one.n_cycles
        and any(
            (not has_same_stroke or abs(one.amplitude / other.amplitude - 1.0) < _SAME_MOTION)
            and abs(one.peak_speed / other.peak_speed - 1.0) < _SAME_MOTION
            for other in fitted
        )
        for one in trace.stretches
    )


# What follows from it


def prediction_warnings(predictions: Sequence[Prediction]) -> tuple[Problem, ...]:
    """Return one problem for all predictions that fail, led by the worst; none where none does."""
    failed = [one for one in predictions if one.is_failed]
    if not failed:
        return ()
    worst = max(failed, key=lambda one: one.ratio)
    what = (
        "repeats of fitted tests differ from them: the rig or the damper has drifted"
        if worst.is_same_motion
        else "the parameters hold for the tests that were fitted, not for the damper"
    )
    which = "{n_failed} of {n} held-out logs are predicted worse than the fitted ones, most {log}: "
    if all(one.cycles == TRANSIENTS for one in failed):
        which = (
            "transients, which are not fitted, are predicted worse than the steady cycles in "
            "{n_failed} of {n} logs, most in {log}: "
        )
    found = warning(
        "drifted" if worst.is_same_motion else "not-predicted",
        which + "{verdict}; " + what,
        n_failed=len(failed),
        n=len(predictions),
        log=worst.trace.name,
        verdict=worst.verdict,
    )
    return (found,)


def missed_predictions(predictions: Iterable[Prediction]) -> dict[Setting, Objection]:
    """Return by setting the held-out test that is missed most, as a reason to withhold its grade.

    Of fitted settings and of other motions: a repeat that is missed tells of drift, not of the law.
    """

    def percent(value: float) -> str:
        """Two digits, and no power of ten."""
        return f"{value:.2g}" if value < 100.0 else f"{float(f'{value:.2g}'):.0f}"

    found = {}
    for one in sorted(predictions, key=lambda missed: missed.mse_percent):
        is_much = one.mse_percent > LIMITS.predicted_percent and one.ratio > LIMITS.predicted_times
        if not is_much or one.is_same_motion or one.is_unseen:
            continue
        what, was, is_missed = one.trace.name, "was", "is"
        if one.cycles == TRANSIENTS:
            what = f"the run-up, coast-down or changes of speed of {what}"
            was, is_missed = "were", "are"
        text = (
            f"{what}, which {was} not fitted, {is_missed} predicted with an MSE of "
            f"{percent(one.mse_percent)} % where {percent(one.expected_mse_percent)} % is "
            "expected: the numbers hold for the motion that was fitted"
        )
        found[one.setting] = Objection("prediction", "", text)  # the worst, last, stands
    return found
