"""Which setting gives a force: between clicks, exactly, twice, never."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from damperfit.adjustment.clicks import which_setting
from damperfit.adjustment.force_at import Force, Sine, Stage
from damperfit.damper.rivals import Bilinear
from damperfit.errors import ConfigurationError
from damperfit.queries.settings import Question, tabulate_forces
from damperfit.tested.setting import Setting, lines_of
from damperfit.uncertainty import SpeedForces
from tests.adjustment import gap_coverage
from tests.fakes import run_of


def forces_by_click(forces, *, settings=None, error=0.5, stroke="rebound"):
    settings = settings or range(1, len(forces) + 1)
    return [
        Force(setting, 0.2, stroke, float(force), error, error, np.zeros(0))
        for setting, force in zip(settings, forces, strict=True)
    ]


def test_between_two_clicks_with_the_interval_of_the_force() -> None:
    (answer,) = which_setting(forces_by_click([100, 200, 300, 400], error=2.0), 250.0).answers
    assert answer.position == pytest.approx(2.5)
    assert answer.high - 2.5 == pytest.approx(1.96 * 2.0 / 100.0, rel=1e-3)
    assert 2.5 - answer.low == pytest.approx(1.96 * 2.0 / 100.0, rel=1e-3)
    assert (answer.below, answer.above, answer.force_below, answer.force_above) == (2, 3, 200, 300)


@pytest.mark.parametrize(
    ("forces", "wanted", "positions", "words"),
    [
        ([100, 200, 300], 200.0, [2.0], "setting 2 (95 % within 0.01), which gives 200 N"),
        ([100, 200, 300], 500.0, [], "more than the hardest, setting 3 with 300 N"),
        ([100, 200, 300], 50.0, [], "less than the weakest"),
        ([-100, -200, -300], -150.0, [1.5], ""),
        ([-100, -200, -300], -400.0, [], "more than the hardest, setting 3"),
        ([-100, -200, -300], -10.0, [], "less than the weakest, setting 1"),
        ([400, 300, 200, 100], 250.0, [2.5], ""),
        ([100, 300, 150, 400], 200.0, [1.5, 2.5, 3.5], "3 answers"),
        ([100, 200, 300], 300.9, [3.0], ""),  # beyond the last, but within its interval
    ],
)
def test_a_force_is_found_wherever_the_curve_passes_it_or_out_of_reach(
    forces, wanted, positions, words
) -> None:
    stroke = "bump" if forces[0] < 0 else "rebound"
    found = which_setting(forces_by_click(forces, stroke=stroke), wanted)
    assert [one.position for one in found.answers] == pytest.approx(positions, abs=0.25)
    assert words in found.sentence
    for one in found.answers:
        assert one.low <= one.position <= one.high
        assert one.below <= one.position <= one.above


def test_a_gap_widens_the_interval_and_is_named() -> None:
    curved = [100.0, 110.0, 400.0]
    near = which_setting(forces_by_click(curved, settings=(1, 2, 3)), 250.0).answers[0]
    beside = which_setting(forces_by_click(curved, settings=(1, 2, 4)), 250.0).answers[0]
    assert beside.high - beside.low > 3.0 * (near.high - near.low)  # one setting in between
    far = which_setting(forces_by_click(curved, settings=(1, 2, 12)), 250.0)
    assert far.answers[0].high - far.answers[0].low > 10.0 * (near.high - near.low)
    assert "none tested between them" in far.sentence


def test_two_settings_tell_no_curve_between_them() -> None:
    """The interval was 0.01 clicks wide; 3 of 1000 such held the truth."""
    wanted = which_setting(forces_by_click([100, 200], settings=(2, 10)), 150.0)
    (answer,) = wanted.answers
    assert (answer.low, answer.position, answer.high) == (2.0, pytest.approx(6.0), 10.0)
    assert "setting 6.00 (anywhere from 2 to 10: two settings do not show how" in wanted.sentence
    beside = which_setting(forces_by_click([100, 110], error=50.0), 105.0)
    assert (beside.answers[0].low, beside.answers[0].high) == (1.0, 2.0)
    assert "setting 1.50 (95 % from 1.00 to 2.00)" in beside.sentence  # no setting between them
    (beside,) = which_setting(forces_by_click([100, 200], settings=(2, 3)), 150.0).answers
    assert beside.high - beside.low < 0.03


def test_intervals_over_gaps_hold_the_setting_that_was_left_out() -> None:
    for count in (3, 5, 10):
        held, asked = gap_coverage.covered(count, draws=8)
        assert 0.93 <= held / asked <= 0.99, count


@pytest.mark.parametrize(
    ("force", "words"),
    [
        # 13.2 of settings 10 and 14; the force is nearer to that of 14.
        (180.0, "nearest is 13, nearest tested 14 (+20 N)"),
        (190.0, "nearest tested is 14 (+10 N)"),
        (110.0, "nearest tested is 10 (-10 N)"),
    ],
)
def test_the_nearest_click_is_named_also_where_it_was_not_tested(force, words) -> None:
    wanted = which_setting(forces_by_click([100, 200], settings=(10, 14)), force)
    assert wanted.sentence.endswith(words)
    tested = which_setting(forces_by_click([100, 200], settings=(10, 11)), force)
    assert re.search(r"; nearest is 1[01] \([+-][12]0 N\)$", tested.sentence)


def test_the_nearest_click_of_several_adjusters_is_a_label() -> None:
    pairs = [Setting((("rebound", r), ("compression", 8))) for r in (10, 14)]
    (line,) = lines_of(pairs)
    wanted = which_setting(forces_by_click([100, 200], settings=pairs), 180.0, line=line)
    assert wanted.sentence.endswith("nearest is R13 C8, nearest tested R14 C8 (+20 N)")


def test_without_errors_there_is_no_interval() -> None:
    wanted = which_setting(forces_by_click([100, 200], error=math.nan), 150.0)
    assert math.isnan(wanted.answers[0].low)
    assert "95 %" not in wanted.sentence


@pytest.mark.parametrize("force", np.linspace(101.0, 399.0, 7))
def test_the_curve_never_leaves_its_neighbours(force) -> None:
    forces = [100.0, 101.0, 390.0, 400.0]
    (answer,) = which_setting(forces_by_click(forces), force).answers
    assert forces[answer.below.cell - 1] <= force <= forces[answer.above.cell - 1]


def test_a_force_is_asked_of_two_settings_at_least() -> None:
    model = Bilinear()
    told = tuple(
        Stage(Setting.of(n), model.values({"c_r": 1000.0 * n, "c_b": 1000.0, "f_0": 0.0}))
        for n in (1, 2)
    )
    run = run_of(told, model, Sine(0.032, 1.5))
    question = Question(0.1, force=150.0, stroke="rebound")
    (wanted,) = tabulate_forces(run, question).wanted
    assert [answer.position for answer in wanted.answers] == pytest.approx([1.5])
    with pytest.raises(ConfigurationError, match="one setting is not enough"):
        tabulate_forces(run_of(told[:1], model, Sine(0.032, 1.5)), question)


def test_a_force_that_the_measured_ones_hold_is_answered_as_measured() -> None:
    """ "No setting gives 2200 N" stood beside a measured 2212 N."""
    model = Bilinear()
    stages = tuple(
        Stage(Setting.of(n), model.values({"c_r": 1000.0 * n, "c_b": 1000.0, "f_0": 0.0}))
        for n in (1, 2)
    )
    # Some per cent off, which the errors of the cycles allow.
    measured = tuple(
        SpeedForces(
            Setting.of(n), "rebound", 300.0, (0.05, 0.1), (0.0, 110.0 * n), (9.0, 9.0),
            (0.0, 10.0 * n), (0.0, 0.0), kind="pvp", rounding=(0.0, 0.0),
        )
        for n in (1, 2)
    )  # fmt: skip
    run = run_of(stages, model, Sine(0.032, 1.5), measured)
    question = Question(0.1, force=212.0, stroke="rebound")
    (wanted,) = tabulate_forces(run, question).wanted
    assert "in rebound at 0.1 m/s, as measured: setting 1.9" in wanted.sentence
    (wanted,) = tabulate_forces(run, replace(question, force=180.0)).wanted
    assert "as measured" not in wanted.sentence
    (wanted,) = tabulate_forces(run, replace(question, force=500.0)).wanted
    assert "no setting gives it" in wanted.sentence
