"""Measured forces beside the model's, and errors for a wrong model, apart from those of noise."""

import math
from dataclasses import replace

import numpy as np
import pytest

from damperfit.adjustment.clicks import compare_settings
from damperfit.adjustment.force_at import Force, force_at, stage_of
from damperfit.conditioning import condition
from damperfit.damper.mounting import FIT, Mounting
from damperfit.damper.purdy.parameters import PURDY_DAMPER, reference_parameters
from damperfit.damper.quasi_static import quasi_static
from damperfit.identification import FitOptions, identify
from damperfit.identification.options import GivenStart
from damperfit.passed_speeds import in_both_strokes
from damperfit.recording import Recording
from damperfit.simulation import simulate, sine_motion
from damperfit.tested.setting import Setting
from damperfit.uncertainty import assess
from damperfit.uncertainty.speed_forces import MeasuredForce
from tests.identification.rig import TIGHT, recorded, recording
from tests.laws.valve_logs import VALUES, damper, moved
from tests.uncertainty.flaws import speed

PLAIN = FitOptions("plain", ("r_m1", "r_m2", "k_e"), {"r_m3": 2.597e6, "f_f": 50.0})


def bent(log: Recording) -> Recording:
    """The same with a knee at 0.1 m/s that no valve of the model has."""
    v = speed(log)
    knee = 120.0 * np.clip(np.abs(v) - 0.1, 0.0, 0.05) / 0.05 * np.sign(v)
    return replace(log, force=log.force + knee)


@pytest.fixture(scope="module")
def both():
    """A sound log and one with a knee that the model has not, fitted, judged, levelled."""
    sound = recording(10, noise=4.0, duration=6.0)
    found = []
    for log in (sound, bent(sound)):
        campaign = identify([condition(log)], PURDY_DAMPER, PLAIN)
        known = assess(campaign, PURDY_DAMPER)
        found.append((condition(log), known, compare_settings(campaign, known, PURDY_DAMPER)))
    return found


@pytest.mark.parametrize("free", [(), ("f_0",)])
def test_what_a_misfit_bends_is_in_a_force_as_far_as_the_rig_takes_it_up(free) -> None:
    log = condition(bent(recording(10, noise=4.0, duration=6.0)))
    options = replace(PLAIN, free=(*PLAIN.free, *free))
    campaign = identify([log], PURDY_DAMPER, options)
    known = assess(campaign, PURDY_DAMPER)
    (errors,) = known.uncertainties
    for force, sign in zip(known.forces, (1.0, -1.0), strict=True):
        values = campaign.fits[0].parameters
        curve = quasi_static(PURDY_DAMPER, values, [0.2 * sign], sensitivities=errors.names)
        bends = float(curve.slopes[:, 0] @ errors.misfit @ curve.slopes[:, 0]) ** 0.5
        # The log holds the force there, whatever its valves are; a tare it does not.
        if free:
            tare = errors.intervals["f_0"].misfit
            assert force.taken_up_near(0.2) == pytest.approx(tare, rel=0.02)
        else:
            assert force.taken_up_near(0.2) < 0.15 * bends


def test_a_model_that_misses_gives_the_measured_force(both) -> None:
    _, known, found = both[1]
    assert known.diagnoses[0].is_structured
    missed = [one for one in found.forces if one.disagrees]
    assert missed
    for one in found.forces:
        assert one.is_measured is any(
            (x.speed, x.stroke) == (one.speed, one.stroke) for x in missed
        )
        if one.is_measured:
            assert (one.force, one.error) == (one.measured.force, one.measured.error)
            assert one.model_force != one.force
        else:
            assert one.misfit > 0.0
    for interval in known.uncertainties[0].intervals.values():
        assert interval.misfit > interval.error > 0.0
        assert interval.high > interval.low


@pytest.mark.parametrize(("amplitude", "names"), [(0.028, PLAIN.free), (0.022, ("r_m1",))])
def test_intervals_for_a_wrong_model_hold_what_another_stroke_finds(both, amplitude, names) -> None:
    """Noise alone would have it that the strokes are two dampers."""
    log = bent(recording(10, noise=4.0, duration=6.0, amplitude=amplitude))
    campaign = identify([condition(log)], PURDY_DAMPER, PLAIN)
    other = assess(campaign, PURDY_DAMPER).uncertainties[0].intervals
    one = both[1][1].uncertainties[0].intervals
    for name in names:
        a, b = one[name], other[name]
        at = [math.sqrt(x.low * x.high) for x in (a, b)]
        apart = abs(math.log(at[1] / at[0]))
        noise = math.hypot(a.error / at[0], b.error / at[1])
        assert 1.2 * noise < apart < 1.96 * math.hypot(noise, a.misfit / at[0], b.misfit / at[1])


def logged(model, values, motion, *, noise=0.0, stroke_noise=0.0):
    force = simulate(values, model, motion).force
    return condition(
        recorded(
            motion.displacement, force, 1.0 / motion.interval, setting=Setting.of(1),
            noises=(stroke_noise, noise),
        )
    )  # fmt: skip


def fitted(trace, model, values, free):
    fixed = {name: getattr(values, name) for name in values.names if name not in free}
    start = GivenStart({name: getattr(values, name) for name in free})
    options = FitOptions("plain", free=free, fixed=fixed, start=start)
    campaign = identify([trace], model, options)
    return campaign.fits[0], assess(campaign, model)


@pytest.mark.parametrize(
    ("setting", "amplitude", "frequency", "tare"),
    # The first is the one that was met: 69.2 N behind the filter for 61.9 N.
    [(18, 0.03, 1.6, -4.1), (10, 0.032, 1.5, 0.0), (1, 0.025, 2.0, 0.0), (19, 0.02, 2.5, 0.0)],
)
def test_the_filter_of_a_loop_is_put_back_where_friction_jumps(
    setting, amplitude, frequency, tare
) -> None:
    """Noise-free, 60 N of friction: 68.9 +- 0.7 N was shown for 61.9 N at 0.05 m/s."""
    truth = reference_parameters(setting).replace(f_f=60.0, f_0=tare)
    motion = sine_motion(amplitude, frequency, cycles=8, sample_rate=1000.0)
    _, known = fitted(logged(PURDY_DAMPER, truth, motion), PURDY_DAMPER, truth, PLAIN.free)
    motion = sine_motion(amplitude, frequency, cycles=3, sample_rate=6000.0)
    response = simulate(truth, PURDY_DAMPER, motion, options=TIGHT)
    last = response.time > 2.0 / frequency
    # A quarter of the corner's period after a reversal.
    limit = amplitude * (2.0 * np.pi * frequency) ** 2 / (4.0 * 30.0)
    for one, sign in zip(known.forces, (1.0, -1.0), strict=True):
        assert one.kind == "cvp"
        assert one.at(0.93 * limit) is None
        speeds = [1.03 * limit, 0.05, 0.1, 0.2, 0.23]
        signals = response.velocity[last], response.force[None, last]
        passed = [x[0] for x in in_both_strokes(*signals, speeds, signs=(sign,))]
        for at, expected in zip(speeds, passed[1][:, :, 0].mean(axis=0), strict=True):
            seen = one.at(at)
            assert abs(seen.force - expected) < 1.96 * seen.error + 2e-3 * abs(expected), at
            assert seen.force == pytest.approx(0.5 * (seen.opening + seen.closing), abs=0.1)
            assert 1.96 * seen.error == pytest.approx(0.5 * abs(seen.rounding), abs=0.05)
            if (at, sign, tare) == (0.05, 1.0, -4.1):
                assert (expected, seen.as_read.force) == pytest.approx((61.9, 69.2), abs=0.1)


RIG = {"k_s": 1e6, "lag": 9e-3}  # 1 N/um
SPEEDS = (0.005, 0.01, 0.025, 0.05, 0.13, 0.25)


@pytest.mark.parametrize("bleed", [2.9e4, 7e4])
def test_peaks_of_segments_are_those_of_the_model_and_the_rig(bleed) -> None:
    """`settings` said 42 N where the dyno's own value at 0.05 m/s was 156."""
    model = replace(damper(), mounting=Mounting(FIT, "none", FIT))
    numbers = {name: value for name, value in VALUES.items() if name != "play"} | RIG
    truth = model.values(numbers, rebound_bleed=bleed, compression_bleed=bleed)
    motion = moved(SPEEDS, cycles=5, rate=250.0)
    trace = logged(model, truth, motion, noise=1.0, stroke_noise=2e-6)
    free = ("rebound_bleed", "rebound_opening", "compression_bleed", "compression_opening", "f_f")
    fit, known = fitted(trace, model, truth, free)
    own = [quasi_static(model, truth, [v, -v]).forces for v in SPEEDS]
    for place, one in enumerate(known.forces):
        assert one.kind == "pvp"
        assert one.speeds == pytest.approx(SPEEDS, rel=0.02)
        for k, at in enumerate(SPEEDS):
            seen = one.at(at)
            assert abs(seen.difference) < 0.02 * abs(seen.force)  # model and rig at the same peaks
            damping = own[k][place] - model.rest_force(0.0)
            # The lag is in the measured force: 2 % at 0.25 m/s, a sine of 2 Hz.
            assert abs(seen.force - truth.f_0 - own[k][place]) < 0.04 * abs(damping) + 1.0
    shown = force_at([stage_of(fit, known)], model, (0.05, 0.1, 0.13), measured=known.forces)
    for one in shown:
        assert one.measured_force == pytest.approx(one.measured.force - one.tare)
        assert (
            abs(one.measured_force - one.force)
            < 0.04 * abs(one.damping) + 1.96 * one.measured_error + 1.0
        )
    # Between segments the bend of the model's own curve is in the interval.
    apart = {one.speed: one.measured_error for one in shown if one.stroke == "rebound"}
    if bleed < 7e4:
        assert apart[0.1] > 5.0 * apart[0.13]
        # Of few cycles no scatter is known, and the bend all the same.
        few = [replace(one, measured_se=(math.nan,) * len(one.speeds)) for one in known.forces]
        blind = force_at([stage_of(fit, known)], model, (0.1,), measured=few)[0]
        assert blind.measured_error == pytest.approx(apart[0.1], rel=0.1)


@pytest.mark.parametrize(
    ("difference", "measured", "error", "disagrees"),
    [
        (20.1, 1000.0, 0.0, True), (19.9, 1000.0, 0.0, False),  # 2 %
        (7.6, 3.0, 0.0, True), (7.4, 3.0, 0.0, False),  # half a per cent of half the range
        (23.1, 1000.0, 1.0, True), (22.9, 1000.0, 1.0, False),  # and three standard errors
    ],
)  # fmt: skip
def test_by_how_much_a_model_may_miss_the_measured_force(
    difference, measured, error, disagrees
) -> None:
    seen = MeasuredForce(
        measured, error, error, 0.0, difference, math.nan, math.nan, measured, "pvp", (0.1, 0.1)
    )
    plain = Force(Setting.of(1), 0.1, "rebound", 900.0, 1.0, 1.0, np.zeros(0))
    assert replace(plain, measured=seen, half_range=1500.0).disagrees is disagrees
    # What the damper may bend between measured speeds is no part of the difference, taken at them.
    bent = replace(seen, error=error + 100.0)
    assert replace(plain, measured=bent, half_range=1500.0).disagrees is disagrees
