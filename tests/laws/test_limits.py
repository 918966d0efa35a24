"""Limits by which laws are told apart: a case just inside and one just outside."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.laws import LawFit, course, law_fit, missed
from damperfit.laws.physics import _where
from damperfit.simulation import SolverOptions
from damperfit.tested.setting import Setting
from tests import fakes


def tried(mse: float, *, score: float = 0.0, name: str = "twin_tube") -> SimpleNamespace:
    model = SimpleNamespace(name=name)
    return SimpleNamespace(mse_percent=mse, score=score, fits=(SimpleNamespace(model=model),))


@pytest.mark.parametrize(("gain", "parts"), [(1.09, "a"), (1.11, "ab")])
def test_a_part_that_gains_a_tenth_is_offered_again_beside_another(
    monkeypatch, gain, parts
) -> None:
    """Friction that is larger at rest shows beside one that builds up over a distance."""

    def law(parts: str) -> SimpleNamespace:
        return SimpleNamespace(parts=parts, leaves_something=True, mse_percent=1.0, score=0.0)

    def verdict(small: SimpleNamespace, large: SimpleNamespace, _: float) -> SimpleNamespace:
        new = large.parts[-1]
        is_worth = new == "a" or (new == "b" and "a" in small.parts)
        return SimpleNamespace(takes_larger=is_worth, gain=3.0 if is_worth else gain, reason="")

    monkeypatch.setattr(course, "judged", verdict)
    monkeypatch.setattr(course, "valve_damper", lambda one: one)
    monkeypatch.setattr(course, "words_of", lambda _, name: name)
    steps = course.Course([], SolverOptions(), lambda _: None, 1)
    monkeypatch.setattr(steps, "back_from", lambda one, _: one)
    monkeypatch.setattr(steps, "record", lambda *_, **__: None)
    monkeypatch.setattr(course, "with_strokes_told", lambda _, one, __: one)
    monkeypatch.setattr(
        steps, "offered",
        lambda one, name: None if name in one.parts else law(one.parts + name),
    )  # fmt: skip
    assert steps.enriched(law(""), ["b", "a", "c"]).parts == parts


def test_a_held_out_log_is_judged_with_an_offset_of_its_own(monkeypatch) -> None:
    trace = fakes.trace(1)
    model = SimpleNamespace(force=trace.force + 9.0)
    monkeypatch.setattr(missed, "compare", lambda *_, **__: model)
    asked = (None, None, [trace], SolverOptions())
    assert missed.misses(*asked).mse_percent > 0.0
    own = missed.misses(*asked, has_own_offsets=True)
    assert own.mse_percent == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(("n", "said"), [(3, "at settings 0, 1, 2"), (4, "at 4 of 5 settings")])
def test_three_settings_that_determine_a_number_are_named(n, said) -> None:
    fits = [
        SimpleNamespace(setting=k, undetermined=() if k < n else ("lag",), at_bound=())
        for k in range(5)
    ]
    assert _where(fits, "lag").startswith(f" {said}; the logs of the others")


@pytest.mark.parametrize(("gain", "is_worth_a_fit"), [(1.095, False), (1.105, True)])
def test_a_part_is_worth_a_fit_that_gains_a_tenth_in_a_few_steps(
    monkeypatch, gain, is_worth_a_fit
) -> None:
    values = reference_parameters(5)
    short = SimpleNamespace(cost=2.0, extra=values, evaluations=4)
    misfit = SimpleNamespace(
        model=SimpleNamespace(start=lambda *_: [values]), traces=(), free=("r_m1",),
        glimpse=lambda _: short, cost=lambda _: gain * 2.0, is_at_edge=lambda *_: False,
    )  # fmt: skip
    misfit.on_cycles = lambda: misfit
    monkeypatch.setattr(law_fit, "_misfit", lambda *_: ({}, misfit))
    monkeypatch.setattr(law_fit, "_beside", lambda *_: ({}, {}))
    near = LawFit(
        Setting.of(5), PURDY_DAMPER, values, (), (), 3.0 * gain, (), float("nan"), "", (), 1
    )
    found = law_fit.glimpsed(PURDY_DAMPER, SimpleNamespace(), near)
    assert (found is None) is is_worth_a_fit
    if found is not None:
        assert (found.mse_percent, found.evaluations) == (pytest.approx(3.0), 4)
