"""Before a valve's part is taken out, settings that laws are not compared at are asked."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from damperfit.errors import SimulationError
from damperfit.laws import elsewhere
from damperfit.laws.choosing import Tried
from damperfit.laws.law_fit import worst_stroke
from damperfit.simulation import SolverOptions


def fit(name, percent, stroke=1.0):
    model = SimpleNamespace(name=name, quantity=lambda _: SimpleNamespace(default=None))
    free = ("bleed",) if name == "small" else ("bleed", "opening")
    return SimpleNamespace(
        model=model, mse_percent=percent, held_out_percent=float("nan"), free=free, at_bound=(),
        worst_stroke_percent=stroke, residuals=(np.zeros(4),),
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
