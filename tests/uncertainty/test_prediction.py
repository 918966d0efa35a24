"""What was not fitted tells a right model from one that was bent until it fitted."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from damperfit.conditioning import condition
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.identification import identify
from damperfit.problem import note
from damperfit.uncertainty import (
    Assessment,
    Prediction,
    assess,
    missed_predictions,
    predict,
    prediction_warnings,
    split_cycles,
)
from damperfit.uncertainty.grades import LIMITS, PREDICTED_PERCENT, _prediction, _tested
from tests import fakes
from tests.identification.rig import recording

WRONG_GAS = replace(PURDY_DAMPER, gas_pressure=1.4 * PURDY_DAMPER.gas_pressure)


def log(setting, **options):
    trace = condition(recording(setting, noise=4.0, duration=6.0, **options))
    return replace(trace, name=f"{trace.name} {options}")


def predicted(fitted, held_out):
    campaign = identify(fitted, PURDY_DAMPER)
    return predict(campaign, assess(campaign, PURDY_DAMPER), held_out, damper=PURDY_DAMPER)


@pytest.mark.parametrize("settings", [(1,), pytest.param((1, 20), marks=pytest.mark.slow)])
def test_a_wrong_gas_fits_one_amplitude_and_predicts_no_other(settings) -> None:
    fitted = [log(setting, damper=WRONG_GAS) for setting in settings]
    # Of the forces of setting 20 gas is a small part: at 16 mm they are as good as met (below).
    strokes = {1: 0.016, 20: 0.010}
    others = [log(setting, damper=WRONG_GAS, amplitude=strokes[setting]) for setting in settings]
    found = predicted(fitted, others)
    assert [one.setting for one in found] == [*settings]
    for one in found:
        assert one.fitted_mse_percent < 0.5  # "excellent"
        assert one.mse_percent > 8 * one.fitted_mse_percent
        assert one.is_failed
    assert found[0].mse_percent == pytest.approx(3.0, abs=0.3)  # the manual's figure
    assert found[-1].verdict.startswith("not predicted: ")
    # Cycles of the same test are no judge of that.
    same = [split_cycles(trace, 0.3) for trace in fitted]
    for one in predicted([rest for rest, _ in same], [last for _, last in same]):
        assert one.is_part
        assert not one.is_failed


@pytest.mark.parametrize(("amplitude", "percent"), [(0.016, 0.086), (0.014, 0.149)])
def test_a_wrong_gas_is_told_from_twice_what_matters_on(amplitude, percent) -> None:
    fitted = [log(setting, damper=WRONG_GAS) for setting in (1, 20)]
    (one,) = predicted(fitted, [log(20, damper=WRONG_GAS, amplitude=amplitude)])
    assert one.mse_percent == pytest.approx(percent, abs=0.004)
    assert one.expected_mse_percent == PREDICTED_PERCENT
    assert one.is_failed is (percent > 2.0 * PREDICTED_PERCENT)


@pytest.mark.parametrize(("cycles", "held"), [(1, 1), (3, 3), (0.3, 2), (0.01, 1), (0.5, 3)])
def test_the_last_cycles_are_held_out_and_nothing_is_lost(cycles, held) -> None:
    trace = log(10)
    assert trace.n_cycles == 6
    parts = split_cycles(trace, cycles)
    assert [one.n_cycles for one in parts] == [6 - held, held]
    (whole,), (rest,), (last,) = (one.segments for one in (trace, *parts))
    assert (rest.first, rest.stop, last.stop) == (whole.first, last.first, whole.stop)
    assert rest.cycle_starts[-1] == last.cycle_starts[0] == whole.cycle_starts[6 - held]
    together = np.concatenate([rest.cycle_starts, last.cycle_starts[1:]])
    assert together == pytest.approx(whole.cycle_starts)
    assert rest.stop == pytest.approx(rest.cycle_starts[-1], abs=0.5)


def test_the_stroke_and_speed_that_were_fitted_are_no_test_of_the_model() -> None:
    seen = log(10, seed=1)
    campaign = identify([seen], PURDY_DAMPER)

    def told(stroke, speed, **changes):
        (one,) = seen.segments
        amplitude, peak = stroke * one.amplitude, speed * one.peak_speed
        other = replace(one, amplitude=amplitude, peak_speed=peak, **changes)
        held = replace(seen, name="other", segments=(other,))
        return predict(campaign, Assessment(), [held], damper=PURDY_DAMPER)[0]

    for one, is_same, ends in (
        (told(1.049, 1.0), True, "so no test of the model"),
        (told(1.0, 0.951), True, "so no test of the model"),
        (told(1.0, 0.949), False, "predicted as well as fitted"),
        (told(1.0, 1.0, cycle_starts=np.empty(0)), False, "predicted as well as fitted"),
        (told(1.051, 1.0), False, "so it proves little"),
    ):
        assert one.is_same_motion is is_same
        assert one.verdict.endswith(ends)
    hidden = replace(told(1.0, 1.0), tested_share=0.25)
    assert "no test: 75 % of the force's variance" in hidden.verdict
    drifts = replace(told(1.0, 1.0), mse_percent=100.0)
    assert prediction_warnings([drifts])[0].code == "drifted"
    assert prediction_warnings([replace(drifts, is_same_motion=False)])[0].code == "not-predicted"


@pytest.mark.parametrize(
    ("offset", "said"), [(7.04, "+7 N from the fitted"), (-1.04, "-1 N from the"), (0.94, "")]
)
def test_another_test_has_an_offset_of_its_own_where_offsets_are_found(offset, said) -> None:
    seen = fakes.trace(1, "other.csv")
    (one,) = seen.segments
    held = replace(seen, segments=(replace(one, peak_speed=0.5 * one.peak_speed),))
    model = SimpleNamespace(force=seen.force - offset)
    free = fakes.fit(1, status={"f_0": "fitted"})
    found = _prediction(free, held, model, 0.0)
    assert found.own_offset == pytest.approx(offset)
    assert found.mse_percent == pytest.approx(0.0, abs=1e-9)
    assert ("with its own force offset" in found.verdict) is bool(said)
    assert said in found.verdict
    # A tare that was held is wrong; the same test again has drifted.
    for counted in (
        _prediction(fakes.fit(1), held, model, 0.0),
        _prediction(free, seen, model, 0.0),
    ):
        assert counted.own_offset == 0.0
        assert counted.mse_percent > 0.0


# Limits, from both sides

PLAIN = Prediction(3, fakes.trace(3), False, 0.8, 0.1, 0.02, 0.05)


@pytest.mark.parametrize(
    ("ratio", "verdict"),
    [
        (1.96, "predicted as well as fitted"),
        (2.04, "worse than fitted: 2 times the expected MSE"),
        (9.8, "worse than fitted: 9.8 times the expected MSE"),
        (10.4, "not predicted: 10 times the expected MSE"),
        (108.0, "not predicted: 110 times the expected MSE"),
    ],
)
def test_a_prediction_is_worse_from_twice_and_none_from_ten_times(ratio, verdict) -> None:
    one = Prediction(3, fakes.trace(3), False, 0.2 * ratio, 0.1, 0.15, 0.2)
    assert one.verdict == one.describe()["verdict"] == verdict
    assert one.is_failed is (ratio > 2.0)


@pytest.mark.parametrize(
    ("changes", "is_missed"),
    [
        ({"mse_percent": 0.51, "expected_mse_percent": 0.51 / 4.1}, True),
        ({"mse_percent": 0.51, "expected_mse_percent": 0.51 / 3.9}, False),
        ({"mse_percent": 0.49}, False),
        ({"mse_percent": 120.0}, True),
        ({"is_same_motion": True}, False),  # a repeat, and a setting without a fit: no test
        ({"is_unseen": True}, False),
    ],
)
def test_a_missed_test_stands_against_the_grade(changes, *, is_missed) -> None:
    assert (LIMITS.predicted_percent, LIMITS.predicted_times) == (0.5, 4.0)
    found = missed_predictions([replace(PLAIN, **changes)]).values()
    assert [one.kind for one in found] == ["prediction"] * is_missed


@pytest.mark.parametrize(("times", "is_tested"), [(2.99, False), (3.01, True)])
def test_friction_is_of_chance_within_three_deviations_of_the_velocity(times, is_tested) -> None:
    """Noise of 10 um at 300 Hz behind 30 Hz has 10 sqrt(0.2) 2 pi 30/sqrt(3) um/s."""
    noise = 1e-5 * math.sqrt(0.2) * 2.0 * math.pi * 30.0 / math.sqrt(3.0)
    velocity = np.array([times * noise, -1.0, 1.0, -times * noise])
    trace = SimpleNamespace(
        compared=slice(None), interval=1.0 / 300.0,
        drive=SimpleNamespace(velocity=velocity, corner=30.0),
        findings=(note("displacement_noise", "", value=10.0, unit="um"),),
    )  # fmt: skip
    assert _tested(trace).tolist() == [is_tested, True, True, is_tested]
    assert _tested(SimpleNamespace(**vars(trace) | {"findings": ()})).all()
