"""Logs and cycles that were not fitted, predicted with the parameters of their setting.

A low MSE is no proof of a model: at one amplitude and frequency a wrong one bends its parameters
until it fits. It shows where nothing was bent: at another amplitude or frequency.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.conditioning import TRANSIENTS, noise_floor
from damperfit.errors import SimulationError
from damperfit.identification import (
    Status,
    compare,
    normalised_mse,
    unlimited_in,
    values_from_others,
)
from damperfit.laws import PREDICTED_PERCENT
from damperfit.simulation import SolverOptions
from damperfit.tested.setting import Setting
from damperfit.uncertainty.repeating import residual_scatter
from damperfit.workers import executor

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.damper.model import Model
    from damperfit.identification import Campaign, Fit, SimulatedLog
    from damperfit.recording import Trace
    from damperfit.uncertainty.assessment import Assessment

    FloatArray = NDArray[np.float64]

__all__ = [
    "Prediction",
    "predict",
    "prediction_warnings",
]


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
    """How the parameters of a setting meet what was not fitted.

    Attributes
    ----------
    setting : Setting
        Adjuster setting.
    trace : Trace
        What was predicted; its stretches hold the held-out cycles only.
    is_part : bool
        Whether the other cycles of the same log were fitted.
    mse_percent, noise_floor_percent : float
        Eq. (22) over them, and the part that is scatter between its cycles; NaN for a
        single cycle.
    fitted_mse_percent : float
        Eq. (22) over the logs that were fitted.
    expected_mse_percent : float
        What the MSE would be with the lack of fit of the fitted logs and the noise, of both
        channels, of this one; at another motion at least what matters, 0.05 %, for noise of the
        displacement costs far more at low speed, and a single cycle does not tell how much.
    is_same_motion : bool
        Whether its strokes and speeds were all fitted too: then it tells of drift and scatter, and
        every law that was bent to the one meets the other.
    is_same_speed : bool
        Whether its peak speeds were all fitted, at other strokes.
    is_unseen : bool
        No log of its setting was fitted: its values are put together from those of other settings
        with the same clicks; a force offset, which is each test's own, is taken from the log.
    unlimited : tuple of str
        Of those the values to which the logs of these settings set no upper limit.
    own_offset : float
        N, of the log beyond the fitted one, where that is a number of each test and not counted:
        of another log and another motion, whose rig may have been tared anew. 0: it is counted.
    tested_share : float
        Of the force's variance, in the samples that are compared: beside cycles those in which
        the velocity is within its own noise are left out, for chance turns the friction there.
    """

    setting: Setting
    trace: Trace
    is_part: bool
    mse_percent: float
    noise_floor_percent: float
    fitted_mse_percent: float
    expected_mse_percent: float
    is_same_motion: bool = False
    is_same_speed: bool = False
    is_unseen: bool = False
    unlimited: tuple[str, ...] = ()
    own_offset: float = 0.0
    tested_share: float = 1.0

    @property
    def ratio(self) -> float:
        """MSE over the one expected; about 1 for a model that carries over."""
        return self.mse_percent / max(self.expected_mse_percent, 1e-300)

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
        words = self._ratio_in_words
        if self.is_unseen:
            words = f"{words}; parameters combined from settings that share its clicks"
            names = ", ".join(self.unlimited)
            return f"{words}, whose logs do not determine {names}" if names else words
        if not self.is_same_motion:
            own = float(f"{self.own_offset:.2g}")
            if abs(own) >= _TOLD_OFFSET:
                words = f"{words}; with its own force offset, {own:+g} N from the fitted"
            if self.is_same_speed:
                words = f"{words}; peak speeds are those of the fitted logs, so it proves little"
            return words
        return f"{words}; same stroke and speed as the fitted logs, so no test of the model"

    @property
    def is_test(self) -> bool:
        """Whether enough of the force lies where the model can be tested."""
        return self.tested_share >= _LEAST_TESTED

    @property
    def _ratio_in_words(self) -> str:
        if not self.is_test:
            share = 100.0 * (1.0 - self.tested_share)
            return (
                f"no test: {share:.0f} % of the force's variance lies where the speed is within "
                "its noise"
            )
        if not self.is_failed:
            if self.mse_percent < _NOT_PREDICTED * self.fitted_mse_percent:
                return "predicted as well as fitted"
            return f"predicted within the expected {self.expected_mse_percent:.2g} %"
        if self.ratio >= _NOT_PREDICTED:
            return f"not predicted: {_rounded(self.ratio)} times the expected MSE"
        # 9.96 rounded up would say that the log is not predicted.
        return f"worse than fitted: {min(self.ratio, 9.9):.2g} times the expected MSE"

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


def _rounded(ratio: float) -> str:
    """Two digits without an exponent."""
    return f"{float(f'{ratio:.2g}'):.0f}"


def prediction_warnings(predictions: Sequence[Prediction]) -> tuple[str, ...]:
    """Return one sentence for all predictions that fail, led by the worst; none where none does."""
    failed = [one for one in predictions if one.is_failed]
    if not failed:
        return ()
    worst = max(failed, key=lambda one: one.ratio)
    said = (
        f"{len(failed)} of {len(predictions)} held-out logs are predicted worse than the fitted "
        f"ones, most {worst.trace.name}: {worst.verdict}; "
    )
    if worst.is_same_motion:
        return (
            f"{said}repeats of fitted tests differ from them: the rig or the damper has drifted",
        )
    return (f"{said}the parameters hold for the tests that were fitted, not for the damper",)


def predict(
    campaign: Campaign,
    assessment: Assessment,
    traces: Sequence[Trace],
    *,
    damper: Model,
    solver: SolverOptions = SolverOptions(tolerance=1e-2),
    jobs: int = 1,
) -> tuple[Prediction, ...]:
    """Predict logs with the parameters found for their settings; costs one simulation each.

    Parameters
    ----------
    campaign : Campaign
        Result of `identify`, made without these logs or cycles.
    assessment : Assessment
        What `assess` says of it; without it all misfit of the fitted logs counts as lack of fit.
    traces : sequence of Trace
        What was held out. Those of a setting without a fit are predicted where others of a joint
        fit have its clicks; else, or where they cannot be simulated, they are left out of the
        result.
    damper : Model
        The damper's model.
    solver : SolverOptions
        How exactly to integrate.
    jobs : int
        Threads.

    Returns
    -------
    tuple of Prediction
        By setting, then in the order given.
    """
    fits = {fit.setting: fit for fit in campaign.fits}
    parameters = {setting: fit.parameters for setting, fit in fits.items()}
    noise = {one.setting: _known(one.noise_percent) for one in assessment.diagnoses}
    unlimited = {fit.setting: assessment.unlimited(fit) for fit in campaign.fits}

    def one(trace: Trace) -> Prediction | None:
        if trace.setting is None:
            return None
        fit = fits.get(trace.setting)
        values = (
            values_from_others(parameters, Setting.of(trace.setting))
            if fit is None
            else fit.parameters
        )
        if values is None:
            return None
        try:
            seen = compare(values, trace, damper, solver=solver)
        except SimulationError:
            return None
        if fit is None:
            told = _unseen(Setting.of(trace.setting), campaign.fits, trace, seen, noise)
            return replace(told, unlimited=unlimited_in(values, parameters, unlimited))
        return _prediction(fit, trace, seen, noise.get(fit.setting, 0.0))

    with executor(jobs) as pool:
        found = [one for one in pool.map(one, traces) if one is not None]
    return tuple(sorted(found, key=lambda prediction: prediction.setting))


def _unseen(
    setting: Setting,
    fits: Sequence[Fit],
    trace: Trace,
    seen: SimulatedLog,
    fitted_noise: Mapping[Setting, float],
) -> Prediction:
    """The prediction of a setting that was not fitted, with the offset of the log itself."""
    measured, simulated = trace.force[trace.compared], seen.force[trace.compared]
    if any(one.is_offset for one in fits[0].parameters.quantities):
        simulated = simulated + float(np.mean(measured - simulated))
    lacks = [max(fit.mse_percent - fitted_noise.get(fit.setting, 0.0), 0.0) for fit in fits]
    return Prediction(
        setting=setting,
        trace=trace,
        is_part=False,
        mse_percent=normalised_mse(measured, simulated),
        noise_floor_percent=noise_floor(trace),
        fitted_mse_percent=float(np.mean([fit.mse_percent for fit in fits])),
        expected_mse_percent=_expected(
            float(np.mean(lacks)), _noise(trace, measured - simulated, 0.0)
        ),
        is_unseen=True,
    )


def _noise(trace: Trace, rest: FloatArray, elsewhere: float) -> float:
    """What scatter between the cycles of a residual costs, in per cent of the force's variance.

    A single cycle, or what does not repeat, has as much as there is `elsewhere`, N^2.
    """
    scatter = sum(
        stretch.n_samples
        * (residual_scatter(rest[place], stretch) if stretch.n_cycles > 1 else elsewhere)
        for stretch, place in zip(trace.stretches, trace.places, strict=True)
    )
    variance = float(np.var(trace.force[trace.compared]))
    return _known(100.0 * scatter / trace.n_samples / variance)


def _prediction(fit: Fit, trace: Trace, seen: SimulatedLog, fitted_noise: float) -> Prediction:
    measured, simulated = trace.force[trace.compared], seen.force[trace.compared]
    fitted = np.concatenate([log.trace.force[log.trace.compared] for log in fit.logs])
    elsewhere = 0.01 * fitted_noise * float(np.var(fitted))
    noise = _noise(trace, measured - simulated, elsewhere)
    is_part = any(log.trace.name == trace.name for log in fit.logs)
    is_same_motion = _is_same_motion(fit, trace)
    is_same_speed = _is_same_motion(fit, trace, has_same_stroke=False)
    offset = 0.0
    if not is_part and not is_same_motion and _is_offset_found(fit):
        offset = float(np.mean(measured - simulated))
        simulated = simulated + offset
    share = 1.0
    if is_part and not trace.n_cycles:
        noise = max(noise, _enough(trace, float(np.std(fitted))))
        tested = _tested(trace)
        spread = (measured - np.mean(measured)) ** 2
        share = float(np.sum(spread[tested]) / max(float(np.sum(spread)), 1e-300))
        if share >= _LEAST_TESTED:
            measured, simulated = measured[tested], simulated[tested]
    lack = max(fit.mse_percent - fitted_noise, 0.0)
    return Prediction(
        setting=fit.setting,
        trace=trace,
        is_part=is_part,
        mse_percent=normalised_mse(measured, simulated),
        noise_floor_percent=noise_floor(trace),
        fitted_mse_percent=fit.mse_percent,
        expected_mse_percent=lack + noise if is_same_motion else _expected(lack, noise),
        is_same_motion=is_same_motion,
        is_same_speed=is_same_speed,
        own_offset=offset,
        tested_share=share,
    )


def _expected(lack: float, noise: float) -> float:
    """Return the MSE that a model which carries over has, %; none below what matters is asked."""
    return max(lack + noise, PREDICTED_PERCENT)


def _is_offset_found(fit: Fit) -> bool:
    """Whether the fit has found the offset of its own logs, which is no number of the damper."""
    return any(
        one.is_offset and fit.status[one.name] in {Status.FITTED, Status.SHARED}
        for one in fit.parameters.quantities
    )


def _enough(trace: Trace, deviation: float) -> float:
    """Return the MSE below which no law is asked to explain more of what moves beside cycles, %.

    `deviation` is that of the fitted forces, N.
    """
    own = float(np.std(trace.force[trace.compared]))
    return 100.0 * (_SMALL * deviation / own) ** 2


def _tested(trace: Trace) -> NDArray[np.bool_]:
    """Return the compared samples whose speed is beyond its noise, which turns friction there."""
    found = (one.value for one in trace.findings if one.name == "displacement_noise")
    displacement = 1e-6 * (next(found, None) or 0.0)
    corner = min(trace.drive.corner, 0.5 / trace.interval)
    passed = math.sqrt(2.0 * corner * trace.interval) * 2.0 * math.pi * corner / math.sqrt(3.0)
    speed = np.abs(trace.drive.velocity[trace.compared])
    return np.asarray(speed > _OF_CHANCE * passed * displacement)


def _is_same_motion(fit: Fit, trace: Trace, *, has_same_stroke: bool = True) -> bool:
    """Whether every stretch of a log has the speed of one that was fitted, and its stroke.

    Motion that does not repeat has neither: another road is another test.
    """
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


def _known(percent: float) -> float:
    """Nothing is known of the scatter of a single cycle: then all of the misfit is lack of fit."""
    return 0.0 if math.isnan(percent) else percent
