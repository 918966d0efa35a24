"""What logs of one speed are, and when stretches are weighed: just inside and just outside."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.identification.fit_facts import FitFacts
from damperfit.identification.one_speed import (
    _NEAR,
    _SHARE,
    holds_one_speed,
    inseparable,
    n_speeds,
    said_of_speeds,
)
from damperfit.identification.weights import _ALIKE, _OTHER_ERRORS, weights
from tests.laws.valve_logs import damper

ALL = ("r_m1", "r_m2", "k_e", "f_f")
VALVES = damper(has_play_and_lag=False)


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


def trace_of_triangles(*speeds: float, share: float = 1.0) -> Any:
    """A stretch at each speed, of which a share is at another."""
    each = [np.tile([speed, -speed], 500) for speed in speeds]
    each[0][round(share * 1000) :] *= 0.3
    stretches = [SimpleNamespace(window=slice(1000 * k, 1000 * k + 1000)) for k in range(len(each))]
    velocity = np.concatenate(each)
    drive = SimpleNamespace(velocity=velocity)
    return SimpleNamespace(drive=drive, stretches=stretches, compared=slice(None))


@pytest.mark.parametrize(
    ("speeds", "share", "held"),
    [
        ((0.05, 0.13, 0.26), 1.0, 3),
        ((0.1, 0.109), 1.0, 1),
        ((0.1, 0.111), 1.0, 2),
        ((0.05, 0.13), 0.91, 2),
        ((0.05, 0.13), 0.89, None),
    ],
)
def test_speeds_are_counted_that_stretches_hold(speeds, share, held) -> None:
    assert n_speeds([trace_of_triangles(*speeds, share=share)]) == held
    assert n_speeds([trace_of_triangles(one, share=share) for one in speeds]) == held


EIGHT = (
    *("rebound_bleed", "rebound_opening", "rebound_slope", "compression_bleed"),
    *("compression_opening", "compression_slope", "f_f", "f_0"),
)


@pytest.mark.parametrize(
    ("speeds", "free", "said"),
    [
        ((0.05, 0.13, 0.26), EIGHT, "the logs hold 3 speeds: their 6 levels of force do not"),
        ((0.02, 0.05, 0.13, 0.26), EIGHT, None),
        ((0.05, 0.13, 0.26), EIGHT[2:], None),
        ((0.05, 0.13), (*EIGHT[:4], "k_e", "k_s"), None),
        ((0.05, 0.13), EIGHT[:5], "the logs hold 2 speeds: their 4 levels of force do not"),
    ],
)
def test_fewer_levels_than_numbers_do_not_determine_them(speeds, free, said) -> None:
    facts = FitFacts(tuple(trace_of_triangles(one) for one in speeds))
    found = said_of_speeds(facts, free, VALVES.quantities)
    assert len(found) == (said is not None)
    assert said is None or found[0].startswith(said)
    assert said is None or f"{len(free)} numbers of valves, friction and offset" in found[0]


def test_a_sine_is_said_nothing_of() -> None:
    sine = 0.3 * np.cos(np.linspace(0.0, 40.0, 1000))
    trace = trace_of_triangles(0.1)
    trace.drive.velocity = sine
    assert said_of_speeds(FitFacts((trace,)), EIGHT, VALVES.quantities) == ()


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
