"""Fits that a search is spared: a law that stays hopeless, a layout that was far worse before."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from damperfit.identification.law_misfit import best_of_starts
from damperfit.identification.least_squares import Minimum
from damperfit.laws.search import _Search
from damperfit.simulation import SolverOptions


class Descending:
    """A misfit whose short descents leave 0.5, and whose long ones 0.1."""

    scatter = 0.0
    model = SimpleNamespace(name="made up")

    def __init__(self) -> None:
        self.n_long = 0

    def descend(self, start, stopping):
        is_short = stopping.max_evaluations < 60
        self.n_long += not is_short
        system = SimpleNamespace(cost=0.5 if is_short else 0.1)
        return Minimum(np.ones(1), system, start, 5, 0, 2, np.zeros(1, dtype=bool))


@pytest.mark.parametrize(("hopeless", "cost", "n_long"), [(0.49, 0.5, 0), (0.51, 0.1, 1)])
def test_a_hopeless_descent_ends_after_its_short_ones(hopeless, cost, n_long) -> None:
    misfit = Descending()
    assert best_of_starts(misfit, ["start"], known=1, hopeless=hopeless).cost == cost
    assert misfit.n_long == n_long


def tried(layout: str, percent: float):
    fit = SimpleNamespace(model=layout, free=())
    return SimpleNamespace(fits=(fit,), score=math.log(percent))


@pytest.mark.parametrize(("times", "is_known"), [(7.9, False), (8.1, True)])
def test_a_layout_that_was_far_worse_is_not_fitted_again(times, is_known) -> None:
    course = _Search([], SolverOptions(), lambda _: None, 1)
    law, other = tried("through flow", 0.01), tried("twin tube", 0.01 * times)
    course.record(law, "", is_taken=True)
    course.record(other, "", is_taken=False)
    assert (course.known_worse(law, "twin tube") is other) is is_known
    assert course.known_worse(law, "monotube") is None
