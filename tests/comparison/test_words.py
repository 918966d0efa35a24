"""What a person reads of many lines, and which of them a terminal shows."""

from __future__ import annotations

import pytest

from damperfit.comparison import ComparisonOptions, compare_runs, verdict_of
from damperfit.comparison.reading import (
    Reading,
    Topic,
    compared,
    difference_of,
    outcome_of,
    place_of,
    surely_different,
)
from damperfit.reporting.compared import comparison_force_sheet
from damperfit.tested.setting import Setting
from tests.comparison.runs import measured, run


def _lines(*steps: float, error: float = 1.0) -> tuple:
    return surely_different(
        [
            compared(
                Topic("force", "force", "force", "N", Setting.of(k), 0.26, "bump"),
                Reading(-1000.0, error, scale=-800.0),
                Reading(-1000.0 + step, error, scale=-800.0),
            )
            for k, step in enumerate(steps, start=1)
        ]
    )


def test_the_outcome_counts_what_differs_and_what_chance_would_do() -> None:
    assert outcome_of(_lines(0.1, 0.2), "forces") == "forces: all 2 the same within errors"
    said = outcome_of(_lines(*[0.0] * 39, 3.0), "forces")
    assert said == (
        "forces: no significant difference: 1 of 40 lie outside their 95 % interval, and chance "
        "alone puts 2 there"
    )
    said = outcome_of(_lines(0.0, -80.0, 40.0, 3.2), "forces")
    assert said.startswith(
        "forces: 3 of 4 differ, all of them significantly; most setting 2, 0.26 m/s"
    )
    assert "+10.00 % (" in said
    assert said.endswith("-80.0 N")
    undetermined = outcome_of(_lines(0.0, 0.0, error=100.0), "forces")
    assert undetermined == "forces: cannot be determined (a difference of 35 % would go unnoticed)"


def test_a_line_says_harder_or_softer_and_whether_it_may_be_chance() -> None:
    harder, softer, maybe = (*_lines(-80.0, 40.0), _lines(*[0.0] * 39, 3.0)[-1])
    assert verdict_of(harder) == "different: 10 % harder"
    assert verdict_of(softer) == "different: 5 % softer"
    assert verdict_of(maybe).startswith("different, perhaps by chance: 0.38 % softer")
    topic = Topic("figure", "hysteresis", "hysteresis", "N", Setting.of(3))
    nothing = compared(topic, Reading(0.0, 1.0), Reading(-9.0, 1.0))
    assert verdict_of(nothing) == "different, perhaps by chance: 9 N less"
    assert place_of(topic) == "setting 3, hysteresis"
    # In rebound it is negative: -54 N was "more" than -57 N, by a share of half the force's range.
    for first, second, said in ((-57.0, -54.0, "3 N narrower"), (40.0, 48.0, "8 N wider")):
        topic = Topic("figure", "hysteresis_rebound", "hysteresis, rebound", "N", Setting.of(3))
        line = compared(topic, Reading(first, 0.1, scale=600.0), Reading(second, 0.1, scale=600.0))
        assert verdict_of(line).endswith(f"the loop is {said}")
    assert difference_of(nothing).startswith("-9 N (-11.8 to -6.23)")


@pytest.mark.parametrize(("factor", "n_shown"), [(1.0, 10), (1.2, 10)])
def test_a_terminal_shows_of_many_lines_the_fastest(factor, n_shown) -> None:
    first = run(*(measured(k, noise=1.0, cycles=5) for k in range(1, 6)))
    second = run(*(measured(k, noise=1.0, cycles=5, seed=1, factor=factor) for k in range(1, 6)))
    found = compare_runs(first, second, ComparisonOptions(is_measured=True))
    sheet = comparison_force_sheet(found, is_short=True)
    assert len(comparison_force_sheet(found).rows) == 50
    assert n_shown <= len(sheet.rows) <= 40
    assert ("different" in sheet.notes[-1]) == (factor > 1.0)
