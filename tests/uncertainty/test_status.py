"""What is said of parameters, from known errors, profiles and statuses."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from damperfit.identification import Outcome, Sharing
from damperfit.identification.outcome import Status
from damperfit.run.record import unlike_frictions
from damperfit.uncertainty import (
    Assessment,
    Interval,
    Uncertainty,
    reconsider,
)
from damperfit.uncertainty.correlation import cycle_covariance, sums_by_cycle
from damperfit.uncertainty.covariance import make_interval
from damperfit.uncertainty.profiles import MisfitProfile, ProfilePoint
from damperfit.uncertainty.residuals import residual_scatter
from damperfit.uncertainty.verdicts import doubts, verdicts
from tests import fakes


def profile(low, high, *, name="r_m3", setting=1, better=0.0, **more) -> MisfitProfile:
    at = fakes.fit(setting).parameters
    points = (ProfilePoint(1.0, 4.0, at), ProfilePoint(2.0, better, at), ProfilePoint(3.0, 5.0, at))
    return MisfitProfile(setting, name, points, low, high, True, 17, **more)


def known(setting=1, *, error=0.01, names=("r_m1", "r_m2", "k_e", "r_m3"), tie=0.0) -> Uncertainty:
    at = fakes.fit(setting).parameters
    covariance = error**2 * np.eye(len(names))
    if tie:
        covariance[0, 1] = covariance[1, 0] = tie * error**2
    intervals = {name: make_interval(getattr(at, name), error) for name in names}
    return Uncertainty(setting, intervals, names, covariance, ("r_m3",))


@pytest.mark.parametrize(
    ("low", "high", "shape"),
    [
        (1.0, 3.0, "closed"),
        (1.0, None, "flat upward"),
        (None, 3.0, "flat downward"),
        (None, None, "flat both ways"),
    ],
)
def test_a_profile_is_flat_where_it_sets_no_limit(low, high, shape) -> None:
    one = profile(low, high)
    assert one.shape == shape
    assert replace(one, is_complete=False).shape == "not finished"


def test_an_offset_has_a_straight_interval_and_all_others_one_of_factors() -> None:
    offset = make_interval(-3.0, 0.5, is_logarithmic=False)
    assert (offset.low, offset.high) == pytest.approx((-3.98, -2.02), abs=1e-4)
    assert offset.error == 0.5
    resistance = make_interval(2.0, 0.5)
    factor = math.exp(0.5 * 1.959964)
    assert (resistance.low, resistance.high) == pytest.approx((2.0 / factor, 2.0 * factor))
    assert resistance.error == 1.0


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
    judged = Assessment(uncertainties=(known(),), profiles=(profile(*shape),))
    (found,) = reconsider(fakes.campaign(fit), judged).fits
    assert found.status["r_m3"] == after
    assert found.outcome is Outcome[outcome]


@pytest.mark.parametrize(("friction", "stiffness", "after", "outcome"), [
    ("at_bound", "fitted", "not_identifiable", Outcome.NOT_IDENTIFIABLE),
    ("at_bound", "at_bound", "not_identifiable", Outcome.AT_BOUND),
    ("fixed", "at_bound", "fixed", Outcome.AT_BOUND),
])  # fmt: skip
def test_what_ran_to_none_is_no_bound_and_what_strains_is(
    friction, stiffness, after, outcome
) -> None:
    one = fakes.fit(1, status={"f_f": friction, "k_e": stiffness})
    values = one.parameters.replace({"f_f": 1e-3, "k_e": 1e6})
    one = replace(one, outcome=Outcome.AT_BOUND, parameters=values)
    (found,) = reconsider(fakes.campaign(one), Assessment()).fits
    assert (found.status["f_f"], found.status["k_e"]) == (after, stiffness)
    assert found.outcome is outcome


def test_an_error_as_large_as_the_value_unfits_what_is_shared_alone() -> None:
    fit = fakes.fit(1)
    campaign = replace(fakes.campaign(fit), sharing=Sharing(taken={"r_m3": 1}))
    judged = Assessment(uncertainties=(known(error=0.4),))
    (found,) = reconsider(campaign, judged).fits
    changed = {name for name in fit.status if found.status[name] != fit.status[name]}
    assert changed == {"r_m3"}
    held = replace(campaign, fits=(replace(fit, status={**fit.status, "r_m3": "fixed"}),))
    assert reconsider(held, judged).fits[0].status["r_m3"] == "fixed"


def test_of_profiles_elsewhere_only_that_of_the_shared_r_m3_speaks_for_a_setting() -> None:
    shared = profile(1.0, 3.0, setting=1, is_shared=True)
    other = profile(1.0, 3.0, setting=1, name="k_e")
    alone = profile(1.0, 3.0, setting=1, name="r_m3")
    friction = profile(1.0, 3.0, setting=1, name="f_f", is_shared=True)
    assert Assessment(profiles=(shared, other, friction)).telling(2) == {"r_m3": shared}
    assert Assessment(profiles=(alone,)).telling(2) == {}
    assert Assessment(profiles=(shared, other)).telling(1) == {"r_m3": shared, "k_e": other}
    partial = replace(other, is_partial=True)
    assert Assessment(profiles=(partial,)).telling(1) == {}


def test_two_cycles_are_enough_to_scatter_and_one_is_not() -> None:
    rng = np.random.default_rng(2)
    scores = rng.standard_normal((400, 2))
    found = cycle_covariance([sums_by_cycle(scores, np.array([0.0, 200.0, 400.0]))])
    sums = scores.reshape(2, 200, 2).sum(axis=1)
    assert found == pytest.approx(2.0 * np.cov(sums.T))
    one = fakes.trace(1).fastest
    two = replace(one, first=0, stop=666, cycle_starts=np.array([0.0, 333.0, 666.0]))
    residuals = np.repeat([1.0, -1.0], 333)
    assert residual_scatter(residuals, two) == pytest.approx(2.0)
    assert math.isnan(residual_scatter(residuals[:333], one))


@pytest.mark.parametrize(("misfit", "is_told"), [(0.49, True), (0.51, False)])
@pytest.mark.parametrize("is_shared", [True, False])
def test_an_interval_with_the_misfit_as_wide_as_that_of_no_value_is_told(
    misfit, is_told, is_shared
) -> None:
    name = "r_m3" if is_shared else "k_e"
    fit, seen = fakes.fit(1), known()
    wide = make_interval(getattr(fit.parameters, name), 0.1, misfit=math.sqrt(misfit**2 - 0.01))
    judged = Assessment(uncertainties=(replace(seen, intervals={**seen.intervals, name: wide}),))
    (found,) = reconsider(fakes.campaign(fit), judged).fits
    status = fit.status[name] if is_told else Status.NOT_IDENTIFIABLE
    assert found.status == {**fit.status, name: status}
    is_lost = not is_told and not is_shared
    assert found.outcome is (Outcome.NOT_IDENTIFIABLE if is_lost else Outcome.CONVERGED)
    offset = replace(seen, intervals={**seen.intervals, "f_0": Interval(1.0, -9.0, 9.0, math.nan)})
    judged = Assessment(uncertainties=(offset,))
    assert reconsider(fakes.campaign(fit), judged).fits[0].status == fit.status


def frictions(*found, status="fitted") -> list[str]:
    """What is said of settings with these frictions, each with errors of noise and misfit."""
    fits, known = [], []
    for n, (value, error, misfit) in enumerate(found, start=1):
        one = fakes.fit(n, status={"f_f": status})
        fits.append(replace(one, parameters=one.parameters.replace({"f_f": value})))
        interval = Interval(error, value - error, value + error, math.nan, misfit)
        known.append(Uncertainty(n, {"f_f": interval}, ("f_f",), np.eye(1)))
    return list(unlike_frictions(fakes.campaign(*fits), Assessment(uncertainties=tuple(known))))


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
    said = frictions(*found)
    assert bool(said) is is_said
    assert frictions(*found, status="shared") == frictions(*found, status="not_identifiable") == []


@pytest.mark.parametrize(
    ("status", "limits", "said"),
    [
        ("fitted", None, "fitted, 95 % from 2.547e+06 to 2.648e+06"),
        ("shared", None, "shared by all settings, 95 % from 2.547e+06"),
        ("fixed", None, "held at the value given"),
        ("at_bound", (1.0, 3.0), "is at a bound of its plausible range: 95 % from 1 to 3"),
        ("fitted", (None, 3.0), "fitted, flat downward, only an upper limit: 95 % below 3"),
        ("not_identifiable", (5e4, None), "not identifiable upward: at least 5e+04"),
        ("not_identifiable", (None, 5e4), "these logs do not determine it (flat downward"),
        ("not_identifiable", None, "these logs do not determine it (95 % from 2.547e+06"),
    ],
)
def test_a_verdict_says_how_a_parameter_was_found_and_its_limits(status, limits, said) -> None:
    fit = fakes.fit(1, status={"r_m3": status})
    profiles = {} if limits is None else {"r_m3": profile(*limits)}
    judged = known(tie=0.98)
    told = verdicts(fit, judged, Sharing(taken={"r_m3": 1}), profiles)
    assert told["r_m3"].startswith(said)
    assert told["r_m1"].endswith("correlated with r_m2 (+0.98)")
    tie = doubts(fakes.campaign(fit), Assessment(uncertainties=(judged,)))[-1]
    assert tie.code == "correlated"
    assert str(tie).startswith("r_m1 and r_m2 are strongly correlated at setting 1 (+0.98)")


@pytest.mark.parametrize(("rise", "is_better"), [(-0.48, False), (-0.52, True)])
def test_another_minimum_is_better_from_half_a_unit(rise, *, is_better) -> None:
    assert (profile(1.0, 3.0, better=rise).better is not None) is is_better


@pytest.mark.parametrize(("tie", "is_tie"), [(0.9, False), (0.96, True), (-0.96, True)])
def test_a_tie_is_a_correlation_that_triples_an_error(tie: float, *, is_tie: bool) -> None:
    campaign, judged = fakes.campaign(fakes.fit(1)), Assessment(uncertainties=(known(tie=tie),))
    assert bool(doubts(campaign, judged)) is is_tie
