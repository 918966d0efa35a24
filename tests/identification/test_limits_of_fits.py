"""Limits by which fits are judged, begun again and shared: a case just inside, one just outside."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from types import SimpleNamespace
from zlib import crc32

import numpy as np
import pytest

from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.identification import (
    FitOptions,
    Outcome,
    Status,
    descent,
    evaluation,
    following,
    joint_fit,
    joint_procedure,
    law_misfit,
    multistart,
    restarts,
    setting,
    settled,
    weights,
)
from damperfit.identification.descent import Misfit
from damperfit.identification.fit_facts import FitFacts
from damperfit.identification.paper import first_pass
from damperfit.identification.paper.first_pass import (
    _friction_range,
    _is_right_all_the_same,
    _tells_r_m3,
)
from damperfit.identification.sharing import listed_runs, listed_settings
from damperfit.simulation import SolverOptions
from damperfit.tested.setting import Setting
from tests import fakes

TRUTH = reference_parameters(10)
FREE = ("r_m1", "r_m2", "k_e")


def misfit(free=FREE, max_evaluations=100):
    return Misfit((), PURDY_DAMPER, free, SolverOptions(), max_evaluations, lambda: False)


def judged(mse=1.0, *, outcome=Outcome.CONVERGED, cavitating=False, evaluations=10, **values):
    solution = SimpleNamespace(
        parameters=TRUTH.replace(values), mse_percent=mse, is_cavitating=cavitating,
        evaluations=evaluations, n_independent=1000.0,
    )  # fmt: skip
    status = dict.fromkeys(TRUTH.names, Status.FITTED)
    return SimpleNamespace(solution=solution, outcome=outcome, status=status, errors={})


# What is sought out of all ways of sharing


@pytest.mark.parametrize(("n", "combinations"), [(4, 16), (5, 7)])
def test_all_combinations_of_four_adjusters_are_looked_at(n, combinations) -> None:
    """Of five none, each one, and all of them."""
    assert len(following._combinations(tuple("abcde"[:n]))) == combinations


@pytest.mark.parametrize(("gained", "rounds"), [(0.79, 6), (0.81, 1)])
def test_a_joint_fit_by_a_fifth_better_begins_the_search_anew(gained, rounds, monkeypatch) -> None:
    settings = [Setting.of(1), Setting.of(2)]
    asked = []

    class Search:
        weights, mean_squares, cost = None, dict.fromkeys(settings, 1.0), 0.0

        def __init__(self, *_):
            pass

        def improved(self, *_):
            return dict.fromkeys(FREE, ())

        def starts(self, _):
            return {}

        def worth(self, _):
            return 0.0

        price = worth

    def solved(*_):
        asked.append(1)
        squares = dict.fromkeys(settings, gained)
        return SimpleNamespace(parameters={}, evaluations=1, mean_squares=squares)

    monkeypatch.setattr(following, "_Search", Search)
    monkeypatch.setattr(following, "_known", lambda *_: {})
    monkeypatch.setattr(following, "JointProblem", lambda *_, **__: None)
    monkeypatch.setattr(following, "fit_jointly", solved)
    following.detected_way(dict.fromkeys(settings, misfit()), {})
    assert len(asked) == rounds


@pytest.mark.parametrize(("promise", "is_there"), [(0.0097, True), (0.0103, False)])
def test_a_joint_fit_that_promises_a_hundredth_is_at_its_minimum(
    promise, is_there, monkeypatch
) -> None:
    ended = SimpleNamespace(
        status=3, evaluations=1, system=SimpleNamespace(cost=0.0),
        extra=SimpleNamespace(seen={}, parameters={}, gas=None),
    )  # fmt: skip
    monkeypatch.setattr(joint_fit, "iterate", lambda *_: ended)
    monkeypatch.setattr(
        joint_fit, "_Model", lambda *_: SimpleNamespace(point_at=None, start=None, weights={})
    )
    monkeypatch.setattr(joint_fit, "_promise", lambda _: promise)
    monkeypatch.setattr(joint_fit, "_errors", lambda *_: {})
    problem = SimpleNamespace(misfits={1: SimpleNamespace(cycles=None, n_samples=1)}, jobs=1)
    assert joint_fit.fit_jointly(problem, {}).is_converged is is_there


@dataclass(frozen=True)
class _Gas:
    pressures: dict


@pytest.mark.parametrize(("moved", "rounds"), [(0.96e-4, 2), (1.04e-4, 6)])
def test_a_gas_law_is_fitted_until_the_pressures_stay(moved, rounds, monkeypatch) -> None:
    asked = []

    def solved(*_):
        asked.append(1)
        return SimpleNamespace(gas=_Gas({1: 1.0}), parameters={}, evaluations=1)

    monkeypatch.setattr(joint_procedure, "fit_jointly", solved)
    monkeypatch.setattr(joint_procedure, "first_law", lambda *_: None)
    monkeypatch.setattr(joint_procedure, "_pressures", lambda *_: {1: 1.0 + moved})
    monkeypatch.setattr(joint_procedure, "replace", lambda one, **_: one)
    given = SimpleNamespace(damper=SimpleNamespace(gas_exponent=1.2))
    joint_procedure._with_gas(given, None, {})
    assert len(asked) == rounds


@dataclass(frozen=True)
class _End:
    point: SimpleNamespace
    evaluations: int = 1


@pytest.mark.parametrize(("cost", "descents"), [(1.95, 1), (2.05, 3)])
def test_a_law_within_twice_the_scatter_needs_no_other_start(cost, descents, monkeypatch) -> None:
    starts = []

    def descend(start, how):
        starts.append(how)
        return _End(SimpleNamespace(cost=cost, extra=start))

    monkeypatch.setattr(law_misfit, "best_fitting", lambda _, ranked: list(ranked))
    given = SimpleNamespace(descend=descend, scatter=1.0, deviation=1.0, model=None, free=())
    law_misfit.best_of_starts(given, ["a", "b", "c"], known=0)
    assert starts.count(law_misfit._SHORT) == descents


# Minima


@pytest.mark.parametrize(
    ("apart", "error", "is_same"),
    [(0.0096, 1e-6, True), (0.0104, 1e-6, False), (0.048, 0.05, True), (0.052, 0.05, False)],
)
def test_minima_are_one_within_a_hundredth_or_an_error(apart, error, is_same, monkeypatch) -> None:
    monkeypatch.setattr(multistart, "relative_errors", lambda _: np.array([error]))
    one, other = judged(r_m1=1e4), judged(r_m1=1e4 * (1.0 - apart))
    assert multistart._is_same(one, other, misfit(("r_m1",))) is is_same


@pytest.mark.parametrize(
    ("apart", "error", "is_same"),
    [(0.0096, 1e-6, True), (0.0104, 1e-6, False), (0.048, 0.05, True), (0.052, 0.05, False)],
)
def test_offsets_are_one_within_a_hundredth_of_their_size_or_an_error(
    apart, error, is_same, monkeypatch
) -> None:
    """An offset may be nothing: its errors are shares of the force's deviation, here its size."""
    monkeypatch.setattr(multistart, "relative_errors", lambda _: np.array([error]))
    size = PURDY_DAMPER.quantity("f_0").size
    given = SimpleNamespace(free=("f_0",), deviation=size)
    one, other = judged(f_0=0.0), judged(f_0=apart * size)
    assert multistart._is_same(one, other, given) is is_same


@pytest.mark.parametrize(("chi", "is_level"), [(3.7, True), (3.98, False)])
def test_noise_makes_a_rise_of_384_once_in_twenty(chi, is_level) -> None:
    assert multistart._is_level(judged(1.0), judged(1.0 + chi / 1000.0)) is is_level


@pytest.mark.parametrize(
    ("starts", "free", "asked"), [(1, ("r_m1",), None), (2, ("r_m1",), 2), (5, (), None)]
)
def test_two_starts_are_searched_where_something_is_free(monkeypatch, starts, free, asked) -> None:
    monkeypatch.setattr(multistart, "fit_setting", lambda *_, **__: "first")
    monkeypatch.setattr(multistart, "reconsidered", lambda *found: found[1])
    monkeypatch.setattr(multistart, "search", lambda *found, n_starts: (found[2], n_starts))
    given = SimpleNamespace(options=SimpleNamespace(starts=starts))
    assert multistart.fit_from(given, 9, SimpleNamespace(free=free), "start") == ("first", asked)


@pytest.mark.parametrize(
    ("place", "seed"), [(9, 9), (0, 0), (-1, crc32(b"-1")), ("soft", crc32(b"soft"))]
)
def test_a_click_is_its_own_seed_and_a_word_has_one(place, seed) -> None:
    assert multistart._seed_of(Setting.of(place)) == seed


def test_what_a_first_descent_has_spent_a_second_lacks(monkeypatch) -> None:
    """On the mean cycle a descent goes on after a step that was not promised."""
    allowed = []

    def minimised(given, start, **_):
        allowed.append(given.max_evaluations)
        return SimpleNamespace(status=1, evaluations=30, failed_trials=0, parameters=start,
                               after=lambda *more: more)  # fmt: skip

    monkeypatch.setattr(descent, "_minimise", minimised)
    monkeypatch.setattr(descent, "promised_step", lambda *_, **__: None)
    assert descent._on_cycles(misfit(), TRUTH) == (30, 0)
    assert allowed == [100, 70]


# The paper's first pass


@pytest.mark.parametrize(("chi", "differ"), [(10.75, False), (10.9, True)])
def test_frictions_differ_where_chance_has_it_once_in_a_thousand(chi, differ) -> None:
    """Two of them, each off their mean by so many errors of 1 N."""
    off = math.sqrt(0.5 * chi)
    fits = [judged(f_f=100.0 - off), judged(f_f=100.0 + off)]
    for one in fits:
        one.errors["f_f"] = 1.0 / one.solution.parameters.f_f
    assert _friction_range(fits)[1] is differ


@pytest.mark.parametrize(("ratio", "is_right"), [(1.24, True), (1.26, False)])
def test_a_cavitating_fit_has_the_others_r_m3_within_a_quarter(ratio, is_right) -> None:
    one = judged(0.01, r_m3=ratio * 2e6)
    assert _is_right_all_the_same(one, 2e6) is is_right


@pytest.mark.parametrize(("error", "is_reported"), [(0.32, True), (0.345, False)])
def test_what_all_settings_share_is_three_errors_from_nothing(error, is_reported) -> None:
    one = judged()
    one.errors["r_m3"] = error
    assert _tells_r_m3(one) is is_reported


@pytest.mark.parametrize("is_minimum", [False, True])
def test_a_fit_that_is_no_minimum_gives_no_r_m3_and_holds_no_friction(
    monkeypatch, is_minimum
) -> None:
    """Beside the mean friction too: what is known stands alone, and the first fit as it was."""
    outcome = Outcome.CONVERGED if is_minimum else Outcome.NO_DESCENT
    first, again = judged(outcome=outcome, r_m3=1e6), judged(outcome=outcome, r_m3=2e6)
    for one in (first, again):
        one.errors["r_m3"] = 2.0
    monkeypatch.setattr(first_pass, "_with_mean_friction", lambda *_, **__: again)
    monkeypatch.setattr(first_pass, "_is_contradicted", lambda *_: False)
    given = SimpleNamespace(misfit=lambda *_, **__: None, options=FitOptions(), damper=PURDY_DAMPER)
    found = first_pass._shared_r_m3(given, {1: first}, FREE, 1, 50.0)
    assert found.value == PURDY_DAMPER.quantity("r_m3").fallback
    assert (found.status, found.judged, found.setting, found.is_refined) == (
        (Status.NOT_IDENTIFIABLE, again, 1, True)
        if is_minimum
        else (Status.FIXED, first, None, False)
    )
    assert found.said.startswith("the logs of setting 1 do not determine R_m3")
    assert found.said.endswith("give --fix r_m3=VALUE if yours is known.")
    assert (f"({outcome.value})" in found.said) is not is_minimum


# Starting again


@pytest.mark.parametrize(
    ("mse", "noise", "cavitating", "is_suspicious"),
    [
        (0.97e-3, 1e-9, True, False),
        (1.03e-3, 1e-9, True, True),
        (1.46, 1.0, True, False),
        (1.54, 1.0, True, True),
        (3.9, 1.0, False, False),
        (4.1, 1.0, False, True),
    ],
)
def test_a_misfit_is_suspicious_beyond_the_noise(
    mse, noise, cavitating, is_suspicious, monkeypatch
) -> None:
    monkeypatch.setattr(restarts, "noise_percent", lambda _: noise)
    monkeypatch.setattr(restarts, "_is_explained", lambda *_: False)
    one = judged(mse, cavitating=cavitating)
    assert restarts.is_suspicious(misfit(), one) is is_suspicious


@pytest.mark.parametrize(("share", "explains"), [(0.48, False), (0.52, True)])
def test_a_flaw_explains_half_of_the_misfit(share, explains, monkeypatch) -> None:
    residuals = np.array([1.0, -1.0])
    monkeypatch.setattr(restarts, "linearise", lambda *_: (residuals, np.array([[1.0], [0.0]])))
    monkeypatch.setattr(restarts, "weights", lambda _: (None,))
    monkeypatch.setattr(restarts, "signatures", lambda *_: {"delay": np.ones((1, 2))})
    monkeypatch.setattr(restarts, "gain", lambda *_: (2.0 * share, None))
    log = SimpleNamespace(force=np.zeros(2), compared=slice(None))
    given = SimpleNamespace(traces=(log,), whole=None, damper=PURDY_DAMPER)
    assert restarts._is_explained(given, judged(), 0.0) is explains
    blind = SimpleNamespace(traces=(log,), whole=None, damper=SimpleNamespace(flaws=()))
    assert not restarts._is_explained(blind, judged(), 0.0)


@pytest.mark.parametrize(("mse", "n"), [(1.04, 1), (1.06, 0)])
def test_a_full_chamber_is_followed_to_its_end_within_a_twentieth(mse, n, monkeypatch) -> None:
    followed = []

    def attempt(*_):
        followed.append(1)
        return judged(2.0)

    short = SimpleNamespace(mse_percent=mse, is_cavitating=False, evaluations=1, parameters=TRUTH)
    monkeypatch.setattr(restarts, "descend", lambda *_: short)
    monkeypatch.setattr(restarts, "attempt", attempt)
    restarts._from(misfit(), TRUTH, judged(1.0, cavitating=True))
    assert len(followed) == n


@pytest.mark.parametrize(("cost", "places"), [(47, 2), (48, 1)])
def test_short_descents_of_twelve_cost_sixty_in_all(cost, places, monkeypatch) -> None:
    """One evaluation was for the suspicion: after 47 more there is room for another twelve."""
    asked = []

    def tried(_, __, best):
        asked.append(1)
        return best, cost

    monkeypatch.setattr(restarts, "_own_starts", lambda *_: ([], False))
    monkeypatch.setattr(restarts, "_places", lambda *_: [TRUTH] * 9)
    monkeypatch.setattr(restarts, "_from", tried)
    monkeypatch.setattr(restarts, "replace", lambda one, **_: one)
    first = judged()
    first.said = ()
    restarts._started_again(misfit(), first, TRUTH)
    assert len(asked) == places


# One setting


@pytest.mark.parametrize(
    ("error", "status"), [(0.48, Status.FITTED), (0.52, Status.NOT_IDENTIFIABLE)]
)
def test_a_number_is_found_with_an_error_of_half_of_it(error, status) -> None:
    found = setting._statuses(misfit(("r_m1",)), judged().solution, {"r_m1": error})
    assert found["r_m1"] is status


@pytest.mark.parametrize(
    ("friction", "status"), [(9.7, Status.AT_BOUND), (10.3, Status.NOT_IDENTIFIABLE)]
)
def test_a_friction_not_found_has_run_to_zero_below_a_hundredth(friction, status) -> None:
    given = SimpleNamespace(free=("f_f",), damper=PURDY_DAMPER, deviation=1000.0)
    found = setting._statuses(given, judged(f_f=friction).solution, {"f_f": 0.9})
    assert found["f_f"] is status


@pytest.mark.parametrize(("mse", "is_kept"), [(1.46, True), (1.54, False)])
def test_a_sound_minimum_is_kept_within_half_as_much_again(mse, is_kept) -> None:
    cavitating = judged(1.0, outcome=Outcome.CAVITATING)
    assert setting._is_preferred(judged(mse), cavitating) is is_kept


@pytest.mark.parametrize(("length", "pays"), [(195, False), (205, True)])
def test_settled_cycles_pay_from_half_of_a_log_on(length, pays, monkeypatch) -> None:
    cycle = SimpleNamespace(motion=SimpleNamespace(displacement=np.zeros(100)))
    monkeypatch.setattr(settled, "_settled", lambda *_, **__: (cycle, 0.25))
    monkeypatch.setattr(settled, "weights", lambda traces: (None,) * len(traces))
    one = SimpleNamespace(n_cycles=3)
    log = SimpleNamespace(
        stretches=(one,), places=(slice(0, 5),), n_samples=5, force=np.zeros(length),
        drive=SimpleNamespace(jumps=()),
    )  # fmt: skip
    found = settled.settled([log, log])
    assert (found is not None) is pays
    assert found is None or found.scatter == 0.5  # of both logs


def test_logs_of_a_setting_count_with_all_their_compared_samples() -> None:
    one, other = fakes.trace(1), fakes.trace(1)
    other = replace(other, force=other.force + 100.0)
    facts = FitFacts((one, other))
    assert facts.n_samples == 2 * 333
    own = np.std(one.force[one.compared])
    assert facts.deviation == pytest.approx(math.hypot(own, 50.0))


@pytest.mark.parametrize(("n", "more"), [(20, ""), (21, " and 1 more")])
def test_twenty_settings_are_named(n, more) -> None:
    assert listed_runs([(3 * k, 3 * k) for k in range(n)]).endswith(f"57{more}")
    assert listed_settings(f"w{k:02d}" for k in range(n)).endswith(f"w19{more}")


# What samples count


@pytest.mark.parametrize(("ratio", "is_weighed"), [(1.23, False), (1.27, True)])
def test_noises_are_told_apart_from_a_quarter_on(ratio, is_weighed) -> None:
    stretches = [SimpleNamespace(noise=one, n_samples=2) for one in (100.0, 100.0 * ratio)]
    log = SimpleNamespace(stretches=stretches, force=np.array([1.0, -1.0] * 2), compared=slice(4))
    assert (weights._by_noise([log])[0] is not None) is is_weighed


def cornered(n, jump, monkeypatch):
    """A jump of the speed in a stretch of so many samples; 19 of them are beside it."""
    monkeypatch.setattr(weights, "_width", lambda *_: 10.0)
    stretch = SimpleNamespace(window=slice(0, n), n_samples=n, peak_speed=1.0)
    velocity = np.zeros(n)
    drive = velocity.copy()
    drive[20] = jump
    return SimpleNamespace(
        stretches=(stretch,), velocity=velocity, drive=SimpleNamespace(velocity=drive, jumps=()),
        model_filter=SimpleNamespace(sections=np.zeros(6), is_zero_phase=True), compared=slice(n),
    )  # fmt: skip


@pytest.mark.parametrize(("jump", "left_out"), [(0.48, 0), (0.52, 19)])
def test_the_speed_jumps_by_half_of_its_peak(jump, left_out, monkeypatch) -> None:
    found = weights._counted(cornered(100, jump, monkeypatch))
    assert (0 if found is None else np.count_nonzero(~found)) == left_out


@pytest.mark.parametrize(("n", "left_out"), [(58, 19), (56, 0)])
def test_corners_of_a_third_of_a_stretch_are_what_it_tells(n, left_out, monkeypatch) -> None:
    found = weights._counted(cornered(n, 1.0, monkeypatch))
    assert (0 if found is None else np.count_nonzero(~found)) == left_out


# What is not known of a log, and what a fit lacks


@pytest.mark.parametrize(
    ("noises", "per_cent"), [((2.0,), 4.0), ((math.nan, 2.0), 4.0), ((math.nan,), math.nan)]
)
def test_noise_is_that_of_the_stretches_that_know_it(noises, per_cent, monkeypatch) -> None:
    """One that does not, as a single cycle, is left out with its samples."""
    stretches = [SimpleNamespace(noise=noise, n_samples=30) for noise in noises]
    log = SimpleNamespace(stretches=stretches, places=[slice(0, 30)] * len(stretches))
    monkeypatch.setattr(restarts, "weights", lambda traces: (None,) * len(traces))
    found = restarts.noise_percent(SimpleNamespace(traces=[log], deviation=10.0))
    assert found == pytest.approx(per_cent, nan_ok=True)


@pytest.mark.parametrize(
    ("f_f", "mse", "cavitating", "lacks"),
    [
        (Status.FITTED, 0.5, False, True),
        (Status.FIXED, 0.5, False, True),
        (Status.AT_BOUND, 0.5, False, False),  # whatever the others are
        (Status.FITTED, 1.5, False, False),
        (Status.FITTED, 0.5, True, False),
    ],
)
def test_rigid_oil_is_a_fit_that_lacks_the_stiffness_alone(f_f, mse, cavitating, lacks) -> None:
    one = judged(mse, cavitating=cavitating)
    one.status |= {"k_e": Status.NOT_IDENTIFIABLE, "f_f": f_f}
    assert setting.lacks_stiffness_alone(one) is lacks
    one.status["k_e"] = Status.FITTED
    assert not setting.lacks_stiffness_alone(one)


@pytest.mark.parametrize(
    ("chamber", "factor", "is_empty"),
    [(0, 1.0, True), (1, 1.0, True), (2, 1.0, False), (0, 0.0, False)],
)
def test_one_empty_chamber_is_cavitation_where_it_is_compared(
    chamber, factor, is_empty, monkeypatch
) -> None:
    """Of a mean cycle: the gas chamber holds no oil, and a factor of nothing counts for nothing."""
    pressures = np.full((3, 4), 1e5)
    pressures[chamber, 2] = 0.0
    seen = SimpleNamespace(pressures=pressures)
    monkeypatch.setattr(evaluation, "simulate", lambda *_, **__: seen)
    monkeypatch.setattr(evaluation, "_refuse_wild", lambda _: None)
    cycle = SimpleNamespace(
        solver=lambda _: None, motion=None, force=np.zeros(4), factor=np.full(4, factor),
        rows=lambda _: np.zeros((4, 4)),
    )  # fmt: skip
    cycles = SimpleNamespace(cycles=[cycle], scatter=0.0)
    assert evaluation._on_cycles(misfit(), cycles, TRUTH, 1.0)[2] is is_empty


def test_a_doubted_fit_begins_again_with_one_quantity_elsewhere_or_two(monkeypatch) -> None:
    """Oil ten times as stiff or soft alone, friction with the valves, and so on."""
    start = TRUTH.replace({"r_m1": 2e4, "r_m2": 2e6, "k_e": 2e8, "f_f": 40.0})
    names = ("k_e", "f_f", "r_m1", "r_m2")
    places = restarts._places(misfit(names), start, [])
    factors = [
        tuple(round(getattr(one, name) / getattr(start, name), 9) for name in names)
        for one in places
    ]
    assert factors == [
        (1.0, 1.0, 1.0, 10.0),
        (0.1, 1.0, 1.0, 1.0),
        (10.0, 1.0, 1.0, 1.0),
        (1.0, 10.0, 0.5, 1.0),
        (1.0, 0.1, 2.0, 1.0),
        (0.3, 1.0, 5.0, 1.0),
        (3.0, 1.0, 0.2, 1.0),
    ]


def test_what_no_log_determines_costs_one_deviation_at_a_factor_of_e_squared(monkeypatch) -> None:
    residuals, slopes = np.ones(4), np.zeros((4, 1))
    monkeypatch.setattr(following, "linearise", lambda *_: (residuals, slopes))
    monkeypatch.setattr(following, "_forces", lambda _: (residuals, residuals > 0.0))
    monkeypatch.setattr(
        following, "common_variables", lambda _: SimpleNamespace(pack=lambda numbers: numbers)
    )
    one = Setting.of(1)
    given = SimpleNamespace(free=("k_e",), traces=(), whole=None)
    (curvature,) = following._Search({one: given}, {one: TRUTH}, None)._curvatures
    off = math.log(math.e**2)
    assert off * float(curvature[0, 0]) * off == pytest.approx(1.0)


@pytest.mark.parametrize("law", ["free", "appendix1"])
def test_a_gas_content_is_fitted_where_it_is_asked_for(law, monkeypatch) -> None:
    def ended(mean_square):
        return SimpleNamespace(
            evaluations=5, is_converged=True, parameters={}, gas=None, unknowns=(),
            mean_squares={1: mean_square, 2: mean_square}, n_independent={1: 100.0, 2: 100.0},
            weights={1: 1.0, 2: 1.0},
        )  # fmt: skip

    monkeypatch.setattr(joint_procedure, "JointProblem", lambda *_, **__: None)
    monkeypatch.setattr(joint_procedure, "_common_starts", lambda *_: {})
    monkeypatch.setattr(joint_procedure, "fit_jointly", lambda *_: ended(1.0))
    monkeypatch.setattr(joint_procedure, "_with_gas", lambda *_: (ended(1.5), 7))
    monkeypatch.setattr(joint_procedure, "_statuses", lambda *_, **__: {})
    given = SimpleNamespace(
        options=SimpleNamespace(bulk_modulus=law), jobs=1, ordered=tuple,
        misfit=lambda *_: None,
    )  # fmt: skip
    way = following.Way(own=(), shared=("f_f",), follows={})
    found = joint_procedure._fit_sound(given, {1: None, 2: None}, way, ("f_f",))
    is_gas = law == "appendix1"
    assert found.evaluations == (12 if is_gas else 5)
    assert found.sharing.gas_rises == ({1: 50.0, 2: 50.0} if is_gas else {})
    assert len(found.warnings) == is_gas  # of two settings
