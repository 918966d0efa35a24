"""Cycles, turns, passages and what the core reads off motions."""

import numpy as np
import pytest

from damperfit.compiled_core import compiled_core
from damperfit.conditioning import apply_filter, design_filter
from damperfit.conditioning.cycles import crossings, cycles_of, tops_of, turning_points
from damperfit.conditioning.delay import _REACH, _scan, _without_smooth
from damperfit.passed_speeds import in_both_strokes
from tests.oracles import cycles as slow

# What the compiled core reads off motions, beside its slow twins.

RANDOM = np.random.default_rng(14)


def motion(n: int, period: float, noise: float, drift: float = 0.0):
    """A wave that may wander, its slope by sample, and noise on both."""
    angle = 2.0 * np.pi * np.arange(n) / period + RANDOM.uniform(0.0, 6.0)
    x = np.sin(angle) * (1.0 + drift * np.arange(n) / n) + 0.3 * drift * np.arange(n) / n
    v = 2.0 * np.pi / period * np.cos(angle)
    return x + noise * RANDOM.standard_normal(n), v + noise * RANDOM.standard_normal(n)


MOTIONS = [
    (400, 37.3, 0.0, 0.0),
    (2000, 111.1, 0.01, 0.2),
    (900, 20.0, 0.3, 0.0),
    (60, 500.0, 0.1, 0),
]


@pytest.mark.parametrize("of", MOTIONS)
@pytest.mark.parametrize("reach", [0.0, 0.02, 0.5, 9.0])
def test_turns_and_passages_are_those_of_the_slow_twin(of, reach: float) -> None:
    x, _ = motion(*of)
    x = np.round(x, 2)  # equal samples in a row, too
    turns = turning_points(x, reach)
    assert np.array_equal(turns, slow.turning_points(x, reach))
    seen = cycles_of(x)
    expected = slow.passages(x, slow.turning_points(x, 0.02 * np.ptp(x)))
    assert np.allclose(seen.passages, expected, rtol=1e-12)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("period", "phase"), [(37.3, 0.4), (100.0, 0.0), (8.1, 2.0)])
def test_crossings_and_tops_of_a_sine_are_where_they_are_known(sign, period, phase) -> None:
    """Behind a first turn beyond the hysteresis, with the error of the cubic piece."""
    k, turn = np.arange(600), 2.0 * np.pi / period
    x, v = 0.2 + np.sin(turn * k + phase), turn * np.cos(turn * k + phase)
    found = crossings(x, v, 0.25, level=0.2, sign=sign)
    known = (np.pi * np.arange(200) - phase) / turn
    known = known[np.sign(np.cos(turn * known + phase)) == sign]
    low = known[(known > 0.8 * period) & (known < 598.0 - 0.2 * period)]
    error = turn**3 / 50.0
    assert np.abs(found[:, None] - low).min(axis=0).max() < error
    assert np.diff(found) == pytest.approx(period, abs=2.0 * error)
    tops = tops_of(x, v, found, 0.2, sign=sign)
    assert tops == pytest.approx(1.0, abs=turn**4 / 100.0)
    assert not len(crossings(x, v, 1.1, level=0.2, sign=sign))


@pytest.mark.parametrize("kink", [None, 1e-3])
@pytest.mark.parametrize("width", [0.0, 1e-4, 1e-3, 8e-3])
def test_steps_are_those_laid_on_one_by_one(width: float, kink: float | None) -> None:
    lag = np.round(RANDOM.uniform(-0.02, 0.02, 300), 4)  # some on a delay, some twice
    lag = np.sort(lag)
    force = RANDOM.standard_normal(300) + 40.0 * lag
    side = _without_smooth(lag, force, kink=kink)
    basis, rest = slow.without_smooth(lag, force, _REACH, kink)
    columns = side.columns[:, :-1]
    assert np.allclose(columns.T @ columns, np.eye(columns.shape[1]), rtol=0.0, atol=1e-13)
    assert np.allclose(side.columns[:, -1], rest, rtol=0.0, atol=1e-12)
    assert side.power == pytest.approx(rest @ rest, rel=1e-12)
    delays = np.arange(-0.01, 0.0101, 5e-4).round(4)
    scan = _scan([side, side], delays, width=width)
    left, heights = slow.steps_left(lag, basis, rest, delays, width)
    assert scan.rest == pytest.approx(2.0 * np.array(left), rel=1e-10)
    assert scan.jumps[1] == pytest.approx(np.array(heights), rel=1e-8, abs=1e-12)
    assert np.array_equal(scan.jumps[0], -scan.jumps[1])


@pytest.mark.parametrize("rows", [2, 3, 4, 5])
def test_signals_side_by_side_are_filtered_as_each_alone(rows: int) -> None:
    design = design_filter("zero_phase", 30.0, sample_rate=500.0)
    signals = RANDOM.standard_normal((rows, 400))
    alone = np.stack([apply_filter(design, one) for one in signals])
    assert np.array_equal(apply_filter(design, signals), alone)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("of", MOTIONS)
def test_signals_at_speeds_are_those_of_the_slow_twin(of, sign: float) -> None:
    signal, v = motion(*of)
    v = np.round(v, 3)  # samples that lie on a speed, too
    speeds = (-0.05, 0.0, float(abs(v[3])), 0.4, 9.0)
    both = np.stack([signal, signal**2])
    passed = in_both_strokes(v, both, sorted(speeds), signs=(sign,))
    counts, means, squares = (of_signs[0] for of_signs in passed)
    for k, speed in enumerate(sorted(speeds)):
        for row, of_row in enumerate(both):
            for way, seen in enumerate(slow.at_speed(sign * v, of_row, speed)):
                assert counts[way, k] == len(seen)
                if not seen:
                    assert np.isnan(means[way, k, row])
                    continue
                assert means[way, k, row] == pytest.approx(np.mean(seen), rel=1e-12, abs=1e-12)
                about = len(seen) * np.var(seen)
                assert squares[way, k, row] == pytest.approx(about, rel=1e-9, abs=1e-12)


# Sizes of the buffers that fit each other, and what comes behind them.
BUFFERS = {
    "turns": ((9, 9), (0.1,)),
    "without_smooth": ((9, 9, 45, 50), (1.0, 0.0)),
    "steps": ((9, 45, 50, 3, 3, 3, 9), (1.0, 0.0, 0.1)),
    "at_speeds": ((9, 1, 18, 2, 4, 4), (1.0,)),
    "spline_slopes": ((5, 5, 5), ()),
    "between": ((16, 2, 4), (2,)),
    "behind_lag": ((6, 6), (2, 0.5, 0.3, 0.2)),
    "run_filter": ((6, 2, 9, 9, 9), (1, 0, 0)),
}


@pytest.mark.parametrize("name", BUFFERS)
def test_a_buffer_of_another_size_is_refused(name: str) -> None:
    sizes, others = BUFFERS[name]
    call = getattr(compiled_core(), name)
    kinds = [np.int64 if (name, k) == ("turns", 1) else np.float64 for k in range(len(sizes))]
    buffers = [np.ones(n, kind) for n, kind in zip(sizes, kinds, strict=True)]
    call(*buffers, *others)
    for k in range(1 if name == "turns" else 0, len(sizes)):
        with pytest.raises(ValueError, match=name):
            call(*buffers[:k], buffers[k][1:].copy(), *buffers[k + 1 :], *others)
