"""Profiles: least at the fit, parabolas where the logs tell a parameter, open where they do not."""

import math
from dataclasses import replace

import pytest

from damperfit.damper.purdy.parameters import PURDY_DAMPER, reference_parameters
from damperfit.identification import FitOptions, Outcome, identify
from damperfit.identification.fit_problem import Block
from damperfit.identification.fit_setting import minimised
from damperfit.simulation import SolverOptions
from damperfit.tested.setting import Setting
from damperfit.uncertainty import Bench, assess, objections, profile_campaign, reconsider
from tests.identification.rig import short_trace, short_traces

FREE = ("r_m1", "r_m2", "k_e")
KNOWN = {"r_m3": 2.597e6, "f_f": 50.0}


def profiled(logs, *names, options=FitOptions()):
    campaign = identify(logs, PURDY_DAMPER, options)
    judged = assess(campaign, PURDY_DAMPER)
    return campaign, profile_campaign(campaign, judged, Bench(PURDY_DAMPER), names=names)


def sandwich(judged, profile):
    interval = judged.uncertainty(profile.setting).intervals[profile.name]
    return interval.low, interval.high


def test_of_a_parameter_well_told_it_is_the_parabola_of_the_printed_interval() -> None:
    campaign, judged = profiled(short_traces([1, 10], noise=4.0), "r_m1", "k_e", "r_m3")
    assert [(p.name, p.setting, p.is_shared) for p in judged.profiles] == [
        ("r_m1", 1, False), ("r_m1", 10, False), ("k_e", 1, False), ("k_e", 10, False),
        ("r_m3", 1, True),
    ]  # fmt: skip
    # What is well told costs nothing more.
    bare = assess(campaign, PURDY_DAMPER)
    assert bare.profiles == ()
    assert reconsider(campaign, bare).fits[0].status == campaign.fits[0].status
    fits = {fit.setting: fit.parameters for fit in campaign.fits}
    for profile in judged.profiles:
        assert profile.shape == "closed"
        best = min(profile.points, key=lambda point: point.rise)
        assert best.rise == 0.0
        assert best.value == pytest.approx(getattr(fits[profile.setting], profile.name), rel=1e-5)
        low, high = sandwich(judged, profile)
        assert judged.limits(profile.setting, profile.name) == (low, high)
        reach = math.log(high / low) / 2.0
        ends = math.log(best.value / profile.low), math.log(profile.high / best.value)
        assert ends == pytest.approx((reach, reach), rel=0.02)
        # Out to three standard errors, on both sides, in steps of about half of one.
        assert profile.points[0].rise > 9.0 < profile.points[-1].rise
        for point in profile.points:
            along = 1.959964 * math.log(point.value / best.value) / reach
            assert point.rise == pytest.approx(along**2, rel=0.05, abs=0.01)


def test_a_point_is_the_minimum_that_a_descent_finds_with_the_parameter_held() -> None:
    log = short_trace(6, noise=60.0, duration=5.0)
    campaign, judged = profiled([log], "k_e", options=FitOptions("plain", FREE, KNOWN))
    everything = Block(PURDY_DAMPER, (log,), FREE, SolverOptions(tolerance=1e-2))
    (fit,), points = campaign.fits, judged.profiles[-1].points
    least = minimised(everything, fit.parameters).mse_percent
    rises, found = [], []
    for point in points[:: len(points) - 1]:
        start = replace(fit.parameters, k_e=point.value)
        held = minimised(replace(everything, free=("r_m1", "r_m2")), start)
        found.append(held.mse_percent - least)
        rises.append(point.rise)
        assert point.parameters.r_m1 == pytest.approx(held.values.r_m1, rel=2e-4)
        assert point.parameters.r_m2 == pytest.approx(held.values.r_m2, rel=2e-3)
    # The scale is that of the intervals: several times less than white noise would make of it.
    assert rises[0] / rises[1] == pytest.approx(found[0] / found[1], rel=0.01)
    assert rises[0] < 0.3 * fit.n_samples / least * found[0]


def test_a_joint_fit_is_profiled_over_all_settings_at_once() -> None:
    logs = short_traces([2, 14], noise=4.0, duration=5.0)
    campaign, judged = profiled(logs, "f_f", options=FitOptions("joint"))
    first, second = judged.profiles
    assert (first.setting, second.setting) == (2, 14)
    assert (first.low, first.high) == (second.low, second.high)
    assert [p.rise for p in first.points] == [p.rise for p in second.points]
    one, other = first.points[0].parameters, second.points[0].parameters
    assert one.r_m1 != other.r_m1
    assert one.r_m3 == other.r_m3 != campaign.fits[0].parameters.r_m3
    low, high = sandwich(judged, first)
    assert (first.low, first.high) == pytest.approx((low, high), rel=0.02 * (high / low - 1.0))


def test_a_short_slow_stroke_leaves_the_bulk_modulus_flat_upward() -> None:
    # 2 mm at 1.5 Hz: the oil gives way by less than the noise, so that it may as well be rigid.
    log = short_trace(10, noise=4.0, amplitude=0.002)
    campaign = identify([log], PURDY_DAMPER, FitOptions("plain", FREE, KNOWN))
    judged = assess(campaign, PURDY_DAMPER)
    profile = judged.telling(10)["k_e"]
    assert profile.shape == "flat upward"
    assert 1e8 < profile.low < reference_parameters(10).k_e
    again = reconsider(campaign, judged)
    assert again.fits[0].status["k_e"] == "not_identifiable"
    assert again.fits[0].outcome is Outcome.NOT_IDENTIFIABLE
    said = judged.verdicts(again)[10]["k_e"]
    assert said.startswith(f"not identifiable upward: at least {1e-6 * profile.low:.4g} MPa (95 %)")


def test_no_friction_has_an_upper_limit() -> None:
    truth = replace(reference_parameters(4), f_f=1e-6)
    campaign = identify([short_trace(4, truth, noise=4.0)], PURDY_DAMPER, FitOptions("plain"))
    judged = assess(campaign, PURDY_DAMPER)
    assert campaign.fits[0].status["f_f"] == "at_bound"
    low, high = judged.limits(4, "f_f")
    assert low is None
    assert 0.01 < high < 2.0
    assert "only an upper limit" in judged.verdicts(campaign)[4]["f_f"]
    again = reconsider(campaign, judged)
    assert again.fits[0].status["f_f"] == "not_identifiable"
    assert again.fits[0].outcome is Outcome.NOT_IDENTIFIABLE
    assert judged.verdicts(again)[4]["f_f"] == (
        "these logs cannot distinguish it from none (only an upper limit: 95 % "
        f"below {high:.4g} N): the model may as well lack this part"
    )
    assert "bound" not in {one.kind for one in objections(again, judged).get(Setting.of(4), ())}
