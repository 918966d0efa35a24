"""What is said of intervals, profiles and residuals, word by word, from known numbers."""

from __future__ import annotations

import inspect
import math
from dataclasses import replace

import numpy as np
import pytest

from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.identification import FitOptions, Outcome, Sharing
from damperfit.identification.outcome import Status
from damperfit.recording import Finding
from damperfit.run.judging import Judgement
from damperfit.run.record import _judged, profile_record, unconfirmed_tares, unlike_frictions
from damperfit.tested.setting import Setting
from damperfit.uncertainty import (
    Assessment,
    Bench,
    Diagnosis,
    Interval,
    Uncertainty,
    assess,
    linearise_settings,
    predict,
    reconsider,
)
from damperfit.uncertainty.correlation import _is_positive, cycle_covariance, sums_by_cycle
from damperfit.uncertainty.covariance import GasContent, make_interval
from damperfit.uncertainty.profiles import MisfitProfile, ProfilePoint
from damperfit.uncertainty.residuals import residual_scatter
from damperfit.uncertainty.verdicts import _is_unfit, _span, doubts, undetermined, verdicts
from tests import fakes


def diagnosis(setting, *, mse=0.02, noise=0.018, is_structured=False, words="") -> Diagnosis:
    said = words or f"sentence of {setting}"
    return Diagnosis(setting, mse, noise, is_structured, 0.0, 1.0, (), said)


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


def test_settings_without_a_misfit_share_one_sentence() -> None:
    structured = diagnosis(5, is_structured=True)
    single = diagnosis(6, noise=math.nan)
    quiet = [diagnosis(n, noise=noise) for n, noise in ((1, 0.018), (2, 0.015), (3, 0.019))]
    told = Assessment(diagnoses=(*quiet, structured, single)).sentences
    assert told == (
        "setting 5: sentence of 5",
        (
            "settings 1-3: no misfit repeats from cycle to cycle; noise makes up "
            "75 % of the MSE or more"
        ),
        "setting 6: sentence of 6",
    )
    (one,) = Assessment(diagnoses=(quiet[0],)).sentences
    assert one.startswith("setting 1: no misfit repeats from cycle to cycle")
    assert one.endswith("noise makes up 90 % of the MSE or more")


def test_a_misfit_of_several_settings_is_one_warning_led_by_the_worst() -> None:
    several = [diagnosis(n, mse=mse, is_structured=True) for n, mse in ((1, 0.2), (2, 0.5))]
    quiet = diagnosis(3, mse=0.9)
    assert Assessment(diagnoses=(quiet,)).warnings == ()
    assert Assessment(diagnoses=(several[0], quiet)).warnings == ("setting 1: sentence of 1.",)
    assert Assessment(diagnoses=(*several, quiet)).warnings == (
        "settings 1, 2, most at 2: sentence of 2.",
    )


def test_the_gas_content_is_told_with_both_intervals() -> None:
    found = GasContent(
        volume_ratio=0.0123, stiffness=4.56e8,
        volume_ratio_interval=Interval(0.001, 0.0101, 0.0145, math.nan),
        stiffness_interval=Interval(1e7, 4.36e8, 4.76e8, math.nan),
        correlation=0.5, pressures={}, rises={},
    )  # fmt: skip
    assert found.sentence == (
        "gas content: V_r = 1.23 % of the oil's volume (95 % from 1.01 to 1.45 %) at the working "
        "pressure, K_B/C = 456 MPa (436 to 476 MPa)"
    )


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


@pytest.mark.parametrize(("rise", "is_better"), [(-0.48, False), (-0.52, True)])
def test_another_minimum_is_better_from_half_a_unit(rise, *, is_better) -> None:
    found = profile(1.0, 3.0, better=rise).better
    assert (found is not None) is is_better
    assert found is None or found.value == 2.0


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


@pytest.mark.parametrize("is_none", [True, False])
def test_a_friction_at_its_upper_edge_is_not_none(is_none) -> None:
    one = fakes.fit(1, status={"f_f": "at_bound"})
    values = one.parameters.replace({"f_f": one.parameters.quantity("f_f").plausible[not is_none]})
    (found,) = reconsider(fakes.campaign(replace(one, parameters=values)), Assessment()).fits
    assert (found.status["f_f"] == "not_identifiable") is is_none


def test_an_error_as_large_as_the_value_unfits_what_is_shared_alone() -> None:
    fit = fakes.fit(1)
    campaign = replace(fakes.campaign(fit), sharing=Sharing(taken={"r_m3": 1}))
    judged = Assessment(uncertainties=(known(error=0.4),))
    (found,) = reconsider(campaign, judged).fits
    changed = {name for name in fit.status if found.status[name] != fit.status[name]}
    assert changed == {"r_m3"}
    held = replace(campaign, fits=(replace(fit, status={**fit.status, "r_m3": "fixed"}),))
    assert reconsider(held, judged).fits[0].status["r_m3"] == "fixed"


@pytest.mark.parametrize(
    ("name", "names", "error", "is_unfit"),
    [
        ("r_m3", ("r_m1", "r_m3"), 0.34, True),
        ("r_m3", ("r_m1", "r_m3"), 0.33, False),
        ("r_m3", ("r_m1", "k_e"), 0.4, False),  # nothing is known of it
        ("f_0", ("f_0",), 40.0, False),  # may well be nothing
    ],
)
def test_a_value_is_unfit_to_share_from_a_third_on(name, names, error, is_unfit) -> None:
    fit = fakes.fit(1)
    errors = [error if one in {name, "k_e"} else 0.5 for one in names]
    judged = Uncertainty(1, {}, names, np.diag(np.square(errors)), names)
    assert _is_unfit(fit, name, judged) is is_unfit
    assert not _is_unfit(fit, name, None)


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


def test_a_limit_from_below_says_that_any_higher_value_fits() -> None:
    fit = fakes.fit(1, status={"r_m3": "not_identifiable"})
    seen = {"r_m3": profile(5e4, None)}
    assert verdicts(fit, known(), Sharing(taken={"r_m3": 1}), seen)["r_m3"] == (
        "not identifiable upward: at least 5e+04 N s/(m2 kg) (95 %), and any higher value fits "
        "these logs as well; 2.597e+06 N s/(m2 kg) is used for all settings; fix it, or fit faster "
        "logs with more force"
    )


@pytest.mark.parametrize(
    ("seen", "end"),
    [
        (None, "95 % from 2.547e+06 to 2.648e+06 N s/(m2 kg)); 2.597e+06 N s/(m2 kg) is used for"),
        (
            profile(None, 5e4),
            "; 2.597e+06 N s/(m2 kg) is used for all settings, instead of 0: any",
        ),
    ],
)
def test_a_limit_from_above_says_that_the_fallback_stands_for_nothing(seen, end) -> None:
    fit = fakes.fit(1, status={"r_m3": "not_identifiable"})
    sharing = Sharing(taken={"r_m3": 1})
    said = verdicts(fit, known(), sharing, {} if seen is None else {"r_m3": seen})["r_m3"]
    assert said.startswith("these logs do not determine it (")
    assert end in said
    alone = verdicts(fit, known(), Sharing(), {})["r_m3"]
    assert "used for all settings" not in alone


@pytest.mark.parametrize(
    ("seen", "said"),
    [
        (profile(1.0, 3.0), "95 % from 1 to 3 N s/(m2 kg) by its profile"),
        (profile(None, 3.0), "flat downward, only an upper limit: 95 % below 3 N s/(m2 kg)"),
        (profile(1.0, None), "flat upward, only a lower limit: 95 % above 1 N s/(m2 kg)"),
        (profile(None, None), "flat upward and downward: no limit at all"),
    ],
)
def test_what_a_profile_has_seen_is_said(seen, said) -> None:
    at_bound = fakes.fit(1, status={"r_m3": "at_bound"})
    told = verdicts(at_bound, known(), Sharing(), {"r_m3": seen})["r_m3"]
    assert told == (
        f"ran to the edge of its plausible range: {said}; fix it, or check units and signs"
    )
    fitted = fakes.fit(1, status={"r_m3": "fitted"})
    told = verdicts(fitted, known(), Sharing(), {"r_m3": seen})["r_m3"]
    assert told == f"fitted, {said}"
    shared = verdicts(fakes.fit(1), known(), Sharing(), {})
    assert shared["r_m3"] == "shared by all settings, 95 % from 2.547e+06 to 2.648e+06 N s/(m2 kg)"
    assert shared["f_0"] == "held at the value given"
    assert shared["f_f"] == "no interval: the fit did not converge to a minimum"


@pytest.mark.parametrize(
    ("status", "seen", "said"),
    [
        ("shared", profile(1.0, 3.0), "no interval: the fit did not converge to a minimum"),
        (
            "not_identifiable", profile(None, 5.0),
            ("these logs cannot tell it from none (flat downward, only an upper limit: 95 % below "
             "5 N): the law may as well lack this part"),
        ),
        (
            "not_identifiable", None,
            "these logs cannot tell it from none: the law may as well lack this part",
        ),
    ],
)  # fmt: skip
def test_what_has_no_interval_is_said_with_what_its_profile_has_seen(status, seen, said) -> None:
    fit = fakes.fit(1, status={"f_f": status})
    seen = {} if seen is None else {"f_f": replace(seen, name="f_f")}
    assert verdicts(fit, known(), Sharing(), seen)["f_f"] == said


@pytest.mark.parametrize(
    ("is_complete", "misfit", "low", "said"),
    [
        (True, 0.0, 1.0, "95 % from 1 to 3 N s/(m2 kg) by its profile"),
        (False, 0.0, 1.0, "95 % from 2.547e+06 to 2.648e+06 N s/(m2 kg)"),
        (True, 9.0, 1.0, "95 % from 2.547e+06 to 2.648e+06 N s/(m2 kg) (standard errors: "),
        (True, 9.0, None, "flat downward, only an upper limit: 95 % below 3 N s/(m2 kg) (standard"),
    ],
)
def test_a_profile_speaks_where_it_is_complete_and_nothing_is_missed_or_it_is_flat(
    is_complete, misfit, low, said
) -> None:
    fit = fakes.fit(1, status={"r_m3": "fitted"})
    told = known()
    intervals = {**told.intervals, "r_m3": replace(told.intervals["r_m3"], misfit=misfit)}
    seen = {"r_m3": replace(profile(low, 3.0), is_complete=is_complete)}
    found = verdicts(fit, replace(told, intervals=intervals), Sharing(), seen)["r_m3"]
    assert found.startswith(f"fitted, {said}")


def test_what_follows_an_adjuster_is_shared_by_the_settings_at_its_click() -> None:
    at = [Setting((("low", low), ("high", high))) for low, high in ((6, 1), (6, 2), (9, 1))]
    sharing = Sharing(jointly=("r_m3",), follows={"r_m3": ("low",)}, settings=tuple(at))
    fit = replace(fakes.fit(1, status={"r_m3": "shared"}), setting=at[1])
    said = verdicts(fit, known(), sharing, {})["r_m3"]
    assert said.startswith("shared by all settings at low 6, 95 % from ")


def test_a_profile_that_was_cut_short_asks_for_more() -> None:
    fit = fakes.fit(1, status={"r_m3": "at_bound"})
    seen = {"r_m3": replace(profile(1.0, 3.0), is_complete=False)}
    assert verdicts(fit, known(), Sharing(), seen)["r_m3"] == (
        "ran to the edge of its plausible range: its profile was not completed; give --profile; "
        "fix it, or check units and signs"
    )


def test_what_is_undetermined_at_several_settings_is_said_once_without_its_ties() -> None:
    """Ties differ from setting to setting, and `doubts` has a sentence for them."""
    fits = [fakes.fit(n, status={"r_m1": "not_identifiable"}) for n in (1, 2)]
    fits = [replace(one, parameters=fits[0].parameters) for one in fits]
    tied = {1: known(1, tie=0.98), 2: replace(known(1, tie=0.96), setting=2)}
    (said,) = undetermined(fits, tied, Sharing(), {})
    assert said.startswith("r_m1 at settings 1, 2: these logs do not determine it (95 % from ")
    assert "correlated" not in said
    assert "correlated with r_m2 (+0.98)" in verdicts(fits[0], tied[1], Sharing(), {})["r_m1"]


def test_ties_at_several_settings_are_one_sentence_with_their_range() -> None:
    fits = [fakes.fit(n) for n in (1, 2, 3)]
    by = {n: known(n, tie=tie) for n, tie in ((1, 0.961), (2, 0.98), (3, 0.94))}
    (said,) = doubts(fits, by, Sharing(), {})
    assert said == (
        "r_m1 and r_m2 are strongly correlated at settings 1, 2 (+0.96 to +0.98): the logs "
        "determine their combination better than each"
    )
    by[2] = known(2, tie=0.963)
    (said,) = doubts(fits, by, Sharing(), {})
    assert "at settings 1, 2 (+0.96): the logs" in said


def test_the_record_of_a_profile_has_both_limits_beside_those_of_the_errors() -> None:
    told = profile_record(profile(1.5, 3.5), Assessment(uncertainties=(known(),)))
    interval = known().intervals["r_m3"]
    assert (told["ci_low"], told["ci_high"]) == (1.5, 3.5)
    assert (told["sandwich_ci_low"], told["sandwich_ci_high"]) == (interval.low, interval.high)
    assert (told["shape"], told["points"], told["evaluations"]) == ("closed", 3, 17)
    held = profile(1.5, 3.5, is_partial=True)
    partial = profile_record(held, Assessment(uncertainties=(known(),)))
    assert partial["sandwich_ci_low"] is partial["sandwich_ci_high"] is None


def test_the_record_of_trust_has_a_place_for_everything() -> None:
    judged = Assessment(
        uncertainties=(known(),), diagnoses=(diagnosis(1),), profiles=(profile(1.5, 3.5),)
    )
    told = _judged(fakes.campaign(fakes.fit(1)), Judgement(judged))
    (trust,) = told["uncertainty"]
    assert (trust["setting"], trust["shared"]) == (1, ["r_m3"])
    assert trust["parameters"] == ["r_m1", "r_m2", "k_e", "r_m3"]
    assert trust["verdicts"]["f_0"] == "held at the value given"
    assert trust["residuals"]["sentence"] == "sentence of 1"
    assert trust["cavitation"]["chamber"] == 2
    assert [one["ci_low"] for one in told["profiles"]] == [1.5]
    assert told["gas_content"] is None


def test_a_tare_that_the_fit_does_not_need_is_told_of_its_settings() -> None:
    tare = Finding("tare", "warning", "tared")
    note = Finding("skew", "note", "not late")

    def said(*findings, settings=(1,), **more):
        fits = []
        for n in settings:
            fit = fakes.fit(n)
            log = replace(fit.logs[0], trace=replace(fit.logs[0].trace, findings=findings))
            fits.append(replace(fit, logs=(log,)))
        judged = Assessment(diagnoses=tuple(diagnosis(n, **more) for n in settings))
        return list(map(str, unconfirmed_tares(fakes.campaign(*fits), judged)))

    assert said(note) == said(replace(tare, severity="note")) == []
    assert said(note, tare, is_structured=True) == said(tare, noise=math.nan) == []
    (one,) = said(note, tare)
    assert one == (
        "setting 1: the warning tare is not confirmed: the fit matches the force to within its "
        "noise without an offset"
    )
    (three,) = said(note, tare, settings=(1, 2, 4))
    assert three.startswith("settings 1, 2, 4: the warning tare is not confirmed")


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


@pytest.mark.parametrize(
    ("rows", "is_positive"),
    [
        ([[1.0, 0.5], [0.5, 1.0]], True),
        ([[1.0, 1.5], [1.5, 1.0]], False),
        ([[0.0, 0.0], [0.0, 1.0]], False),
        ([[1.0, math.nan], [math.nan, math.nan]], False),
    ],
)
def test_a_covariance_is_positive(rows, *, is_positive) -> None:
    assert _is_positive(np.array(rows)) is is_positive


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


def test_a_setting_that_nobody_judged_does_not_hide_those_behind_it() -> None:
    fits = [fakes.fit(n, status={"k_e": "not_identifiable"}) for n in (1, 2, 3)]
    said = undetermined(fits, {1: known(1), 3: known(3)}, Sharing(), {})
    assert [text.partition(":")[0] for text in said] == ["k_e at setting 1", "k_e at setting 3"]


def test_a_fit_is_judged_by_the_integrator_that_has_made_it() -> None:
    """Coarser and finer ones differ by forces that would count as a misfit that repeats."""
    fitted = FitOptions().solver
    for function in (assess, linearise_settings, predict):
        solver = inspect.signature(function).parameters["solver"]
        assert solver.default == fitted, function.__name__
    assert Bench(PURDY_DAMPER).solver == fitted


@pytest.mark.parametrize(
    ("low", "high", "words"),
    [(1.0, 1e10, "95 % from 1 to 1e+10"), (0.99, 1e9, "95 % below 1e+09"),
     (1.01, 1.01e10, "95 % above 1.01"), (9.9e-302, 1e307, "no value of its plausible range")],
)  # fmt: skip
def test_an_end_of_an_interval_beyond_the_plausible_range_is_no_limit(low, high, words) -> None:
    wide = replace(PURDY_DAMPER.quantities[0], plausible=(1.0, 1e10))
    assert _span(low, high, wide).startswith(words)


def test_what_the_logs_do_not_determine_is_told_without_endless_ends() -> None:
    fit, seen = fakes.fit(1), known()
    fit = replace(fit, status={**fit.status, "r_m2": Status.NOT_IDENTIFIABLE})
    endless = replace(seen.intervals["r_m2"], low=9.9e-302, high=1e307)
    seen = replace(seen, intervals={**seen.intervals, "r_m2": endless})
    said = verdicts(fit, seen, Sharing(), {})["r_m2"]
    assert said.startswith("these logs do not determine it (no value of its plausible range")
    assert "e-302" not in said


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


def test_the_frictions_that_are_farthest_apart_are_named() -> None:
    (said,) = frictions((30.0, 1.0, 1.0), (24.2, 0.4, 1.0), (145.0, 0.7, 4.5))
    assert str(said) == (
        "f_f is 24.2 N at setting 2 and 145 N at setting 3, but friction belongs to the damper and "
        "not to its clicks: a preloaded valve may be taken for friction; fit the settings "
        "together: --procedure joint"
    )
