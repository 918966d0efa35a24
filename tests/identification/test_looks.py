"""Points far from the last are looked at on fewer samples; a descent ends where all count."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from damperfit.damper.purdy.reference import reference_parameters
from damperfit.identification import descent
from damperfit.identification.evaluation import evaluate
from damperfit.identification.looks import Looks
from damperfit.identification.settled import settled
from tests.identification.rig import trace
from tests.identification.test_mean_cycle import ALL, THREE, misfit, on_cycles

TRUTH = reference_parameters(10)


@pytest.mark.parametrize(("change", "is_rough"), [(0.098, False), (0.102, True)])
def test_a_step_of_a_tenth_ends_far_away(*, change: float, is_rough: bool) -> None:
    look = Looks(on_cycles(misfit([trace(10, noise=4.0)])), THREE, TRUTH)
    values = np.array([getattr(TRUTH, name) for name in THREE])
    assert not look(values)[2].is_rough
    values[2] *= math.exp(-change)
    assert look(values)[2].is_rough is is_rough
    assert not look(values)[2].is_rough


def test_each_step_on_the_logs_themselves_is_looked_at_closely() -> None:
    look = Looks(misfit([trace(10, noise=4.0, duration=4.0)]), THREE, TRUTH)
    values = np.array([getattr(TRUTH, name) for name in THREE])
    assert not look(values)[2].is_rough
    assert not look(0.5 * values)[2].is_rough


@pytest.mark.parametrize(
    ("rate", "nth"),
    [
        (1000.0, 4),  # of 720 samples 180
        (768.0, 4),  # of 512 just 128
        (756.0, 2),  # of 504 no fourth part is enough
        (384.0, 2),  # of 256 just 128
        (378.0, None),  # 252
        (771.0, None),  # of 514 the half is no even number
    ],
)
def test_a_look_from_afar_has_128_samples_of_a_cycle(rate: float, nth: int | None) -> None:
    log = trace(10, noise=4.0, rate=rate)
    cycles = settled([log], is_thinned=False)
    assert cycles is not None
    seen = cycles.from_afar
    n = len(cycles.cycles[0].force)
    assert (None if seen is None else n // len(seen.cycles[0].force)) == nth


def test_from_afar_the_sum_of_squares_and_its_slopes_are_nearly_the_same() -> None:
    near = on_cycles(misfit([trace(10, noise=4.0)], ALL))
    assert near.cycles is not None
    far = replace(near, cycles=near.cycles.from_afar)
    at = TRUTH.replace({"r_m1": 2.6e4, "f_f": 80.0})
    close, slopes, _ = evaluate(near, at, 1.0)
    rough, few, _ = evaluate(far, at, 1.0)
    assert len(rough) < 0.3 * len(close)
    assert rough @ rough == pytest.approx(close @ close, rel=2e-3)
    assert few.T @ rough == pytest.approx(slopes.T @ close, rel=1e-2)


def test_an_end_that_was_seen_roughly_is_looked_at_closely(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Where each step counts as far every look but the first is rough; the end is none."""
    whole = on_cycles(misfit([trace(10, noise=4.0)]))
    start = TRUTH.replace({name: 1.5 * getattr(TRUTH, name) for name in THREE})
    close = descent._minimise(whole, start)
    monkeypatch.setattr("damperfit.identification.looks._FAR", 0.0)
    rough = descent._minimise(whole, start)
    assert rough.jacobian.shape == close.jacobian.shape
    assert rough.mse_percent == pytest.approx(close.mse_percent, rel=1e-6)
    assert rough.evaluations > close.evaluations
    for name in THREE:  # a fiftieth of an error of K_e
        assert getattr(rough.parameters, name) == pytest.approx(
            getattr(close.parameters, name), rel=3e-5
        )
