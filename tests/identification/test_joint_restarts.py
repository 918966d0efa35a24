"""A joint fit that is strained starts again from what single settings tell of the shared values."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from damperfit.damper.valve_dampers import TwinTube
from damperfit.errors import SimulationError
from damperfit.identification import joint_restarts
from damperfit.identification.failures import SettingError, SettingFailure
from damperfit.identification.joint_fit import JointProblem, JointSolution
from damperfit.tested.setting import Setting

MODEL = TwinTube()
SOFT, HARD, CLOSED = (Setting((("l", low), ("h", high))) for low, high in ((6, 1), (6, 3), (18, 1)))
SHARED, FOLLOWS = ("compression_bleed", "compression_slope"), {"compression_bleed": ("l",)}


class Law:
    """Met where the bleed of the soft needle is that of HARD, and the slope that of CLOSED."""

    def __init__(self, *_) -> None:
        """Whatever it is of."""

    def on_cycles(self):
        return self

    def cost(self, at):
        if at.compression_slope == 2.0:
            raise SimulationError("no")
        return 1.0 if at.compression_slope == 3.0 and at.compression_bleed in {20.0, 30.0} else 5.0


def values(bleed: float, slope: float):
    one = MODEL.values({one.name: 1.0 for one in MODEL.quantities})
    return one.replace({"compression_bleed": bleed, "compression_slope": slope})


APART = {SOFT: values(10.0, 1.0), HARD: values(20.0, 2.0), CLOSED: values(30.0, 3.0)}


def solved(percent: float) -> JointSolution:
    return JointSolution(
        parameters=APART, evaluations=7, is_converged=True, cost=1.0, weights={},
        mean_squares=dict.fromkeys(APART, percent), n_independent={}, errors={}, gas=None,
    )  # fmt: skip


def restarted(monkeypatch, percent: float, again: float, least: float = 1e-3, *, fails: int = 0):
    """What comes of a joint fit that misses by so much, and the starts that were followed."""
    misfit = SimpleNamespace(
        damper=MODEL, traces=(), free=SHARED, solver=None, deviation=10.0, whole=None
    )
    problem = JointProblem(dict.fromkeys(APART, misfit), SHARED, FOLLOWS)
    followed = []

    def fitted(_, start):
        followed.append(start)
        if len(followed) <= fails:
            raise SettingError(SettingFailure(SOFT, "SimulationError", "no"))
        return solved(again)

    monkeypatch.setattr(joint_restarts, "LawMisfit", Law)
    monkeypatch.setattr(joint_restarts, "kept_within", lambda one, _: one)
    monkeypatch.setattr(joint_restarts, "fit_jointly", fitted)
    least_of = dict.fromkeys(APART, least)
    return joint_restarts.unstrained(problem, solved(percent), APART, least_of), followed


def test_the_start_that_meets_all_settings_is_followed_first(monkeypatch) -> None:
    found, followed = restarted(monkeypatch, 0.2, 0.01)
    told = {one: (at.compression_bleed, at.compression_slope) for one, at in followed[0].items()}
    assert told == {SOFT: (20.0, 3.0), HARD: (20.0, 3.0), CLOSED: (30.0, 3.0)}
    assert len(followed) == 2
    assert found.mean_squares[SOFT] == 0.01
    assert found.evaluations == 21


def test_behind_a_start_that_fails_the_next_is_followed(monkeypatch) -> None:
    found, followed = restarted(monkeypatch, 0.2, 0.01, fails=1)
    assert len(followed) == 2
    assert found.mean_squares[SOFT] == 0.01
    assert found.evaluations == 14
    found, followed = restarted(monkeypatch, 0.2, 0.01, fails=2)
    assert (len(followed), found.mean_squares[SOFT], found.evaluations) == (2, 0.2, 7)


def test_a_start_that_cannot_be_simulated_is_not_followed(monkeypatch) -> None:
    def cost(*_):
        raise SimulationError("no")

    monkeypatch.setattr(Law, "cost", cost)
    found, followed = restarted(monkeypatch, 0.2, 0.01)
    assert not followed
    assert (found.mean_squares[SOFT], found.evaluations) == (0.2, 7)


def test_what_ends_no_better_is_left(monkeypatch) -> None:
    found, followed = restarted(monkeypatch, 0.2, 0.3)
    assert len(followed) == 2
    assert found.mean_squares[SOFT] == 0.2


@pytest.mark.parametrize(("percent", "least", "is_strained"), [
    (0.079, 1e-3, False), (0.081, 1e-3, True), (0.39, 0.1, False), (0.41, 0.1, True),
])  # fmt: skip
def test_sharing_may_cost_a_little(monkeypatch, percent, least, *, is_strained) -> None:
    assert bool(restarted(monkeypatch, percent, 0.3, least)[1]) is is_strained


@pytest.mark.parametrize(("n", "orders"), [(4, 24), (5, 5), (20, 8)])
def test_of_many_settings_each_is_first(n, orders) -> None:
    settings = [Setting.of(k) for k in range(1, n + 1)]
    least = {one: float(-place) for place, one in enumerate(settings)}
    found = [*joint_restarts._orders(settings, least)]
    assert len(found) == orders
    assert all(sorted(one) == settings for one in found)
    assert n == 4 or found[0] == tuple(reversed(settings))
