"""Settings of one damper lend each other friction and mounting; parts must do with one friction."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from damperfit.damper.valve_dampers import TwinTube
from damperfit.errors import SimulationError
from damperfit.laws import SettingLogs, Tried, course, elsewhere
from damperfit.simulation import SolverOptions
from damperfit.tested.setting import Setting

MODEL = TwinTube()


def fit(
    friction: float, mse: float, setting: Setting | None = None, *, force: float = 0.5
) -> SimpleNamespace:
    values = MODEL.values({one.name: 1.0 for one in MODEL.quantities}).replace({"f_f": friction})
    return SimpleNamespace(
        model=MODEL, values=values, free=("rebound_bleed", "f_f", "f_0"), mse_percent=mse,
        held_out_percent=float("nan"), held_out="", worst_force_percent=force, setting=setting,
        sure_force_percent=0.0, undetermined=(), at_bound=(),
    )  # fmt: skip


def two_settings() -> course.Course:
    logs = [SettingLogs(Setting.of(k), ()) for k in (1, 2)]
    return course.Course(logs, SolverOptions(), lambda _: None, 1)


@pytest.mark.parametrize(("mse", "beside"), [
    (0.01, 0.3), (0.2, 0.3), (None, 0.3), (0.01, 2.1), (0.01, 1.9),
])  # fmt: skip
def test_a_setting_borrows_the_friction_of_the_other(monkeypatch, mse, beside) -> None:
    """It is held at first, and freed where that is no hopeless place."""
    asked = []

    def fitted(_, logs, *, fixed=None, near=None, **__):
        asked.append((logs.setting, fixed, near and near.f_f))
        if fixed is not None:
            return fit(fixed["f_f"], beside, logs.setting)
        if mse is None:
            raise SimulationError("no")
        return fit(20.0, mse, logs.setting)

    monkeypatch.setattr(elsewhere, "fit_law", fitted)
    one, two = Setting.of(1), Setting.of(2)
    law = Tried("law", (fit(20.0, 0.001, one), fit(240.0, 0.1, two)))
    found = two_settings().crossed(law)
    assert asked[0] == (two, {"f_f": 20.0}, None)
    assert asked[1:] == ([] if beside > 2.0 else [(two, None, 20.0)])
    assert found.fits[0] is law.fits[0]  # it leaves nothing
    is_better = mse == 0.01 and beside < 2.0
    assert found.fits[1].mse_percent == (0.01 if is_better else 0.1)
    assert (found is law) is not is_better


def test_those_two_lend_that_leave_least(monkeypatch) -> None:
    lent_by = []

    def fitted(_, __, *, fixed=None, near=None, **___):
        lent_by.extend([] if fixed is None else [fixed["f_f"]])
        return fit(1.0, 0.05)

    monkeypatch.setattr(elsewhere, "fit_law", fitted)
    own = fit(240.0, 0.1, Setting.of(9))
    others = [fit(k, mse, Setting.of(k)) for k, mse in ((1, 0.3), (2, 0.001), (3, 0.2), (4, 0.04))]
    logs = SettingLogs(Setting.of(9), ())
    elsewhere.lent(own, logs, [own, *others], SolverOptions())
    assert lent_by == [2, 4]


@pytest.mark.parametrize(("friction", "untold", "n_lend"), [
    (33.1, "", 1), (32.9, "", 0), (12.1, "", 1), (12.2, "", 0),
    (248.0, "own", 0), (248.0, "other", 0), (248.0, "edge", 0), (248.0, "misses", 0),
])  # fmt: skip
def test_a_setting_with_another_friction_borrows_though_it_leaves_nothing(
    monkeypatch, friction, untold, n_lend
) -> None:
    """248 N beside 39 were a preload, and a bleed that none has was told: `joint_rates`, 238."""
    lent_by = []

    def fitted(_, __, *, fixed=None, **___):
        lent_by.extend([] if fixed is None else [fixed["f_f"]])
        return fit(20.0, 0.001)

    monkeypatch.setattr(elsewhere, "fit_law", fitted)
    own, other = fit(friction, 0.002, Setting.of(1)), fit(20.0, 0.001, Setting.of(2))
    own.undetermined = ("f_f",) if untold == "own" else ()
    other.undetermined = ("f_f",) if untold == "other" else ()
    own.at_bound = ("f_f",) if untold == "edge" else ()
    other.worst_force_percent = 1.01 if untold == "misses" else 0.99
    found = elsewhere.lent(own, SettingLogs(Setting.of(1), ()), [own, other], SolverOptions())
    assert lent_by == [20.0] * n_lend
    assert found.mse_percent == (0.001 if n_lend else 0.002)


@pytest.mark.parametrize(("again", "found"), [
    ((0.05, 0.02), (0.05, 0.02)),  # each setting keeps what is better
    ((0.05, 0.3), (0.05, 0.1)),
    ((0.1, 0.1), None),  # hardly better
    ((0.0, 0.0), (0.0, 0.0)),  # made-up logs without noise
    (None, None),
])  # fmt: skip
def test_a_law_starts_again_from_where_a_larger_one_got(monkeypatch, again, found) -> None:
    steps = two_settings()
    first, second = (Setting.of(k) for k in (1, 2))
    law = Tried("law", (fit(20.0, 0.2, first), fit(240.0, 0.1, second)))
    near = []

    def fitted(*_, **how):
        near.append(how["near"])
        if again is None:
            return None
        return Tried("law", (fit(20.0, again[0], first), fit(20.0, again[1], second)))

    monkeypatch.setattr(steps, "fitted", fitted)
    larger = [Tried(str(mse), (fit(20.0, mse), fit(20.0, mse))) for mse in (0.03, 0.01)]
    back = steps.back_from(law, larger)
    assert near == [larger[1]]
    if found is None:
        assert back is law
        assert not steps.laws
    else:
        assert tuple(one.mse_percent for one in back.fits) == found
        assert [one.is_taken for one in steps.laws] == [True]
    assert steps.back_from(law, []) is law


@pytest.mark.parametrize(("force", "is_taken"), [(1.34, False), (1.32, True)])
def test_a_law_that_a_force_was_missed_by_starts_again_too(monkeypatch, force, is_taken) -> None:
    """Free gas moved one setting to its valley: its MSE fell by a quarter, a force by a half."""
    steps, law = two_settings(), Tried("law", (fit(20.0, 0.002, force=2.0),))
    one = Tried("law", (fit(20.0, 0.0019, force=force),))
    monkeypatch.setattr(steps, "fitted", lambda *_, **__: one)
    assert (steps.back_from(law, [one]) is not law) is is_taken
