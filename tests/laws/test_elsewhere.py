"""Before a valve's part is taken out, settings that laws are not compared at are asked."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from damperfit.damper.valve_dampers import TwinTube
from damperfit.errors import SimulationError
from damperfit.laws import elsewhere
from damperfit.laws.choosing import Tried
from damperfit.laws.law_fit import SettingLogs
from damperfit.laws.missed import worst_force, worst_stroke
from damperfit.simulation import SolverOptions


def fit(name, percent, stroke=1.0):
    model = SimpleNamespace(name=name, quantity=lambda _: SimpleNamespace(default=None))
    free = ("bleed",) if name == "small" else ("bleed", "opening")
    return SimpleNamespace(
        model=model, mse_percent=percent, held_out_percent=float("nan"), free=free, at_bound=(),
        worst_stroke_percent=stroke, worst_force_percent=0.5, held_out="", setting=9,
        residuals=(np.zeros(4),), sure_force_percent=0.0,
    )  # fmt: skip


SMALL, LARGE = (Tried(name, (fit(name, 0.001),)) for name in ("small", "large"))


def asked(monkeypatch, found, n=1):
    """What the settings say where a law leaves so much, or cannot be simulated."""
    seen = []

    def fitted(model, one, **_):
        seen.append(one.setting)
        if found is None:
            raise SimulationError("no")
        return fit(model.name, *found[model.name])

    monkeypatch.setattr(elsewhere, "fit_law", fitted)
    monkeypatch.setattr(elsewhere, "effective_samples", lambda *_: 50.0)
    settings = [SimpleNamespace(setting=k) for k in range(1, n + 1)]
    said = elsewhere.needed_at(SMALL, LARGE, settings, SolverOptions())
    return said, seen


def test_a_setting_where_a_weak_stroke_is_missed_needs_the_part(monkeypatch):
    said, _ = asked(monkeypatch, {"small": (0.013, 0.1), "large": (0.003, 0.02)})
    assert said.startswith("setting 1 needs it: MSE 0.013 to 0.003 %")


def test_a_law_in_a_wrong_valley_says_nothing_of_the_part(monkeypatch):
    """Its own starts led there; from the settings that are compared it is as good as the larger."""
    found = {"small": (1.4, 1.4), "large": (0.001, 0.001)}
    beside = []

    def from_compared(law, one, known, _):
        beside.append((law.title, one.setting, list(known)))
        return fit("small", 0.001, 0.001)

    monkeypatch.setattr(elsewhere, "_fitted_beside", from_compared)
    assert asked(monkeypatch, found)[0] == ""
    assert beside == [("small", 1, [9])]
    monkeypatch.setattr(elsewhere, "_fitted_beside", lambda *_: None)
    assert asked(monkeypatch, found)[0].startswith("setting 1 needs it")


@pytest.mark.parametrize("found", [
    {"small": (0.013, 0.019), "large": (0.003, 0.01)},  # too little is left in any stroke
    {"small": (0.013, 0.1), "large": (0.012, 0.1)},  # the part explains nothing
    None,
])  # fmt: skip
def test_other_settings_need_nothing(monkeypatch, found):
    assert asked(monkeypatch, found)[0] == ""


def test_of_many_settings_four_are_asked(monkeypatch):
    found = {"small": (0.013, 0.01), "large": (0.003, 0.01)}
    assert set(asked(monkeypatch, found, n=11)[1]) == {1, 4, 7, 10}
    assert set(asked(monkeypatch, found, n=4)[1]) == {1, 2, 3, 4}


def test_what_is_left_is_held_against_the_force_of_its_stroke():
    velocity = np.array([1.0, 1.0, -1.0, -1.0])
    force, rest = np.array([500.0, 500.0, -200.0, -200.0]), np.array([5.0, -5.0, 4.0, -4.0])
    assert worst_stroke(force, rest, velocity) == pytest.approx(100.0 * (4.0 / 200.0) ** 2)


def test_a_force_near_nothing_is_held_against_a_fifth_of_half_the_range():
    velocity = np.array([1.0, -1.0])
    force, rest = np.array([400.0, 0.0]), np.array([0.0, 4.0])
    assert worst_stroke(force, rest, velocity) == pytest.approx(100.0 * (4.0 / 40.0) ** 2)


def test_a_force_at_a_speed_is_held_against_that_of_its_speed() -> None:
    """Twelve speeds a stroke, from a third of the highest on."""
    speed = (np.arange(12) + 0.5) / 12
    velocity = np.concatenate([speed, [1.0], -speed, [-1.0]])
    force = np.where(velocity > 0.0, 400.0, -200.0)
    rest, once = np.zeros(26), np.zeros(26, dtype=np.intp)
    rest[3] = 100.0  # below a third of the highest speed
    assert worst_force(force, rest, velocity, once).worst_percent == 0.0
    velocity[6:8], rest[6:8] = (0.505, 0.575), (8.0, -8.0)  # of one speed
    assert worst_force(force, rest, velocity, once).worst_percent == 0.0
    rest[4] = 8.0
    assert worst_force(force, rest, velocity, once).worst_percent == pytest.approx(2.0)
    rest[13 + 8] = -6.0
    assert worst_force(force, rest, velocity, once).worst_percent == pytest.approx(3.0)
    force[13 + 8] = 10.0  # a fifth of half the range: 60 N
    assert worst_force(force, rest, velocity, once).worst_percent == pytest.approx(10.0)


def cycles(off: list[float], speeds: tuple[float, ...] = (0.5, 0.9)) -> tuple[np.ndarray, ...]:
    """Force, residual, velocity and cycle; in rebound a cycle is off by so much at the first."""
    velocity = np.tile([*speeds, 1.0, -1.0], len(off))
    rest = np.zeros((len(off), len(speeds) + 2))
    rest[:, 0] = off
    cycle = np.repeat(np.arange(len(off)), len(speeds) + 2)
    return np.full(len(velocity), 100.0), rest.ravel(), velocity, cycle


@pytest.mark.parametrize(("scatter", "sure"), [(1.85, 3.0), (1.9, 0.0)])
def test_a_stroke_is_off_by_more_than_its_cycles_scatter(scatter, sure) -> None:
    """Two cycles that differ by 2 scatter: the mean of them has this scatter as its error."""
    found = worst_force(*cycles([3.0 - scatter, 3.0 + scatter]))
    assert found == (pytest.approx(3.0), pytest.approx(sure))
    force, rest, velocity, cycle = cycles([3.0, 3.0])
    rest[[1, 5]] = -scatter, scatter  # all speeds of a stroke count together
    assert worst_force(force, rest, velocity, cycle).sure_percent == pytest.approx(sure)


def test_where_a_stroke_has_one_speed_or_one_cycle_nothing_is_sure() -> None:
    """A triangle's force is in the MSE; of one cycle no scatter is known."""
    assert worst_force(*cycles([3.0])) == (pytest.approx(3.0), 0.0)
    force, rest, velocity, cycle = cycles([3.0, 3.0], speeds=(0.95, 0.97))
    assert worst_force(force, rest, velocity, cycle) == (pytest.approx(1.5), 0.0)
    velocity[[0, 4]] = 0.5
    assert worst_force(force, rest, velocity, cycle).sure_percent > 0.0


def test_a_speed_that_one_cycle_passed_is_left_out_of_what_is_sure() -> None:
    force, rest, velocity, cycle = cycles([3.0, 3.0], speeds=(0.5, 0.7, 0.9))
    velocity[1], rest[1] = 0.8, 8.0
    assert worst_force(force, rest, velocity, cycle) == (pytest.approx(8.0), pytest.approx(3.0))


def test_a_setting_that_is_missed_is_fitted_from_its_own_loops_too(monkeypatch) -> None:
    """From the valves of another it may end in a wrong valley, in which no part shows."""
    starts = []

    def fitted(model, one, *, near, **_):
        starts.append(near)
        found = fit(model.name, 0.001 if near is None else 0.002)
        found.worst_force_percent = 5.0 if left else 0.5
        return found

    monkeypatch.setattr(elsewhere, "fit_law", fitted)
    monkeypatch.setattr(elsewhere, "nearest_setting", lambda *_: 7)
    monkeypatch.setattr(elsewhere, "lent", lambda own, *_: own)
    known = fit("law", 0.001)
    known.setting, known.values = 7, TwinTube().values(dict.fromkeys(TwinTube().names, 3.0))
    left = True
    asked = Tried("law", (known,)), [SettingLogs(1, ())], SolverOptions()
    found = elsewhere.worst_missed(*asked)
    assert found is not None
    assert found[1].mse_percent == pytest.approx(0.001)
    assert starts == [known.values, None]
    left = False
    assert elsewhere.worst_missed(*asked) is None
    assert starts == [known.values, None, known.values]


def test_the_setting_that_is_missed_most_is_found_from_the_friction_of_another(monkeypatch) -> None:
    at = {1: 0.5, 2: 3.0, 3: 2.0, 4: None}
    asked_from = []

    def fitted(model, one, **_):
        asked_from.append(dict(one.more_start))
        if at[one.setting] is None:
            raise SimulationError("no")
        found = fit(model.name, 0.001)
        found.worst_force_percent = at[one.setting]
        return found

    monkeypatch.setattr(elsewhere, "fit_law", fitted)
    monkeypatch.setattr(elsewhere, "nearest_setting", lambda *_: 7)
    monkeypatch.setattr(elsewhere, "lent", lambda own, *_: own)
    values = TwinTube().values({one.name: 3.0 for one in TwinTube().quantities})
    known = fit("law", 0.001)
    known.setting, known.values = 7, values
    settings = [SettingLogs(k, ()) for k in at]
    law = Tried("law", (known,))
    one, there = elsewhere.worst_missed(law, settings, SolverOptions())
    assert (one.setting, there.fits[0].worst_force_percent) == (2, 3.0)
    assert asked_from[0]["f_f"] == asked_from[0]["k_s"] == 3.0
    assert not {"rebound_bleed", "compression_opening", "f_0"} & set(asked_from[0])
    known.worst_force_percent = 4.0  # a setting that was compared counts by itself
    one, there = elsewhere.worst_missed(law, [*settings, SettingLogs(7, ())], SolverOptions())
    assert (one.setting, there.fits) == (7, (known,))
    at.update({2: 0.5, 3: 0.5})
    assert elsewhere.worst_missed(law, settings, SolverOptions()) is None
