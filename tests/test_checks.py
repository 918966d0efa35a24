"""The checklist: each check passes, fails with the settings named, or says why nobody looked."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from damperfit.adjustment.clicks import Adjustment, Click
from damperfit.adjustment.trends import Outlier, Trend, TrendPoint
from damperfit.checks import (
    CHECK_LISTS,
    CHECKS,
    Check,
    Subject,
    expand_checks,
    missed_gates,
    run_checks,
)
from damperfit.damper.model import values_type
from damperfit.damper.purdy.parameters import DAMPER_RANGES
from damperfit.damper.quantity import Quantity
from damperfit.errors import ConfigurationError
from damperfit.identification import LogFit, Outcome, Status
from damperfit.recording import Finding
from damperfit.uncertainty import Assessment, Diagnosis, Objection
from tests.fakes import campaign, fit, trace


def diagnosis(setting=1, *, mse=0.01, noise=0.0098, is_structured=False):
    return Diagnosis(setting, mse, noise, is_structured, 0.0, 1.0, (), f"sentence of {setting}")


def trend(**more):
    plain = Trend("r_m1", "log", 1, 0.003, False, "rising", True, (), (), True, (), "R_m1 rises")
    return replace(plain, **more)


def click(change=50.0, reach=1.0, **more):
    plain = Click(1, 2, 0.3, "rebound", change, change - reach, change + reach, 5.0, 4.9, 5.1)
    return replace(plain, **more)


def subject(*fits, diagnoses=None, trends=None, clicks=None, objections=None, **more):
    trends = (trend(),) if trends is None else trends
    clicks = (click(),) if clicks is None else clicks
    fits = fits or (fit(1), fit(2))
    assessed = [diagnosis(one.setting) for one in fits] if diagnoses is None else diagnoses
    return Subject(
        campaign(*fits),
        Assessment(diagnoses=tuple(assessed), objections=objections or {}),
        Adjustment(trends=tuple(trends), clicks=tuple(clicks)),
        **more,
    )


SOFT = (Objection("beyond", "k_e", "K_e is no oil's"),)


def elastic(setting, status=Status.FITTED, k_s=5e5):
    """A fit of a model whose mounting gives."""
    one = fit(setting)
    spring = Quantity("k_s", "k_s", "", "", "N/m", (1e3, 1e10))
    values = values_type((*one.parameters.quantities, spring))(*one.parameters.numbers, k_s)
    return replace(one, parameters=values, status={**one.status, "k_s": status})


def lagging(one, lag):
    """The same fit of a model whose force channel is late."""
    late = Quantity("lag", "T", "", "", "s", (1e-5, 5e-2))
    values = values_type((*one.parameters.quantities, late))(*one.parameters.numbers, lag)
    return replace(one, parameters=values, status={**one.status, "lag": Status.FITTED})


def result(name, seen) -> Check:
    return {check.name: check for check in run_checks(seen)}[name]


def with_trace(setting, **changes):
    one = fit(setting)
    return replace(one, logs=(LogFit(replace(trace(setting), **changes), 0.01, 0.01),))


FINDING = Finding("clipping", "warning", "the force is clipped")
NOTE = Finding("tare", "note", "the force is not tared")
OFF = trend(outliers=(Outlier(20, 4.9e4, 4.355e4, 0.125),))

FAILING = {
    "every_setting_fitted": (subject(missing=("setting_07.csv failed",)), "setting_07.csv failed"),
    "fits_converged": (
        subject(fit(1), fit(4, outcome=Outcome.NO_DESCENT)),
        "at setting 4 (no_descent)",
    ),
    "mse_below_1_percent": (
        subject(fit(1, mse=1.0), fit(2), fit(3, mse=6.0)),
        "at settings 1, 3, worst 6 % at setting 3",
    ),
    "no_parameter_at_bound": (
        subject(fit(1), fit(2, status={"k_e": "at_bound"})),
        "k_e lies at the edge of its plausible range at setting 2",
    ),
    "all_parameters_identifiable": (
        subject(*(fit(n, status={"k_e": "not_identifiable"}) for n in (1, 2, 3, 7))),
        "k_e is not determined by the logs at settings 1-3, 7",
    ),
    "no_cavitation": (
        subject(fit(19), fit(20, outcome=Outcome.CAVITATING)),
        "at setting 20, most for 5.0 % of the cycle at setting 20",
    ),
    "residuals_white": (
        subject(diagnoses=[diagnosis(1), diagnosis(2, mse=0.62, noise=0.04, is_structured=True)]),
        "repeats from cycle to cycle at setting 2, most 7.6 % of the force at setting 2",
    ),
    "noise_floor_explained": (
        subject(diagnoses=[diagnosis(2, mse=0.62, noise=0.04, is_structured=True)]),
        "at setting 2, least at setting 2: 6.5 % of 0.62 %",
    ),
    "trend_monotone": (
        subject(trends=[trend(monotone=False, sentence="R_m1 turns")]),
        "R_m1 turns",
    ),
    "no_outlier_setting": (subject(trends=[OFF]), "setting 20 (r_m1 +12.5 %)"),
    "every_click_counts": (
        subject(clicks=[click(0.5), click(-0.2, stroke="bump"), click(90.0, speed=0.1)]),
        "at 0.3 m/s does not change from setting 1 to 2",
    ),
    "temperature_in_window": (
        subject(with_trace(3, temperature=28.3)),
        "outside 26 +- 1 degC: setting 3 (setting_03.csv, 28.3 degC)",
    ),
    "no_log_warnings": (subject(with_trace(3, findings=(FINDING, NOTE))), "clipping at setting 3"),
    "damper_declared": (
        subject(undeclared=("gas_length",)),
        "[damper] is declared without gas_length: defaults are used for these",
    ),
}
FAILING |= {
    "every_grade_stands": (
        subject(objections={2: (Objection("misfit", "", "much repeats"),)}),
        "grades are withheld at setting 2; setting 2: much repeats",
    ),
    "bulk_modulus_of_oil": (
        subject(objections={1: SOFT, 2: SOFT}),
        "at settings 1, 2: setting 1: K_e is no oil's",
    ),
    "offset_as_in_log": (
        subject(objections={2: (Objection("offset", "f_0", "f_0 is elsewhere"),)}),
        "setting 2: f_0 is elsewhere",
    ),
    "friction_within_jump": (
        subject(objections={1: (Objection("friction", "f_f", "f_f jumps"),)}),
        "setting 1: f_f jumps",
    ),
    "series_stiffness_found": (
        subject(elastic(1), elastic(2, Status.AT_BOUND)),
        "k_s is not determined by the logs at setting 2",
    ),
}
UNSEEN = {
    "bulk_modulus_of_oil": (
        subject(fit(1, status={"k_e": "fixed"})),
        "no log determined k_e",
    ),
    "friction_within_jump": (subject(elastic(1)), "the mounting is elastic"),
    "series_stiffness_found": (subject(), "the model has no stiffness in series"),
    "residuals_white": (subject(diagnoses=[diagnosis(1, noise=np.nan)]), "at setting 1"),
    "noise_floor_explained": (subject(diagnoses=[diagnosis(1, noise=np.nan)]), "at setting 1"),
    "trend_monotone": (
        subject(trends=[trend(monotone=None, outliers_judged=False, sentence="too few")]),
        "too few",
    ),
    "no_outlier_setting": (subject(trends=[]), "no parameter was fitted setting by setting"),
    "every_click_counts": (subject(clicks=[]), "no two settings"),
    "temperature_in_window": (
        subject(fit(1), with_trace(2, temperature=None)),
        "no temperature in 1 of 2 logs (setting_02.csv)",
    ),
    "damper_declared": (
        subject(undeclared=tuple(DAMPER_RANGES), whose="a generic damper"),
        "no damper is declared: a generic damper is assumed",
    ),
}


@pytest.mark.parametrize("name", CHECKS)
def test_a_good_run_passes_every_check(name) -> None:
    is_elastic = name == "series_stiffness_found"
    check = result(name, subject(elastic(1), elastic(2)) if is_elastic else subject())
    assert check.passed is True, check.reason
    assert check.reason


@pytest.mark.parametrize("name", CHECKS)
def test_every_check_can_fail_and_says_where(name) -> None:
    seen, words = FAILING[name]
    check = result(name, seen)
    assert check.passed is False
    assert words in check.reason


@pytest.mark.parametrize(("fits", "said"), [
    ((lagging(fit(1), 0.03),), "the force channel lags by 30 ms, which spreads the jump"),
    (
        (lagging(elastic(1), 0.005),),
        "the mounting is elastic and the force channel lags by 5 ms, which spreads the jump",
    ),
])  # fmt: skip
def test_what_spreads_the_jump_of_the_friction_is_said(fits, said) -> None:
    check = result("friction_within_jump", subject(*fits))
    assert check.passed is None
    assert check.reason.startswith(said)


def test_friction_is_checked_behind_a_short_lag_where_there_is_one() -> None:
    fits = lagging(fit(1), 0.005), lagging(fit(2), 0.03)
    check = result("friction_within_jump", subject(*fits))
    assert check.passed is True
    assert check.reason.endswith("at setting 1")
    found = {1: (Objection("friction", "f_f", "f_f jumps"),)}
    assert result("friction_within_jump", subject(*fits, objections=found)).passed is False


@pytest.mark.parametrize("name", UNSEEN)
def test_what_cannot_be_looked_at_says_why(name) -> None:
    seen, words = UNSEEN[name]
    check = result(name, seen)
    assert check.passed is None
    assert words in check.reason


@pytest.mark.parametrize("name", ["residuals_white", "noise_floor_explained"])
def test_a_setting_whose_residuals_nobody_saw_is_not_let_through(name) -> None:
    """Used to pass on what the other settings said."""
    for diagnoses, where in (([diagnosis(1)], "setting 2"), ([], "settings 1, 2")):
        check = result(name, subject(diagnoses=diagnoses))
        assert check.passed is None
        assert check.reason == f"the residuals were not evaluated, at {where}"


def test_a_click_that_hardens_bump_counts() -> None:
    seen = subject(clicks=[click(0.5), click(-50.0, stroke="bump")])
    assert result("every_click_counts", seen).passed is True


def test_steps_over_several_clicks_are_not_called_clicks() -> None:
    near = result("every_click_counts", subject(clicks=[click()]))
    apart = result("every_click_counts", subject(clicks=[click(), replace(click(), second=4)]))
    assert near.reason.startswith("every click changes the force at 0.3 m/s")
    assert apart.reason.startswith("every step from one tested setting to the next changes")


def test_one_force_without_an_error_leaves_the_clicks_unseen() -> None:
    seen = subject(clicks=[click(), click(low=math.nan)])
    check = result("every_click_counts", seen)
    assert check.passed is None
    assert check.reason == "the errors of the forces are not known"


@pytest.mark.parametrize(
    ("low", "high", "passed"), [(-0.1, 9.0, False), (0.1, 9.0, True), (-9.0, -0.1, True)]
)
def test_a_click_counts_from_its_error_on(low, high, passed) -> None:
    check = result("every_click_counts", subject(clicks=[click(low=low, high=high)]))
    assert check.passed is passed
    assert "the force at 0.3 m/s" in check.reason


@pytest.mark.parametrize(("mse", "passed"), [(0.99, True), (1.0, False)])
def test_an_mse_is_below_one_per_cent_or_not(mse, passed) -> None:
    check = result("mse_below_1_percent", subject(fit(1, mse=0.2), fit(2, mse=mse)))
    assert check.passed is passed
    assert f"{mse:.3g} % at setting 2" in check.reason


@pytest.mark.parametrize(("noise", "passed"), [(0.49, False), (0.51, True)])
def test_noise_must_explain_half_of_a_structured_mse(noise, passed) -> None:
    seen = subject(fit(1), diagnoses=[diagnosis(1, mse=1.0, noise=noise, is_structured=True)])
    assert result("noise_floor_explained", seen).passed is passed


def turning(by):
    points = tuple(TrendPoint(k, 1.0, 0.9, 1.1, found) for k, found in ((1, 1.0), (2, 1.0 + by)))
    return trend(monotone=False, direction="falling", reversals=((1, 2),), points=points)


@pytest.mark.parametrize("share", [0.009, 0.011])
def test_what_moves_no_force_by_one_per_cent_fails_nothing(share) -> None:
    one = diagnosis(1, mse=100.0 * share**2, noise=0.0, is_structured=True)
    off = trend(outliers=(Outlier(20, 1.0, 1.0 + share, -share),))
    for name, seen in (
        ("residuals_white", subject(fit(1), diagnoses=[one])),
        ("noise_floor_explained", subject(fit(1), diagnoses=[one])),
        ("no_outlier_setting", subject(trends=[off])),
        ("trend_monotone", subject(trends=[turning(share)])),
    ):
        assert result(name, seen).passed is (share < 0.01), name


@pytest.mark.parametrize(
    ("off", "passed"), [(0.95, True), (1.05, False), (-0.95, True), (-1.05, False)]
)
def test_a_temperature_is_in_its_window_or_not(off, passed) -> None:
    seen = subject(with_trace(3, temperature=26.0 + off))
    assert result("temperature_in_window", seen).passed is passed


def test_a_fault_counts_before_a_log_that_tells_nothing() -> None:
    seen = subject(with_trace(1, temperature=None), with_trace(2, temperature=30.0))
    assert result("temperature_in_window", seen).passed is False


@pytest.mark.parametrize(
    ("settings", "passed"),
    [((1, 2, 3, 5), False), ((2, 4, 6, 8), True), ((1, 5, 10, 15, 20), True), ((7,), True)],
)
def test_gaps_are_settings_left_out_of_a_run_of_clicks(settings, passed) -> None:
    check = result("every_setting_fitted", subject(*(fit(setting) for setting in settings)))
    assert check.passed is passed
    assert passed or "no result for setting 4" in check.reason


def test_an_interrupted_run_has_not_fitted_every_setting() -> None:
    whole = subject(fit(1), fit(2))
    cut = replace(whole, campaign=replace(whole.campaign, is_complete=False))
    check = result("every_setting_fitted", cut)
    assert check.passed is False
    assert "interrupted" in check.reason


def test_a_temperature_that_nobody_asks_for_is_not_looked_at() -> None:
    seen = replace(subject(with_trace(1, temperature=None)), temperature_tolerance=math.inf)
    check = result("temperature_in_window", seen)
    assert check.passed is None
    assert "requires no temperature" in check.reason


def test_without_fits_nothing_is_looked_at() -> None:
    checks = run_checks(Subject(campaign(), Assessment(), Adjustment(), missing=("a.csv",)))
    by_name = {check.name: check for check in checks}
    assert by_name.pop("every_setting_fitted").passed is False
    assert {check.passed for check in by_name.values()} == {None}


def test_lists_and_names_are_expanded_once_each() -> None:
    wanted = expand_checks(["no_log_warnings", "purdy2000", "no_cavitation"])
    assert wanted == ("no_log_warnings", *CHECK_LISTS["purdy2000"])
    assert set(CHECK_LISTS["purdy2000"]) <= set(CHECKS)


def test_an_unknown_name_is_refused_with_the_nearest() -> None:
    with pytest.raises(ConfigurationError, match="Did you mean 'no_cavitation'"):
        expand_checks(["no_cavitations"])
    with pytest.raises(ConfigurationError, match="Did you mean 'purdy2000'"):
        expand_checks(["purdy200"])


def test_a_gate_that_nobody_looked_at_is_not_met() -> None:
    checks = (Check("a", True, "fine"), Check("b", False, "bad"), Check("c", None, "no data"))
    assert missed_gates(checks, ("a", "b", "c")) == (
        "check b: bad",
        "check not evaluated: c: no data",
    )


def test_a_check_can_be_left_out_of_a_list() -> None:
    whole = CHECK_LISTS["purdy2000"]
    assert expand_checks(["purdy2000", "-temperature_in_window"]) == whole[:-1]
    assert expand_checks(["-temperature_in_window", "purdy2000"]) == whole[:-1]
    assert expand_checks(["no_cavitation", "purdy2000", "-purdy2000"]) == ()
    with pytest.raises(ConfigurationError, match="excludes a check that was not requested"):
        expand_checks(["no_cavitation", "-temperature_in_window"])
    with pytest.raises(ConfigurationError, match="Did you mean 'no_cavitation'"):
        expand_checks(["purdy2000", "-no_cavitatoin"])


@pytest.mark.parametrize(("n", "ending"), [(20, "log 20 failed"), (21, "log 5 failed and 16 more")])
def test_hundreds_of_failures_are_summarised(n, ending) -> None:
    missing = tuple(f"log {k} failed" for k in range(1, n + 1))
    check = result("every_setting_fitted", subject(missing=missing))
    assert check.reason.startswith("log 1 failed; log 2 failed; ")
    assert check.reason.endswith(ending)
    hot = [with_trace(k, temperature=40.0) for k in range(1, n + 1)]
    far = result("temperature_in_window", subject(*hot))
    assert far.passed is False
    assert far.reason.count("degC)") == (20 if n == 20 else 5)


def test_a_chamber_that_is_empty_in_a_model_that_misses_may_be_full() -> None:
    """The check asserted what the grade doubted."""
    doubt = {20: (Objection("cavitation", "", "chamber 2 cavitates"),)}
    empty = fit(19), fit(20, outcome=Outcome.CAVITATING)
    checks = {one.name: one for one in run_checks(subject(*empty, objections=doubt))}
    assert checks["no_cavitation"].passed is False
    assert checks["no_cavitation"].reason.endswith(
        "at setting 20; the model does not match the logs of setting 20: it may be full"
    )
    sure = {one.name: one for one in run_checks(subject(*empty))}
    assert sure["no_cavitation"].reason.endswith("most for 5.0 % of the cycle at setting 20")
