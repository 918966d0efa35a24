"""A second descent with less free ends by what the first knows, beside its slow twins.

Twins are the descent on the logs alone, which the parameters are held to within a tenth of their
errors, and the mean cycles' own look at the whole log.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from damperfit.damper.model import Values
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.errors import SimulationError
from damperfit.identification import last_step
from damperfit.identification.descent import Misfit, descend
from damperfit.identification.last_step import beside_earlier, known_step
from damperfit.identification.model_versus_log import compare
from damperfit.identification.setting import relative_errors
from damperfit.identification.solution import Earlier, Solution
from damperfit.recording import Trace
from tests.identification.rig import trace
from tests.identification.test_mean_cycle import ALL, LOGS, NEAR, THREE, misfit, on_cycles

TRUTH = reference_parameters(10)
START = TRUTH.replace({name: 1.2 * getattr(TRUTH, name) for name in ALL})
R_M3, F_F = ALL.index("r_m3"), ALL.index("f_f")


def first_pass(logs: Sequence[Trace]) -> Solution:
    found = descend(replace(on_cycles(misfit(logs, ALL)), is_followed=True), START)
    assert found.apart is not None
    return found


@pytest.fixture(scope="module")
def logs() -> list[Trace]:
    return [trace(10, noise=4.0, rate=500.0)]


@pytest.fixture(scope="module")
def first(logs: list[Trace]) -> Solution:
    return first_pass(logs)


@pytest.mark.parametrize("away", [pytest.param(0.0, marks=pytest.mark.slow), 2.0])
@pytest.mark.parametrize(
    "name", ["setting 1", "setting 20", "drift", "causal", "zero phase", "two logs", "whole cycles"]
)
def test_the_second_pass_ends_where_it_would_on_the_logs(name: str, away: float) -> None:
    """With R_m3 and f_f held up to two errors from where this setting's logs have them."""
    logs = LOGS[name]()
    before = first_pass(logs)
    errors = away * relative_errors(before)
    held = before.parameters.replace(
        r_m3=before.parameters.r_m3 * (1.0 + min(errors[R_M3], 0.09)),
        f_f=before.parameters.f_f * (1.0 - min(errors[F_F], 0.09)),
    )
    whole = misfit(logs)
    slow = descend(whole, held)
    fast = descend(replace(on_cycles(whole), earlier=Earlier(ALL, before)), held)
    assert fast.seen
    assert not slow.seen
    own = relative_errors(slow)
    for one, error in zip(THREE, own, strict=True):
        apart = np.log(getattr(fast.parameters, one) / getattr(slow.parameters, one))
        assert abs(apart) < NEAR * error, one
    assert relative_errors(fast) == pytest.approx(own, rel=0.02)
    assert fast.mse_percent == pytest.approx(slow.mse_percent, rel=1e-4)
    assert fast.n_independent == pytest.approx(slow.n_independent, rel=0.02)
    assert fast.is_cavitating == slow.is_cavitating


def test_without_the_way_it_would_end_elsewhere(logs: list[Trace]) -> None:
    """The minima of a log of setting 20 and of its mean cycle differ by more than is allowed."""
    few = LOGS["setting 20"]()
    before = first_pass(few)
    assert before.apart is not None
    no_way = replace(before, apart=np.zeros(len(ALL)))
    found = [
        descend(replace(on_cycles(misfit(few)), earlier=Earlier(ALL, one)), before.parameters)
        for one in (before, no_way)
    ]
    errors = relative_errors(found[0])
    apart = [
        np.log(getattr(found[1].parameters, one) / getattr(found[0].parameters, one))
        for one in THREE
    ]
    assert np.max(np.abs(apart) / errors) > NEAR


def test_what_was_seen_is_of_the_parameters(logs: list[Trace], first: Solution) -> None:
    one = replace(on_cycles(misfit(logs)), earlier=Earlier(ALL, first))
    found = descend(one, first.parameters)
    anew = compare(found.parameters, logs[0], PURDY_DAMPER, solver=one.solver)
    assert np.array_equal(found.seen[0].force, anew.force)
    assert np.array_equal(found.seen[0].response.pressures, anew.response.pressures)


@pytest.mark.parametrize(("away", "is_near"), [(0.098, True), (0.102, False)])
def test_a_value_held_a_tenth_away_is_looked_at_anew(
    *, logs: list[Trace], first: Solution, away: float, is_near: bool
) -> None:
    held = first.parameters.replace(f_f=first.parameters.f_f * np.exp(away))
    one = replace(on_cycles(misfit(logs)), earlier=Earlier(ALL, first))
    assert bool(descend(one, held).seen) is is_near


@pytest.mark.parametrize(
    "earlier",
    [
        lambda first: Earlier(ALL, replace(first, apart=None)),
        lambda first: Earlier(("r_m1", "r_m2", "r_m3", "f_f"), first),
        lambda first: Earlier(THREE, first),
        lambda first: Earlier(ALL, replace(first, jacobian=first.jacobian[:2])),
        lambda first: Earlier(ALL, replace(first, apart=np.full(len(ALL), 0.03))),
    ],
    ids=["on the logs", "without K_e", "nothing held", "too few samples", "far apart"],
)
def test_what_does_not_know_the_way_is_not_asked(
    logs: list[Trace], first: Solution, earlier: object
) -> None:
    assert callable(earlier)
    one = on_cycles(misfit(logs))
    found = descend(replace(one, earlier=earlier(first)), first.parameters)
    assert not found.seen
    assert found.parameters == descend(one, first.parameters).parameters


def test_another_value_of_what_was_never_free_is_another_fit(logs: list[Trace]) -> None:
    four = ("r_m1", "r_m2", "k_e", "r_m3")
    before = descend(on_cycles(misfit(logs, four)), TRUTH)
    one = replace(on_cycles(misfit(logs)), earlier=Earlier(four, before))
    assert descend(one, before.parameters).seen
    assert not descend(one, before.parameters.replace(f_f=1.001 * TRUTH.f_f)).seen


def test_a_misfit_of_the_integrator_or_a_failed_look_is_left_to_others(
    logs: list[Trace], first: Solution, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = replace(misfit(logs), earlier=Earlier(ALL, first))
    there = replace(
        descend(replace(on_cycles(whole), earlier=None), first.parameters),
        gradient=np.zeros(len(THREE)),
    )
    found = known_step(whole, there, least_percent=0.0)
    assert found is not None
    assert known_step(whole, there, least_percent=0.99 * found.mse_percent) is not None
    assert known_step(whole, there, least_percent=1.01 * found.mse_percent) is None

    def refused(*_: object, **__: object) -> None:
        raise SimulationError("no")

    monkeypatch.setattr("damperfit.identification.last_step.compare", refused)
    assert known_step(whole, there, least_percent=0.0) is None


@pytest.fixture(scope="module")
def there(logs: list[Trace], first: Solution) -> Solution:
    """Where a descent on the mean cycles ended, with its gradient."""
    found = descend(replace(on_cycles(misfit(logs)), earlier=None), first.parameters)
    return replace(found, gradient=np.zeros(len(THREE)))


@pytest.mark.parametrize("place", range(len(THREE)))
@pytest.mark.parametrize(("share", "is_taken"), [(0.99, True), (-0.99, True), (1.01, False),
                                                 (-1.01, False)])  # fmt: skip
def test_a_step_of_two_per_cent_is_taken_and_no_longer_one(
    *, logs: list[Trace], there: Solution, place: int, share: float, is_taken: bool,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    step = np.zeros(len(THREE))
    step[place] = share * last_step._SMALL
    monkeypatch.setattr(last_step, "_way", lambda *_: step)
    monkeypatch.setattr(last_step, "_AN_ERROR", np.inf)
    found = known_step(misfit(logs), there, least_percent=0.0)
    assert (found is not None) is is_taken


@pytest.mark.parametrize(("share", "is_taken"), [(0.98, True), (1.02, False)])
def test_a_step_of_one_error_is_taken_and_no_longer_one(
    *, logs: list[Trace], there: Solution, share: float, is_taken: bool,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    """By the rise of the misfit that it promises: 1 is one error of the residuals' own noise."""
    step = np.array([1e-4, 0.0, 0.0])
    moved = there.condensed.jacobian @ step
    rise = float(moved @ moved) * there.n_independent / (there.mse_percent / 100.0)
    step *= share * np.sqrt(last_step._AN_ERROR / rise)
    monkeypatch.setattr(last_step, "_way", lambda *_: step)
    monkeypatch.setattr(last_step, "_SMALL", np.inf)
    found = known_step(misfit(logs), there, least_percent=0.0)
    assert (found is not None) is is_taken


@pytest.mark.parametrize(
    "what", ["nothing", "no gradient", "nothing free", "as much free", "K_e was held", "at an edge"]
)
def test_where_the_way_is_not_known(
    logs: list[Trace], there: Solution, first: Solution, what: str
) -> None:
    whole, end = replace(misfit(logs), earlier=Earlier(ALL, first)), there
    if what == "no gradient":
        end = replace(there, gradient=None)
    elif what == "nothing free":
        whole = replace(whole, free=())
    elif what == "as much free":
        whole = replace(whole, free=ALL)
        end = replace(first, gradient=np.zeros(len(ALL)))
    elif what == "K_e was held":
        assert first.apart is not None
        few = replace(first, jacobian=first.jacobian[:4, :4], apart=first.apart[:4])
        held = tuple(one for one in ALL if one != "k_e")
        whole = replace(whole, earlier=Earlier(held, few))
    elif what == "at an edge":
        high = TRUTH.quantity("k_e").plausible[1]
        end = replace(there, parameters=there.parameters.replace(k_e=high))
        # As near as it is to where the first descent ended.
        at = replace(first, parameters=first.parameters.replace(k_e=high))
        whole = replace(whole, earlier=Earlier(ALL, at))
    assert (last_step._way(whole, end) is None) is (what != "nothing")


def ended_on_cycles(one: Misfit, start: Values) -> np.ndarray:
    found = descend(replace(one, earlier=None), start)
    assert found.apart is not None
    return np.log([getattr(found.parameters, name) for name in THREE]) - found.apart


@pytest.mark.parametrize("name", ["setting 1", "setting 20", "two logs"])
def test_a_second_descent_starts_where_it_nearly_ends(name: str) -> None:
    """With R_m3 and f_f held an error away, and the others on the minimum of the logs."""
    few = LOGS[name]()
    before = first_pass(few)
    errors = relative_errors(before)
    held = before.parameters.replace(
        r_m3=before.parameters.r_m3 * (1.0 + errors[R_M3]),
        f_f=before.parameters.f_f * (1.0 - errors[F_F]),
    )
    one = replace(on_cycles(misfit(few)), earlier=Earlier(ALL, before))
    start = beside_earlier(one, held)
    assert (start.r_m3, start.f_f) == (held.r_m3, held.f_f)
    own = relative_errors(descend(one, held))
    end = ended_on_cycles(one, start)
    near, far = (
        np.max(np.abs(np.log([getattr(at, name) for name in THREE]) - end) / own)
        for at in (start, held)
    )
    assert far > 0.5
    assert near < 0.2 * far


@pytest.mark.parametrize(
    "earlier",
    [
        None,
        lambda first: Earlier(ALL, replace(first, apart=None)),
        lambda first: Earlier(THREE, first),
        lambda first: Earlier(ALL, replace(first, jacobian=first.jacobian[:2])),
    ],
    ids=["none", "on the logs", "nothing held", "too few samples"],
)
def test_a_start_stays_where_nothing_is_known_of_the_way(
    logs: list[Trace], first: Solution, earlier: object
) -> None:
    one = on_cycles(misfit(logs))
    given = replace(one, earlier=earlier(first) if callable(earlier) else None)
    held = first.parameters.replace(f_f=1.01 * first.parameters.f_f)
    assert beside_earlier(given, held) == held


@pytest.mark.parametrize(("away", "is_near"), [(0.098, True), (0.102, False)])
def test_a_start_is_moved_where_what_is_held_is_near(
    *, logs: list[Trace], first: Solution, away: float, is_near: bool
) -> None:
    one = replace(on_cycles(misfit(logs)), earlier=Earlier(ALL, first))
    held = first.parameters.replace(r_m3=first.parameters.r_m3 * np.exp(away))
    assert (beside_earlier(one, held) != held) is is_near
    elsewhere = held.replace(r_m1=1.001 * held.r_m1)  # not where the first has ended
    assert beside_earlier(one, elsewhere) == elsewhere
