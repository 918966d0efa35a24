"""A force late against the displacement: estimated from friction, corrected when asked."""

from dataclasses import replace

import numpy as np
import pytest

from damperfit.conditioning import ConditionOptions, condition
from damperfit.damper.purdy.parameters import PURDY_DAMPER, reference_parameters
from damperfit.identification import FitOptions, identify
from damperfit.recording import Recording
from damperfit.simulation import Motion, simulate, sine_motion
from tests.conditioning.logs import changed, found, moving, sine
from tests.identification.rig import recorded

FIT = FitOptions("plain", ("r_m1", "r_m2", "k_e"), {"r_m3": 2.597e6, "f_f": 50.0})


def late_log(setting, delay, *, rate=500.0, f_f=50.0, noise=4.0):
    """The standard test with the force ``delay`` seconds late."""
    random = np.random.default_rng(setting)
    n, lead, omega = round(8.0 * rate), round(rate * 4.0 / 3.0), 3.0 * np.pi
    angle = omega * np.arange(n + lead) / rate + random.uniform(0.0, 6.28)
    x, v = 0.032 * np.sin(angle - omega * delay), 0.032 * omega * np.cos(angle - omega * delay)
    truth = replace(reference_parameters(setting), f_f=f_f)
    force = simulate(truth, PURDY_DAMPER, Motion(1.0 / rate, x, v)).force[lead:]
    x = 0.032 * np.sin(angle[lead:])
    noises = (2e-6 * noise, noise)
    return recorded(x, force, rate, setting=setting, noises=noises, seed=random)


def skew_of(log, **options):
    return found(log, ConditionOptions(**options))["skew"]


@pytest.mark.parametrize("delay", [-0.001, 0.0, 0.002, 0.005])
@pytest.mark.parametrize("setting", [1, 10, 20])
def test_the_estimate_is_within_its_half_millisecond(setting, delay) -> None:
    finding = skew_of(late_log(setting, delay))
    assert finding.values["value"] == pytest.approx(delay, abs=6e-4)
    # At 500 Hz and 1.5 Hz the samples of all cycles lie 0.67 ms apart: 1 ms is not always sure.
    if abs(delay) != 0.001:
        assert finding.severity == ("warning" if delay else "note")


@pytest.mark.parametrize("setting", [1, 10, 20])
def test_taken_back_by_estimate_k_e_is_near_the_truth_again(setting) -> None:
    log, truth = late_log(setting, 0.002), reference_parameters(setting).k_e
    errors = {}
    for skew in (0.0, "auto", 0.002):
        trace = condition(log, ConditionOptions(skew=skew))
        fit = identify([trace], PURDY_DAMPER, FIT).fits[0]
        errors[skew] = abs(fit.parameters.k_e / truth - 1.0)
    assert errors[0.0] > 0.1  # 15 to 50 %
    assert errors["auto"] < 0.04  # as the manual says
    assert errors[0.002] < 0.02


@pytest.mark.parametrize("delay", [-0.002, 0.0, 0.002, 0.006])
@pytest.mark.parametrize("setting", [1, 20])
def test_a_sample_right_on_the_jump_is_no_rounding(setting, delay) -> None:
    # 500 Hz, 1.5 Hz, from mid-stroke: the friction's jump of every third cycle falls on a sample.
    motion = sine_motion(0.032, 1.5, cycles=12, sample_rate=500.0)
    force = simulate(reference_parameters(setting), PURDY_DAMPER, motion).force
    late = np.roll(force, round(delay * 500.0))
    noise = 2.0 * np.random.default_rng(1).standard_normal(len(late))
    time = np.arange(len(late)) / 500.0
    log = Recording("log.csv", "", "", setting, time, motion.displacement, late + noise)
    finding = skew_of(log)
    assert finding.values["value"] == pytest.approx(delay, abs=1e-4)
    assert finding.severity == ("warning" if delay else "note")


@pytest.mark.parametrize(("noise", "frequency", "seed"), [(2e-5, 0.5, 1), (1e-5, 0.2, 9)])
def test_noise_of_the_ends_of_the_stroke_is_in_the_uncertainty(noise, frequency, seed) -> None:
    random = np.random.default_rng(seed)
    log = moving(sine(frequency, 0.02, 8))
    for channel, size in (("displacement", noise), ("force", 2.0)):
        log = changed(log, channel, lambda y, s=size: y + s * random.standard_normal(len(y)))
    assert skew_of(log).severity == "note"


@pytest.mark.parametrize("delay", [0.0, 0.003])
def test_oil_that_reverses_with_a_triangle_is_not_late(delay) -> None:
    n, rate, random = 2133, 1000.0, np.random.default_rng(0)
    x = 0.04 / np.pi * np.arcsin(np.sin(2.0 * np.pi * 3.75 * np.arange(n) / rate))
    motion = Motion(1.0 / rate, x, np.gradient(x, 1.0 / rate))
    force = np.roll(
        simulate(reference_parameters(10), PURDY_DAMPER, motion).force, round(1e3 * delay)
    )
    log = recorded(x, force, rate, setting=10, noises=(3e-6, 2.0), seed=random)
    assert skew_of(log).severity == ("warning" if delay else "note")


def _soft_seals(log, sliding):
    """Friction that turns over ``sliding`` metres, without noise in its motion."""
    t = np.arange(len(log.time) * 20) / (20.0 * 500.0)
    waves = np.stack([np.sin(3 * np.pi * log.time), np.cos(3 * np.pi * log.time)], axis=-1)
    a, b = np.linalg.lstsq(waves, log.displacement, rcond=None)[0]
    x = a * np.sin(3 * np.pi * t) + b * np.cos(3 * np.pi * t)
    friction, now = np.zeros_like(x), 0.0
    for i, step in enumerate(np.diff(x), start=1):
        goal = 50.0 * np.sign(step)
        now = goal + (now - goal) * np.exp(-abs(step) / sliding)
        friction[i] = now
    return replace(log, force=log.force + friction[::20])


NOT_TOLD = {
    "no friction": (lambda: late_log(5, 0.002, f_f=0.01), {}, "no friction stands out"),
    "soft seals": (lambda: _soft_seals(late_log(5, 0.0, f_f=0.01), 2e-5), {}, "rounded by"),
    "very soft seals": (lambda: _soft_seals(late_log(10, 0.0, f_f=0.01), 2e-4), {}, ""),
    "not late": (lambda: late_log(5, 0.0), {}, None),
    "rig filter": (
        lambda: late_log(5, 0.002),
        {"rig_filter": "zero_phase"},
        "the rig's filter rounds",
    ),
}


@pytest.mark.parametrize("case", NOT_TOLD)
def test_where_it_cannot_be_told_it_says_so_and_changes_nothing(case) -> None:
    make, options, words = NOT_TOLD[case]
    log = make()
    finding, asked = skew_of(log, **options), skew_of(log, skew="auto", **options)
    assert finding.severity == "note"
    if words is not None:
        assert finding.values.get("value") is None
        assert words in str(finding)
        assert asked.severity == "warning"
        assert "nothing was corrected" in str(asked)
    plain = condition(log, ConditionOptions(**options))
    auto = condition(log, ConditionOptions(skew="auto", **options))
    assert np.array_equal(plain.force, auto.force)


def test_a_crank_that_goes_through_its_play_is_late_by_nothing() -> None:
    """Friction turns where the play begins, 10 ms before the middle of the rest."""
    rate, crank = 800.0, 4.0 * np.pi * np.arange(16000) / 800.0
    end = np.cos(np.radians(7.0))
    x = 0.02 * np.clip(np.sin(crank), -end, end)
    v = np.where(np.abs(np.sin(crank)) > end, 0.0, 0.08 * np.pi * np.cos(crank))
    force = simulate(reference_parameters(5), PURDY_DAMPER, Motion(1.0 / rate, x, v)).force
    noise = np.random.default_rng(5).standard_normal((2, len(x)))
    log = replace(
        late_log(5, 0.0),
        time=np.arange(len(x)) / rate,
        displacement=x + 2e-6 * noise[0],
        force=force + 4.0 * noise[1],
    )
    assert "rests at the ends" in str(skew_of(log))
