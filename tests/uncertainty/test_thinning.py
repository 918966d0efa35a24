"""Sums over every few samples of a log beside their slow twin, those over all of them."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from damperfit.conditioning import condition, design_filter
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.identification import FitOptions, identify
from damperfit.uncertainty import assess, linearisation, thinning
from damperfit.uncertainty.correlated_noise import score_covariance
from tests.identification.rig import recording
from tests.identification.rig import trace as rig_trace
from tests.identification.test_mean_cycle import LOGS

ALL = ("r_m1", "r_m2", "r_m3", "k_e", "f_f")
SOLVER = FitOptions().solver


def seen(design: Any, *, n_cycles: int = 15) -> Any:
    return SimpleNamespace(stretches=(SimpleNamespace(n_cycles=n_cycles),), model_filter=design)


@pytest.mark.parametrize("name", ["setting 10", "drift", "causal", "two speeds", "stiff"])
def test_errors_and_diagnoses_are_those_of_all_samples(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Errors within a thousandth; their ratio to the jackknife's, told to two digits, 2 %."""
    logs = [rig_trace(20, noise=4.0, rate=1000.0)] if name == "stiff" else LOGS[name]()
    found = identify(logs, PURDY_DAMPER, FitOptions(procedure="plain", free=ALL))
    thin = assess(found, PURDY_DAMPER, solver=SOLVER)
    monkeypatch.setattr(linearisation, "stride_of", lambda *_: 1)
    whole = assess(found, PURDY_DAMPER, solver=SOLVER)
    for one in ALL:
        first, second = (each.uncertainties[0].intervals[one] for each in (thin, whole))
        assert first.error == pytest.approx(second.error, rel=1e-3), one
        assert first.cycle_ratio == pytest.approx(second.cycle_ratio, rel=2e-2)
    assert thin.sentences == whole.sentences


def test_flaws_are_told_alike(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a model that misses: what explains the misfit, and the errors that it leaves."""
    late = recording(10, noise=4.0)
    log = condition(replace(late, force=np.roll(late.force, 3)))
    held = FitOptions("plain", ("r_m1", "r_m2", "k_e"), {"r_m3": 2.597e6, "f_f": 50.0})
    found = identify([log], PURDY_DAMPER, held)
    thin = assess(found, PURDY_DAMPER, solver=SOLVER)
    monkeypatch.setattr(linearisation, "stride_of", lambda *_: 1)
    whole = assess(found, PURDY_DAMPER, solver=SOLVER)
    assert thin.diagnoses[0].is_structured
    assert thin.diagnoses[0].hints
    assert thin.sentences == whole.sentences
    for name, one in whole.uncertainties[0].intervals.items():
        other = thin.uncertainties[0].intervals[name]
        assert (other.error, other.misfit) == pytest.approx((one.error, one.misfit), rel=2e-3)


@pytest.mark.parametrize(
    ("rate", "stride"), [(200.0, 1), (698.0, 1), (706.0, 3), (1000.0, 3), (1200.0, 5), (1e4, 41)]
)
def test_so_many_samples_are_taken_as_the_band_asks_for(rate: float, stride: int) -> None:
    """A zero-phase filter of 30 Hz passes a hundredth at 59 Hz."""
    design = design_filter("zero_phase", 30.0, sample_rate=rate)
    assert thinning.stride_of(seen(design), None) == stride


def test_without_a_filter_every_sample_is_taken() -> None:
    design = design_filter("none", 30.0, sample_rate=1000.0)
    assert thinning.stride_of(seen(design), None) == 1


def test_what_has_corners_of_its_own_takes_every_sample() -> None:
    design = design_filter("zero_phase", 30.0, sample_rate=1000.0)
    assert thinning.stride_of(seen(design, n_cycles=0), None) == 1
    weight = np.array([1.0, 0.5, 2.0])
    assert thinning.stride_of(seen(design), weight) == 3
    assert thinning.stride_of(seen(design), np.array([1.0, 0.0, 2.0])) == 1


@pytest.mark.parametrize("lag", [0, 9, 20, 40])
def test_a_covariance_of_every_third_score_is_that_of_all(lag: int) -> None:
    """Of scores as slow as two signals behind the filter make them."""
    random = np.random.default_rng(7)
    time = np.arange(8001) / 1000.0
    tones = [
        np.sin(2.0 * np.pi * f * time + random.uniform(0.0, 6.0)) for f in np.arange(1.5, 58.0, 1.7)
    ]
    scores = np.stack([random.standard_normal(len(tones)) @ tones for _ in range(3)], axis=1)
    whole, thin = score_covariance(scores, lag), score_covariance(3.0 * scores[1::3], lag, stride=3)
    size = np.sqrt(np.outer(np.diag(whole), np.diag(whole)))
    assert np.all(np.abs(thin - whole) < 2e-3 * size)
