"""Limits by which laws are told apart: a case just inside and one just outside."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from damperfit.laws import ladder
from damperfit.laws.physics import _where


def tried(mse: float, *, score: float = 0.0, name: str = "twin_tube") -> SimpleNamespace:
    model = SimpleNamespace(name=name)
    return SimpleNamespace(mse_percent=mse, score=score, fits=(SimpleNamespace(model=model),))


@pytest.mark.parametrize(("mse", "is_kept"), [(1.019, True), (1.021, False)])
def test_a_larger_law_may_fit_worse_by_two_per_cent(monkeypatch, mse, is_kept) -> None:
    large, again = tried(mse), tried(0.9)
    monkeypatch.setattr(ladder, "_freed", lambda _: ())
    course = SimpleNamespace(fitted=lambda *_, **__: again)
    found = ladder._Course.no_worse(course, large, tried(1.0))
    assert found is (large if is_kept else again)


@pytest.mark.parametrize(("n", "said"), [(3, "at settings 0, 1, 2"), (4, "at 4 of 5 settings")])
def test_three_settings_that_determine_a_number_are_named(n, said) -> None:
    fits = [
        SimpleNamespace(setting=k, undetermined=() if k < n else ("lag",), at_bound=())
        for k in range(5)
    ]
    assert _where(fits, "lag").startswith(f" {said}; the logs of the others")
