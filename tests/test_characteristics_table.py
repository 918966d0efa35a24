"""The table of characteristics: known loops, with and without gas, by stretch and speed."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from damperfit.tables.files import lay_out
from damperfit.tables.rows import characteristic_rows
from tests.fakes import trace

SPEED = 0.032 * 2 * math.pi * 1.5  # peak of the synthetic log, m/s
GAS = -130.0


def rows_of(log, force=None, *, gas=GAS):
    """Rows of a log whose model says ``force``, by point and speed."""
    damper = SimpleNamespace(
        rest_force=lambda x: None if gas is None else np.full_like(x, gas, dtype=np.float64)
    )
    seen = SimpleNamespace(force=log.force if force is None else force)
    return list(characteristic_rows(7, log, seen, damper))


def test_peaks_and_named_speeds_of_a_viscous_damper_are_known() -> None:
    log = trace(7)
    peak, *named = rows_of(log, 0.9 * 2500.0 * log.velocity + GAS)
    assert peak["point"] == "peak"
    assert peak["speed_rebound_m_per_s"] == pytest.approx(SPEED, rel=1e-4)
    assert peak["measured_rebound_N"] == pytest.approx(2500.0 * SPEED + GAS, rel=1e-3)
    assert peak["measured_bump_N"] == pytest.approx(-2500.0 * SPEED + GAS, rel=1e-3)
    assert peak["measured_rebound_without_gas_N"] == pytest.approx(2500.0 * SPEED, rel=1e-3)
    assert peak["simulated_bump_without_gas_N"] == pytest.approx(-2250.0 * SPEED, rel=1e-3)
    assert peak["measured_ratio_without_gas"] == pytest.approx(1.0, rel=1e-3)
    # The stretch is 333 of the 333.3 samples of a cycle.
    assert peak["measured_energy_J"] == pytest.approx(math.pi * 2500.0 * SPEED * 0.032, rel=2e-3)
    assert [row["speed_rebound_m_per_s"] for row in named] == [0.05, 0.1, 0.13, 0.26, 0.3]
    at = named[1]
    assert at["measured_rebound_N"] == pytest.approx(250.0 + GAS)
    assert at["measured_bump_N"] == pytest.approx(-250.0 + GAS)
    assert at["measured_ratio"] == pytest.approx((250.0 + GAS) / (250.0 - GAS))
    assert at["simulated_rebound_without_gas_N"] == pytest.approx(225.0)
    assert at["measured_hysteresis_rebound_N"] == pytest.approx(0.0, abs=1e-9)
    assert at.get("measured_energy_J") is None
    assert {row["mean_gas_force_N"] for row in (peak, *named)} == {GAS}
    assert {row["temperature_degC"] for row in (peak, *named)} == {26.0}


def test_hysteresis_is_opening_less_closing_force_in_both_strokes() -> None:
    log = trace(7)
    acceleration = np.gradient(log.velocity, log.interval)
    peak, *named = rows_of(replace(log, force=2500.0 * log.velocity + 10.0 * acceleration))
    omega = 2 * math.pi * 1.5
    there = 10.0 * omega * math.sqrt(SPEED**2 - peak["hysteresis_speed_m_per_s"] ** 2)
    # Opening: speed rises; in bump the acceleration is then downwards.
    assert peak["measured_hysteresis_rebound_N"] == pytest.approx(2.0 * there, rel=1e-3)
    assert peak["measured_hysteresis_bump_N"] == pytest.approx(-2.0 * there, rel=1e-3)
    for row in named[:4]:
        there = 10.0 * omega * math.sqrt(SPEED**2 - row["speed_rebound_m_per_s"] ** 2)
        assert row["measured_hysteresis_rebound_N"] == pytest.approx(2.0 * there, rel=1e-2)
        assert row["measured_hysteresis_bump_N"] == pytest.approx(-2.0 * there, rel=1e-2)


def test_at_a_speed_where_the_gas_pushes_both_strokes_down_there_is_no_ratio() -> None:
    slow = rows_of(trace(7))[1]
    assert slow["speed_rebound_m_per_s"] == 0.05
    assert slow["measured_rebound_N"] < 0.0
    assert slow["measured_ratio"] is None
    assert slow["measured_ratio_without_gas"] == pytest.approx(1.0)


def test_a_model_without_gas_leaves_the_cells_empty() -> None:
    table = lay_out("characteristics", rows_of(trace(7), gas=None), settings=[7])
    first = table.to_pylist()[0]
    assert first["measured_rebound_N"] > 0.0
    without = [name for name in table.column_names if "without_gas" in name or "mean_gas" in name]
    assert len(without) == 7
    assert all(first[name] is None for name in without)


def test_motion_that_does_not_repeat_has_its_extremes_and_no_hysteresis() -> None:
    log = trace(7)
    moving = replace(log.stretches[0], kind="moving", cycle_starts=np.empty(0), first=300)
    both = replace(log, stretches=(moving, replace(log.stretches[0], first=667, stop=999)))
    rows = rows_of(both)
    assert [(row["stretch"], row["point"]) for row in rows if row["kind"] == "moving"] == [
        (1, "peak")
    ]
    assert np.isnan(rows[0]["measured_hysteresis_rebound_N"])
    assert rows[0]["cycles"] == 0
    assert rows[1]["stretch"] == 2
    assert rows[1]["start_s"] == pytest.approx(10.0 + 667 / 500.0)
