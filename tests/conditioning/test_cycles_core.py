"""What the compiled core reads off motions, beside its slow twins."""

from __future__ import annotations

import numpy as np
import pytest

from damperfit.compiled_core import compiled_core
from damperfit.conditioning import apply_filter, design_filter
from damperfit.conditioning.channels import Channel, find_spikes, noise_of
from damperfit.conditioning.cycles import _extremes, crossings
from damperfit.conditioning.gas_force import _branches
from damperfit.conditioning.harmonics import harmonic_powers
from damperfit.conditioning.passages import cycles_of, turning_points
from damperfit.conditioning.scatter import _folded
from damperfit.conditioning.skew import _in_order, _steps, _without_smooth
from tests.oracles import cycles as slow

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
@pytest.mark.parametrize("reach", [0.0, 0.05, 0.25, 2.0])
def test_crossings_and_tops_are_those_of_the_slow_twin(of, reach: float) -> None:
    x, v = motion(*of)
    for sign in (1.0, -1.0):
        found = crossings(sign * x, sign * v, reach)
        assert np.array_equal(found, slow.crossings(sign * x, sign * v, reach))
    if len(found) > 1:
        assert np.array_equal(_extremes(x, v, found), slow.tops(x, v, found))


@pytest.mark.parametrize("of", MOTIONS)
@pytest.mark.parametrize("reach", [0.0, 0.02, 0.5, 9.0])
def test_turns_and_passages_are_those_of_the_slow_twin(of, reach: float) -> None:
    x, _ = motion(*of)
    x = np.round(x, 2)  # equal samples in a row, too
    turns = turning_points(x, reach)
    assert np.array_equal(turns, slow.turning_points(x, reach))
    seen = cycles_of(x)
    assert np.array_equal(seen.passages, slow.passages(x, slow.turning_points(x, 0.02 * np.ptp(x))))


def test_a_motion_without_a_turn_has_no_passage() -> None:
    seen = cycles_of(np.linspace(0.0, 1.0, 50) ** 2)
    assert len(seen.passages) <= 1
    assert len(seen.period) == 0


def test_cycles_lie_over_each_other_as_by_the_slow_twin() -> None:
    rows = np.stack([motion(700, 66.6, 0.1)[0] for _ in range(3)])
    # Beyond both ends the outermost four samples are read on.
    starts, phases = -1.5 + 100.2 * np.arange(8), np.arange(50) / 50
    found, lags = _folded(rows, starts, phases)
    twins = [slow.folded(row, starts, phases) for row in rows]
    assert np.allclose(found, [values for values, _ in twins], rtol=0.0, atol=1e-12)
    weights = np.stack([one.ravel() for one in twins[0][1]])
    products = weights @ weights.T
    assert np.allclose(lags, [np.trace(products, k) * (2.0 if k else 1.0) for k in range(4)])


@pytest.mark.parametrize("n", [1, 4, 5, 300])
def test_what_stands_out_is_so_beside_the_median_of_five(n: int) -> None:
    values = np.round(RANDOM.standard_normal(n), 1)
    found = np.empty(n)
    compiled_core().outstanding(values, found)
    assert np.array_equal(found, slow.outstanding(values))


@pytest.mark.parametrize("n", [1, 7, 64, 65, 3000])
def test_harmonics_are_those_of_the_slow_twin(n: int) -> None:
    values = motion(n, 40.0, 0.2)[0] + 5.0
    found = harmonic_powers(values, 1.0 / 40.0, 7)
    expected = slow.harmonic_powers(values, values.mean(), 2.0 * np.pi / 40.0, 7)
    assert np.allclose(found, expected, rtol=1e-10, atol=1e-20)


@pytest.mark.parametrize(
    "values",
    [
        RANDOM.standard_normal(1001),
        np.round(RANDOM.standard_normal(1000), 1),
        np.zeros(50),
        np.arange(200.0),
        np.arange(200.0)[::-1],
        np.tile([1.0, 0.0], 90),
        np.array([3.0]),
        np.array([2.0, 1.0]),
    ],
)
def test_a_rank_is_that_of_the_sorted_values(values) -> None:
    order = np.sort(values)
    for rank in {0, len(values) // 50, len(values) // 2, len(values) - 1}:
        parted = values.copy()
        assert compiled_core().rank(parted, rank) == order[rank]
        assert np.array_equal(np.sort(parted), order)
        assert not rank or parted[:rank].max() <= order[rank]


@pytest.mark.parametrize("n", [5, 6, 7, 500, 501])
def test_noise_is_the_median_of_fifth_differences(n: int) -> None:
    values = RANDOM.standard_normal(n)
    expected = (
        np.median(np.abs(np.diff(values, 5))) / (0.6745 * np.sqrt(252.0)) if n > 5 else np.nan
    )
    assert noise_of(values) == pytest.approx(expected, rel=1e-15, nan_ok=True)


def test_a_spike_is_found_in_values_that_lie_apart_in_memory() -> None:
    both = np.zeros((100, 2))
    both[:, 0] = np.sin(np.arange(100) / 9.0)
    both[50, 0] += 1.0
    channel = Channel("displacement", "mm", 1e3, both[:, 0], both[:, 1], np.arange(100.0))
    assert find_spikes(channel, 2.0, noise=0.0).tolist() == [50]


def test_a_sharp_step_is_summed_as_sample_by_sample() -> None:
    lag = np.round(RANDOM.uniform(-0.02, 0.02, 300), 4)  # some on a delay, some twice
    side = _without_smooth(*_in_order(lag, RANDOM.standard_normal(300)), kink=1e-3)
    delays = np.arange(-0.01, 0.0101, 5e-4).round(4)
    power, along = _steps(side, delays, 0.0)
    step = np.sign(side.lag[:, np.newaxis] - delays)
    assert np.array_equal(power, np.sum(step**2, axis=0))
    assert np.allclose(along, side.columns.T @ step, rtol=0.0, atol=1e-11)
    assert np.allclose(side.columns[:, :-1].T @ side.columns[:, -1], 0.0, atol=1e-12)


@pytest.mark.parametrize("wave", [np.sin, lambda a: np.arcsin(np.sin(a)), lambda a: np.sin(a) ** 3])
def test_branches_are_those_of_a_fit_on_the_columns_themselves(wave) -> None:
    angle = np.linspace(0.0, 60.0, 5000)
    x = wave(angle)
    v = apply_filter(design_filter("zero_phase", 30.0, sample_rate=500.0), np.gradient(x))
    f = 300.0 * np.sign(v) + 1e4 * v + 40.0 * x + 5.0 + RANDOM.standard_normal(len(v))
    u = v / np.abs(v).max()
    out, into = np.maximum(u, 0.0), np.minimum(u, 0.0)
    columns = [np.ones_like(u), x / np.ptp(x), np.sign(u), out, into, out**2, into**2]
    best = np.linalg.lstsq(np.stack(columns, axis=-1), f, rcond=None)[0]
    assert _branches(x, v, f) == pytest.approx((best[0], best[5], -best[6]), rel=1e-7, abs=1e-6)


@pytest.mark.parametrize("rows", [2, 3, 4, 5])
def test_signals_side_by_side_are_filtered_as_each_alone(rows: int) -> None:
    design = design_filter("zero_phase", 30.0, sample_rate=500.0)
    signals = RANDOM.standard_normal((rows, 400))
    alone = np.stack([apply_filter(design, one) for one in signals])
    assert np.array_equal(apply_filter(design, signals), alone)


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("crossings", (np.ones(9), np.ones(8), np.ones(9), 0.1)),
        ("crossings", (np.ones(9), np.ones(9), np.ones(4), 0.1)),
        ("tops", (np.ones(1), np.ones(1), np.ones(2), np.ones(1))),
        ("tops", (np.ones(9), np.ones(8), np.ones(2), np.ones(1))),
        ("tops", (np.ones(9), np.ones(9), np.ones(2), np.ones(2))),
        ("turns", (np.ones(9), np.ones(8, np.int64), 0.1)),
        ("passages", (np.ones(9), np.array([1, 9]), np.ones(1))),
        ("passages", (np.ones(9), np.array([-1, 3]), np.ones(1))),
        ("passages", (np.ones(9), np.array([3, 3]), np.ones(1))),
        ("passages", (np.ones(9), np.array([1, 3]), np.ones(2))),
        ("passages", (np.ones(9), np.empty(0, np.int64), np.empty(0))),
        ("fold", (np.ones(3), np.ones(2), np.ones(2), np.ones(2), np.ones(4), 1)),
        ("fold", (np.ones(9), np.ones(2), np.ones(2), np.ones(3), np.ones(4), 1)),
        ("fold", (np.ones(9), np.ones(2), np.ones(2), np.ones(4), np.ones(4), 2)),
        ("fold", (np.ones(9), np.ones(2), np.ones(2), np.ones(2), np.ones(3), 1)),
        ("fold", (np.ones(9), np.ones(2), np.ones(2), np.ones(2), np.ones(4), 0)),
        ("fold", (np.ones(9), np.ones(0), np.ones(2), np.ones(0), np.ones(4), 1)),
        ("outstanding", (np.ones(9), np.ones(8))),
        ("rank", (np.ones(9), 9)),
        ("rank", (np.ones(9), -1)),
        ("harmonics", (np.ones(0), np.ones(2), 0.0, 0.1)),
        ("harmonics", (np.ones(9), np.ones(17), 0.0, 0.1)),
    ],
)
def test_buffers_of_another_size_are_refused(name: str, arguments: tuple[object, ...]) -> None:
    with pytest.raises(ValueError, match=name):
        getattr(compiled_core(), name)(*arguments)
