"""A descent that loses a bleed or a blow-off is no last word: another start is followed."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from types import SimpleNamespace

import pytest

from damperfit.errors import SimulationError
from damperfit.identification import campaign
from damperfit.identification.fit_problem import FitProblem
from damperfit.identification.law_misfit import COMPARING, best_of_starts


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
    """Starts a, b, e, c, d, the best first; the first three lead to one valley, c to another."""

    ends: dict[str, float]
    at_edge: frozenset[str] = frozenset({"a", "b", "e"})
    free: tuple[str, ...] = ("f_f", "compression_bleed")
    scatter: float = 0.01
    deviation: float = 100.0
    edge: str = "compression_bleed"
    failing: str = ""
    model: SimpleNamespace = field(
        default_factory=lambda: SimpleNamespace(
            quantity=lambda name: SimpleNamespace(
                is_offset=name == "f_0", is_friction=False, part=name.rpartition("_")[2]
            )
        )
    )

    def cost(self, start):
        return float("abecd".index(start))

    def descend(self, start, _stopping):
        if start == self.failing:
            raise SimulationError("no")
        return Ended(start, self.ends[start])

    def is_at_edge(self, start, name):
        return start in self.at_edge and name == self.edge


LOST = Valleys({"a": 0.4, "b": 0.5, "e": 0.45, "c": 0.04, "d": 0.9})


def test_the_next_best_start_is_followed_where_a_bleed_ran_out_of_its_range():
    ended = best_of_starts(LOST, ["a", "d", "c", "e", "b"])
    assert (ended.extra, ended.cost) == ("c", 0.04)


@pytest.mark.parametrize("edge", ["rebound_opening", "compression_slope"])
def test_a_blow_off_counts_as_well(edge):
    misfit = replace(LOST, free=(edge,), edge=edge)
    assert best_of_starts(misfit, list("abecd")).extra == "c"


@pytest.mark.parametrize("misfit", [
    replace(LOST, at_edge=frozenset()),
    replace(LOST, edge="f_f"),
    replace(LOST, ends=LOST.ends | {"a": 0.015}),  # no more than the cycles differ by
    replace(LOST, ends=LOST.ends | {"c": 0.45}),  # no better
    replace(LOST, failing="c"),
])  # fmt: skip
def test_it_stays_where_nothing_is_lost_or_nothing_better_is_found(misfit):
    assert best_of_starts(misfit, list("abecd")).extra == "a"


def test_what_is_hopeless_is_not_followed_to_its_end():
    assert best_of_starts(LOST, list("abecd"), hopeless=0.1).extra == "a"


def test_two_starts_leave_no_other():
    assert best_of_starts(LOST, ["a", "b"]).extra == "a"


@dataclass(frozen=True)
class Offset:
    """A start, told by its offset."""

    f_0: float


@dataclass(frozen=True)
class ByOffset(Valleys):
    """The larger the offset, the better a start fits; only a smaller one leads anywhere."""

    free: tuple[str, ...] = ("f_0",)

    def cost(self, start):
        return -start.f_0

    def descend(self, start, _stopping):
        return Ended(start, 0.05 if start.f_0 < 195.0 else 0.5)

    def is_at_edge(self, _start, _name):
        return False


@pytest.mark.parametrize(("other", "ends_at"), [(189.9, 189.9), (190.1, 200.0)])
def test_the_best_start_with_another_offset_is_followed_too(other, ends_at):
    starts = [Offset(one) for one in (199.0, 199.5, other, 200.0)]
    ended = best_of_starts(ByOffset({}), starts)
    assert ended.extra == Offset(ends_at)


@dataclass(frozen=True)
class Deceptive(Valleys):
    """After a few evaluations b looks worse than a; at its end it leaves less."""

    at_edge: frozenset[str] = frozenset()
    at_its_end: float = 0.3

    def descend(self, start, stopping):
        costs = {"a": (0.4, self.at_its_end), "b": (0.5, 0.1), "e": (0.6, 0.6)}[start]
        return Ended(start, costs[stopping is COMPARING])


def test_a_start_that_looks_worse_is_followed_to_its_end_on_request():
    assert best_of_starts(Deceptive({}), list("abe")).extra == "a"
    ended = best_of_starts(Deceptive({}), list("abe"), is_thorough=True)
    assert (ended.extra, ended.cost, ended.evaluations) == ("b", 0.1, 3 + 3)


@pytest.mark.parametrize(("at_its_end", "descents"), [(0.019, 1), (0.021, 3)])
def test_none_is_followed_beside_an_end_that_leaves_what_differs_by_cycle(at_its_end, descents):
    """Twice 0.01."""
    misfit = Deceptive({}, at_its_end=at_its_end)
    ended = best_of_starts(misfit, list("abe"), is_thorough=True)
    assert (ended.extra, ended.evaluations) == ("a", 3 + descents)


def test_a_declared_law_has_its_other_starts_followed(monkeypatch):
    asked = []

    def best(_, starts, **how):
        asked.append((starts, how))
        return Ended("b", 0.1)

    monkeypatch.setattr(campaign, "best_of_starts", best)
    monkeypatch.setattr(FitProblem, "on_cycles", lambda one: replace(one, cycles=object()))
    problem = FitProblem(SimpleNamespace(kinks=1), (), (), None)
    assert campaign._best(problem, ["a", "b"]) == "b"
    assert asked == [(["a", "b"], {"is_thorough": True})]
