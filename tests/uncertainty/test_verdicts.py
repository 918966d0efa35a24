"""What is said of parameters, from known errors, profiles and statuses."""

import math
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from damperfit.conditioning import condition
from damperfit.damper.mounting import Mounting
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.temperature_law import WithTemperature
from damperfit.identification import FitOptions, Outcome, Sharing, identify
from damperfit.identification.options import GivenStart
from damperfit.identification.outcome import Status
from damperfit.recording import Recording
from damperfit.run.record import unlike_frictions
from damperfit.simulation import simulate
from damperfit.tested.setting import Setting
from damperfit.uncertainty import Assessment, Interval, Uncertainty, assess, reconsider
from damperfit.uncertainty.assessment import with_least_openings
from damperfit.uncertainty.covariance import make_interval
from damperfit.uncertainty.profiles import MisfitProfile, ProfilePoint
from tests import fakes
from tests.laws.valve_logs import VALUES, damper, moved


def profile(low, high, *, name="r_m3", setting=1, better=0.0, **more) -> MisfitProfile:
    at = fakes.fit(setting).parameters
    rises = (4.0, better, 5.0)
    points = tuple(ProfilePoint(float(k), rise, at) for k, rise in enumerate(rises, 1))
    return MisfitProfile(setting, name, points, low, high, True, 17, **more)


def known(setting=1, *, error=0.01, names=("r_m1", "r_m2", "k_e", "r_m3"), tie=0.0) -> Uncertainty:
    at = fakes.fit(setting).parameters
    covariance = error**2 * np.eye(len(names))
    if tie:
        covariance[0, 1] = covariance[1, 0] = tie * error**2
    intervals = {name: make_interval(getattr(at, name), error) for name in names}
    return Uncertainty(setting, intervals, names, covariance, ("r_m3",))


NOTHING = Sharing()


def reconsidered(fit, *profiles, errors=(), sharing=NOTHING):
    judged = Assessment(uncertainties=tuple(errors), profiles=profiles)
    (found,) = reconsider(replace(fakes.campaign(fit), sharing=sharing), judged).fits
    changed = {name for name in fit.status if found.status[name] != fit.status[name]}
    return found, changed


def test_an_offset_has_a_straight_interval_and_all_others_one_of_factors() -> None:
    offset = make_interval(-3.0, 0.5, is_logarithmic=False)
    assert (offset.low, offset.high, offset.error) == pytest.approx((-3.98, -2.02, 0.5), abs=1e-4)
    one, factor = make_interval(2.0, 0.5), math.exp(0.5 * 1.959964)
    assert (one.low, one.high, one.error) == pytest.approx((2.0 / factor, 2.0 * factor, 1.0))


@pytest.mark.parametrize(
    ("shape", "before", "after", "outcome"),
    [
        ((None, 3.0), "fitted", "not_identifiable", "NOT_IDENTIFIABLE"),
        ((1.0, None), "fitted", "not_identifiable", "NOT_IDENTIFIABLE"),
        ((None, None), "shared", "not_identifiable", "CONVERGED"),
        ((1.0, 3.0), "fitted", "fitted", "CONVERGED"),
        ((None, 3.0), "at_bound", "at_bound", "CONVERGED"),
        ((None, 3.0), "fixed", "fixed", "CONVERGED"),
    ],
)
def test_a_profile_without_a_limit_has_the_last_word(shape, before, after, outcome) -> None:
    fit = fakes.fit(1, status={"r_m3": before})
    found, _ = reconsidered(fit, profile(*shape), errors=[known()])
    assert found.status["r_m3"] == after
    assert found.outcome is Outcome[outcome]


@pytest.mark.parametrize(
    ("friction", "stiffness", "after", "outcome"),
    [
        ("at_bound", "fitted", "not_identifiable", Outcome.NOT_IDENTIFIABLE),
        ("at_bound", "at_bound", "not_identifiable", Outcome.AT_BOUND),
        ("fixed", "at_bound", "fixed", Outcome.AT_BOUND),
    ],
)
def test_what_ran_to_none_is_no_bound_and_what_strains_is(friction, stiffness, after, outcome):
    fit = fakes.fit(1, status={"f_f": friction, "k_e": stiffness}, outcome=Outcome.AT_BOUND)
    fit = replace(fit, parameters=fit.parameters.replace({"f_f": 1e-3, "k_e": 1e6}))
    found, _ = reconsidered(fit)
    assert (found.status["f_f"], found.status["k_e"]) == (after, stiffness)
    assert found.outcome is outcome


def test_an_error_as_large_as_the_value_unfits_what_is_shared_alone() -> None:
    sharing, errors = Sharing(taken={"r_m3": 1}), [known(error=0.4)]
    assert reconsidered(fakes.fit(1), errors=errors, sharing=sharing)[1] == {"r_m3"}
    held = fakes.fit(1, status={"r_m3": "fixed"})
    assert "r_m3" not in reconsidered(held, errors=errors, sharing=sharing)[1]


@pytest.mark.parametrize(("error", "status"), [(0.3, "shared"), (0.4, "not_identifiable")])
def test_what_all_settings_share_is_three_errors_from_nothing(error, status) -> None:
    errors = [Uncertainty(1, {}, ("f_f",), np.array([[error**2]]), ("f_f",))]
    fit = fakes.fit(1)
    found, _ = reconsidered(fit, errors=errors, sharing=Sharing(means={"f_f": (1,)}))
    assert found.status["f_f"] == status
    assert found.outcome is fit.outcome  # the setting's own fit is as it was


def test_of_profiles_elsewhere_only_that_of_the_shared_r_m3_speaks_for_a_setting() -> None:
    shared = profile(1.0, 3.0, is_shared=True)
    other = profile(1.0, 3.0, name="k_e")
    friction = profile(1.0, 3.0, name="f_f", is_shared=True)
    assert Assessment(profiles=(shared, other, friction)).telling(2) == {"r_m3": shared}
    assert Assessment(profiles=(profile(1.0, 3.0),)).telling(2) == {}
    assert Assessment(profiles=(shared, other)).telling(1) == {"r_m3": shared, "k_e": other}
    assert Assessment(profiles=(replace(other, is_partial=True),)).telling(1) == {}


@pytest.mark.parametrize(("misfit", "is_told"), [(0.49, True), (0.51, False)])
@pytest.mark.parametrize("name", ["r_m3", "k_e"])
def test_an_interval_with_the_misfit_as_wide_as_that_of_no_value_is_told(misfit, is_told, name):
    fit, seen = fakes.fit(1), known()
    wide = make_interval(getattr(fit.parameters, name), 0.1, misfit=math.sqrt(misfit**2 - 0.01))
    seen = replace(seen, intervals={**seen.intervals, name: wide})
    found, changed = reconsidered(fit, errors=[seen])
    assert changed == (set() if is_told else {name})
    is_lost = not is_told and name == "k_e"
    assert found.outcome is (Outcome.NOT_IDENTIFIABLE if is_lost else Outcome.CONVERGED)
    offset = replace(seen, intervals={"f_0": Interval(1.0, -9.0, 9.0)})
    assert reconsidered(fit, errors=[offset])[1] == set()


@pytest.mark.parametrize(
    ("found", "is_said"),
    [
        (((20.0, 1.0, 0.0), (41.0, 1.0, 0.0)), True),
        (((20.0, 1.0, 0.0), (39.0, 1.0, 0.0)), False),  # less than twice as much
        (((20.0, 4.0, 3.0), (42.0, 3.0, 4.0)), True),  # 22 N, 3.1 errors of 7.07
        (((20.0, 4.0, 3.0), (41.0, 3.0, 4.0)), False),  # 2.97
        (((20.0, 1.0, 0.0),), False),
        ((), False),
    ],
)
def test_a_friction_that_follows_the_clicks_is_none(found, is_said) -> None:
    """Settings with these frictions, each with errors of noise and misfit."""
    for status in ("fitted", "shared", "not_identifiable"):
        fits, errors = [], []
        for n, (value, error, misfit) in enumerate(found, start=1):
            fit = fakes.fit(n, status={"f_f": status})
            fits.append(replace(fit, parameters=fit.parameters.replace({"f_f": value})))
            interval = Interval(error, value - error, value + error, misfit)
            errors.append(Uncertainty(n, {"f_f": interval}, ("f_f",), np.eye(1)))
        judged = Assessment(uncertainties=tuple(errors))
        said = list(unlike_frictions(fakes.campaign(*fits), judged))
        assert bool(said) is (is_said and status == "fitted")


def verdicts(fit, known, sharing, *profiles):
    judged = Assessment(uncertainties=(known,), profiles=profiles)
    return judged.verdicts(SimpleNamespace(fits=(fit,), sharing=sharing))[fit.setting]


@pytest.mark.parametrize(
    ("status", "limits", "said"),
    [
        ("fitted", None, "fitted, 95 % from 2.547e+06 to 2.648e+06"),
        ("shared", None, "shared by all settings, 95 % from 2.547e+06"),
        ("fixed", None, "held at the value given"),
        ("at_bound", (1.0, 3.0), "is at a bound of its plausible range: 95 % from 1 to 3"),
        ("fitted", (None, 3.0), "fitted, only an upper limit: 95 % below 3"),
        ("not_identifiable", (5e4, None), "not identifiable upward: at least 5e+04"),
        ("not_identifiable", (None, 5e4), "these logs do not determine it (only an upper limit"),
        ("not_identifiable", None, "these logs do not determine it (95 % from 2.547e+06"),
    ],
)
def test_a_verdict_says_how_a_parameter_was_found_and_its_limits(status, limits, said) -> None:
    fit = fakes.fit(1, status={"r_m3": status})
    profiles = () if limits is None else (profile(*limits),)
    told = verdicts(fit, known(tie=0.98), Sharing(taken={"r_m3": 1}), *profiles)
    assert told["r_m3"].startswith(said)
    assert told["r_m1"].endswith("correlated with r_m2 (+0.98)")


@pytest.mark.parametrize(("rise", "is_better"), [(-0.48, False), (-0.52, True)])
def test_another_minimum_is_better_from_half_a_unit(rise, *, is_better) -> None:
    assert (profile(1.0, 3.0, better=rise).better is not None) is is_better


@pytest.mark.parametrize(("tie", "is_tie"), [(0.9, False), (0.96, True), (-0.96, True)])
def test_a_tie_is_a_correlation_that_triples_an_error(tie, *, is_tie) -> None:
    judged = Assessment(uncertainties=(known(tie=tie),))
    found = judged.doubts(fakes.campaign(fakes.fit(1)))
    assert [one.code for one in found] == ["correlated"] * is_tie
    assert all(f"at setting 1 ({tie:+.2f})" in str(one) for one in found)


# A blow-off that no log opens: its preload is above the pressure on it, and that is said.

MODEL = replace(damper(has_play_and_lag=False), mounting=Mounting())
NAME = "rebound_opening"


def log_of(setting, model, numbers, speeds, *, noise=2.0, **options):
    """A log of a valve damper, and the highest pressure across its piston in rebound."""
    motion = moved(speeds, **options)
    response = simulate(model.values(numbers), model, motion)
    chance, n = np.random.default_rng(setting), len(response.force)
    x = motion.displacement + chance.normal(0.0, 3e-6, n)
    force, time = response.force + chance.normal(0.0, noise, n), motion.interval * np.arange(n)
    trace = condition(Recording(f"{setting}.csv", "", "", Setting.of(setting), time, x, force))
    return trace, float((response.pressures[0] - response.pressures[2]).max())


# From an edge, for where on the way to it a descent ends is chance.
@pytest.mark.parametrize(("opening", "speed", "start"), [(4e6, 0.05, {}), (1e7, 0.13, {NAME: 1e8})])
def test_an_opening_that_no_log_reaches_is_above_the_pressure_on_it(opening, speed, start) -> None:
    truth = {name: VALUES[name] for name in MODEL.names if name in VALUES} | {NAME: opening}
    trace, most = log_of(1, MODEL, truth, (speed,), cycles=4)
    campaign = identify([trace], MODEL, FitOptions("plain", start=GivenStart(start)))
    judged = assess(campaign, MODEL)
    campaign = reconsider(campaign, judged)
    (fit,) = campaign.fits
    assert fit.status[NAME] == Status.NOT_IDENTIFIABLE
    assert judged.uncertainties[0].unopened == {NAME: pytest.approx(most, rel=0.02)}
    said = judged.verdicts(campaign)[fit.setting]
    least = re.search(r"it opens above (\S+) bar, the highest pressure on it in them", said[NAME])
    assert 1e5 * float(least[1]) == pytest.approx(most, rel=0.02)
    if start:
        assert said[NAME].endswith("1000 bar is used: the model may as well lack this part")
    assert "they do not open the blow-off" in said["rebound_slope"]
    assert said["compression_opening"].startswith("fitted, 95 % from")


def linearised(setting, opening, pressed, slope=1e6):
    values = SimpleNamespace(rebound_opening=opening, rebound_slope=slope)
    log = SimpleNamespace(trace=fakes.trace(setting))
    fit = SimpleNamespace(setting=Setting.of(setting), parameters=values, logs=(log,))
    return SimpleNamespace(fit=fit, pressed={NAME: pressed}, names=(NAME, "rebound_slope"))


def unopened(*each, is_shared=True, damper=MODEL):
    settings = tuple(one.fit.setting for one in each)
    sharing = Sharing(jointly=(NAME,) if is_shared else (), settings=settings)
    seen = Uncertainty(settings[0], {}, (), np.eye(1))
    return with_least_openings([seen], each, sharing, damper)[0].unopened


@pytest.mark.parametrize(
    ("is_shared", "opening", "found"),
    [(True, 1e6, {NAME: 9e5}), (False, 1e6, {NAME: 2e5}), (True, 8e5, {}), (False, 1.9e5, {})],
)
@pytest.mark.parametrize("damper", [PURDY_DAMPER, MODEL, WithTemperature(MODEL, 20.0)])
def test_a_setting_that_shares_an_opening_may_press_on_it_more(damper, is_shared, opening, found):
    each = [linearised(1, opening, 2e5), linearised(2, opening, 9e5)]
    assert unopened(*each, is_shared=is_shared, damper=damper) == found


@pytest.mark.parametrize(("share", "is_open"), [(0.0095, False), (0.0105, True)])
def test_a_hundredth_of_a_strokes_oil_is_a_blow_off_that_opens(share, is_open) -> None:
    flow = MODEL.oil_density * MODEL.annulus_area * fakes.trace(1).fastest.peak_speed
    one = linearised(1, 5e5, 9e5, slope=4e5 / (share * flow))
    assert unopened(one) == ({} if is_open else {NAME: 9e5})


def test_a_mounting_that_no_log_shows_give_has_a_lower_limit() -> None:
    """Also where all settings share it: by one profile of all settings."""
    model, true = damper(has_play_and_lag=False), 2e9  # N/m: the oil gives 300 times as much
    numbers = {k: v for k, v in VALUES.items() if k in model.names} | {"k_s": true, "k_e": 1e9}
    logs = []
    for setting, bleed in ((1, 2e4), (2, 3e4), (3, 4e4)):
        own = {"rebound_bleed": bleed, "compression_bleed": 0.9 * bleed}
        motion = {"rate": 500.0, "cycles": 3, "noise": 1.5}
        logs.append(log_of(setting, model, numbers | own, (0.08, 0.24), **motion)[0])
    campaign = identify(logs, model, FitOptions("joint"))
    judged = assess(campaign, model)
    campaign = reconsider(campaign, judged)
    assert [fit.status["k_s"] for fit in campaign.fits] == [Status.NOT_IDENTIFIABLE] * 3
    for fit in campaign.fits:
        low, high = judged.plausible_limits(fit, "k_s")
        assert high is None
        assert 1e6 < low < true
        said = judged.verdicts(campaign)[fit.setting]["k_s"]
        assert said.startswith(f"not identifiable upward: at least {1e-3 * low:.4g} N/mm (95 %)")
    shared = [p for p in judged.profiles if p.is_shared]
    # What is determined is not followed.
    assert {(p.name, p.shape) for p in shared} == {("k_s", "flat upward")}
    assert shared[0].evaluations < 60
