"""Sums over some phases of each cycle beside their slow twin, those over all samples."""

from __future__ import annotations

import math
import tracemalloc
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from damperfit.conditioning import apply_filter, condition, design_filter
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.identification import FitOptions, identify
from damperfit.identification.mean_cycle import settled
from damperfit.simulation import simulate
from damperfit.uncertainty import assess, linearisation
from damperfit.uncertainty.correlated_noise import (
    correlation_length,
    repeated_covariance,
    score_covariance,
)
from damperfit.uncertainty.intervals import linearise_settings
from damperfit.uncertainty.residuals import diagnose
from damperfit.uncertainty.rows import EverySample, Phases, phases_of
from tests.identification.rig import recording
from tests.identification.rig import trace as rig_trace
from tests.identification.test_mean_cycle import LOGS, filtered_in_the_rig

ALL = ("r_m1", "r_m2", "r_m3", "k_e", "f_f")
SOLVER = FitOptions().solver


def every_sample(_: Any, stretch: Any, __: Any, **more: Any) -> EverySample:
    del more
    return EverySample(stretch)


@pytest.mark.parametrize("name", ["setting 10", "drift", "causal", "two speeds", "stiff"])
def test_errors_and_diagnoses_are_those_of_all_samples(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Errors within four thousandths; their ratio to the jackknife's, told to two digits, 2 %."""
    logs = [rig_trace(20, noise=4.0, rate=1000.0)] if name == "stiff" else LOGS[name]()
    found = identify(logs, PURDY_DAMPER, FitOptions(procedure="plain", free=ALL))
    few = assess(found, PURDY_DAMPER, solver=SOLVER)
    monkeypatch.setattr(linearisation, "phases_of", every_sample)
    whole = assess(found, PURDY_DAMPER, solver=SOLVER)
    for one in ALL:
        first, second = (each.uncertainties[0].intervals[one] for each in (few, whole))
        assert first.error == pytest.approx(second.error, rel=4e-3), one
        assert first.error != second.error
        assert first.cycle_ratio == pytest.approx(second.cycle_ratio, rel=2e-2)
    assert few.sentences == whole.sentences


def test_flaws_are_told_alike(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a model that misses: what explains the misfit, and the errors that it leaves."""
    late = recording(10, noise=4.0)
    log = condition(replace(late, force=np.roll(late.force, 3)))
    held = FitOptions("plain", ("r_m1", "r_m2", "k_e"), {"r_m3": 2.597e6, "f_f": 50.0})
    found = identify([log], PURDY_DAMPER, held)
    few = assess(found, PURDY_DAMPER, solver=SOLVER)
    monkeypatch.setattr(linearisation, "phases_of", every_sample)
    whole = assess(found, PURDY_DAMPER, solver=SOLVER)
    assert few.diagnoses[0].is_structured
    assert few.diagnoses[0].hints
    assert few.sentences == whole.sentences
    for name, one in whole.uncertainties[0].intervals.items():
        other = few.uncertainties[0].intervals[name]
        assert (other.error, other.misfit) == pytest.approx((one.error, one.misfit), rel=4e-3)


def test_a_flaw_explains_as_much_where_one_log_takes_every_sample(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A cycle of a log of 250 Hz has fewer samples than it would have phases."""
    fast, slow = recording(10, noise=1.0), recording(10, noise=1.0, amplitude=0.02, rate=250.0)
    late = [
        condition(replace(log, force=np.roll(log.force, by)))
        for log, by in ((fast, 4), (replace(slow, name="slow.csv"), 1))
    ]
    held = FitOptions("plain", ("r_m1", "r_m2", "k_e"), {"r_m3": 2.597e6, "f_f": 50.0})
    found = identify(late, PURDY_DAMPER, held)
    (few,) = linearise_settings(found, PURDY_DAMPER, solver=SOLVER)
    kinds = [type(one.rows) for log in few.logs for one in log.slopes]
    assert kinds == [Phases, EverySample]
    monkeypatch.setattr(linearisation, "phases_of", every_sample)
    (whole,) = linearise_settings(found, PURDY_DAMPER, solver=SOLVER)
    first, second = (diagnose(one).hints[0] for one in (few, whole))
    assert first.name == second.name
    assert (first.share, first.amount) == pytest.approx((second.share, second.amount), rel=5e-3)


def rows_of(
    rate: float,
    *,
    period: float = 1.0 / 1.5,
    corner: float | None = 30.0,
    weight: Any = None,
    beyond: float = 0.0,
    is_filtered_by_rig: bool = True,
) -> EverySample | Phases:
    """Where sums are taken over three cycles of a log, with a share of residuals beyond 59 Hz."""
    wanted = "none" if corner is None else "zero_phase"
    log: Any = SimpleNamespace(
        model_filter=design_filter(wanted, corner or 30.0, sample_rate=rate),
        is_filtered_by_rig=is_filtered_by_rig,
    )
    samples = period * rate
    stretch: Any = SimpleNamespace(n_samples=round(3 * samples), n_cycles=3, first=7)
    starts = 7.0 + samples * np.arange(4.0)
    cycle: Any = SimpleNamespace(force=np.empty(2 * round(0.5 * samples)), starts=starts)
    time = np.arange(stretch.n_samples) / rate
    low, high = (np.sin(2.0 * np.pi * hertz * time) for hertz in (6.0, 72.0))
    residuals = math.sqrt(1.0 - beyond) * low + math.sqrt(beyond) * high
    return phases_of(log, stretch, cycle, weight=weight, residuals=residuals)


@pytest.mark.parametrize(
    ("rate", "phases"), [(285.0, None), (290.0, 192), (500.0, 192), (1e3, 208), (1e4, 208)]
)
def test_so_many_phases_are_taken_as_the_band_asks_for(rate: float, phases: int | None) -> None:
    """A zero-phase filter of 30 Hz passes a hundredth at 59 Hz, 39 harmonics of 1.5 Hz."""
    rows = rows_of(rate)
    assert (rows.at.shape if isinstance(rows, Phases) else None) == (phases and (3, phases))
    if isinstance(rows, Phases):
        assert rows.n_cycles * phases * rows.spacing == pytest.approx(3 * rate / 1.5, rel=1e-3)


def test_a_short_cycle_has_phases_for_its_blocks() -> None:
    rows = rows_of(1e3, period=0.2)
    assert isinstance(rows, Phases)
    assert rows.at.shape == (3, 128)
    assert isinstance(rows_of(1e3, period=0.12), EverySample)


def test_phases_lie_in_the_middle_of_parts_of_their_cycles() -> None:
    rows = rows_of(1e3)
    assert isinstance(rows, Phases)
    parts = (np.arange(208) + 0.5) / 208.0
    assert rows.at == pytest.approx(2000.0 / 3.0 * (np.arange(3.0)[:, None] + parts))
    straight = np.arange(2000.0)
    assert rows.read(straight) == pytest.approx(rows.at, rel=1e-12)


def test_without_a_filter_every_sample_is_taken() -> None:
    assert isinstance(rows_of(1e3, corner=None), EverySample)


def test_what_has_corners_of_its_own_takes_every_sample() -> None:
    assert isinstance(rows_of(1e3, weight=np.array([1.0, 1.0, 1.0])), Phases)
    assert isinstance(rows_of(1e3, weight=np.array([1.0, 0.0, 2.0])), EverySample)


@pytest.mark.parametrize(("beyond", "kind"), [(0.0095, Phases), (0.0105, EverySample)])
def test_residuals_with_a_hundredth_beyond_the_band_take_every_sample(
    beyond: float, kind: type
) -> None:
    assert isinstance(rows_of(1e3, beyond=beyond), kind)
    # What our own filter has passed need not be looked at.
    assert isinstance(rows_of(1e3, beyond=beyond, is_filtered_by_rig=False), Phases)


@pytest.mark.parametrize(("after", "kind"), [(0.0, Phases), (2.0, EverySample)])
def test_a_log_with_noise_behind_the_filter_of_the_rig_takes_every_sample(
    after: float, kind: type
) -> None:
    """Its errors were too large by up to a third, as those of what is missed between phases."""
    log = filtered_in_the_rig("zero_phase")
    noise = after * np.random.default_rng(5).standard_normal(len(log.force))
    held = FitOptions(procedure="plain", free=ALL)
    found = identify([replace(log, force=log.force + noise)], PURDY_DAMPER, held)
    (told,) = linearise_settings(found, PURDY_DAMPER, solver=SOLVER)
    assert isinstance(told.logs[0].slopes[0].rows, kind)


@pytest.mark.parametrize(("share", "n"), [(0.995, 208), (1.005, 224)])
def test_the_band_ends_where_a_hundredth_passes(share: float, n: int) -> None:
    """Of two passes of 4th order, which together have 3 dB at 30 Hz; five phases a period."""
    hertz = 30.0 * (99.0 / (2.0**0.5 - 1.0)) ** 0.125
    rows = rows_of(1e5, period=share * 208.0 / (5.0 * hertz))
    assert isinstance(rows, Phases)
    assert rows.at.shape == (3, n)


@pytest.mark.parametrize(("cut", "kind"), [(1.4, Phases), (1.6, EverySample)])
@pytest.mark.parametrize("end", ["first", "last"])
def test_cycles_that_are_cut_take_every_sample(cut: float, kind: type, end: str) -> None:
    log: Any = SimpleNamespace(
        model_filter=design_filter("zero_phase", 30.0, sample_rate=1e3), is_filtered_by_rig=False
    )
    stretch: Any = SimpleNamespace(n_samples=1998, n_cycles=3, first=0)
    starts = 666.0 * np.arange(4.0)
    starts[0 if end == "first" else -1] += -cut if end == "first" else cut
    cycle: Any = SimpleNamespace(force=np.empty(666), starts=starts)
    found = phases_of(log, stretch, cycle, weight=None, residuals=np.zeros(1998))
    assert isinstance(found, kind)


@pytest.mark.parametrize("name", ["whole cycles", "setting 10"])
@pytest.mark.parametrize("n", [200, 400])
def test_signals_at_phases_are_those_at_all_samples(name: str, n: int) -> None:
    (log,) = LOGS[name]()
    found = settled([log], is_thinned=False)
    assert found is not None
    (cycle,) = found.cycles
    values = reference_parameters(10)
    response = simulate(values, PURDY_DAMPER, cycle.motion, options=cycle.solver(SOLVER))
    stretch = log.fastest
    middles = (np.arange(n) + 0.5) / n
    at = cycle.starts[:-1, None] - stretch.first + np.diff(cycle.starts)[:, None] * middles
    rows = Phases(stretch, at)
    few = rows.seen(cycle, [response.force])[0]
    whole = cycle.over(stretch, [response.force])[0]
    assert rows.read(whole)[1:-1] == pytest.approx(
        np.tile(few, (len(at) - 2, 1)), abs=2e-4 * float(np.ptp(few))
    )


def banded(n: int, columns: int, *, period: int | None = None, seed: int = 7) -> np.ndarray:
    """Signals behind a filter of 30 Hz at 1 kHz, (n, columns); of that period."""
    random = np.random.default_rng(seed)
    time = np.arange(n) / 1000.0
    step = 1000.0 / period if period else 1.7
    tones = [
        np.sin(2.0 * np.pi * f * time + random.uniform(0.0, 6.0))
        for f in np.arange(step, 58.0, step)
    ]
    return np.stack([random.standard_normal(len(tones)) @ tones for _ in range(columns)], axis=1)


@pytest.mark.parametrize("lag", [0, 9, 20, 40, 150, 300])
def test_the_covariance_of_repeated_slopes_is_that_of_all_scores(lag: int) -> None:
    """Every third sample of cycles of 600, beside all of them."""
    slopes, residuals = banded(600, 3, period=600), banded(7200, 1, seed=8)[:, 0]
    whole = score_covariance(np.tile(slopes, (12, 1)) * residuals[:, None], lag)
    few = repeated_covariance(residuals[1::3].reshape(12, 200), slopes[1::3], lag, spacing=3.0)
    size = np.sqrt(np.outer(np.diag(whole), np.diag(whole)))
    assert np.all(np.abs(few - whole) < 2e-3 * size)


def test_long_correlation_of_slow_cycles_takes_little_memory() -> None:
    """Cycles of 10 s at 10 kHz: 25 000 lags, a thirtieth of them known, were a table of 150 MB.

    It was made of gigabytes; of a misfit that repeats, whose correlation has no end, more yet.
    """
    residuals = np.tile(banded(2960, 1)[:, 0], (3, 1))
    tracemalloc.start()
    lag = correlation_length(residuals.ravel(), longest=25_000, spacing=33.8)
    found = repeated_covariance(residuals, np.ones((2960, 1)), lag, spacing=33.8)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert lag == 25_000
    assert found > 0.0
    assert peak < 1e8


@pytest.mark.parametrize("spacing", [3.0, 10.0 / 3.0])
def test_a_correlation_length_is_found_between_the_residuals(spacing: float) -> None:
    """Of noise behind 30 Hz, seen at each sample and at every few."""
    design = design_filter("zero_phase", 30.0, sample_rate=1e3)
    noise = apply_filter(design, np.random.default_rng(3).standard_normal(10000))
    at = np.arange(0.0, 9999.0, spacing)
    few = np.interp(at, np.arange(10000.0), noise)
    whole = correlation_length(noise, longest=160)
    assert whole > 10
    assert correlation_length(few, longest=160, spacing=spacing) == pytest.approx(whole, abs=1)
