"""The checklist: each check passes, fails with the settings named, or says why nobody looked."""

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
from damperfit.damper.model import Quantity, values_type
from damperfit.damper.purdy.parameters import DAMPER_RANGES
from damperfit.errors import ConfigurationError
from damperfit.identification import LogFit, Outcome, Status
from damperfit.problem import note, warning
from damperfit.uncertainty import Assessment, Diagnosis, Interval, Objection, Uncertainty
from tests.fakes import campaign, fit, trace


def diagnosis(setting=1, *, mse=0.01, noise=0.0098, is_structured=False):
    return Diagnosis(setting, mse, noise, is_structured, (), f"sentence of {setting}")


def trend(**more):
    plain = Trend(
        "r_m1",
        "log",
        1,
        0.003,
        False,
        "rising",
        True,
        (),
        (),
        True,
        (),
        "R_m1 rises",
        symbol="R_m1",
    )
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


FINDING = warning("clipping", "the force is clipped")
NOTE = note("tare", "the force is not tared")
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
        "K_e is at a bound of its plausible range at setting 2",
    ),
    "all_parameters_identifiable": (
        subject(*(fit(n, status={"k_e": "not_identifiable"}) for n in (1, 2, 3, 7))),
        "K_e is not determined by the logs at settings 1-3, 7",
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
        "at setting 2, least at setting 2: 6.5 % of its 0.62 %",
    ),
    "trend_monotone": (
        subject(trends=[trend(monotone=False, sentence="R_m1 turns")]),
        "R_m1 turns",
    ),
    "no_outlier_setting": (subject(trends=[OFF]), "setting 20 (R_m1 +12.5 %)"),
    "every_click_counts": (
        subject(clicks=[click(0.5), click(-0.2, stroke="bump"), click(0.1, speed=0.1)]),
        "no force changes from setting 1 to 2",
    ),
    "temperature_in_window": (
        subject(with_trace(3, temperature=28.3)),
        "outside 25 to 27 degC: setting 3 (setting_03.csv, 28.3 degC)",
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
        "no log determined K_e",
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
def test_every_check_can_pass_fail_and_be_unable_to_look_and_says_where(name) -> None:
    is_elastic = name == "series_stiffness_found"
    good = subject(elastic(1), elastic(2)) if is_elastic else subject()
    cases = [(good, "", True), (*FAILING[name], False)]
    if name in UNSEEN:
        cases.append((*UNSEEN[name], None))
    for seen, words, passed in cases:
        check = result(name, seen)
        assert check.passed is passed, check.reason
        assert check.reason
        assert words in check.reason


def turning(by):
    points = tuple(TrendPoint(k, 1.0, 0.9, 1.1, found) for k, found in ((1, 1.0), (2, 1.0 + by)))
    return trend(monotone=False, direction="falling", reversals=((1, 2),), points=points)


def structured(noise, mse=1.0):
    return subject(fit(1), diagnoses=[diagnosis(1, mse=mse, noise=noise, is_structured=True)])


JUMPS = {1: (Objection("friction", "f_f", "f_f jumps"),)}
LATE = lagging(fit(1), 0.005), lagging(fit(2), 0.03)
HOT_AND_UNKNOWN = subject(with_trace(1, temperature=None), with_trace(2, temperature=30.0))
WHOLE = subject(fit(1), fit(2))
ERRATIC = trend(
    parameter="r_m2", is_erratic=True, outliers_judged=False, sentence="R_m2 is erratic"
)
ANY_TEMPERATURE = replace(subject(with_trace(1, temperature=None)), temperature_tolerance=math.inf)


# Each limit with a case on both sides, and what stands in a check's way.
@pytest.mark.parametrize(
    ("name", "seen", "passed", "words"),
    [
        (
            "every_click_counts",
            subject(clicks=[click(low=-0.1, high=9.0)]),
            False,
            "no force changes",
        ),
        ("every_click_counts", subject(clicks=[click(low=0.1, high=9.0)]), True, "every click "),
        ("every_click_counts", subject(clicks=[click(low=-9.0, high=-0.1)]), True, "every click "),
        ("every_click_counts", subject(clicks=[click(0.5), click(90.0, speed=0.1)]), True, ""),
        ("every_click_counts", subject(clicks=[click(0.5), click(-50.0, stroke="bump")]), True, ""),
        ("every_click_counts", subject(clicks=[click(), click(low=math.nan)]), None, "not known"),
        ("every_click_counts", subject(clicks=[click(second=4)]), True, "every step from"),
        ("no_cavitation", subject(fit(1)), True, "R_m3 may rise by 18 % at setting 1"),
        ("no_outlier_setting", subject(trends=[trend(is_erratic=True)]), True, ""),
        ("no_outlier_setting", subject(trends=[trend(), ERRATIC]), None, "R_m2 is erratic"),
        ("mse_below_1_percent", subject(fit(1), fit(2, mse=0.99)), True, "0.99 % at setting 2"),
        ("mse_below_1_percent", subject(fit(1), fit(2, mse=1.0)), False, "1 % at setting 2"),
        ("noise_floor_explained", structured(0.49), False, ""),
        ("noise_floor_explained", structured(0.51), True, ""),
        *(
            (name, subject(diagnoses=diagnoses), None, f"were not evaluated, at {where}")
            for name in ("residuals_white", "noise_floor_explained")
            for diagnoses, where in (([diagnosis(1)], "setting 2"), ([], "settings 1, 2"))
        ),
        *(
            ("temperature_in_window", subject(with_trace(3, temperature=26.0 + off)), passed, "")
            for off, passed in ((0.95, True), (1.05, False), (-0.95, True), (-1.05, False))
        ),
        ("temperature_in_window", HOT_AND_UNKNOWN, False, ""),
        ("temperature_in_window", ANY_TEMPERATURE, None, "requires no temperature"),
        *(
            ("every_setting_fitted", subject(*map(fit, settings)), passed, words)
            for settings, passed, words in (
                ((1, 2, 3, 5), False, "no result for setting 4"),
                ((2, 4, 6, 8), True, ""),
                ((1, 5, 10, 15, 20), True, ""),
                ((7,), True, ""),
            )
        ),
        (
            "every_setting_fitted",
            replace(WHOLE, campaign=replace(WHOLE.campaign, is_complete=False)),
            False,
            "interrupted",
        ),
        ("friction_within_jump", subject(lagging(fit(1), 0.03)), None, "channel lags by 30 ms"),
        (
            "friction_within_jump",
            subject(lagging(elastic(1), 0.005)),
            None,
            "the mounting is elastic and the force channel lags by 5 ms",
        ),
        ("friction_within_jump", subject(*LATE), True, "at setting 1"),
        ("friction_within_jump", subject(*LATE, objections=JUMPS), False, ""),
        *(
            (name, seen, share < 0.01, "")
            for share in (0.009, 0.011)
            for name, seen in (
                ("residuals_white", structured(0.0, 100.0 * share**2)),
                ("noise_floor_explained", structured(0.0, 100.0 * share**2)),
                (
                    "no_outlier_setting",
                    subject(trends=[trend(outliers=(Outlier(20, 1.0, 1.0 + share, -share),))]),
                ),
                ("trend_monotone", subject(trends=[turning(share)])),
            )
        ),
    ],
)
def test_a_check_passes_or_not(name, seen, passed, words) -> None:
    check = result(name, seen)
    assert check.passed is passed, check.reason
    assert words in check.reason


@pytest.mark.parametrize(
    ("middle", "passed"), [(1.5, None), (2.17, False), (2.11, None), (0.91, False), (0.97, None)]
)
def test_three_settings_of_which_the_middle_one_turns_may_be_mixed_up(middle, passed) -> None:
    fits, known = [], []
    for setting, value in ((1, 1.0), (2, middle), (3, 2.0)):
        plain = fit(setting)
        fits.append(replace(plain, parameters=replace(plain.parameters, r_m1=value)))
        interval = {"r_m1": Interval(0.005, 0.99 * value, 1.01 * value)}
        known.append(Uncertainty(setting, interval, ("r_m1",), np.eye(1)))
    seen = replace(subject(*fits, trends=[]), assessment=Assessment(uncertainties=tuple(known)))
    check = result("trend_monotone", seen)
    assert check.passed is passed
    assert ("turns at setting 2" in check.reason) is (passed is False)


def test_without_fits_nothing_is_looked_at() -> None:
    checks = run_checks(Subject(campaign(), Assessment(), Adjustment(), missing=("a.csv",)))
    by_name = {check.name: check for check in checks}
    assert by_name.pop("every_setting_fitted").passed is False
    assert {check.passed for check in by_name.values()} == {None}


WHOLE_LIST = CHECK_LISTS["purdy2000"]


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (["no_log_warnings", "purdy2000", "no_cavitation"], ("no_log_warnings", *WHOLE_LIST)),
        (["purdy2000", "-temperature_in_window"], WHOLE_LIST[:-1]),
        (["-temperature_in_window", "purdy2000"], WHOLE_LIST[:-1]),
        (["no_cavitation", "purdy2000", "-purdy2000"], ()),
        (["no_cavitations"], "Did you mean 'no_cavitation'"),
        (["purdy200"], "Did you mean 'purdy2000'"),
        (["no_cavitation", "-temperature_in_window"], "excludes a check that was not requested"),
        (["purdy2000", "-no_cavitatoin"], "Did you mean 'no_cavitation'"),
    ],
)
def test_names_and_lists_stand_for_checks_each_once(names, expected) -> None:
    if isinstance(expected, tuple):
        assert expand_checks(names) == expected
        return
    with pytest.raises(ConfigurationError, match=expected):
        expand_checks(names)


def test_a_gate_that_nobody_looked_at_is_not_met() -> None:
    checks = (Check("a", True, "fine"), Check("b", False, "bad"), Check("c", None, "no data"))
    sentences = ["check b: bad", "check not evaluated: c: no data"]
    assert list(map(str, missed_gates(checks, ("a", "b", "c")))) == sentences


def test_a_chamber_that_is_empty_in_a_model_that_misses_may_be_full() -> None:
    """The check asserted what the grade doubted."""
    doubt = {20: (Objection("cavitation", "", "chamber 2 cavitates"),)}
    empty = fit(19), fit(20, outcome=Outcome.CAVITATING)
    for objections, is_doubted in ((doubt, True), ({}, False)):
        check = result("no_cavitation", subject(*empty, objections=objections))
        assert check.passed is False
        assert check.reason.endswith("setting 20: it may be full") is is_doubted
