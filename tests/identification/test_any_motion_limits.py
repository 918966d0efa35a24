"""What logs of one speed are, and when stretches are weighed: just inside and just outside."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.identification.fit_facts import FitFacts
from damperfit.identification.one_speed import _NEAR, _SHARE, holds_one_speed, inseparable
from damperfit.identification.weights import _ALIKE, _OTHER_ERRORS, weights

ALL = ("r_m1", "r_m2", "k_e", "f_f")


def trace_of_speeds(share_of_one_speed: float) -> Any:
    n = 1000
    speed = np.full(n, 0.2)
    speed[round(share_of_one_speed * n) :] = 0.05
    speed[::2] *= -1.0
    return SimpleNamespace(drive=SimpleNamespace(velocity=speed), compared=slice(None))


@pytest.mark.parametrize(("share", "told"), [(0.89, ()), (0.91, ALL)])
def test_nine_tenths_at_one_speed_are_one_speed(share: float, told: tuple[str, ...]) -> None:
    assert inseparable(FitFacts((trace_of_speeds(share),)), ALL, PURDY_DAMPER.quantities) == told


@pytest.mark.parametrize(("off", "told"), [(1.096, ALL), (1.104, ())])
def test_speeds_within_a_tenth_are_one(off: float, told: tuple[str, ...]) -> None:
    trace = trace_of_speeds(1.0)
    trace.drive.velocity[:200] *= off
    assert inseparable(FitFacts((trace,)), ALL, PURDY_DAMPER.quantities) == told


def _by_the_median(speed: np.ndarray) -> bool:
    usual = float(np.median(speed))
    return float(np.mean(np.abs(speed - usual) <= _NEAR * usual)) > _SHARE


def test_what_needs_no_median_is_what_the_median_says() -> None:
    rng = np.random.default_rng(5)
    said = []
    for _ in range(400):
        n = int(rng.integers(1, 300))
        share, width = rng.choice([0.2, 0.8, 0.89, 0.9, 0.91, 1.0]), rng.choice([0.0, 0.12, 0.3])
        speed = 0.2 * (1.0 + width * rng.uniform(-1.0, 1.0, n))
        others = rng.random(n) > share
        speed[others] = rng.uniform(*sorted(rng.uniform(0.0, 0.6, 2)), n)[others]
        trace = SimpleNamespace(drive=SimpleNamespace(velocity=-speed), compared=slice(None))
        said.append(holds_one_speed([trace]))
        assert said[-1] == _by_the_median(speed)
    assert 50 < sum(said) < 350


def test_valves_of_one_direction_each_are_told_by_one_speed() -> None:
    facts = FitFacts((trace_of_speeds(1.0),))
    assert inseparable(facts, ("r_m1", "k_e", "f_f"), PURDY_DAMPER.quantities) == ()


def two_stretches(noise: float) -> Any:
    stretches = [SimpleNamespace(noise=one, n_samples=500) for one in (noise, 40.0)]
    force = np.concatenate([np.full(500, 100.0), np.full(500, -100.0)])
    v = np.ones(1000)  # one array: the drive is as it is compared
    return SimpleNamespace(
        force=force,
        compared=slice(None),
        stretches=stretches,
        velocity=v,
        drive=SimpleNamespace(velocity=v),
    )


@pytest.mark.parametrize(("factor", "n_weighed"), [(0.99, 0), (1.01, 1000)])
def test_noises_alike_are_not_weighed(factor: float, n_weighed: int) -> None:
    other = _OTHER_ERRORS * 100.0
    noise = float(np.sqrt((np.hypot(40.0, other) * _ALIKE * factor) ** 2 - other**2))
    (found,) = weights([two_stretches(noise)])
    assert (0 if found is None else len(found)) == n_weighed
    if found is not None:
        louder, quieter = found[0], found[-1]
        assert quieter / louder == pytest.approx(_ALIKE * factor, rel=1e-9)
