"""A descent that loses a bleed or a blow-off is no last word: another start is followed."""

from __future__ import annotations

from dataclasses import dataclass, replace

import pytest

from damperfit.errors import SimulationError
from damperfit.identification.law_misfit import best_of_starts


@dataclass(frozen=True)
class Ended:
    """Where a descent ended."""

    place: str
    cost: float
    evaluations: int = 1

    @property
    def point(self):
        return self

    @property
    def extra(self):
        return self.place


@dataclass(frozen=True)
class Valleys:
    """Starts a to d, by cost; a and b lead to one valley, c to another, d to none."""

    ends: dict[str, float]
    at_edge: frozenset[str] = frozenset({"a", "b"})
    free: tuple[str, ...] = ("f_f", "compression_bleed")
    scatter: float = 0.01
    edge: str = "compression_bleed"
    failing: str = ""

    def cost(self, start):
        return float("abcd".index(start))

    def descend(self, start, _stopping):
        if start == self.failing:
            raise SimulationError("no")
        return Ended(start, self.ends[start])

    def is_at_edge(self, start, name):
        return start in self.at_edge and name == self.edge


LOST = Valleys({"a": 0.4, "b": 0.5, "c": 0.04, "d": 0.9})


def test_the_next_best_start_is_followed_where_a_bleed_ran_out_of_its_range():
    ended = best_of_starts(LOST, ["a", "d", "c", "b"])
    assert (ended.point.extra, ended.point.cost) == ("c", 0.04)


@pytest.mark.parametrize("edge", ["rebound_opening", "compression_slope"])
def test_a_blow_off_counts_as_well(edge):
    misfit = replace(LOST, free=(edge,), edge=edge)
    assert best_of_starts(misfit, list("abcd")).point.extra == "c"


@pytest.mark.parametrize("misfit", [
    replace(LOST, at_edge=frozenset()),
    replace(LOST, edge="f_f"),
    replace(LOST, ends=LOST.ends | {"a": 0.015}),  # no more than the cycles differ by
    replace(LOST, ends=LOST.ends | {"c": 0.45}),  # no better
    replace(LOST, failing="c"),
])  # fmt: skip
def test_it_stays_where_nothing_is_lost_or_nothing_better_is_found(misfit):
    assert best_of_starts(misfit, list("abcd")).point.extra == "a"


def test_what_is_hopeless_is_not_followed_to_its_end():
    assert best_of_starts(LOST, list("abcd"), hopeless=0.1).point.extra == "a"


def test_two_starts_leave_no_other():
    assert best_of_starts(LOST, ["a", "b"]).point.extra == "a"
