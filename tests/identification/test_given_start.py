"""Fits start where somebody says, and from the neighbour where they have ended far worse."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import pytest

from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.errors import ConfigurationError
from damperfit.identification import (
    FitOptions,
    GivenStart,
    Outcome,
    check_options,
    identify,
    neighbours,
)
from damperfit.identification.neighbours import _is_in_doubt, beside_neighbours
from damperfit.identification.procedure_input import ProcedureInput
from damperfit.tested.setting import Setting, nearest_setting
from tests import fakes
from tests.identification.rig import trace

KNOWN = {"r_m3": 2.597e6, "f_f": 50.0}
OWN = {"r_m1": 1e4, "r_m2": 2e6, "k_e": 5e8}


@cache
def log(setting: int):
    return trace(setting, noise=4.0, duration=4.0)


def given(start: GivenStart, settings=(5,)) -> ProcedureInput:
    options = FitOptions("plain", fixed={**KNOWN, "f_0": 0.0}, start=start)
    traces = {Setting.of(k): (log(k),) for k in settings}
    return ProcedureInput(traces, PURDY_DAMPER, options, 1, lambda _: None, lambda: False)


def started(start: GivenStart):
    one = given(start)
    misfit = one.misfit(Setting.of(5), ("r_m1", "r_m2", "k_e"))
    return one.start(Setting.of(5), misfit, one.options.fixed)


def test_what_is_told_is_where_a_fit_starts_and_the_rest_is_the_models_start() -> None:
    own = started(GivenStart())
    there = started(GivenStart({"k_e": 7e8}))
    assert there == own.replace(k_e=7e8) != own


def test_a_name_goes_before_the_table_what_is_fixed_before_both_and_the_range_before_all() -> None:
    table = {Setting.of(5): {**OWN, "r_m3": 1.0, "k_e": 1e30, "other": 3.0}}
    there = started(GivenStart({"r_m1": 2e4}, table))
    assert (there.r_m1, there.r_m2, there.r_m3) == (2e4, 2e6, KNOWN["r_m3"])
    assert there.k_e == PURDY_DAMPER.quantity("k_e").plausible[1]


def test_a_setting_that_the_table_does_not_have_starts_from_the_nearest() -> None:
    table = {Setting.of(k): {"k_e": 1e8 * k} for k in (1, 4, 9)}
    assert started(GivenStart({}, table)).k_e == 4e8


def test_the_nearest_setting_counts_words_before_clicks() -> None:
    def two(a, b):
        return Setting((("low", a), ("high", b)))

    known = [two("soft", 3), two("hard", 4), two("hard", 9)]
    assert nearest_setting(two("hard", 3), known) == two("hard", 4)
    assert nearest_setting(two("hard", 7), known) == two("hard", 9)
    assert nearest_setting(3, [Setting.of(1), Setting.of(5)]) == 1  # alike: the first
    assert nearest_setting(3, []) is None
    assert nearest_setting(3, [two(3, 3), Setting.of(50)]) == 50  # other adjusters are farthest


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"fixed": {"k_e": 5e8}, "start": {"k_e": 5e8}}, "k_e is fixed and also given a start"),
        ({"start": {"k_f": 5e8}}, "no parameter 'k_f'"),
        ({"start": {"k_e": 9e99}}, "k_e = 9e.99 is given as a start"),
        ({"start": {"f_0": 5.0}}, "f_0 is given a start but is not fitted"),
    ],
)
def test_what_cannot_act_is_refused(options, said) -> None:
    start = GivenStart(options.pop("start"))
    with pytest.raises(ConfigurationError, match=said):
        check_options(FitOptions("plain", start=start, **options), PURDY_DAMPER)


def test_what_is_freed_may_be_given_a_start() -> None:
    free = (*OWN, "f_0")
    check_options(FitOptions("plain", free=free, start=GivenStart({"f_0": 5.0})), PURDY_DAMPER)


def fit(setting: int, mse: float, outcome: Outcome = Outcome.CONVERGED):
    return replace(fakes.fit(setting), mse_percent=mse, noise_floor_percent=0.01, outcome=outcome)


@pytest.mark.parametrize(("mse", "is_doubted"), [(0.199, False), (0.201, True)])
def test_a_fit_is_doubted_at_twice_its_neighbours_misfit(mse, is_doubted) -> None:
    assert _is_in_doubt(fit(2, mse), fit(1, 0.1)) is is_doubted


@pytest.mark.parametrize(("mse", "is_doubted"), [(0.0399, False), (0.0401, True)])
def test_noise_is_no_reason_to_doubt(mse, is_doubted) -> None:
    assert _is_in_doubt(fit(2, mse), fit(1, 1e-6)) is is_doubted


def test_a_wrong_valley_is_left_from_the_neighbours_values() -> None:
    """R_m3 ten times too large beside a small K_e: half the cycle is empty, MSE 2 %."""
    both = given(GivenStart(), (5, 6))
    names = ("r_m1", "r_m2", "k_e")
    campaign = identify([log(5), log(6)], PURDY_DAMPER, both.options)
    sound = campaign.fits
    lost = replace(
        sound[1],
        parameters=sound[1].parameters.replace(r_m1=3e3, k_e=5e6),
        mse_percent=40.0,
        outcome=Outcome.CAVITATING,
    )
    wrong = replace(campaign, fits=(sound[0], lost))
    found = beside_neighbours(wrong, lambda one: both.misfit(one, names), jobs=1)
    assert found.fits[0] is sound[0]
    assert found.fits[1].parameters.r_m1 == pytest.approx(sound[1].parameters.r_m1, rel=1e-4)
    assert "from the values of setting 5" in found.fits[1].warnings[-1]
    kept = beside_neighbours(campaign, lambda one: both.misfit(one, names), jobs=1)
    assert kept.fits == sound


def test_a_minimum_within_the_ranges_is_preferred_to_one_at_an_edge() -> None:
    """As good to the noise: a blow-off without resistance stood beside neighbours that had one."""
    both = given(GivenStart(), (5, 6))
    names = ("r_m1", "r_m2", "k_e")
    campaign = identify([log(5), log(6)], PURDY_DAMPER, both.options)
    edge = replace(campaign.fits[1], outcome=Outcome.AT_BOUND)
    strained = replace(campaign, fits=(campaign.fits[0], edge))
    found = beside_neighbours(strained, lambda one: both.misfit(one, names), jobs=1)
    assert found.fits[1].outcome is Outcome.CONVERGED
    assert "within them that fits as well" in found.fits[1].warnings[-1]
    better = replace(edge, mse_percent=0.5 * edge.mse_percent)
    kept = beside_neighbours(
        replace(campaign, fits=(campaign.fits[0], better)),
        lambda one: both.misfit(one, names),
        jobs=1,
    )
    assert kept.fits[1].outcome is Outcome.AT_BOUND


def test_a_worse_end_from_the_neighbour_is_not_taken(monkeypatch) -> None:
    monkeypatch.setattr(neighbours, "LEAST", 0.0)
    both = given(GivenStart(), (5, 6))
    campaign = identify([log(5), log(6)], PURDY_DAMPER, both.options)
    good = replace(campaign.fits[1], noise_floor_percent=1e-9)
    better = replace(campaign.fits[0], mse_percent=1e-6)
    found = beside_neighbours(
        replace(campaign, fits=(better, good)), lambda one: both.misfit(one, ("k_e",)), jobs=1
    )
    assert found.fits[1].parameters == good.parameters
    assert found.fits[1].evaluations > good.evaluations
