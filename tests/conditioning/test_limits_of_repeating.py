"""Limits by which cycles, runs and what repeats are found: a case just inside, one just outside."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from damperfit.conditioning import (
    compared_part,
    continuation,
    cycles,
    drive,
    motion,
    moving,
    plateaus,
    repeatability,
    stretches,
)
from damperfit.conditioning.channels import noise_of
from damperfit.conditioning.options import ConditionOptions
from damperfit.conditioning.passages import SteadyRun, _repeats, cycles_of, ends_in_motion, runs_of
from damperfit.conditioning.scatter import scatter_between_cycles
from damperfit.errors import ConditioningError
from tests.conditioning.test_limits_of_findings import _log
from tests.conditioning.test_limits_of_findings import cycles as made

OPTIONS = ConditionOptions()
EDGES = stretches.Edges(5)


def swings(n: float, samples: int = 50) -> np.ndarray:
    """n half strokes of a sine, from turn to turn."""
    return -np.cos(np.pi * np.arange(round(n * samples)) / samples)


# Which part is compared


@pytest.mark.parametrize(("beyond", "moves"), [(0.48, True), (0.52, False)])
def test_noise_with_half_its_speed_far_up_is_no_motion(beyond, moves, monkeypatch) -> None:
    monkeypatch.setattr(compared_part, "find_runs", lambda *_, **__: ((), 5))
    monkeypatch.setattr(compared_part, "content_beyond", lambda *_: beyond)
    monkeypatch.setattr(compared_part, "find_moving", lambda *_, **__: ("a motion",))
    seen = SimpleNamespace(log=SimpleNamespace(interval=0.001), displacement=0, velocity=0)
    found, _ = compared_part._several(seen, EDGES, OPTIONS)
    assert bool(found) is moves


@pytest.mark.parametrize(("n", "suffices"), [(2, False), (3, True)])
def test_three_whole_cycles_make_a_test(n, suffices) -> None:
    rising = 100.0 * np.arange(n + 1)
    found = cycles.Cycles(rising, rising + 50.0, 100.0, 0.0, 1.0, n)
    log = SimpleNamespace(force=np.zeros(350), interval=0.01, displacement=np.arange(350.0))
    if suffices:
        assert len(compared_part._window("a.csv", log, found, 0)) >= 2
    else:
        with pytest.raises(ConditioningError, match="found 2 whole steady cycles"):
            compared_part._window("a.csv", log, found, 0)


def test_a_whole_cycle_may_begin_in_mid_cycle() -> None:
    """Between run-in and edges there is one crossing each way, and room for a cycle."""
    rising = 100.0 * np.arange(4)
    found = cycles.Cycles(rising, rising[:-1] + 50.0, 100.0, 0.0, 1.0, 3)
    log = SimpleNamespace(force=np.zeros(310), interval=0.01, displacement=np.arange(310.0))
    assert compared_part._window("a.csv", log, found, 51).tolist() == [151.0, 251.0]
    with pytest.raises(ConditioningError, match="no whole steady cycle is left"):
        compared_part._window("a.csv", log, found, 55)


@pytest.mark.parametrize(("n", "suffices"), [(2, False), (3, True)])
def test_a_short_run_in_the_middle_of_a_log_has_three_cycles(n, suffices, monkeypatch) -> None:
    run = SimpleNamespace(stretch=SimpleNamespace(kind="steady"))
    for name, answer in (
        ("behind_filter", "seen"), ("_cycles", None), ("_edges", EDGES), ("_edge", 5),
        ("_is_one_run", False), ("_one_run", None), ("_several", ((run,), n)), ("_kept", "kept"),
    ):  # fmt: skip
        monkeypatch.setattr(compared_part, name, lambda *_, answer=answer, **__: answer)
    log = SimpleNamespace(force=np.zeros(350), interval=0.01, displacement=np.arange(350.0))
    if suffices:
        assert compared_part.choose_compared("a.csv", log, OPTIONS) == "kept"
    else:
        with pytest.raises(ConditioningError, match="found 0 whole steady cycles"):
            compared_part.choose_compared("a.csv", log, OPTIONS)


@pytest.mark.parametrize("at", [0, -1])
@pytest.mark.parametrize(("off", "is_of_it"), [(0.0, True), (30.0, False), (-30.0, False)])
def test_a_passage_beside_a_run_is_of_it_where_it_is_a_cycle_off(at, off, is_of_it) -> None:
    rising = 100.0 * np.arange(1, 5)
    run = SimpleNamespace(begin=-math.inf, end=math.inf, boundaries=rising, period=100.0)
    falling = 50.0 + 100.0 * np.arange(5)
    falling[at] += off
    kept, begin, end = cycles._of_run(falling, run, 0.05)
    assert len(kept) == (5 if is_of_it else 4)
    assert begin == (100.0 if at == 0 and not is_of_it else -math.inf)
    assert end == (400.0 if at == -1 and not is_of_it else math.inf)


# A log continued by its own cycles


@pytest.mark.parametrize(("more", "is_continued"), [(2, False), (3, True)])
def test_a_log_is_continued_for_more_cycles_only(more, is_continued, monkeypatch) -> None:
    def found(n):
        return stretches.FoundStretch(SimpleNamespace(n_cycles=n), -math.inf, math.inf)

    log = SimpleNamespace(displacement=None, interval=0.01)
    seen = SimpleNamespace(log=log, displacement=None, velocity=None)
    longer = SimpleNamespace(log=log, first=10, stop=90)
    monkeypatch.setattr(compared_part, "ends_in_motion", lambda *_: ("a run", None))
    monkeypatch.setattr(compared_part, "continue_log", lambda *_, **__: longer)
    monkeypatch.setattr(compared_part, "behind_filter", lambda *_: seen)
    monkeypatch.setattr(compared_part, "_edge", lambda _: 5)
    monkeypatch.setattr(compared_part, "_edges", lambda _: EDGES)
    monkeypatch.setattr(compared_part, "find_runs", lambda *_, **__: ((found(more),), more))
    monkeypatch.setattr(
        compared_part,
        "_kept",
        lambda seen, runs, n, cycles: compared_part.ComparedPart(
            seen, runs, n, cycles, slice(0, 9)
        ),
    )
    made = compared_part._continued("a.csv", seen, (found(2),), 2, None, OPTIONS)
    assert (made is not None) is is_continued


def settled(force, length=200.0, *, off, at):
    force = force.copy()
    force[at] += off
    return continuation._settled(force, length)


@pytest.mark.parametrize(("off", "run_in"), [(3.8, 0), (4.2, 10)])
def test_a_beginning_differs_by_a_fiftieth_of_the_range(off, run_in) -> None:
    wave = 100.0 * np.sin(2.0 * np.pi * np.arange(800) / 200.0)
    assert settled(wave, off=off, at=slice(0, 10)) == run_in


@pytest.mark.parametrize(("share", "run_in"), [(5.8, 0), (6.2, 10)])
def test_a_beginning_differs_by_six_deviations(share, run_in) -> None:
    noise = np.tile(np.random.default_rng(1).standard_normal(2000), 4)
    off = share * math.sqrt(2.0) * noise_of(noise)
    assert settled(noise, 2000.0, off=off, at=slice(0, 10)) == run_in


@pytest.mark.parametrize(("first", "run_in"), [(3, 21), (4, 0)])
def test_a_beginning_begins_with_the_log(first, run_in) -> None:
    wave = 100.0 * np.sin(2.0 * np.pi * np.arange(800) / 200.0)
    assert settled(wave, off=20.0, at=slice(first, 21)) == run_in


@pytest.mark.parametrize(("rows", "run_in"), [(88, 88), (89, 89), (90, 0), (92, 0)])
def test_what_differs_for_most_of_half_a_cycle_is_no_beginning(rows, run_in) -> None:
    wave = 100.0 * np.sin(2.0 * np.pi * np.arange(800) / 200.0)
    assert settled(wave, off=20.0, at=slice(0, rows)) == run_in


@pytest.mark.parametrize(("length", "run_in"), [(16, 5), (14, 0)])
def test_a_beginning_is_looked_for_in_eight_samples_at_least(length, run_in) -> None:
    wave = 100.0 * np.sin(2.0 * np.pi * np.arange(20 * length) / length)
    assert settled(wave, float(length), off=200.0, at=slice(0, 5)) == run_in


# Cycles


@pytest.mark.parametrize(("height", "period"), [(0.24, 200.0), (0.26, 100.0)])
def test_a_crossing_counts_that_leaves_a_quarter_of_the_amplitude(height, period) -> None:
    """Between its strokes the motion goes to and fro about the middle, by so much of them."""
    half = np.sin(np.pi * np.arange(80) / 80.0)
    small = height * np.sin(np.pi * np.arange(20) / 20.0)
    x = np.tile(np.concatenate([half, -small, small, -half]), 8)
    found = cycles._steady_run(x, np.gradient(x), 0.0, cycles._HYSTERESIS, 0.05)
    assert found.period == pytest.approx(period)


@pytest.mark.parametrize(("alike", "is_run"), [(10, False), (11, True)])
def test_a_run_is_a_tenth_of_all_cycles(alike, is_run, monkeypatch) -> None:
    periods = np.full(109, 100.0)
    periods[alike:] = np.where(np.arange(109 - alike) % 2, 50.0, 150.0)
    marks = np.concatenate([[0.0], np.cumsum(periods)])
    monkeypatch.setattr(cycles, "crossings", lambda *_, **__: marks)
    monkeypatch.setattr(cycles, "_tops", lambda *_, **__: np.ones(109))
    found = cycles._steady_run(np.zeros(1), np.zeros(1), 0.0, 0.0, 0.05)
    assert (found is not None) is is_run


# What drives the model


def stretch_of(n: int = 4, samples: int = 100):
    one = made(n).fastest
    return replace(one, stop=n * samples, cycle_starts=samples * np.arange(n + 1.0))


@pytest.mark.parametrize(("lost", "is_wider"), [(0.0029, False), (0.0031, True)])
def test_a_filter_may_take_three_thousandths_of_the_speed(lost, is_wider, monkeypatch) -> None:
    velocity = np.tile([1.0, -1.0], 200)
    motion = np.array([lost**2])
    seen = drive._Spectrum(np.array([100.0]), motion, np.zeros(1))
    monkeypatch.setattr(drive, "_seen", lambda *_: seen)
    corner = drive._corner(velocity, velocity, stretch_of(), OPTIONS, interval=0.001)
    assert (corner > OPTIONS.filter_corner) is is_wider


@pytest.mark.parametrize(("lines", "alone"), [(7, False), (8, True)])
def test_eight_lines_tell_the_noise_of_an_order(lines, alone) -> None:
    table = np.zeros((5, lines))
    table[2] = 1.0
    assert (drive._between_orders(table).tolist() == [0.0, 0.0, 1.0, 0.0, 0.0]) is alone


@pytest.mark.parametrize(("share", "moves"), [(7.7, False), (8.3, True)])
def test_a_line_of_the_motion_stands_eight_times_above_the_noise(share, moves, monkeypatch) -> None:
    """Amplitude a has the power a^2/2."""
    monkeypatch.setattr(drive, "_between_orders", lambda lines: np.full(len(lines), 1.0))
    rest = math.sqrt(2.0 * share) * np.sin(2.0 * np.pi * np.arange(401) / 100.0)
    seen = drive._of_cycles(rest, stretch_of())
    assert bool(seen.motion[4] > 0.0) is moves


# Findings of the motion


@pytest.mark.parametrize(("share", "n"), [(0.0195, 0), (0.0205, 1)])
def test_two_per_cent_beyond_half_the_rigs_corner_are_told(share, n, monkeypatch) -> None:
    monkeypatch.setattr(motion, "content_beyond", lambda *_: share)
    options = ConditionOptions(rig_filter="causal")
    assert len(list(motion._drive(made(4), options))) == n


@pytest.mark.parametrize(("samples", "n"), [(19.5, 0), (20.5, 1)])
def test_noise_is_told_from_motion_at_twenty_samples_a_cycle(samples, n) -> None:
    trace = made(4)
    trace = replace(trace, interval=1.0 / (trace.frequency * samples))
    assert len(list(motion._displacement_noise(_log(trace), trace, OPTIONS))) == n


@pytest.mark.parametrize(("share", "severity"), [(0.34, "note"), (0.36, "warning")])
def test_noise_of_a_third_of_a_per_cent_of_the_speed_counts(share, severity, monkeypatch) -> None:
    trace = made(4)
    passed = 30.0 / math.sqrt(3.0) * math.sqrt(2.0 * 30.0 * trace.interval)
    noise = 0.01 * share * trace.frequency * trace.amplitude / passed
    monkeypatch.setattr(motion, "noise_of", lambda _: noise)
    (found,) = motion._displacement_noise(_log(trace), trace, OPTIONS)
    assert found.severity == severity
    assert f"{share:g} % of the peak velocity" in found.sentence


# Motion that does not repeat


def moved(x, v=None):
    v = np.gradient(x, 0.01) if v is None else v
    return moving.find_moving(x, v, interval=0.01, edges=EDGES)


@pytest.mark.parametrize(("turns", "n"), [(7, 0), (8, 1)])
def test_a_motion_has_eight_turns(turns, n) -> None:
    x = swings(turns - 0.5)
    assert len(moved(x)) == n


@pytest.mark.parametrize(("half", "run_in"), [(0.95, 1.9), (1.05, 2.0)])
def test_the_run_in_is_a_cycle_and_no_longer_than_two_seconds(half, run_in) -> None:
    (found,) = moved(swings(12, round(100.0 * half)))
    assert 0.01 * (found.stretch.first - 5) == pytest.approx(run_in, abs=0.015)


@pytest.mark.parametrize(("share", "n"), [(0.019, 2), (0.021, 1)])
def test_a_fiftieth_of_the_fastest_speed_is_rest(share, n) -> None:
    x = swings(20)
    v = np.where(np.arange(1000) % 2, 1.0, -1.0)
    v[470:530] = share
    assert len(moved(x, v)) == n


def test_a_shove_between_two_motions_does_not_end_the_search() -> None:
    one = swings(20)
    shove = one[-1] + np.concatenate([np.zeros(80), np.linspace(0.0, 0.5, 40), np.full(80, 0.5)])
    first, second = moved(np.concatenate([one, shove, shove[-1] + 1.0 + swings(20)]))
    assert first.stretch.stop <= len(one) < len(one) + len(shove) <= second.stretch.first
    # What the log does not hold may have been the same motion.
    assert (first.begin, second.end) == (-math.inf, math.inf)
    assert first.stretch.stop <= first.end <= len(one) + 1
    assert len(one) + 199 <= second.begin <= second.stretch.first


# Passages and runs


@pytest.mark.parametrize(("turns", "n"), [(4, 0), (5, 1)])
def test_a_run_has_three_passages_at_which_a_cycle_begins(turns, n) -> None:
    x = swings(turns + 1)  # the first and the last turn are the log's ends
    seen = cycles_of(x)
    assert len(seen.passages) == turns
    assert len(list(runs_of(seen, 0.05, near=1.0))) == n


@pytest.mark.parametrize(("ripple", "counts"), [(0.019, False), (0.021, True)])
def test_a_turn_goes_back_by_a_fiftieth_of_the_range(ripple, counts) -> None:
    x = np.concatenate([np.linspace(0, 1, 50), np.linspace(1, 0, 50), np.linspace(0, 0.5, 50)])
    back = np.concatenate([x, [0.5 - ripple], np.linspace(0.5, 1, 50), np.linspace(1, 0, 50)])
    assert (len(cycles_of(back).passages) > 3) is counts


RUN = SteadyRun(80.0, 900.0, 100.0, 1.0, 0.0)


@pytest.mark.parametrize(("ahead", "repeats"), [(79.0, True), (81.0, False)])
def test_four_fifths_of_a_cycle_may_be_ahead_of_a_run(ahead, repeats) -> None:
    assert _repeats(np.tile(swings(2), 10), ahead, RUN) is repeats


@pytest.mark.parametrize(("off", "repeats"), [(0.096, True), (0.104, False)])
def test_what_is_ahead_of_a_run_is_alike_within_a_tenth(off, repeats) -> None:
    x = np.tile(swings(2), 10)
    x[3] += off
    assert _repeats(x, 60.0, RUN) is repeats


@pytest.mark.parametrize(("gone", "keeps"), [(0.58, True), (0.62, False)])
def test_a_level_drifts_through_six_tenths_of_its_allowance(gone, keeps) -> None:
    values = 100.0 + np.linspace(-0.5, 0.5, 21) * gone
    assert plateaus._keeps_level(values, 0, 21, 0.01) is keeps


@pytest.mark.parametrize(("length", "is_whole"), [(49, True), (51, False)])
def test_levels_are_the_tests_where_they_are_half_of_a_run(length, is_whole, monkeypatch) -> None:
    monkeypatch.setattr(plateaus, "_parts", lambda *_: [(0, length)])
    values = np.linspace(1.0, 1.0045, 100)
    found = plateaus.level_parts(values, values, fewest=3, steadiness=0.05)
    assert list(found) == [(0, 100) if is_whole else (0, length)]


@pytest.mark.parametrize(("times", "is_one"), [(1.95, True), (2.05, False)])
def test_cycles_without_a_level_wander_by_twice_the_steadiness(times, is_one, monkeypatch) -> None:
    monkeypatch.setattr(plateaus, "_parts", lambda *_: [])
    monkeypatch.setattr(plateaus, "_trimmed", lambda *given: given[2:4])
    period = np.exp(np.linspace(0.0, 0.05 * times, 100))
    found = plateaus.level_parts(period, period, fewest=3, steadiness=0.05)
    assert list(found) == ([(0, 100)] if is_one else [])


@pytest.mark.parametrize(("share", "is_looked_at"), [(0.39, False), (0.41, True)])
@pytest.mark.parametrize("steadiness", [0.05, 0.004])
def test_cycles_within_four_tenths_of_the_least_allowance_are_one_run(
    share, is_looked_at, steadiness, monkeypatch
) -> None:
    looked: list[object] = []
    monkeypatch.setattr(plateaus, "_parts", lambda *seen: looked.append(seen) or [(0, 90)])
    least = min(plateaus._PERIOD, steadiness)
    # The worst case: half at one end of the range, half at the other.
    period = np.repeat([1.0, 1.0 + share * least], 50)
    found = plateaus.level_parts(period, np.ones(100), fewest=3, steadiness=steadiness)
    assert bool(looked) is is_looked_at
    monkeypatch.undo()
    allowed = plateaus._allowed(period, plateaus._PERIOD, steadiness)
    if not is_looked_at:  # what the long way finds as well
        assert list(found) == plateaus._parts(period, np.ones(100), (allowed, 0.02)) == [(0, 100)]
        assert plateaus._keeps_level(period, 0, 100, allowed)


@pytest.mark.parametrize(("off", "n"), [(0.97, 1), (1.03, 2)])
def test_two_hundred_half_cycles_say_the_level(off, n) -> None:
    """A creeping period is cut where it leaves the last 200 of them, half of which is 100.5."""
    creep = np.exp(0.01 * off / 100.5 * np.arange(280))
    parts = plateaus._parts(creep, np.ones(280), (0.01, 0.02))
    assert len(parts) == n


# Runs to stretches


@pytest.mark.parametrize(("passages", "found"), [(19, 0), (21, 1)])
def test_runs_are_the_test_from_a_third_of_all_cycles_on(passages, found, monkeypatch) -> None:
    one = SimpleNamespace(stretch=None)
    monkeypatch.setattr(stretches, "cycles_of", lambda _: SimpleNamespace(passages=np.zeros(60)))
    monkeypatch.setattr(stretches, "runs_of", lambda *_, **__: [(0, passages - 2)])
    monkeypatch.setattr(stretches, "run_of", lambda *_: RUN)
    monkeypatch.setattr(stretches, "_of_run", lambda *_, **__: one)
    runs, _ = stretches.find_runs(
        np.zeros(9), np.zeros(9), interval=0.01, steadiness=0.05, edges=EDGES
    )
    assert len(runs) == found


@pytest.mark.parametrize(
    ("samples", "wanders", "expected"),
    [(3241.0, 0.0, True), (3239.0, 0.0, False), (9e3, 0.49, True), (9e3, 0.51, False)],
)
def test_one_run_is_sure_from_three_cycles_in_their_place_on(
    samples, wanders, expected, monkeypatch
) -> None:
    seen = SimpleNamespace(passages=np.zeros(20), middle=wanders * (np.arange(18) % 2))
    monkeypatch.setattr(stretches, "cycles_of", lambda _: seen)
    monkeypatch.setattr(stretches, "runs_of", lambda *_, **__: [(0, 18)])
    run = SteadyRun(50.0, 50.0 + samples, 1000.0, 1.0, 0.0)
    monkeypatch.setattr(stretches, "run_of", lambda *_: run)
    edges = stretches.Edges(120)
    found = stretches.is_one_run(np.zeros(9), interval=0.01, steadiness=0.05, edges=edges)
    assert found is expected


@pytest.mark.parametrize(
    ("first", "second", "expected"),
    [
        (305, 500, [(100, 300), (305, 500)]),
        (300, 500, [(100, 300), (300, 500)]),
        (299, 500, [(100, 300), (300, 500)]),
        (297, 500, [(100, 300), (300, 500)]),  # the same passage, a little off in both
        (296, 500, [(296, 500)]),  # a cycle that both claim: the longer has it
        (296, 400, [(100, 300)]),
    ],
)
def test_stretches_beside_one_another_share_no_sample(first, second, expected, monkeypatch) -> None:
    ends = {0: (100, 300), 20: (first, second)}
    monkeypatch.setattr(stretches, "cycles_of", lambda _: SimpleNamespace(passages=np.zeros(60)))
    monkeypatch.setattr(stretches, "runs_of", lambda *_, **__: [(0, 20), (20, 40)])
    monkeypatch.setattr(
        stretches, "run_of", lambda _, begin, __: SimpleNamespace(period=100.0, ends=ends[begin])
    )

    def found_in(run, *_, **__):
        one = replace(stretch_of(), first=run.ends[0], stop=run.ends[1])
        return stretches.FoundStretch(one, -math.inf, math.inf)

    monkeypatch.setattr(stretches, "_of_run", found_in)
    runs, _ = stretches.find_runs(
        np.zeros(9), np.zeros(9), interval=0.01, steadiness=0.05, edges=EDGES
    )
    assert [(one.stretch.first, one.stretch.stop) for one in runs] == expected


@pytest.mark.parametrize(("off", "n"), [(4.8, 4), (5.2, 3)])
def test_one_more_passage_is_half_a_hundredth_of_a_cycle_off_at_most(off, n) -> None:
    run = SteadyRun(2000.0, 4000.0, 1000.0, 1.0, 0.0)
    x = np.sin(2.0 * np.pi * np.arange(6000) / 1000.0)
    at = np.array([1000.0 - off, 2000.0, 3000.0, 4000.0])
    assert len(stretches._belonging(at, run, x, moved=0.1)) == n


@pytest.mark.parametrize(("ahead", "n"), [(4.8, 3), (5.2, 2)])
def test_as_many_whole_cycles_count_as_were_logged(ahead, n) -> None:
    """The first passage lies ahead of what was logged, by so many of 1000 samples a cycle."""
    run = SteadyRun(0.0, 3000.0, 1000.0, 1.0, 0.0)
    edges = stretches.Edges(5, first=100.0, stop=2500.0)
    inner = stretches._inner(run, 9000, edges, begin=-math.inf, end=math.inf)
    marks = np.array([100.0 - ahead, 1100.0, 2100.0])
    assert np.count_nonzero((marks >= inner[0]) & (marks <= inner[1])) == n


# Scatter


@pytest.mark.parametrize(("behind", "known"), [(192, True), (193, False)])
def test_eight_phases_tell_a_scatter(behind, known) -> None:
    trace = made(4)
    one = replace(trace.fastest, smeared=(0, behind))
    assert math.isfinite(scatter_between_cycles(trace, one)) is known


@pytest.mark.parametrize(("n", "bends"), [(7, False), (8, True)])
def test_a_trend_of_eight_cycles_may_bend(n, bends) -> None:
    found = repeatability._peaks(1000.0 + 50.0 * np.linspace(0.0, 1.0, n) ** 2)
    assert (found.scatter < 1e-6) is bends


@pytest.mark.parametrize(("f_value", "goes"), [(11.6, False), (12.4, True)])
def test_peaks_go_with_the_cycles_from_twelve_on(f_value, goes) -> None:
    """Five peaks on a line, and a bend of it: 2.5 over 14/3 is F where both are of size 1."""
    bend = np.array([2.0, -1.0, -2.0, -1.0, 2.0]) * math.sqrt(2.5 * 3.0 / 14.0 / f_value)
    found = repeatability._peaks(1000.0 + np.linspace(-1.0, 1.0, 5) + bend)
    assert (found.trend is not None) is goes


@pytest.mark.parametrize(("warmer", "said"), [(0.95, False), (1.05, True)])
def test_a_kelvin_is_told_beside_a_trend_of_the_peaks(warmer, said) -> None:
    one = repeatability._Peaks(1.0, 1.0, (1000.0, 900.0))
    found = repeatability._trend_of_peaks(one, one, (20.0, 20.0 + warmer))
    assert ("while the temperature goes" in found.sentence) is said


@pytest.mark.parametrize(("beside", "said"), [(0.68, True), (0.72, False)])
def test_a_motion_explains_noise_below_seven_tenths_of_the_floor(beside, said, monkeypatch) -> None:
    monkeypatch.setattr(repeatability, "noise_beside_motion", lambda _: beside)
    found = repeatability._noise_floor(made(4), 1.0)
    assert ("but the motion differs too" in found.sentence) is said


@pytest.mark.parametrize(("times", "is_hum"), [(9.5, False), (10.5, True)])
@pytest.mark.parametrize("mains", [50, 60, 120, 300, 360])
def test_a_line_of_the_mains_ten_times_above_its_neighbours_is_hum(mains, times, is_hum) -> None:
    power = np.ones(500)
    power[mains] = times
    kept = drive._without_hum(power, np.arange(500.0))
    assert kept[mains] == (1.0 if is_hum else times)
    power[mains + 9] = 2.0  # what stands beside it, as an order of a motion does
    assert drive._without_hum(power, np.arange(500.0))[mains] == times


@pytest.mark.parametrize(("times", "is_hum"), [(9.5, False), (10.5, True)])
def test_an_order_at_the_mains_ten_times_above_its_neighbours_is_hum(times, is_hum) -> None:
    """Order 25 of 2 Hz, with orders 23, 24, 26 and 27 of a tenth of its power beside it."""
    t = np.arange(2000) / 1000.0
    beside = sum(np.cos(4.0 * np.pi * k * t) for k in (23, 24, 26, 27))
    rest = beside + math.sqrt(times) * np.cos(4.0 * np.pi * 25 * t)
    cycles = 500.0 * np.arange(4.0)
    stretch = replace(stretch_of(3, 500), cycle_starts=cycles, frequency=2.0)
    seen = drive._of_cycles(rest, stretch)
    assert bool(seen.motion[75] == 0.0) is is_hum
    assert seen.motion[72] > 0.0


@pytest.mark.parametrize(("errors", "severity"), [(3.85, "note"), (4.15, "warning")])
def test_a_drift_is_sure_from_four_errors_on(errors, severity, monkeypatch) -> None:
    monkeypatch.setattr(repeatability, "_trend", lambda _: (100.0, 100.0 / errors))
    assert repeatability._force_drift(made(4)).severity == severity
    monkeypatch.setattr(repeatability, "_trend", lambda _: (0.01, 0.01 / errors))
    assert repeatability._stroke_drift(made(4)).severity == severity


def test_the_ends_of_five_passages_are_in_motion() -> None:
    x = np.tile(swings(2), 4)
    assert ends_in_motion(x, 0.05) == (pytest.approx(100.0), pytest.approx(100.0))


def test_behind_a_run_of_no_use_others_are_found(monkeypatch) -> None:
    monkeypatch.setattr(stretches, "runs_of", lambda *_, **__: [(0, 10), (10, 20), (20, 30)])
    monkeypatch.setattr(stretches, "run_of", lambda _, first, __: SimpleNamespace(period=first))
    monkeypatch.setattr(stretches, "_of_run", lambda run, *_, **__: run.period or None)
    monkeypatch.setattr(stretches, "_without_overlap", lambda one, *_: one)
    x = np.tile(swings(2), 8)
    runs, _ = stretches.find_runs(
        x, np.gradient(x, 0.001), interval=0.001, steadiness=0.05, edges=stretches.Edges(0)
    )
    assert runs == (10, 20)


@pytest.mark.parametrize(("later", "n"), [(1.45, 6), (1.55, 5)])
def test_a_filter_moves_a_passage_by_a_millisecond_and_a_half(later, n) -> None:
    """The last stroke is longer by twice as much, and its passage by so much, ms, behind."""
    halves = np.array([50.0] * 14 + [50.0 + 2.0 * later, 50.0])
    edges = np.concatenate([[0.0], np.cumsum(halves)])
    t = np.arange(math.floor(edges[-1]))
    which = np.searchsorted(edges, t, side="right") - 1
    x = -np.cos(np.pi * (t - edges[which]) / halves[which]) * (-1.0) ** which
    (found,), _ = stretches.find_runs(
        x, np.gradient(x, 0.001), interval=0.001, steadiness=0.05, edges=stretches.Edges(0)
    )
    assert found.stretch.n_cycles == n


@pytest.mark.parametrize(("edge", "is_noisy"), [(0.366, True), (0.384, False)])
def test_noise_is_read_between_three_tenths_and_45_hundredths_of_the_rate(edge, is_noisy) -> None:
    """White from an edge on: that is more than half of this band, or less."""
    lines = np.where(np.arange(2001) > 4000.0 * edge, 1.0, 0.0)
    phases = np.exp(2j * np.pi * np.random.default_rng(1).uniform(size=2001))
    seen = drive._of_motion(np.fft.irfft(lines * phases), 1.0)
    level = float(seen.noise[1000] / (2.0 * np.pi * seen.frequency[1000]) ** 2)
    usual = 2.0 / 4000.0**2
    assert (level > 0.01 * usual) is is_noisy


@pytest.mark.parametrize(
    ("gap", "amplitude", "n"), [(2.9, 1.0, 1), (3.1, 1.0, 0), (1.0, 1.0096, 1), (1.0, 1.0104, 0)]
)
def test_a_run_goes_on_that_is_the_same_after_three_cycles(gap, amplitude, n) -> None:
    one = stretch_of()
    more = round(100 * gap)
    other = replace(
        one, first=one.stop + more, stop=2 * one.stop + more, amplitude=amplitude * one.amplitude
    )
    interval = 0.01 / one.frequency
    trace = SimpleNamespace(stretches=(one, other), interval=interval, start_time=0.0)
    assert len(list(motion._broken(trace))) == n


@pytest.mark.parametrize(
    ("kind", "off", "is_off"),
    [("period", 0.96, 0), ("period", 1.04, 1), ("amplitude", 1.92, 0), ("amplitude", 2.08, 1)],
)
def test_a_cycle_is_off_its_level_by_a_hundredth_or_two(kind, off, is_off) -> None:
    values = np.full(40, 100.0)
    values[20] += off
    assert np.count_nonzero(plateaus.off_level(values, kind, 0.05)) == is_off


def test_a_single_passage_is_no_cycle() -> None:
    none = np.empty(0)
    assert stretches._whole(np.array([50.0]), none, 100.0, (10.0, 90.0)) is None
    assert len(stretches._whole(np.array([10.0, 110.0]), none, 100.0, (10.0, 110.0))) == 2


@pytest.mark.parametrize(("lines", "width"), [(199, 1), (200, 2), (299, 2)])
def test_motion_is_sought_in_bands_of_a_hundredth_of_the_spectrum(lines, width) -> None:
    """A single line is spread over its band, less what noise may make of that."""
    rest = np.zeros(2 * lines - 1)
    rest[lines] = 1.0
    tone = rest + np.sin(2.0 * np.pi * 20.0 / len(rest) * np.arange(len(rest)))
    seen = drive._of_motion(tone, 1.0)
    assert len(seen.frequency) == lines
    size = seen.motion[1:] / (2.0 * np.pi * seen.frequency[1:]) ** 2
    assert size[19] == pytest.approx(size[20]) if width == 2 else size[19] != size[20]
    assert np.count_nonzero(np.diff(size) > 1e-9 * size.max()) > 0
